"""Drift: slow stochastic changes of a sensor's zero from sample to sample."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_number
from tactile_bayes.errors import ParameterError


@dataclass(frozen=True)
class _DriftProcess:
    """Process d(i+1) = decay · d(i) + a normal step, channel by channel: a random walk from zero, unless overridden."""

    moment: float = 0.0
    force: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            name, value = f"{type(self).__name__}: {field.name}", getattr(self, field.name)
            number = check_number(name, value, "give zero or a positive number", least=0.0)
            object.__setattr__(self, field.name, number)

    @property
    def sizes(self) -> Floats:
        """Size for each channel, shape (3,): `moment`, `force`, `force`."""
        return np.array([self.moment, self.force, self.force])

    @property
    def decay(self) -> float:
        """Factor on the drift from one sample to the next."""
        return 1.0

    @property
    def initial_variance(self) -> float:
        """Variance of the drift at the first sample, over the square of the size."""
        return 0.0

    @property
    def step_variance(self) -> float:
        """Variance of a step, over the square of the size."""
        return 1.0

    def draw(self, normal: Floats) -> Floats:
        """Draw drift from independent standard normal numbers, shape (..., samples, 3)."""
        from scipy.signal import lfilter  # takes a while to load

        steps = math.sqrt(self.step_variance) * normal
        steps[..., :1, :] = math.sqrt(self.initial_variance) * normal[..., :1, :]
        return np.asarray(lfilter([1.0], [1.0, -self.decay], steps, axis=-2)) * self.sizes


@dataclass(frozen=True)
class RandomWalk(_DriftProcess):
    """Drift of the zero by a random walk, from zero at the first sample of the record.

    It describes the warming-up of a cell after taring. After n samples the drift has the standard deviation √n · step,
    without bound; a typical step is 1e-3 to 1e-1 of the white noise.

    Parameters
    ----------
    moment, force : float
        Standard deviation of the step from one sample to the next, of the moment [N m, or EI/L] and of each force
        [N, or EI/L²].

    Raises
    ------
    ParameterError
        If a size is negative or not finite.

    Examples
    --------
    >>> walk = RandomWalk(force=1e-3).draw(np.random.default_rng(1).standard_normal((20_000, 100, 3)))
    >>> walk[:, -1].std(axis=0).round(4)  # √99 steps
    array([0.  , 0.01, 0.01])
    """


@dataclass(frozen=True)
class OrnsteinUhlenbeck(_DriftProcess):
    """Drift of the zero about its mean by an Ornstein–Uhlenbeck process with a correlation time of `time` samples.

    It describes draughts and a switching temperature control. The process is stationary: the first sample drifts as
    much as any. Two samples k apart have exactly the correlation exp(−k/time).

    Parameters
    ----------
    moment, force : float
        Standard deviation of the drift of the moment [N m, or EI/L] and of each force [N, or EI/L²]; typically of the
        size of the white noise.
    time : float
        Correlation time [samples], > 0.

    Raises
    ------
    ParameterError
        If a size is negative or not finite, or the time is not positive.

    Examples
    --------
    >>> normal = np.random.default_rng(1).standard_normal((20_000, 21, 3))
    >>> wander = OrnsteinUhlenbeck(moment=0.1, time=20.0).draw(normal)
    >>> round(float(np.corrcoef(wander[:, 0, 0], wander[:, 20, 0])[0, 1]), 2)  # exp(−1)
    0.37
    """

    time: float = 100.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.time == 0.0:
            raise ParameterError("OrnsteinUhlenbeck: time is 0: give a positive number of samples")

    @property
    def decay(self) -> float:
        return math.exp(-1.0 / self.time)

    @property
    def initial_variance(self) -> float:
        return 1.0

    @property
    def step_variance(self) -> float:
        return -math.expm1(-2.0 / self.time)


Drift = RandomWalk | OrnsteinUhlenbeck


class Zero(NamedTuple):
    """Variances of an unknown zero, shape (..., channels): of the drift at the first sample, its steps, and a bias."""

    initial: Floats
    step: Floats
    bias: Floats
    decay: float  # factor on the drift from one sample to the next

    @classmethod
    def of(cls, drift: Drift | None, sizes: Floats, bias: Floats) -> Zero:
        """Return the variances for a drift of these squared sizes, shape (..., channels), none without a drift."""
        if drift is None:
            return cls(np.zeros_like(bias), np.zeros_like(bias), bias, 1.0)
        return cls(drift.initial_variance * sizes, drift.step_variance * sizes, bias, drift.decay)
