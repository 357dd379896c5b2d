"""One contact from its coordinates, with derivatives: the closed form of `contact_coordinates`, compiled.

The pivot as seen from the contact (`pose`) is turned so that the rod has its drive angle at the pivot. The closed form
goes on for longer rods, which would wind about the line of force: a contact of a straight, uniform rod has a lever
u ≥ 0 of the contact force and |ψ1| < π/2, and other arcs are shorter than a period.
"""

from __future__ import annotations

import math

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import cached, compiled
from tactile_bayes.mechanics.contacts.arc_states import MOST_LOAD
from tactile_bayes.mechanics.poses.beam import Beam, Varied, WholePose, mirrored_by, whole_pose
from tactile_bayes.mechanics.poses.pose import Pose

_MEANS = 20  # steps of the arithmetic–geometric mean: more than enough
_MOST_INTEGRATED = 1e3  # largest load f s1² of a rod that is integrated
_NONE = Pose(math.nan, math.nan, math.nan)
_NOWHERE = WholePose(_NONE, _NONE, _NONE, _NONE)


@compiled
def _is_first(x: float, y: float) -> bool:
    """True if the rod is shorter than a period of the elastica, for the parameters of its functions (`jacobi`). A
    pendulum that turns over has the period π/M in t, one that swings 2π/M, with the mean M of √max(x, y) and √|x −
    y|."""
    whole = math.pi if x > y else 2.0 * math.pi
    a = math.sqrt(max(x, y))
    if a < whole:
        return True
    b = math.sqrt(abs(x - y))
    for _ in range(_MEANS):
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return a < whole


@compiled
def _column(bend: Pose, beta: float, growth: float, cos: float, sin: float, by: Floats, c: int) -> None:
    """Write derivatives by a coordinate, from those of the pose, of β, and of log f."""
    fx, fy, x, y = by[0, 1], by[0, 2], by[0, 3], by[0, 4]
    by[c, 1], by[c, 2] = growth * fx - beta * fy, growth * fy + beta * fx
    by[c, 3], by[c, 4] = bend.u * cos - bend.v * sin - y * beta, bend.u * sin + bend.v * cos + x * beta
    by[c, 5] = beta


@compiled
def contact_state(z: Floats, i: int, beam: Beam, by: Floats) -> WholePose:
    """Write one contact, with the coordinates in row i of z, to `by`, shape (5, 6); NaN if there is none. Its rows are
    moment and force at the base, contact point, and direction β of the force; then their derivatives by each
    coordinate."""
    force, psi1, arclength, drive_angle = z[i, 0], z[i, 1], z[i, 2], z[i, 3]
    curvature, is_arc = beam.curvature, beam.varied is None
    half, load, is_straight = 0.5 * curvature * arclength, force * arclength * arclength, is_arc and curvature == 0.0
    possible = -0.5 * math.pi < psi1 < (0.5 if is_straight else 1.5) * math.pi and arclength > 0.0 and force > 0.0
    if possible and load < (MOST_LOAD if is_arc else _MOST_INTEGRATED) and half * half < MOST_LOAD:
        if is_arc:
            possible = _is_first(half * half + load * math.sin(0.25 * math.pi - 0.5 * psi1) ** 2, load)
        pose = whole_pose(beam, psi1, arclength, force)
        here, by_psi1, longer, by_force = pose
        if possible and (here.u >= beam.stem * math.cos(psi1 + here.turn) or not is_straight):
            beta = drive_angle - psi1 - here.turn
            cos, sin = math.cos(beta), math.sin(beta)
            x, y = here.u * cos - here.v * sin, here.u * sin + here.v * cos
            by[0, 0], by[0, 1], by[0, 2] = force * here.u, -force * sin, force * cos
            by[0, 3], by[0, 4], by[0, 5] = x, y, beta
            _column(by_force, -by_force.turn, 1.0 / force, cos, sin, by, 1)
            _column(by_psi1, -1.0 - by_psi1.turn, 0.0, cos, sin, by, 2)
            _column(longer, -longer.turn, 0.0, cos, sin, by, 3)
            by[1, 0], by[2, 0], by[3, 0] = here.u + force * by_force.u, force * by_psi1.u, force * longer.u
            by[4, 0], by[4, 1], by[4, 2], by[4, 3], by[4, 4], by[4, 5] = 0.0, -by[0, 2], by[0, 1], -y, x, 1.0
            return pose
    for c in range(5):
        for k in range(6):
            by[c, k] = math.nan
    return _NOWHERE


@compiled
def moved(
    z: Floats,
    i: int,
    pose: WholePose,
    by: Floats,
    angle: float,
    moment: float,
    fx: float,
    fy: float,
) -> tuple[float, float, float, float, float]:
    """Shift of the place and of ψ1, to first order, for changes of drive angle and loads: the derivatives of Step 2.
    With ψ0 = φ0 − β (equation 26 of Merker et al. 2018, doi 10.1155/2018/1613945) the changes of ψ0 and of the lever u
    = m0/f determine those of ψ1 and the arc length."""
    force = z[i, 0]
    here, by_psi1, longer, by_force = pose
    growth = (by[0, 1] * fx + by[0, 2] * fy) / (force * force)
    beta = (by[0, 1] * fy - by[0, 2] * fx) / (force * force)
    df, turning = growth * force, 1.0 + by_psi1.turn
    turned = angle - beta - by_force.turn * df
    levered = moment / force - here.u * growth - by_force.u * df
    det = turning * longer.u - longer.turn * by_psi1.u  # cos ψ1 in uniform rods
    shift = (turned * longer.u - longer.turn * levered) / det
    by_length = (turning * levered - by_psi1.u * turned) / det
    return (
        by[1, 3] * df + by[2, 3] * shift + by[3, 3] * by_length + by[4, 3] * angle,
        by[1, 4] * df + by[2, 4] * shift + by[3, 4] * by_length + by[4, 4] * angle,
        beta,
        by_length,
        shift,
    )


@cached
def write_contact_states(
    coordinates: Floats,
    delta: Floats,
    curvature: Floats,
    varied: Varied | None,
    stem: float,
    loads: Floats,
    place: Floats,
    volumes: Floats,
    loads_by: Floats,
    place_by: Floats,
    by: Floats,
) -> None:
    """Write loads, places and volumes of contacts as in `ContactStates`, NaN where there is none, and derivatives.
    Coordinates as in `contact_states`, `by` as in `contact_state`; `loads_by` and `place_by` as in
    `ContactStateSlopes`, or without rows."""
    for i in range(delta.size):
        _, by_psi1, longer, by_force = contact_state(coordinates, i, mirrored_by(curvature[i], varied, stem), by)
        for k in range(3):
            loads[k, i] = by[0, k]
        place[0, i], place[1, i], place[2, i], place[3, i] = by[0, 3], by[0, 4], by[0, 5] - delta[i], coordinates[i, 2]
        # In the frame of the force, which turns with the drive, the volume is an area of the plane of u and v.
        volumes[0, i] = abs(by_force.u * by_psi1.v - by_psi1.u * by_force.v)
        volumes[1, i] = abs(by_force.u * longer.v - longer.u * by_force.v)
        if loads_by.shape[0]:
            for c in range(4):
                for k in range(3):
                    loads_by[i, k, c], place_by[i, k, c] = by[c + 1, k], by[c + 1, k + 3]
                place_by[i, 3, c] = 1.0 if c == 2 else 0.0


@cached
def wrench_slopes(
    coordinates: Floats, curvature: Floats, varied: Varied | None, stem: float, by: Floats, out: Floats
) -> None:
    """Write the derivatives of places by drive angle and loads, shape (n, 4, 4)."""
    for i in range(coordinates.shape[0]):
        pose = contact_state(coordinates, i, mirrored_by(curvature[i], varied, stem), by)
        for c in range(4):
            errors = 1.0 * (c == 0), 1.0 * (c == 1), 1.0 * (c == 2), 1.0 * (c == 3)
            change = moved(coordinates, i, pose, by, *errors)
            for k in range(4):
                out[i, k, c] = change[k]
