"""The moving rod: its shapes along the most probable contour at the samples of a record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours import Contour
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.experiment import likelihood_of
from tactile_bayes.inference.result import best_draw, record_of
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.mechanics.phases import NONE, PHASE_NAMES
from tactile_bayes.record import loads_of, rod_of, rows_of_sweeps
from tactile_bayes.rig.stated import rod_with
from tactile_bayes.sweep import ManyUnits, to_lab_frame

_MOST = 900  # largest number of samples shown; of a longer record every second, or third, and so on
_POINTS = 33


@dataclass(frozen=True)
class Frames:
    """Rods along the most probable contour, at samples of a record, sweep after sweep; in the record's units."""

    contour: Contour  # of the draw with the highest posterior density
    samples: Index  # numbers of the samples in the record, shape (n,)
    sweep: Index  # their sweeps
    rod_x: Floats  # the rod from pivot to tip, shape (n, points)
    rod_y: Floats
    contact_x: Floats  # contact point on the object, shape (n,); NaN out of contact
    contact_y: Floats
    phase: NDArray[np.str_]  # "tip", "tangential" or "none"
    drive_angle: Floats  # slope of the rod at the pivot [rad]
    # Drive angle as read, without the encoder's offset and backlash [rad]: the angle of a load cell that turns with the
    # drive. It differs from `drive_angle` by the deflection of a compliant suspension.
    cell_angle: Floats
    loads: (
        Floats  # holding moment and support reaction in the laboratory frame, without the cell's errors, shape (n, 3)
    )
    pivots: Floats  # pivots of that draw, shape (pivots, 2)
    every: int  # every how many samples one is shown


def motion_of(posterior: xr.DataTree, most: int = _MOST) -> Frames:
    """Return the rods of the most probable draw, with its rigidity, encoder, friction, suspension and pivots."""
    record, draw = record_of(posterior), best_draw(posterior)
    contour = contours_of(draw, posterior.attrs["family"])
    likelihood, unknowns = likelihood_of(posterior, record)
    rig = unknowns.rig({name: np.atleast_1d(draw[name].values) for name in unknowns.names})
    paths = likelihood.paths(contour, rig)

    numbers = record.sweep.values
    every = max(1, -(-numbers.size // most))
    samples = np.concatenate([rows[::every] for rows in rows_of_sweeps(numbers)])
    batch_index = likelihood.segments.of_sample[samples]
    mirrored = paths.sweep_frame.mirrored[batch_index]
    read = likelihood.segments.drive_angles
    angle = (read - likelihood.misread(rig)[0])[samples]
    angle_in_sweep_frame = np.where(mirrored, np.pi - angle, angle)
    states = paths.states(batch_index, likelihood.travels(read, rig)[0, samples])
    rod = rod_with(rod_of(record), {**unknowns.known, **{name: float(draw[name]) for name in unknowns.names}})
    stiffer = float(np.ravel(rig.rigidity_scale)[0])
    units = ManyUnits(rod.length_unit, stiffer * rod.moment_unit, stiffer * rod.force_unit)
    in_lab_frame = to_lab_frame(paths.sweep_frame, batch_index, states, units)
    loaded = states.wrench.phase != NONE
    slope = np.where(loaded, states.wrench.drive_angle, angle_in_sweep_frame)
    wrench = (np.where(loaded, getattr(states.wrench, name), 0.0) for name in ("holding_moment", "force_x", "force_y"))
    sign = np.where(mirrored, -1.0, 1.0)
    x, y = rod_shape(slope, *wrench, points=_POINTS, side=1.0, rods=rod.mirrored(sign))
    loads = loads_of(in_lab_frame)
    starts = np.stack([paths.sweep_frame.base_x, paths.sweep_frame.base_y], axis=-1)
    bases = np.stack([record["base_x"].values, record["base_y"].values], axis=-1)[samples]
    base_x, base_y = (starts[batch_index] + bases - likelihood.segments.bases[batch_index]).T
    return Frames(
        contour=contour.take(np.array(0)),
        samples=samples,
        sweep=numbers[samples],
        rod_x=base_x[:, None] + sign[:, None] * x * rod.length_unit,
        rod_y=base_y[:, None] + y * rod.length_unit,
        contact_x=np.where(loaded, in_lab_frame["contact_x"], np.nan),
        contact_y=np.where(loaded, in_lab_frame["contact_y"], np.nan),
        phase=np.array(PHASE_NAMES)[states.wrench.phase],
        drive_angle=np.where(mirrored, np.pi - slope, slope),
        cell_angle=angle,
        loads=np.where(loaded[:, None], loads, 0.0),
        pivots=np.unique(starts, axis=0),
        every=every,
    )
