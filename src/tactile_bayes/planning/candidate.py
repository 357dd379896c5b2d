"""A candidate for the next record: its drives, and its expected results."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import stats

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.densities import Proposal, effective_number, weighed
from tactile_bayes.inference.record_likelihood.likelihood import events_of
from tactile_bayes.numerics.differences import central_slopes
from tactile_bayes.numerics.random_numbers import Seed, words
from tactile_bayes.planning.expected_band import (
    band_factor,
    deviation_of_heights,
    height_slopes,
    joined_arcs,
    mean_of_known,
)
from tactile_bayes.planning.knowledge import COARSE, STEP, Knowledge
from tactile_bayes.planning.record_information import COARSE_STEP, parameter_scales, reading_slopes, record_information
from tactile_bayes.record import CHANNELS
from tactile_bayes.sweep import Carried, Drive, Rotation
from tactile_bayes.uncertainty.band import central_levels
from tactile_bayes.uncertainty.offsets import heights_of

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
    def base(self) -> tuple[float, float]:
        """The pivot, or where the first drive begins [length]."""
        first = self.drives[0]
        return tuple(first.poses[0, :2].tolist()) if isinstance(first, Carried) else first.base

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
    known, candidate = question.known, question.candidates[number]
    touched = np.stack([_usable(known, drive) for drive in candidate.drives], axis=1)
    usable: Flags = np.any(touched, axis=1, keepdims=False)
    patterns, pattern_of = np.unique(touched, axis=0, return_inverse=True)
    drives = [[one for one, it in zip(candidate.drives, row, strict=True) if it or not row.any()] for row in patterns]
    models = [known.model_from(some) for some in drives]
    rng, wide = _random(question.seed, candidate), band_factor(question.probability)
    rows = np.full((len(touched), 5), np.nan)  # width and information by Laplace's approximation, then those of _nested
    for k, pattern in enumerate(pattern_of.ravel()):
        model = models[pattern]
        own = known.of(model)
        point, precision = own.points[k], own.precision
        if usable[k]:
            with suppress(ReachError):
                slopes = reading_slopes(model, point, COARSE_STEP)
                precision = precision + record_information(model, point, slopes=slopes).matrix
        deviations = deviation_of_heights(height_slopes(model, point, question.x), precision)
        rows[k, 0] = wide * mean_of_known(deviations)
        rows[k, 1] = 0.5 * (np.linalg.slogdet(precision)[1] - np.linalg.slogdet(own.precision)[1])
        if question.nested and usable[k]:
            rows[k, 2:] = _nested(question, own, model, point, precision, rng)
    width, information, nested_width, nested_information, _ = map(_mean, rows.T)
    gap, draws = _mean(_gaps(known, candidate, usable)), rows[usable, -1]
    nested_draws = float(np.median(draws)) if draws.size else np.nan
    return Expected(width, gap, information, float(usable.mean()), nested_width, nested_information, nested_draws)


def _random(seed: Seed, candidate: Candidate) -> np.random.Generator:
    """Return the random numbers of a candidate, which do not depend on the others."""
    paths = [drive.poses.ravel() for drive in candidate.drives if isinstance(drive, Carried)]
    numbers = np.concatenate([[*candidate.base, candidate.drive_step], *paths])
    return np.random.default_rng([*words(seed), *numbers.view(np.uint32)])


def _usable(known: Knowledge, drive: Drive) -> Flags:
    """Return which draws a rod touches in a drive."""
    model = known.model_from([drive])
    points = known.of(model).points
    return model.likelihood.usable(model.contours(points), model.rig(points))


def _nested(
    question: Question,
    known: Knowledge,
    model: ContourModel,
    point: Floats,
    precision: Floats,
    rng: np.random.Generator,
) -> tuple[float, float, float]:
    """Return width of the band, information gained and effective draws of the posterior of one simulated record.

    The posterior is sampled by importance sampling from a t distribution about the mode of Laplace's approximation.
    """
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
    heights = heights_of(model.contours(points[likely]), question.x)
    width = mean_of_known(_band_widths(heights, weights[likely], question.probability))
    return width, float(densities(point[None]).sum() - evidence), float(effective_number(weights))


def measured_of(model: ContourModel, point: Floats, rng: np.random.Generator) -> xr.Dataset:
    """Return a simulated measurement of the model's record, of one truth, shape (d,)."""
    loads, scale = model.loads(point[None])[0], model.noise_scale(point[None])[0]
    cell, template = model.likelihood.load_cell, model.measured
    readings = cell.simulate(loads, rng=rng, noise_scale=scale, discrepancy=model.discrepancy_at(point))
    readings = readings * model.likelihood.rod.load_units
    return template.assign({name: ("sample", readings[:, i], template[name].attrs) for i, name in enumerate(CHANNELS)})


def _band_widths(heights: Floats, weights: Floats, probability: float) -> Floats:
    """Return widths of central intervals at each grid point, from weighted draws, shape (grid points,).

    They are those of the draws that have a height there; NaN where none has.
    """
    widths, known = np.full(heights.shape[1], np.nan), ~np.isnan(heights).all(axis=0)
    of_each = np.broadcast_to(weights[:, None], heights[:, known].shape)
    levels = central_levels(probability)[::2]
    ends = np.nanquantile(heights[:, known], levels, axis=0, weights=of_each, method="inverted_cdf")
    widths[known] = np.ptp(ends, axis=0)
    return widths


def _gaps(known: Knowledge, candidate: Candidate, usable: Flags) -> Floats:
    """Return the width that no sweep touches between the outermost first contacts, for each usable draw."""
    drives = [
        replace(drive, drive_angles=None, drive_step=None) if isinstance(drive, Rotation) else drive
        for drive in candidate.drives
    ]
    model = known.model_from([*known.drives, *drives], COARSE)
    points = known.of(model).points[usable]
    if not len(points):
        return np.array([np.nan])
    found = events_of(model.likelihood, model.contours(points), model.rig(points), exact=False)
    ends = np.stack([found["first_contact_x"], found["snap_off_contact_x"]], axis=-1)
    gaps = []
    for of_draw in ends:
        arcs = joined_arcs(of_draw[np.isfinite(of_draw).all(axis=1)].tolist())
        gaps.append(sum(after[0] - before[1] for before, after in pairwise(arcs)) if arcs else np.nan)
    return np.array(gaps, dtype=float)


def _mean(values: Floats) -> tuple[float, float]:
    """Return the mean and its standard error, of what is known; NaN if unknown."""
    values = values[~np.isnan(values)]
    error = float(values.std(ddof=1) / np.sqrt(values.size)) if values.size > 1 else np.nan
    return mean_of_known(values), error
