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
    """Return the experiment of which a tree is the posterior.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`.
    family, rig : Family and Rig, optional
        Arguments of `infer_contour`. By default the posterior states them, unless a distribution is none of SciPy's.

    Raises
    ------
    InferenceError
        If the tree is no result of `infer_contour`.
    ParameterError
        If the posterior does not state its rig or family, or states other priors than the given ones.

    Examples
    --------
    >>> from scipy import stats
    >>> from tactile_bayes import LoadCell, SamplerSettings, infer_contour, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> quick = SamplerSettings(ensembles=2, walkers=20, max_steps=20)
    >>> narrow = Family("parabola", q=stats.uniform(0.4, 0.2))
    >>> tree = infer_contour(measured, family=narrow, rig=Rig(unknown="nothing"), rng=1, settings=quick)
    >>> experiment_of(tree).family
    Family('parabola', q=uniform(0.4, 0.2))
    """
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
