"""Tables of an inspection: samples with their flags, channels and sweeps."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.diagnostics.inspection.samples import outliers, repeat_chance, repeated, stuck, uneven_steps
from tactile_bayes.diagnostics.inspection.stretches import autocorrelation, position_scatter
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import (
    CHANNELS,
    carried_sweeps,
    loads_of,
    means_of_positions,
    positions_of,
    present_channels,
    travels_of,
)

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
