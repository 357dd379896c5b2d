"""Drives: paths of the base, along which the rod is turned, carried, or both."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_array, check_choice, check_number, check_numbers, check_positive, refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.record import carried_sweeps

_ROUNDING = 1e-15
_TURN = 2.0 * math.pi
# Least step of a rotation [rad], and of other drives over their travel; finer ones give millions of samples.
_FINEST = 1e-6
_COARSEST = 0.5  # largest step of a rotation [rad]; a larger one is probably in degrees
_SHARE = 1e-9  # share of a step by which the last one may be too short
_IN_DEGREES = "give an angle in radians, at most a turn (2π); one in degrees is converted by np.radians"


@dataclass(frozen=True)
class Rotation:
    """Drive that turns the rod about a pivot that rests.

    Parameters
    ----------
    base : (float, float)
        The pivot, in the contour's unit of length. The contour must lie above it.
    direction : {"both", "forward", "backward"}
        Directions of its sweeps; "both" is a forward sweep, which is counter-clockwise, then a backward one.
    drive_step : float, optional
        Step of the drive [rad], at most 0.5; by default 1° in a scan, and 2° in a plan or a calibration whose drive
        angles do not depend on the contour.
    drive_angles : array_like, shape (n,), optional
        Readings of a perfect encoder [rad] in place of such a grid, used in increasing order forward and in decreasing
        order backward, without duplicates.

    Raises
    ------
    ParameterError
        If the pivot is not two finite numbers, there is no such direction, a step or an angle is impossible, or both
        are given.

    Examples
    --------
    >>> Rotation(base=(0.1, 0.0), direction="forward", drive_angles=[1.0, 0.5]).drive_angles
    (0.5, 1.0)
    """

    base: tuple[float, float] = (0.0, 0.0)
    direction: Literal["both", "forward", "backward"] = "both"
    drive_step: float | None = None
    drive_angles: ArrayLike | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "base", _pair(self.base))
        directions = ("both", "forward", "backward")
        check_choice("direction", self.direction, directions, "choose 'forward' or 'backward', or 'both'")
        if self.drive_step is not None:
            correction = (
                f"give a positive angle in radians, at most {_COARSEST}; one in degrees is converted by np.radians, "
                f"and below {_FINEST:g} there would be millions of samples"
            )
            step = check_number("drive_step", self.drive_step, correction, least=_FINEST, most=_COARSEST)
            object.__setattr__(self, "drive_step", step)
        if self.drive_angles is not None:
            angles = check_numbers("drive_angles", self.drive_angles, _IN_DEGREES, least=-_TURN, most=_TURN)
            if angles.ndim > 1 or not angles.size:
                raise refused("drive_angles", self.drive_angles, "give a list of angles in radians")
            object.__setattr__(self, "drive_angles", tuple(np.unique(angles).tolist()))
            if self.drive_step is not None:
                raise ParameterError("drive_step and drive_angles are two grids of one rotation: give one of them")

    @property
    def directions(self) -> tuple[Direction, ...]:
        """Directions of its sweeps, in their order."""
        return ("forward", "backward") if self.direction == "both" else (self.direction,)

    @property
    def description(self) -> dict[str, Any]:
        """Everything that it consists of, as JSON has it, without what is left to defaults."""
        given = {"direction": self.direction, "drive_step": self.drive_step, "drive_angles": self.drive_angles}
        return {"base": self.base, **{name: value for name, value in given.items() if value not in (None, "both")}}


class Carried(ABC):
    """Drive that carries the base along a path: straight lines from pose to pose. It makes one sweep, which is called
    forward if the rod touches the object with its left side, as in a counter-clockwise rotation, and else backward."""

    drive_step: float | None

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

    @property
    def description(self) -> dict[str, Any]:
        """Everything that it consists of, as JSON has it, without what is left to defaults."""
        step = {} if self.drive_step is None else {"drive_step": self.drive_step}
        return {"poses": self.poses.tolist(), **step}

    def by(self, step: float) -> Floats:
        """Return the travels of the samples by a step [length, or rad]."""
        return np.asarray(step * np.arange(math.floor(float(self.travels[-1]) / step + _SHARE) + 1))

    def _check_step(self) -> None:
        """Refuse a step that is not positive, or too fine."""
        if self.drive_step is not None:
            least = _FINEST * float(self.travels[-1])
            what = f"give a positive length; below {least:g} there would be millions of samples"
            object.__setattr__(self, "drive_step", check_number("drive_step", self.drive_step, what, least=least))

    def at(self, travels: ArrayLike) -> Floats:
        """Poses of the base at travels between the first and the last [length and rad], shape (k, 3)."""
        wanted = check_array("travels", travels)
        return np.stack([np.interp(wanted, self.travels, column) for column in self.poses.T], axis=-1)


Drive = Rotation | Carried
Direction = Literal["forward", "backward"]


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
    drive_step : float, optional
        Step of the drive in its travel [length]; by default a hundredth of the rod's length in a scan, and in plans and
        calibrations whose drive angles do not depend on the contour as many samples as of a rotation.

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
    drive_step: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "base", _pair(self.base))
        for name in ("heading", "drive_angle"):
            value = check_number(name, getattr(self, name), _IN_DEGREES, least=-_TURN, most=_TURN)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "travel", check_positive("travel", self.travel, "give a positive length"))
        self._check_step()

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
    drive_step : float, optional
        As in `Translation`; a scan by more than 8 poses is by default sampled at these.

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
    drive_step: float | None = None

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
        self._check_step()

    @property
    def poses(self) -> Floats:
        return np.stack([self.x, self.y, self.drive_angle], axis=1)


def drives_of(drive: Drive | Sequence[Drive] | None) -> list[Drive]:
    """Return drives from one or several, by default a rotation about the origin; ParameterError if they are none."""
    if drive is None:
        return [Rotation()]
    drives = [drive] if isinstance(drive, Rotation | Carried) else list(drive) if isinstance(drive, Sequence) else []
    if not drives or not all(isinstance(one, Rotation | Carried) for one in drives):
        raise refused("drive", drive, "give a Rotation, a Translation or a Motion, or a list of them")
    return drives


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
