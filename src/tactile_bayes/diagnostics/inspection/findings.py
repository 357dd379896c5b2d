"""What looks wrong with a record, the most serious first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr
from scipy.special import ndtri

from tactile_bayes.arrays import Flags
from tactile_bayes.diagnostics.findings import (
    NOISE_FACTOR,
    OFF_ZERO,
    Finding,
    counted,
    joined,
    listed,
    moved_zero,
    of_sweeps,
    quantity,
    zero_off,
)
from tactile_bayes.diagnostics.inspection.fit import OTHER_ANGLE, Fit
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
_FEWEST_IN_CONTACT = 10  # samples in contact that are no few, and those of a sweep that may show that it has none
_UNITS = {"large loads", "small loads", "long lever"}


def inspection_findings(
    record: xr.Dataset,
    sweeps: xr.Dataset,
    channels: xr.Dataset,
    samples: xr.Dataset,
    of_loads: Sequence[Finding],
    fit: Fit,
    stated: LoadCell | None,
    false_alarm: float,
) -> tuple[Finding, ...]:
    """Return the findings of `inspect_record` with the load cell that is stated; none if nothing looks wrong."""
    return (
        *_untouched(record, sweeps),
        *_loads(of_loads, fit),
        *_cut_off(record, samples, stated),
        *_without_contact(sweeps),
        *(Finding("stuck", **words) for _, words in _of_channels(samples, "stuck")),
        *_stored_twice(samples),
        *_outlying(samples, stated),
        *_zeros(record, channels, stated, false_alarm),
        *_noise(channels, stated, false_alarm),
        *_steps(samples),
        *_unfinished(sweeps),
    )


def _untouched(record: xr.Dataset, sweeps: xr.Dataset) -> list[Finding]:
    """Report that there is no contact, or else the channels that never change."""
    if not np.any(sweeps.contact.values | _is_short(sweeps)):
        return [Finding("no contact")]
    names = [name for name in present_channels(record) if np.ptp(record[name].values) == 0.0]
    return [Finding("dead channel", channel=name, entry=rig_entry("missing", [name])) for name in names]


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


def _of_channels(samples: xr.Dataset, flags: str) -> Iterator[tuple[Flags, dict[str, str]]]:
    """Yield the flagged samples of each channel that has some, and the words on them."""
    for index, name in enumerate(CHANNELS):
        flagged = samples[flags].values[:, index]
        if flagged.any():
            words = {"readings": counted(flagged, "reading"), "channel": name, "samples": listed(flagged)}
            yield flagged, words | {"are": "is" if np.sum(flagged) == 1 else "are"}


def _cut_off(record: xr.Dataset, samples: xr.Dataset, stated: LoadCell | None) -> Iterator[Finding]:
    for flagged, words in _of_channels(samples, "cut_off"):
        column = record[words["channel"]]
        largest = quantity(float(np.abs(column.values[flagged]).max()), str(column.attrs.get("units", "1")))
        is_known = stated is not None and np.isfinite(stated.limit[CHANNELS.index(words["channel"])])
        advice = "" if is_known else ": state its end in the header, or take a cell with a larger one"
        yield Finding("cut off", largest=largest, advice=advice, **words)


def _without_contact(sweeps: xr.Dataset) -> Iterator[Finding]:
    none = sweeps.sweep.values[~(sweeps.contact.values | _is_short(sweeps))].tolist()
    if 0 < len(none) < sweeps.sizes["sweep"]:
        yield Finding("sweep without contact", sweeps=of_sweeps(none, "show"))


def _is_short(sweeps: xr.Dataset) -> Flags:
    """Return True for sweeps of a few readings, like touches, whose ends may be loaded as well."""
    return np.asarray(sweeps.samples.values < _FEWEST_IN_CONTACT)


def _stored_twice(samples: xr.Dataset) -> Iterator[Finding]:
    if (flags := samples.repeated.values).any():
        have = "has" if np.sum(flags) == 1 else "have"
        yield Finding("stored twice", count=counted(flags, "sample"), have=have, samples=listed(flags))


def _outlying(samples: xr.Dataset, stated: LoadCell | None) -> list[Finding]:
    entry = rig_entry("degrees_of_freedom", 4, "load_cell")
    advice = f"If there are more, state noise with outliers ({entry}); else remove the row."
    if stated is not None and np.isfinite(stated.degrees_of_freedom):
        advice = "The noise with outliers that is stated allows for some; else remove the row."
    forms = {"is": {"stand": "stands", "their": "its"}, "are": {"stand": "stand", "their": "their"}}
    every = [words for _, words in _of_channels(samples, "outlier")]
    return [Finding("outlier", advice=advice, **forms[words["are"]], **words) for words in every]


def _zeros(record: xr.Dataset, channels: xr.Dataset, stated: LoadCell | None, false_alarm: float) -> Iterator[Finding]:
    if not _drifts(stated):
        p_values = dict(zip(channels.channel.values.tolist(), channels.same_bias_p_value.values.tolist(), strict=True))
        yield from moved_zero(p_values, false_alarm)
    far = far_off(record, channels, stated)
    if far:
        entries = {name: column_entry(record[name], added=-float(channels.bias.sel(channel=name))) for name in far}
        how = f"as the column is read: {rig_entries(entries)}" if all(entries.values()) else "from the readings"
        yield Finding("far zero", zeros=joined(list(far.values())), how=how)
    if stated is None or _drifts(stated):
        return
    off = {}
    for row in _rows(channels):
        name = str(row.channel.values)
        if name not in far:
            error = float(np.hypot(float(row.bias_uncertainty), stated.bias_uncertainty[CHANNELS.index(name)]))
            off[name] = float(row.bias - row.stated_bias), error, str(row.unit.values)
    advice = "infer finds it as it is (bias, one of the defaults), unless the rig says that it is known."
    yield from zero_off(off, advice)


def far_off(record: xr.Dataset, channels: xr.Dataset, stated: LoadCell | None) -> dict[str, str]:
    """Return, by channel and as text, zeros that the prior of a bias hardly allows and that no cell states."""
    rod, cell, found = rod_of(record), stated or LoadCell(), {}
    for row in _rows(channels):
        name, bias = str(row.channel.values), float(row.bias)
        index = CHANNELS.index(name)
        expected = PARAMETERS["moment_bias"].width * rod.load_units[index]
        if abs(bias - cell.bias[index]) > _FAR * max(expected, cell.bias_uncertainty[index]):
            found[name] = f"{quantity(bias, str(row.unit.values))} of {name}"
    return found


def _noise(channels: xr.Dataset, stated: LoadCell | None, false_alarm: float) -> list[Finding]:
    if _drifts(stated):
        return []
    level = -float(ndtri(0.5 * false_alarm / len(CHANNELS)))
    apart, alike, unlike = [], [], []
    for row in _rows(channels):
        name, unit = str(row.channel.values), str(row.unit.values)
        if float(row.position_p_value) < false_alarm / len(CHANNELS):
            scatter, usual = (quantity(float(row[key]), unit) for key in ("position_noise", "position_noise_expected"))
            apart.append(f"{name} ({scatter} instead of {usual})")
        elif abs(float(row.neighbour_score)) > level and abs(float(row.neighbour_correlation)) > _CORRELATED:
            alike.append(f"{name} ({float(row.neighbour_correlation):+.2f})")
        noise, error, expected = (float(row[key]) for key in ("noise", "noise_uncertainty", "stated_noise"))
        is_as_stated = 1.0 / NOISE_FACTOR <= noise / expected <= NOISE_FACTOR
        if not is_as_stated and abs(noise - expected) > OFF_ZERO * error:  # false without a stated noise, NaN
            real, said = quantity(noise, unit), quantity(expected, unit)
            unlike.append(Finding("noise not as stated", channel=name, found=real, stated=said))
    scattered = "the means of unloaded positions scatter more than single readings explain, in"
    ways = (
        (apart, scattered, "Give the mean of each position as one sample"),
        (alike, "unloaded neighbours are correlated in", "Filter less or sample less often"),
    )
    entry = rig_entry("drift", "default", "unknown")
    return [
        *(Finding("noise not white", how=f"{how} {joined(n)}", advice=a, entry=entry) for n, how, a in ways if n),
        *unlike,
    ]


def _drifts(stated: LoadCell | None) -> bool:
    """Return True if a drift is stated, which explains a zero that moves and correlated neighbours."""
    return stated is not None and stated.drift is not None


def _steps(samples: xr.Dataset) -> Iterator[Finding]:
    if (flags := samples.uneven_step.values).any():
        differ = "differs" if np.sum(flags) == 1 else "differ"
        yield Finding("uneven steps", steps=counted(flags, "step"), differ=differ, samples=listed(flags))


def _unfinished(sweeps: xr.Dataset) -> list[Finding]:
    contact = sweeps.contact.values
    begins, ends = (
        contact & np.isnan(sweeps[f"{event}_drive_angle"].sel(side=["before", "after"]).values).all(axis=-1)
        for event in ("onset", "snap_off")
    )
    few = contact & (sweeps.samples.values - sweeps.unloaded.values < _FEWEST_IN_CONTACT)
    kinds = ("begins in contact", "begin", begins), ("ends in contact", "end", ends), ("few samples", "show", few)
    return [
        Finding(kind, sweeps=of_sweeps(sweeps.sweep.values[flags].tolist(), verb), fewest=_FEWEST_IN_CONTACT)
        for kind, verb, flags in kinds
        if flags.any()
    ]


def _rows(channels: xr.Dataset) -> list[xr.Dataset]:
    """Return the rows of the channels that are present."""
    return [channels.isel(channel=i) for i in np.flatnonzero(np.isfinite(channels.largest.values))]
