"""The zero load of a record: its unloaded stretches, and the bias and noise estimated from them."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.special import fdtrc

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.checks import check_probability
from tactile_bayes.errors import DriftWarning, RecordError
from tactile_bayes.load_cell.blocks import are_blocks, bounds_in_blocks
from tactile_bayes.load_cell.contact_bounds import FEWEST, ContactBounds, contact_bounds
from tactile_bayes.record import (
    CHANNELS,
    COLUMNS,
    carried_sweeps,
    frame_of,
    means_of_positions,
    positions_of,
    present_channels,
    rows_of_sweeps,
    travels_of,
    validate,
)

# Least number of samples of a sweep that counts as unloaded because no contact was found in it: in a shorter sweep a
# strong contact may be missed.
_MIN_SAMPLES = 12
_STEPS = 1e-2  # tolerated distance of a reading, in steps, from a whole number


def zero_load(record: xr.Dataset, *, false_alarm: float = 1e-3) -> xr.Dataset:
    """Find the unloaded samples of a record, without labels, and estimate bias and white noise from them.

    A sweep is unloaded, then loaded without a break, then unloaded again; each part may be missing. Loads grow from
    zero approximately linearly in the sample number, and drop abruptly.

    Parameters
    ----------
    record : xr.Dataset
        A record. Its data sheet of the load cell is not used.
    false_alarm : float
        Largest probability of a false detection of contact in a sweep, over all channels and positions, in white normal
        noise of unknown bias and size. It is also the level of every other test named below.

    Returns
    -------
    xr.Dataset
        In the units and the frame of the record.

        contact, p_value (sweep)
            Whether contact was found, and an upper bound of the p-value of no contact.
        onset, snap_off (sweep, side)
            Samples of the record between which contact began and ended: the last "before" the event and the first
            "after" it that are certainly unloaded or loaded, which at onset are at least two apart; -1 where there is
            none, as before the onset of a sweep that is loaded from its first sample. Their drive angles, or NaN, are
            onset_drive_angle and snap_off_drive_angle [rad]. If the drive carries the base in some sweep, there are
            also onset_travel and snap_off_travel: ways of the base from the sweep's first sample [length] where it does
            so, and else drive angles [rad].
        unloaded (sample)
            Samples from which bias and noise are estimated: up to "before" of the onset and from "after" of the
            snap-off, and sweeps of at least 12 samples with neither contact nor slope at a level of 5 %.
        bias, noise (channel), bias_uncertainty, noise_uncertainty (channel)
            Mean, standard deviation, and their standard errors; bias is one number for all sweeps. NaN for missing
            channels, and if fewer than 3 samples are unloaded.
        same_bias_p_value (channel)
            p-value of the hypothesis that all unloaded stretches have the same bias (analysis of variance).
        resolution (channel)
            Step of the reading, if it can be detected; else 0.

    Raises
    ------
    RecordError
        If `record` is not a record.
    ParameterError
        If `false_alarm` is not a probability below a half.

    Warns
    -----
    DriftWarning
        If the stretches differ in their bias; the spread between stretches is then added to its uncertainty.

    Notes
    -----
    *Contact.* Take some samples at both ends of a sweep. Without contact the sum of squares about their mean, as a
    share of that of the whole sweep, follows a beta distribution exactly, for any bias and noise. The smallest of its
    probabilities, over ends of 0, 1, 2, 3, 4, 6, 8, 12, ... samples and over channels, times their number (Bonferroni),
    is `p_value`: the rate of false alarms is bounded for every length, and for correlated channels. So that outliers do
    not count as contact, the same must hold after readings that exceed both neighbours are clipped at three deviations
    from the median.

    *Bounds of contact.* A sample (with a neighbour on the same side) or a block of 2, 4, 8, ... samples is loaded if
    Student's t against the ends is significant, again by Bonferroni. The first one bounds the onset from above. The
    bound from below is an F-test of the possible starts of a linear ramp up to there (an approximation, as for any
    break), less one sample, since the sample after a break carries almost no load. After the last loaded sample the
    load counts as constant until a likelihood-ratio test shows that it is gone. This is repeated with the samples that
    are then unloaded until nothing changes. An end with a slope is not unloaded.

    *Performance*, in simulations at the default, with the standard deviation σ of the noise. False alarms are two to
    five times rarer than stated; outliers that follow Student's t with 5 degrees of freedom cause one in less than 1 %,
    with 3 in less than 4 % of sweeps of up to 2000 samples. A load on one channel that grows to h at snap-off is found
    in 95 of 100 sweeps from h = 8 σ (15 samples before, in and after contact), 5 σ (15, 100, 15) or 2.2 σ (100, 500,
    100). Onset is detected 17, 5 and 0.3 samples late at slopes of 0.2, 1 and 20 σ a sample, and 7, 3 and 1 samples
    before it are left out as a margin. A snap-off from 20 σ is exact to the sample in 999 of 1000 sweeps, from 10 σ in
    three of four; otherwise its samples are further apart. Bias over its uncertainty follows Student's t, with a mean
    below 0.1. However, a contact too weak to be detected shifts it: by 4 uncertainties for 100 samples that reach 1 σ,
    between 15 unloaded samples on either side.

    *Stops.* Where the drive stops for several readings at each of 12 or more positions, contact and bias are found from
    the means of the positions, so that noise that is correlated there, as that of a slow amplifier, is no load. The
    noise is that of single readings.

    *Cropped sweeps.* A sweep of loaded samples alone has no ends to compare with: its contact is significant where a
    parabola fits the readings (an F-test) and spans twenty standard deviations of the noise between neighbours.

    *Limits.* A load that is constant throughout a sweep counts as a bias. The warning reports a zero that moves during
    contact (2 σ in 7 of 10 sweeps, 15 samples on either side); but a change by more than about a sixth of the largest
    load counts as load, and the sweep then seems to have no snap-off. A rod that rings after snap-off counts as loaded
    as long as it rings.

    Noise smaller than the step of the reading cannot be distinguished from it: the noise is then at least step/√12, and
    the uncertainty of the bias is not smaller.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> ideal = scan(paper_profile("II", q=0.5)).record
    >>> found = zero_load(LoadCell(moment_noise=0.02, force_noise=0.05, bias=(0.1, 0, 0)).measure(ideal, rng=1))
    >>> found.snap_off.values.tolist()  # between samples, in both sweeps
    [[148, 149], [313, 314]]
    >>> bool(abs(found.bias[0] - 0.1) < 3 * found.bias_uncertainty[0])
    True
    """
    check_probability("false_alarm", false_alarm, "give a probability between 0 and 0.5, such as 1e-3", below=0.5)
    record = validate(record)
    channels = present_channels(record)
    readings = np.stack([record[name].values for name in channels], axis=-1)
    steps = np.array([_step(values) for values in readings.T])
    rounding = 4.0 * np.finfo(float).eps * np.abs(readings).max(axis=0)
    floor = np.maximum(steps**2 / 12.0, rounding**2)
    sweep = record["sweep"].values
    sweeps = rows_of_sweeps(sweep)
    travels, blocked = travels_of(record), are_blocks(record)
    positions = [np.arange(rows.size) if blocked else _positions(travels[rows]) for rows in sweeps]
    if blocked:
        part, at_rest = record["block_part"].values, record["block_unloaded"].values.astype(bool)
        bounds = [bounds_in_blocks(part[rows], at_rest[rows]) for rows in sweeps]
    else:
        bounds = [_bounds(readings[rows], at, false_alarm, floor) for rows, at in zip(sweeps, positions, strict=True)]
    stretches, of_positions = [], []
    for rows, at, of_sweep in zip(sweeps, positions, bounds, strict=True):
        for ends in (slice(of_sweep.before), slice(len(rows) - of_sweep.after, None)):
            if rows[ends].size:
                stretches.append(rows[ends])
                of_positions.append(means_of_positions(readings[rows[ends]], at[ends]))
    unloaded = np.zeros(sweep.size, dtype=bool)
    for rows in stretches:
        unloaded[rows] = True
    statistics = _statistics(_stretches(record, channels, readings, stretches), steps, floor, false_alarm)
    if any(len(rows) > len(means) for rows, means in zip(stretches, of_positions, strict=True)):
        of_means = _statistics(list(map(_Stretch.of_readings, of_positions)), steps, floor, false_alarm)
        statistics |= {name: of_means[name] for name in statistics if name not in ("noise", "noise_uncertainty")}
    moved = np.flatnonzero(statistics["same_bias_p_value"] < false_alarm / len(channels))
    if moved.size:
        names = " and ".join(channels[index] for index in moved)
        p_values = " and ".join(f"{statistics['same_bias_p_value'][index]:.1g}" for index in moved)
        zeros, they = ("zeros", "they") if moved.size > 1 else ("zero", "it")
        warnings.warn(
            f"the {zeros} of {names} moved from one unloaded stretch to another (p = {p_values} if {they} had not): "
            "bias_uncertainty has the spread between them added; tare before each sweep, or describe the cell with a "
            "drift",
            DriftWarning,
            stacklevel=2,
        )
    statistics["resolution"] = steps
    return _labelled(record, sweeps, bounds, unloaded, statistics, channels).assign_attrs(false_alarm=false_alarm)


def quiet_zero_load(record: xr.Dataset) -> xr.Dataset:
    """Return `zero_load` for those who report a drift in another way, or do not mind it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DriftWarning)
        return zero_load(record)


def found_cell(record: xr.Dataset, *, false_alarm: float = 1e-3) -> dict[str, Any]:
    """Arguments of the `LoadCell` of `LoadCell.from_zero_load`; see there."""
    found = zero_load(record, false_alarm=false_alarm)
    count = int(found["unloaded"].sum())
    if count < FEWEST:
        raise RecordError(
            f"the record has {count} samples that are unloaded for certain, and bias and noise take {FEWEST}: record "
            "some before first contact and after snap-off, or state the load cell by hand, LoadCell(bias=..., ...)"
        )
    bias, uncertainty = (np.nan_to_num(found[name].values) for name in ("bias", "bias_uncertainty"))
    moment, *forces = (float(noise) for noise in found["noise"].values)
    forces = [noise for noise in forces if not math.isnan(noise)]
    larger, smaller = max(forces, default=0.0), min(forces, default=0.0)
    freedom = count - FEWEST + 1
    differ = larger > 0.0 and (smaller == 0.0 or 2.0 * fdtrc(freedom, freedom, (larger / smaller) ** 2) < false_alarm)
    pooled = math.sqrt(float(np.mean(np.square(forces)))) if forces else 0.0
    return {
        "moment_noise": 0.0 if math.isnan(moment) else moment,
        "force_noise": larger if differ else pooled,
        "bias": tuple(bias.tolist()),
        "bias_uncertainty": tuple(uncertainty.tolist()),
        "frame": frame_of(record),
    }


def _step(values: Floats) -> float:
    """Step of a reading: its smallest difference, if all others are multiples of it; else 0."""
    different = np.unique(values)
    if not 2 <= different.size < values.size:
        return 0.0
    step = float(np.diff(different).min())
    whole = (different - different[0]) / step
    # With two different numbers both must repeat: noise does not repeat itself, but zero load without noise does.
    few = different.size == 2 and min(np.count_nonzero(values == v) for v in different) == 1
    return 0.0 if few or np.any(np.abs(whole - np.round(whole)) > _STEPS) else step


def _positions(travel: Floats) -> Index:
    """Return the position of each sample of a sweep, one each where positions are too few to see contact begin."""
    positions = positions_of(travel)
    return positions if positions[-1] + 1 >= _MIN_SAMPLES else np.arange(travel.size, dtype=np.intp)


def _bounds(readings: Floats, positions: Index, false_alarm: float, floor: Floats) -> ContactBounds:
    """Return the bounds of contact of one sweep, from the means of its positions: their noise may be correlated."""
    means = means_of_positions(readings, positions)
    bounds = contact_bounds(means, false_alarm, floor * len(means) / len(readings))
    if not bounds.found and len(means) < _MIN_SAMPLES:
        bounds = replace(bounds, before=0, after=0)
    if len(means) == len(readings):
        return bounds
    firsts = np.searchsorted(positions, np.arange(len(means) + 1))  # the first sample of each position, and the end

    def samples(pair: tuple[int, int]) -> tuple[int, int]:
        last, first = pair
        return int(firsts[last + 1]) - 1 if last >= 0 else -1, int(firsts[first]) if first >= 0 else -1

    return replace(
        bounds,
        onset=samples(bounds.onset),
        snap_off=samples(bounds.snap_off),
        before=int(firsts[bounds.before]),
        after=len(readings) - int(firsts[len(means) - bounds.after]),
    )


class _Stretch(NamedTuple):
    """Readings of an unloaded stretch in which the zero is constant."""

    readings: float
    freedom: float  # degrees of freedom of `squares`
    mean: Floats  # shape (channels,)
    squares: Floats  # sum of squares about the mean, shape (channels,)

    @classmethod
    def of_readings(cls, values: Floats) -> _Stretch:
        """Return the stretch of readings of shape (samples, channels)."""
        mean = values.mean(axis=0)
        return cls(len(values), len(values) - 1.0, mean, ((values - mean) ** 2).sum(axis=0))

    @classmethod
    def of_means(cls, values: Floats, weight: Floats, freedom: Floats, scatter: Floats) -> _Stretch:
        """Return the stretch of means of shape (samples, channels), with the numbers of readings behind them."""
        mean = np.average(values, axis=0, weights=weight)
        squares = scatter.sum(axis=0) + weight @ (values - mean) ** 2
        return cls(weight.sum(), freedom.sum() + len(values) - 1.0, mean, squares)


def _stretches(record: xr.Dataset, channels: tuple[str, ...], readings: Floats, parts: list[Index]) -> list[_Stretch]:
    """Return the stretches of some parts of a record, whose samples may be means of readings."""
    if not are_blocks(record):
        return [_Stretch.of_readings(readings[rows]) for rows in parts]
    weight, freedom = (record[f"block_{name}"].values.astype(float) for name in ("readings", "freedom"))
    scatter = np.stack([record[f"block_scatter_{name}"].values for name in channels], axis=-1)
    return [_Stretch.of_means(*(column[rows] for column in (readings, weight, freedom, scatter))) for rows in parts]


def _statistics(stretches: list[_Stretch], steps: Floats, floor: Floats, false_alarm: float) -> dict[str, Floats]:
    """Mean and deviation of unloaded stretches with their standard errors, shape (channels,)."""
    sizes = np.array([stretch.readings for stretch in stretches], dtype=float)
    count, groups = sizes.sum(), len(stretches)
    names = ("bias", "bias_uncertainty", "noise", "noise_uncertainty", "same_bias_p_value")
    freedom = sum(stretch.freedom for stretch in stretches)
    if count < FEWEST or freedom < 1:
        return {name: np.full(steps.size, np.nan) for name in names}
    means = np.stack([stretch.mean for stretch in stretches])
    within = np.sum([stretch.squares for stretch in stretches], axis=0)
    variance = within / freedom
    rounded = steps > 0.0
    variance[rounded] = np.maximum(variance, steps**2 / 12.0)[rounded]
    bias = sizes @ means / count
    error = variance / count
    # With noise below half a step readings change too rarely for their mean to average over the step.
    error[rounded & (variance < 0.25 * steps**2)] += (steps**2 / 12.0)[rounded & (variance < 0.25 * steps**2)]
    p_value = np.ones(steps.size)
    if groups > 1:
        between = (sizes[:, None] * (means - bias) ** 2).sum(axis=0)
        safe = np.maximum(variance, np.maximum(floor, np.finfo(float).tiny))
        p_value = fdtrc(groups - 1, freedom, between / (groups - 1) / safe)
        spread = np.maximum(between - (groups - 1) * variance, 0.0) / (count - (sizes**2).sum() / count)
        error = np.where(p_value < false_alarm / steps.size, error + spread, error)
    noise = np.sqrt(variance)
    values = (bias, np.sqrt(error), noise, noise / math.sqrt(2.0 * freedom), p_value)
    return dict(zip(names, values, strict=True))


def _labelled(
    record: xr.Dataset,
    sweeps: list[Index],
    bounds: list[ContactBounds],
    unloaded: Flags,
    statistics: dict[str, Floats],
    channels: tuple[str, ...],
) -> xr.Dataset:
    angle = record["drive_angle"].values
    variables: dict[str, Any] = {
        "contact": ("sweep", [of_sweep.found for of_sweep in bounds], {"long_name": "whether contact was found"}),
        "p_value": ("sweep", [of_sweep.p_value for of_sweep in bounds], {"long_name": "p-value of no contact"}),
        "unloaded": ("sample", unloaded, {"long_name": "whether the sample is unloaded"}),
    }
    for name, event in (("onset", "first contact"), ("snap_off", "snap-off")):
        inside = [getattr(of_sweep, name) for of_sweep in bounds]
        sample = np.array(
            [[-1 if i < 0 else int(rows[i]) for i in pair] for rows, pair in zip(sweeps, inside, strict=True)]
        )
        dims = ("sweep", "side")
        variables[name] = (dims, sample, {"long_name": f"samples beside {event}"})
        attrs = {"units": "rad", "long_name": f"drive angles beside {event}"}
        variables[f"{name}_drive_angle"] = (dims, np.where(sample < 0, np.nan, angle[sample]), attrs)
        if carried_sweeps(record):
            attrs = {"long_name": f"travels of the drive beside {event}"}
            variables[f"{name}_travel"] = (dims, np.where(sample < 0, np.nan, travels_of(record)[sample]), attrs)
    for name, values in statistics.items():
        of_all = np.full(len(CHANNELS), np.nan)
        of_all[[CHANNELS.index(channel) for channel in channels]] = values
        variables[name] = ("channel", of_all, {"long_name": name.replace("_", " ")})
    units = record.attrs["units"]
    coords = {
        "sweep": [int(record["sweep"].values[rows[0]]) for rows in sweeps],
        "side": ["before", "after"],
        "channel": list(CHANNELS),
        "unit": ("channel", [COLUMNS[name].unit_in(units) for name in CHANNELS]),
    }
    return xr.Dataset(variables, coords, {"units": units, "load_cell_frame": frame_of(record)})
