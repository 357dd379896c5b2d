"""A contour posterior's draws as the groups of a result, with what they predict."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.inference.contour_events import events_of
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.ensembles import Draws
from tactile_bayes.inference.result import sample_stats
from tactile_bayes.record import CHANNELS, COLUMNS, present_channels

__all__ = ["groups_of", "prior_draws", "unit_of"]

Floats = NDArray[np.float64]

_KEPT_DRAWS = 250
"""Draws of each chain for which predictions and events are stored."""

_PRIOR_DRAWS = 1000


def groups_of(model: ContourModel, draws: Draws, rng: np.random.Generator) -> dict[str, xr.Dataset]:
    """The result's groups except the prior."""
    chains, count, _ = draws.samples.shape
    kept = draws.evenly(_KEPT_DRAWS)
    points = draws.samples[:, kept].reshape(-1, len(model.names))
    predicted, likelihood, events = [], [], []
    for part in np.array_split(points, max(1, len(points) // 200)):
        loads, reached = model.loads_with_errors(part)
        error = model.likelihood.encoder.draw(rng, (len(part), loads.shape[2]))
        predicted.append(np.take_along_axis(loads, error[:, None, :, None], axis=1)[:, 0])
        likelihood.append(model.likelihood.score(loads, reached, model.noise_scale(part), pointwise=True))
        events.append(events_of(model.likelihood, model.contours(part), model.rig(part), exact=False))
    shape = (chains, kept.size)
    coords = {"chain": np.arange(chains), "draw": kept}
    cell = model.likelihood.load_cell
    noisy = cell.simulate(np.concatenate(predicted), seed=rng, noise_scale=model.noise_scale(points))
    units = _load_units(model)
    predictive, observed = {}, {}
    for i, name in enumerate(CHANNELS):
        observed[name] = model.measured[name]
        if name in present_channels(model.measured):
            values = noisy[..., i].reshape(*shape, -1) * units[i]
            predictive[name] = (("chain", "draw", "sample"), values, model.measured[name].attrs)
    return {
        "posterior": _labelled(model, draws.samples, np.arange(count)),
        "sample_stats": sample_stats(draws),
        "posterior_predictive": xr.Dataset(predictive, coords=coords),
        "log_likelihood": xr.Dataset(
            {"record": (("chain", "draw", "sample"), np.concatenate(likelihood).reshape(*shape, -1))}, coords=coords
        ),
        "events": _labelled_events(
            model,
            {name: np.concatenate([event[name] for event in events]).reshape(*shape, -1) for name in events[0]},
            coords,
        ),
        "observed_data": xr.Dataset(observed),
        "constant_data": model.measured.drop_vars(CHANNELS).drop_attrs(deep=False),
    }


def _labelled_events(model: ContourModel, events: Mapping[str, Floats], coords: Mapping[str, Any]) -> xr.Dataset:
    units = model.measured.attrs["units"]
    variables = {}
    for name, values in events.items():
        column = COLUMNS[name.removeprefix("first_").removeprefix("snap_off_")]
        variables[name] = (("chain", "draw", "stroke"), values, {"units": column.unit_in(units)})
    strokes = ["backward" if stroke.backward else "forward" for stroke in model.likelihood.strokes]
    return xr.Dataset(variables, coords={**coords, "stroke": strokes})


def prior_draws(model: ContourModel, rng: np.random.Generator) -> xr.Dataset:
    points, share = model.draw_prior(rng, _PRIOR_DRAWS)
    return _labelled(model, points[None], np.arange(len(points))).assign_attrs(share_within_reach=share)


def _labelled(model: ContourModel, samples: Floats, draw: NDArray[np.intp]) -> xr.Dataset:
    coords = {"chain": np.arange(samples.shape[0]), "draw": draw}
    return xr.Dataset(
        {
            name: (("chain", "draw"), samples[..., i], {"units": unit_of(model, name)})
            for i, name in enumerate(model.names)
        },
        coords=coords,
    )


def unit_of(model: ContourModel, name: str) -> str:
    """The unit of a parameter, in words."""
    if model.measured.attrs["units"] == "dimensionless":
        return "rad" if name in ("drive_angle_offset", "backlash", "length_scale") else "1"
    if name in model.nuisances.names:
        return model.nuisances.unit(name)
    if name == "length_scale":
        return "rad"
    powers = {0: "1", 1: "m", -1: "1/m"}
    return {"moment_noise": "N m", "force_noise": "N"}.get(name) or powers[model.family.length_powers.get(name, 0)]


def _load_units(model: ContourModel) -> Floats:
    rod = model.likelihood.rod
    return np.array([rod.moment_unit, rod.force_unit, rod.force_unit])
