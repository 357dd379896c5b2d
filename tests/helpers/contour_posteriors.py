"""Records of known contours, and posteriors that several tests look at: computed once, and not to be changed."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import xarray as xr

import tactile_bayes as tb
from helpers.load_cells import CELL
from tactile_bayes.contours import Parabola
from tactile_bayes.rig import NOTHING

DEVIATIONS = np.array([0.02, 0.05, 0.05])
STEP = float(np.radians(2.0))
TRUTH = {"a": 0.5, "q": 0.5, "x_c": 0.0}

# Enough for files and messages, not for numbers.
QUICK = tb.SamplerSettings(ensembles=2, walkers=20, block_steps=10, max_steps=30)
# Too short for anything but the layout of results.
BRIEF = tb.SamplerSettings(ensembles=2, walkers=16, block_steps=30, max_steps=30, min_ess=1e9)
# Enough for means within a fraction of a standard deviation.
MODEST = tb.SamplerSettings(ensembles=2, walkers=16, min_ess=160, max_r_hat=1.06)
SOUND = tb.SamplerSettings(ensembles=2, walkers=24, min_ess=400, max_r_hat=1.05)


NO_PRIORS: Mapping[str, Any] = {}


def only(*names: str, **said: Any) -> dict[str, Any]:
    """Unknowns of a rig of which everything else is as stated."""
    return {**NOTHING, **dict.fromkeys(names, "default"), **said}


def infer_as_stated(
    record: xr.Dataset, *, load_cell: tb.LoadCell | None = None, unknown: Mapping[str, Any] = NO_PRIORS, **options: Any
) -> xr.DataTree:
    """A posterior of a contour and noise alone, but for what is said to be unknown: of few parameters, and quick."""
    return tb.infer_contour(record, rig=tb.Rig(load_cell=load_cell, unknown=only(**unknown)), **options)


def swept(contour, *, bases=((0.0, 0.0),), step=STEP, rod=None, friction=0.0, **options) -> xr.Dataset:
    """An exact record of sweeps in both directions from every base."""
    parts, rig = [], tb.Rig(rod=rod, unknown={"friction": friction})
    for k, base in enumerate(bases):
        part = tb.scan(contour, rig, base=base, drive_step=step, **options).record
        part["sweep"] = part.sweep + 2 * k
        parts.append(part)
    return xr.concat(parts, "sample", combine_attrs="override") if parts[1:] else parts[0]


def without(record: xr.Dataset, *names: str) -> xr.Dataset:
    """The record with channels or attributes taken away."""
    record = record.copy(deep=True)
    for name in names:
        if name in record:
            record[name] = ("sample", np.full(record.sizes["sample"], np.nan), record[name].attrs)
        else:
            del record.attrs[name]
    return record.drop_vars([name for name in record.data_vars if str(name).startswith("truth_")])


def tree(family: str, *, units: str = "dimensionless", **values: Any) -> xr.DataTree:
    """A posterior that holds these draws of the family's parameters, and nothing else."""
    draws = {name: (("chain", "draw"), np.atleast_2d(v)) for name, v in values.items()}
    out = xr.DataTree.from_dict({"posterior": xr.Dataset(draws)})
    out.attrs = {"family": family, "units": units}
    return out


def touched(posterior: xr.DataTree, segments: Sequence[str] = ("forward",), **events: Any) -> xr.DataTree:
    """The posterior with events of its contours, each of a shape that broadcasts with (chain, draw, segment)."""
    shape = (*posterior["posterior"].to_dataset()["q"].shape, len(segments))
    values = {name: (("chain", "draw", "segment"), np.broadcast_to(v, shape)) for name, v in events.items()}
    posterior["events"] = xr.DataTree(xr.Dataset(values, coords={"segment": list(segments)}))
    return posterior


def assert_near(result: xr.DataTree, truth: dict[str, float], deviations: float = 4.0) -> None:
    """The posterior has converged, and its means lie within so many standard deviations of the truth."""
    assert result.attrs["converged"], result.attrs["message"]
    for name, value in truth.items():
        draws = result["posterior"][name]
        assert abs(draws.mean() - value) < deviations * draws.std(), name


@cache
def measured() -> xr.Dataset:
    """Profile II at q = 0.5, both sweeps in steps of 2°."""
    return CELL.measure(swept(Parabola(**TRUTH)), rng=5)


@cache
def posterior() -> xr.DataTree:
    """The parabola's posterior of it."""
    return infer_as_stated(measured(), load_cell=CELL, rng=1, settings=SOUND)
