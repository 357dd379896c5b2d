"""The inspection of a record: its sweeps, channels and samples, and messages on what looks wrong."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import check_function, check_probability
from tactile_bayes.diagnostics.findings import OFF_ZERO, Finding
from tactile_bayes.diagnostics.inspection.findings import UNFIT, far_off, inspection_findings
from tactile_bayes.diagnostics.inspection.fit import Fit, fit_of
from tactile_bayes.diagnostics.inspection.samples import (
    autocorrelation,
    outliers,
    position_scatter,
    repeat_chance,
    repeated,
    stuck,
    uneven_steps,
    unloaded_stretches,
)
from tactile_bayes.diagnostics.units_and_signs import unit_and_sign_findings
from tactile_bayes.errors import DriftWarning, RecordError
from tactile_bayes.load_cell import LoadCell, zero_load
from tactile_bayes.reconstruction import contacts_of
from tactile_bayes.record import (
    CHANNELS,
    carried_sweeps,
    loads_of,
    means_of_positions,
    positions_of,
    present_channels,
    rows_of_sweeps,
    travels_of,
    validate,
    with_rod,
)
from tactile_bayes.record.origin import column_entry
from tactile_bayes.rig.corrected import corrected
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.rig import Rig, rig_of

# Number of steps of an inspection: unloaded samples, Step 2, fit of contacts; each correction tried adds one.
_STEPS = 3
_MOVED = 1e-3  # probability that a zero which stays where it is seems to have moved as far between unloaded stretches
_DIGITS = 3  # number of significant digits of a noise that is estimated
_STATED = ("given", "data sheet")  # sources of a load cell that somebody states

CellSource = Literal["given", "data sheet", "unloaded samples", "nothing", "too few unloaded samples"]
_FLAGS = {
    "outlier": "whether the reading stands out from its neighbours",
    "stuck": "whether the reading stays the same for long",
    "cut_off": "whether the reading is at the end of a range",
}
_COLUMNS = (
    *("smallest", "largest", "stated_noise", "stated_bias", "neighbour_correlation", "neighbour_score"),
    *("position_noise", "position_noise_expected", "position_p_value"),
)
_FROM_ZERO_LOAD = ("bias", "bias_uncertainty", "noise", "noise_uncertainty", "resolution", "same_bias_p_value")


@dataclass(frozen=True, eq=False)
class Inspection:
    """Result of `inspect_record`.

    Attributes
    ----------
    record : xr.Dataset
        The record.
    messages : tuple of Finding
        What looks wrong, the most serious first, or "Nothing looks wrong.": sentences, each with its `kind` and
        `details`.
    is_suspect : bool
        True if anything looks wrong.
    sweeps : xr.Dataset
        Over "sweep": direction, samples, positions (fewer than samples where the drive stops for several readings),
        base_x, base_y, drive_angle_from, drive_angle_to and drive_step (the median, between positions) [rad]; from
        `zero_load` contact, p_value, onset_drive_angle and snap_off_drive_angle [rad] (also over "side", NaN where
        there is none); unloaded, the number of unloaded samples. If the drive carries the base in some sweep, also
        carried, travel and travel_step (whole way of the base, and its median step, NaN for rotations), and
        onset_travel and snap_off_travel from `zero_load`; base_x and base_y are then those of the first sample.
    channels : xr.Dataset
        Over "channel", in the units of coordinate "unit", NaN for a missing channel: smallest, largest, bias,
        bias_uncertainty, noise, noise_uncertainty, resolution and same_bias_p_value (see `zero_load`), stated_noise
        (NaN if no noise is stated, or it has no standard deviation), neighbour_correlation of the unloaded samples and
        its neighbour_score (about standard normal for white noise); where the drive stops, position_noise, the standard
        deviation of the means of unloaded positions, position_noise_expected if readings are independent, and
        position_p_value of that.
    samples : xr.Dataset
        Over "sample" (and "channel"): unloaded; outlier, stuck and cut_off of each channel; repeated and uneven_step;
        status in raw Step 2 ("" where a load channel is missing).
    statuses : mapping of str to int
        Number of samples by status in raw Step 2; empty where a load channel is missing.
    load_cell : LoadCell or None
        The load cell with its noise, if known.
    load_cell_source : str
        Source of the load cell: "given", "data sheet", "unloaded samples", "nothing" (an ideal record) or "too few
        unloaded samples".
    """

    record: xr.Dataset
    messages: tuple[Finding, ...]
    is_suspect: bool
    sweeps: xr.Dataset
    channels: xr.Dataset
    samples: xr.Dataset
    statuses: Mapping[str, int]
    load_cell: LoadCell | None
    load_cell_source: str


def inspect_record(
    record: xr.Dataset,
    rig: Rig | None = None,
    *,
    false_alarm: float = 1e-3,
    progress: Callable[[int, int], object] | None = None,
) -> Inspection:
    """Inspect a record before anything is inferred: its contents, and what looks wrong, whatever the contour.

    Parameters
    ----------
    record : xr.Dataset
        A record.
    rig : Rig, optional
        Rod and load cell, by default those that the record states, or bias and noise of its unloaded samples; and known
        deviations, for which Step 2 corrects.
    false_alarm : float
        Level of every test, in (0, 0.5): the probability of a false alarm for a record in white normal noise with
        nothing wrong, for each sweep in `zero_load`, and for all channels and samples together in the others.
    progress : callable, optional
        Called with the number of steps done and their total, which grows where samples do not fit, as corrections are
        tried.

    Returns
    -------
    Inspection

    Raises
    ------
    RecordError
        If `record` is not a valid record.
    ParameterError
        If `rig` is no rig, or `false_alarm` is not a probability below a half.

    Notes
    -----
    The messages report, in this order: a record without contact; channels that never change; loads that no such rod can
    have; samples whose loads fit no contact, with the sign, the frame, the exchange of forces or the friction that
    would correct them, if one does; readings cut off at the end of a range; a sweep without contact; readings that are
    stuck or stored twice; outliers; a zero that moved, or is off; noise that is not white, or not as stated; uneven
    steps of the drive; sweeps that begin or end in contact.

    The inspection does not report a rod that is a few per cent stiffer or longer than stated, nor an encoder that is a
    degree off: `infer_contour` finds them. None of 1536 simulated records with eight kinds of load cell and nothing
    wrong raised an alarm.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02, bias=(0.1, 0.0, 0.0))
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5)).record, rng=1)
    >>> print(*inspect_record(measured).messages)
    Nothing looks wrong.
    >>> knocked = measured.holding_moment.copy()
    >>> knocked[5] += 1.0
    >>> for message in inspect_record(measured.assign(holding_moment=knocked)).messages:
    ...     print(message)
    1 reading of holding_moment stands out from its neighbours (sample 5): a knock? If there are more, ...
    """
    rig = rig_of(rig)
    check_probability("false_alarm", false_alarm, "give a probability between 0 and 0.5, such as 1e-3", below=0.5)
    check_function("progress", progress)
    record = with_rod(validate(record), rig.rod)
    report = progress or (lambda done, count: None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DriftWarning)  # a message reports it
        found = zero_load(record, false_alarm=false_alarm)
        cell, source = known_cell(record, rig.load_cell)
    stated = cell if source in _STATED else None
    sweeps = rows_of_sweeps(record["sweep"].values)
    stretches = unloaded_stretches(sweeps, found["unloaded"].values)
    channels = channel_table(record, found, stretches, stated)
    samples = sample_table(record, found, sweeps, stretches, stated, false_alarm=false_alarm)
    report(1, _STEPS)
    statuses: dict[str, int] = {}
    fit = Fit(math.nan, math.nan, 0, "")
    if len(present_channels(record)) == len(CHANNELS):
        status = contacts_of(corrected(record, cell or LoadCell(), rig.known), "raw").status.values
        samples["status"] = ("sample", status, {"long_name": "status in raw Step 2"})
        statuses = dict(Counter(status.tolist()).most_common())
        report(2, _STEPS)
        dead = any(np.ptp(record[name].values) == 0.0 for name in CHANNELS)
        without_zeros = {name: value for name, value in rig.known.items() if name not in GROUPS["bias"]}
        if cell is not None and cell.has_variances and found["contact"].values.any() and not dead:
            fit = fit_of(
                corrected(record, _with_zero(cell, found), without_zeros),
                most=UNFIT,
                progress=lambda done, count: report(_STEPS + done, _STEPS + count),
            )
    else:
        samples["status"] = ("sample", np.full(record.sizes["sample"], ""), {"long_name": "none: a channel is missing"})
    table = sweep_table(record, found, sweeps)
    of_loads = unit_and_sign_findings(record, _with_zero(cell, found)) if found["contact"].values.any() else ()
    against = inspection_findings(record, table, channels, samples, of_loads, fit, stated, false_alarm)
    said = against or (Finding("nothing wrong"),)
    return Inspection(record, said, bool(against), table, channels, samples, statuses, cell, source)


def known_cell(measured: xr.Dataset, given: LoadCell | None = None) -> tuple[LoadCell | None, CellSource]:
    """Return the given load cell, or the record's data sheet, or an estimate from unloaded samples, and its source."""
    if given is not None:
        return given, "given"
    if (stated := LoadCell.from_record(measured)) is not None:
        return stated, "data sheet"
    try:
        found = LoadCell.from_zero_load(measured)
    except RecordError:
        return None, "too few unloaded samples"
    noisy = all(found.standard_deviations[name] for name in present_channels(measured))
    return (found, "unloaded samples") if noisy else (None, "nothing")


def _with_zero(cell: LoadCell | None, found: xr.Dataset) -> LoadCell:
    """Return the load cell with the bias that the record shows; a message of its own reports a forgotten tare."""
    if not np.isfinite(found["bias"].values).any():
        return cell or LoadCell()
    bias, uncertainty = (tuple(np.nan_to_num(found[name].values).tolist()) for name in ("bias", "bias_uncertainty"))
    return replace(cell or LoadCell(), bias=bias, bias_uncertainty=uncertainty)


def shown_rig(found: Inspection, rig: Rig) -> Rig:
    """Return the rig of an inspected record, with what its unloaded samples show and nobody states.

    That is the noise, and zeros that are clearly off and stay where they are, as they are added to columns of the file.
    """
    columns = {name: column_entry(found.record[name], added=-zero) for name, zero in _zeros(found)}
    columns = {name: text for name, text in columns.items() if text}
    rig = replace(rig, file=replace(rig.format, columns={**rig.format.columns, **columns}))
    if found.load_cell_source != "unloaded samples":
        return rig
    names = "force_noise", "moment_noise"
    force_noise, moment_noise = (float(f"{getattr(found.load_cell, name):.{_DIGITS}g}") for name in names)
    stated = rig.load_cell or LoadCell()
    return replace(rig, load_cell=replace(stated, force_noise=force_noise, moment_noise=moment_noise))


def _zeros(found: Inspection) -> Iterator[tuple[str, float]]:
    """Yield the channels whose zeros are off by many standard errors, or, beside a stated cell, more than it allows."""
    is_stated = found.load_cell_source in _STATED
    far = far_off(found.record, found.channels, found.load_cell if is_stated else None)
    for name in found.channels.channel.values.tolist():
        row = found.channels.sel(channel=name)
        zero, error = float(row.bias), float(row.bias_uncertainty)
        has_moved = float(row.same_bias_p_value) < _MOVED
        is_off = abs(zero) > OFF_ZERO * error > 0.0 and not is_stated
        if (name in far or is_off) and not has_moved:
            yield name, zero


def sample_table(
    record: xr.Dataset,
    found: xr.Dataset,
    sweeps: list[Index],
    stretches: list[Index],
    stated: LoadCell | None,
    *,
    false_alarm: float,
) -> xr.Dataset:
    """Return `Inspection.samples` without the status; `found` is the result of `zero_load`."""
    count, present = record.sizes["sample"], present_channels(record)
    level = false_alarm / len(present)
    flags = {name: np.zeros((count, len(CHANNELS)), dtype=bool) for name in _FLAGS}
    unloaded = found["unloaded"].values
    chances, readings = [], []
    for index, name in enumerate(CHANNELS):
        if name not in present:
            continue
        reading = record[name].values
        step, noise = float(found["resolution"][index]), float(found["noise"][index])
        rounding = 4.0 * np.finfo(float).eps * float(np.abs(reading).max())
        if not noise > rounding:  # an ideal record, whose zeros are equal, or too few unloaded samples
            continue
        chance = repeat_chance(reading, stretches, step, noise)
        chances.append(chance)
        readings.append(reading)
        flags["outlier"][:, index] = outliers(reading, sweeps, stretches, step, false_alarm=level)
        equal = stuck(reading, sweeps, chance, noise, false_alarm=level)
        at_end = equal & ~unloaded & ((reading == reading.max()) | (reading == reading.min()))
        flags["cut_off"][:, index] = at_end
        flags["stuck"][:, index] = equal & ~at_end
    if stated is not None:
        ends = stated.cuts_off(loads_of(record))
        flags["cut_off"] |= ends
        flags["stuck"] &= ~ends
    twice = np.zeros(count, dtype=bool)
    if len(readings) == len(present):
        twice = repeated(np.stack(readings, axis=-1), sweeps, np.array(chances), false_alarm=false_alarm)
        twice &= ~(flags["stuck"] | flags["cut_off"]).all(axis=1)
    uneven = np.zeros(count, dtype=bool)
    travels, carried = travels_of(record), carried_sweeps(record)
    for rows in sweeps:
        first = record.isel(sample=rows[0])
        turns_back = first.direction.item() == "backward" and first.sweep.item() not in carried
        uneven[rows] = uneven_steps(travels, rows, -1 if turns_back else 1)
    return xr.Dataset(
        {
            "unloaded": ("sample", unloaded, {"long_name": "whether the sample is unloaded"}),
            **{name: (("sample", "channel"), flags[name], {"long_name": words}) for name, words in _FLAGS.items()},
            "repeated": ("sample", twice, {"long_name": "whether all readings are those of the sample before"}),
            "uneven_step": ("sample", uneven, {"long_name": "whether the step of the drive up to it is another"}),
        },
        coords={"channel": list(CHANNELS)},
    )


def channel_table(record: xr.Dataset, found: xr.Dataset, stretches: list[Index], stated: LoadCell | None) -> xr.Dataset:
    """Return `Inspection.channels`; `found` is the result of `zero_load`."""
    columns = np.full((len(_COLUMNS), len(CHANNELS)), np.nan)
    travels = travels_of(record)
    positions = [positions_of(travels[rows]) for rows in stretches]
    for index, name in enumerate(CHANNELS):
        if name not in present_channels(record):
            continue
        reading, noise, bias = record[name].values, np.nan, np.nan
        if stated is not None:
            noise = float(np.hypot(stated.standard_deviations[name], stated.resolution[index] / np.sqrt(12.0)))
            noise, bias = noise if 0.0 < noise < np.inf else np.nan, stated.bias[index]
        likeness, apart = autocorrelation(reading, stretches), position_scatter(reading, stretches, positions)
        columns[:, index] = reading.min(), reading.max(), noise, bias, *likeness, *apart
    table = xr.Dataset(
        {name: ("channel", values) for name, values in zip(_COLUMNS, columns, strict=True)},
        coords={"channel": list(CHANNELS), "unit": ("channel", found["unit"].values)},
        attrs={"units": record.attrs["units"]},
    )
    return table.assign({name: found[name].variable for name in _FROM_ZERO_LOAD})


def sweep_table(record: xr.Dataset, found: xr.Dataset, sweeps: list[Index]) -> xr.Dataset:
    """Return `Inspection.sweeps`; `found` is the result of `zero_load`."""
    angle, unloaded = record["drive_angle"].values, found["unloaded"].values
    first, last = np.array([rows[[0, -1]] for rows in sweeps]).T
    travels = travels_of(record)
    positions = [positions_of(travels[rows]) for rows in sweeps]
    steps = [_usual_step(angle[rows], stops) for rows, stops in zip(sweeps, positions, strict=True)]
    length, of_angle = {"units": record["base_x"].attrs["units"]}, {"units": "rad"}
    table = xr.Dataset(
        {
            "direction": ("sweep", record["direction"].values[first]),
            "samples": ("sweep", [rows.size for rows in sweeps]),
            "positions": ("sweep", [int(stops[-1]) + 1 for stops in positions]),
            "base_x": ("sweep", record["base_x"].values[first], length),
            "base_y": ("sweep", record["base_y"].values[first], length),
            "drive_angle_from": ("sweep", angle[first], of_angle),
            "drive_angle_to": ("sweep", angle[last], of_angle),
            "drive_step": ("sweep", steps, of_angle),
            "unloaded": ("sweep", [int(np.count_nonzero(unloaded[rows])) for rows in sweeps]),
        },
        coords={"sweep": found["sweep"].values, "side": found["side"].values},
    )
    names = ["contact", "p_value", "onset_drive_angle", "snap_off_drive_angle"]
    carried = np.isin(table["sweep"].values, carried_sweeps(record))
    if carried.any():
        steps = [_usual_step(travels[rows], stops) for rows, stops in zip(sweeps, positions, strict=True)]
        table["carried"] = ("sweep", carried)
        table["travel"] = ("sweep", np.where(carried, travels[last], np.nan), length)
        table["travel_step"] = ("sweep", np.where(carried, steps, np.nan), length)
        names += ["onset_travel", "snap_off_travel"]
    return table.assign({name: found[name].variable for name in names})


def _usual_step(along: Floats, positions: Index) -> float:
    """Return the median step of a sweep between its positions; NaN if there is one alone."""
    steps = np.abs(np.diff(means_of_positions(along, positions)))
    return float(np.median(steps)) if steps.size else np.nan
