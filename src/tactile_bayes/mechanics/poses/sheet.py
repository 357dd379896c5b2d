"""Coefficients of the pose of one rod, contracted from a table (`forward_table`), and the pose that they give.

A pose is a polynomial in ψ1 or s1, and in log(1 + f Λ²/10): there are strong forces, and few contacts have them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.pose import Pose, scaled

# Most terms in ψ1 or s1, terms in the force, most polynomials in what differs between rods.
MOST_ROWS, TERMS, MOST_NODES = 16, 24, 7
COLUMNS = 3 * TERMS

GROUP = 4  # terms in ψ1 or s1 that are summed at a time
MOST_FORCE, BEYOND = 36.0, 0.6  # largest f Λ², and largest Λ beyond the tip, over Λ(1)
MOST_PSI1 = 1.4  # largest ψ1 in tip contact [rad]
SCALE = 10.0  # f Λ² from which on polynomials are in its logarithm
SPAN = math.log1p(MOST_FORCE / SCALE)  # largest logarithm
_CACHE_LINE = 64  # bytes of a line of the processor's cache: numbers that lie in two of them take longer to load
# Coefficients of one rod.
_SHEET = np.dtype(
    [
        ("phases", float, (3, MOST_ROWS, COLUMNS)),  # tip contact, tangential contact up to the tip, and beyond it
        ("sums", float, (2, COLUMNS)),  # workspace for one pose
        ("outer", float, (3, MOST_NODES)),  # polynomials in taper, bend and friction angle
        ("least_psi1", float),  # of the table
        ("sign", float),  # the rod
        ("taper", float),
        ("bend", float),
        ("friction_angle", float),
        ("rows", np.intp, (3,)),  # numbers of terms in ψ1 or s1 of the phases
    ],
    align=True,
)


def sheet() -> NDArray[np.void]:
    """Return an array of one `_SHEET`, whose rows begin where cache lines do."""
    room = np.zeros(_SHEET.itemsize + _CACHE_LINE, dtype=np.uint8)
    begin = -room.ctypes.data % _CACHE_LINE
    return room[begin : begin + _SHEET.itemsize].view(_SHEET)


@compiled
def length_of(slenderness: float, taper: float, arclength: float) -> tuple[float, float]:
    """Λ, and its derivative by the arc length."""
    if arclength > 1.0:
        rate = slenderness / ((1.0 - taper) * (1.0 - taper))
        return slenderness / (1.0 - taper) + (arclength - 1.0) * rate, rate
    width = 1.0 - taper * arclength
    return slenderness * arclength / width, slenderness / (width * width)


@compiled
def pose_in(
    sheet: NDArray[np.void], slenderness: float, taper: float, psi1: float, arclength: float, force: float, tip: bool
) -> tuple[bool, Pose, Pose, Pose]:
    """True if there is a pose; the pose, and its derivatives by ψ1 or the arc length, and by the force."""
    length, rate = length_of(slenderness, taper, arclength)
    own, loading = sheet[0], force * length * length
    z, by_loading = 2.0 / SPAN * math.log1p(loading / SCALE) - 1.0, 2.0 / (SPAN * (SCALE + loading))
    phase, begin, by_x, at = 1, 0.0, 2.0, arclength
    if tip:
        phase, begin, at = 0, own.least_psi1, psi1
        by_x = 2.0 / (MOST_PSI1 - begin)
    elif arclength > 1.0:
        phase, begin, by_x = 2, 1.0, 2.0 / (BEYOND * (1.0 - taper))
    x, by_force = (at - begin) * by_x - 1.0, by_loading * length * length
    inside = -1.0 <= x <= 1.0 and z <= 1.0
    here, in_x, in_z = _sums(own.phases[phase], own.rows[phase], x, z, own.sums)
    if tip:
        return inside, here, scaled(by_x, in_x), scaled(by_force, in_z)
    by_s = 2.0 * by_loading * force * length * rate
    in_s = Pose(by_x * in_x.u + by_s * in_z.u, by_x * in_x.v + by_s * in_z.v, by_x * in_x.turn + by_s * in_z.turn)
    return (
        inside,
        _stretched(arclength, here),
        Pose(here.u + arclength * in_s.u, here.v + arclength * in_s.v, in_s.turn),
        scaled(by_force, _stretched(arclength, in_z)),
    )


@compiled
def is_far(slenderness: float, taper: float, arclength: float, force: float) -> bool:
    """True if f Λ² is more than twice the largest one of any table."""
    length, _ = length_of(slenderness, taper, arclength)
    return force * length * length > 2.0 * MOST_FORCE


@compiled
def _stretched(factor: float, pose: Pose) -> Pose:
    return Pose(factor * pose.u, factor * pose.v, pose.turn)


@compiled
def _sums(rows: Floats, count: int, x: float, z: float, room: Floats) -> tuple[Pose, Pose, Pose]:
    """Three polynomials in two variables, and their derivatives."""
    at, by, square, power, before = room[0], room[1], x * x, 1.0, 0.0
    for j in range(COLUMNS):
        at[j], by[j] = 0.0, 0.0
    for i in range(0, count, GROUP):
        power_1, power_2, power_3 = power * x, power * square, power * square * x
        by_0, by_1, by_2, by_3 = i * before, (i + 1) * power, (i + 2) * power_1, (i + 3) * power_2
        row_0, row_1, row_2, row_3 = rows[i], rows[i + 1], rows[i + 2], rows[i + 3]
        for j in range(COLUMNS):  # several at a time, and nothing stored before all is loaded
            c_0, c_1, c_2, c_3 = row_0[j], row_1[j], row_2[j], row_3[j]
            value = at[j] + (power * c_0 + power_1 * c_1 + power_2 * c_2 + power_3 * c_3)
            slope = by[j] + (by_0 * c_0 + by_1 * c_1 + by_2 * c_2 + by_3 * c_3)
            at[j], by[j] = value, slope
        power, before = power_2 * square, power_3
    u, v, turn, u_x, v_x, turn_x, u_z, v_z, turn_z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(COLUMNS - 3, -1, -3):
        u_z, v_z, turn_z = u_z * z + u, v_z * z + v, turn_z * z + turn
        u, v, turn = u * z + at[j], v * z + at[j + 1], turn * z + at[j + 2]
        u_x, v_x = u_x * z + by[j], v_x * z + by[j + 1]
        turn_x = turn_x * z + by[j + 2]
    return Pose(u, v, turn), Pose(u_x, v_x, turn_x), Pose(u_z, v_z, turn_z)
