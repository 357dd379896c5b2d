"""The public face as a typed program uses it: `make lint` checks these lines as strictly as mypy can."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy import stats

import tactile_bayes as tb
from tactile_bayes.inference.family import Family
from tactile_bayes.rig import Rig


def contour_of(record: xr.Dataset) -> tuple[xr.DataTree, xr.Dataset, xr.Dataset]:
    cell: tb.LoadCell = tb.LoadCell.from_zero_load(record)
    contacts: xr.Dataset = tb.reconstruct(record, Rig(load_cell=cell), method="constrained")
    posterior: xr.DataTree = tb.infer_contour(
        record, family=Family("parabola", q=stats.uniform(0.3, 0.4)), rig=Rig(load_cell=cell), rng=1
    )
    band: xr.Dataset = tb.contour_band(posterior, x=[-0.5, 0.0, 0.5], probability=0.95)
    return posterior, contacts, band


def simulated(rod: tb.Rod | None = None) -> xr.Dataset:
    contour: tb.contours.Contour = tb.contours.Parabola(a=0.5, q=0.5)
    scan = tb.scan(contour, Rig(rod=rod), base=[(0.0, 0.0), (0.25, 0.0)], drive_step=float(np.radians(2.0)))
    angle: float = scan.sweeps[0].snap_off.drive_angle
    record: xr.Dataset = scan.record
    return tb.LoadCell(force_noise=0.05, moment_noise=0.02).measure(record.where(record.drive_angle < angle), rng=1)


def drawn(posterior: xr.DataTree, band: xr.Dataset) -> Axes:
    ax: Axes = tb.plotting.contour(band.x.values, band=band, gap=tb.gap(posterior))
    return ax


def planned() -> tuple[xr.DataTree, xr.Dataset, xr.Dataset]:
    plan = tb.planning.Plan(tb.contours.paper_profile("II", q=0.5))
    needed: xr.Dataset = tb.planning.required_noise(plan, 0.005)
    found: xr.Dataset = tb.design("parabola", draws=4, rng=1)
    return tb.sensitivity(rng=1), needed, found
