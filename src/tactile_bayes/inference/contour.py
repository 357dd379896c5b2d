"""The posterior of a contour, given a whole record."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tactile_bayes.contours import Contour
from tactile_bayes.errors import InferenceError, ParameterError, ReachError
from tactile_bayes.inference.ensembles import Draws, Progress, SamplerSettings, Seed, sample, scatter_walkers, spawn
from tactile_bayes.inference.families import Family, Prior, family_named
from tactile_bayes.inference.likelihood import FAST_ORDER, FINE_ORDER, RecordLikelihood
from tactile_bayes.inference.noise import Noise, noise_of
from tactile_bayes.inference.result import provenance, sample_stats
from tactile_bayes.inference.start import best_optimum, gather
from tactile_bayes.load_cell import LoadCell, rough_noise
from tactile_bayes.reconstruction import loaded_samples, reconstruct
from tactile_bayes.record import (
    CHANNELS,
    COLUMNS,
    frame_of,
    present_channels,
    record_hash,
    rod_of,
    validate,
    with_rod,
)
from tactile_bayes.rod import Rod

__all__ = ["contours_of", "default_priors", "infer_contour"]

Floats = NDArray[np.float64]

_KEPT_DRAWS = 250
"""Draws of each chain for which predictions and events are stored."""

_PRIOR_DRAWS = 1000

_MOST_TRIALS = 50
"""Draws from the prior for each that is wanted within reach, before fewer will do."""

_QUIET = 3e-4
"""Noise over the largest load below which the fast interpolation of loads would be felt."""


def infer_contour(
    measured: xr.Dataset,
    *,
    family: str = "parabola",
    load_cell: LoadCell | None = None,
    priors: Mapping[str, Prior] | None = None,
    seed: Seed,
    rod: Rod | None = None,
    friction: float = 0.0,
    settings: SamplerSettings | None = None,
    progress: Callable[[Progress], object] | None = None,
) -> xr.DataTree:
    """Posterior of a contour's parameters from a whole record, by independent emcee ensembles.

    Every sample counts, also the unloaded ones: a contour that would have been touched later, or let go earlier, than
    the record shows is unlikely. Contours that some sweep of the record could not reach are excluded. The walkers start
    around a robust least-squares optimum that begins at the contact points of Step 2, or at the best of many draws from
    the prior where channels are missing.

    Parameters
    ----------
    measured : xr.Dataset
        A record; SI or dimensionless, channels may be missing.
    family : str
        What shape the contour is known to have: parabola, circle, ellipse, power-law, or one for each flank, like
        "parabola/power-law", on the left and on the right of a common vertex.
    load_cell : LoadCell, optional
        The sensor, in the record's units; by default the data sheet that the record carries. Its noise is taken as
        known up to the factor `noise_scale`, which is inferred. Without any, or if it states none for all channels,
        `moment_noise` and `force_noise` are.
    priors : mapping of str to frozen scipy.stats distribution, optional
        In place of some of the default ones (see Notes), in the record's units.
    seed : int or numpy.random.SeedSequence
        The same seed, the same draws.
    rod : Rod, optional
        In place of the rod that an SI record states.
    friction : float
        Coulomb's coefficient μ, taken as known.
    settings : SamplerSettings, optional
        When to stop, and how much to spend at most.
    progress : callable, optional
        Is given a `Progress` after each look at the diagnostics.

    Returns
    -------
    xr.DataTree
        In ArviZ's layout and the record's units, a chain being an ensemble: `posterior`, `sample_stats`, `prior`,
        `posterior_predictive` and `log_likelihood` (by sample; of some of the draws), `events` (first contact and
        snap-off of each sweep, of the same draws), `observed_data`, `constant_data`. Attributes: version, seed,
        settings, hash of the data, `converged` and a `message` in words.

    Raises
    ------
    RecordError
        If `measured` is no record.
    ParameterError
        If the family is unknown, a prior does not belong to a parameter, the seed is no whole number from 0 up, or the
        load cell has noise on some channels, and none on another.
    InferenceError
        If no sample carries any load, or no contour of the family is found that the rod can reach.

    Notes
    -----
    The default priors follow from pivot and rod length L alone, never from what was measured. Vertex: within a rod
    length of the pivot sideways and in height, uniformly. Parabola's a: log-normal around 1/L, circle's r and the
    ellipse's semi-axes a (sideways) and b: log-normal around L/2, all with standard deviation 1 of the logarithm. The
    power law is (y − q)/w = (|x − x_c|/w)ⁿ, so that w is where the contour is as high as it is wide: log-normal around
    L, standard deviation 1 of the logarithm; n − 1: log-normal around 1, standard deviation 0.7 of the logarithm, n
    from 1.1 to 50. noise_scale: log-normal around 1, standard deviation 0.5 of the logarithm. Unknown noises:
    log-uniform from 1e-6 to 10, in EI/L and EI/L². Contours out of reach, and those that the rod would still cut after
    snap-off, are excluded on top.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, SamplerSettings, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, seed=1)
    >>> quick = SamplerSettings(min_ess=100, max_r_hat=1.1)
    >>> result = infer_contour(measured, family="parabola", load_cell=cell, seed=1, settings=quick)
    >>> bool(result.attrs["converged"]), list(result["posterior"].data_vars)
    (True, ['a', 'q', 'x_c', 'noise_scale'])
    """
    measured = with_rod(validate(measured), rod)
    settings = settings or SamplerSettings()
    chosen = family_named(family)
    noise = noise_of(measured, load_cell)
    chosen_priors = {**_contour_priors(measured, chosen), **noise.priors}
    for name, prior in (priors or {}).items():
        if name not in chosen_priors:
            raise ParameterError(
                f"there is no parameter {name!r} to give a prior: there are {', '.join(chosen_priors)}"
            )
        if not isinstance(prior, Prior):
            raise ParameterError(
                f"the prior of {name} is {prior!r}: give a frozen distribution, like scipy.stats.norm(0.5, 0.1)"
            )
    if not loaded_samples(measured, noise.cell if noise.names == ("noise_scale",) else None).any():
        raise InferenceError(
            "no sample carries a load that noise does not explain: was anything touched, and is the load cell's noise "
            "in the record's units?"
        )
    chosen_priors.update(priors or {})
    model = _Model(measured, chosen, noise, chosen_priors, friction)
    seeds = spawn(seed, 4)
    with threadpool_limits(1):  # the arrays are small: threads would only wait for one another
        start = model.start(seeds[0], settings)
        draws = sample(
            model.log_probability, start, names=model.names, seed=seeds[1], settings=settings, progress=progress
        )
        groups = model.groups(draws, np.random.default_rng(seeds[2]))
        groups["prior"] = model.prior_draws(np.random.default_rng(seeds[3]))
    tree = xr.DataTree.from_dict(groups)
    tree.attrs = provenance(
        draws,
        seed=seed,
        settings=settings,
        data_sha256=record_hash(measured),
        family=family,
        friction=friction,
        priors=json.dumps({name: _in_words(prior) for name, prior in chosen_priors.items()}),
        units=measured.attrs["units"],
        load_cell_frame=frame_of(measured),
        **{name: measured.attrs[name] for name in ("rod_length", "rod_flexural_rigidity", "rod_diameter")},
        approximations="; ".join(noise.cell.approximations),
        **{f"load_cell_{name}": value for name, value in noise.cell.entries().items() if name not in noise.inferred},
    )
    return tree


def default_priors(
    measured: xr.Dataset, family: str = "parabola", load_cell: LoadCell | None = None
) -> dict[str, Prior]:
    """The priors that `infer_contour` takes where it is given none, in the record's units; its notes say which.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> list(default_priors(scan(paper_profile("II", q=0.5)).record))
    ['a', 'q', 'x_c', 'moment_noise', 'force_noise']
    """
    measured = validate(measured)
    return {**_contour_priors(measured, family_named(family)), **noise_of(measured, load_cell).priors}


def contours_of(draws: xr.Dataset, family: str) -> Contour:
    """The contours of posterior or prior draws, with parameters of shape (all draws,)."""
    chosen = family_named(family)
    return chosen.build(*(draws[name].values.ravel() for name in chosen.parameters))


def _contour_priors(measured: xr.Dataset, family: Family) -> dict[str, Prior]:
    base = float(measured.base_x.mean()), float(measured.base_y.mean())
    return family.default_priors(base, rod_of(measured).length)


def _in_words(prior: Prior) -> str:
    law = getattr(prior, "dist", None)
    if law is None:
        return repr(prior)
    arguments = [f"{a:g}" for a in prior.args] + [f"{k}={v:g}" for k, v in prior.kwds.items()]  # type: ignore[attr-defined]
    return f"{law.name}({', '.join(arguments)})"


class _Model:
    """Prior times likelihood, as a function of arrays of parameters."""

    def __init__(
        self, measured: xr.Dataset, family: Family, noise: Noise, priors: Mapping[str, Prior], friction: float
    ) -> None:
        self.measured = measured
        self.family = family
        self.noise = noise
        self.priors = priors
        self.friction = friction
        self.names = (*family.parameters, *noise.names)
        bounds = [family.bounds.get(name, (-np.inf, np.inf)) for name in family.parameters]
        self.low, self.high = np.array([*bounds, *[(0.0, np.inf)] * len(noise.names)]).T
        self.likelihood = RecordLikelihood(
            measured, noise.cell, friction, is_always_clear=family.is_always_clear and not friction
        )
        self.deviation = self._rough_noise()
        largest = np.abs(self.likelihood.measured[:, self.present]).max(axis=0)
        quiet = np.any(self.deviation[self.present] < _QUIET * largest)
        self.likelihood.order = FINE_ORDER if quiet else FAST_ORDER

    @property
    def present(self) -> NDArray[np.bool_]:
        """Which channels were measured, shape (3,)."""
        return ~np.isnan(self.likelihood.measured).all(axis=0)

    def contours(self, points: Floats) -> Contour:
        return self.family.build(*points[:, : len(self.family.parameters)].T)

    def noise_scale(self, points: Floats) -> Floats:
        """Factors on the load cell's standard deviations, shape (n, 3)."""
        scale = np.ones((points.shape[0], len(CHANNELS)))
        for name, channels in zip(self.noise.names, self.noise.channels, strict=True):
            scale[:, [CHANNELS.index(c) for c in channels]] = points[:, [self.names.index(name)]]
        return scale

    def log_prior(self, points: Floats) -> Floats:
        logs = [self.priors[name].logpdf(points[:, i]) for i, name in enumerate(self.names)]
        possible = ((points > self.low) & (points < self.high)).all(axis=1)
        return np.where(possible, np.sum(logs, axis=0), -np.inf)

    def log_probability(self, points: Floats) -> Floats:
        """Up to the prior's normalisation over contours within reach; −inf outside its support or reach."""
        values = self.log_prior(points)
        inside = np.flatnonzero(np.isfinite(values))
        if inside.size:
            chosen = points[inside]
            values[inside] += self.likelihood.log_likelihood(self.contours(chosen), self.noise_scale(chosen))
        return values

    def draw_prior(self, rng: np.random.Generator, count: int) -> tuple[Floats, float]:
        """Draws within reach, fewer where they are very rare, and the share of all draws that they are."""
        found, drawn = [np.empty((0, len(self.names)))], 0
        while sum(map(len, found)) < count and drawn < _MOST_TRIALS * count:
            points = np.stack([self.priors[name].rvs(count, random_state=rng) for name in self.names], axis=1)
            drawn += count
            points = points[np.isfinite(self.log_prior(points))]
            if len(points):
                found.append(points[self.likelihood.usable(self.contours(points))])
        points = np.concatenate(found)
        if not len(points):
            raise ReachError(
                f"of {drawn} contours from the prior the rod can reach none in every sweep: are base, rod length and "
                "units right, and the priors in the record's units?"
            )
        return points[:count], len(points) / drawn

    # ---- where to start

    def start(self, seed: np.random.SeedSequence, settings: SamplerSettings) -> Floats:
        """Walkers scattered twice as wide as a normal approximation around the optimum."""
        rng = np.random.default_rng(seed)
        size = len(self.family.parameters)
        deviation, present = self.deviation, self.present
        measured = self.likelihood.measured[:, present] / deviation[present]
        candidates, _ = self.draw_prior(rng, 400)
        some_noise = candidates[0, size:]

        def residuals(points: Floats) -> Floats:
            noise = np.broadcast_to(some_noise, (len(points), some_noise.size))
            allowed = np.isfinite(self.log_prior(np.concatenate([points, noise], axis=1)))
            out = np.tile(10.0 * (np.abs(measured) + 1.0), (len(points), 1, 1))
            if allowed.any():
                predicted, _ = self.likelihood.predict(self.contours(points[allowed]))
                expected = self.likelihood.load_cell.expected(predicted)
                out[allowed] = measured - expected[..., present] / deviation[present]
            return out.reshape(len(points), -1)

        spread = np.array([float(self.priors[name].std()) for name in self.family.parameters])
        percentiles = np.quantile(candidates[:, :size], [0.16, 0.84], axis=0)
        rough = np.maximum(0.5 * np.diff(percentiles, axis=0)[0], 1e-3 * np.abs(percentiles[0]))
        spread = np.where(np.isfinite(spread), spread, rough)
        costs = np.sum(np.minimum(np.abs(residuals(candidates[:, :size])), 30.0), axis=1)
        chosen = [candidates[i, :size] for i in np.argsort(costs)[:2]]
        by_contacts = self._from_contacts()
        if by_contacts is not None:
            chosen.insert(0, by_contacts)
        optimum = best_optimum(residuals, np.array(chosen), percentiles.mean(axis=0), spread)

        noise = self._fitted_noise(optimum.residuals.reshape(measured.shape))
        possible = candidates[:, size:]
        if not np.isfinite(self.log_prior(np.append(optimum.point, noise)[None]))[0]:
            noise = possible[np.argmin(np.sum(np.log(possible / noise) ** 2, axis=1))]
        narrow = np.minimum(0.5 * spread / np.sqrt(np.diag(optimum.covariance)), 1.0)
        covariance = np.zeros((len(self.names), len(self.names)))
        covariance[:size, :size] = optimum.covariance * np.outer(narrow, narrow)
        covariance[range(size, len(self.names)), range(size, len(self.names))] = 0.5 / measured.size

        def with_logarithms(points: Floats) -> Floats:
            return np.concatenate([points[:, :size], np.exp(points[:, size:])], axis=1)

        def log_probability(points: Floats) -> Floats:
            return self.log_probability(with_logarithms(points))

        cloud = gather(log_probability, np.append(optimum.point, np.log(noise)), covariance, rng)
        try:
            return scatter_walkers(
                lambda points: np.where(self.log_probability(points) > cloud.floor, 0.0, -np.inf),
                lambda rng, count: with_logarithms(cloud.draw(rng, count)),
                parameters=len(self.names),
                seed=seed,
                settings=settings,
            )
        except InferenceError as error:
            best = ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.names, optimum.point, strict=False))
            raise InferenceError(
                f"no {self.family.name} was found that describes the record (the nearest has {best}): are units, rod, "
                "base and family right?"
            ) from error

    def _rough_noise(self) -> Floats:
        """Standard deviation of each channel from the median bend between neighbouring samples, shape (3,)."""
        measured = self.likelihood.measured
        deviation = np.ones(len(CHANNELS))
        for i in np.flatnonzero(self.present):
            level = rough_noise(measured[:, i]) if len(measured) > 2 else float(self.likelihood.load_cell.noise[i])
            deviation[i] = max(level, 1e-4 * float(np.max(np.abs(measured[:, i]))), 1e-12)
        return deviation

    def _fitted_noise(self, residuals: Floats) -> Floats:
        """Noise parameters that fit the optimum's residuals, shape (samples, present channels), outliers aside."""
        known = self.likelihood.load_cell.noise
        fitted = self.deviation[self.present] * np.maximum(1.4826 * np.median(np.abs(residuals), axis=0), 1e-3)
        measured = np.flatnonzero(self.present)
        ratio = {CHANNELS[i]: value / (known[i] or 1.0) for i, value in zip(measured, fitted, strict=True)}
        return np.array([np.median([ratio[c] for c in channels if c in ratio]) for channels in self.noise.channels])

    def _from_contacts(self) -> Floats | None:
        """The family fitted to Step 2's contact points."""
        if len(present_channels(self.measured)) < len(CHANNELS):
            return None
        contacts = reconstruct(
            self.measured,
            load_cell=self.noise.cell if self.noise.names == ("noise_scale",) else None,
            friction=self.friction,
        )
        force = np.hypot(self.measured.force_x.values, self.measured.force_y.values)
        firm = (contacts.status.values == "ok") & (force > 0.1 * force.max())
        if np.count_nonzero(firm) < 2 * len(self.family.parameters):
            return None
        length = self.likelihood.rod.length
        values = self.family.fit(contacts.contact_x.values[firm] / length, contacts.contact_y.values[firm] / length)
        point = np.array([values[name] * length**power for name, power in self.family.length_powers.items()])
        inside = [np.isfinite(self.priors[n].logpdf(v)) for n, v in zip(self.family.parameters, point, strict=True)]
        return point if all(inside) else None

    # ---- what comes out

    def groups(self, draws: Draws, rng: np.random.Generator) -> dict[str, xr.Dataset]:
        """The result's groups except the prior."""
        chains, count, _ = draws.samples.shape
        kept = np.unique(np.linspace(0, count - 1, min(count, _KEPT_DRAWS)).astype(int))
        points = draws.samples[:, kept].reshape(-1, len(self.names))
        predicted, likelihood, events = [], [], []
        for part in np.array_split(points, max(1, len(points) // 200)):
            contours, scale = self.contours(part), self.noise_scale(part)
            loads, reached = self.likelihood.predict(contours)
            predicted.append(loads)
            likelihood.append(self.likelihood.score(loads, reached, scale, pointwise=True))
            events.append(self._events(contours))
        shape = (chains, kept.size)
        coords = {"chain": np.arange(chains), "draw": kept}
        cell = self.likelihood.load_cell
        noisy = cell.simulate(np.concatenate(predicted), seed=rng, noise_scale=self.noise_scale(points))
        units = self._load_units()
        predictive, observed = {}, {}
        for i, name in enumerate(CHANNELS):
            observed[name] = self.measured[name]
            if name in present_channels(self.measured):
                values = noisy[..., i].reshape(*shape, -1) * units[i]
                predictive[name] = (("chain", "draw", "sample"), values, self.measured[name].attrs)
        return {
            "posterior": self._labelled(draws.samples, np.arange(count)),
            "sample_stats": sample_stats(draws),
            "posterior_predictive": xr.Dataset(predictive, coords=coords),
            "log_likelihood": xr.Dataset(
                {"record": (("chain", "draw", "sample"), np.concatenate(likelihood).reshape(*shape, -1))}, coords=coords
            ),
            "events": self._labelled_events(
                {name: np.concatenate([event[name] for event in events]).reshape(*shape, -1) for name in events[0]},
                coords,
            ),
            "observed_data": xr.Dataset(observed),
            "constant_data": self.measured.drop_vars(CHANNELS).drop_attrs(deep=False),
        }

    def _labelled_events(self, events: Mapping[str, Floats], coords: Mapping[str, Any]) -> xr.Dataset:
        units = self.measured.attrs["units"]
        variables = {}
        for name, values in events.items():
            column = COLUMNS[name.removeprefix("first_").removeprefix("snap_off_")]
            variables[name] = (("chain", "draw", "stroke"), values, {"units": column.unit_in(units)})
        strokes = ["backward" if stroke.backward else "forward" for stroke in self.likelihood.strokes]
        return xr.Dataset(variables, coords={**coords, "stroke": strokes})

    def prior_draws(self, rng: np.random.Generator) -> xr.Dataset:
        points, share = self.draw_prior(rng, _PRIOR_DRAWS)
        return self._labelled(points[None], np.arange(len(points))).assign_attrs(share_within_reach=share)

    def _labelled(self, samples: Floats, draw: NDArray[np.intp]) -> xr.Dataset:
        coords = {"chain": np.arange(samples.shape[0]), "draw": draw}
        return xr.Dataset(
            {
                name: (("chain", "draw"), samples[..., i], {"units": self._unit(name)})
                for i, name in enumerate(self.names)
            },
            coords=coords,
        )

    def _unit(self, name: str) -> str:
        if self.measured.attrs["units"] == "dimensionless":
            return "1"
        powers = {0: "1", 1: "m", -1: "1/m"}
        return {"moment_noise": "N m", "force_noise": "N"}.get(name) or powers[self.family.length_powers.get(name, 0)]

    def _load_units(self) -> Floats:
        rod = self.likelihood.rod
        return np.array([rod.moment_unit, rod.force_unit, rod.force_unit])

    def _events(self, contours: Contour) -> dict[str, Floats]:
        """First contact and snap-off in every stroke, in the record's units, each of shape (n, strokes)."""
        count = contours.shape[0]
        paths = self.likelihood.paths(contours, exact_events=True)
        lanes = np.arange(paths.seen.lanes)
        backward = paths.seen.mirrored
        out = {}
        for label, angle, parameter in (
            ("first", paths.first_angle, paths.first_parameter),
            ("snap_off", paths.snap_angle, paths.snap_parameter),
        ):
            locus = paths.seen.contour.take(lanes).locate(np.where(backward, -parameter, parameter))
            out[f"{label}_drive_angle"] = np.where(backward, np.pi - angle, angle)
            out[f"{label}_contact_x"], out[f"{label}_contact_y"] = locus.x, locus.y
        return {name: values.reshape(-1, count).T for name, values in out.items()}
