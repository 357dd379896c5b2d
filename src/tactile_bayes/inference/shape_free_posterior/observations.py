"""What a record says against a shape-free contour and its rig: residuals, and their linearisation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import huber

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.contours import Contour
from tactile_bayes.contours.shape_free_family import ShapeFreeFamily
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.numerics.scatter import robust_deviation
from tactile_bayes.reconstruction import loaded_samples
from tactile_bayes.rig.parameters import MAY_VANISH

_OF_ROUGHNESS = ("amplitude", "length_scale")


def scale_names(model: ContourModel) -> tuple[str, ...]:
    """Return the parameters in which loads are not linearised."""
    return (*_OF_ROUGHNESS, *model.noise.names)


def linear_names(model: ContourModel) -> tuple[str, ...]:
    """Return the parameters in which loads are linearised, lengths by logarithms; those that may vanish come last."""
    rough = [name for name in model.family.parameters if name not in _OF_ROUGHNESS]
    return (*rough, *sorted(model.unknowns.names, key=MAY_VANISH.__contains__))


def logarithms(model: ContourModel) -> list[int]:
    """Return the places of those of the linear parameters that are logarithms: of r, and of the length of a flat."""
    names = linear_names(model)
    return [names.index(name) for name in ("r", "flat_length") if name in names]


def white_scales(model: ContourModel) -> slice:
    """Return the place of the white noise among the scales."""
    return slice(len(_OF_ROUGHNESS), len(_OF_ROUGHNESS) + len(model.noise.of_white))


def split(model: ContourModel, points: Floats) -> tuple[Floats, Floats]:
    """Return scales (amplitude, length scale, noise), (n, scales), and linear parameters, (n, d), of points."""
    values = model.values(points)
    linear = np.stack([values[name] for name in linear_names(model)], axis=1)
    of_lengths = logarithms(model)
    linear[:, of_lengths] = np.log(linear[:, of_lengths])
    return np.stack([values[name] for name in scale_names(model)], axis=1), linear


def joined(model: ContourModel, scales: Floats, linear: Floats) -> Floats:
    """Return the model's parameters, (n, parameters), from scales and linear parameters."""
    names = (*scale_names(model), *linear_names(model))
    points = np.empty((len(linear), len(names)))
    linear, of_lengths = linear.copy(), logarithms(model)
    linear[:, of_lengths] = np.exp(linear[:, of_lengths])
    points[:, [model.names.index(name) for name in names]] = np.hstack([scales, linear])
    return points


_HUBER_THRESHOLD = 4.0  # residual in standard deviations from which Huber's loss is linear
_MIN_WIDTH = 0.01  # smallest standard deviation of a snap-off, over half a step of the drive angle
# Step of the first differences of loads, over the scale of each coordinate, and the largest step of further ones.
_STEP, _LARGEST_STEP = 1e-5, 0.01
_FURTHER_DIFFERENCES = 2  # number of times that differences are taken again
_MIN_CHANGE = 0.03  # least singular value of residuals that counts, in deviations per prior scale


class Observer:
    """Residuals of contours and rigs with respect to the record."""

    def __init__(self, model: ContourModel) -> None:
        self.model = model
        self.loaded = model.certainly_loaded
        if not np.isfinite(model.zero[model.present]).all():  # hardly any sample is unloaded
            self.loaded = loaded_samples(model.measured, model.noise.stated_cell)
        stated = np.asarray(model.likelihood.load_cell.noise)
        self.noise = model.of_samples(np.where(stated > 0.0, stated, model.deviation))
        between = model.likelihood.segments.event_angles(self.loaded)[:, 2:]
        self.ends = np.isfinite(between).all(axis=1)
        self._end, self._within = between.mean(axis=1), 0.5 * np.diff(between, axis=1)[:, 0]
        self._width = self._within / np.sqrt(3.0)

    def __call__(self, contours: Contour, values: dict[str, Floats]) -> tuple[Floats, Flags, Floats]:
        """Return residuals (expected less measured) over `noise`, samples loaded alike, and residuals of snap-offs.
        Shapes (n, samples, 3), (n, samples) and (n, sweep segments that end)."""
        model, rig = self.model, self.model.unknowns.rig(values)
        loads, _, events = model.likelihood.predict_with_events(contours, rig)
        agree = (loads != 0.0).any(axis=2) == self.loaded
        cell = model.likelihood.load_cell
        beyond = cell.expected(model.unknowns.sensed(loads, values, cell)) - model.likelihood.measured
        late = (events[..., 1] - self._end) / self._width
        beyond /= self.noise
        return beyond, agree, late[:, self.ends]

    def narrow_snap_offs(self, point: Floats) -> bool:
        """Reduce the widths of snap-offs that a point, (1, parameters), misses; return True if there are any."""
        _, _, late = self(self.model.contours(point), self.model.values(point))
        off = np.zeros(self._width.size, dtype=bool)
        off[self.ends] = np.abs(late[0]) * self._width[self.ends] > self._within[self.ends]
        off &= self._width > _MIN_WIDTH * self._within
        self._width = np.where(off, self._width / 3.0, self._width)
        return bool(off.any())

    def log_density(self, points: Floats) -> Floats:
        """Return a coarse log-likelihood, (n,), with Huber's loss, constant for samples loaded unlike the record's."""
        model = self.model
        residual, agree, late = self(model.contours(points), model.values(points))
        scale = model.noise_scale(points)
        cost = huber(_HUBER_THRESHOLD, residual / scale[:, None])
        cost = np.where(agree[..., None], cost, 0.5 * _HUBER_THRESHOLD)[..., model.present].sum(axis=(1, 2))
        volume = residual.shape[1] * np.log(scale[:, model.present]).sum(axis=1)
        return np.nan_to_num(-cost - volume - 0.5 * np.square(late).sum(axis=1), nan=-np.inf)


class LinearPrior(NamedTuple):
    """Normal prior of log r, the directions' weights, the flat side if there is one, the vertex and the rig."""

    mean: Floats  # shape (d,)
    deviation: Floats  # shape (d,)
    root: Floats  # root of the precision rootᵀ·root, which holds the correlations of a calibrated rig, shape (d, d)


class Observations(NamedTuple):
    """Linearised observations: as few combinations of readings and snap-offs as carry all information."""

    slopes: Floats  # over the log-radii at the nodes and the other parameters, shape (observations, k)
    values: Floats  # at zero parameters, with the noise of the scales, shape (observations,)
    kinds: Index  # kinds of noise, the last of which is that of snap-offs, shape (observations,)
    readings: Floats  # number of readings of each other kind
    scatter: Floats  # robust standard deviation of these readings from those at the centre
    # Unit vectors along which the readings of each other kind are combined, shape (observations, samples, channels),
    # and whether samples have such readings, shape (samples,).
    axes: list[Floats]
    used: Flags


def linearised(
    observer: Observer, prior: LinearPrior, scales: Floats, centre: Floats, discrepancy: Floats | float = 0.0
) -> Observations:
    """Return the observations linearised at a centre, (k,): the log-radii at the nodes, and the other parameters.
    Differences along the parameters give rough slopes, and steps along their singular vectors better ones. A
    `discrepancy` has standard deviations, (samples, 3), over the noise of the load cell."""
    model = observer.model
    family = model.family
    assert isinstance(family, ShapeFreeFamily)
    nodes, rig = family.radius.nodes, linear_names(model)[prior.mean.size - len(model.unknowns.names) :]
    first_of_rig = centre.size - len(rig)
    units = np.append(np.ones(nodes), prior.deviation[nodes - centre.size :])
    vanishing = slice(centre.size - int(np.count_nonzero(model.may_vanish)), None)  # and no step leads below zero
    centre = np.append(centre[: vanishing.start], np.maximum(centre[vanishing], _LARGEST_STEP * units[vanishing]))
    noises = scales[white_scales(model)]

    def differences(axes: Floats, steps: Floats) -> tuple[list[_Lines], list[float], Flags]:
        """Return the lines along axes, for each kind of noise and for snap-offs, the scatter of each kind, and the
        samples that have slopes."""
        moves = steps[:, None] * axes * units
        points = np.concatenate([centre + moves, centre - moves, centre[None]])
        contours = family.smooth(points[:, :nodes], *points[:, nodes:first_of_rig].T)
        residual, agree, late = observer(contours, dict(zip(rig, points[:, first_of_rig:].T, strict=True)))
        # A sample that is loaded on one side of a difference only has no slope.
        smooth = agree[-1] & (agree == agree[-1]).all(axis=0)
        lines, scatter = [], []
        for chosen, noise in zip(model.noise_columns, noises, strict=True):
            of_kind = residual[:, smooth][..., chosen].reshape(len(points), -1)
            scatter.append(robust_deviation(of_kind[-1]))
            usual = np.hypot(noise, np.broadcast_to(discrepancy, residual.shape[1:])[smooth][:, chosen].ravel())
            of_kind *= np.minimum(1.0, _HUBER_THRESHOLD * usual / np.maximum(np.abs(of_kind[-1]), 1e-300)) ** 0.5
            lines.append(_Lines.of(of_kind, steps, axes))
        return [*lines, _Lines.of(late, steps, axes)], scatter, smooth

    axes = np.eye(centre.size)
    lines, scatter, used = differences(axes, np.full(centre.size, _STEP))
    for _ in range(_FURTHER_DIFFERENCES):
        every = [line.slopes / noise for line, noise in zip(lines, (*noises, 1.0), strict=True)]
        upper = np.linalg.qr(np.concatenate([*every, np.zeros(axes.shape)]), mode="r")
        _, sizes, axes = np.linalg.svd(upper)
        lines, scatter, used = differences(axes, 1.0 / np.maximum(sizes, 1.0 / _LARGEST_STEP))
    observed, along = zip(*(line.condensed() for line in lines), strict=True)
    kinds = np.repeat(np.arange(len(observed)), [len(line.values) for line in observed])
    slopes = np.concatenate([line.slopes for line in observed]) / units
    values = slopes @ centre + np.concatenate([line.values for line in observed])
    counts = [float(line.values.size) for line in lines[:-1]]
    each = [axes.reshape(len(axes), -1, len(c)) for axes, c in zip(along, model.noise_columns, strict=False)]
    return Observations(slopes, values, kinds, np.array(counts), np.array(scatter), each, used)


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

    def condensed(self) -> tuple[_Lines, Floats]:
        """Return combinations that carry all information, by singular value decomposition, and the unit vectors along
        which they are, (combinations, n)."""
        axes, sizes, across = np.linalg.svd(self.slopes, full_matrices=False)
        significant = sizes > _MIN_CHANGE
        along = axes[:, significant]
        explained = along.T @ self.values
        # The norm of the unexplained residual, with slopes of zero, informs the noise scale.
        left = self.values - along @ explained
        rest = float(np.linalg.norm(left))
        combined = _Lines(
            np.vstack([sizes[significant, None] * across[significant], np.zeros(across.shape[1])]),
            np.append(explained, rest),
        )
        return combined, np.vstack([along.T, left / max(rest, 1e-300)])
