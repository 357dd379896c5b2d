"""Normal approximation to the posterior of a shape-free contour, with linearised loads and snap-offs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr, ndtri_exp

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours import Smooth
from tactile_bayes.contours.shape_free_family import ShapeFreeFamily
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.shape_free_posterior.anchor import Anchor
from tactile_bayes.inference.shape_free_posterior.observer import HUBER_THRESHOLD, Observer
from tactile_bayes.numerics.scatter import robust_deviation
from tactile_bayes.rig.parameters import MAY_VANISH

__all__ = ["LinearPrior", "NormalApproximation", "joined", "linear_names", "scale_names", "split"]

_OF_ROUGHNESS = ("amplitude", "length_scale")
# Step of the first differences by which loads are linearised, over the scale of each coordinate, and the largest step
# of the further ones.
_STEP, _LARGEST_STEP = 1e-5, 0.01
_FURTHER_DIFFERENCES = 2  # number of times that differences are taken again
_MIN_CHANGE = 0.03  # least singular value of residuals that counts, in deviations per prior scale
_FAR_DOWN = -35.0  # standard normal number of which, and of all below, a truncation at less changes nothing


class LinearPrior(NamedTuple):
    """Means and precisions, shape (d,) each, of log r, the directions' weights, the vertex and the rig."""

    mean: Floats
    precision: Floats


def scale_names(model: ContourModel) -> tuple[str, ...]:
    """Return the parameters in which loads are not linearised."""
    return (*_OF_ROUGHNESS, *model.noise.names)


def linear_names(model: ContourModel) -> tuple[str, ...]:
    """Return the parameters in which loads are linearised, r by its logarithm; those that may vanish come last."""
    rough = [name for name in model.family.parameters if name not in _OF_ROUGHNESS]
    return (*rough, *sorted(model.unknowns.names, key=MAY_VANISH.__contains__))


def _white_scales(model: ContourModel) -> slice:
    """Return the place of the white noise among the scales."""
    return slice(len(_OF_ROUGHNESS), len(_OF_ROUGHNESS) + len(model.noise.of_white))


def split(model: ContourModel, points: Floats) -> tuple[Floats, Floats]:
    """Return scales (amplitude, length scale, noise), (n, scales), and linear parameters, (n, d), of points."""
    values = model.values(points)
    linear = np.stack([values[name] for name in linear_names(model)], axis=1)
    linear[:, 0] = np.log(linear[:, 0])
    return np.stack([values[name] for name in scale_names(model)], axis=1), linear


def joined(model: ContourModel, scales: Floats, linear: Floats) -> Floats:
    """Return the model's parameters, (n, parameters), from scales and linear parameters."""
    names = (*scale_names(model), *linear_names(model))
    points = np.empty((len(linear), len(names)))
    points[:, [model.names.index(name) for name in names]] = np.hstack([scales, np.exp(linear[:, :1]), linear[:, 1:]])
    return points


class _SmoothNoise(NamedTuple):
    """White noise that is as harmful as a discrepancy to what changes slowly along a sweep, the shape of a contour."""

    size: Floats  # root mean square of the largest load in contact over the noise, for each parameter of the noise
    step: float  # distance of samples
    longest: float  # length of a sweep in contact

    @classmethod
    def at(cls, observer: Observer, point: Floats) -> _SmoothNoise:
        """Return the noise for the loads of a point, shape (1, parameters)."""
        model = observer.model
        nothing = cls(np.zeros(len(model.noise.channels)), 1.0, 1.0)
        if not model.noise.of_discrepancy:
            return nothing
        loads, _ = model.likelihood.predict(model.contours(point), model.rig(point))
        course = model.likelihood.segments.course
        largest = course.load_in_contact(loads[0]) / observer.noise
        in_contact = largest.any(axis=1)
        if not in_contact.any():
            return nothing
        sizes = [np.sqrt(np.mean(np.square(largest[in_contact][:, chosen]))) for chosen in model.noise_columns]
        step = float(np.mean(course.step[np.isfinite(course.step)]))
        sweeps = np.count_nonzero(np.isinf(course.step))
        return cls(np.array(sizes), step, step * np.count_nonzero(in_contact) / sweeps)

    def beside(self, white: Floats, discrepancy: Floats) -> Floats:
        """Return the noise, shape (n, noises), beside a discrepancy of scale and length (n, 2), or none (n, 0)."""
        if not discrepancy.size:
            return white
        scale, length = discrepancy[:, :1], discrepancy[:, 1:]
        # The integral of Matérn's correlation, ν = 3/2, is 4/√3 lengths.
        alike = np.minimum(4.0 / np.sqrt(3.0) * length, self.longest) / self.step
        return np.asarray(np.hypot(white, scale * np.sqrt(np.maximum(alike, 1.0)) * self.size))


class _Observations(NamedTuple):
    """Linearised observations: as few combinations of readings and snap-offs as carry all information."""

    slopes: Floats  # over the log-radii at the nodes and the other parameters, shape (observations, k)
    values: Floats  # at zero parameters, with the noise of the scales, shape (observations,)
    kinds: Index  # kinds of noise, the last of which is that of snap-offs, shape (observations,)
    readings: Floats  # number of readings of each other kind
    scatter: Floats  # robust standard deviation of these readings from those at the centre


class NormalApproximation:
    """Normal distribution of the linear parameters, given amplitude, length scale and noise, `scales` of the model.

    It is exact if loads and snap-offs are linear in the log-radii and in the rig, with the vertex moved by `bent`, and
    priors are normal. Loads are linearised at a point; over the length scale, the map is interpolated. Parameters that
    may vanish, like friction, have the positive part of the distribution alone.
    """

    def __init__(self, observer: Observer, prior: LinearPrior, scales: Floats, linear: Floats) -> None:
        self.prior, self.model = prior, observer.model
        family = observer.model.family
        assert isinstance(family, ShapeFreeFamily)
        self.white = _white_scales(observer.model)
        self._smooth = _SmoothNoise.at(observer, joined(observer.model, scales[None], linear[None]))
        known, self._count = family.radius.directions, family.radius.count
        self.vanishing = int(np.count_nonzero(observer.model.may_vanish))
        self._radius = family.radius
        log_radius = self._log_radius(scales[None], linear[None])[0]
        self._centre = np.append(log_radius, linear[1 + self._count :])
        self._observations = _linearised(observer, prior, scales, self._centre)
        slopes = self._observations.slopes
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

    @property
    def scatter(self) -> Floats:
        """Robust standard deviation of the readings from those at that point, in the unit of the white noise."""
        return self._observations.scatter

    @property
    def _vertex(self) -> slice:
        return slice(1 + self._count, 3 + self._count)

    def _log_radius(self, scales: Floats, linear: Floats) -> Floats:
        """Return log-radii at the nodes, (n, nodes), from scales (n, scales) and linear parameters (n, d)."""
        return self._radius.log_radius(linear[:, 0], scales[:, 0], scales[:, 1], linear[:, 1 : 1 + self._count])

    def bent(self, scales: Floats, linear: Floats, *, back: bool = False) -> Floats:
        """Return linear parameters, (n, d), with the vertex where the anchor is as a linear map has it, or back."""
        beyond = self._anchor.beyond_line(self._log_radius(scales, linear))
        bent = linear.copy()
        bent[:, self._vertex] += beyond if back else -beyond
        return bent

    def _information(self, scales: Floats) -> tuple[Floats, Floats]:
        """Return slopes of the observations over the linear parameters, (n, observations, d), in units of their noise,
        and one over that noise, (n, observations); that of the snap-offs is known."""
        at = np.clip(np.log(scales[:, 1]), self._through.x[0], self._through.x[-1])
        noise = self._smooth.beside(scales[:, self.white], scales[:, self.white.stop :])
        certainty = np.hstack([1.0 / noise, np.ones((len(scales), 1))])[:, self._observations.kinds]
        through = self._through(at) * certainty[:, None, :]
        through[:, 1 : 1 + self._count] *= scales[:, :1, None]
        return np.swapaxes(through, 1, 2), certainty

    def nearest(self, scales: Floats) -> Floats:
        """Return the linear parameters, (d,), that observe most like the centre at other scales, (scales,)."""
        (through,), (certainty,) = self._information(scales[None])
        each = np.eye(self.prior.mean.size)
        radii = self._log_radius(np.tile(scales, (len(each), 1)), each).T
        units = np.append(np.ones(len(radii)), np.sqrt(self.prior.precision[1 + self._count :]))
        rows = np.vstack([through, radii, each[1 + self._count :] * units[len(radii) :, None]])
        observed = certainty * (self._observations.slopes @ self._centre)
        return np.asarray(np.linalg.lstsq(rows, np.append(observed, units * self._centre))[0])

    def conditional(self, scales: Floats) -> tuple[Floats, Floats]:
        """Return L⁻¹b, (n, d), and L, (n, d, d), given scales (n, scales): precision L·Lᵀ and mean L⁻ᵀL⁻¹b."""
        upper = self._triangular(scales)
        return upper[:, :-1, -1], np.swapaxes(upper[:, :-1, :-1], 1, 2)

    def _triangular(self, scales: Floats) -> Floats:
        """Return Lᵀ with L⁻¹b as last column, and below that the root of the least squares, up to sign.

        Orthogonal transformations keep the digits that squares lose, as precisions differ by factors of up to 1e15.
        """
        through, certainty = self._information(scales)
        size, root = self.prior.mean.size, np.sqrt(self.prior.precision)
        rows = np.zeros((len(scales), size + through.shape[1], size + 1))
        rows[:, :size] = np.column_stack([np.diag(root), root * self.prior.mean])
        rows[:, size:, :size], rows[:, size:, size] = through, certainty * self._observations.values
        upper = np.asarray(np.linalg.qr(rows, mode="r"))
        return upper * np.copysign(1.0, np.diagonal(upper, axis1=1, axis2=2))[..., None]

    def mean(self, scales: Floats) -> Floats:
        """Return the mean of the linear parameters, shape (d,), given scales of shape (scales,).

        Of parameters that may vanish it is the median.
        """
        pulled, root = self.conditional(scales[None])
        pulled += self.truncated(pulled, root, np.zeros(pulled.shape))[0]
        return np.asarray(solve_triangular(root[0].T, pulled[0]))

    def damped(self, scales: Floats, start: Floats, damping: Floats) -> Floats:
        """Return linear parameters, (n, d), after Levenberg–Marquardt steps from a start, (d,), with dampings (n,).

        A damping adds to the prior's precision, around the start: large ones hold all that a record hardly determines.
        Parameters that may vanish keep at least half of their values.
        """
        (through,), (certainty,) = self._information(scales[None])
        root = np.sqrt(self.prior.precision)
        _, sizes, axes = np.linalg.svd(slopes := through / root)
        pull = axes @ (
            slopes.T @ (certainty * self._observations.values - through @ start) + root * (self.prior.mean - start)
        )
        precision = 1.0 + damping[:, None] + np.pad(sizes**2, (0, start.size - sizes.size))
        there = start + (pull / precision) @ axes / root
        vanishing = slice(start.size - self.vanishing, None)
        there[:, vanishing] = np.maximum(there[:, vanishing], 0.5 * start[vanishing])
        return np.asarray(there)

    def truncated(self, pulled: Floats, root: Floats, normal: Floats) -> tuple[Floats, Floats]:
        """Return numbers, (n, d), for which parameters that may vanish are positive, and the log-determinant, (n,).

        These come last and Lᵀ is upper triangular, so that each depends on its own number and later ones only.
        """
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
        known = scales.copy()
        known[self.white.stop :] = 0.0  # a discrepancy is no white noise, from which the size of the residuals tells it
        upper, noise = self._triangular(known[None])[0], scales[self.white]
        volume = np.sum(self._observations.readings * np.log(noise)) + np.log(np.diag(upper)[:-1]).sum()
        return float(-0.5 * upper[-1, -1] ** 2 - volume)


def _linearised(observer: Observer, prior: LinearPrior, scales: Floats, centre: Floats) -> _Observations:
    """Return the observations linearised at a centre, (k,): the log-radii at the nodes, and the other parameters.

    Differences along the parameters give rough slopes, and steps of about a deviation along their singular vectors
    better ones.
    """
    model = observer.model
    rig = linear_names(model)[prior.mean.size - len(model.unknowns.names) :]
    nodes = centre.size - 2 - len(rig)
    units = np.append(np.ones(nodes), prior.precision[-2 - len(rig) :] ** -0.5)
    noises = scales[_white_scales(model)]

    def differences(axes: Floats, steps: Floats) -> tuple[list[_Lines], list[float]]:
        """Return the lines along axes, for each kind of noise and for snap-offs, and the scatter of each kind."""
        moves = steps[:, None] * axes * units
        points = np.concatenate([centre + moves, centre - moves, centre[None]])
        contours = Smooth(points[:, :nodes], q=points[:, nodes], x_c=points[:, nodes + 1])
        residual, agree, late = observer(contours, dict(zip(rig, points[:, nodes + 2 :].T, strict=True)))
        # A sample that is loaded on one side of a difference only has no slope.
        smooth = agree[-1] & (agree == agree[-1]).all(axis=0)
        lines, scatter = [], []
        for chosen, noise in zip(model.noise_columns, noises, strict=True):
            of_kind = residual[:, smooth][..., chosen].reshape(len(points), -1)
            scatter.append(robust_deviation(of_kind[-1]))
            of_kind *= np.minimum(1.0, HUBER_THRESHOLD * noise / np.maximum(np.abs(of_kind[-1]), 1e-300)) ** 0.5
            lines.append(_Lines.of(of_kind, steps, axes))
        return [*lines, _Lines.of(late, steps, axes)], scatter

    axes = np.eye(centre.size)
    lines, scatter = differences(axes, np.full(centre.size, _STEP))
    for _ in range(_FURTHER_DIFFERENCES):
        every = [line.slopes / noise for line, noise in zip(lines, (*noises, 1.0), strict=True)]
        upper = np.linalg.qr(np.concatenate([*every, np.zeros(axes.shape)]), mode="r")
        _, sizes, axes = np.linalg.svd(upper)
        lines, scatter = differences(axes, 1.0 / np.maximum(sizes, 1.0 / _LARGEST_STEP))
    observed = [line.condensed() for line in lines]
    kinds = np.repeat(np.arange(len(observed)), [len(line.values) for line in observed])
    slopes = np.concatenate([line.slopes for line in observed]) / units
    values = slopes @ centre + np.concatenate([line.values for line in observed])
    counts = [float(line.values.size) for line in lines[:-1]]
    return _Observations(slopes, values, kinds, np.array(counts), np.array(scatter))


class _Lines(NamedTuple):
    """Linearised residuals with unit noise, whose signs are those of measured less expected values."""

    slopes: Floats  # slopes of the expected values, over changes of the parameters in prior scales, shape (n, k)
    values: Floats  # at the centre, shape (n,)

    @classmethod
    def of(cls, residual: Floats, steps: Floats, axes: Floats) -> _Lines:
        """Return the lines through residuals, (2 k + 1, n), at points a step along each axis to either side of the
        centre, and at the centre. Those that are not finite at one of the points, like a snap-off that the rod does not
        reach, are zero."""
        size = steps.size
        finite = np.isfinite(residual).all(axis=0)
        change = np.where(finite, residual[:size] - residual[size:-1], 0.0) / (2.0 * steps[:, None])
        return cls(change.T @ axes, -np.where(finite, residual[-1], 0.0))

    def condensed(self) -> _Lines:
        """Return combinations that carry all information, by singular value decomposition."""
        axes, sizes, across = np.linalg.svd(self.slopes, full_matrices=False)
        significant = sizes > _MIN_CHANGE
        explained = axes[:, significant].T @ self.values
        # The norm of the unexplained residual, with slopes of zero, informs the noise scale.
        rest = np.sqrt(max(float(self.values @ self.values - explained @ explained), 0.0))
        combined = sizes[significant, None] * across[significant]
        return _Lines(np.vstack([combined, np.zeros(across.shape[1])]), np.append(explained, rest))
