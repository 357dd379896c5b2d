"""What a record says of a contour of any shape, with loads and snap-offs made linear: a normal distribution."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_triangular

from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Contour, Smooth
from tactile_bayes.contours.shape_free_family import ShapeFreeFamily
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.reconstruction import loaded_samples
from tactile_bayes.record import CHANNELS

__all__ = ["LinearPrior", "NormalApproximation", "Observer", "joined", "linear_names", "scale_names", "split"]

_OF_ROUGHNESS = ("amplitude", "length_scale")

_STEP = 1e-4
"""Of the differences by which loads are made linear, over the scale of each coordinate."""

_TELLING = 0.03
"""Change of residuals, in standard deviations for a prior's or a radius' logarithm of one, below which all is noise."""

_SURE = 0.01
"""Standard deviation of a snap-off, over half a step of the drive, below which nothing more is asked of it."""

_RIDGE = 1e-12
"""Share by which precisions are raised, so that they stay positive definite where rounding is as large as the least."""

_BRAVE = 4.0
"""Residual in standard deviations from which on a reading pulls less than by its square."""


class LinearPrior(NamedTuple):
    """Means, shape (d,), and one over variances of log r, the directions' weights, the vertex and the rig."""

    mean: Floats
    precision: Floats


def scale_names(model: ContourModel) -> tuple[str, ...]:
    """Parameters in which loads are not made linear."""
    return (*_OF_ROUGHNESS, *model.noise.names)


def linear_names(model: ContourModel) -> tuple[str, ...]:
    """Parameters in which loads are made linear, r by its logarithm; amplitude, length scale and noise are the rest."""
    rough = [name for name in model.family.parameters if name not in _OF_ROUGHNESS]
    return (*rough, *model.nuisances.names)


def split(model: ContourModel, points: Floats) -> tuple[Floats, Floats]:
    """Scales (amplitude, length scale, noise), (n, scales), and what is linear, (n, d), of the model's parameters."""
    values = model.values(points)
    linear = np.stack([values[name] for name in linear_names(model)], axis=1)
    linear[:, 0] = np.log(linear[:, 0])
    return np.stack([values[name] for name in scale_names(model)], axis=1), linear


def joined(scales: Floats, linear: Floats) -> Floats:
    """The model's parameters, (n, parameters), from scales and what is linear."""
    return np.hstack([np.exp(linear[:, :1]), scales[:, :2], linear[:, 1:], scales[:, 2:]])


class Observer:
    """What contours and rigs look like to the record's sensor.

    Parameters
    ----------
    model : ContourModel
    """

    def __init__(self, model: ContourModel) -> None:
        self.model = model
        self.loaded = loaded_samples(model.measured, model.noise.stated_cell)
        stated = np.asarray(model.likelihood.load_cell.noise)
        self.noise = np.where(stated > 0.0, stated, model.deviation)
        between = model.likelihood.event_angles(self.loaded)[:, 2:]
        self.ends = np.isfinite(between).all(axis=1)
        self._end, self._within = between.mean(axis=1), 0.5 * np.diff(between, axis=1)[:, 0]
        self._width = self._within / np.sqrt(3.0)

    def __call__(self, contours: Contour, values: dict[str, Floats]) -> tuple[Floats, NDArray[np.bool_], Floats]:
        """Expected readings less measured ones, in `noise`; which are loaded as measured; and snap-offs less measured
        ones, in standard deviations: shapes (n, samples, 3), (n, samples), (n, strokes that end).
        """
        model, rig = self.model, self.model.nuisances.rig(values)
        loads, _ = model.likelihood.predict(contours, rig)
        agree = (loads != 0.0).any(axis=2) == self.loaded
        cell = model.likelihood.load_cell
        beyond = cell.expected(model.nuisances.sensed(loads, values, cell)) - model.likelihood.measured
        late = (model.likelihood.snap_offs(contours, rig) - self._end) / self._width
        beyond /= self.noise
        return beyond, agree, late[:, self.ends]

    def insist(self, point: Floats) -> bool:
        """Take snap-offs for better known that a point, (1, parameters), has where the record has none; any there?"""
        _, _, late = self(self.model.contours(point), self.model.values(point))
        off = np.zeros(self._width.size, dtype=bool)
        off[self.ends] = np.abs(late[0]) * self._width[self.ends] > self._within[self.ends]
        off &= self._width > _SURE * self._within
        self._width = np.where(off, self._width / 3.0, self._width)
        return bool(off.any())

    def log_density(self, points: Floats) -> Floats:
        """Roughly the log-likelihood, shape (n,), for a search: samples that are loaded where the record's are not cost
        what the snap-off is off, and outliers less than by their square.
        """
        model = self.model
        residual, agree, late = self(model.contours(points), model.values(points))
        scale = model.noise_scale(points)
        cost = _huber(residual / scale[:, None])
        cost = np.where(agree[..., None], cost, 0.5 * _BRAVE)[..., model.present].sum(axis=(1, 2))
        volume = residual.shape[1] * np.log(scale[:, model.present]).sum(axis=1)
        return np.nan_to_num(-cost - volume - 0.5 * np.square(late).sum(axis=1), nan=-np.inf)


class NormalApproximation:
    """Given amplitude and length scale of the random radius, and the noise, a normal distribution of all the rest.

    Exact would be that for loads and snap-offs that are linear in the radii's logarithms and the rig, with normal
    priors. What belongs to a length scale is tabulated for those of the random radius, and interpolated.

    Parameters
    ----------
    observer : Observer
    prior : LinearPrior
    scales, linear : ndarray, shape (scales,), (d,)
        Where loads and snap-offs are made linear.
    """

    def __init__(self, observer: Observer, prior: LinearPrior, scales: Floats, linear: Floats) -> None:
        self.prior, self.model = prior, observer.model
        family = observer.model.family
        assert isinstance(family, ShapeFreeFamily)
        known, self._count = family.radius.directions, family.radius.count
        slopes, self._seen, self._kinds, self._readings = _linearised(observer, family, prior, scales, linear)
        # From what is linear to what is seen, for every length scale: a spline of it belongs to that of the directions.
        nodes = known.values.shape[1]
        through = np.empty((len(known.values), linear.size, len(slopes)))
        through[:, 0] = slopes[:, :nodes].sum(axis=1)
        through[:, 1 : 1 + self._count] = np.swapaxes(slopes[:, :nodes] @ known.values, 1, 2)
        through[:, 1 + self._count :] = slopes[:, nodes:].T
        self._through = CubicSpline(known.log_lengths, through)

    @property
    def arrays(self) -> tuple[Floats, ...]:
        """All that `conditional` follows from."""
        return self._through.c, self._seen, *self.prior

    def conditional(self, scales: Floats) -> tuple[Floats, Floats]:
        """L⁻¹b, (n, d), and L, (n, d, d): the precision is L·Lᵀ, the mean L⁻ᵀL⁻¹b, given scales (n, scales)."""
        at = np.clip(np.log(scales[:, 1]), self._through.x[0], self._through.x[-1])
        # One over the noise of what is seen, of which the snap-offs' is known.
        certainty = np.hstack([1.0 / scales[:, 2:], np.ones((len(scales), 1))])[:, self._kinds]
        through = self._through(at) * certainty[:, None, :]
        through[:, 1 : 1 + self._count] *= scales[:, :1, None]
        precision = through @ np.swapaxes(through, 1, 2)
        diagonal = np.arange(self.prior.mean.size)
        precision[:, diagonal, diagonal] += self.prior.precision
        precision[:, diagonal, diagonal] *= 1.0 + _RIDGE
        root = np.linalg.cholesky(precision)
        pull = through @ (certainty * self._seen)[..., None] + (self.prior.precision * self.prior.mean)[:, None]
        return np.linalg.solve(root, pull)[..., 0], np.asarray(root)

    def mean(self, scales: Floats) -> Floats:
        """Of what is linear, shape (d,), given scales of shape (scales,)."""
        pulled, root = (of_one[0] for of_one in self.conditional(scales[None]))
        return np.asarray(solve_triangular(root.T, pulled))

    def log_evidence(self, scales: Floats) -> float:
        """Logarithm of the density of readings and snap-offs given scales of shape (scales,), up to a constant."""
        pulled, root = (of_one[0] for of_one in self.conditional(scales[None]))
        certainty = np.append(1.0 / scales[2:], 1.0)[self._kinds]
        volume = np.sum(self._readings * np.log(scales[2:])) + np.log(np.diag(root)).sum()
        return float(0.5 * (pulled @ pulled - np.sum(np.square(certainty * self._seen))) - volume)


def _huber(residual: Floats) -> Floats:
    size = np.abs(residual)
    return np.where(size < _BRAVE, 0.5 * size**2, _BRAVE * (size - 0.5 * _BRAVE))


def _linearised(
    observer: Observer, family: ShapeFreeFamily, prior: LinearPrior, scales: Floats, linear: Floats
) -> tuple[Floats, Floats, NDArray[np.intp], Floats]:
    """What is seen, as few combinations of readings and snap-offs as tell all that can be told: their slopes over
    radii at the nodes and all the rest, (seen, k); their values where those are zero, (seen,), with noise of the
    scale's size; kinds of noise, the snap-offs' the last; and the number of readings of each kind but that.
    """
    model, radius = observer.model, family.radius
    nodes, count = radius.nodes, radius.count
    log_radius = radius.log_radius(linear[:1], scales[:1], scales[1:2], linear[None, 1 : 1 + count])[0]
    centre = np.concatenate([log_radius, linear[1 + count :]])
    units = np.append(np.ones(nodes), prior.precision[1 + count :] ** -0.5)
    steps = _STEP * units
    points = np.concatenate([centre + np.diag(steps), centre - np.diag(steps), centre[None]])
    contours = Smooth(points[:, :nodes], q=points[:, nodes], x_c=points[:, nodes + 1])
    residual, agree, late = observer(contours, dict(zip(model.nuisances.names, points[:, nodes + 2 :].T, strict=True)))
    # A sample that only one of two has touched says nothing about how loads change.
    smooth = agree[-1] & (agree == agree[-1]).all(axis=0)
    seen, counts = [], []
    for channels, scale in zip(model.noise.channels, scales[2:], strict=True):
        chosen = [CHANNELS.index(c) for c in channels if model.present[CHANNELS.index(c)]]
        of_kind = residual[:, smooth][..., chosen].reshape(len(points), -1)
        of_kind *= np.minimum(1.0, _BRAVE * scale / np.maximum(np.abs(of_kind[-1]), 1e-300)) ** 0.5
        counts.append(float(of_kind.shape[1]))
        seen.append(_condensed(of_kind, centre, units))
    readings = np.array(counts)
    seen.append(_condensed(late, centre, units))
    kinds = np.repeat(np.arange(len(seen)), [len(values) for _, values in seen])
    return (
        np.concatenate([slopes for slopes, _ in seen]),
        np.concatenate([values for _, values in seen]),
        kinds,
        readings,
    )


def _condensed(residual: Floats, centre: Floats, units: Floats) -> tuple[Floats, Floats]:
    """Combinations of residuals of unit noise that tell all, from those beside a centre, which come last.

    What is not there at one of the points, like a snap-off where the rod does not reach, says nothing.
    """
    size = centre.size
    finite = np.isfinite(residual).all(axis=0)
    residual = residual if finite.all() else residual[:, finite]
    slopes = (residual[:size] - residual[size:-1]).T / (2.0 * _STEP)
    axes, sizes, across = np.linalg.svd(slopes, full_matrices=False)
    telling = sizes > _TELLING
    combined = sizes[telling, None] * across[telling] / units
    left = -residual[-1]
    told = axes[:, telling].T @ left
    # What no parameter explains is one more number, with slopes of zero, for the sake of the noise's size.
    rest = np.sqrt(max(float(left @ left - told @ told), 0.0))
    return np.vstack([combined, np.zeros(size)]), np.append(combined @ centre + told, rest)
