"""The experiment behind a stored posterior: its record, rig and priors."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.distributions import in_words
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.family import Family, family_of
from tactile_bayes.inference.result import contour_draws, record_of
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.tasks.documents import read_json

__all__ = ["experiment_of", "points_of", "predicted_points"]


def experiment_of(posterior: xr.DataTree, family: Family | None = None, rig: Rig | None = None) -> Experiment:
    """Return the experiment of which a tree is the posterior."""
    contour_draws(posterior)
    attrs: dict[Any, Any] = posterior.attrs
    found = Experiment(
        record_of(posterior),
        Rig.of(posterior) if rig is None else rig_of(rig),
        Family.of(posterior) if family is None else family_of(family),
        events=bool(attrs.get("events", 1)),
    )
    stated = read_json(attrs.get("priors", "{}"), "priors")
    for name, prior in found.priors.items():
        if stated.get(name) != (own := in_words(prior)):
            raise ParameterError(f"the prior of {name} was {stated.get(name, 'none')}, not {own}: give that one")
    return found


def points_of(posterior: xr.DataTree, names: tuple[str, ...]) -> Floats:
    """Return all draws of a posterior as points of its model, shape (chain, draw, parameter)."""
    draws = contour_draws(posterior)
    return np.stack([draws[name].transpose("chain", "draw").values for name in names], axis=-1)


def predicted_points(posterior: xr.DataTree, names: tuple[str, ...]) -> Floats:
    """Return the draws of a posterior of which it holds predicted records, in their order; shape (records, d)."""
    predicted = posterior["posterior_predictive"].to_dataset()
    draws = contour_draws(posterior).sel(chain=predicted["chain"], draw=predicted["draw"])
    return np.stack([draws[name].transpose("chain", "draw").values.ravel() for name in names], axis=-1)
