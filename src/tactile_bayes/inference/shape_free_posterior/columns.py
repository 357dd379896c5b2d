"""Parameters of a shape-free model as columns: scales, and those in which loads are linearised."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_model import ContourModel
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
