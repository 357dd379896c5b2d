"""Drives: paths of the base, along which the rod is turned, carried, or both."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_array, check_number, check_numbers, check_positive
from tactile_bayes.errors import ParameterError
from tactile_bayes.record import carried_sweeps

__all__ = ["Carried", "Drive", "Motion", "Rotation", "Translation", "recorded_drives"]

_ROUNDING = 1e-15
_TURN = 2.0 * math.pi
_IN_DEGREES = "give an angle in radians, at most a turn (2π); one in degrees is converted by np.radians"


@dataclass(frozen=True)
class Rotation:
    """Drive that turns the rod about a pivot that rests.

    Parameters
    ----------
    base : (float, float)
        The pivot, in the contour's unit of length.

    Raises
    ------
    ParameterError
        If the pivot is not two finite numbers.

    Examples
    --------
    >>> Rotation(base=(0.1, 0.0)).base
    (0.1, 0.0)
    """

    base: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "base", _pair(self.base))


class Carried(ABC):
    """Drive that carries the base along a path: straight lines from pose to pose."""

    @property
    @abstractmethod
    def poses(self) -> Floats:
        """Poses (x, y, drive angle) of the base in the laboratory frame [length and rad], shape (n, 3)."""

    @cached_property
    def travels(self) -> Floats:
        """Travel at each pose: distance moved by the base [length], or turn if the base does not move at all [rad]."""
        steps = np.diff(self.poses, axis=0)
        ways = np.hypot(steps[:, 0], steps[:, 1])
        return np.append(0.0, np.cumsum(ways if ways.any() else np.abs(steps[:, 2])))

    def side(self, length: float) -> str:
        """Return "forward" if the left side of an unloaded rod of a length leads on average, else "backward"."""
        check_positive("length", length)
        steps, angle = np.diff(self.poses, axis=0), self.poses[:-1, 2]
        ahead = steps[:, 1] * np.cos(angle) - steps[:, 0] * np.sin(angle) + 0.5 * length * steps[:, 2]
        return "forward" if ahead.sum() >= 0.0 else "backward"

    def at(self, travels: ArrayLike) -> Floats:
        """Poses of the base at travels between the first and the last [length and rad], shape (k, 3)."""
        wanted = check_array("travels", travels)
        return np.stack([np.interp(wanted, self.travels, column) for column in self.poses.T], axis=-1)


Drive = Rotation | Carried


@dataclass(frozen=True)
class Translation(Carried):
    """Drive that carries the base along a line, with the rod clamped at a drive angle.

    Parameters
    ----------
    base : (float, float)
        Position of the base at the beginning, in the contour's unit of length.
    heading : float
        Direction of the motion, counter-clockwise from the x axis [rad].
    drive_angle : float
        Slope of the unloaded rod at its base [rad].
    travel : float
        Distance by which the base moves [length].

    Raises
    ------
    ParameterError
        If a number is not finite, an angle exceeds a turn, or the travel is not positive.

    Examples
    --------
    >>> Translation(base=(0.8, 0.0), heading=np.pi, drive_angle=np.pi / 2, travel=1.5).at([0.0, 1.5]).round(6)
    array([[ 0.8     ,  0.      ,  1.570796],
           [-0.7     ,  0.      ,  1.570796]])
    """

    base: tuple[float, float]
    heading: float
    drive_angle: float
    travel: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "base", _pair(self.base))
        for name in ("heading", "drive_angle"):
            value = check_number(name, getattr(self, name), _IN_DEGREES, least=-_TURN, most=_TURN)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "travel", check_positive("travel", self.travel, "give a positive length"))

    @property
    def poses(self) -> Floats:
        direction = np.array([math.cos(self.heading), math.sin(self.heading), 0.0])
        way = self.travel * np.where(np.abs(direction) < _ROUNDING, 0.0, direction)
        begin = np.array([*self.base, self.drive_angle])
        return np.stack([begin, begin + way])


@dataclass(frozen=True, eq=False)
class Motion(Carried):
    """Drive that carries the base along any path: straight lines from pose to pose, along which it turns at a constant
    rate.

    Parameters
    ----------
    x, y : array_like, broadcastable to shape (n,)
        Positions of the base in their order, in the contour's unit of length.
    drive_angle : array_like, broadcastable to shape (n,)
        Slope of the unloaded rod at its base there [rad].

    Raises
    ------
    ParameterError
        If there are fewer than two poses, two in succession are the same, a number is not finite, or an angle exceeds
        a turn.

    Examples
    --------
    Turned by half a right angle while it is carried to the left:

    >>> motion = Motion(x=[0.8, -0.7], y=0.0, drive_angle=[0.8, 1.6])
    >>> motion.at([0.0, 0.75]).round(6)
    array([[0.8 , 0.  , 0.8 ],
           [0.05, 0.  , 1.2 ]])
    """

    x: Any
    y: Any
    drive_angle: Any

    def __post_init__(self) -> None:
        names = ("x", "y", "drive_angle")
        given = [np.atleast_1d(check_numbers(name, getattr(self, name))) for name in names]
        try:
            columns = np.broadcast_arrays(*given)
        except ValueError as error:
            sizes = ", ".join(str(column.shape) for column in given)
            what = f"x, y and drive_angle have the shapes {sizes}: give one value for each pose"
            raise ParameterError(what) from error
        if columns[0].ndim != 1 or columns[0].size < 2:
            raise ParameterError("a motion needs at least two poses: give x, y or drive_angle as arrays of shape (n,)")
        if np.any(np.abs(columns[2]) > _TURN):
            raise ParameterError(f"drive_angle is up to {float(np.abs(columns[2]).max()):g}: {_IN_DEGREES}")
        steps = np.abs(np.diff(np.stack(columns, axis=1), axis=0)).sum(axis=1)
        if not np.all(steps > 0.0):
            at = int(np.argmin(steps))
            raise ParameterError(f"the poses {at} and {at + 1} are the same: leave one of them out")
        for name, column in zip(names, columns, strict=True):
            object.__setattr__(self, name, np.array(column))

    @property
    def poses(self) -> Floats:
        return np.stack([self.x, self.y, self.drive_angle], axis=1)


def recorded_drives(record: xr.Dataset) -> list[Drive]:
    """Return the drives of a record: a rotation about each pivot, and a motion for each sweep that carries the base."""
    carried = carried_sweeps(record)
    drives: dict[object, Drive] = {}
    for number in dict.fromkeys(record.sweep.values.tolist()):
        rows = record.sweep.values == number
        poses = np.column_stack([record[name].values[rows] for name in ("base_x", "base_y", "drive_angle")])
        if number in carried:
            moves = np.append(True, np.any(np.diff(poses, axis=0) != 0.0, axis=1))
            drives[number] = Motion(*poses[moves].T)
        else:
            x, y = poses[0, :2].tolist()
            drives.setdefault((x, y), Rotation((x, y)))
    return list(drives.values())


def _pair(base: Any) -> tuple[float, float]:
    x, y = check_numbers("base", base, "give two numbers, (x, y)", shape=(2,))
    return float(x), float(y)
