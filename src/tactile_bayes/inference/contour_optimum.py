"""Where a contour and all else that is not known fit a record best, sought without help."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles import Logarithms
from tactile_bayes.inference.found_rig import rig_with
from tactile_bayes.inference.nuisances import BIASES
from tactile_bayes.inference.start import Optimum, descend, optima
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.record import CHANNELS, present_channels

__all__ = ["ContourOptimum", "contact_fit", "fitted_noise", "optima_of", "optimum_of"]

_PRIOR_DRAWS = 1000
_CANDIDATES = 24
"""Draws from the prior from which the optimum is sought at most, the likeliest first. A sample at an event that is
loaded or not holds the search up where it began too far away."""

_SHARP = 0.1
"""Of the angle between the samples beside an event: how far it may be outside for a residual of one."""

_LOUD = 1e-7
"""Probability that noise makes a sample look loaded by itself."""

_FARTHEST = 12.0
"""Standard deviations of the prior's logarithm that a size may be off on the way to where it is sought."""

_FAR_OFF = 1000.0
"""Residual of an event that does not happen."""

_FIRM = 2.0
"""Standard deviation of a contact across the contour, over the median one, up to which a contour is fitted to it."""

_FAR_BETTER, _NEARLY = 100.0, 5.0
"""Log-likelihood, roughly, by which a record is explained better beyond the end of a prior for that to be a mistake;
and cost per residual there, for what is not nearly explained is where a search got lost."""


_CLEARLY = 0.9
"""Share of its cost that a search from Step 2's contacts may leave, to be gone on with."""


class ContourOptimum(NamedTuple):
    """Parameters that explain a record, by robust least squares."""

    point: Floats
    """All of the model's."""
    covariance: Floats
    """Roughly that of the model's coordinates in the posterior."""
    cost: float
    """Of robust least squares."""
    fits: bool
    """Whether noise as it was guessed explains the record."""
    beyond: str = ""
    """What the record wants and the priors do not allow, where that explains it far better; in words."""


class Brackets(NamedTuple):
    """Drive angles between which contact begins or ends, as read and as seen in forward sweeps, a row an event."""

    stroke: NDArray[np.intp]
    ends: NDArray[np.intp]
    """0 for first contact, 1 for snap-off."""
    low: Floats
    high: Floats
    width: Floats
    """In which a residual grows by one."""

    def at(self, events: Floats) -> Floats:
        """Of events, shape (n, strokes, 2), those that have to happen, shape (n, events); NaN where one does not."""
        return np.asarray(events[:, self.stroke, self.ends])

    def missed(self, events: Floats) -> Floats:
        """By how much events, shape (n, strokes, 2), are outside, in widths, shape (n, events)."""
        at = self.at(events)
        missed = np.maximum(self.low - at, 0.0) - np.maximum(at - self.high, 0.0)
        return np.nan_to_num(missed / self.width, nan=_FAR_OFF)


def event_brackets(model: ContourModel) -> Brackets:
    """Between which samples contact begins and ends, by the loads alone.

    Loads say nothing of where a rod lets go until a sample is on the other side: what is missed here leads there.
    """
    angle = model.likelihood.angles_in_sweep_frame
    of_sample = model.likelihood.segment_of_sample
    rows = []
    for onset, snap_off in zip(model.found["onset"].values, model.found["snap_off"].values, strict=True):
        for ends, (before, after) in enumerate((onset, snap_off)):
            if before < 0 or after < 0 or of_sample[before] != of_sample[after] or angle[before] >= angle[after]:
                continue  # there is none, or the drive turns back
            rows.append((of_sample[before], ends, angle[before], angle[after], _SHARP * (angle[after] - angle[before])))
    found = {row[0] for row in rows}
    for stroke, (before, first, last, after) in enumerate(model.likelihood.event_samples(_loud(model))):
        if stroke not in found and before >= 0 and after >= 0:  # contact so brief that loads before it tell nothing
            step = _SHARP * (angle[after] - angle[before]) / 2.0
            rows += [(stroke, 0, -np.inf, angle[first], step), (stroke, 1, angle[last], angle[after], step)]
    columns = np.array(rows, dtype=float).reshape(-1, 5).T
    return Brackets(columns[0].astype(np.intp), columns[1].astype(np.intp), *columns[2:])


def _loud(model: ContourModel) -> NDArray[np.bool_]:
    """Samples whose load no noise explains, each for itself."""
    measured, present = model.likelihood.measured[:, model.present], model.present
    zero = np.where(np.isfinite(model.zero[present]), model.zero[present], np.median(measured, axis=0))
    surprise = np.square((measured - zero) / model.deviation[present]).sum(axis=1)
    return np.asarray(surprise > chdtri(np.count_nonzero(present), _LOUD))


def optimum_of(model: ContourModel, rng: np.random.Generator, deadline: Deadline = NEVER) -> ContourOptimum:
    """The best of `optima_of`, or the first that explains the record.

    Raises
    ------
    InferenceError
        If there is none.
    """
    best: ContourOptimum | None = None
    for found in optima_of(model, rng, deadline):
        if best is None or found.cost < best.cost:
            best = found
        if best.fits:
            break
    if best is None:
        raise InferenceError("no contour was found that the rod can reach: are base, rod and units right?")
    return best


def optima_of(model: ContourModel, rng: np.random.Generator, deadline: Deadline = NEVER) -> Iterator[ContourOptimum]:
    """Return where searches end that begin at Step 2's contacts and at draws from the prior, the likeliest first."""
    search = _Search(model, rng, deadline)
    for found in optima(search.residuals, search.starts(), *search.limits):
        yield search.judged(search.gone_on(found))


class _Search:
    """Least squares over the contour and the rig, in logarithms of sizes; the noise follows from what is left."""

    def __init__(self, model: ContourModel, rng: np.random.Generator, deadline: Deadline) -> None:
        self.model = model
        self.deadline = deadline
        size = len(model.forward_parameters)
        self.located = Logarithms(model.coordinates.positive[:size])
        self.deviation = model.deviation[model.present]
        self.measured = model.likelihood.measured[:, model.present] / self.deviation
        self.brackets = event_brackets(model)
        self.candidates, _ = model.draw_prior(rng, _PRIOR_DRAWS, deadline)
        for name, zero in _zeros(model).items():
            self.candidates[:, model.names.index(name)] = zero
        self.drawn = self.located.of(self.candidates[:, :size])
        percentiles = np.quantile(self.drawn, [0.16, 0.84], axis=0)
        rough = np.maximum(0.5 * np.diff(percentiles, axis=0)[0], 1e-3 * np.abs(percentiles[0]))
        stated = np.array([float(model.priors[name].std()) for name in model.forward_parameters])
        self.middle = percentiles.mean(axis=0)
        self.spread = np.where(np.isfinite(stated) & ~self.located.positive, stated, rough)
        walked = model.walked_ends
        self.limits = self.middle, self.spread, walked.low[:size], walked.high[:size], deadline

    def points(self, places: Floats) -> Floats:
        """Parameters of contour and rig, shape (n, parameters), from where they are sought."""
        return self.located.parameters(places)[0]

    def residuals(self, places: Floats) -> Floats:
        """Loads and events that are missed, in standard deviations, shape (n, loads + events).

        A prior that ends somewhere is no wall: the way to where it does not may lead through there.
        """
        model, points, size = self.model, self.points(places), self.middle.size
        least = np.where(model.may_vanish, -model.high, model.low)[:size]
        allowed = ((points > least) & (points < model.high[:size])).all(axis=1)
        far = np.abs(places - self.middle) >= _FARTHEST * self.spread
        allowed &= ~far[:, self.located.positive].any(axis=1)
        out = np.tile(10.0 * (np.abs(self.measured) + 1.0), (len(points), 1, 1))
        late = np.full((len(points), self.brackets.low.size), _FAR_OFF)
        if allowed.any():
            loads, events = _continued(model, points[allowed])
            expected = model.likelihood.load_cell.expected(loads)
            # Where loads are large, to have none would often be nearer than to have others: it leads nowhere.
            happens = ~np.isnan(self.brackets.at(events)).any(axis=1)
            missed = self.measured - expected[happens][..., model.present] / self.deviation
            out[np.flatnonzero(allowed)[happens]] = missed
            late[allowed] = self.brackets.missed(events)
        return np.concatenate([out.reshape(len(points), -1), late], axis=1)

    def events_missed(self, places: Floats) -> Floats:
        """The events' part of the residuals."""
        return self.residuals(places)[:, self.measured.size :]

    def starts(self) -> Iterator[Floats]:
        """Places where searches begin; at draws from the prior, moved to where events are as they are to be."""
        by_contacts = contact_fit(self.model)
        if by_contacts is not None:
            rig = np.median(self.candidates[:, by_contacts.size : self.middle.size], axis=0)
            yield self.located.of(np.append(by_contacts, rig))
        parts = [self.drawn[block] for block in blocks(len(self.drawn), self.measured.size)]
        costs = np.concatenate([np.sum(np.minimum(np.abs(self.residuals(part)), 30.0), axis=1) for part in parts])
        for place in self.drawn[np.argsort(costs)[:_CANDIDATES]]:
            if self.brackets.low.size and not self.deadline.has_passed:
                yield descend(self.events_missed, place, self.middle, self.spread, deadline=self.deadline).point
            else:
                yield place

    def gone_on(self, found: Optimum) -> Optimum:
        """An optimum, or, as long as it does not explain the record, what a search from Step 2's contacts leads to.

        The rig is often found long before a contour that is far away; with that rig Step 2 says where the contour is.
        """
        while not found.fits and not self.deadline.has_passed:
            point = self.points(found.point[None])[0]
            point = np.where(self.model.may_vanish[: point.size], np.maximum(point, 0.0), point)
            by_contacts = contact_fit(self.model, dict(zip(self.model.forward_parameters, point.tolist(), strict=True)))
            if by_contacts is None:
                break
            place = self.located.of(np.append(by_contacts, point[by_contacts.size :]))
            again = next(optima(self.residuals, [place], *self.limits))
            if again.cost > _CLEARLY * found.cost:
                break
            found = again
        return found

    def judged(self, found: Optimum) -> ContourOptimum:
        """All parameters at an optimum, how uncertain they are, and whether the record wants others."""
        model, size = self.model, self.middle.size
        point = self.points(found.point[None])[0]
        noise = fitted_noise(model, found.residuals[: self.measured.size].reshape(self.measured.shape))
        if not np.isfinite(model.log_prior(np.append(point, noise)[None]))[0]:
            possible = self.candidates[:, size:]
            noise = possible[np.argmin(np.sum(np.log(possible / noise) ** 2, axis=1))]
        narrow = np.minimum(0.5 * self.spread / np.sqrt(np.diag(found.covariance)), 1.0)
        covariance = np.diag(np.full(len(model.names), 0.5 / self.measured.size))
        covariance[:size, :size] = found.covariance * np.outer(narrow, narrow)
        return ContourOptimum(np.append(point, noise), covariance, found.cost, found.fits, self._beyond(found))

    def _beyond(self, found: Optimum) -> str:
        """What the record wants and the priors do not allow, in words, where that explains it far better."""
        explained = found.cost - found.excess < _NEARLY * found.residuals.size
        if found.beyond is None or found.excess <= _FAR_BETTER or not explained:
            return ""
        wanted, ends = self.points(found.beyond[None])[0], self.model.ends
        low, high = ends.low[: wanted.size], ends.high[: wanted.size]
        off = np.flatnonzero((wanted <= low) | (wanted >= high))
        return ", ".join(
            f"{self.model.forward_parameters[i]} = {wanted[i]:.6g} (prior: {low[i]:.6g} to {high[i]:.6g})" for i in off
        )


def _continued(model: ContourModel, points: Floats) -> tuple[Floats, Floats]:
    """Loads and events, continued evenly to less than zero of what may vanish: where the record would have less than
    none, a search that ran into a wall would not get on along it.
    """
    vanishing = np.flatnonzero(model.may_vanish)
    below = (points[:, vanishing] < 0.0).any(axis=1)
    if not below.any():
        return model.loads_and_events(points)
    none, mirrored = points.copy(), points[below]
    none[:, vanishing] = np.maximum(none[:, vanishing], 0.0)
    mirrored[:, vanishing] = np.abs(mirrored[:, vanishing])
    found = model.loads_and_events(none)
    for values, there in zip(found, model.loads_and_events(mirrored), strict=True):
        values[below] = 2.0 * values[below] - there
    return found


def fitted_noise(model: ContourModel, residuals: Floats) -> Floats:
    """Noise parameters that fit the optimum's residuals, shape (samples, present channels), outliers aside."""
    known = model.likelihood.load_cell.noise
    fitted = model.deviation[model.present] * np.maximum(1.4826 * np.median(np.abs(residuals), axis=0), 1e-3)
    measured = np.flatnonzero(model.present)
    ratio = {CHANNELS[i]: value / (known[i] or 1.0) for i, value in zip(measured, fitted, strict=True)}
    return np.array([np.median([ratio[c] for c in channels if c in ratio]) for channels in model.noise.channels])


def contact_fit(model: ContourModel, found: Mapping[str, float] | None = None) -> Floats | None:
    """The family fitted to Step 2's contact points, with the rig that was found, or with zeros as they show."""
    if len(present_channels(model.measured)) < len(CHANNELS):
        return None
    rod = model.likelihood.rod
    moment, *forces = model.deviation * np.array([rod.moment_unit, rod.force_unit, rod.force_unit])
    cell = replace(model.noise.cell, moment_noise=float(moment), force_noise=float(max(forces)))
    rig = rig_with(model.measured, cell, _zeros(model) if found is None else found, model.nuisances.friction)
    contacts = rig.contacts()
    firm = contacts.status.values == "ok"
    if firm.any():
        firm &= contacts.normal_sd.values <= _FIRM * np.median(contacts.normal_sd.values[firm])
    said = len(model.family.parameters) - len(model.family.roughness)
    if np.count_nonzero(firm) < 2 * said:
        return None
    length = rod.length
    values = model.family.fit(contacts.contact_x.values[firm] / length, contacts.contact_y.values[firm] / length)
    point = np.array([values[name] * length**power for name, power in model.family.length_powers.items()])
    inside = [np.isfinite(model.priors[n].logpdf(v)) for n, v in zip(model.family.parameters, point, strict=True)]
    return point if all(inside) else None


def _zeros(model: ContourModel) -> dict[str, float]:
    """Biases that are inferred as unloaded samples show them, by name."""
    names, stated = model.nuisances.names, model.noise.cell.bias
    units = [model.nuisances.units.get(name, np.nan) for name in BIASES]
    shown = zip(BIASES, model.zero * np.array(units) - np.array(stated), strict=True)
    return {name: float(zero) for name, zero in shown if name in names and np.isfinite(zero)}
