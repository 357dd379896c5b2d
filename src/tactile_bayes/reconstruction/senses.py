"""The sense of friction in samples: which way the rod slides, and where it may also stick or slide the other way."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Index
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.fitting import fit_contacts, raw_contacts
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.reconstruction.estimate import Estimate, are_weighed, constrained_estimate
from tactile_bayes.reconstruction.histories import least_turn, turned_sweeps
from tactile_bayes.reconstruction.samples import Samples
from tactile_bayes.record import carried_sweeps
from tactile_bayes.record.sweep_segments import turning_points

_NO_CONTACT = 25.0  # bound on the misfit of a loaded sample; the value for a sample without a contact
_OFF = 4.0  # misfit from which a sample does not slide in the sense that is taken
_TWENTY_TO_ONE = 6.0  # difference of misfits at which one of two sides is twenty times as likely


def with_likelier_senses(samples: Samples, measured: xr.Dataset, cell: LoadCell, friction: float) -> Samples:
    """Return samples with the senses in which they slide, and with those of which it is sure. A rod that is turned
    about a pivot slides as it is turned, and one that is carried as if it were turned on; the other way where a way of
    the drive fits clearly better so."""
    if not friction:
        return samples
    sense, is_sure = samples.sense.copy(), ~_is_bent(samples)
    carried = measured.sweep.isin(carried_sweeps(measured)).values
    for rows in _ways(measured, cell):
        if not carried[rows[0]] and samples.reading.drive_angle[rows[-1]] < samples.reading.drive_angle[rows[0]]:
            sense[rows] *= -1.0
        part = samples.take(rows)._replace(sense=sense[rows])
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
    return _misfit(one, friction) < _misfit(other, friction) - _TWENTY_TO_ONE


def _misfit(samples: Samples, friction: float) -> float:
    """Return the sum of squared deviations of loaded samples, with 2 log n for each change between the phases. Without
    it, a sense in which noisy samples have both phases to choose from would fit better."""
    with np.errstate(over="ignore"):
        usable = np.isfinite(samples.reading.loads**2).all(axis=1)
    some = samples.take(np.flatnonzero(samples.loaded & ~samples.cut_off & usable))
    if not some.side.size:
        return 0.0
    fit = fit_contacts(some.reading, some.friction_angles(friction), some.rods)
    each = np.full((2, some.side.size), _NO_CONTACT)
    for phase, of_phase in zip((TIP, TANGENTIAL), each, strict=True):
        np.fmin(of_phase, fit.misfit, out=of_phase, where=(fit.phase == phase) | fit.at_edge)
        np.fmin(of_phase, fit.misfit + fit.rival, out=of_phase, where=fit.other_phase == phase)
    change, sums = 2.0 * np.log(some.side.size), np.zeros(2)
    for of_sample in each.T:
        sums = np.minimum(sums, sums[::-1] + change) + of_sample
    return float(sums.min())


def of_any_sense(samples: Samples, friction: float) -> tuple[Samples, Estimate]:
    """Return samples with the senses in which they touch, and their most likely contacts. Where a sense is not sure and
    does not fit, the rod sticks, and the contact is that of the raw method; or it slides the other way, if the force
    lies outside the cone of friction there."""
    found = constrained_estimate(samples, samples.friction_angles(friction))
    assert found.misfit is not None
    with np.errstate(invalid="ignore"):
        off = ~samples.is_sure & ~(found.misfit <= _OFF) & (friction > 0.0)
    if not off.any():
        return samples, found
    raw = raw_contacts(samples.reading, np.zeros(off.size), samples.rods, samples.has_noise)
    of_force = (raw.place[:, 2] - raw.tip_angle + samples.rod.surface.half_angle) / np.arctan(friction)
    off &= raw.place[:, 3] < 1.0
    samples = samples._replace(sense=np.where(off, np.clip(of_force, -1.0, 1.0), samples.sense))
    found = constrained_estimate(samples, samples.friction_angles(friction))
    if found.covariance is not None:
        found.covariance[np.abs(samples.sense) < 1.0] = raw.covariance[np.abs(samples.sense) < 1.0]
    return samples, found
