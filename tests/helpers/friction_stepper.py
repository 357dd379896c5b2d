"""A rod with Coulomb friction, step by step, along any drive.

Each step of the drive is one implicit step: the same motion is tried first, then sticking, then slip either way, and
what obeys all inequalities (cone, sense of slip, s1 ≤ 1, tip outside, F presses) is the next state. A step without such
a state nearby is parted; when it has become too small for that, the rod has lost its contact. Nothing looks for events
except the first touch of the unloaded rod. Signs are those of a record.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from helpers.friction_contact import Flexible, Oval, Parabola, State, Stepper

# Largest change of slopes [rad] and of s1 in a step: absolute, and over the root of the step's share of the travel, as
# before a fold.
_NEAR, _STEEP = 0.2, 3.0
# Share of the travel down to which a step is parted in which the contact changes: so exact are events, and the place
# where slip ends within a step.
_RESOLUTION = 1e-5
_FINEST = 1e-8  # smallest step, as a share of the travel
_FIRST = 30.0  # size of the first step in contact over the resolution: slip grows with the square of the travel there
_UNLOADED = 1e-3  # force below which contact that is lost was released, without a jump
_SHARE = 1e-9  # share of the samples' spacing that is rounding
_INSIDE = -1e-7  # clearance below which a rod lies in the object
_MODES = {0: "stick", 1: "slip+", -1: "slip-"}
_NOTHING = {"kind": "none", "mode": "none", "holding_moment": 0.0, "force": 0.0, "force_x": 0.0, "force_y": 0.0}
_NOTHING |= dict.fromkeys(("slope_angle", "force_angle", "contact_x", "contact_y", "contact_arclength"), math.nan)


class Drive:
    """Straight lines from pose to pose of the base, over the distance moved, or the turn if it does not move."""

    def __init__(self, poses: Any):
        self.poses = np.asarray(poses, dtype=float)
        steps = np.diff(self.poses, axis=0)
        ways = np.hypot(steps[:, 0], steps[:, 1])
        self.knots = np.append(0.0, np.cumsum(ways if ways.any() else np.abs(steps[:, 2])))
        self.travel = float(self.knots[-1])

    def pose(self, t: float) -> np.ndarray:
        return np.array([np.interp(t, self.knots, column) for column in self.poses.T])


@dataclass
class History:
    """Columns by name at the samples of a drive, and what happened as (travel, word) in order."""

    columns: dict[str, np.ndarray]
    events: list[tuple[float, str]]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    @property
    def imbalance(self) -> np.ndarray:
        """Work of the drive that is neither stored, dissipated nor lost in jumps."""
        return self["work"] - self["stored"] - self["dissipated"] - self["lost"]


@dataclass
class _Run:
    """A rod on its way along a drive."""

    stepper: Stepper
    drive: Drive
    t: float = 0.0
    state: State | None = None
    work: float = 0.0
    dissipated: float = 0.0
    lost: float = 0.0
    ended: bool = False
    events: list[tuple[float, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.part = self.drive.travel

    def say(self, word: str, *, last: bool = False) -> None:
        self.events.append((self.t, word))
        self.ended = last

    def touch(self, target: float) -> None:
        """Go on without contact to the next touch, or to `target`."""
        touch = self.stepper.first_touch(self.drive.pose, self.t, target)
        self.t, self.state = (target, None) if touch is None else touch
        if self.state is not None:
            self.say(f"touch {self.state.kind}")
            if self.stepper.clearance(None, self.drive.pose(self.t)) < _INSIDE:
                self.say("blocked", last=True)

    def step(self, target: float) -> None:
        """Go on in contact by one step, at most to `target`, or part the step."""
        state, part = self.state, min(self.part, target - self.t)
        near = min(_NEAR, _STEEP * math.sqrt(part / self.drive.travel))
        new = self.stepper.next_state(state, self.drive.pose(self.t + part), near)
        if new is None:
            self.part = 0.25 * part
            if self.part < _FINEST * self.drive.travel:
                self.lose()
            return
        changed = (new.kind, new.mode) != (state.kind, state.mode)
        if changed and part > _RESOLUTION * self.drive.travel * (1.0 if state.loaded else _FIRST):
            self.part = 0.25 * part
            return
        if changed or not state.loaded:
            self.say(f"{new.kind} {_MODES[new.mode]}")
        self.accept(new, self.t + part if part < target - self.t else target)
        self.part = 4.0 * part

    def accept(self, new: State, t: float) -> None:
        """Take a state as the next one, with the energies by the trapezoidal rule."""
        old = self.state
        mean = 0.5 * np.array([old.fx + new.fx, old.fy + new.fy, old.moment + new.moment])
        self.work -= float(mean @ (new.pose - old.pose))
        rubbed = 0.5 * (self.stepper.pressed(old)[1] + self.stepper.pressed(new)[1])
        self.dissipated -= rubbed * (new.slip - old.slip)
        self.t, self.state = t, new
        if abs(self.stepper.contour.at(new.p).alpha) >= 0.5 * math.pi:
            self.say("end of the contour", last=True)
        elif self.stepper.clearance(new, new.pose) < _INSIDE:
            self.say("touches twice", last=True)

    def lose(self) -> None:
        """Go on without contact, if the rod had any load."""
        state = self.state
        if not state.loaded:
            self.say("jammed", last=True)
            return
        self.say("release" if math.hypot(state.fx, state.fy) < _UNLOADED else "snap-off")
        self.lost += state.stored
        self.state, self.part = None, self.drive.travel

    def sample(self) -> dict[str, Any]:
        """A row of the history."""
        state, pose = self.state, self.drive.pose(self.t)
        row = {"travel": self.t, "base_x": pose[0], "base_y": pose[1], "drive_angle": pose[2], **_NOTHING}
        row |= {"stored": 0.0, "work": self.work, "dissipated": self.dissipated, "lost": self.lost}
        row["clearance"] = self.stepper.clearance(state, pose)
        if state is not None:
            at = self.stepper.contour.at(state.p)
            row |= {"kind": state.kind, "mode": _MODES[state.mode], "contact_arclength": state.s1}
            row |= {"slope_angle": at.alpha, "contact_x": at.x, "contact_y": at.y, "stored": state.stored}
            row |= {"force": math.hypot(state.fx, state.fy), "force_angle": math.atan2(state.fx, -state.fy)}
            row |= {"holding_moment": -state.moment, "force_x": -state.fx, "force_y": -state.fy}
        return row


def step_through(case: dict[str, Any]) -> History:
    """History of a case: a dict of `rod`, `contour`, `friction`, `poses` (n, 3) and `step`, the samples' spacing."""
    drive = Drive(case["poses"])
    stepper = Stepper(Flexible(**case["rod"]), contour_of(case["contour"]), case["friction"])
    run, rows = _Run(stepper, drive), []
    samples = case["step"] * np.arange(math.floor(drive.travel / case["step"] + _SHARE) + 1)
    apart = np.abs(samples - drive.knots[:, None]).min(axis=1) > _SHARE * case["step"]
    samples = np.minimum(samples, drive.travel)
    for target in np.union1d(samples, drive.knots[apart]).tolist():
        while run.t < target and not run.ended:
            run.touch(target) if run.state is None else run.step(target)
        if run.ended:
            break
        if target in samples:
            rows.append(run.sample())
    return History({name: np.array([row[name] for row in rows]) for name in rows[0]}, run.events)


def contour_of(description: dict[str, Any]) -> Any:
    """The contour of a description: its family and the family's parameters by name."""
    family, values = description["family"], {k: v for k, v in description.items() if k != "family"}
    if family == "circle":
        radius = values.pop("r")
        values |= {"a": radius, "b": radius}
    return Parabola(**values) if family == "parabola" else Oval(**values)
