"""The experiment behind a stored posterior: its record, rig and priors."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from scipy import stats

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_mapping
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.experiment import Experiment, prior_in_words
from tactile_bayes.inference.parameters.priors import Prior
from tactile_bayes.inference.parameters.rig_prior import RigPrior
from tactile_bayes.inference.result import contour_draws, record_of

__all__ = ["experiment_of", "joint_of", "points_of", "predicted_points"]

_WORDS = re.compile(r"(\w+)\((.*)\)")


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
        nuisances=json.loads(attrs["nuisances"]),
        events=bool(attrs.get("events", 1)),
        joint=joint_of(attrs),
    )
    default, given = experiment.default_priors, {} if priors is None else dict(priors)
    own: dict[str, Prior] = {}
    for name, words in json.loads(attrs["priors"]).items():
        if experiment.joint is not None and name in experiment.joint.priors:
            continue
        if name in given or name not in default or prior_in_words(default[name]) != words:
            own[name] = given.get(name) or _distribution(name, words)
            if prior_in_words(own[name]) != words:
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
    words = json.loads(attrs["priors"])
    own = {name: _distribution(name, words[name]) for name in json.loads(attrs["rig_parameters"])}
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


def _distribution(name: str, words: str) -> Prior:
    """Return the distribution of a text from `prior_in_words`."""
    match = _WORDS.fullmatch(words)
    kind = getattr(stats, match[1], None) if match else None
    if match is None or not isinstance(kind, stats.rv_continuous):
        raise InferenceError(f"the prior of {name} was {words}, which text does not determine: give priors=")
    parts = [part.partition("=") for part in match[2].split(", ")] if match[2] else []
    positional = [float(value) for value, _, other in parts if not other]
    return kind(*positional, **{key: float(value) for key, _, value in parts if value})
