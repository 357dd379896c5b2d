"""The discrepancy of a model: a smooth random deviation of the readings in contact, beside the errors of the sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats, Index, RandomSource
from tactile_bayes.checks import check_array, check_kind, check_numbers, refused

__all__ = ["Course", "Discrepancy", "joined"]


class Course(NamedTuple):
    """Order in which a discrepancy passes through the samples of a record."""

    order: Index  # samples, those of each sweep together and by its coordinate, shape (samples,)
    step: Floats  # distance from the sample before in that order; infinite where a sweep begins, shape (samples,)

    @classmethod
    def along(cls, coordinate: Floats, sweeps: Sequence[Index]) -> Course:
        """Return the course by a coordinate of each sample, shape (samples,), within sweeps given by their samples.

        Examples
        --------
        >>> Course.along(np.array([0.0, 0.5, 3.0, 2.0]), [np.array([0, 1]), np.array([2, 3])])
        Course(order=array([0, 1, 3, 2]), step=array([inf, 0.5, inf, 1. ]))
        """
        coordinate = check_numbers("coordinate", coordinate, "give a finite number for each sample", shape=(None,))
        try:
            ordered = [samples[np.argsort(coordinate[samples], kind="stable")] for samples in sweeps]
            ordered.sort(key=lambda samples: int(samples.min()))
        except (AttributeError, IndexError, TypeError, ValueError):
            raise refused("sweeps", sweeps, "give the samples of each sweep, as arrays of their indices") from None
        if sum(map(len, ordered)) != coordinate.size:
            raise refused("sweeps", sweeps, f"give each of the {coordinate.size} samples in one sweep")
        step = [np.append(np.inf, np.diff(coordinate[samples])) for samples in ordered]
        return cls(np.concatenate(ordered), np.concatenate(step))

    @property
    def is_measured_order(self) -> bool:
        """True if the samples are in the order of measurement."""
        return bool(np.all(np.diff(self.order) > 0))

    def load_in_contact(self, loads: Floats) -> Floats:
        """Return the largest load of the sweep at samples in contact, shape (..., samples, 3); 0 at the others.

        The largest force in any direction stands for both forces, so that the discrepancy does not depend on the frame
        of the load cell, and a force that happens to be small is as uncertain as the other.
        """
        sizes = np.stack([np.abs(loads[..., 0]), np.hypot(loads[..., 1], loads[..., 2])], axis=-1)
        begins = np.isinf(self.step)
        largest = np.maximum.reduceat(sizes[..., self.order, :], np.flatnonzero(begins), axis=-2)
        of_sample = np.empty(self.order.size, dtype=np.intp)
        of_sample[self.order] = np.cumsum(begins) - 1
        in_contact = (sizes > 0.0).any(axis=-1, keepdims=True)
        return np.asarray(np.where(in_contact, largest[..., of_sample, :][..., [0, 1, 1]], 0.0))


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """Zero-mean Gaussian process that is added to the readings, independent in each channel and each sweep.

    Its covariance over the distance d of two samples of a sweep is σ₁ σ₂ (1 + √3 d/length) exp(−√3 d/length): Matérn's
    with ν = 3/2, once differentiable, with the standard deviations σ₁ and σ₂ of the two samples. Kennedy and O'Hagan
    2001 (doi 10.1111/1467-9868.00294) introduced such a term for what a model does not describe.

    Parameters
    ----------
    course : Course
        Order and distances of the samples.
    deviation : ndarray, shape (..., samples, 3)
        Standard deviation in each channel, in the units of the load cell; 0 where there is no discrepancy.
    length : ndarray, shape (...)
        Correlation length, > 0, in the unit of the distances.
    """

    course: Course
    deviation: Floats
    length: Floats

    def __post_init__(self) -> None:
        check_kind("course", self.course, Course, "give a Course")
        object.__setattr__(self, "length", check_array("length", self.length))
        samples = len(self.course.order)
        correction = f"give numbers, shape (..., samples, channels), with {samples} samples"
        object.__setattr__(self, "deviation", check_array("deviation", self.deviation, correction))
        if self.deviation.shape[-2:-1] != (samples,):
            raise refused("deviation", self.deviation, correction)

    def take(self, where: Index | int) -> Discrepancy:
        """Return some of a batch, or one."""
        return Discrepancy(self.course, self.deviation[where], np.asarray(self.length[where]))

    def of(self, channels: Index) -> Discrepancy:
        """Return the discrepancy of some channels."""
        return Discrepancy(self.course, self.deviation[..., channels], self.length)

    @property
    def rate(self) -> Floats:
        """Rate of the process, shape (...)."""
        return math.sqrt(3.0) / np.asarray(self.length, dtype=float)

    def covariance(self) -> Floats:
        """Return the covariance of the samples of each channel, shape (samples, samples, 3), without a batch."""
        sweep = np.cumsum(np.isinf(self.course.step))
        place = np.cumsum(np.where(np.isinf(self.course.step), 0.0, self.course.step))
        a = float(self.rate) * np.abs(np.subtract.outer(place, place))
        together = np.empty(a.shape)
        ordered = np.where(np.equal.outer(sweep, sweep), (1.0 + a) * np.exp(-a), 0.0)
        together[np.ix_(self.course.order, self.course.order)] = ordered
        return np.asarray(self.deviation[:, None] * together[..., None] * self.deviation)

    def draw(self, rng: RandomSource) -> Floats:
        """Draw discrepancies, shape (..., samples, 3)."""
        batch, rate = self.deviation.shape[:-2], self.rate
        normal = np.moveaxis(rng.standard_normal((*self.deviation.shape, 2)), -3, 0)
        drawn = np.empty((len(self.course.order), *batch, self.deviation.shape[-1]))
        value, slope = normal[0, ..., 0], normal[0, ..., 1]
        for sample, step in zip(self.course.order, self.course.step, strict=True):
            if math.isinf(step):
                value, slope = normal[sample, ..., 0], normal[sample, ..., 1]
            else:
                a = np.broadcast_to(rate * step, batch)[..., None]
                fade = np.exp(-a)
                # Cholesky factor of the variance that is new since the last sample.
                from_value = np.sqrt(np.maximum(1.0 - fade**2 * (1.0 + 2.0 * a * (1.0 + a)), 0.0))
                between = 2.0 * fade**2 * a**2
                with np.errstate(invalid="ignore", divide="ignore"):
                    shared = np.where(from_value > 0.0, between / from_value, 0.0)
                own = np.sqrt(np.maximum(1.0 - fade**2 * (1.0 + 2.0 * a * (a - 1.0)) - shared**2, 0.0))
                value, slope = fade * ((1.0 + a) * value + a * slope), fade * ((1.0 - a) * slope - a * value)
                value = value + from_value * normal[sample, ..., 0]
                slope = slope + shared * normal[sample, ..., 0] + own * normal[sample, ..., 1]
            drawn[sample] = value
        return np.asarray(np.moveaxis(drawn, 0, -2) * self.deviation)


def joined(parts: Sequence[Discrepancy]) -> Discrepancy | None:
    """Return one batch of several; None if there are none."""
    if not parts:
        return None
    deviation, length = (np.concatenate([getattr(part, name) for part in parts]) for name in ("deviation", "length"))
    return Discrepancy(parts[0].course, deviation, length)
