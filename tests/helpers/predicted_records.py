"""Results of an inference that knows the contour: predictions of one record, without any sampling."""

from functools import cache

import numpy as np
import xarray as xr

import tactile_bayes as tb
from helpers.load_cells import CELL
from tactile_bayes.contours import paper_profile
from tactile_bayes.record import CHANNELS, loads_of
from tactile_bayes.sweep import Scan

STEP = float(np.radians(3.0))

# Enough for predictions of a record, and far from converged.
SHORT = tb.SamplerSettings(ensembles=4, walkers=12, max_steps=60, min_ess=1e9)


@cache
def swept() -> Scan:
    """Profile II at q = 0.5, both sweeps in steps of 3°."""
    return tb.scan(paper_profile("II", q=0.5), drive_step=STEP)


def predicted(cell: tb.LoadCell = CELL, *, chains: int = 4, draws: int = 250) -> xr.DataTree:
    """A tree as `infer_contour` returns it, of a posterior that is a point, and of a record from it."""
    rng = np.random.default_rng(1)
    ideal = swept().record
    loads = loads_of(ideal)
    values = cell.simulate(np.broadcast_to(loads, (chains, draws, *loads.shape)), rng=rng)
    dims = ("chain", "draw", "sample")
    predictive = {name: (dims, values[..., i], ideal[name].attrs) for i, name in enumerate(CHANNELS)}
    record = cell.measure(ideal, rng=rng)
    events = {
        f"{label}_drive_angle": [getattr(swept().events[side], kind).drive_angle for side in ("forward", "backward")]
        for label, kind in (("first", "first_contact"), ("snap_off", "snap_off"))
    }
    shape = (chains, draws, 2)
    coords = {"chain": np.arange(chains), "draw": np.arange(draws)}
    tree = xr.DataTree.from_dict(
        {
            "posterior": xr.Dataset({"noise_scale": (dims[:2], rng.lognormal(sigma=0.03, size=shape[:2]))}),
            "prior": xr.Dataset({"noise_scale": (dims[:2], rng.lognormal(sigma=0.5, size=(1, 1000)))}),
            "sample_stats": xr.Dataset({"lp": (dims[:2], np.zeros(shape[:2]))}, coords=coords),
            "posterior_predictive": xr.Dataset(predictive, coords=coords),
            "events": xr.Dataset(
                {name: ((*dims[:2], "segment"), np.broadcast_to(pair, shape)) for name, pair in events.items()},
                coords={"segment": ["forward", "backward"]},
            ),
            "observed_data": record[list(CHANNELS)].drop_attrs(deep=False),
            "constant_data": record.drop_vars(CHANNELS).drop_attrs(deep=False),
        }
    )
    kept = {name: value for name, value in record.attrs.items() if name.startswith(("rod_", "load_cell_"))}
    tree.attrs = {"units": "dimensionless", "family": "parabola", "known": "{}", "converged": 1, "message": "converged"}
    tree.attrs |= kept
    return tree


@cache
def taken_for_a_parabola(profile: str) -> xr.DataTree:
    """The parabola's posterior, of few steps, of a record of one of the paper's profiles; not to be changed."""
    measured = CELL.measure(tb.scan(paper_profile(profile, q=0.5), drive_step=0.1).record, rng=1)
    return tb.infer_contour(measured, rig=tb.Rig(load_cell=CELL, unknown="nothing"), rng=1, settings=SHORT)


def with_readings(tree: xr.DataTree, **readings: np.ndarray) -> xr.DataTree:
    """The tree with another record in it."""
    other = tree.copy()
    observed = tree["observed_data"].to_dataset()
    other["observed_data"] = xr.DataTree(
        observed.assign({name: ("sample", v, observed[name].attrs) for name, v in readings.items()})
    )
    return other


def ideal(name: str) -> np.ndarray:
    """A column of the exact record."""
    return swept().record[name].values.copy()
