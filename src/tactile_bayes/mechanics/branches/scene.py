"""What an equilibrium depends on: contour, rod, rig, drive, and the phase of contact; and its coordinates."""

from __future__ import annotations

from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.line import Line, line_of, pivots
from tactile_bayes.mechanics.branches.outline import Outline
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.poses.beam import Beam, rubbed_otherwise


class Equilibrium(NamedTuple):
    """Coordinates of an equilibrium, or a direction in their space. What p and q are depends on the phase: see
    `phase`."""

    p: float
    q: float
    force: float


BY_P, BY_Q, BY_FORCE = Equilibrium(1.0, 0.0, 0.0), Equilibrium(0.0, 1.0, 0.0), Equilibrium(0.0, 0.0, 1.0)
NO_FORCE = Equilibrium(0.0, 0.0, 0.0)


class RigParameters(NamedTuple):
    """Parameters of the loads other than rod and contour."""

    # Angle from the contour's normal to the force of a contact that slides, ± arctan μ [rad]: > 0 where it slides to
    # lesser parameters. Of one that sticks, that of the last that slid.
    friction_angle: float
    compliance: float  # turn of the pivot's suspension per holding moment, c in (drive angle) = φ0 + c m0 [rad/(EI/L)]
    yielding: float  # way of the object along its normal per normal force [L/(EI/L²)]
    offset: float  # encoder offset in the sweep frame [rad]
    sign: float  # −1 in backward sweeps, else 1
    moment_unit: float
    force_unit: float  # EI/L and EI/L² of the rod, in the units of loads


class StuckContact(NamedTuple):
    """A contact of object and rod that does not slip."""

    p: float  # parameter of the contour
    arclength: float


NOWHERE = StuckContact(0.0, 0.0)


class Scene(NamedTuple):
    """All that an equilibrium depends on: one contour in the sweep frame, the rod, the rig, and the phase."""

    outline: Outline
    beam: Beam
    rig: RigParameters
    line: Line  # drive that carries the base, which is at the origin at its beginning; or a rotation
    phase: int
    anchor: StuckContact  # where it sticks, if it does


@compiled
def in_phase(scene: Scene, phase: int) -> Scene:
    """Scene in a phase of contact."""
    return Scene(scene.outline, scene.beam, scene.rig, scene.line, phase, scene.anchor)


@compiled
def anchored(scene: Scene, anchor: StuckContact) -> Scene:
    """Scene with another place where it sticks."""
    return Scene(scene.outline, scene.beam, scene.rig, scene.line, scene.phase, anchor)


@compiled
def on_line(scene: Scene, lines: Floats, k: int) -> Scene:
    """Scene with another line of the drive, if lines carry the base."""
    if pivots(lines):
        return scene
    return Scene(scene.outline, scene.beam, scene.rig, line_of(lines, k), scene.phase, scene.anchor)


@compiled
def with_friction(scene: Scene, angle: float) -> Scene:
    """Scene with friction of an angle, which acts in either sense."""
    own, compliance, yielding, offset, sign, moment_unit, force_unit = scene.rig
    rig = RigParameters(angle, compliance, yielding, offset, sign, moment_unit, force_unit)
    beam = scene.beam if angle == own else rubbed_otherwise(scene.beam)
    return Scene(scene.outline, beam, rig, scene.line, scene.phase, scene.anchor)


@compiled
def cross(a: Equilibrium, b: Equilibrium) -> Equilibrium:
    return Equilibrium(a.q * b.force - a.force * b.q, a.force * b.p - a.p * b.force, a.p * b.q - a.q * b.p)


@compiled
def dot(a: Equilibrium, b: Equilibrium) -> float:
    return a.p * b.p + a.q * b.q + a.force * b.force


@compiled
def less(a: Equilibrium, b: Equilibrium) -> Equilibrium:
    """Difference a − b."""
    return Equilibrium(a.p - b.p, a.q - b.q, a.force - b.force)


@compiled
def times(factor: float, a: Equilibrium) -> Equilibrium:
    return Equilibrium(factor * a.p, factor * a.q, factor * a.force)
