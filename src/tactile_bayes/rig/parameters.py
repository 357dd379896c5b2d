"""The parameters of a rig: how far the rig on the table may be from what its data sheets state. One table: names,
meanings, units, bounds, default distributions, and when a record cannot show them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from tactile_bayes.mechanics.elastica import MAX_FRICTION_ANGLE
from tactile_bayes.mechanics.rods.profile import MOST_MODES, STEEPEST_TAPER

BASE = re.compile(r"base_(\d+)_([xy])")  # shift of a pivot of the record, counted from 1, along an axis
_DEGREE = float(np.radians(1.0))

_CHANNELS = ("moment", "force_x", "force_y")


# Powers of the units of moments, EI/L, or of forces, EI/L², and of lengths, in SI units.
_POWERS = {
    "N m": (1, 0),
    "N": (1, 0),
    "m": (0, 1),
    "1/m": (0, -1),
    "m/N": (-1, 2),
    "1/N/m": (-1, 0),
    "1/N²/m²": (-2, 0),
    "rad/(N m)": (-1, 0),
}


class Parameter(NamedTuple):
    """A parameter of a rig."""

    name: str
    meaning: str
    unit: str  # SI unit
    # Default distribution: about the stated value where there is one, else about `neutral`; that of what may vanish is
    # cut off at the bounds.
    default: Literal["normal", "log_normal", "half_normal", "log_uniform"]
    # Standard deviation, or that of the logarithm, or the scale of the default distribution, in units of the rod; of a
    # log-uniform one the smallest value.
    width: float
    neutral: float | None = 0.0  # value of a rig that is as stated; None if the rod or the load cell states it
    low: float = -np.inf
    high: float = np.inf
    hidden: str = ""  # when no record shows it, or which one does not

    @property
    def powers(self) -> tuple[int, int]:
        """Powers of the unit of moments (of forces in zeros of forces), and of that of lengths, in the unit."""
        return _POWERS.get(self.unit, (0, 0))


# Which records do not show some of them.
_NO_MOMENT = "without the moment"
_NO_TURN = "in sweeps of one direction, where drive_angle_offset has the same effect, and where the base is carried"
_BESIDE_GAINS = "beside the gains of all channels, which have the same effect"
_BESIDE_LEVER = "beside the lever where the base is only carried without turning"
_UNTRACED = "unless the rod was traced"
_UNMEASURED = "unless diameters were measured along the rod"
_NO_GAUGE = "unless the contour is that of a gauge"
_NO_NOISE, _NOISE = "unless the load cell states a noise", "where the load cell states its noise"

_MOST_FRICTION = float(np.tan(MAX_FRICTION_ANGLE))
_LEVER = "of the point to which the moment refers, from the pivot, in the cell's frame"
_SHAPE = "of the rest curvature, in standard deviations of its trace"


def _of_channels(what: str, meaning: str) -> Iterator[Parameter]:
    """Yield a change of the zero of each channel, in tenths of its unit."""
    for channel in _CHANNELS:
        unit = "N m" if channel == "moment" else "N"
        yield Parameter(f"{channel}_{what}", meaning.format(channel), unit, "normal", 0.1)


def _memory(what: str, meaning: str, unit: str, width: float) -> Iterator[Parameter]:
    """Yield a property of the memory of all channels, and that of each."""
    for prefix, of in (("", "all channels"), *((f"{channel}_", channel) for channel in _CHANNELS)):
        yield Parameter(f"{prefix}{what}", meaning.format(of), unit, "half_normal", width, None, 0.0)


_not_negative = partial(Parameter, low=0.0)
_ROWS = (
    _not_negative(
        "rigidity_scale", "flexural rigidity over the stated one", "1", "log_normal", 0.05, 1.0, hidden=_BESIDE_GAINS
    ),
    Parameter(
        "drive_angle_offset", "reading of the encoder less the angle", "rad", "normal", _DEGREE, 0.0, -np.pi, np.pi
    ),
    *_of_channels("bias", "reading of {} without load, in the middle of the record"),
    *(Parameter(f"lever_{axis}", f"{axis} {_LEVER}", "m", "normal", 0.005, hidden=_NO_MOMENT) for axis in "xy"),
    Parameter(
        "backlash",
        "reading of the encoder in forward motion less that in backward motion",
        "rad",
        "normal",
        0.2 * _DEGREE,
        0.0,
        -np.pi,
        np.pi,
        hidden=_NO_TURN,
    ),
    Parameter(
        "friction", "Coulomb's coefficient between rod and object", "1", "half_normal", 0.3, 0.0, 0.0, _MOST_FRICTION
    ),
    *_of_channels("drift", "change of the zero of {} from the first sample to the last, linear"),
    *(
        Parameter(f"{channel}_gain", f"reading of {channel} over the load", "1", "normal", 0.02, 1.0, 0.0)
        for channel in _CHANNELS
    ),
    *(
        Parameter(
            f"moment_curve_{what}", "curve of the moment's reading", unit, "normal", width, None, hidden=_NO_MOMENT
        )
        for what, unit, width in (("quadratic", "1/N/m", 0.05), ("cubic", "1/N²/m²", 0.02))
    ),
    *_memory("lag", "lag of first order of {}, in readings", "1", 1.0),
    *_memory("lag_seconds", "lag of first order of {}, where the record has times", "s", 0.2),
    *_memory("play", "hysteresis of {}: half the loop's width over the largest load", "1", 0.01),
    _not_negative(
        "suspension_compliance", "turn of the pivot per holding moment", "rad/(N m)", "half_normal", 0.05, 0.0
    ),
    _not_negative(
        "contact_compliance", "way of the object along its normal per normal force", "m/N", "half_normal", 0.003, 0.0
    ),
    Parameter("rest_curvature", "mean curvature of the unloaded rod", "1/m", "normal", 0.05, None),
    *(
        Parameter(f"rest_shape_{k}", f"amplitude of mode {k} {_SHAPE}", "1", "normal", 1.0, hidden=_UNTRACED)
        for k in range(1, MOST_MODES + 1)
    ),
    Parameter(
        "taper_error", "error of the measured taper, in its standard deviations", "1", "normal", 1.0, hidden=_UNMEASURED
    ),
    Parameter("taper", "part by which the diameter falls to the tip", "1", "normal", 0.05, None, 0.0, STEEPEST_TAPER),
    _not_negative(
        "stem", "rigid, straight piece between pivot and rod", "m", "normal", 0.02, None, hidden=_BESIDE_LEVER
    ),
    Parameter("length", "length of the rod", "m", "normal", 0.01, None, 0.0),
    *(
        Parameter(f"gauge_{a}", f"{a} of the gauge less the stated one", "m", "normal", 0.01, hidden=_NO_GAUGE)
        for a in "xy"
    ),
    _not_negative(
        "discrepancy_scale",
        "smooth deviation of readings in contact over the largest load of the sweep",
        "1",
        "log_normal",
        1.0,
        0.005,
    ),
    _not_negative(
        "discrepancy_length",
        "drive angle, or travel in rod lengths, over which it changes",
        "rad",
        "log_normal",
        0.5,
        0.3,
    ),
    _not_negative(
        "noise_scale", "noise over the one that the load cell states", "1", "log_normal", 0.5, 1.0, hidden=_NO_NOISE
    ),
    *(
        Parameter(f"{of}_noise", f"standard deviation of {what}", unit, "log_uniform", 1e-6, None, 0.0, hidden=_NOISE)
        for of, what, unit in (("moment", "the moment", "N m"), ("force", "each force", "N"))
    ),
)

# All parameters by name, except the shifts of pivots, of which there are as many as pivots.
PARAMETERS = {row.name: row for row in _ROWS}
# Values of parameters that change nothing, where there are such.
NEUTRAL = {name: row.neutral for name, row in PARAMETERS.items() if row.neutral is not None}
# Names that stand for several parameters; "base" stands for the shifts of all pivots but the first.
GROUPS = {
    **{what: tuple(f"{channel}_{what}" for channel in _CHANNELS) for what in ("bias", "drift", "gain")},
    "lever": ("lever_x", "lever_y"),
    "moment_curve": ("moment_curve_quadratic", "moment_curve_cubic"),
    "rest_shape": tuple(f"rest_shape_{k}" for k in range(1, MOST_MODES + 1)),
    "gauge": ("gauge_x", "gauge_y"),
    "discrepancy": ("discrepancy_scale", "discrepancy_length"),
}
# Ways in which what is not the rod yields.
COMPLIANCES = ("suspension_compliance", "contact_compliance")
# Parameters of the memory of a load cell, with those of each channel that go before, and all that replace what it
# states of itself.
MEMORY = {what: tuple(f"{channel}_{what}" for channel in _CHANNELS) for what in ("lag", "lag_seconds", "play")}
_OF_MEMORY = tuple(name for what, names in MEMORY.items() for name in (what, *names))
SENSOR = (*GROUPS["moment_curve"], *_OF_MEMORY)
# What is unknown of a real rig, unless it is said to be known.
STANDARD = (
    "rigidity_scale",
    "drive_angle_offset",
    "bias",
    "lever",
    "backlash",
    "friction",
    "rest_shape",
    "taper_error",
)
# Parameters that are zero or positive, and may be zero.
MAY_VANISH = ("friction", *COMPLIANCES, "taper", "stem", *_OF_MEMORY)


def parameter_named(name: str) -> Parameter | None:
    """Return the parameter of a name, also of the shift of a pivot; None if there is none."""
    shift = BASE.fullmatch(name)
    if shift is None:
        return PARAMETERS.get(name)
    meaning = f"{shift[2]} of pivot {shift[1]} less the recorded one"
    return Parameter(name, meaning, "m", "normal", 0.01, hidden="of the first pivot")


def members(name: str) -> Iterator[str]:
    """Yield the parameters that a name stands for."""
    yield from GROUPS.get(name, (name,))
