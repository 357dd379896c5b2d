"""Groups of a contour posterior: draws, predictions and events."""

from __future__ import annotations

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles import Draws
from tactile_bayes.inference.family import PartlyKnown
from tactile_bayes.inference.record_likelihood.likelihood import events_of
from tactile_bayes.inference.result import sample_stats
from tactile_bayes.load_cell.discrepancy import Discrepancy, joined
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.record import CHANNELS, COLUMNS, present_channels
from tactile_bayes.record.origin import with_origin
from tactile_bayes.rig.parameters import parameter_named

_KEPT_DRAWS = 250  # largest number of draws of each chain for which predictions and events are stored
# Largest number of values in predictions and log-likelihoods, 128 MB: fewer draws are stored from 2,700 samples on.
_STORED_NUMBERS = 16_000_000
FEWEST_PREDICTIONS = 100  # least number of predictions that the check of the record requires
_PATHS = 200  # number of contours whose paths are followed at a time
_PRIOR_DRAWS = 1000
_BY_DRAW = ("chain", "draw")
_BY_SAMPLE = (*_BY_DRAW, "sample")


def drawn_groups(model: ContourModel, draws: Draws) -> dict[str, xr.Dataset]:
    """Return the groups that are known when sampling ends: draws, statistics of the ensembles, and the record."""
    record = model.measured.assign({name: with_origin(model.measured[name]) for name in (*CHANNELS, "drive_angle")})
    log_prior = model.log_prior(draws.samples.reshape(-1, len(model.names))).reshape(draws.log_probability.shape)
    coords = {"chain": np.arange(len(log_prior)), "draw": np.arange(draws.samples.shape[1])}
    return {
        "posterior": _labelled(model, draws.samples, np.arange(draws.samples.shape[1])),
        "sample_stats": sample_stats(draws),
        "log_prior": xr.Dataset({"prior": (_BY_DRAW, log_prior)}, coords),
        "observed_data": xr.Dataset({name: record[name] for name in CHANNELS}),
        "constant_data": record.drop_vars(CHANNELS).drop_attrs(deep=False),
    }


def predicted_groups(model: ContourModel, draws: Draws, rng: np.random.Generator) -> dict[str, xr.Dataset]:
    """Return events of `_KEPT_DRAWS` draws of each chain, and predictions for as many, or as a long record allows."""
    kept = draws.evenly(_KEPT_DRAWS)
    chains, samples = len(draws.samples), len(model.likelihood.measured)
    affordable = _STORED_NUMBERS // (chains * samples * 2 * len(CHANNELS))
    fewer = draws.evenly(max(affordable, -(-FEWEST_PREDICTIONS // chains))) if affordable < kept.size else kept
    groups = _predictions(model, draws, fewer, rng)
    if fewer.size < kept.size:
        stored = f"of {fewer.size} draws of each chain, not {kept.size}, since the record has {samples} samples"
        groups = {name: group.assign_attrs(stored=stored) for name, group in groups.items()}
    return {**groups, "events": _events(model, draws, kept)}


def _predictions(model: ContourModel, draws: Draws, kept: Index, rng: np.random.Generator) -> dict[str, xr.Dataset]:
    """Return posterior predictions by sample, and log-likelihoods by sample and measured channel."""
    points = draws.samples[:, kept].reshape(-1, len(model.names))
    likelihood, cell = model.likelihood, model.likelihood.load_cell
    samples, present = len(likelihood.measured), present_channels(model.measured)
    predicted = np.empty((len(points), samples, len(CHANNELS)))
    log_likelihood = np.empty((len(points), samples, len(present)))
    smooth: list[Discrepancy] = []
    for block in blocks(len(points), model.loads_of_a_point, _PATHS):
        loads, reached, discrepancy = model.loads_and_discrepancy(points[block])
        error = likelihood.encoder.draw(rng, (block.size, samples))
        predicted[block] = np.take_along_axis(loads, error[:, None, :, None], axis=1)[:, 0]
        log_likelihood[block] = likelihood.score_readings(loads, reached, model.noise_scale(points[block]), discrepancy)
        if discrepancy is not None:
            smooth.append(discrepancy)
    discrepancy = joined(smooth)
    for block in blocks(len(points), predicted[0].size):
        scale, own = model.noise_scale(points[block]), None if discrepancy is None else discrepancy.take(block)
        predicted[block] = cell.simulate(predicted[block], rng=rng, noise_scale=scale, discrepancy=own)
    shape = (len(draws.samples), kept.size, samples)
    coords = {"chain": np.arange(shape[0]), "draw": kept}
    predictive = {}
    for i, (name, unit) in enumerate(zip(CHANNELS, model.likelihood.rod.load_units, strict=True)):
        if name in present:
            values = (predicted[..., i] * unit).reshape(shape)
            predictive[name] = (_BY_SAMPLE, values, model.measured[name].attrs)
    by_reading = ((*_BY_SAMPLE, "channel"), log_likelihood.reshape(*shape, len(present)))
    return {
        "posterior_predictive": xr.Dataset(predictive, coords=coords),
        "log_likelihood": xr.Dataset({"record": by_reading}, coords={**coords, "channel": list(present)}),
    }


def _events(model: ContourModel, draws: Draws, kept: Index) -> xr.Dataset:
    """Return first contact and snap-off of some draws in every sweep segment."""
    points = draws.samples[:, kept].reshape(-1, len(model.names))
    found = [
        events_of(model.likelihood, model.contours(points[block]), model.rig(points[block]), exact=False)
        for block in blocks(len(points), 1, _PATHS)
    ]
    chains, units, variables = len(draws.samples), model.measured.attrs["units"], {}
    for name in found[0]:
        values = np.concatenate([event[name] for event in found]).reshape(chains, kept.size, -1)
        what = name.removeprefix("first_").removeprefix("snap_off_")
        column = COLUMNS["base_x" if what == "travel" else what]
        variables[name] = ((*_BY_DRAW, "segment"), values, {"units": column.unit_in(units)})
    sides = np.where(model.likelihood.segments.backward, "backward", "forward")
    return xr.Dataset(variables, coords={"chain": np.arange(chains), "draw": kept, "segment": sides})


def whole_groups(model: ContourModel, draws: Draws, rng: np.random.Generator) -> dict[str, xr.Dataset]:
    """Return all groups of draws."""
    with threadpool_limits(1):
        groups = {**drawn_groups(model, draws), **predicted_groups(model, draws, rng)}
        return {**groups, "prior": prior_draws(model, rng)}


def prior_draws(model: ContourModel, rng: np.random.Generator, deadline: Deadline = NEVER) -> xr.Dataset:
    """Return draws from the prior of contours within reach, fewer if the deadline passes."""
    points, share = model.draw_prior(rng, _PRIOR_DRAWS, deadline)
    return _labelled(model, points[None], np.arange(len(points))).assign_attrs(share_within_reach=share)


def _labelled(model: ContourModel, samples: Floats, draw: Index) -> xr.Dataset:
    coords = {"chain": np.arange(samples.shape[0]), "draw": draw}
    columns = {name: samples[..., i] for i, name in enumerate(model.names)}
    if isinstance(model.family, PartlyKnown):
        columns |= {name: np.full(samples.shape[:2], value) for name, value in model.family.known.items()}
    return xr.Dataset({n: (_BY_DRAW, values, {"units": unit_of(model, n)}) for n, values in columns.items()}, coords)


def unit_of(model: ContourModel, name: str) -> str:
    """Return the unit of a parameter, like "N m"."""
    row = parameter_named(name)
    if name == "length_scale":
        unit = "rad"
    elif row is not None:
        unit = row.unit
    else:
        family = model.family.whole if isinstance(model.family, PartlyKnown) else model.family
        unit = {0: "1", 1: "m", -1: "1/m"}[family.length_powers.get(name, 0)]
    return unit if unit == "rad" or model.measured.attrs["units"] != "dimensionless" else "1"
