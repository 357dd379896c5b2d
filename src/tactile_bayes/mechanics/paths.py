"""Equilibrium paths of a batch of contours, from first contact to snap-off, for arrays.

Quantities are in rod lengths, EI/L and EI/L², and in the sweep frame: `SweepFrame` mirrors backward sweeps to forward
ones. Compiled code (`continuation`) follows the paths one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.mechanics.branches.line import NO_LINES
from tactile_bayes.mechanics.branches.readings import STATE_COLUMNS
from tactile_bayes.mechanics.branches.sweeps import Segments, Shapes, Solutions, Sweeps, shapes_of, solve_sweeps
from tactile_bayes.mechanics.elastica import Wrench
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.mechanics.rods.profile import MOST_MODES, Profile

# What paths have of their solutions as it is.
_AS_SOLVED = (
    *("reach", "distance", "first_angle", "first_parameter", "snap_angle", "snap_parameter", "snap_off", "phases"),
    "clear_angle",
)


class States(NamedTuple):
    """States on paths."""

    parameter: Floats  # parameter of the contour in the sweep frame
    x: Floats
    y: Floats  # contact point on the object
    slope_angle: Floats
    wrench: Wrench

    def take(self, *where: Index) -> States:
        """Return the states at indices, one for each axis."""
        wrench: list[Any] = [column[where] for column in self.wrench]
        return States(self.parameter[where], self.x[where], self.y[where], self.slope_angle[where], Wrench(*wrench))


class ContactMode(NamedTuple):
    """How rod and object touch along a part of a path."""

    tip: bool  # true if the tip touches, else the rod
    sticks: bool
    # True if it slips along the contour to the right; of one that sticks it is not defined, nor without friction.
    to_right: bool


@dataclass(frozen=True)
class Paths:
    """Paths of a batch of n contours; see `trace`. Arrays have the shape (n,) unless stated otherwise. `reach` says
    which contours have a path; for the others angles are NaN and loads zero."""

    sweep_frame: SweepFrame
    reach: NDArray[np.int8]
    distance: Floats  # least distance of the contour from the pivot [L]
    first_angle: Floats  # drive angle of first contact [rad]
    first_parameter: Floats
    snap_angle: Floats  # drive angle of snap-off [rad]
    snap_parameter: Floats
    snap_off: NDArray[np.int8]
    # States where phases begin, and at the end of the last, with the columns of `STATE`, shape (n, phases + 1,
    # columns); zero beyond.
    events: Floats
    phases: Index  # number of phases
    largest_curvature: Floats  # largest curvature of the rod up to snap-off [1/L], with a relative error of 1e-4
    # Drive angle beyond which the unloaded rod has passed the contour, as far as that is known [rad]. If the base is
    # carried, the travel from snap-off on at which the unloaded rod lies in the object [L]; −∞ if it does so nowhere.
    clear_angle: Floats
    tolerance: Floats | None
    shapes: Shapes
    sweeps: Sweeps
    profile: Profile | None
    # Lines of drives that carry the base, as in `Segments`, shape (1 or n, lines, columns). All drive angles here are
    # then travels, in rod lengths.
    lines: Floats | None
    sampled: Floats  # states at the drive angles given to `trace`, shape (n, k, columns)

    def is_clear(self) -> Flags:
        """Return whether the unloaded rod is clear of the object after snap-off, as far as known; shape (n,). A drive
        that carries the base does not bring it to the object again either."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.snap_angle > self.clear_angle)

    def drive_angles_at(self, travels: Floats) -> Floats:
        """Drive angles at travels in the sweep frame [rad], shape (n,): the travels themselves in rotations."""
        if self.lines is None:
            return travels
        lines = np.broadcast_to(self.lines, (self.sweep_frame.size, *self.lines.shape[1:]))
        with np.errstate(invalid="ignore"):
            line = np.maximum(np.count_nonzero(lines[..., 6] <= travels[:, None], axis=1) - 1, 0)
        at = lines[np.arange(len(lines)), line]
        return np.asarray(at[:, 2] + (travels - at[:, 6]) * at[:, 5])

    def observables(self, drive_angles: Floats) -> Floats:
        """Holding moment [EI/L] and forces [EI/L²] in the laboratory frame, shape (n, k, 3); zero out of contact. They
        are interpolated at drive angles in the sweep frame [rad], shape (k,) or (n, k), with an error of some 1e-8 of
        the largest."""
        sign = np.where(self.sweep_frame.mirrored[:, None, None], [-1.0, -1.0, 1.0], 1.0)
        return np.asarray(sign * self._swept(drive_angles).loads)

    def _swept(self, drive_angles: Floats, states: bool = False) -> Solutions:
        of_rod: dict[str, Any] = {"profile": self.profile, "tolerance": self.tolerance}
        return _swept(self.shapes, self.sweeps, drive_angles, self.lines, states=states, **of_rod)

    def states(self, index: Index, drive_angles: Floats) -> States:
        """Exact states at drive angles, shape (k,), of contours, shape (k,); NaN and `NONE` out of contact."""
        angles = np.asarray(drive_angles, dtype=float)
        count = np.bincount(index, minlength=self.sweep_frame.size)
        order = np.argsort(index, kind="stable")
        rank = np.empty(index.size, dtype=np.intp)
        rank[order] = np.arange(index.size) - (np.cumsum(count) - count)[index[order]]
        by_contour = np.full((self.sweep_frame.size, int(count.max(initial=0))), np.nan)
        by_contour[index, rank] = angles
        found = self._swept(by_contour, states=True)
        return _as_states(found.states[index, rank])

    def loaded_states(self) -> tuple[Index, Index, States]:
        """Indices of contour and sample, and states, shape (m,), in contact at the drive angles given to `trace`."""
        index, sample = np.nonzero(self.sampled[..., 0] != NONE)
        return index, sample, _as_states(self.sampled[index, sample])

    def sampled_states(self, index: Index, sample: Index | slice = slice(None)) -> States:
        """States of contours at the drive angles given to `trace`, shape (*index.shape, k), or at one of them each,
        shape (*index.shape,); NaN out of contact."""
        return _as_states(self.sampled[index, sample])

    def modes(self) -> list[list[ContactMode]]:
        """Return how each path touches, one after the other."""
        column = {name: self.events[..., k] for k, name in enumerate(STATE_COLUMNS)}
        to_right = (column["friction_angle"] < 0.0) != self.sweep_frame.mirrored[:, None]
        found = zip(column["phase"] == TIP, column["sticks"] > 0.0, to_right, self.phases, strict=True)
        return [
            [ContactMode(*map(bool, one)) for one in zip(tip[:n], sticks[:n], right[:n], strict=True)]
            for tip, sticks, right, n in found
        ]

    def event_states(self) -> States:
        """Exact states at first contact, at the changes of the phase and at snap-off, shape (n, phases + 1). Those of a
        path are its first `phases + 1`; the others are NaN."""
        return _as_states(self.events)

    def event_travels(self) -> Floats:
        """Travels at the events of `event_states`: drive angles [rad], or ways of the base [L]."""
        return np.where(self.events[..., 0] == NONE, np.nan, self.events[..., STATE_COLUMNS.index("travel")])


def trace(
    sweep_frame: SweepFrame,
    *,
    friction_angle: ArrayLike = 0.0,
    suspension_compliance: ArrayLike = 0.0,
    contact_compliance: ArrayLike = 0.0,
    profile: Profile | None = None,
    tolerance: Floats | None = None,
    drive_angles: Floats | None = None,
    relative: bool = False,
    polished: bool = True,
    lines: Floats | None = None,
) -> Paths:
    """Follow the equilibria of every contour from first contact to snap-off.

    Friction and compliances are as in `RigParameters`, of each contour or all; profile, tolerance and `polished` as in
    `solve_sweeps`. States are at drive angles in the sweep frame, shape (k,) or (n, k), or if these are `relative` at
    shares of them from first contact to snap-off; with lines as in `Segments`, one or n drives, at travels [L].
    """
    sweeps = _sweeps_of(sweep_frame, friction_angle, suspension_compliance, contact_compliance)
    shapes = shapes_of(sweep_frame.contour, *(sweep_frame.own_domain() if sweep_frame.contour.halves is None else ()))
    angles = np.empty(0) if drive_angles is None else drive_angles
    options: dict[str, Any] = {"profile": profile, "tolerance": tolerance}
    solutions = _swept(shapes, sweeps, angles, lines, relative, states=True, polished=polished, **options)
    most = int(solutions.phases.max(initial=0))
    has_path = solutions.phases[:, None, None] > 0
    return Paths(
        sweep_frame=sweep_frame,
        events=np.where(has_path, solutions.event_states[:, : most + 1], 0.0),
        largest_curvature=solutions.curvature,
        tolerance=tolerance,
        shapes=shapes,
        sweeps=sweeps,
        profile=profile,
        lines=lines,
        sampled=solutions.states,
        **{name: getattr(solutions, name) for name in _AS_SOLVED},
    )


def _sweeps_of(
    sweep_frame: SweepFrame, friction_angle: ArrayLike, compliance: ArrayLike, yielding: ArrayLike
) -> Sweeps:
    """One sweep along each contour, with loads in EI/L and EI/L²."""
    count, every = sweep_frame.size, np.arange(sweep_frame.size)
    values = {name: getattr(sweep_frame, name) for name in ("base_x", "base_y", "length", "standoff", "taper", "stem")}
    values |= {"rest_curvature": sweep_frame.rest_curvature, "friction_angle": friction_angle, "compliance": compliance}
    values |= {"yielding": yielding, "offset": 0.0, "rigidity": 1.0, "relative_length": 1.0}
    each: dict[str, Any] = {name: np.array(np.broadcast_to(of, (count,)), dtype=float) for name, of in values.items()}
    each["rest_shape"] = np.array(np.broadcast_to(sweep_frame.rest_shape, (count, MOST_MODES)), dtype=float)
    return Sweeps(contour=every, segment=every, backward=np.ascontiguousarray(sweep_frame.mirrored), **each)


def _swept(
    shapes: Shapes,
    sweeps: Sweeps,
    drive_angles: Floats,
    lines: Floats | None = None,
    relative: bool = False,
    **options: Any,
) -> Solutions:
    """Solutions at drive angles in the sweep frame, shape (k,) for all or (n, k)."""
    angles = np.atleast_2d(np.asarray(drive_angles, dtype=float))
    if lines is not None:
        angles = np.broadcast_to(angles, (max(angles.shape[0], lines.shape[0]), angles.shape[1]))
        lines = np.broadcast_to(lines, (angles.shape[0], *lines.shape[1:])).copy()
    order = np.argsort(angles, axis=1, kind="stable")
    segments, each = angles.shape
    sweeps = sweeps._replace(segment=sweeps.contour % segments)
    sorted_angles = np.take_along_axis(angles, order, axis=1)
    lines = NO_LINES if lines is None else lines
    asked = Segments(each * np.arange(segments + 1), order.ravel(), sorted_angles.ravel(), lines, relative)
    return solve_sweeps(shapes, sweeps, asked, (sweeps.contour.size, each), **options)


def _as_states(columns: Floats) -> States:
    """States from their columns, shape (..., columns); NaN where there is none."""
    phase = columns[..., 0].astype(np.int8)
    found = np.where((phase == NONE)[..., None], np.nan, columns)
    parameter, x, y, alpha, drive_angle, moment, force_x, force_y, arclength, tip_angle, *_ = np.moveaxis(
        found[..., 1:], -1, 0
    ).copy()
    unknown, lying = np.full(phase.shape, np.nan), np.where(phase == TANGENTIAL, arclength, np.nan)
    wrench = Wrench(drive_angle, moment, force_x, force_y, arclength, tip_angle, phase, unknown, unknown, lying)
    return States(parameter, x, y, alpha, wrench)
