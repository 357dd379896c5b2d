"""Prints effective draws of one posterior per second and per evaluation, by this package and other samplers.

The posterior is the demonstration's: a parabola's three parameters and the factor on the load cell's noise. Every
sampler is given the same log-probability, starts, processor core and number of evaluations, in four independent runs of
which the second half counts. Times are the processor's. Effective sample size is that of the bulk, of the worst
parameter, by arviz-stats over four chains; the chain of a run with many walkers is walker-major. Peers are not
dependencies of this package: `make samplers` puts them in a folder of their own.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.metadata import version
from typing import Any

import numpy as np
from arviz_stats.base.array import array_stats
from threadpoolctl import threadpool_limits

import tactile_bayes as tb
from benchmarks.table import line
from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.ensembles import sample
from tactile_bayes.inference.ensembles.diagnosis import walker_major
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.starts.contour_start import Walk, walk_of
from tactile_bayes.numerics.random_numbers import spawn
from tactile_bayes.runs.demonstration import CONTOUR, LOAD_CELL, ROD
from tactile_bayes.tasks import one_thread

Sampler = Callable[["Counted", Floats, int], Floats]

RUNS = 4
WALKERS = 48


class Counted:
    """A log-probability that counts the points at which it was computed."""

    def __init__(self, log_probability: Callable[[Floats], Floats]) -> None:
        self.log_probability = log_probability
        self.evaluations = 0

    def __call__(self, points: Floats) -> Floats:
        self.evaluations += len(points)
        return self.log_probability(points)


def main(evaluations: int = 40_000) -> None:
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    with threadpool_limits(1), one_thread():
        model = demonstration()
        walk = walk_of(model, spawn(1, 1)[0], tb.SamplerSettings(ensembles=RUNS, walkers=WALKERS))
        start = started(walk)
        model.log_probability(start[0])  # whatever is compiled is compiled here
        print(f"{', '.join(model.names)}: {RUNS} runs of {evaluations // RUNS:,} evaluations\n")
        print(line("", ("evaluations", "CPU", "R̂", "ESS", "ESS/s", "ESS/1000", "means off"), 54, 12))
        reference = None
        for name, package, sampler in samplers(walk):
            if not installed(package[1]):
                print(f"{name:<54}not installed, skipped: see `make samplers`")
                continue
            target = Counted(model.log_probability)
            began = time.process_time()
            draws = sampler(target, start, evaluations)
            seconds = time.process_time() - began
            chains = walker_major(draws[:, draws.shape[1] // 2 :])
            reference = chains if reference is None else reference
            print_row(f"{name}, {package[0]} {version(package[0])}", target.evaluations, seconds, chains, reference)


def started(walk: Walk) -> Floats:
    """Return starting points of walkers, as parameters, shape (ensembles, walkers, parameters)."""
    parameters, _ = walk.coordinates.parameters(walk.start.reshape(-1, walk.start.shape[-1]))
    return parameters.reshape(walk.start.shape)


def demonstration() -> ContourModel:
    measured = LOAD_CELL.measure(tb.scan(CONTOUR, tb.Rig(rod=ROD)).record, rng=1)
    return Experiment(measured, tb.Rig(unknown="nothing")).model


def installed(module: str) -> bool:
    try:
        import_module(module)
    except ImportError as error:
        if error.name != module:
            print(f"{module} lacks {error.name}: install it beside", file=sys.stderr)
        return False
    return True


def print_row(name: str, evaluations: int, seconds: float, chains: Floats, reference: Floats) -> None:
    """Print a row; the largest distance of means is in standard deviations, with an error of 1/√ESS of either."""
    every = range(chains.shape[-1])
    ess = min(array_stats.ess(chains[..., i], chain_axis=0, draw_axis=1, method="bulk") for i in every)
    r_hat = max(array_stats.rhat(chains[..., i], chain_axis=0, draw_axis=1, method="rank") for i in every)
    off = chains.mean(axis=(0, 1)) - reference.mean(axis=(0, 1))
    off = float(np.abs(off / reference.std(axis=(0, 1))).max())
    cells = [f"{evaluations:,}", f"{seconds:.1f} s", f"{r_hat:.3f}", f"{ess:,.0f}", f"{ess / seconds:,.1f}"]
    print(line(name, [*cells, f"{1000.0 * ess / evaluations:.1f}", f"{off:.3f}"], 54, 12), flush=True)


# ---- samplers: from a target, starts (runs, walkers, parameters) and a number of evaluations to draws, shape
# (runs, steps, walkers, parameters)


def samplers(walk: Walk) -> Iterator[tuple[str, tuple[str, str], Sampler]]:
    """Yield name, distribution and module, and function."""
    yield "infer_contour's", ("tactile-bayes", "tactile_bayes"), ours(walk)
    pints = ("pints", "pints")
    yield "DifferentialEvolutionMCMC", pints, population_of_pints("DifferentialEvolutionMCMC")
    yield "DreamMCMC", pints, population_of_pints("DreamMCMC")
    yield "HaarioBardenetACMC", pints, haario
    yield "EnsembleSampler", ("zeus-mcmc", "zeus"), zeus


def ours(walk: Walk) -> Sampler:
    """Sample until the evaluations are spent, although it would have stopped before."""

    def draw(target: Counted, start: Floats, evaluations: int) -> Floats:
        settings = tb.SamplerSettings(ensembles=RUNS, walkers=WALKERS, max_steps=steps_for(evaluations), min_ess=1e9)
        names = [f"p{i}" for i in range(start.shape[-1])]
        draws = sample(target, walk.start, names=names, seed=1, settings=settings, coordinates=walk.coordinates)
        kept = draws.samples.reshape(len(draws.samples), draws.walkers, draws.steps_kept, -1).swapaxes(1, 2)
        return np.concatenate([np.full_like(kept, np.nan), kept], axis=1)  # it keeps the second half alone

    return draw


def population_of_pints(name: str) -> Sampler:
    def draw(target: Counted, start: Floats, evaluations: int) -> Floats:
        pints = import_module("pints")
        np.random.seed(1)  # noqa: NPY002, it knows no other random numbers
        steps, method = steps_for(evaluations), getattr(pints, name)
        return np.array([asked(target, [method(WALKERS, list(of_run))], steps) for of_run in start])

    return draw


def haario(target: Counted, start: Floats, evaluations: int) -> Floats:
    """Run one walker, from the first of the ensemble; the scatter of the starts is the initial covariance."""
    pints = import_module("pints")
    np.random.seed(1)  # noqa: NPY002
    covariance = np.cov(start.reshape(-1, start.shape[-1]).T)
    methods = [pints.HaarioBardenetACMC(of_run[0], covariance) for of_run in start]
    return np.swapaxes(asked(target, methods, evaluations // RUNS), 0, 1)[:, :, None]


def asked(target: Counted, methods: list[Any], steps: int) -> Floats:
    """Return steps of methods of PINTS, with points evaluated together; shape (steps, walkers, parameters)."""
    draws = []
    quiet = [method for method in methods if method.needs_initial_phase()]
    for method in quiet:
        method.set_initial_phase(True)
    current: list[Any] = [None] * len(methods)
    while len(draws) < steps:
        if len(draws) == min(200, steps // 4):  # the length that the controller of PINTS gives its initial phase
            for method in quiet:
                method.set_initial_phase(False)
        points = [np.atleast_2d(method.ask()) for method in methods]
        values = np.split(target(np.concatenate(points)), np.cumsum([len(p) for p in points])[:-1])
        for i, (method, of_method) in enumerate(zip(methods, values, strict=True)):
            told = method.tell(of_method if len(methods) == 1 else of_method[0])
            current[i] = current[i] if told is None else np.atleast_2d(told[0])
        if all(place is not None for place in current):
            draws.append(np.concatenate(current))
    return np.array(draws)


def zeus(target: Counted, start: Floats, evaluations: int) -> Floats:
    """Run zeus; the evaluations of a slice vary, so a run ends when its share of them is spent."""
    sampler_of = import_module("zeus").EnsembleSampler
    np.random.seed(1)  # noqa: NPY002
    runs = []
    for of_run in start:
        spent = target.evaluations
        sampler = sampler_of(WALKERS, start.shape[-1], target, vectorize=True, verbose=False)
        for _ in sampler.sample(of_run, iterations=steps_for(evaluations), progress=False):
            if target.evaluations - spent >= evaluations // RUNS:
                break
        done = int(sampler.iteration)
        runs.append(sampler.get_chain()[:done])
    steps = min(map(len, runs))
    return np.array([run[:steps] for run in runs])


def steps_for(evaluations: int) -> int:
    return evaluations // (RUNS * WALKERS)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
