"""What looks wrong with a record, the most serious first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr
from scipy.special import ndtri

from tactile_bayes.arrays import Flags
from tactile_bayes.diagnostics.findings import Finding, counted, joined, listed, of_sweeps, quantity
from tactile_bayes.diagnostics.inspection.corrections import OTHER_ANGLE
from tactile_bayes.diagnostics.inspection.fit import Fit
from tactile_bayes.diagnostics.zeros import NOISE_FACTOR, OFF_ZERO, moved_zero, zero_off
from tactile_bayes.inference.misfit import CHECK_RIG
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import CHANNELS, present_channels, rod_of
from tactile_bayes.record.origin import column_entry
from tactile_bayes.record.rig_entry import rig_entries, rig_entry
from tactile_bayes.rig.parameters import PARAMETERS

# Share of loaded samples without a fitting contact above which it is reported: a rod 10 % stiffer than stated stays
# below it at the usual noise.
UNFIT = 0.25
_FAR = 3.0  # standard deviations of a bias's prior beyond which `check` would report the bias
_CORRELATED = 0.2  # autocorrelation of neighbours below which noise counts as white
_FEWEST_IN_CONTACT = 10
_DRIFT = rig_entry("drift", "default", "unknown")
_UNITS = {"large loads", "small loads", "long lever"}


def inspection_findings(
    record: xr.Dataset,
    sweeps: xr.Dataset,
    channels: xr.Dataset,
    samples: xr.Dataset,
    of_loads: Sequence[Finding],
    fit: Fit,
    cell: LoadCell | None,
    source: str,
    false_alarm: float,
) -> tuple[Finding, ...]:
    """Return the findings of `inspect_record`; none if nothing looks wrong."""
    return (
        *([] if sweeps.contact.values.any() else [Finding("no contact")]),
        *_dead(record, sweeps),
        *_loads(of_loads, fit),
        *_cut_off(record, samples, cell),
        *_without_contact(sweeps),
        *_stuck(samples),
        *_outlying(samples, cell),
        *_zeros(record, channels, cell, source, false_alarm),
        *_noise(channels, cell, source, false_alarm),
        *_steps(samples),
        *_unfinished(sweeps),
    )


def _loads(of_loads: Sequence[Finding], fit: Fit) -> list[Finding]:
    """Report wrong units and signs, and loads that fit no contact."""
    found = list(of_loads)
    if not max(fit.share, fit.below) > UNFIT:
        return found
    if found and (not fit.correction or found[0].kind in _UNITS):  # the first finding suffices
        return found
    fits = fit.share > UNFIT
    would = "would" if fits else "would touch something above"
    advice = f"nearly all {would} if {fit.correction}" if fit.correction else CHECK_RIG
    kind, share = ("no fit", fit.share) if fits else ("below the pivot", fit.below)
    unlike = Finding(kind, share=f"{share:.0%}", loaded=fit.loaded, advice=advice)
    found.insert(0 if fit.correction.startswith(OTHER_ANGLE) else len(found), unlike)
    return found


def _dead(record: xr.Dataset, sweeps: xr.Dataset) -> list[Finding]:
    if not sweeps.contact.values.any():
        return []
    names = [name for name in present_channels(record) if np.ptp(record[name].values) == 0.0]
    return [Finding("dead channel", channel=name, entry=rig_entry("missing", [name])) for name in names]


def _of_channels(samples: xr.Dataset, flags: str) -> Iterator[tuple[Flags, dict[str, str]]]:
    """Yield the flagged samples of each channel that has some, and the words on them."""
    for index, name in enumerate(CHANNELS):
        flagged = samples[flags].values[:, index]
        if flagged.any():
            words = {"readings": counted(flagged, "reading"), "channel": name, "samples": listed(flagged)}
            yield flagged, words | {"are": "is" if np.sum(flagged) == 1 else "are"}


def _cut_off(record: xr.Dataset, samples: xr.Dataset, cell: LoadCell | None) -> list[Finding]:
    found = []
    for flagged, words in _of_channels(samples, "cut_off"):
        name = words["channel"]
        largest = float(np.abs(record[name].values[flagged]).max())
        stated = cell is not None and np.isfinite(cell.limit[CHANNELS.index(name)])
        advice = "" if stated else ": state its end in the header, or take a cell with a larger one"
        unit = str(record[name].attrs.get("units", "1"))
        found.append(Finding("cut off", largest=quantity(largest, unit), advice=advice, **words))
    return found


def _without_contact(sweeps: xr.Dataset) -> list[Finding]:
    none = [int(number) for number, found in zip(sweeps.sweep.values, sweeps.contact.values, strict=True) if not found]
    some = 0 < len(none) < sweeps.sizes["sweep"]
    return [Finding("sweep without contact", sweeps=of_sweeps(none, "show"))] if some else []


def _stuck(samples: xr.Dataset) -> list[Finding]:
    found = [Finding("stuck", **words) for _, words in _of_channels(samples, "stuck")]
    flags = samples.repeated.values
    if flags.any():
        have = "has" if np.sum(flags) == 1 else "have"
        found.append(Finding("stored twice", count=counted(flags, "sample"), have=have, samples=listed(flags)))
    return found


def _outlying(samples: xr.Dataset, cell: LoadCell | None) -> list[Finding]:
    entry = rig_entry("degrees_of_freedom", 4, "load_cell")
    advice = f"If there are more, state noise with outliers ({entry}); else remove the row."
    if cell is not None and np.isfinite(cell.degrees_of_freedom):
        advice = "The noise with outliers that is stated allows for some; else remove the row."
    return [
        Finding(
            "outlier",
            stand="stands" if words["are"] == "is" else "stand",
            their="its" if words["are"] == "is" else "their",
            advice=advice,
            **words,
        )
        for _, words in _of_channels(samples, "outlier")
    ]


def _zeros(
    record: xr.Dataset, channels: xr.Dataset, cell: LoadCell | None, source: str, false_alarm: float
) -> list[Finding]:
    found = []
    if not _drifts(cell):
        p_values = dict(zip(channels.channel.values.tolist(), channels.same_bias_p_value.values.tolist(), strict=True))
        found += moved_zero(p_values, false_alarm)
    is_stated = source in ("given", "data sheet")
    far = far_off(record, channels, cell if is_stated else None)
    if far:
        zeros = {str(row.channel.values): float(row.bias) for row in _rows(channels)}
        entries = {name: column_entry(record[name], added=-zeros[name]) for name in far}
        how = f"as the column is read: {rig_entries(entries)}" if all(entries.values()) else "from the readings"
        found.append(Finding("far zero", zeros=joined(list(far.values())), how=how))
    if not is_stated or _drifts(cell):
        return found
    off = {}
    for row in _rows(channels):
        name = str(row.channel.values)
        stated = 0.0 if cell is None else cell.bias_uncertainty[CHANNELS.index(name)]
        if name not in far:
            error = float(np.hypot(float(row.bias_uncertainty), stated))
            off[name] = float(row.bias - row.stated_bias), error, str(row.unit.values)
    advice = "infer finds it as it is (bias, one of the defaults), unless the rig says that it is known."
    return [*found, *zero_off(off, advice)]


def far_off(record: xr.Dataset, channels: xr.Dataset, cell: LoadCell | None) -> dict[str, str]:
    """Return, by channel and as text, zeros that the prior of a bias hardly allows and that no cell states."""
    rod, found = rod_of(record), {}
    for row in _rows(channels):
        name, bias = str(row.channel.values), float(row.bias)
        index = CHANNELS.index(name)
        stated, uncertain = (0.0, 0.0) if cell is None else (cell.bias[index], cell.bias_uncertainty[index])
        expected = PARAMETERS["moment_bias"].width * (rod.moment_unit if name == CHANNELS[0] else rod.force_unit)
        if abs(bias - stated) > _FAR * max(expected, uncertain):
            found[name] = f"{quantity(bias, str(row.unit.values))} of {name}"
    return found


def _noise(channels: xr.Dataset, cell: LoadCell | None, source: str, false_alarm: float) -> list[Finding]:
    if _drifts(cell):
        return []
    found = []
    level = -float(ndtri(0.5 * false_alarm / len(CHANNELS)))
    apart, alike = [], []
    for row in _rows(channels):
        name, unit = str(row.channel.values), str(row.unit.values)
        if float(row.position_p_value) < false_alarm / len(CHANNELS):
            scatter, usual = (quantity(float(row[key]), unit) for key in ("position_noise", "position_noise_expected"))
            apart.append(f"{name} ({scatter} instead of {usual})")
        elif abs(float(row.neighbour_score)) > level and abs(float(row.neighbour_correlation)) > _CORRELATED:
            alike.append(f"{name} ({float(row.neighbour_correlation):+.2f})")
    for channels_, how, advice in (
        (
            apart,
            "the means of unloaded positions scatter more than single readings explain, in",
            "Give the mean of each position as one sample",
        ),
        (alike, "unloaded neighbours are correlated in", "Filter less or sample less often"),
    ):
        if channels_:
            found.append(Finding("noise not white", how=f"{how} {joined(channels_)}", advice=advice, entry=_DRIFT))
    if source in ("given", "data sheet"):
        for row in _rows(channels):
            noise, error, expected = (float(row[name]) for name in ("noise", "noise_uncertainty", "stated_noise"))
            ratio = noise / expected if expected else np.nan
            if not 1.0 / NOISE_FACTOR <= ratio <= NOISE_FACTOR and abs(noise - expected) > OFF_ZERO * error:
                real, stated = (quantity(value, str(row.unit.values)) for value in (noise, expected))
                found.append(Finding("noise not as stated", channel=str(row.channel.values), found=real, stated=stated))
    return found


def _drifts(cell: LoadCell | None) -> bool:
    """Return True if a drift is stated, which explains a zero that moves and correlated neighbours."""
    return cell is not None and cell.drift is not None


def _steps(samples: xr.Dataset) -> list[Finding]:
    flags = samples.uneven_step.values
    if not flags.any():
        return []
    differ = "differs" if np.sum(flags) == 1 else "differ"
    return [Finding("uneven steps", steps=counted(flags, "step"), differ=differ, samples=listed(flags))]


def _unfinished(sweeps: xr.Dataset) -> list[Finding]:
    contact = sweeps.contact.values
    event = {"begin": "onset_drive_angle", "end": "snap_off_drive_angle"}
    inside = {
        verb: contact & np.isnan(sweeps[name].sel(side=["before", "after"]).values).all(axis=-1)
        for verb, name in event.items()
    }
    few = contact & (sweeps.samples.values - sweeps.unloaded.values < _FEWEST_IN_CONTACT)
    return [
        Finding(kind, sweeps=of_sweeps(sweeps.sweep.values[flags].tolist(), verb), fewest=_FEWEST_IN_CONTACT)
        for kind, verb, flags in (
            ("begins in contact", "begin", inside["begin"]),
            ("ends in contact", "end", inside["end"]),
            ("few samples", "show", few),
        )
        if flags.any()
    ]


def _rows(channels: xr.Dataset) -> list[xr.Dataset]:
    """Return the rows of the channels that are present."""
    return [channels.isel(channel=i) for i in np.flatnonzero(np.isfinite(channels.largest.values))]
