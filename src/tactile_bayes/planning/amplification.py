"""Amplification of errors of the sensor to errors of a contact point, along a sweep."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.contacts.contact_coordinates import (
    ARCLENGTH,
    DRIVE_ANGLE,
    FORCE,
    PSI1,
    contact_states_and_slopes,
    place_by_wrench,
)
from tactile_bayes.mechanics.rods.profile import Rods
from tactile_bayes.mechanics.rods.surface import Surface
from tactile_bayes.planning.plan import SAMPLE_COLUMNS, Plan
from tactile_bayes.record import CHANNELS, COLUMNS, carried_sweeps, loads_of, travel_unit, travels_of
from tactile_bayes.record.frame import to_fixed_axes
from tactile_bayes.rig.stated import cell_with
from tactile_bayes.sweep import Rotation

Method = Literal["raw", "constrained"]
METHODS: tuple[Method, ...] = ("raw", "constrained")
SOURCES = (*CHANNELS, "drive_angle")

_TRUTHS = ("contact_x", "contact_y", "slope_angle", "contact_phase")

# Default distances of samples from first contact and from snap-off, over the sweep's length.
_NEAR = np.geomspace(1e-5, 0.5, 41)
_EVENLY = 60  # default number of further samples, evenly over the sweep's length
# Distances from an event between which errors follow a power of the distance, over the sweep's length.
_POWER_LAW = (1e-5, 1e-3)
# Free contact coordinates, in tip contact (True) and in tangential contact (False).
_FREE = {True: (FORCE, PSI1), False: (FORCE, ARCLENGTH)}


class _Forward(NamedTuple):
    """Contacts of a sweep in the sweep frame, dimensionless."""

    side: Floats  # 1 for forward and −1 for backward samples, shape (n,)
    coordinates: Floats  # force, ψ1, arc length and drive angle, shape (n, 4)
    tip: Flags  # true in tip contact, shape (n,)
    slope_angle: Floats  # slope angle of the contour at the contact [rad], shape (n,)
    from_readings: Floats  # derivatives of the loads by the three readings, shape (n, 3, 3)
    # Derivatives of the loads by the drive angle, for a load cell that turns with the drive, shape (n, 3).
    leaning: Floats
    covariance: Floats  # covariance of the readings, shape (n, 3, 3)
    rods: Rods  # their rods in the sweep frame

    def take(self, where: Index) -> _Forward:
        """Return some of the contacts."""
        return _Forward._make(c.take(where) if isinstance(c, Rods) else c[where] for c in self)


def amplification(plan: Plan) -> xr.Dataset:
    """Return the errors of contact points due to errors of the sensor, to first order, in closed form.

    The constrained estimate is the weighted least-squares solution on the surface of possible contacts.
    """
    return contact_errors(_refined(plan))


def contact_errors(plan: Plan) -> xr.Dataset:
    """Return the errors of `amplification` at the loaded samples of the plan's own record."""
    for name, what in (("suspension_compliance", "a pivot"), ("contact_compliance", "an object")):
        if plan.rig.known.get(name):
            raise ParameterError(f"{name} is known, and amplification is of {what} that does not yield: leave it out")
    record, rod = plan.scan.record, plan.rig.known_rod
    loaded = np.flatnonzero(record.truth_contact_phase.values != "none")
    chosen = record.isel(sample=loaded)
    contacts, delta = _forward(plan, record, loaded), float(np.arctan(plan.friction))
    of_angle = plan.cell.drive_angle_deviation
    gains = (_raw(contacts), _constrained(contacts, delta, of_angle))
    both = [_gains_along_and_across(contacts, gain, rod.surface) for gain in gains]
    deviations = [[_deviation(gain, contacts, of_angle) for gain in of_method] for of_method in both]
    # Readings are in the units of the record, not in EI/L or EI/L².
    per_unit = rod.length / np.array([*rod.load_units, 1.0])
    distances = event_distances(plan, chosen.sweep.values, travels_of(record)[loaded])
    unit = {"units": COLUMNS["base_x"].unit_in(record.attrs["units"])}
    dims, of_segments = ("reconstruction", "sample"), ("reconstruction", "segment", "event")
    gain, sd = np.array(both) * per_unit, np.array(deviations) * rod.length
    sweeps = [chosen.sweep.values == k for k in range(len(plan.scan.sweeps))]
    variables: dict[str, Any] = {}
    for k, way in enumerate(("along", "across")):
        variables[f"gain_{way}"] = ((*dims, "source"), gain[:, k])
        variables[f"sd_{way}"] = (dims, sd[:, k], unit)
        growth = [[[_growth(one[of], far[of]) for far in distances.values()] for of in sweeps] for one in sd[:, k]]
        variables[f"growth_{way}"] = (of_segments, np.array(growth))
    holds = [plan.reconstruct(plan.record, method).status.values[loaded] == "ok" for method in METHODS]
    return xr.Dataset(
        {
            **chosen[SAMPLE_COLUMNS].data_vars,
            **{name: chosen[f"truth_{name}"] for name in _TRUTHS},
            **{name: ("sample", far, {"units": travel_unit(record)}) for name, far in distances.items()},
            **variables,
            "holds": (dims, np.array(holds)),
        },
        coords={
            "reconstruction": list(METHODS),
            "source": list(SOURCES),
            "event": ["first contact", "snap-off"],
            "segment": [f"{sweep.direction} from ({sweep.base[0]:g}, {sweep.base[1]:g})" for sweep in plan.scan.sweeps],
        },
    )


def _refined(plan: Plan) -> Plan:
    """Return the plan with drive angles that are dense near first contact and snap-off.

    It is unchanged without rotations, or if one has drive angles of its own.
    """
    if any(isinstance(drive, Rotation) and drive.drive_angles is not None for drive in plan.drives):
        return plan
    shares = np.concatenate([_NEAR, 1.0 - _NEAR, even_shares(_EVENLY)])
    turned = set(range(len(plan.scan.sweeps))) - set(carried_sweeps(plan.scan.record))
    return plan.at_angles(np.concatenate([angles_within(plan, k, shares) for k in turned])) if turned else plan


def even_shares(count: int) -> Floats:
    """Return the middles of equal parts of the interval from 0 to 1."""
    return (np.arange(count) + 0.5) / count


def angles_within(plan: Plan, sweep: int, shares: Floats) -> Floats:
    """Return drive angles at shares of the way from first contact to snap-off of a sweep."""
    one = plan.scan.sweeps[sweep]
    first, snap = one.first_contact.drive_angle, one.snap_off.drive_angle
    return np.asarray(first + (snap - first) * shares)


def _forward(plan: Plan, record: xr.Dataset, chosen: Index) -> _Forward:
    """Return some contacts of a record in the sweep frame."""
    rod = plan.rig.known_rod
    cell = cell_with(plan.cell, plan.rig.known).dimensionless(rod)
    units = rod.load_units
    loads = loads_of(record) / units
    angle = record.drive_angle.values
    turn, leaning = np.broadcast_to(np.eye(3), (angle.size, 3, 3)), np.zeros_like(loads)
    in_cell = loads
    if cell.frame == "turning":
        leaning[:, 1], leaning[:, 2] = -loads[:, 2], loads[:, 1]
        turn = to_fixed_axes(angle)
        in_cell = np.einsum("nji,nj->ni", turn, loads)
    side = np.where(record.direction.values == "forward", 1.0, -1.0)
    signs = np.where(side[:, None] < 0.0, [-1.0, -1.0, 1.0], 1.0)
    from_readings = signs[:, :, None] * turn @ np.linalg.inv(cell.slopes(in_cell))
    slope = side * record.truth_slope_angle.values
    tip_angle = np.where(side < 0.0, np.pi - record.truth_tip_angle.values, record.truth_tip_angle.values)
    tip = record.truth_contact_phase.values == "tip"
    delta = float(np.arctan(plan.friction))
    coordinates = np.stack(
        [
            np.hypot(loads[:, 1], loads[:, 2]),
            np.where(tip, tip_angle - slope - delta, -rod.surface.friction_angle(delta)),
            np.where(tip, 1.0, record.truth_contact_arclength.values / rod.length),
            np.where(side < 0.0, np.pi - angle, angle),
        ],
        axis=-1,
    )
    leaning = side[:, None] * signs * leaning
    whole = _Forward(
        side, coordinates, tip, slope, from_readings, leaning, cell.covariance(in_cell), rod.mirrored(side)
    )
    return whole.take(chosen)


def _raw(contacts: _Forward) -> Floats:
    """Return derivatives of (x, y, slope angle, arc length) by the four readings, of raw Step 2, shape (n, 4, 4)."""
    by_angle_and_loads = place_by_wrench(contacts.coordinates, contacts.rods)
    by_loads = by_angle_and_loads[:, :, 1:]
    by_angle = by_angle_and_loads[:, :, :1] + by_loads @ contacts.leaning[:, :, None]
    return np.concatenate([by_loads @ contacts.from_readings, by_angle * contacts.side[:, None, None]], axis=2)


def _constrained(contacts: _Forward, delta: float, angle_deviation: float) -> Floats:
    """Return the same derivatives of the most likely contact on the surface of its phase, shape (n, 4, 4)."""
    _, slopes = contact_states_and_slopes(contacts.coordinates, delta, contacts.rods)
    from_readings = contacts.from_readings
    covariance = from_readings @ contacts.covariance @ np.swapaxes(from_readings, 1, 2)
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    gains = np.empty((contacts.tip.size, 4, 4))
    for tip, free in _FREE.items():
        here = np.flatnonzero(contacts.tip == tip)
        loads, place, white = slopes.loads[here], slopes.place[here], whiten[here]
        by_angle = loads[:, :, DRIVE_ANGLE] - contacts.leaning[here]
        known = np.concatenate([white @ loads[:, :, free], white @ by_angle[:, :, None]], axis=2)
        errors = np.concatenate([white @ from_readings[here], np.zeros((here.size, 3, 1))], axis=2)
        if angle_deviation:
            # The drive angle is an additional reading and an additional unknown.
            last = np.zeros((here.size, 1, 3))
            last[:, 0, 2] = 1.0 / angle_deviation
            found = np.linalg.pinv(np.concatenate([known, last], axis=1))
            errors = np.concatenate([errors, np.zeros((here.size, 1, 4))], axis=1)
            errors[:, 3, 3] = contacts.side[here] / angle_deviation
            gains[here] = place[:, :, [*free, DRIVE_ANGLE]] @ found @ errors
        else:
            errors[:, :, 3] = -known[:, :, 2] * contacts.side[here, None]
            gains[here] = place[:, :, free] @ np.linalg.pinv(known[:, :, :2]) @ errors
            gains[here, :, 3] += place[:, :, DRIVE_ANGLE] * contacts.side[here, None]
    return gains


def along_and_across(x: Floats, y: Floats, slope_angle: Floats) -> tuple[Floats, Floats]:
    """Return the components of vectors along and across a contour of these slope angles."""
    cos, sin = np.cos(slope_angle), np.sin(slope_angle)
    return cos * x + sin * y, cos * y - sin * x


def _gains_along_and_across(contacts: _Forward, gain: Floats, surface: Surface) -> tuple[Floats, Floats]:
    """Return derivatives of the contact along and across the contour, in the laboratory frame, shape (n, 4) each."""
    along, across = along_and_across(gain[:, 0], gain[:, 1], contacts.slope_angle[:, None])
    standoff, closer = surface.standoff(contacts.coordinates[:, ARCLENGTH])[:, None], np.sin(surface.half_angle)
    along = along - standoff * gain[:, 2]  # the surface turns with the slope
    return contacts.side[:, None] * along, across - closer * gain[:, 3]


def _deviation(gain: Floats, contacts: _Forward, angle_deviation: float) -> Floats:
    """Return standard deviations from all readings, shape (n,)."""
    by_loads = gain[:, :3]
    variance = np.einsum("ni,nij,nj->n", by_loads, contacts.covariance, by_loads)
    return np.asarray(np.sqrt(variance + (gain[:, 3] * angle_deviation) ** 2))


def event_distances(plan: Plan, sweep: Index, travel: Floats) -> dict[str, Floats]:
    """Return the distances along the drive of samples from first contact and from snap-off [rad or length]."""
    ends = np.array([(one.first_contact.travel, one.snap_off.travel) for one in plan.scan.sweeps])[sweep].T
    return dict(zip(("after_first_contact", "before_snap_off"), np.abs(travel - ends), strict=True))


def _growth(deviation: Floats, distance: Floats) -> float:
    """Return the exponent of a deviation as a power of the distance, from close samples; NaN if they are too few."""
    longest = distance.max(initial=0.0)
    near = (distance > _POWER_LAW[0] * longest) & (distance < _POWER_LAW[1] * longest) & (deviation > 0.0)
    near &= np.isfinite(deviation)
    if np.count_nonzero(near) < 3:
        return np.nan
    return float(np.polyfit(np.log(distance[near]), np.log(deviation[near]), 1)[0])
