"""The posterior of a rig as a prior: a density fitted to the draws of the parameters that do not change."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from scipy import optimize, stats

from tactile_bayes.arrays import Floats
from tactile_bayes.distributions import Distribution
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.result import posterior_draws
from tactile_bayes.rig.parameters import MAY_VANISH
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.tasks.documents import read_json

# Parts of the names of parameters that belong to one record, or to rod and object (friction).
_PASSING = ("bias", "drift", "discrepancy", "friction", "base", "gauge")
_PROBABILITIES = np.array([0.05, 0.25, 0.5, 0.75, 0.95])  # at which quantiles of draws and density are compared
# Beginnings of the attributes that must agree: the rig's parameters are deviations from what they state.
_SENSES = (
    "rod_",
    "units",
    "load_cell_frame",
    "load_cell_gain",
    "load_cell_lever",
    "load_cell_moment_curve",
    "load_cell_lag",
    "load_cell_play",
    "load_cell_drive_angle_",
)
_NOISES = ("load_cell_drive_angle_noise", "load_cell_drive_angle_resolution")


def rig_prior(rig: xr.DataTree) -> RigPrior:
    """Return a density fitted to the posterior of a rig."""
    if not isinstance(rig, xr.DataTree) or "gauge" not in rig.attrs:
        raise InferenceError("this is no posterior of a rig: give one that calibrate_rig found")
    if not rig.attrs.get("converged"):
        raise InferenceError(f"the posterior of the rig has not converged ({rig.attrs.get('message')}): infer it again")
    draws = posterior_draws(rig)
    inferred = [name for name in read_json(rig.attrs["nuisances"], "nuisances") if name in draws]
    names = tuple(name for name in inferred if not set(_PASSING) & set(name.split("_")))
    if not names:
        raise InferenceError("no unknown of the rig lasts beyond its record: say that one is, like rigidity_scale")
    points = np.stack([draws[name].values.ravel() for name in names], axis=1)
    priors = {name: _fitted(name, values) for name, values in zip(names, points.T, strict=True)}
    source = f"{rig.attrs.get('rig_data_sha256', '')} {rig.attrs['data_sha256']}".strip()
    scores = RigPrior(priors, np.eye(len(names)), 0.0, source).scores(points)
    correlation = np.atleast_2d(np.corrcoef(scores.T))
    error = max(_error(scores, correlation), float(rig.attrs.get("rig_density_error", 0.0)))
    stated = {str(name): value for name, value in rig.attrs.items() if _is_stated(str(name))}
    return RigPrior(priors, correlation, error, source, stated, rig)


def _is_stated(name: str) -> bool:
    return name.startswith(_SENSES) and name not in _NOISES and not name.startswith("rig_")


def refuse_other_rig(rig: RigPrior, own: Mapping[str, Any]) -> None:
    """Refuse a calibration of another rod, load cell, frame or unit than a posterior states by its attributes."""
    if own["data_sha256"] in rig.source.split():
        raise ParameterError("the rig was inferred from this very record, which would count twice: give another record")
    if not rig.stated:
        return
    for name in sorted({*rig.stated, *(str(name) for name in own if _is_stated(str(name)))}):
        stated, here = rig.stated.get(name, "nothing"), own.get(name, "nothing")
        is_text = isinstance(stated, str) or isinstance(here, str)
        if stated != here if is_text else not np.allclose(stated, here, rtol=1e-9, atol=0.0):
            raise ParameterError(
                f"the rig does not match: its {name} is {stated}, that of the record is {here}; its parameters are "
                "deviations from what is stated, so state the same in both"
            )


def _error(scores: Floats, correlation: Floats) -> float:
    """Return the largest difference of quantiles of normal scores and of their principal axes from normal ones."""
    variances, axes = np.linalg.eigh(correlation)
    along = scores @ axes / np.sqrt(variances)
    found = np.quantile(np.concatenate([scores, along], axis=1), _PROBABILITIES, axis=0)
    return float(np.abs(found - stats.norm.ppf(_PROBABILITIES)[:, None]).max())


def _fitted(name: str, values: Floats) -> Distribution:
    """Return a marginal fitted to draws."""
    if name in MAY_VANISH:
        return _truncated(values)
    if name == "rigidity_scale" or name.endswith("_gain"):
        logarithms = np.log(values)
        return stats.lognorm(s=float(logarithms.std()), scale=float(np.exp(logarithms.mean())))
    return stats.norm(float(values.mean()), float(values.std()))


def _truncated(values: Floats) -> Distribution:
    """Return the likeliest normal distribution cut off at zero, in units of the draws' root mean square."""
    unit = float(np.sqrt(np.mean(np.square(values))))
    mean, square = float(values.mean() / unit), 1.0

    def minus_log_likelihood(point: Floats) -> float:
        middle, log_width = point
        width = np.exp(log_width)
        scatter = (square - 2.0 * mean * middle + middle**2) / (2.0 * width**2)
        return float(scatter + log_width + stats.norm.logcdf(middle / width))

    start = np.array([mean, np.log(max(float(values.std()) / unit, 1e-6))])
    found = optimize.minimize(minus_log_likelihood, start, method="L-BFGS-B", bounds=[(-20.0, 5.0), (-15.0, 3.0)])
    middle, width = float(found.x[0]), float(np.exp(found.x[1]))
    return stats.truncnorm(-middle / width, np.inf, loc=middle * unit, scale=width * unit)
