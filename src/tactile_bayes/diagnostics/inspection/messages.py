"""Messages on what looks wrong with a record, the most serious first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from scipy.special import ndtri

from tactile_bayes.arrays import Flags
from tactile_bayes.diagnostics.inspection.corrections import OTHER_ANGLE
from tactile_bayes.diagnostics.inspection.fit import Fit
from tactile_bayes.diagnostics.units_and_signs import CHECK_UNITS
from tactile_bayes.diagnostics.verdicts import NOISE_FACTOR, OFF_ZERO
from tactile_bayes.inference.misfit import CHECK_RIG
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import CHANNELS, present_channels, rod_of
from tactile_bayes.record.origin import column_entry
from tactile_bayes.record.rig_entry import rig_entries, rig_entry
from tactile_bayes.rig.parameters import PARAMETERS

# Share of loaded samples without a fitting contact above which it is reported: a rod 10 % stiffer than stated stays
# below it at the usual noise.
UNFIT = 0.25
_FAR = 3.0  # standard deviations of a bias's prior beyond which `verdicts` would report the bias
_CORRELATED = 0.2  # autocorrelation of neighbours below which noise counts as white
_FEWEST_IN_CONTACT = 10

_SHOWN = 5  # largest number of samples that a message lists
_DRIFT = rig_entry("drift", "default", "unknown")

_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def inspection_messages(
    record: xr.Dataset,
    sweeps: xr.Dataset,
    channels: xr.Dataset,
    samples: xr.Dataset,
    of_loads: Sequence[str],
    fit: Fit,
    cell: LoadCell | None,
    source: str,
    false_alarm: float,
) -> tuple[str, ...]:
    """Return the messages of `inspect_record`; none if nothing looks wrong."""
    return (
        *_never_loaded(sweeps),
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


def quantity(value: float, unit: str) -> str:
    """Return a value with its unit as text, to three digits, in SI with a prefix."""
    if unit == "1":
        return f"{value:.3g}"
    size, prefix = prefix_of(value)
    return f"{value / size:.3g} {prefix}{unit}"


def prefix_of(value: float) -> tuple[float, str]:
    """Return the size of the prefix that suits a value in SI, and the prefix."""
    if not abs(value) > 0.0:  # zero or NaN
        return _PREFIXES[0]
    return next((pair for pair in _PREFIXES if abs(value) >= pair[0]), _PREFIXES[-1])


def _loads(of_loads: Sequence[str], fit: Fit) -> list[str]:
    """Report wrong units and signs, and loads that fit no contact."""
    messages = list(of_loads)
    if not max(fit.share, fit.below) > UNFIT:
        return messages
    if messages and (not fit.correction or messages[0].endswith(CHECK_UNITS)):  # the first message suffices
        return messages
    against = f"The loads of {fit.share:.0%} of the {fit.loaded} loaded samples fit no contact of such a rod"
    would = "would"
    if not fit.share > UNFIT:
        against = f"Of the {fit.loaded} loaded samples {fit.below:.0%} touch something below the pivot, not above"
        would = "would touch something above"
    advice = CHECK_RIG
    if fit.correction:
        advice = f"nearly all {would} if {fit.correction}"
    messages.insert(0 if fit.correction.startswith(OTHER_ANGLE) else len(messages), f"{against}: {advice}.")
    return messages


def _dead(record: xr.Dataset, sweeps: xr.Dataset) -> list[str]:
    if not sweeps.contact.values.any():
        return []
    names = [name for name in present_channels(record) if np.ptp(record[name].values) == 0.0]
    return [
        f"{name} never changes: is it connected? If it is not measured, empty its column, or remove it and state "
        f"{rig_entry('missing', [name])}."
        for name in names
    ]


def _cut_off(record: xr.Dataset, samples: xr.Dataset, cell: LoadCell | None) -> list[str]:
    messages = []
    for index, name in enumerate(CHANNELS):
        flags = samples.cut_off.values[:, index]
        if not flags.any():
            continue
        largest = float(np.abs(record[name].values[flags]).max())
        stated = cell is not None and np.isfinite(cell.limit[index])
        advice = "" if stated else ": state its end in the header, or take a cell with a larger one"
        messages.append(
            f"{_count(flags, 'reading')} of {name} {_are(flags)} cut off at {quantity(largest, _unit(record, name))}, "
            f"the end of a range ({_listed(flags)}){advice}."
        )
    return messages


def _never_loaded(sweeps: xr.Dataset) -> list[str]:
    if sweeps.contact.values.any():
        return []
    return [
        "No sweep shows contact: the loads do not change from beginning to end by more than noise. Does the rod "
        "touch, and are the load columns the right ones?"
    ]


def _without_contact(sweeps: xr.Dataset) -> list[str]:
    none = [int(number) for number, found in zip(sweeps.sweep.values, sweeps.contact.values, strict=True) if not found]
    if not none or len(none) == sweeps.sizes["sweep"]:
        return []
    return [f"{_of_sweeps(none, 'show')} no contact: leave it out, or is it another object's?"]


def _stuck(samples: xr.Dataset) -> list[str]:
    messages = []
    for index, name in enumerate(CHANNELS):
        flags = samples.stuck.values[:, index]
        if flags.any():
            messages.append(
                f"{_count(flags, 'reading')} of {name} {_are(flags)} the same as before or after, for longer than its "
                f"steps explain ({_listed(flags)}): did the acquisition hang?"
            )
    flags = samples.repeated.values
    if flags.any():
        messages.append(
            f"{_count(flags, 'sample')} {'has' if np.sum(flags) == 1 else 'have'} all the readings of the one before "
            f"({_listed(flags)}): stored twice? Remove what is no measurement."
        )
    return messages


def _outlying(samples: xr.Dataset, cell: LoadCell | None) -> list[str]:
    messages = []
    advice = (
        "If there are more, state noise with outliers, load_cell_degrees_of_freedom: 4, in the header; else remove the "
        "row."
    )
    if cell is not None and np.isfinite(cell.degrees_of_freedom):
        advice = "The noise with outliers that is stated allows for some; else remove the row."
    for index, name in enumerate(CHANNELS):
        flags = samples.outlier.values[:, index]
        if flags.any():
            stands = "stands" if np.sum(flags) == 1 else "stand"
            messages.append(
                f"{_count(flags, 'reading')} of {name} {stands} out from {'its' if stands[-1] == 's' else 'their'} "
                f"neighbours ({_listed(flags)}): a knock? {advice}"
            )
    return messages


def _zeros(
    record: xr.Dataset, channels: xr.Dataset, cell: LoadCell | None, source: str, false_alarm: float
) -> list[str]:
    messages = []
    level = false_alarm / max(int(np.isfinite(channels.same_bias_p_value.values).sum()), 1)
    moved = [str(row.channel.values) for row in _rows(channels) if float(row.same_bias_p_value) < level]
    if moved and not _drifts(cell):
        messages.append(
            f"The zero of {_and(moved)} moved between one unloaded stretch and another: tare before each sweep, or "
            f"have infer find a drift ({_DRIFT})."
        )
    is_stated = source in ("given", "data sheet")
    far = far_off(record, channels, cell if is_stated else None)
    if far:
        zeros = {str(row.channel.values): float(row.bias) for row in _rows(channels)}
        entries = {name: column_entry(record[name], added=-zeros[name]) for name in far}
        how = f"as the column is read: {rig_entries(entries)}" if all(entries.values()) else "from the readings"
        messages.append(
            f"Without load the cell reads {_and(list(far.values()))}, more than infer expects. Subtract it {how}."
        )
    if not is_stated or _drifts(cell):
        return messages
    off = []
    for row in _rows(channels):
        if str(row.channel.values) in far:
            continue
        away, error = float(row.bias - row.stated_bias), float(row.bias_uncertainty)
        stated = 0.0 if cell is None else cell.bias_uncertainty[CHANNELS.index(str(row.channel.values))]
        error = float(np.hypot(error, stated))
        if abs(away) > OFF_ZERO * error > 0.0:
            off.append(
                f"{row.channel.values} is off by {quantity(away, str(row.unit.values))} "
                f"({abs(away) / error:.0f} standard errors)"
            )
    if off:
        messages.append(
            f"Without load the cell does not read what is stated: {', '.join(off)}. Was the tare forgotten? "
            "infer finds it as it is (bias, one of the defaults), unless the rig says that it is known."
        )
    return messages


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


def _noise(channels: xr.Dataset, cell: LoadCell | None, source: str, false_alarm: float) -> list[str]:
    messages = []
    level = -float(ndtri(0.5 * false_alarm / len(CHANNELS)))
    apart = {
        str(row.channel.values): f"{row.channel.values} ({quantity(float(row.position_noise), str(row.unit.values))} "
        f"instead of {quantity(float(row.position_noise_expected), str(row.unit.values))})"
        for row in _rows(channels)
        if float(row.position_p_value) < false_alarm / len(CHANNELS)
    }
    if apart and not _drifts(cell):
        messages.append(
            "The noise is not white: the means of unloaded positions scatter more than single readings explain, in "
            f"{_and(list(apart.values()))}. Give the mean of each position as one sample, or have infer find a drift "
            f"({_DRIFT}), else bands come out too narrow."
        )
    like = [
        f"{row.channel.values} ({float(row.neighbour_correlation):+.2f})"
        for row in _rows(channels)
        if abs(float(row.neighbour_score)) > level
        and abs(float(row.neighbour_correlation)) > _CORRELATED
        and str(row.channel.values) not in apart
    ]
    if like and not _drifts(cell):
        messages.append(
            f"The noise is not white: unloaded neighbours are correlated in {_and(like)}. Filter less or sample less "
            f"often, or have infer find a drift ({_DRIFT}), else bands come out too narrow."
        )
    if source in ("given", "data sheet") and not _drifts(cell):
        for row in _rows(channels):
            stated, found, error = (float(row[name]) for name in ("stated_noise", "noise", "noise_uncertainty"))
            ratio = found / stated if stated else np.nan
            if not 1.0 / NOISE_FACTOR <= ratio <= NOISE_FACTOR and abs(found - stated) > OFF_ZERO * error:
                unit = str(row.unit.values)
                messages.append(
                    f"The noise of {row.channel.values} is {quantity(found, unit)} in unloaded samples, and stated as "
                    f"{quantity(stated, unit)}: state what it is, or are the units right?"
                )
    return messages


def _drifts(cell: LoadCell | None) -> bool:
    """Return True if a drift is stated, which explains a zero that moves and correlated neighbours."""
    return cell is not None and cell.drift is not None


def _steps(samples: xr.Dataset) -> list[str]:
    flags = samples.uneven_step.values
    if not flags.any():
        return []
    return [
        f"{_count(flags, 'step')} of the drive {'differs' if np.sum(flags) == 1 else 'differ'} from the others "
        f"({_listed(flags)}): were samples lost, or did the drive slip?"
    ]


def _unfinished(sweeps: xr.Dataset) -> list[str]:
    messages = []
    contact = sweeps.contact.values
    for name, words, advice in (
        ("onset_drive_angle", "begin", "begin before first contact"),
        ("snap_off_drive_angle", "end", "continue until the rod snaps off"),
    ):
        inside = (
            contact & np.isnan(sweeps[name].sel(side="after").values) & np.isnan(sweeps[name].sel(side="before").values)
        )
        numbers = [int(number) for number in sweeps.sweep.values[inside]]
        if numbers:
            messages.append(f"{_of_sweeps(numbers, words)} in contact: {advice}, which is informative on the contour.")
    few = contact & (sweeps.samples.values - sweeps.unloaded.values < _FEWEST_IN_CONTACT)
    numbers = [int(number) for number in sweeps.sweep.values[few]]
    if numbers:
        which = _of_sweeps(numbers, "show")
        messages.append(f"{which} fewer than {_FEWEST_IN_CONTACT} samples in contact: take finer steps of the drive.")
    return messages


def _rows(channels: xr.Dataset) -> list[xr.Dataset]:
    """Return the rows of the channels that are present."""
    return [channels.isel(channel=i) for i in np.flatnonzero(np.isfinite(channels.largest.values))]


def _unit(record: xr.Dataset, name: str) -> str:
    return str(record[name].attrs.get("units", "1"))


def _count(flags: Flags, noun: str) -> str:
    count = int(np.sum(flags))
    return f"{count} {noun}{'s' * (count != 1)}"


def _are(flags: Flags) -> str:
    return "is" if np.sum(flags) == 1 else "are"


def _listed(flags: Flags) -> str:
    """Return text like "samples 3, 5 to 9 and 12", neighbours joined."""
    where = np.flatnonzero(flags)
    runs = np.split(where, np.flatnonzero(np.diff(where) != 1) + 1)
    words = [f"{run[0]}" if run.size == 1 else f"{run[0]} to {run[-1]}" for run in runs]
    more = len(words) - _SHOWN
    shown = [*words[:_SHOWN], "..."] if more > 0 else words
    return f"sample{'s' * (where.size != 1)} {_and(shown) if more <= 0 else ', '.join(shown)}"


def _and(words: Sequence[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else list(words))


def _of_sweeps(numbers: Sequence[int], verb: str) -> str:
    one = len(numbers) == 1
    return f"Sweep{'' if one else 's'} {_and(list(map(str, numbers)))} {verb}{'s' if one else ''}"
