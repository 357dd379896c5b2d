"""The posterior of a contour as functions for samplers of other packages, and the result of their draws."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_array, check_kind, check_whole_number, refused
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.contour import refuse_beyond
from tactile_bayes.inference.contour_groups import unit_of, whole_groups
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.ensembles import Draws, SamplerSettings, settings_of
from tactile_bayes.inference.ensembles.diagnosis import Diagnosis, autocorrelation_time
from tactile_bayes.inference.experiment import ContourProblem, Experiment, contour_problem
from tactile_bayes.inference.family import Family
from tactile_bayes.inference.result import OTHER, provenance
from tactile_bayes.inference.starts.contour_start import walk_of
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.numerics.random_numbers import Rng, generator, seed_sequence, spawn
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.tasks import FieldsAlone

_REPEATS = 3  # of a measurement of time, of which the shortest counts
_LEAST, _LARGEST = 2.0**-54, 1.0 - 2.0**-53  # probabilities at which quantiles are finite


@dataclass(frozen=True, eq=False)
class Target(FieldsAlone):
    """Prior and likelihood of a contour, the rig and the noise, given a record: see `tactile_bayes.target`.

    Points are arrays of shape (..., parameters), in the order of `names` and the record's units; a density has their
    shape without the last axis, and is a number for a single point. Pools of processes may pickle a target: it travels
    as record, rig and family, from which each process builds it once. It has no gradients, since the likelihood jumps
    where a sample is before snap-off or after it.
    """

    experiment: Experiment

    def __repr__(self) -> str:
        samples = self.model.measured.sizes["sample"]
        return f"Target({self.experiment.own_family!r}, {samples} samples, names={self.names})"

    @cached_property
    def problem(self) -> ContourProblem:
        """The inference problem, with the sides of contact that the record states."""
        return contour_problem(self.experiment)

    @property
    def model(self) -> ContourModel:
        """Prior times likelihood, for points of shape (n, parameters)."""
        return self.problem.model

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters: of the contour, the rig and the noise."""
        return self.model.names

    @property
    def units(self) -> dict[str, str]:
        """Unit of each parameter, by name."""
        return {name: unit_of(self.model, name) for name in self.names}

    @property
    def bounds(self) -> Floats:
        """Return the ends of the parameters by definition and by their priors, shape (parameters, 2)."""
        return np.stack([self.model.ends.low, self.model.ends.high], axis=1)

    def log_prior(self, points: ArrayLike) -> Floats:
        """Return the natural logarithm of the prior density of points, −inf out of bounds.

        It is that of all contours: its integral over those within reach is the share of these.
        """
        return self._within(points, self.model.log_prior)

    def log_likelihood(self, points: ArrayLike) -> Floats:
        """Return the natural logarithm of the likelihood of points, −inf out of bounds and out of the rod's reach.

        It is the density of loads in EI/L and EI/L².
        """
        return self._within(points, self.model.log_likelihood)

    def log_probability(self, points: ArrayLike) -> Floats:
        """Return the natural logarithm of prior times likelihood of points, −inf where either is zero."""
        return self._within(points, self.model.log_probability)

    def prior_transform(self, cube: ArrayLike) -> Floats:
        """Return the points with given probabilities under the prior of all contours, within reach or not.

        Each parameter is a quantile of its own prior; those of a calibrated rig, which depend on one another, are
        transformed in turn, each given those before. Reach is left to the likelihood: the integral of the likelihood
        over the cube is the evidence of `compare_families`, which is that of contours within reach, times the share of
        the prior within reach, ``result["prior"].attrs["share_within_reach"]``.

        Parameters
        ----------
        cube : array_like, shape (..., parameters)
            Numbers from 0 to 1.

        Returns
        -------
        array, shape (..., parameters)
            Parameters.

        Raises
        ------
        ParameterError
            If a number is not from 0 to 1, or a prior of your own has no `ppf`.
        """
        shares = self._points("cube", cube)
        if not np.all((shares >= 0.0) & (shares <= 1.0)):
            raise refused("cube", cube, "give numbers from 0 to 1")
        return self.model.prior_quantiles(np.clip(shares, _LEAST, _LARGEST)).reshape(np.shape(cube))

    def start(self, rng: Rng, walkers: int | None = None) -> Floats:
        """Return starting points of walkers as `infer_contour` finds them, wider than the posterior.

        Parameters
        ----------
        rng : int, numpy.random.SeedSequence or numpy.random.Generator
            Random numbers; the same seed gives the same points.
        walkers : int, optional
            Number of walkers; by default that of an ensemble of `infer_contour`.

        Returns
        -------
        array, shape (walkers, parameters)
            Points of a finite log-probability.

        Raises
        ------
        InferenceError
            If nothing within reach of the rod describes the record, or what does is outside the priors.
        """
        size = len(self.names)
        count = SamplerSettings().walkers_for(size) if walkers is None else check_whole_number("walkers", walkers, 1)
        settings = SamplerSettings(ensembles=2, walkers=2 * max(size, -(-count // 2)))
        with threadpool_limits(1):
            walk = walk_of(self.model, seed_sequence(rng), settings)
        refuse_beyond(self.model, walk)
        return walk.coordinates.parameters(walk.start.reshape(-1, size))[0][:count]

    def seconds(self, points: ArrayLike) -> float:
        """Return the time that the log-probability takes for each of some points at once, measured here.

        Parameters
        ----------
        points : array_like, shape (..., parameters)
            Parameters, as from `start`: a point takes less time beside others, and away from the posterior more.

        Returns
        -------
        float
            The shortest of three measurements [s].
        """
        times = []
        for _ in range(1 + _REPEATS):  # the first one may compile
            began = time.perf_counter()
            values = self.log_probability(points)
            times.append(time.perf_counter() - began)
        return min(times[1:]) / max(np.size(values), 1)

    def _points(self, name: str, values: ArrayLike) -> Floats:
        """Return points as an array of shape (n, parameters)."""
        points = check_array(name, values)
        if points.shape[-1:] != (len(self.names),):
            raise ParameterError(
                f"{name} has shape {points.shape}: give (..., {len(self.names)}), with {', '.join(self.names)} along "
                "the last axis"
            )
        return points.reshape(-1, len(self.names))

    def _within(self, points: ArrayLike, log_density: Any) -> Floats:
        """Return a log-density of points of any leading shape, −inf out of bounds, as many at once as memory allows."""
        flat = self._points("points", points)
        values = np.full(len(flat), -np.inf)
        inside = np.flatnonzero(self.model.within_bounds(flat))
        for block in blocks(inside.size, self.model.loads_of_a_point) if inside.size else ():
            values[inside[block]] = log_density(flat[inside[block]])
        return values.reshape(np.shape(points)[:-1])[()]


def target(measured: xr.Dataset, *, family: Family | str = "parabola", rig: Rig | None = None) -> Target:
    """Return the posterior of a contour as functions of points, for any sampler.

    Parameters
    ----------
    measured : xr.Dataset
        A record, as for `infer_contour`.
    family : str or Family
        Family of the contour, with priors, as in `infer_contour`.
    rig : Rig, optional
        Rod, load cell and unknowns of the rig, as in `infer_contour`.

    Returns
    -------
    Target
        The posterior that `infer_contour` samples: `names`, `units`, `bounds`, `log_prior`, `log_likelihood`,
        `log_probability`, `prior_transform`, `start`, and `seconds` that a point takes. `result` turns draws of it
        into a result.

    Raises
    ------
    RecordError, ParameterError, InferenceError
        As in `infer_contour`; ParameterError also if the readings leave in doubt on which side of the object a sweep
        was in contact.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> rig = Rig(load_cell=LoadCell(force_noise=0.05, moment_noise=0.02), unknown="nothing")
    >>> measured = rig.load_cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> parabola = target(measured, family="parabola", rig=rig)
    >>> parabola.names
    ('a', 'q', 'x_c', 'noise_scale')
    >>> parabola.log_probability([[0.5, 0.5, 0.0, 1.0], [-0.5, 0.5, 0.0, 1.0]]).round()
    array([652., -inf])
    >>> parabola.prior_transform([0.5, 0.5, 0.5, 0.5]).round(6)
    array([1., 0., 0., 1.])
    """
    made = Target(Experiment(measured, rig_of(rig), family))
    if made.problem.others:
        raise ParameterError(
            "the side of contact of a sweep is in doubt, as its moment contradicts its direction: state the sides of "
            'all sweeps, as in record.assign_attrs(contact_sides=\'{"0": "forward", "1": "backward"}\')'
        )
    return made


def result(
    target: Target,
    draws: ArrayLike | xr.Dataset,
    *,
    rng: Rng,
    sampler: str = "not named",
    settings: SamplerSettings | None = None,
) -> xr.DataTree:
    """Return draws of another sampler as a result of `infer_contour`.

    Parameters
    ----------
    target : Target
        The posterior from which they were drawn.
    draws : array_like, shape (chains, draws, parameters), or xr.Dataset
        Draws of equal weight, without those before convergence; as a dataset, a variable for each parameter over chain
        and draw, like the group `posterior` of ArviZ. Chains should be independent runs: put all walkers of an ensemble
        into one, one walker after the other.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Random numbers of the predictions, and of draws from the prior.
    sampler : str
        Name of what drew them, for an attribute of the result.
    settings : SamplerSettings, optional
        Criteria of convergence, max_r_hat and min_ess.

    Returns
    -------
    xr.DataTree
        The groups and attributes of `infer_contour`, for `contour_band`, `gap`, `check`, `trust` and a report. In
        `sample_stats` acceptance is not known, and evaluations and seconds are those of this call.

    Raises
    ------
    ParameterError
        If draws are of another shape, or parameters are missing.
    InferenceError
        If draws are impossible under the target.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, contour_band, scan, target
    >>> from tactile_bayes.contours import paper_profile
    >>> rig = Rig(load_cell=LoadCell(force_noise=0.05, moment_noise=0.02), unknown="nothing")
    >>> measured = rig.load_cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> draws = np.random.default_rng(1).normal([0.5, 0.5, 0.0, 1.0], 1e-3, (4, 200, 4))
    >>> tree = result(target(measured, rig=rig), draws, rng=1, sampler="a guess")
    >>> tree.attrs["converged"], contour_band(tree, [0.0])["median"].values.round(2)
    (0, array([0.5]))
    """
    check_kind("target", target, Target, "give the result of tactile_bayes.target")
    settings, seed, began = settings_of(settings), seed_sequence(rng), time.monotonic()
    if not isinstance(sampler, str):
        raise refused("sampler", sampler, "give its name")
    samples = _samples(draws, target.names)
    values = target.log_probability(samples)
    if impossible := int(np.count_nonzero(~np.isfinite(values))):
        raise InferenceError(
            f"{impossible} of {values.size} draws are impossible: are they parameters in the record's units, in the "
            f"order {', '.join(target.names)}?"
        )
    walkers = samples[:, :, None]
    found = Diagnosis(walkers)
    converged = found.satisfies(settings.max_r_hat, settings.min_ess)
    message = f"{'' if converged else 'not '}converged, draws of {sampler}: {found.message(target.names)}"
    if not converged:
        message += f"; criteria: R̂ below {settings.max_r_hat:g} and an effective sample size of {settings.min_ess:.0f}"
    chains, count, _ = samples.shape
    drawn = Draws(
        samples=samples,
        log_probability=values,
        names=target.names,
        walkers=1,
        steps_kept=count,
        steps_run=count,
        r_hat=found.r_hat,
        ess_bulk=found.ess_bulk,
        ess_tail=found.ess_tail,
        acceptance=np.full(chains, np.nan),
        autocorrelation_time=autocorrelation_time(walkers),
        evaluations=values.size,
        seconds=time.monotonic() - began,
        converged=converged,
        message=message,
        stuck=int(np.count_nonzero(np.all(samples == samples[:, :1], axis=(1, 2)))),
    )
    tree = xr.DataTree.from_dict(whole_groups(target.model, drawn, generator(spawn(seed, 1)[0])))
    tree.attrs = {
        **provenance(drawn, seed=seed, settings=settings, **target.problem.about),
        "sampler": f"{OTHER}, {sampler}",
    }
    return tree


def _samples(draws: ArrayLike | xr.Dataset, names: tuple[str, ...]) -> Floats:
    """Return draws as an array of shape (chains, draws, parameters)."""
    if isinstance(draws, xr.Dataset):
        if missing := [name for name in names if name not in draws or set(draws[name].dims) != {"chain", "draw"}]:
            raise ParameterError(f"draws lack {', '.join(missing)} over chain and draw")
        draws = np.stack([draws[name].transpose("chain", "draw").values for name in names], axis=-1)
    samples = check_array("draws", draws, "give an array, or a dataset of the parameters over chain and draw")
    if samples.ndim != 3 or samples.shape[-1] != len(names) or not samples.size:
        raise ParameterError(
            f"draws have shape {samples.shape}: give (chains, draws, {len(names)}), with {', '.join(names)} along the "
            "last axis"
        )
    return samples
