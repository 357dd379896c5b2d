"""Prints times of SciPy alone and of this package, in one process and one thread, and their growth."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any

import emcee
import numpy as np
import xarray as xr
from arviz_stats.base.array import array_stats
from threadpoolctl import threadpool_limits

import tactile_bayes as tb
from benchmarks.samplers import demonstration, started
from benchmarks.shooting import contact_by_integration, misfit_by_least_squares, sweep_by_collocation, sweep_by_shooting
from benchmarks.table import Row, best_time, print_growth, print_ratios
from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Parabola
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.inference.contact_posterior.density import ContactDensity
from tactile_bayes.inference.contact_posterior.draws import draw_contacts
from tactile_bayes.inference.contact_posterior.posterior import density_of
from tactile_bayes.inference.ensembles import sample
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.inference.starts.contour_start import walk_of
from tactile_bayes.mechanics.paths import trace
from tactile_bayes.numerics.random_numbers import spawn
from tactile_bayes.rig import make_record
from tactile_bayes.runs.demonstration import CONTOUR as DEMONSTRATED
from tactile_bayes.runs.demonstration import LOAD_CELL, ROD
from tactile_bayes.tasks import one_thread

CONTOUR = tb.contours.paper_profile("II", q=0.6)  # its forward sweep is in tip, then tangential, then tip contact again
SLOPES = 0.54, 0.12  # from soon after first contact to just before snap-off
TAPERED = tb.Rod(taper=0.5)
ANGLES = np.radians(np.arange(180.0))
CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
PARABOLAS = {"a": {"uniform": [0.3, 0.7]}, "q": {"uniform": [0.5, 0.7]}, "x_c": {"normal": [0.0, 0.05]}}
SPECIFICATION: dict[str, Any] = {
    "records": 2_000,
    "seed": 1,
    "contours": [{"family": "parabola", **PARABOLAS}],
    "scan": {"samples": 180},
    "load_cell": {"force_noise": 0.05, "moment_noise": 0.02},
}
MANY = 100_000
STRETCHES = 1_000  # steps of emcee's ensembles, by its own moves
TIGHT = 1e-12  # tolerance at which accuracy is judged; what is timed has 1e-9


def main() -> None:
    with threadpool_limits(1), one_thread():
        one, error_of_one = step_one()
        two, error_of_two = step_two()
        likeliest, error_of_likeliest = constrained()
        of_records, rate = data_set()
        of_contour, draws = contour_posterior()
        of_sweeps = sweeps(by_hand=one[0].otherwise)
        print_ratios([*one, *of_sweeps, *two, likeliest, posteriors(), of_contour, of_records, *starting()])
        print(f"\n{error_of_one}\n{error_of_two}\n{error_of_likeliest}\n{rate}\n{draws}")
        print("\nTime per item, for growing numbers of items:")
        print_growth("state, equilibria", (1_000, 10_000, 100_000, 1_000_000), equilibria)
        print_growth("sample, reconstruct", (1_000, 10_000, 100_000, 1_000_000), reconstruct)
        print_growth("contour, trace and 180 drive angles", (10, 100, 1_000, 10_000), loads)


def step_one() -> tuple[list[Row], str]:
    """Time a state; 40 slope angles by hand."""
    slopes = np.linspace(*SLOPES, 40)
    exact = states(slopes)
    first, of_tapered = tuple(exact[0]), tuple(states(slopes, TAPERED)[0])
    shooting, collocation, tapered = (
        best_time(job, 3) / slopes.size
        for job in (
            lambda: sweep_by_shooting(CONTOUR, slopes, first),
            lambda: sweep_by_collocation(CONTOUR, slopes, first),
            lambda: sweep_by_collocation(CONTOUR, slopes, of_tapered, taper=TAPERED.taper),
        )
    )
    few = MANY // 20
    ours, ours_of_tapered = best_time(equilibria(MANY)) / MANY, best_time(equilibria(few, TAPERED)) / few
    apart = np.abs(sweep_by_shooting(CONTOUR, slopes, first, TIGHT) - exact).max()
    return [
        Row("Step 1, a state: solve_ivp and root / equilibria", shooting, ours),
        Row("Step 1, a state: solve_bvp / equilibria", collocation, ours),
        Row("Step 1, a state of a tapered rod: solve_bvp / equilibria", tapered, ours_of_tapered),
    ], (
        f"Step 1: states with {np.mean(exact[:, 3] == 1.0):.0%} in tip contact, the others tangential; "
        f"shooting at tolerance {TIGHT:g} and equilibria differ by at most {apart:.1e}"
    )


def step_two() -> tuple[list[Row], str]:
    """Time a sample; 60 by hand."""
    clean = record(MANY)
    some = clean.isel(sample=np.flatnonzero(clean.holding_moment > 0.0)[:: MANY // 120])
    wrenches = [some[name].values for name in ("drive_angle", "holding_moment", "force_x", "force_y")]

    def by_hand(rtol: float = 1e-9) -> np.ndarray:
        return np.array([contact_by_integration(*wrench, rtol) for wrench in zip(*wrenches, strict=True)])

    integration = best_time(by_hand, 3) / some.sizes["sample"]
    records = {"without noise": clean, "with noise": CELL.measure(clean, rng=1)}
    rows = []
    for kind, measured in records.items():
        ours = best_time(lambda measured=measured: tb.reconstruct(measured), 10) / measured.sizes["sample"]
        rows.append(Row(f"Step 2, a sample {kind}: solve_ivp with an event / reconstruct", integration, ours))
    contacts = tb.reconstruct(some)
    apart = np.abs(by_hand(TIGHT) - np.stack([contacts.contact_x, contacts.contact_y], axis=1)).max()
    phases = tb.reconstruct(clean).contact_phase
    return rows, (
        f"Step 2: {clean.sizes['sample']:,} samples in 2 sweeps, {float((phases == 'tip').mean()):.0%} in tip contact, "
        f"the others tangential; integration at tolerance {TIGHT:g} and reconstruct differ by at most {apart:.1e}"
    )


def constrained() -> tuple[Row, str]:
    """Time a sample; by hand, some in tangential contact, for which that sheet alone is fitted."""
    measured = CELL.measure(record(MANY), rng=1)
    contacts = tb.reconstruct(measured, method="constrained")
    lying = (contacts.contact_phase.values == "tangential") & (contacts.status.values == "ok")
    some = np.flatnonzero(lying & (measured.direction.values == "forward"))[:: MANY // 120]
    noise = np.array([CELL.moment_noise, CELL.force_noise, CELL.force_noise])
    loads = np.stack([measured[name].values for name in ("holding_moment", "force_x", "force_y")], axis=1)
    angles = measured.drive_angle.values

    def by_hand() -> list[float]:
        return [misfit_by_least_squares(angles[i], loads[i], noise) for i in some]

    otherwise = best_time(by_hand, 3) / some.size
    ours = best_time(lambda: tb.reconstruct(measured, method="constrained"), 3) / measured.sizes["sample"]
    apart = np.abs(np.array(by_hand()) - contacts.misfit.values[some]).max()
    return Row("Step 2 constrained, a sample with noise: least_squares, one phase / reconstruct", otherwise, ours), (
        f"Step 2 constrained: {1.0 / ours:,.0f} samples/s; {some.size} sums of squares by least_squares and ours "
        f"differ by at most {apart:.1e}"
    )


def posteriors() -> Row:
    """Time a contact of a double sweep at 1°; every fortieth sample by emcee, four ensembles to 400 effective draws."""
    measured = CELL.measure(tb.scan(CONTOUR).record, rng=1)
    density, *_ = density_of(measured.isel(sample=slice(None, None, 40)), CELL, 0.0, "flat")
    starts = draw_contacts(density, 4 * 24, np.random.SeedSequence(1)).points
    settings = tb.SamplerSettings(walkers=24, min_ess=400.0, max_steps=4000)

    def by_hand() -> None:
        for i in range(starts.shape[2]):
            one = density.take(np.array([i]))

            def log_density(points: Floats, one: ContactDensity = one) -> Floats:
                return one.log_density(*one.unfold(points[:, None]))[:, 0]

            seed = np.random.SeedSequence(i)
            sample(log_density, starts[:, :, i], names=("way", "force"), seed=seed, settings=settings)

    by_emcee = best_time(by_hand, 1) / starts.shape[2]
    count = int((tb.reconstruct(measured).status != "no contact").sum())
    ours = best_time(lambda: tb.infer_contacts(measured, rng=1), 1) / count
    return Row(f"posterior of one of {count} contacts: emcee for each / infer_contacts", by_emcee, ours)


def contour_posterior() -> tuple[Row, str]:
    """Time the demonstration, with start and predictions; by emcee's own moves, 1000 effective draws.

    These get the start, the same log-probability, vectorised, and enough steps to forget the start; their
    effective draws are those of the second half.
    """
    measured = LOAD_CELL.measure(tb.scan(DEMONSTRATED, tb.Rig(rod=ROD)).record, rng=1)
    results: list[xr.DataTree] = []
    rig = tb.Rig(unknown="nothing")
    ours = best_time(lambda: results.append(tb.infer_contour(measured, rig=rig, rng=1)), 3)
    model = demonstration()
    start = started(walk_of(model, spawn(1, 1)[0], tb.SamplerSettings()))
    began = time.perf_counter()
    chains = []
    for of_ensemble in start:
        sampler: Any = emcee.EnsembleSampler(*of_ensemble.shape, model.log_probability, vectorize=True)
        sampler.run_mcmc(of_ensemble, STRETCHES)
        chains.append(sampler.get_chain()[STRETCHES // 2 :].swapaxes(0, 1).reshape(-1, of_ensemble.shape[1]))
    seconds = time.perf_counter() - began
    ess = min(array_stats.ess(np.array(chains)[..., i], chain_axis=0, draw_axis=1) for i in range(len(model.names)))
    stats = results[-1]["sample_stats"]
    return Row("posterior of the demonstration, 4 parameters: emcee / infer_contour", seconds * 1000.0 / ess, ours), (
        f"Posterior: {float(stats.ess_bulk.min()):,.0f} effective draws of {stats.attrs['evaluations']:,} evaluations; "
        f"emcee's own moves gave {ess:,.0f} of {start.shape[0] * start.shape[1] * STRETCHES:,} in {seconds:.1f} s"
    )


def starting() -> list[Row]:
    """Time importing this package, and the help of its command, in new processes beside importing scipy.stats."""
    ours = {"import tactile_bayes": "import tactile_bayes"}
    ours["tactile-bayes --help"] = "from tactile_bayes.cli import app; app(['--help'])"

    def time_of(code: str) -> float:
        command = [sys.executable, "-c", code]
        return best_time(lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL), repeats=3)

    reference = time_of("import scipy.stats")
    return [Row(f"start: import scipy.stats / {what}", reference, time_of(code)) for what, code in ours.items()]


def sweeps(by_hand: float) -> list[Row]:
    """Time whole sweeps; by hand they take as long as their states in contact."""
    scan = tb.scan(CONTOUR)
    scanned = in_contact(scan.record)
    observed = loads(1_000)
    touching = float(np.mean(np.any(observed() != 0.0, axis=-1))) * ANGLES.size
    measured = CELL.measure(tb.scan(CONTOUR, drive_angles=ANGLES).record, rng=1)
    likelihood = RecordLikelihood(measured, CELL)
    walkers = contours(64)
    rows = [
        ("double scan at 1° and its events", scanned, lambda: tb.scan(CONTOUR), 1),
        ("sweep at 1° along one of 1000 contours", touching, observed, 1_000),
        (
            "log-likelihood of a double sweep for one of 64 contours",
            in_contact(measured),
            lambda: likelihood.log_likelihood(walkers),
            64,
        ),
    ]
    return [
        Row(f"{what}, {n:.0f} states: solve_ivp and root / ours", n * by_hand, best_time(job) / of)
        for what, n, job, of in rows
    ]


def data_set() -> tuple[Row, str]:
    """Time a record of a data set; by hand, every fourth state of the forward sweeps of the first four."""
    records = SPECIFICATION["records"]
    with TemporaryDirectory() as folder:
        few = tb.datasets.generate({**SPECIFICATION, "records": 4}, mkdtemp(dir=folder), workers=1)
        made = tb.datasets.open(few.parent).load()
        ours = best_time(lambda: tb.datasets.generate(SPECIFICATION, mkdtemp(dir=folder), workers=1), 3) / records
    touched = int(np.count_nonzero(made.truth_contact_phase != 0)) / 4
    by_hand = touched * float(np.mean([time_by_hand(made.isel(record=k, sweep=0)) for k in range(4)]))
    samples = f"{made.sizes['sweep']} × {made.sizes['sample']} samples"
    what = f"record of {samples} in a data set on disk, {touched:.0f} states: solve_ivp and root / generate"
    return Row(what, by_hand, ours), (
        f"Data set: {records:,} double sweeps along as many contours, truth and readings, {1.0 / ours:,.0f} records/s"
    )


def time_by_hand(sweep: xr.Dataset) -> float:
    """Return the time of a state, along every fourth sample in contact."""
    some = sweep.isel(sample=np.flatnonzero(sweep.truth_contact_phase.values != 0)[::4])
    contour = Parabola(*(float(some[f"truth_contour_{name}"]) for name in ("a", "q", "x_c")))
    force = np.hypot(some.truth_force_x, some.truth_force_y)
    columns = [some.drive_angle, some.truth_holding_moment, force, some.truth_contact_arclength]
    first = tuple(float(column[0]) for column in columns)
    slopes = some.truth_slope_angle.values
    return best_time(lambda: sweep_by_shooting(contour, slopes, first), 1) / slopes.size


def states(slopes: np.ndarray, rod: tb.Rod | None = None) -> np.ndarray:
    """Return drive angle, holding moment, force and arc length of the contact."""
    found = tb.equilibria(CONTOUR, slopes, rig=tb.Rig(rod=rod))
    force = np.hypot(found.force_x, found.force_y)
    return np.stack([found.drive_angle, found.holding_moment, force, found.contact_arclength], axis=1)


def in_contact(scanned: xr.Dataset) -> int:
    return int(np.sum(scanned.truth_contact_phase.values != "none"))


def contours(count: int) -> Parabola:
    """Return contours as different as those of a broad posterior."""
    rng = np.random.default_rng(1)
    return Parabola(rng.uniform(0.3, 0.7, count), rng.uniform(0.5, 0.7, count), rng.uniform(-0.1, 0.1, count))


@cache
def double_sweep() -> xr.Dataset:
    """Return about `MANY` samples, all in contact except some 60, from a load cell without noise."""
    events = tb.scan(CONTOUR).events.values()
    angle = sum(abs(sweep.snap_off.drive_angle - sweep.first_contact.drive_angle) for sweep in events)
    scanned = tb.scan(CONTOUR, drive_step=angle / (MANY - 60)).record
    return scanned.drop_vars([name for name in scanned.data_vars if name.startswith("truth_")])


def record(count: int) -> xr.Dataset:
    """Return about so many samples of the double sweep, or several double sweeps."""
    if count <= MANY:
        return double_sweep().isel(sample=slice(None, None, MANY // count))
    times, one = count // MANY, double_sweep()
    columns: dict[str, Any] = {str(name): np.tile(column.values, times) for name, column in one.items()}
    columns["sweep"] += 2 * np.repeat(np.arange(times), one.sizes["sample"])
    return make_record(columns)


def equilibria(count: int, rod: tb.Rod | None = None) -> Callable[[], Any]:
    slopes, rig = np.linspace(*SLOPES, count), tb.Rig(rod=rod)
    return lambda: tb.equilibria(CONTOUR, slopes, rig=rig)


def reconstruct(count: int) -> Callable[[], Any]:
    measured = record(count)
    return lambda: tb.reconstruct(measured)


def loads(count: int) -> Callable[[], Any]:
    """Return loads as a likelihood computes them."""
    zero = np.zeros(count)
    sweep_frame = SweepFrame(contours(count), zero, zero, 1.0, 0.0, zero > 0.0)
    return lambda: trace(sweep_frame, tolerance=np.array([4e-5, 1e-4, 1e-4]), drive_angles=ANGLES, polished=False)


if __name__ == "__main__":
    main()
