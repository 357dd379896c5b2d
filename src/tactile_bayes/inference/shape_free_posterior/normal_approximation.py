"""Normal approximation to the posterior of a shape-free contour, with linearised loads and snap-offs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr, ndtri_exp

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.shape_free_family import ShapeFreeFamily
from tactile_bayes.inference.shape_free_posterior.correlated_noise import CorrelatedNoise
from tactile_bayes.inference.shape_free_posterior.observations import (
    LinearPrior,
    Observer,
    joined,
    linear_names,
    linearised,
    white_scales,
)
from tactile_bayes.numerics import chebyshev

_NODE, _WEIGHT = np.polynomial.legendre.leggauss(24)  # of the quadrature between vertex and anchor
_SLOPE_ANGLES = np.linspace(-1.4, 1.4, 57)  # slope angles that may be the anchor's [rad]
_LARGEST = 50.0  # bound of the change of the logarithm of a radius, far beyond any prior


@dataclass(frozen=True, eq=False)
class Anchor:
    """The point of a contour at one slope angle, and how far it is from where a linear map of the radii has it. An arc
    that was touched stays at its distance from the vertex, linear in the log-radii near a centre only."""

    slope_angle: float
    centre: Floats  # logarithms of the radii, at the nodes of interpolation, around which the map is linear

    @classmethod
    def best(cls, centre: Floats, radii: Floats, vertex: Floats) -> Anchor:
        """Return the anchor where a contour is known best. Shapes: centre (nodes,), radii, vertex (n, nodes)."""
        anchors = [cls(float(angle), centre) for angle in _SLOPE_ANGLES]
        spread = [np.sum(np.square(radii @ anchor._interpolation @ anchor._lengths + vertex)) for anchor in anchors]
        return anchors[int(np.argmin(spread))]

    @cached_property
    def _interpolation(self) -> Floats:
        """Logarithms of the radii between vertex and anchor from those at the nodes, shape (nodes, places)."""
        count = self.centre.size
        return np.asarray(chebyshev.coefficients(np.eye(count)).T @ chebyshev.basis(count, self._places / np.pi + 0.5))

    @cached_property
    def _places(self) -> Floats:
        return 0.5 * self.slope_angle * (_NODE + 1.0)

    @cached_property
    def _lengths(self) -> Floats:
        """Height and distance that each place contributes at the radii of the centre, shape (places, 2)."""
        lengths = 0.5 * self.slope_angle * _WEIGHT * np.exp(self.centre @ self._interpolation)
        return lengths[:, None] * np.column_stack([np.sin(self._places), np.cos(self._places)])

    def beyond_line(self, log_radius: Floats) -> Floats:
        """Return how far the anchor is above and to the right of where the linear map has it, shape (n, 2)."""
        change = (log_radius - self.centre) @ self._interpolation
        return np.asarray((np.expm1(np.minimum(change, _LARGEST)) - change) @ self._lengths)


_FAR_DOWN = -35.0  # standard normal number of which, and of all below, a truncation at less changes nothing


class NormalApproximation:
    """Normal distribution of the linear parameters, given amplitude, length scale and noise, `scales` of the model.

    It is exact if loads and snap-offs are linear in log-radii and rig, with the vertex moved by `bent`, and priors are
    normal. Over the length scale, the map is interpolated. What may vanish, like friction, has the positive part alone.
    """

    def __init__(self, observer: Observer, prior: LinearPrior, scales: Floats, linear: Floats) -> None:
        self.prior, self.model = prior, observer.model
        family = observer.model.family
        assert isinstance(family, ShapeFreeFamily)
        self.white = white_scales(observer.model)
        known, self._count = family.radius.directions, family.radius.count
        vertex = linear_names(observer.model).index("q")
        self._vertex = slice(vertex, vertex + 2)
        self.vanishing = int(np.count_nonzero(observer.model.may_vanish))
        self._radius = family.radius
        log_radius = self._log_radius(scales[None], linear[None])[0]
        self._centre = np.append(log_radius, linear[1 + self._count :])
        self._correlated: CorrelatedNoise | None = None
        if observer.model.noise.of_discrepancy:
            here = joined(observer.model, scales[None], linear[None])[0]
            largest = observer.model.largest_in_contact(here) / observer.noise
            self.observations = linearised(observer, prior, scales, self._centre, scales[self.white.stop] * largest)
            each = [largest[:, chosen] for chosen in observer.model.noise_columns]
            course, seen = observer.model.likelihood.segments.course, self.observations
            self._correlated = CorrelatedNoise(seen.axes, seen.used, course, each, scales[self.white.start :])
        else:
            self.observations = linearised(observer, prior, scales, self._centre)
        slopes = self.observations.slopes
        # The map from linear parameters to observations, at every length scale of the tabulated directions.
        nodes = known.values.shape[1]
        through = np.empty((len(known.values), linear.size, len(slopes)))
        through[:, 0] = slopes[:, :nodes].sum(axis=1)
        through[:, 1 : 1 + self._count] = np.swapaxes(slopes[:, :nodes] @ known.values, 1, 2)
        through[:, 1 + self._count :] = slopes[:, nodes:].T
        self._through = CubicSpline(known.log_lengths, through)
        _, root = self.conditional(scales[None])
        deviations = solve_triangular(root[0], np.eye(linear.size), lower=True)  # a row for each direction
        radii = self._log_radius(np.tile(scales, (linear.size, 1)), deviations)
        self._anchor = Anchor.best(log_radius, radii, deviations[:, self._vertex])

    def _log_radius(self, scales: Floats, linear: Floats) -> Floats:
        """Return log-radii at the nodes, (n, nodes), from scales (n, scales) and linear parameters (n, d)."""
        return self._radius.log_radius(linear[:, 0], scales[:, 0], scales[:, 1], linear[:, 1 : 1 + self._count])

    def bent(self, scales: Floats, linear: Floats, *, back: bool = False) -> Floats:
        """Return linear parameters, (n, d), with the vertex such that the anchor is where the map has it; or back."""
        beyond = self._anchor.beyond_line(self._log_radius(scales, linear))
        bent = linear.copy()
        bent[:, self._vertex] += beyond if back else -beyond
        return bent

    def _seen(self, scales: Floats, columns: Floats) -> Floats:
        """Return columns of observations, (n or 1, observations, k), in units of their noise; that of the snap-offs is
        known."""
        white = scales[:, self.white]
        noise = np.hstack([white, np.ones((len(scales), 1))])[:, self.observations.kinds]
        if self._correlated is not None:
            columns = self._correlated.whitened(columns, white, scales[:, self.white.stop :])
        return np.asarray(columns / noise[..., None])

    def _rows(self, scales: Floats) -> Floats:
        """Return slopes of the observations over the linear parameters, and their values as last column, in units of
        their noise, shape (n, observations, d + 1)."""
        at = np.clip(np.log(scales[:, 1]), self._through.x[0], self._through.x[-1])
        through = self._through(at)
        through[:, 1 : 1 + self._count] *= scales[:, :1, None]
        values = np.broadcast_to(self.observations.values[:, None], (len(scales), self.observations.values.size, 1))
        return self._seen(scales, np.concatenate([np.swapaxes(through, 1, 2), values], axis=2))

    def nearest(self, scales: Floats) -> Floats:
        """Return the linear parameters, (d,), with which a contour of other scales, (k,), is nearest the centre."""
        through = self._rows(scales[None])[0, :, :-1]
        each = np.eye(self.prior.mean.size)
        radii = self._log_radius(np.tile(scales, (len(each), 1)), each).T
        units = np.append(np.ones(len(radii)), 1.0 / self.prior.deviation[1 + self._count :])
        rows = np.vstack([through, radii, each[1 + self._count :] * units[len(radii) :, None]])
        observed = self._seen(scales[None], (self.observations.slopes @ self._centre)[None, :, None])[0, :, 0]
        return np.asarray(np.linalg.lstsq(rows, np.append(observed, units * self._centre))[0])

    def conditional(self, scales: Floats) -> tuple[Floats, Floats]:
        """Return L⁻¹b, (n, d), and L, (n, d, d), given scales (n, scales): precision L·Lᵀ and mean L⁻ᵀL⁻¹b."""
        upper = self._triangular(scales)
        return upper[:, :-1, -1], np.swapaxes(upper[:, :-1, :-1], 1, 2)

    def _triangular(self, scales: Floats) -> Floats:
        """Return Lᵀ with L⁻¹b as last column, and below that the root of the least squares, up to sign. Orthogonal
        transformations keep the digits that squares lose, as precisions differ by factors of up to 1e15."""
        observed, size, root = self._rows(scales), self.prior.mean.size, self.prior.root
        rows = np.empty((len(scales), size + observed.shape[1], size + 1))
        rows[:, :size] = np.column_stack([root, root @ self.prior.mean])
        rows[:, size:] = observed
        upper = np.asarray(np.linalg.qr(rows, mode="r"))
        return upper * np.copysign(1.0, np.diagonal(upper, axis1=1, axis2=2))[..., None]

    def mean(self, scales: Floats) -> Floats:
        """Return the mean of the linear parameters, (d,), given scales (scales,); of what may vanish the median."""
        pulled, root = self.conditional(scales[None])
        pulled += self.truncated(pulled, root, np.zeros(pulled.shape))[0]
        return np.asarray(solve_triangular(root[0].T, pulled[0]))

    def damped(self, scales: Floats, start: Floats, damping: Floats) -> Floats:
        """Return linear parameters, (n, d), after Levenberg–Marquardt steps from a start, (d,), with dampings (n,).
        Large dampings hold all that a record hardly determines. What may vanish keeps at least half of its value."""
        observed, root = self._rows(scales[None])[0], self.prior.root
        through = observed[:, :-1]
        _, sizes, axes = np.linalg.svd(slopes := np.linalg.solve(root.T, through.T).T)
        pull = axes @ (slopes.T @ (observed[:, -1] - through @ start) + root @ (self.prior.mean - start))
        precision = 1.0 + damping[:, None] + np.pad(sizes**2, (0, start.size - sizes.size))
        there = start + np.linalg.solve(root, ((pull / precision) @ axes).T).T
        vanishing = slice(start.size - self.vanishing, None)
        there[:, vanishing] = np.maximum(there[:, vanishing], 0.5 * start[vanishing])
        return np.asarray(there)

    def truncated(self, pulled: Floats, root: Floats, normal: Floats) -> tuple[Floats, Floats]:
        """Return numbers, (n, d), for which parameters that may vanish are positive, and the log-determinant, (n,).
        These come last and Lᵀ is upper triangular, so that each depends on its own number and later ones only."""
        normal, growth = normal.copy(), np.zeros(len(normal))
        for k, least in self._least(pulled, root, normal):
            whole = log_ndtr(-least)
            cut = np.where(normal[:, k] > _FAR_DOWN, -ndtri_exp(log_ndtr(-normal[:, k]) + whole), normal[:, k])
            growth += 0.5 * (np.square(cut) - np.square(normal[:, k])) + whole
            normal[:, k] = cut
        return normal, growth

    def untruncated(self, pulled: Floats, root: Floats, normal: Floats) -> Floats:
        """Return the numbers of which `truncated` makes those given."""
        numbers = normal.copy()
        for k, least in self._least(pulled, root, normal):
            share = np.minimum(log_ndtr(-normal[:, k]) - log_ndtr(-least), 0.0)
            numbers[:, k] = np.where(normal[:, k] > _FAR_DOWN, -ndtri_exp(share), normal[:, k])
        return numbers

    def _least(self, pulled: Floats, root: Floats, normal: Floats) -> Iterator[tuple[int, Floats]]:
        """Give columns of parameters that may vanish, and the numbers, (n,), at which they do, given later numbers."""
        size = normal.shape[1]
        linear = np.zeros((len(normal), 0))
        for k in range(size - 1, size - 1 - self.vanishing, -1):
            least = np.einsum("ij,ij->i", root[:, k + 1 :, k], linear) - pulled[:, k]
            yield k, least
            linear = np.column_stack([(normal[:, k] - least) / root[:, k, k], linear])

    def log_evidence(self, scales: Floats) -> float:
        """Return the log-density of readings and snap-offs given scales of shape (scales,), up to a constant."""
        upper, noise = self._triangular(scales[None])[0], scales[self.white]
        volume = np.sum(self.observations.readings * np.log(noise)) + np.log(np.diag(upper)[:-1]).sum()
        if self._correlated is not None:
            volume += self._correlated.log_volume(noise[None], scales[None, self.white.stop :])
        return float(-0.5 * upper[-1, -1] ** 2 - volume)
