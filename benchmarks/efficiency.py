"""Prints posterior standard deviations over Cramér and Rao's bounds, at several noises.

Profile II at the distance 0.5, swept forward and backward in steps of 2°, with all that is not known of the rig by
default: 13 parameters. What stands in the table is the standard deviation of each in its posterior, over the bound
(with priors, at the noise that the posterior finds); the mean of several records.
"""

from __future__ import annotations

import sys

import numpy as np

import tactile_bayes as tb
from benchmarks.table import line, results
from tactile_bayes.arrays import Floats
from tactile_bayes.planning.information import information

FACTORS = (3.0, 1.0, 0.1, 0.01)  # factors on a noise of 0.05 EI/L² and 0.02 EI/L
DRAWS = 2500.0
SETTINGS = tb.SamplerSettings(ensembles=4, walkers=32, max_r_hat=1.01, min_ess=DRAWS, max_steps=4000)
RIG = tb.Rig(load_cell=tb.LoadCell(force_noise=0.05, moment_noise=0.02))
PLAN = tb.planning.Plan(
    tb.contours.paper_profile("II", q=0.5), RIG, drive=tb.Rotation(drive_step=float(np.radians(2.0)))
)


def main(records: int = 8) -> None:
    found: dict[float, list[Floats]] = {factor: [] for factor in FACTORS}
    for (factor, _), ratios in results(compared, [(factor, seed) for factor in FACTORS for seed in range(records)]):
        found[factor].append(ratios)
    print(line("noise, over the usual", (f"{factor:g}" for factor in FACTORS), 24, 16))
    for k, name in enumerate(PLAN.model.names):
        print(line(name, (_mean(np.array(found[factor])[:, k]) for factor in FACTORS), 24, 16))
    print(f"Means of {records} records; of one, sampling alone makes {1.0 / np.sqrt(2.0 * DRAWS):.1%}.")


def compared(task: tuple[float, int]) -> Floats:
    """Return standard deviation over bound of every parameter."""
    factor, seed = task
    plan = PLAN.with_noise(factor)
    measured = plan.cell.measure(plan.scan.record, rng=seed)
    posterior = tb.infer_contour(measured, rig=plan.rig, rng=seed, settings=SETTINGS)
    draws = posterior["posterior"].to_dataset()
    of_record = plan.with_noise(float(draws.noise_scale.mean()))
    bounds = information(of_record).bound_with_priors.sel(parameter=list(PLAN.model.names)).values
    return np.array([float(draws[name].std()) for name in PLAN.model.names]) / bounds


def _mean(ratios: Floats) -> str:
    return f"{ratios.mean():.3f} ± {ratios.std(ddof=1) / np.sqrt(ratios.size):.3f}"


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
