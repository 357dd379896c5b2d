"""Prints widths of bands from a second base that was chosen, and from the obvious one.

Objects are drawn from the prior, and with them a rig; each is swept from the origin, and inferred. Then it is swept
from another base: beside the first by half the gap (the obvious choice to close it), or where
`tactile_bayes.design` says; and inferred from both records together.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from benchmarks.table import results
from tactile_bayes.arrays import Floats
from tactile_bayes.errors import TactileBayesError
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import usual_load_cell
from tactile_bayes.planning.candidate import measured_of
from tactile_bayes.planning.knowledge import known_from_prior

FAMILY = tb.Family("parabola", a=stats.lognorm(s=0.4, scale=0.6), q=stats.uniform(0.35, 0.3), x_c=stats.norm(0.0, 0.1))
STEP = float(np.radians(2.0))
SETTINGS = SamplerSettings(ensembles=2, walkers=32, block_steps=25, max_r_hat=1.05, min_ess=400.0, max_steps=1000)
PLACES = 25


class Outcome(NamedTuple):
    """Mean widths of bands over the span of the first base's sweeps, with the gap; or arrays of them."""

    first: float
    again: float  # from the same base once more
    naive: float
    chosen: float
    foreseen: float  # prediction by `design` for the chosen base


def main(objects: int = 100) -> None:
    done = [outcome for _, outcome in results(compared, range(objects)) if outcome is not None]
    print(f"{len(done)} objects; {objects - len(done)} could not be inferred or reached from a base")
    width = Outcome(*np.array(done).T)
    for name in ("again", "naive", "chosen"):
        print(f"band, {name + ' over that of the first base alone':<42}{_spread(getattr(width, name) / width.first)}")
    ratio = width.naive / width.chosen
    print(f"band, {'naive over chosen':<42}{_spread(ratio)}; chosen is narrower in {np.mean(ratio > 1.0):.0%}")
    print(f"band, {'chosen over what was foreseen':<42}{_spread(width.chosen / width.foreseen)}")


def _spread(ratio: Floats) -> str:
    logs = np.log(ratio)
    error = np.exp(logs.std(ddof=1) / np.sqrt(logs.size)) - 1.0
    low, high = np.quantile(ratio, [0.1, 0.9])
    return f"{np.exp(logs.mean()):6.3f} ± {error:.1%} (geometric mean), 10 to 90 %: {low:.2f} to {high:.2f}"


def compared(number: int) -> Outcome | None:
    """Return the widths for one object; None if it could not be inferred or reached."""
    rng = np.random.default_rng([2031, number])
    known = known_from_prior(tb.Rig(unknown={"friction": 0.0}), FAMILY, draws=1, rng=rng)
    point = known.points[0]
    try:
        first = measured_of(known.model_from([tb.Rotation()], STEP), point, rng)
        posterior = _inferred(first, number)
        gap = tb.gap(posterior)
        x = np.linspace(*_span(posterior), PLACES)
        drives = tb.planning.usual_drives(posterior, drive_step=STEP)
        criterion = tb.planning.Criterion(span=(x[0], x[-1]))
        planned = tb.design(posterior, drives=drives, criterion=criterion, rng=number, draws=8)
        reached = planned.isel(candidate=np.flatnonzero(planned.reached.values == 1.0))
        best = reached.isel(candidate=int(np.argmin(reached.width.values)))
        bases = {
            "again": (0.0, 0.0),
            "naive": (0.5 * float(gap.width.sel(bound="median")), 0.0),
            "chosen": (float(best.base_x), float(best.base_y)),
        }
        widths = {"first": _width(posterior, x)}
        for name, base in bases.items():
            model = known.model_from([tb.Rotation(base)], STEP)
            second = measured_of(model, point, np.random.default_rng([2032, number]))
            both = xr.concat([first, second.assign(sweep=second.sweep + 2)], "sample", combine_attrs="override")
            widths[name] = _width(_inferred(both, number), x)
    except TactileBayesError:
        return None
    return Outcome(**widths, foreseen=float(best.width))


def _inferred(record: xr.Dataset, seed: int) -> xr.DataTree:
    rig = tb.Rig(load_cell=usual_load_cell(tb.Rod()))
    return tb.infer_contour(record, family=FAMILY, rig=rig, settings=SETTINGS, rng=seed)


def _span(posterior: xr.DataTree) -> tuple[float, float]:
    ends = posterior["events"].to_dataset().first_contact_x.median(("chain", "draw")).values
    return float(ends.min()), float(ends.max())


def _width(posterior: xr.DataTree, x: Floats) -> float:
    band = tb.contour_band(posterior, x, probability=0.95)
    return float(np.mean(band.upper.values - band.lower.values))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
