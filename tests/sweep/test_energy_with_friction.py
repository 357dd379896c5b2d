"""Work of the drive is what the rod stores and what friction takes, with friction that holds and turns.

Between events the states are smooth, so that Gauss-Legendre nodes there give work and slip to rounding. The stored
energy is integrated along the rod from the loads at its base.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp

import tactile_bayes as tb
from tactile_bayes.contours import Parabola
from tactile_bayes.rig import Rig

CONTOUR = Parabola(0.6, 0.45, 0.1)
DRIVES = {
    "turned back": [(0.0, 0.0, 0.4), (0.0, 0.0, 2.2), (0.0, 0.0, 0.4)],
    "turned back twice": [(0.0, 0.0, 0.4), (0.0, 0.0, 2.0), (0.0, 0.0, 1.6), (0.0, 0.0, 2.1), (0.0, 0.0, 0.3)],
    "carried and turned back": [(1.2, -0.2, 1.3), (0.1, -0.2, 1.6), (1.2, -0.2, 1.3)],
    "not back": [(0.0, 0.0, 0.4), (0.0, 0.0, 1.9), (0.0, 0.0, 1.7)],
}
RODS = {
    "straight": tb.Rod(),
    "curved": tb.Rod(rest_curvature=-0.4),
    "tapered": tb.Rod(taper=0.5),
    "on a stem": tb.Rod(stem=0.1),
}
NODES, WEIGHTS = legendre.leggauss(40)
# Derivatives at the nodes of what has values at the nodes, by the right.
SLOPES = np.linalg.solve(
    legendre.legvander(NODES, NODES.size - 1).T, legendre.legval(NODES, legendre.legder(np.eye(NODES.size)))
)


def at_nodes(drive, rig):
    """A scan at nodes between events, the rows that these have, shape (parts, nodes), and the last state."""
    sweep = tb.scan(CONTOUR, rig, drive=replace(drive, drive_step=0.05)).sweeps[0]
    events = [event.travel for event in (sweep.first_contact, *sweep.transitions, sweep.snap_off)]
    ends = np.unique([*events, *drive.travels[(drive.travels > events[0]) & (drive.travels < events[-1])]])
    ends = ends[np.append(True, np.diff(ends) > 1e-7)]
    ends = np.interp(np.linspace(0.0, ends.size - 1.0, 3 * ends.size - 2), np.arange(ends.size), ends)
    travels = ends[:-1, None] + 0.5 * np.diff(ends)[:, None] * (NODES + 1.0)
    every = np.unique([*travels.ravel(), *drive.travels])
    record = tb.scan(CONTOUR, rig, drive=tb.Motion(*drive.at(every).T)).record
    assert record.sizes["sample"] == every.size
    return record, np.searchsorted(every, travels)


def stored(record, rod):
    """Elastic energy in the last sample."""
    moment, force_x, force_y = (float(record[n].values[-1]) for n in ("holding_moment", "force_x", "force_y"))
    angle, end = float(record.drive_angle.values[-1]), float(record.truth_contact_arclength.values[-1])
    if np.isnan(end):
        return 0.0
    begin = rod.stem * np.array([np.cos(angle), np.sin(angle)])

    def along(s, state):
        x, y, slope, _ = state
        stiffness = (1.0 - rod.taper * s) ** 4
        bending = x * force_y - y * force_x - moment
        curvature = bending / stiffness
        return [np.cos(slope), np.sin(slope), curvature + rod.rest_curvature, 0.5 * bending * curvature]

    return solve_ivp(along, (0.0, end), [*begin, angle, 0.0], method="DOP853", rtol=1e-12, atol=1e-13).y[-1, -1]


@pytest.mark.parametrize("friction", [0.1, 0.5])
@pytest.mark.parametrize("rod", RODS.values(), ids=RODS)
@pytest.mark.parametrize("poses", DRIVES.values(), ids=DRIVES)
def test_work_is_stored_or_taken_by_friction(poses, rod, friction):
    drive, rig = tb.Motion(*np.transpose(poses)), Rig(rod=rod, unknown={"friction": friction})
    record, rows = at_nodes(drive, rig)

    def column(name):
        return record[name].values[rows]

    moment, force_x, force_y = (column(name) for name in ("holding_moment", "force_x", "force_y"))
    x, y, angle = (column(name) @ SLOPES for name in ("base_x", "base_y", "drive_angle"))
    work = (moment * angle + force_x * x + force_y * y) @ WEIGHTS
    # The material point at the contact moves as the contact does, less by what the contact moves along the rod.
    slope, along = column("truth_tip_angle"), column("truth_contact_arclength") @ SLOPES
    slip_x = column("truth_contact_x") @ SLOPES - np.cos(slope) * along
    slip_y = column("truth_contact_y") @ SLOPES - np.sin(slope) * along
    taken = (force_x * slip_x + force_y * slip_y) @ WEIGHTS
    assert (taken > -1e-9).all()
    assert taken.sum() > 0.01
    assert abs(work.sum() - taken.sum() - stored(record, rod)) < 1e-8
