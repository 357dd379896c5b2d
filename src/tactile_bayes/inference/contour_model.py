"""Prior times likelihood of a contour, and of what else is not known, given a record."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Contour
from tactile_bayes.contours.family import Family
from tactile_bayes.errors import DriftWarning, ReachError
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles import Ends, Logarithms
from tactile_bayes.inference.likelihood import RecordLikelihood, Rig
from tactile_bayes.inference.noise import Noise
from tactile_bayes.inference.nuisances import MAY_VANISH, Nuisances
from tactile_bayes.inference.prior_density import log_density_of
from tactile_bayes.inference.priors import Prior, support_of
from tactile_bayes.load_cell import rough_noise, zero_load
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.record import CHANNELS

__all__ = ["ContourModel"]

_FEWEST_UNLOADED = 12
"""Unloaded samples that tell zero and noise of a channel."""

_MOST_TRIALS = 50
"""Draws from the prior for each that is wanted within reach, before fewer will do."""


class ContourModel:
    """Prior times likelihood, as a function of arrays of parameters."""

    def __init__(
        self,
        measured: xr.Dataset,
        family: Family,
        nuisances: Nuisances,
        noise: Noise,
        priors: Mapping[str, Prior],
    ) -> None:
        """Points have the parameters of the contour first, then those of the rig, then those of the noise."""
        self.measured = measured
        self.family = family
        self.nuisances = nuisances
        self.noise = noise
        self.priors = priors
        self.located = (*family.parameters, *nuisances.names)
        self.names = (*self.located, *noise.names)
        bounds = [*family.bounds.values(), *(nuisances.bounds(name) for name in nuisances.names)]
        self.low, self.high = np.array([*bounds, *[(0.0, np.inf)] * len(noise.names)]).T
        # Parameters that share a prior are asked for at once: a call takes longer than many numbers.
        columns: dict[int, list[int]] = {}
        for i, name in enumerate(self.names):
            columns.setdefault(id(priors[name]), []).append(i)
        self._columns = [(log_density_of(priors[self.names[which[0]]]), which) for which in columns.values()]
        rubs = bool(nuisances.friction) or "friction" in nuisances.names
        self.likelihood = RecordLikelihood(
            measured, noise.cell, nuisances.friction, is_always_clear=family.is_always_clear and not rubs
        )
        self.found = self._zero_load()
        self.zero, noise_found = self._unloaded()
        rough = np.where(noise_found > 0.0, noise_found, self._rough_noise())
        largest = np.nan_to_num(np.abs(self.likelihood.measured)).max(axis=0)
        self.deviation = np.where(self.present, np.maximum(rough, np.maximum(1e-7 * largest, 1e-12)), 1.0)
        self.likelihood.noise = np.where(self.present, rough, np.inf)

    @property
    def present(self) -> NDArray[np.bool_]:
        """Which channels were measured, shape (3,)."""
        return ~np.isnan(self.likelihood.measured).all(axis=0)

    @property
    def coordinates(self) -> Logarithms:
        """In which posteriors are sought and walked: the logarithms of parameters that are positive and never zero."""
        return Logarithms((self.low == 0.0) & ~self.may_vanish)

    @property
    def ends(self) -> Ends:
        """Of the parameters, by what they are and by their priors."""
        support = np.array([support_of(self.priors[name]) for name in self.names]).T
        return Ends(np.maximum(support[0], self.low), np.minimum(support[1], self.high))

    @property
    def walked_ends(self) -> Ends:
        """The same of the coordinates."""
        ends = self.ends
        with np.errstate(divide="ignore"):  # a size may be as small as it likes
            return Ends(self.coordinates.of(ends.low), self.coordinates.of(ends.high))

    @property
    def may_vanish(self) -> NDArray[np.bool_]:
        """Which parameters may be zero, and not less."""
        return np.isin(self.names, MAY_VANISH)

    @property
    def loads_of_a_point(self) -> int:
        """Numbers that are predicted of a point: a load for every channel, sample and error of the encoder."""
        return self.likelihood.measured.size * self.likelihood.encoder.count

    def contours(self, points: Floats) -> Contour:
        return self.family.build(*points[:, : len(self.family.parameters)].T)

    def values(self, points: Floats) -> dict[str, Floats]:
        """Columns of points, shape (n, parameters), by name; those of the noise may be missing."""
        return dict(zip(self.names, points.T, strict=False))

    def rig(self, points: Floats) -> Rig:
        return self.nuisances.rig(self.values(points))

    def loads(self, points: Floats) -> Floats:
        """What the load cell senses at the drive angles read, shape (n, samples, 3)."""
        loads, _ = self.likelihood.predict(self.contours(points), self.rig(points))
        return self.nuisances.sensed(loads, self.values(points), self.likelihood.load_cell)

    def loads_and_events(self, points: Floats) -> tuple[Floats, Floats]:
        """`loads`, and drive angles of first contact and snap-off, see `RecordLikelihood.predict_with_events`."""
        loads, _, events = self.likelihood.predict_with_events(self.contours(points), self.rig(points))
        return self.nuisances.sensed(loads, self.values(points), self.likelihood.load_cell), events

    def loads_with_errors(self, points: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """`loads` for every error of the encoder, shape (n, errors, samples, 3), and which points are usable, (n,)."""
        loads, reached = self.likelihood.predict_with_errors(self.contours(points), self.rig(points))
        return self.nuisances.sensed(loads, self.values(points), self.likelihood.load_cell), reached

    def noise_scale(self, points: Floats) -> Floats:
        """Factors on the load cell's standard deviations, shape (n, 3)."""
        scale = np.ones((points.shape[0], len(CHANNELS)))
        for name, channels in zip(self.noise.names, self.noise.channels, strict=True):
            scale[:, [CHANNELS.index(c) for c in channels]] = points[:, [self.names.index(name)]]
        return scale

    def log_prior(self, points: Floats) -> Floats:
        values = np.zeros(len(points))
        for log_density, columns in self._columns:
            values += log_density(points[:, columns]).sum(axis=1)
        values[~((points > self.low) & (points < self.high)).all(axis=1)] = -np.inf
        return values

    def log_probability(self, points: Floats) -> Floats:
        """Up to the prior's normalisation over contours within reach; −inf outside its support or reach."""
        values = self.log_prior(points)
        inside = np.flatnonzero(np.isfinite(values))
        for block in blocks(inside.size, self.loads_of_a_point) if inside.size else ():
            chosen = points[inside[block]]
            values[inside[block]] += self.likelihood.score(*self.loads_with_errors(chosen), self.noise_scale(chosen))
        return values

    def draw_prior(self, rng: np.random.Generator, count: int, deadline: Deadline = NEVER) -> tuple[Floats, float]:
        """Draws within reach, fewer where they are very rare or time is up, and the share of all draws that they are.

        However late it is, the search for the first one goes on.
        """
        found, drawn = [np.empty((0, len(self.names)))], 0
        while (had := sum(map(len, found))) < count and drawn < _MOST_TRIALS * count:
            if had and deadline.has_passed:
                break
            points = np.stack([self.priors[name].rvs(count, random_state=rng) for name in self.names], axis=1)
            drawn += count
            points = points[np.isfinite(self.log_prior(points))]
            if len(points):
                found.append(points[self.likelihood.usable(self.contours(points), self.rig(points))])
        points = np.concatenate(found)
        if not len(points):
            raise ReachError(
                f"of {drawn} contours from the prior the rod can reach none in every sweep: are base, rod length and "
                "units right, and the priors in the record's units?"
            )
        return points[:count], len(points) / drawn

    def _zero_load(self) -> xr.Dataset:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DriftWarning)
            return zero_load(self.measured)

    def _unloaded(self) -> tuple[Floats, Floats]:
        """Mean and standard deviation of each channel's unloaded samples, shape (3,); NaN where there are few."""
        if int(self.found["unloaded"].sum()) < _FEWEST_UNLOADED:
            return np.full(len(CHANNELS), np.nan), np.full(len(CHANNELS), np.nan)
        rod = self.likelihood.rod
        units = np.array([rod.moment_unit, rod.force_unit, rod.force_unit])
        return self.found["bias"].values / units, self.found["noise"].values / units

    def _rough_noise(self) -> Floats:
        """Standard deviation of each channel from the median bend between neighbouring samples, shape (3,)."""
        measured, stated = self.likelihood.measured, self.likelihood.load_cell.noise
        return np.array([rough_noise(v) if len(v) > 2 else s for v, s in zip(measured.T, stated, strict=True)])
