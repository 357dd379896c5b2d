"""A candidate for the next record: its drives, and its expected results."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import stats

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.densities import Proposal, effective_number
from tactile_bayes.inference.importance import weighed
from tactile_bayes.inference.record_likelihood.likelihood import events_of
from tactile_bayes.numerics.differences import central_slopes
from tactile_bayes.numerics.random_numbers import Seed, words
from tactile_bayes.planning.expected_band import band_factor, deviation_of_heights, height_slopes, mean_of_known
from tactile_bayes.planning.knowledge import COARSE, STEP, Base, Knowledge
from tactile_bayes.planning.record_information import COARSE_STEP, parameter_scales, reading_slopes, record_information
from tactile_bayes.record import CHANNELS
from tactile_bayes.sweep import Carried, Drive, Rotation
from tactile_bayes.uncertainty.quantiles import central_levels

# Degrees of freedom of the t distribution from which nested draws come, and its scale over that of Laplace's
# approximation.
_FREEDOM, _WIDENING = 8.0, 1.2


@dataclass(frozen=True)
class Candidate:
    """Drives for the next record."""

    drives: tuple[Drive, ...]

    @property
    def drive_step(self) -> float:
        """Step of the first drive, the mean one of given angles, or that of a rotation with as many samples [rad]."""
        first = self.drives[0]
        if isinstance(first, Carried):
            step = first.drive_step
            return STEP if step is None else math.radians(240.0 / max(first.by(step).size - 1, 1))
        if first.drive_angles is None:
            return first.drive_step or STEP
        angles = np.array(first.drive_angles)
        return float(np.ptp(angles)) / max(angles.size - 1, 1)

    @property
    def base(self) -> Base:
        """The pivot, or where the first drive begins [length]."""
        first = self.drives[0]
        x, y = first.poses[0, :2].tolist() if isinstance(first, Carried) else first.base
        return x, y

    @property
    def is_pivot(self) -> bool:
        """True if the rod is turned about one pivot."""
        return len(self.drives) == 1 and isinstance(self.drives[0], Rotation)

    @property
    def words(self) -> str:
        """The drives in a few words."""
        return " and ".join(map(_in_words, self.drives))


def _in_words(drive: Drive) -> str:
    if isinstance(drive, Rotation):
        alone = "" if drive.direction == "both" else f", {drive.direction} alone"
        return f"turned about ({drive.base[0]:g}, {drive.base[1]:g}){alone}"
    begin, end = drive.poses[0], drive.poses[-1]
    angles = [f"{np.degrees(angle):.3g}°" for angle in sorted({begin[2], end[2]})]
    return f"carried from ({begin[0]:g}, {begin[1]:g}) to ({end[0]:g}, {end[1]:g}) at {' to '.join(angles)}"


@dataclass(frozen=True, eq=False)
class Question:
    """The design problem: knowledge, candidates, and the band of interest."""

    known: Knowledge
    candidates: tuple[Candidate, ...]
    x: Floats  # grid points at which the band matters [length]
    probability: float  # probability of the pointwise band, in (0, 1)
    nested: int  # number of draws of each nested posterior; 0 for Laplace's approximation alone
    seed: Seed


class Expected(NamedTuple):
    """Expected results of a candidate: means over draws of the truth, each with its standard error."""

    width: tuple[float, float]  # mean width of the band [length]
    gap: tuple[float, float]  # width of the arcs that no sweep touches [length]
    information: tuple[float, float]  # gain in information [nats]
    reached: float  # share of the draws that the rod reaches
    nested_width: tuple[float, float]  # mean width of the band by nested Monte Carlo [length]
    nested_information: tuple[float, float]  # gain in information by nested Monte Carlo [nats]
    nested_draws: float  # median of the effective draws of the nested posteriors


def expected_of(task: tuple[Question, int]) -> Expected:
    """Return the expected results of one candidate, by its index.

    The information about a draw is that of the drives that touch it.
    """
    question, number = task
    candidate = question.candidates[number]
    wide = band_factor(question.probability)
    touched = np.stack([_usable(question.known, drive) for drive in candidate.drives], axis=1)
    usable: Flags = np.any(touched, axis=1, keepdims=False)
    rows: dict[str, list[float]] = {
        name: [] for name in ("width", "information", "nested_width", "nested_information", "draws")
    }
    numbers = np.asarray([*candidate.base, candidate.drive_step])
    paths = [drive.poses.ravel() for drive in candidate.drives if isinstance(drive, Carried)]
    numbers = np.concatenate([numbers, *paths])
    rng = np.random.default_rng([*words(question.seed), *numbers.view(np.uint32)])
    by_touch: dict[bytes, tuple[Question, ContourModel]] = {}
    for k, touches in enumerate(touched):
        if touches.tobytes() not in by_touch:
            drives = [drive for drive, it in zip(candidate.drives, touches, strict=True) if it or not touches.any()]
            model = question.known.model_from(drives)
            by_touch[touches.tobytes()] = replace(question, known=question.known.of(model)), model
        of_draw, model = by_touch[touches.tobytes()]
        known, point = of_draw.known, of_draw.known.points[k]
        slopes = height_slopes(model, point, question.x)
        gained = np.zeros_like(known.precision)
        if usable[k]:
            try:
                gained = record_information(model, point, slopes=reading_slopes(model, point, COARSE_STEP)).matrix
            except ReachError:
                gained = np.zeros_like(known.precision)
        precision = known.precision + gained
        rows["width"].append(wide * mean_of_known(deviation_of_heights(slopes, precision)))
        rows["information"].append(0.5 * (_logdet(precision) - _logdet(known.precision)))
        if question.nested and usable[k]:
            found = _nested(of_draw, model, point, precision, rng)
            for name, value in zip(("nested_width", "nested_information", "draws"), found, strict=True):
                rows[name].append(value)
    gaps = _gaps(question.known, candidate, usable)
    means = {name: _mean(np.array(values)) for name, values in rows.items()}
    return Expected(
        means["width"],
        _mean(gaps),
        means["information"],
        float(usable.mean()),
        means["nested_width"],
        means["nested_information"],
        float(np.median(rows["draws"])) if rows["draws"] else np.nan,
    )


def _usable(known: Knowledge, drive: Drive) -> Flags:
    """Return which draws a rod touches in a drive."""
    model = known.model_from([drive])
    points = known.of(model).points
    return model.likelihood.usable(model.contours(points), model.rig(points))


def _nested(
    question: Question, model: ContourModel, point: Floats, precision: Floats, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Return width of the band, information gained and effective draws of the posterior of one simulated record.

    The posterior is sampled by importance sampling from a t distribution about the mode of Laplace's approximation.
    """
    known = question.known
    measured = measured_of(model, point, rng)
    after = known.model(measured)
    steps = COARSE_STEP * parameter_scales(after, point)

    def densities(points: Floats) -> Floats:
        inside = after.within_bounds(points)
        values = np.full((len(points), measured.sizes["sample"]), -np.inf)
        values[inside] = after.log_likelihood(points[inside], pointwise=True)
        return values

    score = central_slopes(densities, point, steps).sum(axis=0)
    middle = known.points.mean(axis=0)
    covariance = np.linalg.inv(precision)
    centre = point + covariance @ (score + known.precision @ (middle - point))
    proposal = Proposal(centre, _WIDENING * np.asarray(np.linalg.cholesky(covariance)), freedom=_FREEDOM)
    points, density = proposal.draw(rng, question.nested)
    log_known = stats.multivariate_normal(middle, np.linalg.inv(known.precision)).logpdf(points)
    logs, evidence = weighed(densities(points).sum(axis=1) + log_known - density - proposal.constant)
    weights = np.exp(logs)
    likely = weights > 0.0
    contours = model.family.build(*points[likely, : len(model.family.parameters)].T)
    heights = np.asarray(contours.take(np.arange(contours.shape[0])[:, None]).height(question.x))
    width = mean_of_known(_band_widths(heights, weights[likely], question.probability))
    own = float(densities(point[None]).sum())
    return width, own - float(evidence), float(effective_number(weights))


def measured_of(model: ContourModel, point: Floats, rng: np.random.Generator) -> xr.Dataset:
    """Return a simulated measurement of the model's record, of one truth, shape (d,)."""
    loads = model.loads(point[None])[0]
    discrepancy = model.discrepancy_at(point)
    rod = model.likelihood.rod
    units = rod.load_units
    cell = model.likelihood.load_cell
    scale = model.noise_scale(point[None])[0]
    readings = cell.simulate(loads, rng=rng, noise_scale=scale, discrepancy=discrepancy) * units
    template = model.measured
    return template.assign({name: ("sample", readings[:, i], template[name].attrs) for i, name in enumerate(CHANNELS)})


def _band_widths(heights: Floats, weights: Floats, probability: float) -> Floats:
    """Return widths of central intervals at each grid point, from weighted draws, shape (grid points,).

    They are those of the draws that have a height there; NaN where none has.
    """
    levels = central_levels(probability)
    widths, known = np.full(heights.shape[1], np.nan), ~np.isnan(heights)
    for k in np.flatnonzero(known.any(axis=0)):
        one, its_weights = heights[known[:, k], k], weights[known[:, k]]
        lower, _, upper = np.quantile(one, levels, weights=its_weights, method="inverted_cdf")
        widths[k] = upper - lower
    return widths


def _gaps(known: Knowledge, candidate: Candidate, usable: Flags) -> Floats:
    """Return the width that no sweep touches between the outermost first contacts, for each usable draw."""
    model = known.model_from([*known.drives, *map(_coarse, candidate.drives)], COARSE)
    points = known.of(model).points[usable]
    if not len(points):
        return np.array([np.nan])
    found = events_of(model.likelihood, model.contours(points), model.rig(points), exact=False)
    ends = np.sort(np.stack([found["first_contact_x"], found["snap_off_contact_x"]], axis=-1), axis=-1)
    gaps = []
    for of_draw in ends:
        arcs = sorted(map(tuple, of_draw[np.isfinite(of_draw).all(axis=1)]))
        if not arcs:
            gaps.append(np.nan)
            continue
        reach, open_width = arcs[0][1], 0.0
        for begin, end in arcs[1:]:
            open_width += max(0.0, begin - reach)
            reach = max(reach, end)
        gaps.append(open_width)
    return np.array(gaps)


def _coarse(drive: Drive) -> Drive:
    """Return a drive without a grid of its own."""
    return replace(drive, drive_angles=None, drive_step=None) if isinstance(drive, Rotation) else drive


def _mean(values: Floats) -> tuple[float, float]:
    """Return the mean and its standard error, of what is known; NaN if unknown."""
    values = values[~np.isnan(values)]
    if not values.size:
        return np.nan, np.nan
    error = float(values.std(ddof=1) / np.sqrt(values.size)) if values.size > 1 else np.nan
    return float(values.mean()), error


def _logdet(precision: Floats) -> float:
    return float(np.linalg.slogdet(precision)[1])
