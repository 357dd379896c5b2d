"""Contacts from noisy samples: by raw Step 2, or fitted on the sheets of possible contacts.

A contact has three degrees of freedom, and a sample has four numbers (drive angle, holding moment, two forces), so that
the sum of squared residuals has one degree of freedom. Each phase is fitted by the Levenberg–Marquardt method on its
sheet (`contact_coordinates`), sample by sample (`single_sample`). An optimum beyond the edge where the two sheets meet
does not count; where neither sheet has one before it, the most likely contact lies on the edge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.contacts.contact_coordinates import ARCLENGTH, DRIVE_ANGLE, FORCE, PSI1, contact_workspace
from tactile_bayes.mechanics.contacts.fits import ContactFit, RawFit, Reading, SheetFit
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP
from tactile_bayes.mechanics.rods.profile import Rods, rods_of

# Free coordinates on a sheet; None stands for the edge.
_FREE = {TIP: (FORCE, PSI1), TANGENTIAL: (FORCE, ARCLENGTH), None: (FORCE,)}
_BLOCK = 4096

_COARSE, _COARSE_STEPS = 1e-3, 10
# Gain in the sum of squares that the next step promises, relative to one plus the sum, at which a descent ends.
_SETTLED, _MOST_STEPS = 1e-12, 100
# Factor on the other sheet's sum of squares, and addend, beyond which a coarsely fitted sheet is given up.
_OUTDONE = 2.0, 10.0
# Arc lengths to start from in tangential contact, and shares of the range of ψ1 in tip contact.
_STARTS = (0.1, 0.3, 0.5, 0.7, 0.9)
# Correlation that counts as zero, and the value that replaces a covariance that is not finite.
_ROUNDING, _BEYOND_ALL = 1e-15, 1e300
_LEAST_MOMENT = 0.1  # least moment of a start, in its standard deviations
_SAME = 1e-4  # difference of coordinates of one and the same optimum


def raw_contacts(reading: Reading, delta: Floats, rods: Rods | ArrayLike, has_noise: bool) -> RawFit:
    """Contacts of n samples by Step 2, with friction angles and rods, or rest curvatures of arcs, of shape (n,).
    Without noise there are no covariances and no bends."""
    from tactile_bayes.mechanics.contacts.single_sample import Room, raw_fits
    from tactile_bayes.mechanics.poses.beam import varied_of  # numba takes a second to load

    count = delta.size
    noisy = count if has_noise else 0
    (place, other), (tip_angle, deviation, other_deviation) = np.empty((2, count, 4)), np.empty((3, count))
    fit = RawFit(place, tip_angle, np.empty((noisy, 4, 4)), np.empty(noisy), deviation, other, other_deviation)
    room = Room(np.empty((1, 4)), np.empty((4, 4)), np.empty((2, 4, 5)), contact_workspace())
    curvature, profile, stem = rods_of(rods, count)
    axes = _principal_axes(reading.covariance[:noisy])
    reading = plain(reading._replace(covariance=reading.covariance[:0]))
    raw_fits(reading, axes, np.array(delta), curvature, varied_of(profile), stem, fit, room)
    return fit


def _principal_axes(covariance: Floats) -> Floats:
    """Principal axes of covariances, one standard deviation long, in columns."""
    matrix = np.where(np.isfinite(covariance), covariance, _BEYOND_ALL)
    deviation = np.sqrt(np.abs(np.diagonal(matrix, axis1=1, axis2=2)))
    matrix[np.abs(matrix) <= _ROUNDING * deviation[:, :, None] * deviation[:, None, :]] = 0.0
    axes = deviation[:, :, None] * np.eye(3)
    correlated = (matrix != 0.0).sum(axis=(1, 2)) > 3
    variances, turned = np.linalg.eigh(matrix[correlated])
    axes[correlated] = turned * np.sqrt(np.maximum(variances, 0.0))[:, None, :]
    return axes


def fit_contacts(reading: Reading, friction_angle: Floats, rods: Rods | ArrayLike = 0.0) -> ContactFit:
    """Find the most likely contacts of samples, for rods, or rest curvatures of arcs that are mirrored like these."""
    size = reading.drive_angle.size
    each, blocks = rods_of(rods, size), []
    for begin in range(0, max(size, 1), _BLOCK):
        part = slice(begin, begin + _BLOCK)
        blocks.append(_fit_block(reading.take(part), friction_angle[part], each.take(part)))
    return ContactFit(*(np.concatenate(column) for column in zip(*blocks, strict=True)))


def _fit_block(reading: Reading, delta: Floats, rods: Rods) -> ContactFit:
    target = _Target(reading, delta, rods)
    sheets = [(TANGENTIAL, False), (TIP, False)] + ([] if rods.are_straight else [(TIP, True)])
    descents = [_Descent(target, *sheet) for sheet in sheets]
    everyone = np.arange(delta.size)
    for descent in descents:
        descent.go(everyone, _COARSE, _COARSE_STEPS)
    misfits = np.stack([descent.misfit_before(delta) for descent in descents])
    for k, descent in enumerate(descents):
        others = np.delete(misfits, k, axis=0).min(axis=0)
        descent.go(
            np.flatnonzero((misfits[k] <= _OUTDONE[0] * others + _OUTDONE[1]) | np.isinf(others)), _SETTLED, _MOST_STEPS
        )
    misfits = np.stack([descent.misfit_before(delta) for descent in descents])

    best = misfits.argmin(axis=0)
    at_edge = np.isinf(misfits.min(axis=0))
    # A contact on the edge takes its variance from the sheet with the smaller misfit.
    best[at_edge] = descents[1].misfit[at_edge] < descents[0].misfit[at_edge]
    z, covariances = np.stack([d.z for d in descents]), np.stack([d.covariance() for d in descents])
    coordinates, covariance = z[best, everyone], covariances[best, everyone]
    misfit = np.stack([d.misfit for d in descents])[best, everyone]
    ends = best > 0
    free = np.where(ends, PSI1, ARCLENGTH)[:, None]
    spread = np.sqrt(np.take_along_axis(np.diagonal(covariance, axis1=1, axis2=2), free, axis=1)[:, 0])
    turn = coordinates[:, PSI1] + delta
    with np.errstate(divide="ignore", invalid="ignore"):
        clearance = np.where(ends, np.minimum(turn, np.pi - turn), 1.0 - coordinates[:, ARCLENGTH]) / spread
    where = np.flatnonzero(at_edge)
    if where.size:
        edge = _Descent(_Target(reading.take(where), delta[where], rods.take(where)), None)
        edge.go(np.arange(where.size), _SETTLED, _MOST_STEPS)
        coordinates[where], misfit[where], clearance[where] = edge.z, edge.misfit, 0.0
    same = ends & (np.arange(len(descents))[:, None] > 0) & (np.abs(z - coordinates).max(axis=2) < _SAME)
    with np.errstate(invalid="ignore"):
        excess = np.where(at_edge | same, np.inf, misfits - misfit)
    excess[best, everyone] = np.inf
    next_best = excess.argmin(axis=0)
    phases = np.array([phase for phase, _ in sheets], dtype=np.int8)
    return ContactFit(
        coordinates,
        covariance,
        misfit,
        phases[best],
        at_edge,
        clearance,
        excess[next_best, everyone],
        z[next_best, everyone],
        phases[next_best],
    )


def fit_sheet(
    reading: Reading, delta: Floats, phase: int | None, rods: Rods | ArrayLike = 0.0, is_over: bool = False
) -> SheetFit:
    """Find the best contact of one phase, beyond its edge too, or on the edge (None). With `is_over` it starts from a
    tip that is turned beyond the normal of the contour."""
    descent = _Descent(_Target(reading, delta, rods_of(rods, delta.size)), phase, is_over)
    descent.go(np.arange(delta.size), _SETTLED, _MOST_STEPS)
    return SheetFit(descent.z, descent.covariance(), descent.misfit)


class _Descent:
    """The Levenberg–Marquardt method on one sheet, for many samples."""

    def __init__(self, target: _Target, phase: int | None, is_over: bool = False) -> None:
        self._target = target
        self._phase = phase
        self._is_over = is_over
        self._free = _FREE[phase] if target.is_exact else (*_FREE[phase], DRIVE_ANGLE)
        self.z = np.full((target.delta.size, 4), np.nan)
        count = len(self.z)
        self.misfit = np.full(count, np.inf)
        self._normal = np.full((count, len(self._free), len(self._free) + 1), np.nan)
        self._hardness = np.full(count, 1e-3)
        self._start()

    def _start(self) -> None:
        """Start from raw Step 2, or from the best of several contacts where it has no solution."""
        reading, delta, phase = self._target.reading, self._target.delta, self._phase
        force = np.hypot(reading.loads[:, 1], reading.loads[:, 2])
        z = np.stack([force, -delta, np.ones(force.size), reading.drive_angle], axis=1)
        raw: list[Floats] = []
        if phase is None:
            coordinate, options = FORCE, [force * share for share in (1.0, 0.5, 2.0)]
        elif phase == TIP:
            low, high = (0.5 * np.pi, np.pi - delta) if self._is_over else (-delta, 0.5 * np.pi)
            most = high if self._is_over else 1.4
            raw = [np.clip(psi1, low, most) for _, psi1 in self._raw_starts()]
            coordinate, options = PSI1, [*raw, *(np.asarray(low + share * (high - low)) for share in _STARTS)]
        else:
            raw = [np.clip(arclength, 0.02, 1.0) for arclength, _ in self._raw_starts()]
            coordinate, options = ARCLENGTH, [*raw, *(np.full(force.size, share) for share in _STARTS)]
        left = np.arange(force.size)
        best, found = np.full(force.size, np.inf), self.z
        for number, values in enumerate(options):
            self.z = z.copy()
            self.z[:, coordinate] = values
            self.go(left, 0.0, 0)
            better = left[self.misfit[left] < best[left]]
            best[better], found[better] = self.misfit[better], self.z[better]
            if number == len(raw) - 1:
                left = np.flatnonzero(np.isinf(best))
                if not left.size:
                    break
        self.z = found
        if len(raw) != 1 or left.size:
            self.go(np.arange(force.size), 0.0, 0)
        self._hardness[:] = 1e-3

    def _raw_starts(self) -> list[tuple[Floats, Floats]]:
        """Arc lengths and ψ1 by raw Step 2; where the moment has the wrong sign, with a small one of the right sign.
        Unless all rods are straight and uniform, they follow from the wrong sign too: such rods may be bent both
        ways."""
        reading, rods = self._target.reading, self._target.rods
        moment, least = reading.loads[:, 0], _LEAST_MOMENT * np.sqrt(reading.covariance[:, 0, 0])
        moments = [np.maximum(moment, least)]
        if not rods.are_straight and np.any(moment < least):
            moments.append(moment)
        pairs = [contact_pairs(reading, one, self._target.delta, rods) for one in moments]
        return [(pair[:, int(self._is_over), 0], pair[:, int(self._is_over), 1]) for pair in pairs]

    def go(self, who: Index, gain: float, most_steps: int) -> None:
        """Descend with the samples `who` until the gain that the next step promises is small."""
        from tactile_bayes.mechanics.contacts.single_sample import SampleWorkspace, descents
        from tactile_bayes.mechanics.poses.beam import varied_of  # numba takes a second to load

        count, target = len(self._free), self._target
        workspace = SampleWorkspace(
            np.empty((1, 4)), np.empty((4, count + 1)), np.empty((count, count)), contact_workspace()
        )
        of_rods = target.rods.curvature, varied_of(target.rods.profile), target.rods.stem
        known = target.reading, *of_rods, target.whitening, who, np.array(self._free)
        descents(*known, gain, most_steps, self.z, self.misfit, self._normal, self._hardness, workspace)

    def misfit_before(self, delta: Floats) -> Floats:
        """Sum of squares; infinite for contacts beyond the edge."""
        turn = self.z[:, PSI1] + delta
        beyond = (turn < 0.0) | (turn > np.pi) if self._phase == TIP else self.z[:, ARCLENGTH] > 1.0
        return np.where(beyond, np.inf, self.misfit)

    def covariance(self) -> Floats:
        """Covariance of the coordinates, shape (n, 4, 4)."""
        covariance = np.zeros((len(self.z), 4, 4))
        covariance[np.ix_(range(len(self.z)), self._free, self._free)] = _inverse(self._normal[:, :, :-1])
        return covariance


def _inverse(matrix: Floats) -> Floats:
    """Inverses of symmetric positive matrices; infinite where there is none."""
    scale = np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
    with np.errstate(all="ignore"):
        scaled = matrix / scale[:, :, None] / scale[:, None, :]
        index = np.arange(matrix.shape[1])
        scaled[:, index, index] = 1.0 + 1e-14
        usable = np.isfinite(scaled).all(axis=(1, 2))
        scaled[~usable] = np.eye(matrix.shape[1])
        inverse = np.linalg.inv(scaled) / scale[:, :, None] / scale[:, None, :]
    inverse[~usable] = np.inf
    return inverse


class _Target:
    """Samples, and the weights of deviations from them."""

    def __init__(self, reading: Reading, delta: Floats, rods: Rods) -> None:
        self.reading = plain(reading)
        self.delta = delta
        self.rods = rods
        self.is_exact = not np.any(reading.angle_deviation)
        self.whitening = np.linalg.inv(np.linalg.cholesky(reading.covariance))


def plain(reading: Reading) -> Reading:
    """Reading in arrays of the one layout that is compiled."""
    return Reading(*(np.array(column, dtype=float, order="C") for column in reading))


def contact_pairs(reading: Reading, moment: Floats, delta: Floats, rods: Rods) -> Floats:
    """Arc lengths and ψ1 of the two points at which a rod may touch by raw Step 2, shape (n, 2, 2)."""
    from tactile_bayes.mechanics.contacts.states import write_contacts
    from tactile_bayes.mechanics.poses.beam import varied_of  # numba takes a second to load

    wrenches = np.column_stack([reading.drive_angle, moment, reading.loads[:, 1:], delta])
    out = np.empty((delta.size, 2, 2))
    write_contacts(wrenches, rods.curvature, varied_of(rods.profile), rods.stem, np.empty((0, 6)), out)
    return out
