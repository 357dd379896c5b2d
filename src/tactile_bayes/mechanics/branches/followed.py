"""Legs that have been followed, kept until the end of a path is known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.branches.curves import ANGLE, Accuracy, Course
from tactile_bayes.mechanics.branches.equilibrium import Equilibrium, Scene, in_phase, on_line
from tactile_bayes.mechanics.branches.leg import Leg, LegCurves
from tactile_bayes.mechanics.branches.readings import Asked, Followed
from tactile_bayes.mechanics.branches.series import copy_rows, value
from tactile_bayes.mechanics.compiler import compiled

__all__ = ["Legs", "legs_for", "recall", "store"]


class Legs(NamedTuple):
    """Legs, one in each row."""

    phase: Index
    line: Index
    """Number of the line of the drive."""
    begin: Floats
    along: Floats
    normal: Floats
    """As in `Leg`, shape (legs, 3)."""
    course: Floats
    """As in `Course`, shape (legs, 4)."""
    series: Floats
    """As in `Curves`, shape (legs, 6, order)."""
    place: Floats
    """As in `LegCurves`, shape (legs, order)."""


def legs_for(legs: int, order: int) -> Legs:
    """Room for at most so many legs, with series of so many terms."""
    phase, line = np.empty((2, legs), dtype=np.intp)
    begin, along, normal = np.empty((3, legs, 3))
    return Legs(
        phase, line, begin, along, normal, np.empty((legs, 4)), np.empty((legs, 6, order)), np.empty((legs, order))
    )


@compiled
def store(phase: int, line: int, leg: Leg, course: Course, work: LegCurves, legs: Legs, k: int) -> None:
    """Keep a leg as number k."""
    legs.phase[k], legs.line[k] = phase, line
    for c in range(3):
        legs.begin[k, c], legs.along[k, c], legs.normal[k, c] = leg.begin[c], leg.along[c], leg.normal[c]
    for c in range(4):
        legs.course[k, c] = course[c]
    copy_rows(work.curves.series, legs.series[k])
    for i in range(work.place.size):
        legs.place[k, i] = work.place[i]


@compiled
def recall(
    scene: Scene, lines: Floats | None, accuracy: Accuracy, work: LegCurves, workspace: Asked, legs: Legs, k: int
) -> Followed:
    """Leg number k, with its series in the workspace."""
    curves, course = work.curves, legs.course[k]
    copy_rows(legs.series[k], curves.series)
    for i in range(work.place.size):
        work.place[i] = legs.place[k, i]
        curves.values[ANGLE, i] = value(curves.series[ANGLE], curves.on.nodes[i])
    leg = Leg(_equilibrium(legs.begin[k]), _equilibrium(legs.along[k]), _equilibrium(legs.normal[k]))
    there = on_line(in_phase(scene, legs.phase[k]), lines, legs.line[k])
    return Followed(there, leg, accuracy, Course(course[0], course[1], course[2], course[3]), work, workspace)


@compiled
def _equilibrium(row: Floats) -> Equilibrium:
    return Equilibrium(row[0], row[1], row[2])
