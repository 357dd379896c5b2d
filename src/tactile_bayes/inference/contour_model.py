"""Prior times likelihood of a contour, the rig and the noise, given a record."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType

import numpy as np
import xarray as xr
from scipy.special import chdtri, ndtri

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.contours import Contour
from tactile_bayes.contours.family import ContourFamily
from tactile_bayes.distributions import Distribution, log_density_of, quantiles_of, support_of
from tactile_bayes.errors import ParameterError, ReachError
from tactile_bayes.inference.coordinates import Logarithms
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import Ends
from tactile_bayes.inference.parameters.noise import Noise
from tactile_bayes.inference.parameters.unknowns import RigValues, Unknowns
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.load_cell.discrepancy import Discrepancy
from tactile_bayes.load_cell.zero_load import quiet_zero_load
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.numerics.scatter import rough_noise
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig.parameters import MAY_VANISH

_FALSE_ALARM = 1e-7  # probability that noise alone makes an unloaded sample look loaded
_FEWEST_UNLOADED = 12  # least number of unloaded samples from which zero and noise of a channel are estimated
_MOST_TRIALS = 50  # largest number of draws from the prior for each requested draw within reach
_FEWEST_TRIALS = 1000  # draws of the prior before none within reach is an error, so that one is found too


class ContourModel:
    """Prior times likelihood, as a function of arrays of parameters, in the record's units. Points, (n, d), have the
    parameters `names`: of the contour and the rig (both are `forward_parameters`), the noise, a discrepancy. `of_path`
    are columns that move samples on the path; `zero` and `deviation` are by channel."""

    def __init__(
        self,
        measured: xr.Dataset,
        family: ContourFamily,
        unknowns: Unknowns,
        noise: Noise,
        priors: Mapping[str, Distribution],
    ) -> None:
        self.measured, self.family, self.priors = measured, family, priors
        self.unknowns, self.noise = unknowns, noise
        self.forward_parameters = (*family.parameters, *unknowns.names)
        self.names = (*self.forward_parameters, *noise.names)
        bounds = [*family.bounds.values(), *(unknowns.bounds(name) for name in unknowns.names)]
        self.low, self.high = np.array([*bounds, *[(0.0, np.inf)] * len(noise.names)]).T
        # Densities of parameters that share a prior come from one call, whose overhead exceeds many numbers.
        columns: dict[int, list[int]] = {}
        for i, name in enumerate(self.names):
            columns.setdefault(id(priors[name]), []).append(i)
        self._columns = [(log_density_of(priors[self.names[which[0]]]), which) for which in columns.values()]
        of_path = (*family.parameters, *unknowns.of_path)
        self.of_path = [i for i, name in enumerate(self.forward_parameters) if name in of_path]
        self._jointly = [self.names.index(name) for name in unknowns.joint.priors] if unknowns.joint else []
        self.rubs = bool(unknowns.friction) or "friction" in unknowns.names
        self.likelihood = RecordLikelihood(
            measured,
            noise.cell.straight,
            unknowns.friction,
            is_always_clear=family.is_always_clear and not self.rubs,
            rubs=self.rubs,
        )
        if noise.of_discrepancy and self.likelihood.encoder.count > 1:
            raise ParameterError(
                "drive_angle_noise or drive_angle_resolution together with a discrepancy have no closed form: leave "
                "one of the two out (relative_noise of the load cell can stand for small errors of the encoder)"
            )
        self.found = quiet_zero_load(measured)
        self.zero, noise_found = self._unloaded()
        is_white = (noise_found > 0.0) & (not unknowns.memory)  # else readings that decay count as unloaded
        rough = np.where(is_white, noise_found, self._rough_noise())
        largest = np.nan_to_num(np.abs(self.likelihood.measured)).max(axis=0)
        self.deviation = np.where(self.present, np.maximum(rough, np.maximum(1e-7 * largest, 1e-12)), 1.0)
        # What play leaves of a load that has ended, at most; zeros of unloaded samples are off by that.
        self.left_by_play = unknowns.most_play(priors) * largest
        self.likelihood.noise = np.where(self.present, rough, np.inf)

    @property
    def deviations(self) -> Floats:
        """Estimated standard deviation of each sample, shape (1 or samples, 3): that of a reading, or of a mean."""
        return self.of_samples(self.deviation)

    def of_samples(self, deviation: Floats) -> Floats:
        """Return the standard deviation of each sample, shape (1 or samples, 3), from that of a reading, shape (3,)."""
        blocks = self.likelihood.blocks
        return np.asarray(deviation[None] if blocks is None else deviation / np.sqrt(blocks.readings)[:, None])

    @property
    def present(self) -> Flags:
        """True for channels that were measured, shape (3,)."""
        return np.asarray(~np.isnan(self.likelihood.measured).all(axis=0))

    @property
    def certainly_loaded(self) -> Flags:
        """True for samples whose load noise does not explain, each taken by itself, above the zero of the record."""
        present = self.present
        measured, zero = self.likelihood.measured[:, present], self.zero[present]
        zero = np.where(np.isfinite(zero), zero, np.median(measured, axis=0))
        off = np.hypot(self.deviations, self.left_by_play)[:, present]
        squared_distance = np.square((measured - zero) / off).sum(axis=1)
        return np.asarray(squared_distance > chdtri(np.count_nonzero(present), _FALSE_ALARM))

    @property
    def noise_columns(self) -> list[list[int]]:
        """Columns of the channels that were measured and whose white noise each of its parameters scales."""
        present = self.present
        return [[i for i in map(CHANNELS.index, channels) if present[i]] for channels in self.noise.channels]

    @property
    def coordinates(self) -> Logarithms:
        """Coordinates of optimisation and sampling: logarithms of the parameters that are strictly positive."""
        return Logarithms((self.low == 0.0) & ~self.may_vanish)

    @property
    def ends(self) -> Ends:
        """Bounds of the parameters by definition and by their priors."""
        support = np.array([support_of(self.priors[name]) for name in self.names]).T
        return Ends(np.maximum(support[0], self.low), np.minimum(support[1], self.high))

    @property
    def walked_ends(self) -> Ends:
        """Bounds of the coordinates."""
        ends = self.ends
        with np.errstate(divide="ignore"):  # a size has no positive lower bound
            return Ends(self.coordinates.of(ends.low), self.coordinates.of(ends.high))

    @property
    def may_vanish(self) -> Flags:
        """True for parameters that may be zero and not negative, shape (d,)."""
        return np.isin(self.names, MAY_VANISH)

    @property
    def loads_of_a_point(self) -> int:
        """Number of predicted loads of a point: one for every channel, sample and error of the encoder."""
        return self.likelihood.measured.size * self.likelihood.encoder.count

    def prior_medians(self, names: Sequence[str]) -> list[float]:
        """Return the medians of some parameters' priors."""
        return [float(self.priors[name].median()) for name in names]  # type: ignore[attr-defined]

    def contours(self, points: Floats) -> Contour:
        """Return the contours of points, with parameters of shape (n,)."""
        built = self.family.build(*points[:, : len(self.family.parameters)].T)
        return built if built.shape else built.broadcast_to((len(points),))

    def values(self, points: Floats) -> dict[str, Floats]:
        """Return the columns of points, shape (n, d), by name; those of the noise may be missing."""
        return dict(zip(self.names, points.T, strict=False))

    def rig(self, points: Floats) -> RigValues:
        """Return the rig of every point."""
        return self.unknowns.rig(self.values(points))

    def loads(self, points: Floats) -> Floats:
        """Return the loads that the load cell senses at the drive angles read, shape (n, samples, 3)."""
        loads, _ = self.likelihood.predict(self.contours(points), self.rig(points))
        return self.unknowns.sensed(loads, self.values(points), self.likelihood.load_cell)

    def readings(self, points: Floats, turned: Floats | float = 0.0) -> tuple[Floats, Flags]:
        """Return expected readings, (n, samples, 3), and usable points; drive angles are `turned` further, (n,)."""
        rig, cell = self.rig(points), self.likelihood.load_cell
        rig = rig._replace(drive_angle_offset=np.asarray(rig.drive_angle_offset) - turned)
        loads, usable = self.likelihood.predict(self.contours(points), rig)
        return cell.expected(self.unknowns.sensed(loads, self.values(points), cell)), usable

    def loads_and_events(self, points: Floats) -> tuple[Floats, Floats]:
        """Return `loads`, and events as `RecordLikelihood.predict_with_events`; points of the same path share it."""
        _, first, path = np.unique(points[:, self.of_path], axis=0, return_index=True, return_inverse=True)
        different = points[first]
        loads, _, events = self.likelihood.predict_with_events(self.contours(different), self.rig(different))
        sensed = self.unknowns.sensed(loads[path], self.values(points), self.likelihood.load_cell)
        return sensed, events[path]

    def felt(self, points: Floats) -> tuple[Floats, Flags]:
        """Return loads of contour and rig alone, (n, errors of the encoder, samples, 3), and what is usable."""
        return self.likelihood.predict_with_errors(self.contours(points), self.rig(points))

    def sensed(self, points: Floats, felt: Floats) -> tuple[Floats, Discrepancy | None]:
        """Return the loads that the load cell senses, from those of `felt` and in their place, and the discrepancy."""
        discrepancy = self.discrepancy(points, felt[:, 0])
        return self.unknowns.sensed(felt, self.values(points), self.likelihood.load_cell), discrepancy

    def noise_scale(self, points: Floats) -> Floats:
        """Return the factors on the load cell's standard deviations, shape (n, 3)."""
        scale = np.ones((points.shape[0], len(CHANNELS)))
        for name, channels in zip(self.noise.of_white, self.noise.channels, strict=True):
            scale[:, [CHANNELS.index(c) for c in channels]] = points[:, [self.names.index(name)]]
        return scale

    def discrepancy(self, points: Floats, loads: Floats) -> Discrepancy | None:
        """Return the discrepancy of readings, for loads (n, samples, 3) of contour and rig alone; None without."""
        if not self.noise.of_discrepancy:
            return None
        scale, length = points[:, [self.names.index(name) for name in self.noise.of_discrepancy]].T
        return Discrepancy(self.likelihood.segments.course, scale[:, None, None] * self._largest(loads), length)

    def _largest(self, loads: Floats) -> Floats:
        """Return the largest readings of samples' segments if they are in contact, for loads (n, samples, 3)."""
        return self.likelihood.segments.course.load_in_contact(loads) * self.likelihood.load_cell.own_gains

    def largest_in_contact(self, point: Floats) -> Floats:
        """Return the largest reading of each sample's segment if it is in contact, (samples, 3), at a point, (d,)."""
        loads, _ = self.likelihood.predict(self.contours(point[None]), self.rig(point[None]))
        return self._largest(loads)[0]

    def discrepancy_at(self, point: Floats) -> Discrepancy | None:
        """Return the discrepancy of one point, shape (d,), for a single record; None without."""
        if not self.noise.of_discrepancy:
            return None
        loads, _ = self.likelihood.predict(self.contours(point[None]), self.rig(point[None]))
        every = self.discrepancy(point[None], loads)
        return None if every is None else every.take(0)

    def log_likelihood(self, points: Floats, *, pointwise: bool = False) -> Floats:
        """Return the log-likelihood of points, shape (n,), or of each sample, (n, samples); −inf out of reach."""
        return self.log_likelihood_of(points, *self.felt(points), pointwise=pointwise)

    def log_likelihood_of(self, points: Floats, felt: Floats, usable: Flags, *, pointwise: bool = False) -> Floats:
        """Return the `log_likelihood` of points from the results of `felt`, whose loads are modified in place."""
        loads, discrepancy = self.sensed(points, felt)
        scale = self.noise_scale(points)
        return self.likelihood.score(loads, usable, scale, pointwise=pointwise, discrepancy=discrepancy)

    def loads_and_discrepancy(self, points: Floats) -> tuple[Floats, Flags, Discrepancy | None]:
        """Return the results of `sensed`, and which points are usable between them."""
        felt, usable = self.felt(points)
        loads, discrepancy = self.sensed(points, felt)
        return loads, usable, discrepancy

    def log_prior(self, points: Floats) -> Floats:
        """Return the logarithm of the prior density, shape (n,), without the exclusion of contours out of reach."""
        values = np.zeros(len(points))
        for log_density, columns in self._columns:
            values += log_density(points[:, columns]).sum(axis=1)
        if self.unknowns.joint is not None:
            values += self.unknowns.joint.log_dependence(points[:, self._jointly])
        values[~self.within_bounds(points)] = -np.inf
        return values

    def within_bounds(self, points: Floats) -> Flags:
        """Return True for points, shape (n, d), between the bounds of every parameter, shape (n,)."""
        return Ends(self.low, self.high).hold(points)

    def log_probability(self, points: Floats) -> Floats:
        """Return the log of prior times likelihood, (n,), without the normalisation over reach; −inf outside either."""
        values = self.log_prior(points)
        for which in self.possible(values):
            values[which] += self.log_likelihood(points[which])
        return values

    def possible(self, log_prior: Floats) -> Iterator[Index]:
        """Yield the indices of points with a finite log-prior, so many at a time as memory allows."""
        inside = np.flatnonzero(np.isfinite(log_prior))
        for block in blocks(inside.size, self.loads_of_a_point) if inside.size else ():
            yield inside[block]

    def prior_points(
        self, rng: np.random.Generator, count: int, others: Mapping[str, Distribution] = MappingProxyType({})
    ) -> Floats:
        """Draw (count, d) from the prior of all contours, within reach or not, with some other priors."""
        priors = {**self.priors, **others}
        points = np.stack([priors[name].rvs(count, random_state=rng) for name in self.names], axis=1)
        if self.unknowns.joint is not None:
            points[:, self._jointly] = self.unknowns.joint.draw(rng, count)
        return points

    @cached_property
    def _quantiles(self) -> list[Callable[[Floats], Floats]]:
        return [quantiles_of(self.priors[name], name) for name in self.names]

    def prior_quantiles(self, shares: Floats) -> Floats:
        """Return the points, (n, d), at which the prior of all contours has these probabilities, one after another."""
        found = np.stack([at(share) for at, share in zip(self._quantiles, shares.T, strict=True)], axis=1)
        if self.unknowns.joint is not None:
            found[:, self._jointly] = self.unknowns.joint.at(ndtri(shares[:, self._jointly]))
        return found

    def draw_prior(self, rng: np.random.Generator, count: int, deadline: Deadline = NEVER) -> tuple[Floats, float]:
        """Return draws from the prior of contours within reach, (count, d) or fewer, and the share within reach."""
        found, drawn = [np.empty((0, len(self.names)))], 0
        most = max(_MOST_TRIALS * count, _FEWEST_TRIALS)
        while (had := sum(map(len, found))) < count and drawn < most:
            if had and deadline.has_passed:
                break
            found.append(self._within_reach(self.prior_points(rng, count)))
            drawn += count
        points = np.concatenate(found)
        if not len(points):
            raise ReachError(
                f"the rod reaches none of {drawn} contours from the prior in every sweep: check base, rod length and "
                "units, and give priors in the record's units"
            )
        return points[:count], len(points) / drawn

    def share_within_reach(
        self, rng: np.random.Generator, count: int, others: Mapping[str, Distribution] = MappingProxyType({})
    ) -> float:
        """Return the share of so many draws of `prior_points` that are within reach, at least 1/count."""
        return max(len(self._within_reach(self.prior_points(rng, count, others))), 1) / count

    def _within_reach(self, points: Floats) -> Floats:
        """Return those of the points, (n, d), of which the rod reaches the contour in every sweep."""
        points = points[self.within_bounds(points)]
        if not len(points):
            return points
        return points[self.likelihood.usable(self.contours(points), self.rig(points))]

    def _unloaded(self) -> tuple[Floats, Floats]:
        """Return mean and standard deviation of each channel's unloaded samples, shape (3,); NaN if they are few."""
        if int(self.found["unloaded"].sum()) < _FEWEST_UNLOADED:
            return np.full(len(CHANNELS), np.nan), np.full(len(CHANNELS), np.nan)
        units = self.likelihood.rod.load_units
        return self.found["bias"].values / units, self.found["noise"].values / units

    def _rough_noise(self) -> Floats:
        """Return the standard deviation of each channel from second differences of its samples, shape (3,)."""
        measured, stated, blocks = self.likelihood.measured, self.likelihood.load_cell.noise, self.likelihood.blocks
        if blocks is not None and np.any(blocks.freedom):
            return np.asarray(np.sqrt(blocks.scatter.sum(axis=0) / blocks.freedom.sum()))
        return np.array([rough_noise(v) if len(v) > 2 else s for v, s in zip(measured.T, stated, strict=True)])
