"""Two contours joined, with or without an edge between them: profile IV of the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours.base import Contour, Locus, Parameter, as_parameter, common_shape, refuse_unless
from tactile_bayes.contours.halves import Halves
from tactile_bayes.errors import ContourError

SAME_SLOPE = 1e-9  # difference below which slope angles are equal [rad]


@dataclass(frozen=True, eq=False)
class Joined(Contour):
    """Part of `left` up to the joint, and part of `right` beyond it.

    The radius of curvature may jump at the joint. The slope may too, if it grows: the object then has an edge, an arc
    of radius zero on which the rod turns on the spot.

    Parameters
    ----------
    left, right : Contour
        The halves, which meet at the joint.
    x : array_like, optional
        Position of the joint [length]; broadcasts with the halves. By default the point at which both are level.

    Raises
    ------
    ContourError
        If the halves do not meet at the joint, or their slopes make a dent there.

    Examples
    --------
    >>> from tactile_bayes.contours import Joined, Parabola, PowerLaw
    >>> iv = Joined(Parabola(0.5, q=0.3), PowerLaw(1.0, 4, q=0.3))
    >>> iv.height([-1.0, 0.0, 1.0])
    array([0.8, 0.3, 1.3])

    An edge:

    >>> edge = Joined(Parabola(0.2, q=0.3, x_c=1.0), Parabola(0.2, q=0.3, x_c=-1.0), x=0.0)
    >>> edge.point([-0.2, 0.0, 0.2])[0].round(12), edge.radius_of_curvature(0.1)
    (array([0., 0., 0.]), np.float64(0.0))
    """

    left: Contour
    right: Contour
    x: Parameter | None = None

    def __post_init__(self) -> None:
        for name in ("left", "right"):
            if not isinstance(getattr(self, name), Contour):
                raise ContourError(f"Joined: {name} is {getattr(self, name)!r}: give a contour")
        if self.x is not None:
            self.__dict__["x"] = as_parameter("Joined", "x", self.x)
        shapes = {"left": self.left.shape, "right": self.right.shape, "x": () if self.x is None else np.shape(self.x)}
        shape = common_shape("Joined", **shapes)
        ends = []
        for half in (self.left, self.right):
            parameter = half.parameter_of_slope(0.0) if self.x is None else half.parameter_of_x(self.x)
            if np.any(np.isnan(parameter)):
                where = "level anywhere" if self.x is None else f"there at x = {self.x}"
                raise ContourError(f"Joined: {half} is not {where}: give an x at which both halves meet")
            ends.append((parameter, half.locate(parameter)))
        (before, left), (after, right) = ends
        scale = 1.0 + np.abs(left.x) + np.abs(left.y)
        meet = (np.abs(left.x - right.x) <= 1e-12 * scale) & (np.abs(left.y - right.y) <= 1e-12 * scale)
        points = {"left x": left.x, "left y": left.y, "right x": right.x, "right y": right.y}
        rule = "the halves must meet at the joint: give both the same vertex, or an x where they cross"
        refuse_unless(meet, "Joined", rule, **points)
        edge = right.slope_angle - left.slope_angle
        slopes = {"left slope": np.tan(left.slope_angle), "right slope": np.tan(right.slope_angle)}
        rule = "the slope must not fall at the joint, else the object has a dent there"
        refuse_unless(edge >= -SAME_SLOPE, "Joined", rule, **slopes)
        joint = np.broadcast_arrays(before, after, np.where(edge > SAME_SLOPE, edge, 0.0), np.empty(shape))
        self.__dict__["_parameters"] = tuple(joint[:3])

    @property
    def _joint(self) -> tuple[Floats, Floats, Floats]:
        """Parameters of the left and the right half at the joint, and the turn between them [rad]."""
        return self.__dict__["_parameters"]

    @property
    def domain(self) -> tuple[Floats, Floats]:
        before, after, edge = self._joint
        return self.left.domain[0] - before, self.right.domain[1] - after + edge

    @property
    def halves(self) -> Halves | None:
        left, right = self.left.halves, self.right.halves
        if self.x is not None or left is None or right is None:
            return None
        return Halves(left.left, right.right, left.x, left.y)

    def end_name(self, side: Literal["left", "right"]) -> str:
        return (self.left if side == "left" else self.right).end_name(side)

    @property
    def knots(self) -> tuple[Floats, ...]:
        before, after, edge = self._joint
        inner = [knot - before for knot in self.left.knots], [knot - after + edge for knot in self.right.knots]
        return (*(np.minimum(k, 0.0) for k in inner[0]), np.zeros(()), edge, *(np.maximum(k, edge) for k in inner[1]))

    def locate(self, parameter: ArrayLike) -> Locus:
        p = self._at("parameter", parameter)
        before, after, edge = self._joint
        left = self.left.locate(np.minimum(p, 0.0) + before)
        right = self.right.locate(np.maximum(p - edge, 0.0) + after)
        locus = Locus(*(np.where(p < 0.0, a, b) for a, b in zip(left, right, strict=True)))
        turning = (p >= 0.0) & (p < edge)
        if not np.any(turning):
            return locus
        return locus._replace(
            slope_angle=np.where(turning, right.slope_angle - edge + p, locus.slope_angle),
            arclength_rate=np.where(turning, 0.0, locus.arclength_rate),
            slope_rate=np.where(turning, 1.0, locus.slope_rate),
        )

    def parameter_of_slope(self, slope_angle: ArrayLike) -> Floats:
        before, after, edge = self._joint
        last = self.left.locate(before).slope_angle
        past = self._at("slope_angle", slope_angle) - last
        left = self.left.parameter_of_slope(last + np.minimum(past, 0.0)) - before
        right = self.right.parameter_of_slope(self.right.locate(after).slope_angle + np.maximum(past - edge, 0.0))
        return np.where(past < 0.0, left, np.where(past < edge, past, right - after + edge))

    def parameter_of_x(self, x: ArrayLike) -> Floats:
        before, after, edge = self._joint
        x, joint = self._at("x", x), self.right.locate(after).x
        left = self.left.parameter_of_x(np.minimum(x, joint)) - before
        right = self.right.parameter_of_x(np.maximum(x, joint)) - after + edge
        return np.where(x < joint, left, right)

    def height(self, x: ArrayLike) -> Floats:
        x = self._at("x", x)
        return np.where(x < self.right.locate(self._joint[1]).x, self.left.height(x), self.right.height(x))

    @property
    def shape(self) -> tuple[int, ...]:
        return self._joint[0].shape

    def broadcast_to(self, shape: tuple[int, ...]) -> Joined:
        return self._both(lambda half: half.broadcast_to(shape), lambda value: np.broadcast_to(value, shape))

    def take(self, index: Index | tuple[Index, ...]) -> Joined:
        return self._both(lambda half: half.take(index), lambda value: value[index])

    def _both(self, of_half: Callable[[Contour], Contour], of_value: Callable[[Floats], Floats]) -> Joined:
        other = object.__new__(type(self))  # the halves have been checked, and this is called in inner loops
        x, joint = None if self.x is None else of_value(np.asarray(self.x)), tuple(map(of_value, self._joint))
        other.__dict__.update(left=of_half(self.left), right=of_half(self.right), x=x, _parameters=joint)
        return other
