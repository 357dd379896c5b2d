"""The measurement of loads and of records by a sensor, and the correction of records for its known errors."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats, RandomSource
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell.data_sheet import CERTAIN, DataSheet
from tactile_bayes.load_cell.discrepancy import Discrepancy
from tactile_bayes.load_cell.memory import remembered
from tactile_bayes.record import CHANNELS, column_of, frame_of, in_frame, loads_of, present_channels, validate
from tactile_bayes.record.schema import LARGEST_DRIVE_ANGLE, SIGNED
from tactile_bayes.record.times import times_of

_PREFIX = "load_cell_"
_TAKEN_OUT = tuple(f"{_PREFIX}{name}" for name in SIGNED if name != "correlation_")


def corrupted_loads(
    sheet: DataSheet,
    loads: Floats,
    rng: RandomSource,
    noise_scale: ArrayLike = 1.0,
    discrepancy: Discrepancy | None = None,
    zeros: ArrayLike = 0.0,
    times: Floats | None = None,
) -> Floats:
    """Simulate readings of loads: memory, lever, gain and bias, drift, noise and discrepancy, the range, and the steps.
    Shapes: loads (..., samples, 3), noise_scale (..., 3), times [s] (samples,); `zeros` add to the bias.
    """
    noise = rng.standard_normal(loads.shape)
    if any(sheet.correlation):
        noise = noise @ np.linalg.cholesky(sheet.correlation_matrix).T
    loads = remembered(loads, (sheet.lag, sheet.lag_seconds, sheet.play), times)
    readings = sheet.expected(loads) + np.asarray(zeros)
    if any(sheet.bias_uncertainty):
        readings += np.array(sheet.bias_uncertainty) * rng.standard_normal((*loads.shape[:-2], 1, 3))
    if sheet.drift is not None:
        readings += sheet.drift.draw(rng.standard_normal(loads.shape))
    if math.isfinite(sheet.degrees_of_freedom):
        noise /= np.sqrt(rng.chisquare(sheet.degrees_of_freedom, loads.shape) / sheet.degrees_of_freedom)
    scale = np.asarray(noise_scale, dtype=float)
    readings += sheet.deviation(loads) * (scale[..., None, :] if scale.ndim else scale) * noise
    if discrepancy is not None:
        readings += discrepancy.draw(rng)
    return rounded(sheet.cut(readings), sheet.resolution)


def corrupted_angles(sheet: DataSheet, angles: Floats, direction: ArrayLike, rng: RandomSource) -> Floats:
    """Simulate readings of drive angles of any shape: offset, backlash by the direction, noise, then the steps."""
    noise = sheet.drive_angle_noise * rng.standard_normal(angles.shape)
    return rounded(angles + sheet.misread(direction) + noise, np.array(sheet.drive_angle_resolution))


def rounded(values: Floats, step: Floats) -> Floats:
    """Round values to the nearest multiple of a step; a step of 0 leaves them unchanged."""
    if not np.any(step):
        return values
    with np.errstate(over="ignore"):
        steps = np.round(values / np.where(step > 0.0, step, np.inf))
    return np.where((step > 0.0) & np.isfinite(steps), steps * step, values)


def measured(sheet: DataSheet, record: xr.Dataset, rng: np.random.Generator, zeros: ArrayLike = 0.0) -> xr.Dataset:
    """Measure a record with a sensor, and zeros in addition to its bias; see `LoadCell.measure`."""
    made = validate(record if sheet.frame is None else in_frame(record, sheet.frame))
    entries = _after(sheet, stated_entries(made)).entries()
    present = present_channels(made)
    times = times_of(made) if np.any(sheet.lag_seconds) else None
    readings = corrupted_loads(sheet, loads_of(made), rng, zeros=zeros, times=times)
    for index, channel in enumerate(CHANNELS):
        if channel not in present:
            continue
        if np.isnan(readings[:, index]).any():
            raise ParameterError(
                f"the load cell has cross-talk on {channel} from a channel that the record misses "
                f"({', '.join(name for name in CHANNELS if name not in present)}): measure the complete record"
            )
        _put(made, channel, readings[:, index])
    if any(getattr(sheet, f"drive_angle_{flaw}") for flaw in ("offset", "backlash", "noise", "resolution")):
        angles = corrupted_angles(sheet, made["drive_angle"].values, made["direction"].values, rng)
        beyond = np.abs(angles) > LARGEST_DRIVE_ANGLE
        if beyond.any():
            sample = int(np.argmax(beyond))
            raise ParameterError(
                f"the encoder reads {float(angles[sample])!r} rad at sample {sample}, more than a turn (2π): give a "
                "smaller drive_angle_offset, drive_angle_backlash, drive_angle_noise or drive_angle_resolution, in "
                "radians (numpy.radians converts degrees)"
            )
        _put(made, "drive_angle", angles)
    made.attrs |= {_PREFIX + name: value for name, value in entries.items()}
    return validate(made)


def corrected(sheet: DataSheet, record: xr.Dataset) -> xr.Dataset:
    """Correct a record for bias, gain, lever, and the encoder's offset and backlash; see `LoadCell.corrected`."""
    ideal = DataSheet()
    if all(getattr(sheet, name) == getattr(ideal, name) for name in CERTAIN):
        return record
    corrected = validate(record)
    present = [CHANNELS.index(name) for name in present_channels(corrected)]
    if np.any(np.delete(sheet.gain_matrix, present, axis=1)[present]):
        raise ParameterError(
            "the load cell has cross-talk from a channel that the record misses: its gain and lever cannot be taken "
            "out; infer_contour works without"
        )
    loads = loads_of(corrected)[:, present] - np.array(sheet.bias)[present]
    if any(getattr(sheet, name) != getattr(ideal, name) for name in ("gain", "lever", "moment_curve")):
        loads = sheet.loads_of(loads, np.array(present))
    for values, index in zip(loads.T, present, strict=True):
        corrected[CHANNELS[index]].values = values
    corrected["drive_angle"].values = corrected["drive_angle"].values - sheet.misread(corrected["direction"].values)
    corrected.attrs = {k: v for k, v in corrected.attrs.items() if not str(k).startswith(_TAKEN_OUT)}
    return validate(corrected)


def stated_entries(record: xr.Dataset) -> dict[str, Any]:
    """Entries of the data sheet in the attributes of a record, without the frame."""
    return {
        str(name).removeprefix(_PREFIX): value
        for name, value in record.attrs.items()
        if str(name).startswith(_PREFIX) and not isinstance(value, str)
    }


def _put(made: xr.Dataset, name: str, readings: Floats) -> None:
    """Replace a column by readings, and store it as the truth unless there is one."""
    ideal, truth = made[name], column_of(f"truth_{name}")
    if truth is not None and truth.name not in made:
        attrs = {"units": ideal.attrs["units"], "long_name": truth.long_name_in(frame_of(made))}
        made[truth.name] = ("sample", ideal.values.copy(), attrs)
    made[name] = ("sample", readings, ideal.attrs)


def _after(sheet: DataSheet, stated: dict[str, Any]) -> DataSheet:
    """Data sheet of two successive measurements of a record."""
    ideal = DataSheet()
    here, before = DataSheet.from_entries({**sheet.entries(), "frame": None}), DataSheet.from_entries(stated)
    if ideal in (here, before):
        return here if before == ideal else before
    white = DataSheet(
        force_noise=math.hypot(before.force_noise, here.force_noise),
        moment_noise=math.hypot(before.moment_noise, here.moment_noise),
    )
    for one in (before, here):
        if replace(one, force_noise=white.force_noise, moment_noise=white.moment_noise) != white:
            raise ParameterError(
                "the record has been measured before, and two load cells, one of them with more than white normal "
                "noise, cannot be described as one: measure the ideal record, or remove its load_cell_ "
                "attributes"
            )
    return white
