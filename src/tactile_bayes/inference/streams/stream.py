"""The posterior of a contour while its record grows, by sequential Monte Carlo."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any, Self

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_function, check_numbers, check_path, check_whole_number
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_groups import unit_of, whole_groups
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.densities import effective_number, normalised
from tactile_bayes.inference.ensembles import Draws, SamplerSettings
from tactile_bayes.inference.experiment import Experiment, identity_of
from tactile_bayes.inference.family import Family, family_of
from tactile_bayes.inference.result import STREAMED, provenance
from tactile_bayes.inference.streams.particles import DECORRELATED, SETTLED, Particles
from tactile_bayes.inference.streams.stream_state import (
    StreamState,
    continued,
    read_tree,
    state_in,
    surprise_after,
    tree_of,
)
from tactile_bayes.numerics.random_numbers import Rng, child, seed_sequence, whole_seed
from tactile_bayes.numerics.selection import resampled
from tactile_bayes.record import validate
from tactile_bayes.record.netcdf import write_netcdf
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.tasks import differences, versions_of

LEVELS = (0.025, 0.25, 0.5, 0.75, 0.975)  # levels of the quantiles of parameters and of the band
_MOST_SURPRISE = 700.0  # largest logarithm of an e-value that is stated, which is finite
_PRIOR_DRAWS = 4000  # number of draws from the prior for the share of contours within reach


class Stream:
    """The posterior of a contour from the record so far, updated with every new block of samples.

    Weighted particles represent the posterior. They come from the prior; each block multiplies their weights by the
    ratio of the likelihoods of the record with and without it. If too few of them remain effective, the block enters by
    powers of that ratio, and after each the particles are resampled and moved by the steps of `infer_contour` (Del
    Moral, Doucet & Jasra 2006, doi 10.1111/j.1467-9868.2006.00553.x). The likelihood is that of `infer_contour` for the
    record so far, and so is the posterior, within the Monte-Carlo error of the particles.

    Parameters
    ----------
    family, rig
        As in `infer_contour`. An unknown of which nothing is said and that the record does not show at first, like the
        backlash in a single direction, enters with the first sample that does.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Random numbers: the same seed and blocks give the same results.
    particles : int
        Number of particles, from 100 up; see Notes.
    x : array_like, optional
        Positions at which every update states quantiles of the contour's height [length].
    stop : callable, optional
        Rule for the end of measuring: a function that is called with the result of each update, and whose value
        becomes the result's `may_stop`.

    Raises
    ------
    ParameterError
        If an argument is not valid. What depends on the record is checked at the first update.

    Notes
    -----
    Each update computes the likelihood of the whole record so far again: exact for drifts, correlated noise and
    integrated biases, but an update costs more the longer the record: 0.1 to 1.0 s on one core with 1,000 particles, 13
    parameters and up to 330 samples, the first two 4 and 2 s.

    `e_value` is the largest so far of a martingale: the density of the samples from some block on with noise that is
    wider by 1.5, 3 or 6, over that of the model, both given the samples before. For records of the model, drawn from
    its prior, it exceeds 1/α with a probability of at most α, however often one looks (Ville 1939; Shin, Ramdas &
    Rinaldo 2023, arXiv:2203.03532), up to the Monte-Carlo error of the particles: above 1,000 the model is wrong, in
    its shape, its rig or its noise. It is NaN with a discrepancy.

    With 13 parameters, medians were up to 1.1 standard deviations off with 100 particles, 0.35 with 150, and 0.3 with
    200 and 400: take 30 for each parameter at least, better 50.

    Examples
    --------
    >>> import tempfile
    >>> from tactile_bayes import LoadCell, Rig, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> options = {"family": "parabola", "rig": Rig(load_cell=cell, unknown="nothing"), "rng": 1, "particles": 200}
    >>> stream = Stream(**options)
    >>> first = stream.update(measured.isel(sample=slice(0, 10)))
    >>> with tempfile.TemporaryDirectory() as directory:
    ...     stream.save(Path(directory) / "stream.nc")
    ...     resumed = Stream.resume(Path(directory) / "stream.nc", **options)
    >>> one, other = (each.update(measured.isel(sample=slice(10, None))) for each in (stream, resumed))
    >>> one.drop_vars("seconds").identical(other.drop_vars("seconds"))
    True
    """

    def __init__(
        self,
        *,
        family: Family | str = "parabola",
        rig: Rig | None = None,
        rng: Rng,
        particles: int = 1000,
        x: ArrayLike | None = None,
        stop: Callable[[xr.Dataset], object] | None = None,
    ) -> None:
        check_whole_number("particles", particles, 100, "give a whole number of at least 100", most=10**7)
        check_function("stop", stop)
        self._x = None if x is None else check_numbers("x", x, "give a list of finite numbers", shape=(None,))
        self._family, self._rig = family_of(family), rig_of(rig)
        self._seed = seed_sequence(rng)
        self._particles, self._stop = particles, stop
        self._state: StreamState | None = None

    @property
    def record(self) -> xr.Dataset | None:
        """The record so far; None before the first update."""
        return None if self._state is None else self._state.record

    def update(self, samples: xr.Dataset) -> xr.Dataset:
        """Take new samples into account, and return the posterior in brief.

        Parameters
        ----------
        samples : xr.Dataset
            A record of the new samples alone, in the order of measurement, with the columns and attributes of those
            before. They may continue the last sweep, or begin new ones.

        Returns
        -------
        xr.Dataset
            `samples`, their number so far; `log_evidence`, the logarithm of the density of the record under the prior
            of contours within reach; `effective_number` of the particles; `stages` and `steps` of this update (0 if
            weights alone changed), and `correlation`, the largest one of a parameter before and after the last steps,
            which end below 0.2, or after 40 (NaN without steps); `log_density_rise`, the increase of the mean
            log-density in the steps of the last stage, over its standard deviation: above 0.4 the particles had lost
            the posterior, and are on their way to it; `log_density_shift`, the largest one of a stage so far: above 1.2
            `log_evidence` is too small; `e_value`, above 1,000 for a model that is wrong, see
            Notes of `Stream`; `seconds` that the update took; `parameters` by `parameter` and `level`, their quantiles;
            with `x`, `height` by `level` and `x`; with a rule, `may_stop`.

        Raises
        ------
        RecordError
            If the samples are no valid record, or do not continue the one before.
        ParameterError, InferenceError, ReachError
            As in `infer_contour`. After any error the stream is as before.
        """
        began = perf_counter()
        old = self._state
        record = validate(samples) if old is None else continued(old.record, samples)
        experiment = Experiment(record, self._rig, self._family)
        updates = 0 if old is None else old.updates + 1
        random = self._random(0, updates)
        with threadpool_limits(1):
            advance = Particles(experiment.model, old, self._particles, random)
            share = _share_within_reach(experiment.model, old, random)
        seconds, evaluations = (0.0, 0) if old is None else (old.seconds, old.evaluations)
        had = np.nan if old is None else old.correlation
        products, surprise = surprise_after(old, advance.log_ratios)
        state = StreamState(
            record,
            experiment,
            advance.points,
            advance.values,
            advance.log_weights,
            products,
            advance.log_integral,
            share,
            advance.correlation if advance.steps else had,
            max(advance.shift, 0.0 if old is None else old.shift),
            advance.rise if advance.steps or old is None else old.rise,
            surprise,
            updates,
            evaluations + advance.evaluations,
            seconds + perf_counter() - began,
        )
        result = self._brief(state).assign(stages=advance.stages, steps=advance.steps, correlation=advance.correlation)
        result["seconds"] = ((), perf_counter() - began, {"units": "s"})
        if self._stop is not None:
            result["may_stop"] = bool(self._stop(result))
        self._state = state
        return result

    def latest(self) -> xr.Dataset:
        """Return the result of `update` for the record so far, without the entries on a single update.

        These are `stages`, `steps`, `seconds` and `may_stop`; `correlation` is that of the last steps of any update.

        Raises
        ------
        InferenceError
            Before the first update.
        """
        return self._brief(self._known_state())

    def posterior(self) -> xr.DataTree:
        """Return the posterior of the record so far, as `infer_contour` does, with equally weighted particles as draws.

        There is one chain, whose convergence is not judged by R̂: `converged` is 0 if the last moves of the particles
        ended before they had decorrelated, or they had left the posterior (`log_density_rise`), and the message
        states their effective number. Where that is less than their number, some draws are repeated.

        Raises
        ------
        InferenceError
            Before the first update.
        """
        state = self._known_state()
        model, random = state.experiment.model, self._random(1, state.updates)
        left = float(effective_number(normalised(state.log_weights)))
        if state.rise > SETTLED:
            fault = "; not converged, they had lost the posterior and are on their way to it: take more from the start"
        elif state.correlation >= DECORRELATED:
            fault = f"; not converged, the last moves left a correlation of {state.correlation:.2f}: take more of them"
        else:
            fault = ""
        picked = random.permutation(resampled(np.exp(state.log_weights), len(state.log_weights), random))
        unknown = np.full(len(model.names), np.nan)
        draws = Draws(
            samples=state.points[picked][None],
            log_probability=state.values[picked][None],
            names=model.names,
            walkers=len(picked),
            steps_kept=1,
            steps_run=state.updates + 1,
            r_hat=unknown,
            ess_bulk=unknown,
            ess_tail=unknown,
            acceptance=np.full(1, np.nan),
            autocorrelation_time=unknown,
            evaluations=state.evaluations,
            seconds=state.seconds,
            converged=not fault,
            message=f"sequential Monte Carlo, {left:.0f} effective of {len(picked)} particles{fault}",
            stuck=0,
        )
        tree = xr.DataTree.from_dict(whole_groups(model, draws, random))
        about = provenance(draws, seed=self._seed, settings=SamplerSettings(), **state.experiment.about)
        tree.attrs = {**about, "sampler": STREAMED, "settings": f'{{"particles": {len(picked)}}}'}
        return tree

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the stream to a file from which `resume` continues, whole or not at all.

        The NetCDF file holds the record so far, the particles, and all that their numbers depend on (model, priors,
        seed, versions). It replaces one of its name.

        Parameters
        ----------
        path : path-like
            File to be written.

        Raises
        ------
        InferenceError
            Before the first update.
        """
        write_netcdf(self.as_tree(), check_path("path", path))

    def as_tree(self) -> xr.DataTree:
        """Return the tree that `save` writes."""
        state = self._known_state()
        return tree_of(state, self._identity(state.experiment))

    @classmethod
    def resume(cls, path: str | os.PathLike[str], record: xr.Dataset | None = None, **arguments: Any) -> Self:
        """Return the stream that was saved in a file; it continues with the numbers that it would have had.

        Parameters
        ----------
        path : path-like
            File that `save` has written.
        record : xr.Dataset, optional
            The record as it is now, if it is kept elsewhere too: it must begin with the samples of the stream.
        **arguments
            The arguments of `Stream` as they were; `x` and `stop` may be others.

        Raises
        ------
        InferenceError
            If there is no such file, it is damaged, or it is of another record, model, prior, seed, number of
            particles or version; the message states what differs.
        RecordError, ParameterError
            As in `update`.
        """
        path, stream = check_path("path", path), cls(**arguments)
        stream.restore(read_tree(path), path, record)
        return stream

    def restore(self, tree: xr.DataTree, path: Path, record: xr.Dataset | None = None) -> None:
        """Continue from the tree that `as_tree` has returned, which is in the file at a path; see `resume`."""
        own, identity, numbers = state_in(tree, path)
        if record is not None:
            own = validate(record).isel(sample=slice(0, own.sizes["sample"]))
        experiment = Experiment(own, self._rig, self._family)
        state = StreamState(own, experiment, **numbers)
        differing = differences(identity, self._identity(experiment), most=20)
        if not differing:
            with threadpool_limits(1):
                values = experiment.model.log_probability(state.points)
            if not np.allclose(values, state.values, rtol=1e-9, atol=1e-6):
                differing = "by a prior or the load cell, the log-density of the particles is another"
        if differing:
            raise InferenceError(f"{path} is of another stream: {differing}; give another file, or what was given then")
        self._state = state

    def contour_draws(self, count: int) -> Floats:
        """Return draws of the contour's parameters from the particles, shape (count, parameters of the contour).

        Raises
        ------
        InferenceError
            Before the first update.
        """
        check_whole_number("count", count, 1, most=10**7)
        state = self._known_state()
        picked = resampled(np.exp(state.log_weights), count, self._random(2, state.updates))
        return state.points[picked, : len(state.experiment.model.family.parameters)]

    def _known_state(self) -> StreamState:
        if self._state is None:
            raise InferenceError("the stream has no samples yet: call update with some first")
        return self._state

    def _identity(self, experiment: Experiment) -> dict[str, str]:
        """Return all that the numbers of a stream depend on, as text."""
        return identity_of(experiment.about) | {
            "samples": str(experiment.record.sizes["sample"]),
            "names of parameters": ", ".join(experiment.model.names),
            "particles": str(self._particles),
            "seed": whole_seed(self._seed),
            **versions_of("emcee"),
        }

    def _random(self, purpose: int, updates: int) -> np.random.Generator:
        """Return random numbers of an update: they do not depend on calls that were refused."""
        return np.random.default_rng(child(self._seed, purpose, updates))

    def _brief(self, state: StreamState) -> xr.Dataset:
        model, points, weights = state.experiment.model, state.points, np.exp(state.log_weights)
        units = [unit_of(model, name) for name in model.names]
        result = xr.Dataset(
            {
                "samples": state.record.sizes["sample"],
                "log_evidence": state.log_integral - np.log(state.share),
                "effective_number": float(effective_number(normalised(state.log_weights))),
                "correlation": state.correlation,
                "log_density_shift": state.shift,
                "log_density_rise": state.rise,
                "e_value": np.exp(np.minimum(state.surprise, _MOST_SURPRISE)),
                "parameters": (("level", "parameter"), _weighted_quantiles(points, weights)),
            },
            coords={"level": list(LEVELS), "parameter": list(model.names), "unit": ("parameter", units)},
        )
        if self._x is not None:
            heights = model.contours(points).take(np.arange(len(weights))[:, None]).height(self._x)
            result = result.assign_coords(x=self._x)
            result["height"] = (("level", "x"), _weighted_quantiles(heights, weights))
        return result


def _share_within_reach(model: ContourModel, old: StreamState | None, random: np.random.Generator) -> float:
    """Return the share of the prior within reach, which only a new sweep or parameter changes."""
    before = None if old is None else old.experiment.model
    if old is None or before is None or model.likelihood.segments.has_history or before.names != model.names:
        return model.share_within_reach(random, _PRIOR_DRAWS)
    is_same = np.array_equal(before.likelihood.segments.contacts, model.likelihood.segments.contacts)
    return old.share if is_same else model.share_within_reach(random, _PRIOR_DRAWS)


def _weighted_quantiles(values: Floats, weights: Floats) -> Floats:
    """Return quantiles of every column, shape (levels, columns); NaN where a value is."""
    found = np.quantile(values, LEVELS, axis=0, weights=weights, method="inverted_cdf")
    return np.where(np.isfinite(values).all(axis=0), found, np.nan)
