"""The sense of friction in samples: which way the rod slides, and where it may also stick or slide the other way."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction.constrained import are_weighed, constrained_estimate
from tactile_bayes.reconstruction.estimate import Estimate
from tactile_bayes.reconstruction.histories import least_turn, turned_sweeps
from tactile_bayes.reconstruction.samples import Samples
from tactile_bayes.record import carried_sweeps
from tactile_bayes.record.sweep_segments import turning_points

__all__ = ["fits_better", "slopes_by_friction", "with_likelier_senses"]

_NO_CONTACT = 25.0  # bound on the misfit of a loaded sample; the value for a sample without a contact
_TWENTY_TO_ONE = 6.0  # difference of misfits at which one of two sides is twenty times as likely


def with_likelier_senses(samples: Samples, measured: xr.Dataset, cell: LoadCell, friction: float) -> Samples:
    """Return samples with the ways of drives with a history along which they slide the other way, if they fit clearly
    better so, and with those of which the sense is sure: a way of the drive has one."""
    if not friction:
        return samples
    sense, is_sure = samples.sense.copy(), ~_is_bent(samples)
    for rows in _ways(measured, cell):
        part = samples.take(rows)
        sense[rows] *= -1.0 if fits_better(part._replace(sense=-part.sense), part, friction) else 1.0
        is_sure[rows] = False
    return samples._replace(sense=sense, is_sure=is_sure)


def _ways(measured: xr.Dataset, cell: LoadCell) -> list[Index]:
    """Return the samples of each way of the drives with a history."""
    ways = []
    turned = turned_sweeps(measured, cell)
    for sweep in sorted({*carried_sweeps(measured), *turned}):
        rows = np.flatnonzero(measured.sweep.values == sweep)
        angle = measured.drive_angle.values[rows]
        turns = turning_points(angle, least_turn(angle, cell)) if sweep in turned else []
        ways += np.split(rows, np.array(turns, dtype=np.intp) + 1)
    return [rows for rows in ways if rows.size]


def _is_bent(samples: Samples) -> Flags:
    """Return where the rod is curved toward the object anywhere, so that it may slide outward at first."""
    rods = samples.rods
    if rods.profile is None:
        return np.asarray(rods.curvature > 0.0)
    toward = rods.curvature[:, None] * (rods.profile.curvature[:, 0] + rods.profile.bend)
    return np.asarray((toward > 0.0).any(axis=1))


def fits_better(one: Samples, other: Samples, friction: float) -> bool:
    """Return whether the misfit of samples is clearly smaller than that of others; False without a noise level."""
    if not (are_weighed(one) and are_weighed(other)):
        return False
    misfits = []
    for samples in (one, other):
        found = constrained_estimate(samples, samples.friction_angles(friction)).misfit
        none = np.nan if found is None else found
        misfits.append(float(np.minimum(np.nan_to_num(none, nan=_NO_CONTACT), _NO_CONTACT)[samples.loaded].sum()))
    return misfits[0] < misfits[1] - _TWENTY_TO_ONE


def slopes_by_friction(estimate: Estimate, samples: Samples, friction: float) -> Floats:
    """Return the slope angle, and the other end of those that friction allows, dimensionless, shape (n, 2).

    The force lies within the cone of friction about the contour's normal, at an edge of it if the rod slides.
    """
    slope = estimate.place[:, 2]
    return np.stack([slope, slope + np.where(samples.is_sure, 0.0, samples.sense * 2.0 * np.arctan(friction))], axis=1)
