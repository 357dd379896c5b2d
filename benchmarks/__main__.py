"""Prints the table of ratios: what a user would otherwise write beside what this package does, in one process."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

import tactile_bayes as tb
from benchmarks.shooting import contact_by_integration, sweep_by_shooting
from tactile_bayes.contours import Parabola
from tactile_bayes.inference.likelihood import RecordLikelihood
from tactile_bayes.record import make_record


def _best(job: Callable[[], Any], repeats: int = 5) -> float:
    """Shortest of several times [s]: what the job costs when nothing disturbs it."""
    job()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        job()
        times.append(time.perf_counter() - began)
    return min(times)


def main() -> None:
    contour = tb.contours.paper_profile("II", q=0.3)
    rows: list[tuple[str, float, float]] = []

    slopes = np.linspace(0.6, 0.1, 40)
    exact = tb.equilibria(contour, slopes)
    first = float(exact.force_y[0] / np.cos(slopes[0])), float(exact.contact_arclength[0]), float(exact.drive_angle[0])
    by_hand = sweep_by_shooting(contour, slopes, first)
    error = np.max(np.abs(by_hand[:, 0] - exact.drive_angle.values))
    shooting = _best(lambda: sweep_by_shooting(contour, slopes, first), 3) / slopes.size
    for profile, q in (("II", 0.3), ("II", 0.5)):
        many = np.linspace(0.05, 0.55, 100_000)
        shape = tb.contours.paper_profile(profile, q=q)
        closed = _best(lambda shape=shape, many=many: tb.equilibria(shape, many)) / many.size
        rows.append((f"Step 1, one state of profile {profile}, q = {q}: shooting / equilibria", shooting, closed))

    scan = tb.scan(contour, direction="forward").record
    loaded = scan.isel(sample=np.flatnonzero(scan.truth_contact_phase.values != "none"))
    samples = [
        tuple(float(loaded[n][i]) for n in ("drive_angle", "holding_moment", "force_x", "force_y")) for i in range(40)
    ]
    integration = _best(lambda: [contact_by_integration(*sample) for sample in samples], 3) / len(samples)
    repeated: dict[str, Any] = {
        name: np.resize(loaded[name].values, 100_000) for name in ("holding_moment", "force_x", "force_y")
    }
    angle = np.resize(loaded["drive_angle"].values, 100_000)
    order = np.argsort(angle, kind="stable")
    record = make_record(
        {"sweep": 0, "direction": "forward", "drive_angle": angle[order], **{k: v[order] for k, v in repeated.items()}}
    )
    step2 = _best(lambda: tb.reconstruct(record)) / 100_000
    rows.append(("Step 2, one sample: integration with an event / reconstruct", integration, step2))

    rows.append(
        ("double sweep of 180 + 180 samples: shooting / scan", 2 * 180 * shooting, _best(lambda: tb.scan(contour)))
    )

    cell = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
    grid = np.radians(np.arange(0.0, 180.0))
    measured: xr.Dataset = cell.measure(tb.scan(contour, drive_angles=grid).record, seed=1)
    likelihood = RecordLikelihood(measured, cell)
    rng = np.random.default_rng(1)
    walkers = Parabola(*(v + 1e-3 * rng.normal(size=64) for v in (0.5, 0.3, 0.0)))
    with threadpool_limits(1):
        batch = _best(lambda: likelihood.log_likelihood(walkers)) / 64
    rows.append(("log-likelihood of 2 × 180 samples, a walker of 64: shooting / ours", 2 * 180 * shooting, batch))

    print(f"shooting agrees with the closed form to {error:.1e} in drive angle (its tolerance is 1e-9)\n")
    print(f"{'':<76}{'otherwise':>12}{'here':>12}{'ratio':>9}")
    for name, theirs, ours in rows:
        print(f"{name:<76}{_time(theirs):>12}{_time(ours):>12}{theirs / ours:>9.0f}")


def _time(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


if __name__ == "__main__":
    main()
