"""The experiment behind a stored posterior: its record, rig, priors and points, and the rig that it found."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.distributions import in_words
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.family import Family, family_of
from tactile_bayes.inference.parameters.unknowns import Unknowns, belongs
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.inference.record_likelihood.record_segments import RecordSegments
from tactile_bayes.inference.result import contour_draws, known_of, posterior_draws, record_of
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction import contacts_of
from tactile_bayes.record import CHANNELS, present_channels, rod_of
from tactile_bayes.rig.corrected import Corrected, corrected
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.tasks.documents import read_json


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


def likelihood_of(posterior: xr.DataTree, record: xr.Dataset) -> tuple[RecordLikelihood, Unknowns]:
    """Return the likelihood of a posterior's record, of which the paths are, and the unknowns of its rig."""
    inferred = read_json(posterior.attrs.get("nuisances", "[]"), "nuisances")
    names = tuple(name for name in inferred if not belongs(name, "discrepancy"))
    unknowns = Unknowns(names, {}, rod_of(record), known_of(posterior.attrs))
    # `infer_contour` gives a cell whose noise it infers a noise of 1.
    noises: dict[str, Any] = {name: 1.0 for name in ("force_noise", "moment_noise") if name in posterior["posterior"]}
    cell = replace(LoadCell.from_record(record) or LoadCell(), **noises)
    return RecordLikelihood(record, cell, unknowns.friction, rubs="friction" in unknowns.names), unknowns


def segments_of(posterior: xr.DataTree, record: xr.Dataset) -> RecordSegments:
    """Return the sweep segments of a posterior's record, in the order of its events."""
    rubs = posterior.attrs.get("friction", 0.0) > 0.0
    rubs |= "friction" in read_json(posterior.attrs.get("nuisances", "[]"), "nuisances")
    return RecordSegments(record, LoadCell.from_record(record) or LoadCell(), rubs)


def found_rig(measured: xr.Dataset, posterior: xr.DataTree, load_cell: LoadCell | None = None) -> Corrected:
    """Return the rig with the posterior medians of its parameters."""
    draws = posterior_draws(posterior)
    found = {str(name): float(values.median()) for name, values in draws.data_vars.items()}
    stated = load_cell or LoadCell.from_record(measured) or LoadCell()
    names = read_json(posterior.attrs.get("nuisances", "[]"), "nuisances")
    noise: dict[str, Any] = {name: found[name] for name in ("moment_noise", "force_noise") if name in found}
    rig = {name: value for name, value in found.items() if name in names}
    return corrected(measured, replace(stated, **noise), {**known_of(posterior.attrs), **rig})


def contact_points(
    measured: xr.Dataset, posterior: xr.DataTree, load_cell: LoadCell | None = None
) -> xr.Dataset | None:
    """Return contact points by Step 2, with the inferred noise, biases, stiffness, offset and friction."""
    if set(present_channels(measured)) != set(CHANNELS):
        return None
    found = found_rig(measured, posterior, load_cell)
    return contacts_of(found, "constrained" if found.load_cell.has_variances else "raw")
