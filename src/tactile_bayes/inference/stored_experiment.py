"""The experiment behind a stored posterior: its record, rig and priors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_mapping
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.parameters.prior_text import is_prior_in_words, prior_in_words, prior_of_words
from tactile_bayes.inference.parameters.priors import Prior
from tactile_bayes.inference.parameters.rig_prior import RigPrior
from tactile_bayes.inference.result import contour_draws, record_of
from tactile_bayes.tasks.documents import read_json

__all__ = ["experiment_of", "joint_of", "points_of", "predicted_points"]


def experiment_of(posterior: xr.DataTree, priors: Mapping[str, Prior] | None = None) -> Experiment:
    """Return the experiment of which a tree is the posterior.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`.
    priors : mapping of str to frozen scipy.stats distribution, optional
        The argument of `infer_contour`. By default priors follow from their text in the tree, which has six digits.

    Raises
    ------
    InferenceError
        If the tree is no result of `infer_contour`, or a prior does not follow from its text, or is not the stated one.

    Examples
    --------
    >>> from scipy import stats
    >>> from tactile_bayes import LoadCell, SamplerSettings, infer_contour, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, seed=1)
    >>> quick = SamplerSettings(ensembles=2, walkers=20, max_steps=20)
    >>> tree = infer_contour(measured, nuisances=[], priors={"q": stats.uniform(0.4, 0.2)}, seed=1, settings=quick)
    >>> prior_in_words(experiment_of(tree).priors["q"])
    'uniform(0.4, 0.2)'
    """
    contour_draws(posterior)
    check_mapping("priors", priors, "give the argument of infer_contour, or None")
    attrs: dict[Any, Any] = posterior.attrs
    lacking = {"priors", "nuisances", "friction"} - set(attrs)
    if lacking:
        raise InferenceError(f"the posterior does not state its {', '.join(sorted(lacking))}: infer it again")
    experiment = Experiment(
        record_of(posterior),
        str(attrs["family"]),
        priors={},
        friction=float(attrs["friction"]),
        nuisances=read_json(attrs["nuisances"], "nuisances"),
        events=bool(attrs.get("events", 1)),
        joint=joint_of(attrs),
    )
    default, given = experiment.default_priors, {} if priors is None else dict(priors)
    own: dict[str, Prior] = {}
    for name, words in read_json(attrs["priors"], "priors").items():
        if experiment.joint is not None and name in experiment.joint.priors:
            continue
        if name in given or name not in default or not is_prior_in_words(default[name], words):
            own[name] = given.get(name) or prior_of_words(name, words)
            if not is_prior_in_words(own[name], words):
                raise InferenceError(f"the prior of {name} was {words}, not {prior_in_words(own[name])}: give that one")
    return Experiment(
        experiment.record,
        experiment.family,
        priors=own,
        friction=experiment.friction,
        nuisances=experiment.nuisances,
        events=experiment.events,
        joint=experiment.joint,
    )


def joint_of(attrs: Mapping[Any, Any]) -> RigPrior | None:
    """Return the joint prior of the rig that the attributes of a posterior state; None without."""
    if "rig_parameters" not in attrs:
        return None
    words = read_json(attrs["priors"], "priors")
    own = {name: prior_of_words(name, words[name]) for name in read_json(attrs["rig_parameters"], "rig_parameters")}
    return RigPrior.from_entries(attrs, own)


def points_of(posterior: xr.DataTree, names: tuple[str, ...]) -> Floats:
    """Return all draws of a posterior as points of its model, shape (chain, draw, parameter)."""
    draws = contour_draws(posterior)
    return np.stack([draws[name].transpose("chain", "draw").values for name in names], axis=-1)


def predicted_points(posterior: xr.DataTree, names: tuple[str, ...]) -> Floats:
    """Return the draws of a posterior of which it holds predicted records, in their order; shape (records, d)."""
    predicted = posterior["posterior_predictive"].to_dataset()
    draws = contour_draws(posterior).sel(chain=predicted["chain"], draw=predicted["draw"])
    return np.stack([draws[name].transpose("chain", "draw").values.ravel() for name in names], axis=-1)
