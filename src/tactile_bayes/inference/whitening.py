"""Coordinates in which the posterior of a contour of any shape is nearly a standard normal one."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.contours import Smooth
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.ensembles import whitened_moves
from tactile_bayes.inference.shape_free import ShapeFreeFamily
from tactile_bayes.record import CHANNELS

__all__ = ["Whitening", "whitening_at"]

Floats = NDArray[np.float64]

_STEP = 1e-4
"""Of the differences by which loads are made linear, over the scale of each coordinate."""

_ROUNDS = 4
"""Times that the place where loads are made linear moves to where they say that the posterior is."""

_FAR = 50.0
"""Logarithm of scales that no prior comes near."""

_DRAWS = 4000
"""From a prior, for its mean and standard deviation."""


@dataclass(frozen=True, eq=False)
class Whitening:
    """A change of variables, exact whatever it is made from: only how normal the posterior becomes depends on that.

    Given what is not linear (amplitude and length scale of the random radius, and the noise), loads that are linear in
    all the rest, with normal priors, make that normal, with a mean and covariance that are known. The rest is given by
    how far it is from that mean, in units of that covariance: coordinates are the logarithms of what is not linear, and
    these numbers, which the posterior makes nearly independent and standard normal.
    """

    model: ContourModel
    family: ShapeFreeFamily
    information: Floats
    """By kind of noise, of radii at the nodes and all the rest, at unit noise scale, shape (kinds, k, k)."""
    weighted: Floats
    """Information times where the likelihood is largest, shape (kinds, k)."""
    middle: Floats
    """Prior means of log r, the weights, the vertex and the rig, shape (d,)."""
    precision: Floats
    """One over their prior variances, shape (d,)."""
    at: Floats
    """Amplitude, length scale and noise at which loads were made linear, shape (bent,)."""

    @property
    def bent(self) -> int:
        """Number of coordinates that are logarithms, the first ones."""
        return 2 + len(self.model.noise.names)

    @property
    def digest(self) -> str:
        """Of all that parameters follow from."""
        arrays = (self.information, self.weighted, self.middle, self.precision)
        return hashlib.sha256(b"".join(np.ascontiguousarray(a, dtype="<f8").tobytes() for a in arrays)).hexdigest()

    @property
    def middle_of_coordinates(self) -> Floats:
        return np.append(np.log(self.at), np.zeros(self.middle.size))

    @property
    def centre(self) -> Floats:
        """The model's parameters at the middle of the coordinates, where loads were made linear."""
        return self.parameters(self.middle_of_coordinates[None])[0][0]

    def parameters(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """The model's parameters, (n, parameters), and the logarithm of by how much a volume grows, (n,)."""
        points, growth = np.empty(coordinates.shape), np.empty(len(coordinates))
        for part in np.array_split(np.arange(len(coordinates)), max(1, len(coordinates) // 500)):
            points[part], growth[part] = self._moved(coordinates[part])
        return points, growth

    def moves(self) -> list[tuple[Any, float]]:
        return whitened_moves(self.bent)

    def _moved(self, coordinates: Floats) -> tuple[Floats, Floats]:
        bent = self.bent
        scales = np.exp(np.clip(coordinates[:, :bent], -_FAR, _FAR))
        mean, root = self._conditional(scales)
        linear = mean + np.linalg.solve(np.swapaxes(root, 1, 2), coordinates[:, bent:, None])[..., 0]
        log_r = np.clip(linear[:, 0], -_FAR, _FAR)
        volume = np.log(scales).sum(axis=1) - np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        columns = [np.exp(log_r), scales[:, 0], scales[:, 1], *linear[:, 1:].T, *scales[:, 2:].T]
        return np.stack(columns, axis=1), log_r + volume

    def _conditional(self, scales: Floats) -> tuple[Floats, Floats]:
        """Mean of what is linear, (n, d), and the root of its precision, (n, d, d), given what is not."""
        design = self._design(scales[:, 0], scales[:, 1])
        noise = 1.0 / scales[:, 2:] ** 2
        information = np.tensordot(noise, self.information, 1)
        precision = np.swapaxes(design, 1, 2) @ (information @ design) + np.diag(self.precision)
        weighted = (np.swapaxes(design, 1, 2) @ (noise @ self.weighted)[..., None])[..., 0]
        mean = np.linalg.solve(precision, (weighted + self.precision * self.middle)[..., None])[..., 0]
        return np.asarray(mean), np.asarray(np.linalg.cholesky(precision))

    def _design(self, amplitude: Floats, length: Floats) -> Floats:
        """From what is linear to radii at the nodes and all the rest, shape (n, k, d)."""
        radius, total = self.family.radius, self.middle.size
        nodes, count = radius.nodes, radius.count
        design = np.zeros((amplitude.size, self.information.shape[-1], total))
        design[:, :nodes, 0] = 1.0
        design[:, :nodes, 1 : 1 + count] = amplitude[:, None, None] * radius.shapes(length)
        rest = np.arange(total - 1 - count)
        design[:, nodes + rest, 1 + count + rest] = 1.0
        return design


def whitening_at(model: ContourModel, point: Floats, rng: np.random.Generator) -> Whitening:
    """Coordinates that belong to a point that explains the record, shape (parameters,), or to one near it."""
    family = model.family
    assert isinstance(family, ShapeFreeFamily)
    names = ("r", *(f"z_{k + 1}" for k in range(family.radius.count)), "q", "x_c", *model.nuisances.names)
    middle, deviation = _moments(model, names, rng)
    values = dict(zip(model.names, point, strict=True))
    scales = np.array([[values["amplitude"], values["length_scale"], *(values[n] for n in model.noise.names)]])
    linear = np.array([np.log(values["r"]), *(values[n] for n in names[1:])])
    whitening = None
    for _ in range(_ROUNDS):
        information, weighted = _linearised(model, family, scales, linear, deviation)
        whitening = Whitening(model, family, information, weighted, middle, deviation**-2, scales[0])
        linear = whitening._conditional(scales)[0][0]
    assert whitening is not None
    return whitening


def _moments(model: ContourModel, names: Sequence[str], rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Means and standard deviations of the priors, of r those of its logarithm."""
    draws = [np.asarray(model.priors[name].rvs(_DRAWS, random_state=rng)) for name in names]
    draws[0] = np.log(draws[0])
    return np.mean(draws, axis=1), np.std(draws, axis=1)


def _linearised(
    model: ContourModel, family: ShapeFreeFamily, scales: Floats, linear: Floats, deviation: Floats
) -> tuple[Floats, Floats]:
    """Information on radii at the nodes and all the rest by kind of noise, and that times where it has its centre."""
    radius = family.radius
    nodes, count = radius.nodes, radius.count
    log_radius = radius.log_radius(linear[:1], scales[:, 0], scales[:, 1], linear[None, 1 : 1 + count])[0]
    centre = np.concatenate([log_radius, linear[1 + count :]])
    steps = _STEP * np.concatenate([np.ones(nodes), deviation[1 + count :]])

    def loads(points: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """What the cell is expected to read, and where there is a load."""
        contours = Smooth(points[:, :nodes], q=points[:, nodes], x_c=points[:, nodes + 1])
        values = dict(zip(model.nuisances.names, points[:, nodes + 2 :].T, strict=True))
        found, _ = model.likelihood.predict(contours, model.nuisances.rig(values))
        loaded = (found != 0.0).any(axis=2)
        found = model.nuisances.sensed(found, values, model.likelihood.load_cell)
        return model.likelihood.load_cell.expected(found), loaded

    moved, loaded = loads(np.concatenate([centre + np.diag(steps), centre - np.diag(steps), centre[None]]))
    ahead, behind, here = moved[: steps.size], moved[steps.size : -1], moved[-1]
    slopes = (ahead - behind) / (2.0 * steps[:, None, None])
    # A sample that only one of the two has touched says nothing about how loads change.
    events = (loaded != loaded[-1]).any(axis=0)
    missing = model.likelihood.measured - here
    stated = np.asarray(model.likelihood.load_cell.noise)
    noise = np.where(stated > 0.0, stated, model.deviation)
    information, weighted = [], []
    for channels in model.noise.channels:
        chosen = [CHANNELS.index(c) for c in channels if model.present[CHANNELS.index(c)]]
        of_kind = (slopes / noise)[:, ~events][..., chosen].reshape(steps.size, -1)
        left = (missing / noise)[~events][:, chosen].ravel()
        information.append(of_kind @ of_kind.T)
        weighted.append(information[-1] @ centre + of_kind @ left)
    return np.array(information), np.array(weighted)
