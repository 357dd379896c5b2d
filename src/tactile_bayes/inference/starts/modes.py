"""Modes of the posterior of a contour, found from the record alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.coordinates import Coordinates, FlankCoordinates, in_coordinates
from tactile_bayes.inference.deadline import Deadline
from tactile_bayes.inference.densities import (
    ANYTHING,
    BENT,
    EFFICIENT,
    WIDENING,
    Ends,
    Proposal,
    approximate,
    at_maximum,
)
from tactile_bayes.inference.record_likelihood.likelihood import events_of
from tactile_bayes.inference.starts.cloud import Cloud, gather, square_root
from tactile_bayes.inference.starts.contour_optimum import ContourOptimum, are_alike, optima_of
from tactile_bayes.inference.starts.residuals import left_over_noise

_MANY_SAMPLES = 100  # loaded ones, from which an optimum that explains the record is taken for the only one
_MAX_SEARCHES = 9  # after which no other begins, unless none of them explains a record of few loaded samples
# Searches that end in known modes after which no other is expected: with many loaded samples, or a normal last mode.
_REPEATS, _REPEATS_FEW_SAMPLES = 2, 4
# Efficiency of the proposal in coordinates of a flank, over that in the model's own, from which they are preferred: a
# ridge that bends beyond the draws of the importance sampling looks straight.
_FLANK_EFFICIENCY = 0.4
# Share of the touched arc beyond the vertex from which the record is of two flanks.
_OTHER_FLANK = 0.1
_MAX_EXCESS_COST = 100.0  # above the smallest cost, from which an optimum is disregarded
_MODE_RADIUS = 3.0  # distance from a mode, over that of typical points of its proposal, within which an optimum is its
_MAX_LOG_MASS_RATIO = 9.0  # from which the smaller mode is left out: one draw in ten thousand
# First round that counts of an adaptation from the curvature, whose own draws may leave out a tail, and seem efficient.
_BY_CURVATURE = 3
# Root mean square of a channel's residuals at the best optimum, over the noise of neighbours, that no noise explains.
_SMOOTH = 2.5
_EXTENT_DRAWS = 500  # from which the extent of a proposal is estimated


class PosteriorMode(NamedTuple):
    """Mode of the posterior."""

    optimum: ContourOptimum
    cloud: Cloud
    proposal: Proposal
    coordinates: Coordinates  # of the cloud and the proposal
    usual: PosteriorMode | None = None  # the mode in the model's own coordinates, if those are others


class Modes:
    """Modes of the posterior that were found so far."""

    def __init__(self, model: ContourModel, rng: np.random.Generator, deadline: Deadline) -> None:
        self.model, self.rng, self.deadline = model, rng, deadline
        self.found: list[PosteriorMode] = []
        self.is_hopeless = False  # True if no noise explains what the best optimum leaves
        self._own = model.coordinates

    def found_by_search(self) -> list[PosteriorMode]:
        """Return modes, that with the most mass first: one if it explains many loaded samples, or if none is worth a
        look, else all of mass."""
        others, found = sorted(self._not_explaining(), key=lambda one: one.cost), self.found
        if not found and others and left_over_noise(self.model, others[0].point) > _SMOOTH:
            self.is_hopeless, others = True, others[:1]
        for optimum in others:
            least = min((mode.optimum.cost for mode in found), default=optimum.cost)
            late = found and self.deadline.has_passed
            if optimum.cost < least + _MAX_EXCESS_COST and not late and not self._is_known(optimum):
                found.append(self._around(optimum))
        if not found:
            raise InferenceError("no contour was found that the rod can reach: are base, rod and units right?")
        found.sort(key=lambda mode: -mode.proposal.log_mass)
        least_mass = found[0].proposal.log_mass - _MAX_LOG_MASS_RATIO
        return [mode for mode in found if mode is found[0] or mode.proposal.log_mass > least_mass]

    def _not_explaining(self) -> list[ContourOptimum]:
        """Search, find the modes of optima that explain the record, and return the other optima."""
        others, repeats = [], 0
        many_samples = bool(np.count_nonzero(~self.model.found["unloaded"].values) >= _MANY_SAMPLES)
        for tried, optimum in enumerate(optima_of(self.model, self.rng, self.deadline), start=1):
            if not optimum.fits:
                others.append(optimum)
            elif self._is_known(optimum):
                repeats += 1
            else:
                self.found.append(self._around(optimum))
            if self._are_all(others, repeats, tried, many_samples):
                break
        return others

    def _are_all(self, others: list[ContourOptimum], repeats: int, tried: int, many_samples: bool) -> bool:
        """Return True if no further search is worth while, after so many, of which so many ended in known modes."""
        normal = bool(self.found) and self.found[-1].proposal.efficiency > EFFICIENT
        hopeless = not self.found and are_alike([one.cost for one in others])
        if many_samples and (normal or hopeless or repeats == _REPEATS):
            return True
        if normal and repeats == _REPEATS_FEW_SAMPLES:
            return True
        return tried >= _MAX_SEARCHES and (bool(self.found) or many_samples)

    def _is_known(self, optimum: ContourOptimum) -> bool:
        """Return True if an optimum belongs to a mode that was found before: it is near its own, or in its proposal."""
        point = optimum.point[None]
        own, far = self._own.of(point)[0], _MODE_RADIUS * np.sqrt(point.size)
        for mode in self.found:
            # Along a bent ridge a proposal may leave out the optimum that it was made around.
            off = own - self._own.of(mode.optimum.point[None])[0]
            steps = np.linalg.solve(square_root(mode.optimum.covariance), off)
            if min(np.linalg.norm(steps), np.linalg.norm(mode.proposal.steps(mode.coordinates.of(point)))) < far:
                return True
        return False

    def _around(self, optimum: ContourOptimum) -> PosteriorMode:
        """Approximate a mode in the coordinates in which it is nearer to normal; modes on a flank share them."""
        model, point = self.model, optimum.point
        usual = self._in(self._own, optimum, optimum.covariance, model.walked_ends)
        if usual.proposal.efficiency > EFFICIENT or self.deadline.has_passed:
            return usual
        flanks = dict.fromkeys([*(mode.coordinates for mode in self.found), flank_at_contacts(model, point)])
        for flank in flanks:  # each once, since modes share them
            if not isinstance(flank, FlankCoordinates):
                continue
            covariance = flank.covariance(point, optimum.covariance)
            if not np.isfinite(covariance).all():  # the vertex is too near, or on the other side
                continue
            mode = self._in(flank, optimum, covariance)._replace(usual=usual)
            is_better = bool(self.found) or mode.proposal.efficiency > _FLANK_EFFICIENCY * usual.proposal.efficiency
            if is_better and not flank.reach_vertex(mode.proposal.draw(self.rng, _EXTENT_DRAWS)[0]):
                return mode
        return usual

    def _in(
        self, coordinates: Coordinates, optimum: ContourOptimum, covariance: Floats, ends: Ends = ANYTHING
    ) -> PosteriorMode:
        target, centre = in_coordinates(self.model.log_probability, coordinates), coordinates.of(optimum.point[None])[0]
        first, poor = 1, EFFICIENT
        if self.model.noise.of_discrepancy:  # which makes residuals alike, as the search does not know
            centre, root = at_maximum(target, centre, square_root(covariance), self.deadline, ends)
            covariance, first, poor = root @ root.T, _BY_CURVATURE, BENT
        cloud = gather(target, centre, covariance, self.rng, self.deadline, ends)
        proposal = approximate(target, cloud.centre, cloud.narrow_covariance, self.rng, self.deadline, ends, first)
        if proposal.efficiency <= poor:
            guess = square_root(cloud.narrow_covariance)
            middle, root = at_maximum(target, cloud.centre, guess, self.deadline, ends)
            again = approximate(target, middle, root @ root.T, self.rng, self.deadline, ends, _BY_CURVATURE)
            if again.efficiency > proposal.efficiency:
                narrow = again.root @ again.root.T / WIDENING**2
                cloud, proposal = gather(target, again.mean, narrow, self.rng, self.deadline, ends), again
        return PosteriorMode(optimum, cloud, proposal, coordinates)


def flank_at_contacts(model: ContourModel, point: Floats) -> FlankCoordinates | None:
    """Return coordinates of a flank at the middle of the contacts predicted at a point, shape (parameters,)."""
    if not FlankCoordinates.describe(model.family.name):
        return None
    at = point[None]
    events = events_of(model.likelihood, model.contours(at), model.rig(at), exact=False)
    x = np.concatenate([events["first_contact_x"], events["snap_off_contact_x"]], axis=None)
    found = FlankCoordinates.at(model.family.name, model.names, model.coordinates, point, float(np.mean(x)))
    if found is None:
        return None
    beyond = -found.side * (x - point[found.columns[-1]])  # of the vertex
    return None if beyond.max() > _OTHER_FLANK * np.ptp(x) else found
