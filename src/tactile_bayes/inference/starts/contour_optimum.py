"""Parameters that fit a record best, found from the record and the priors alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.coordinates import Logarithms
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.least_squares import (
    HUBER_THRESHOLD,
    STEP,
    Optimum,
    Residuals,
    descend,
    optima,
    robust_cost,
)
from tactile_bayes.inference.misfit import is_inferred
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.numerics.differences import central_slopes
from tactile_bayes.numerics.scatter import DEVIATION_OVER_MEDIAN
from tactile_bayes.reconstruction import contacts_of
from tactile_bayes.record import CHANNELS, present_channels
from tactile_bayes.rig.corrected import corrected
from tactile_bayes.rig.parameters import GROUPS

_PRIOR_DRAWS = 1000
_PRIOR_QUANTILES = 25
_STEP_OF_ADDED = 0.2  # of the differences by a parameter that is added, in prior standard deviations
_FARTHEST = 2.0  # longest step to first order, in prior standard deviations of a parameter
_SHARES = np.array([1.0, 0.5, 0.25, 0.1, 0.0])  # of that step, of which the best is taken, none of it last
_CANDIDATES = 24  # most prior draws from which searches begin, the likeliest first: from too far away they stop early
_SMOOTH_DRAWS, _SMOOTH_STARTS = 300, 6  # of the prior, and of the likeliest of them, for contours without roughness
_EVENT_TOLERANCE = 0.1  # distance outside its bracket that counts as a residual of one, over its width
_MAX_LOG_DISTANCE = 12.0  # of the log of a parameter from its prior median in a search, in prior spreads
_DECAY = 5.0  # lags after which a load that has ended is a hundredth of itself
_MISSING_EVENT_RESIDUAL = 1000.0  # residual of an event that does not occur
_MAX_RELATIVE_SD = 2.0  # of a contact normal to the contour, over the median one, for a fit
# Gain in log-likelihood beyond a prior's end that shows it to be too narrow, and the cost per residual to believe it.
_MIN_GAIN, _MAX_COST = 100.0, 5.0
_DISCREPANCY_SPREAD = 0.4  # deviation of the logs of its scale and length, before they are known
_MAX_RESIDUAL = 100.0  # largest residual in standard deviations from which a discrepancy is estimated
# Ratio of the cost to the least one below which optima are alike, and number of such from which others will be, too.
_ALIKE, _MANY_ALIKE = 1.25, 3
_MAX_COST_RATIO = 0.9  # share of the cost that a search from Step 2's contacts may leave to be taken


class ContourOptimum(NamedTuple):
    """Robust least-squares solution for all parameters."""

    point: Floats  # shape (parameters,)
    covariance: Floats  # coarse posterior covariance of the model's coordinates, shape (parameters, parameters)
    cost: float  # robust least-squares cost
    fits: bool  # True if the assumed noise explains the residuals
    beyond: str = ""  # parameters that fit the record far better beyond the ends of their priors, as text; else empty
    log_evidence: float = -np.inf  # Laplace's approximation, for the coarse noise, up to a constant of the record


class Brackets(NamedTuple):
    """Drive angles as read, in the sweep frame, between which contact begins or ends; one entry per event."""

    segment: Index  # number of the sweep segment
    ends: Index  # 0 for first contact, 1 for snap-off
    low: Floats
    high: Floats
    width: Floats  # distance outside that counts as a residual of one [rad]

    def at(self, events: Floats) -> Floats:
        """Select the bracketed events from all events, (n, segments, 2), as (n, events); NaN if one does not occur."""
        return np.asarray(events[:, self.segment, self.ends])

    def missed(self, events: Floats) -> Floats:
        """Return residuals of events, shape (n, segments, 2), relative to their brackets, shape (n, events)."""
        at = self.at(events)
        missed = np.maximum(self.low - at, 0.0) - np.maximum(at - self.high, 0.0)
        return np.nan_to_num(missed / self.width, nan=_MISSING_EVENT_RESIDUAL)


def event_brackets(model: ContourModel) -> Brackets:
    """Return the drive angles between which contact begins and ends; loads alone do not show how far events are off."""
    segments = model.likelihood.segments
    angle, of_sample = segments.angles_in_sweep_frame, segments.of_sample
    late, rows = int(min(_DECAY * model.unknowns.longest_lag(model.priors), len(angle))), []
    for onset, snap_off in zip(model.found["onset"].values, model.found["snap_off"].values, strict=True):
        for ends, (before, after) in enumerate((onset, snap_off)):
            if before < 0 or after < 0 or of_sample[before] != of_sample[after] or angle[before] >= angle[after]:
                continue  # there is no event, or the drive turns back
            width = _EVENT_TOLERANCE * (angle[after] - angle[before])
            first = max(before - late, int(np.argmax(of_sample == of_sample[before])))
            rows.append((of_sample[before], ends, min(angle[first], angle[before]), angle[after], width))
    found = {row[0] for row in rows}
    for segment, (before, first, last, after) in enumerate(segments.event_samples(model.certainly_loaded)):
        if segment not in found and before >= 0 and after >= 0:  # contact is too brief for its loads to show events
            width = _EVENT_TOLERANCE * (angle[after] - angle[before]) / 2.0
            rows += [(segment, 0, -np.inf, angle[first], width), (segment, 1, angle[last], angle[after], width)]
    columns = np.array(rows, dtype=float).reshape(-1, 5).T
    return Brackets(columns[0].astype(np.intp), columns[1].astype(np.intp), *columns[2:])


def are_alike(costs: Sequence[float], ratio: float = _ALIKE) -> bool:
    """Return True if so many optima have nearly the least cost that further searches would end there, too."""
    return sum(cost < ratio * min(costs) for cost in costs) >= _MANY_ALIKE


def optima_of(model: ContourModel, rng: np.random.Generator, deadline: Deadline = NEVER) -> Iterator[ContourOptimum]:
    """Yield optima that start from a contour fitted to Step 2's contacts, and from prior draws, the likeliest first."""
    search = _Search(model, model.draw_prior(rng, _PRIOR_DRAWS, deadline)[0], deadline)
    for found in optima(search.residuals, search.starts(), *search.limits):
        yield search.complete(search.refine(found))


def optimum_beside(
    model: ContourModel, starts: Sequence[Mapping[str, float]], deadline: Deadline = NEVER, most: int | None = None
) -> ContourOptimum:
    """Return the best of the optima from starts by name, for a contour of its family, and from Step 2's contacts; with
    a number, of the first so many that there are."""
    search = _Search(model, _prior_quantiles(model), deadline)
    tried: list[Optimum] = []
    for found in optima(search.residuals, islice(search.beside(starts), most), *search.limits):
        tried.append(found)
        if found.fits or are_alike([one.cost for one in tried]):
            break
    best = min(tried, key=lambda one: one.cost)
    return search.complete(search.refine(best) if most is None else best)


def smooth_optima(model: ContourModel, rng: np.random.Generator, deadline: Deadline = NEVER) -> list[Floats]:
    """Return the parameters of the best contours without roughness: a circle, or one with a flat side on each flank."""
    search = _Search(model, model.draw_prior(rng, _SMOOTH_DRAWS, deadline)[0], deadline)
    return [search.complete(found).point for found in search.smooth()]


def cost_of_residuals(model: ContourModel, start: Mapping[str, float]) -> float:
    """Return the robust cost of a record's residuals at parameters by name."""
    search = _Search(model, _prior_quantiles(model), NEVER)
    coordinates = search.coordinates.of(search.named(start)[None])
    return float(robust_cost(search.residuals(coordinates))[0])


class FirstOrder(NamedTuple):
    """What a parameter that is added explains of a record, to first order, all others fitted again."""

    log_evidence: float  # above that without the parameter, for the coarse noise
    start: dict[str, float]  # parameters after the best part of the step, by name
    moved: dict[str, float] | None  # if that is none of it, those after the best of the others: an edge may be near


def first_order(model: ContourModel, start: Mapping[str, float], added: Sequence[Sequence[str]]) -> list[FirstOrder]:
    """Return what each group of added parameters explains beside a start, the optimum of the model without them. It is
    ½ (sᵀ S⁻¹ s − log det S), Laplace's approximation, of the score s of a group and its information S, less what the
    others explain, both in prior standard deviations (Rao's score test, and its price)."""
    search, names = _Search(model, _prior_quantiles(model), NEVER), model.forward_parameters
    place = search.coordinates.of(search.named(start)[None])[0] / search.spread
    residuals, loose = search.residuals((place * search.spread)[None])[0], set().union(*added)

    def slopes_over(step: float) -> Floats:
        steps = np.where([name in loose for name in names], step, STEP)
        return central_slopes(lambda points: search.residuals(points * search.spread), place, steps)

    slopes = slopes_over(STEP)
    for i in [i for i, name in enumerate(names) if name in loose and is_inferred("lag", [name])]:
        there = place + np.eye(place.size)[i]  # the derivative by a lag vanishes where it does
        slopes[:, i] = search.residuals((there * search.spread)[None])[0] - residuals
    # Where a parameter is as stated, another solution of the rod may take over, a little off, as if all loads jumped.
    if not (moving := slopes.any(axis=0)).all():
        slopes = np.where(moving, slopes, slopes_over(_STEP_OF_ADDED))
    weight = 1.0 / np.sqrt(1.0 + np.square(residuals / HUBER_THRESHOLD))
    precision = (slopes.T * weight) @ slopes + np.eye(place.size)
    score = -(slopes.T * weight) @ residuals - (place - search.middle / search.spread)
    own = [i for i, name in enumerate(names) if name not in loose]
    at_zero, found = model.may_vanish[: len(names)] & (place <= 0.0), []
    for group in added:
        which = [names.index(name) for name in group]
        while True:
            both = own + which
            step = np.linalg.solve(precision[np.ix_(both, both)], score[both])
            wrong = [i for i, move in zip(which, step[len(own) :], strict=True) if at_zero[i] and move < 0.0]
            if not wrong:
                break
            which = [i for i in which if i not in wrong]
        alone = np.linalg.solve(precision[np.ix_(own, own)], score[own])
        gain = 0.5 * (score[both] @ step - score[own] @ alone)
        of_both, of_own = (np.linalg.slogdet(precision[np.ix_(some, some)]).logabsdet for some in (both, own))
        moved = np.tile(place, (_SHARES.size, 1))
        moved[:, both] += _SHARES[:, None] * np.clip(step, -_FARTHEST, _FARTHEST)
        costs, points = search.costs(moved * search.spread), search.points(moved * search.spread).tolist()
        best, other = (dict(zip(names, points[np.argmin(some)], strict=True)) for some in (costs, costs[:-1]))
        found.append(FirstOrder(float(gain - 0.5 * (of_both - of_own)), best, other if best != other else None))
    return found


def _prior_quantiles(model: ContourModel) -> Floats:
    """Return quantiles of the priors, each parameter's by itself, in place of draws, (quantiles, d)."""
    shares = np.linspace(0.02, 0.98, _PRIOR_QUANTILES)
    return model.prior_quantiles(np.tile(shares[:, None], len(model.names)))


class _Search:
    """Least squares over the forward-model parameters, positive ones by their logarithms; noise from residuals."""

    def __init__(self, model: ContourModel, candidates: Floats, deadline: Deadline) -> None:
        self.model = model
        self.deadline = deadline
        size = len(model.forward_parameters)
        self.coordinates = Logarithms(model.coordinates.positive[:size])
        self.deviation = model.deviations[:, model.present]
        self.measured = model.likelihood.measured[:, model.present] / self.deviation
        bias = np.array(model.likelihood.load_cell.bias_uncertainty)[model.present] / self.deviation
        size_of_bias = np.linalg.norm(bias, axis=0)
        self.bias = bias / np.where(size_of_bias > 0.0, size_of_bias, 1.0)
        self.of_bias = 1.0 - 1.0 / np.hypot(1.0, size_of_bias)
        self.brackets = event_brackets(model)
        self.candidates = candidates.copy()
        for name, zero in _zeros(model).items():
            self.candidates[:, model.names.index(name)] = zero
        self.usual = np.median(self.candidates[:, :size], axis=0)
        self.drawn = self.coordinates.of(self.candidates[:, :size])
        percentiles = np.quantile(self.drawn, [0.16, 0.84], axis=0)
        coarse = np.maximum(0.5 * np.diff(percentiles, axis=0)[0], 1e-3 * np.abs(percentiles[0]))
        stated = np.array([float(model.priors[name].std()) for name in model.forward_parameters])
        self.middle = percentiles.mean(axis=0)
        self.spread = np.where(np.isfinite(stated) & ~self.coordinates.positive, stated, coarse)
        ends = model.walked_ends
        self.limits = self.middle, self.spread, ends.low[:size], ends.high[:size], deadline

    def points(self, coordinates: Floats) -> Floats:
        """Return the forward-model parameters at coordinates, both of shape (n, parameters)."""
        return self.coordinates.parameters(coordinates)[0]

    def named(self, start: Mapping[str, float]) -> Floats:
        """Return the parameters of a start by name, medians for those that it does not name."""
        pairs = zip(self.model.forward_parameters, self.usual.tolist(), strict=True)
        return np.array([start.get(name, value) for name, value in pairs])

    def residuals(self, coordinates: Floats) -> Floats:
        """Return residuals of loads and events in deviations, (n, loads + events), beyond the ends of priors, too. A
        bias that the likelihood integrates out is whitened with the noise."""
        model, points, size = self.model, self.points(coordinates), self.middle.size
        least = np.where(model.may_vanish, -model.high, model.low)[:size]
        allowed = ((points > least) & (points < model.high[:size])).all(axis=1)
        far = np.abs(coordinates - self.middle) >= _MAX_LOG_DISTANCE * self.spread
        allowed &= ~far[:, self.coordinates.positive].any(axis=1)
        out = np.tile(10.0 * (np.abs(self.measured) + 1.0), (len(points), 1, 1))
        late = np.full((len(points), self.brackets.low.size), _MISSING_EVENT_RESIDUAL)
        if allowed.any():
            loads, events = _continued(model, points[allowed])
            expected = model.likelihood.load_cell.cut(model.likelihood.load_cell.expected(loads))
            # Zero loads are often closer to measured ones than wrong loads: without contact, residuals are constant.
            happens = ~np.isnan(self.brackets.at(events)).any(axis=1)
            missed = self.measured - expected[happens][..., model.present] / self.deviation
            if self.of_bias.any():
                missed -= self.of_bias * self.bias * np.sum(self.bias * missed, axis=1, keepdims=True)
            out[np.flatnonzero(allowed)[happens]] = missed
            late[allowed] = self.brackets.missed(events)
        return np.concatenate([out.reshape(len(points), -1), late], axis=1)

    def costs(self, coordinates: Floats) -> Floats:
        """Return the robust costs of residuals and priors, (n,)."""
        of_prior = np.square((coordinates - self.middle) / self.spread).sum(axis=1)
        return robust_cost(self.residuals(coordinates)) + 0.5 * of_prior

    def beside(self, starts: Sequence[Mapping[str, float]]) -> Iterator[Floats]:
        """Yield coordinates of starts, where medians stand for what they do not name, and of the contour fitted to Step
        2's contacts, with the rig's medians and without."""
        of_contour = [start for start in starts if set(self.model.family.parameters) <= set(start)]
        yield from (self.coordinates.of(self.named(start)) for start in of_contour)
        rig = dict(zip(self.model.forward_parameters, self.usual.tolist(), strict=True))
        contacts = [fitted for fitted in (self._at_contacts(), self._at_contacts(rig)) if fitted is not None]
        yield from contacts
        if not (of_contour or contacts):
            yield from (self.coordinates.of(self.named(start)) for start in starts)

    def starts(self) -> Iterator[Floats]:
        """Yield coordinates at which searches begin; prior draws are first moved until events are in their brackets."""
        fitted = self._at_contacts()
        if fitted is not None:
            yield fitted
        yield from islice(self._likeliest(self.residuals, self.drawn, self.middle, self.spread), _CANDIDATES)

    def _likeliest(self, residuals: Residuals, drawn: Floats, middle: Floats, spread: Floats) -> Iterator[Floats]:
        """Yield drawn coordinates, the likeliest first, each moved until events are in their brackets."""
        parts = [drawn[block] for block in blocks(len(drawn), self.measured.size)]
        costs = np.concatenate([np.sum(np.minimum(np.abs(residuals(part)), 30.0), axis=1) for part in parts])

        def missed(coordinates: Floats) -> Floats:
            return residuals(coordinates)[:, self.measured.size :]

        for place in drawn[np.argsort(costs)]:
            if self.brackets.low.size and not self.deadline.has_passed:
                yield descend(missed, place, middle, spread, deadline=self.deadline).point
            else:
                yield place

    def smooth(self) -> Iterator[Optimum]:
        """Yield the best contours without roughness, as the loads have them with the usual rig, for each flank on which
        a flat side may be."""
        family, names = self.model.family, self.model.forward_parameters
        free = [i for i, name in enumerate(names) if name in family.parameters and name not in family.roughness]
        usual = self.coordinates.of(self.usual)
        usual[[i for i, name in enumerate(names) if name.startswith("z_")]] = 0.0

        def whole(some: Floats) -> Floats:
            every = np.tile(usual, (len(some), 1))
            every[:, free] = some
            return every

        def residuals(some: Floats) -> Floats:
            return self.residuals(whole(some))

        middle, spread, low, high = (limit[free] for limit in self.limits[:4])
        covariance = np.diag(np.square(self.spread))
        flank = np.sign(self.drawn[:, names.index("flat_slope")]) if "flat_slope" in names else np.ones(len(self.drawn))
        for side in (sides := np.unique(flank)):
            drawn = self.drawn[flank == side]
            places = islice(self._likeliest(residuals, drawn[:, free], middle, spread), _SMOOTH_STARTS // len(sides))
            found = optima(residuals, places, middle, spread, low, high, self.deadline)
            best = min(found, key=lambda one: one.cost)
            yield Optimum(whole(best.point[None])[0], covariance, best.residuals, best.cost)
            if self.deadline.has_passed:
                break

    def _at_contacts(self, found: Mapping[str, float] | None = None) -> Floats | None:
        """Return coordinates of the contour of `contact_fit`, with the usual rig."""
        fitted = contact_fit(self.model, found)
        return None if fitted is None else self.coordinates.of(np.append(fitted, self.usual[fitted.size :]))

    def refine(self, found: Optimum) -> Optimum:
        """Return an optimum refined by searches from contacts of Step 2 with its rig, which often converges first."""
        while not found.fits and not self.deadline.has_passed:
            point = self.points(found.point[None])[0]
            point = np.where(self.model.may_vanish[: point.size], np.maximum(point, 0.0), point)
            fitted = contact_fit(self.model, dict(zip(self.model.forward_parameters, point.tolist(), strict=True)))
            if fitted is None:
                break
            place = self.coordinates.of(np.append(fitted, point[fitted.size :]))
            again = next(optima(self.residuals, [place], *self.limits))
            if again.cost > _MAX_COST_RATIO * found.cost:
                break
            found = again
        return found

    def complete(self, found: Optimum) -> ContourOptimum:
        """Return the optimum with the noise parameters and the covariance of all parameters."""
        model, size = self.model, self.middle.size
        point = self.points(found.point[None])[0]
        residuals = found.residuals[: self.measured.size].reshape(self.measured.shape)
        drawn = self.candidates[:, len(model.names) - len(model.noise.of_discrepancy) :]
        noise = np.append(fitted_noise(model, residuals), _fitted_discrepancy(model, point, residuals, drawn))
        if not np.isfinite(model.log_prior(np.append(point, noise)[None]))[0]:
            possible = self.candidates[:, size:]
            noise = possible[np.argmin(np.sum(np.log(possible / noise) ** 2, axis=1))]
        narrow = np.minimum(0.5 * self.spread / np.sqrt(np.diag(found.covariance)), 1.0)
        variances = np.full(len(model.names), 0.5 / self.measured.size)
        variances[len(model.names) - len(model.noise.of_discrepancy) :] = _DISCREPANCY_SPREAD**2
        covariance = np.diag(variances)
        covariance[:size, :size] = found.covariance * np.outer(narrow, narrow)
        sizes = np.linalg.slogdet(found.covariance).logabsdet - 2.0 * np.log(self.spread).sum()
        log_evidence = float(0.5 * sizes - found.cost)
        whole = np.append(point, noise)
        return ContourOptimum(whole, covariance, found.cost, found.fits, self._beyond(found), log_evidence)

    def _beyond(self, found: Optimum) -> str:
        """Return the parameters that fit the record far better beyond the ends of their priors, as text."""
        explained = found.cost - found.excess < _MAX_COST * found.residuals.size
        if found.beyond is None or found.excess <= _MIN_GAIN or not explained:
            return ""
        favoured, ends, names = self.points(found.beyond[None])[0], self.model.ends, self.model.forward_parameters
        low, high = ends.low[: favoured.size], ends.high[: favoured.size]
        widens = ~(self.model.may_vanish[: favoured.size] & (low <= 0.0))  # negative friction is no matter of a prior
        off = np.flatnonzero((favoured <= low) & widens | (favoured >= high))
        return ", ".join(f"{names[i]} = {favoured[i]:.6g} (prior: {low[i]:.6g} to {high[i]:.6g})" for i in off)


def _continued(model: ContourModel, points: Floats) -> tuple[Floats, Floats]:
    """Return loads and events, continued antisymmetrically to negative values of parameters that may vanish."""
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
    """Return the white noise that fits residuals, (samples, present channels); beside a discrepancy that of scatter."""
    known = model.likelihood.load_cell.noise
    sizes = np.maximum(DEVIATION_OVER_MEDIAN * np.median(np.abs(residuals), axis=0), 1e-3)
    fitted = model.deviation[model.present] * (1.0 if model.noise.of_discrepancy else sizes)
    measured = np.flatnonzero(model.present)
    ratio = {CHANNELS[i]: value / (known[i] or 1.0) for i, value in zip(measured, fitted, strict=True)}
    return np.array([np.median([ratio[c] for c in channels if c in ratio]) for channels in model.noise.channels])


def _fitted_discrepancy(model: ContourModel, point: Floats, residuals: Floats, drawn: Floats) -> Floats:
    """Return the discrepancy that fits residuals as in `fitted_noise`, from prior draws (n, 2); empty without one."""
    if not model.noise.of_discrepancy:
        return np.empty(0)
    largest = model.largest_in_contact(point)[:, model.present]
    squares = np.square(np.clip(residuals, -_MAX_RESIDUAL, _MAX_RESIDUAL) * model.deviations[:, model.present])
    least, most = np.quantile(drawn[:, 0], [0.05, 1.0])
    share = np.sqrt(squares[largest > 0.0].sum() / max(np.square(largest).sum(), np.finfo(float).tiny))
    return np.array([np.clip(share, least, most), np.median(drawn[:, 1])])


def contact_fit(model: ContourModel, found: Mapping[str, float] | None = None) -> Floats | None:
    """Return the contour parameters fitted to Step 2's contacts with a rig; None if few are usable, or it is far off.
    The rig's default has the zeros of the unloaded samples."""
    if len(present_channels(model.measured)) < len(CHANNELS):
        return None
    rod = model.likelihood.rod
    moment, *forces = model.deviation * rod.load_units
    cell = replace(model.noise.cell, moment_noise=float(moment), force_noise=float(max(forces)))
    try:
        rig = {**model.unknowns.known, **(_zeros(model) if found is None else found)}
        contacts = contacts_of(corrected(model.measured, cell, rig), "constrained" if cell.has_variances else "raw")
    except (ParameterError, RecordError):
        return None
    usable = contacts.status.values == "ok"
    if usable.any():
        usable &= contacts.normal_sd.values <= _MAX_RELATIVE_SD * np.median(contacts.normal_sd.values[usable])
    size = len(model.family.parameters) - len(model.family.roughness)
    if np.count_nonzero(usable) < 2 * size:
        return None
    length = rod.length
    values = model.family.fit(contacts.contact_x.values[usable] / length, contacts.contact_y.values[usable] / length)
    point = np.array([values[name] * length**power for name, power in model.family.length_powers.items()])
    inside = [np.isfinite(model.priors[n].logpdf(v)) for n, v in zip(model.family.parameters, point, strict=True)]
    return point if all(inside) else None


def _zeros(model: ContourModel) -> dict[str, float]:
    """Return inferred biases as estimated from the unloaded samples, by name; none beside play, which hides them."""
    if model.left_by_play.any():
        return {}
    names, stated = model.unknowns.names, model.noise.cell.bias
    units = [model.unknowns.units.get(name, np.nan) for name in GROUPS["bias"]]
    shown = zip(GROUPS["bias"], model.zero * np.array(units) - np.array(stated), strict=True)
    return {name: float(zero) for name, zero in shown if name in names and np.isfinite(zero)}
