"""How exact the path is: against shooting, against forty digits, and against what the sequence of phases must be.

Contours, pivots and senses are drawn by hypothesis. What is asked for is 1e-9 of the greatest load of the path at every
drive angle, down to 1e-12 rad before the snap-off, and the snap-off itself to 1e-14 rad.

Near a fold loads depend on the root of the angle that is left: 1e-12 rad before it, one unit in the last place of the
angle (4e-16 rad) changes that root by 2e-4 of itself, and the load by up to 1e-9 of the greatest where the maximum is a
flat one. A drive angle and a snap-off angle that are doubles cannot say more than that, so the bound is

    1e-9 · greatest load + `ULPS` · (change of the exact load by one unit in the last place of the angle),

with 8 units for what evaluating the rod's formulas at the fold rounds (3e-15 rad at most in thousands of draws).
"""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import root

from helpers.contours_drawn import Scene, edge, mirrored, scenes
from helpers.exact_path import ExactPath
from helpers.exact_rod import mp
from helpers.single_states import states_at
from tactile_bayes.contours import Circle, Ellipse, Joined, Parabola, PowerLaw, ShapeFree, paper_profile
from tactile_bayes.errors import ContourError
from tactile_bayes.mechanics.branches.crossings import DIP
from tactile_bayes.mechanics.elastica import tangential_arclength
from tactile_bayes.mechanics.phases import NONE
from tactile_bayes.record import CHANNELS
from tactile_bayes.sweep import equilibria, scan
from tactile_bayes.sweep.path import Acting, sweep_paths

# Some of these objects are met again after snap-off, which is no concern of the path up to there.
pytestmark = pytest.mark.filterwarnings("ignore::tactile_bayes.errors.ClearanceWarning")

ACCURACY, SNAP_OFF = 1e-9, 1e-14
ULPS = 32  # up to five doublings of the argument of Jacobi's functions, each of which doubles a rounding error

FEW = settings(
    max_examples=8,
    deadline=None,
    derandomize=True,
    database=None,
    phases=[Phase.explicit, Phase.generate],  # an example takes half a second: to shrink one takes minutes
    suppress_health_check=list(HealthCheck),
)


def states_along(paths, parameters):
    parameters = np.atleast_1d(parameters)
    return states_at(paths, np.zeros(parameters.size, dtype=np.intp), parameters)


def greatest_loads(paths):
    """The greatest moment and forces on the path, from states along all of it."""
    first, snap = paths.first_parameter[0], paths.snap_parameter[0]
    wrench = states_along(paths, snap + (first - snap) * np.linspace(0.0, 1.0, 400)[:-1] ** 2).wrench
    return np.array([np.nanmax(np.abs(getattr(wrench, name))) for name in CHANNELS])


def told(paths, angles):
    """Loads at drive angles, as a scan records them, shape (n, 3); and the states."""
    states = paths.states(np.zeros(angles.size, dtype=np.intp), angles)
    return np.stack([getattr(states.wrench, name) for name in CHANNELS], axis=-1), states


# --- forty digits ----------------------------------------------------------------------------------------------------


def check_against_forty_digits(scene):
    """All of the path: just after first contact, on the way, down to 1e-12 rad before snap-off, and snap-off itself."""
    paths = scene.paths()
    exact, greatest = ExactPath(*scene), greatest_loads(paths)
    first, snap = float(paths.first_angle[0]), float(paths.snap_angle[0])

    kind, last = exact.snap_off(exact.start(states_along(paths, paths.snap_parameter[0])))
    assert abs(float(mp.mpf(snap) - last.drive_angle)) <= SNAP_OFF * max(1.0, abs(snap))
    at_end = states_along(paths, paths.snap_parameter[0]).wrench
    off = np.abs([float(getattr(at_end, name)[0]) for name in CHANNELS] - last.loads())
    assert np.all(off <= ACCURACY * greatest)

    angles = np.concatenate([first + (snap - first) * np.array([1e-6, 0.3, 0.9]), snap - 10.0 ** -np.arange(3, 13, 3)])
    angles = angles[angles > first]
    loads, states = told(paths, angles)
    for k, angle in enumerate(angles):
        assert states.wrench.phase[k] != NONE
        start = exact.start(states, k)
        truth = exact.at_angle(angle, start)
        beside = exact.at_angle(mp.mpf(angle) - mp.mpf(float(np.spacing(angle))), start)
        if kind == "fold" and truth.piece == last.piece:
            assert exact.side * (truth.parameter - last.parameter) > 0, "the state is beyond the snap-off"
        by_rounding = np.abs(beside.loads() - truth.loads())
        assert np.all(np.abs(loads[k] - truth.loads()) <= ACCURACY * greatest + ULPS * by_rounding)


def check_that_it_rises(scene):
    """From first contact on the drive angle grows all the way to the snap-off, and falls after it. Before a join, where
    the curvature jumps, and where contact comes to the tip again, it may fall by less than is a snap-off, and grow
    again. At 400 slope angles, the denser the nearer to the snap-off; the contour is asked for its states there, not
    the path. Rounding of the point that a slope angle stands for is 1e-15 over what a tip's onset makes of it."""
    events = scan(scene.contour, base=scene.base, direction=scene.direction).events[scene.direction]
    first, last = events.first_contact.slope_angle, events.snap_off.slope_angle
    slopes = last + (first - last) * np.linspace(0.98, 0.0, 400) ** 2
    side = 1.0 if scene.direction == "forward" else -1.0
    states = equilibria(scene.contour, slopes, base=scene.base, direction=scene.direction)
    angles, on_tip = side * states.drive_angle.values, states.contact_phase.values == "tip"
    assert np.isfinite(angles[:-1]).all()
    dip = DIP if isinstance(scene.contour, Joined) or np.any(on_tip[1:] & ~on_tip[:-1]) else 1e-10
    assert np.all(np.maximum.accumulate(angles[:-1]) - angles[:-1] < dip)
    end = side * events.snap_off.drive_angle
    assert np.all(angles[:-1] <= end + 1e-12)


@pytest.mark.slow
@settings(FEW, max_examples=300)
@given(scenes())
def test_down_to_the_snap_off(scene):
    check_against_forty_digits(scene)
    check_that_it_rises(scene)


HARD = {
    # The guess from the interpolant falls beyond the fold, where the drive angle is the same once more.
    "slim ellipse": Scene(Ellipse(0.07, 0.19, 0.85, 0.42), (0.0, 0.0), "backward"),
    "flat ellipse": Scene(Ellipse(5.0, 0.05, 0.3, 0.1)),
    # Where loads change fast with the angle, what is missing of it halves slowly long before it is rounding.
    "just before a fold": Scene(
        ShapeFree(
            np.array([-1.5, -0.5, 0.5, 1.5]),
            np.array([0.249749571163064, 0.04548753734990708, 0.24974871765457296, 6.56104877556666e-07]),
            x=0.33510746,
            y=0.05,
            at=0.0,
        ),
        (0.0, 0.0),
        "backward",
    ),
    "nearly square vertex": Scene(PowerLaw(6.8, 2.2, 0.54, -0.14), (0.06, 0.15), "backward"),
    "a dip before a join": Scene(
        Joined(
            Parabola(1.000000100000005, 0.18313132137207438, 0.6255873257122484),
            Parabola(6.000047198999893, 0.27490671355641705, 0.3164781380477987),
            x=0.3223065825372089,
        )
    ),
    "two ellipses": Scene(Joined(Ellipse(2.7, 0.17, 0.15, -0.24), Ellipse(1.8, 0.17, 0.15, -0.24)), (0.21, -0.07)),
    "pivot below a slope": Scene(Joined(PowerLaw(0.34, 3.93, 0.26, 0.1), Ellipse(1.72, 0.11, 0.26, 0.1)), (0.57, 0.19)),
    # The path is not smooth where it ends, at the flat vertex.
    "flat vertex": Scene(PowerLaw(3.9788149864202675, 3.3070677398801873, 0.05)),
    "hardly flat vertex": Scene(PowerLaw(0.5, 2.8, 0.1)),
    "flatter vertex": Scene(PowerLaw(4.0, 3.1, 0.2), (0.0, 0.0), "backward"),
    # Rounding undoes the very first contact.
    "steep start": Scene(PowerLaw(4.0, 8.0, 0.2)),
    # Everything happens in a few degrees.
    "pivot close by": Scene(edge(0.39, 0.1, np.arctan([0.67, 2.79]), (0.62, 0.94)), (0.43, 0.126)),
    "small circle close by": Scene(Circle(0.1, 0.03), (0.02, 0.0)),
    # A tip's onset, in a sweep that ends soon.
    "brief tip contact": Scene(
        Joined(PowerLaw(0.115, 4.34, 0.766, -0.45), PowerLaw(0.145, 1.38, 0.766, -0.45)), (0, 0), "backward"
    ),
    "slow end at a knot": Scene(Joined(Parabola(5.0, 0.3), Parabola(0.2, 0.3)), (-0.05, 0.0)),
    # Radius zero at the vertex.
    "sharp": Scene(PowerLaw(1.0, 1.2, 0.4, 0.05)),
    "sharp, from the side": Scene(PowerLaw(0.15, 1.35, 0.22, -0.14), (0.28, -0.39), "backward"),
    "sharp, with the tip once more": Scene(PowerLaw(1.0128, 1.2, 1.0 / 3.0, 0.0127), (0.571, 0.0127), "backward"),
    # Radii that a polynomial over the whole path does not follow.
    "wiggly": Scene(ShapeFree(np.linspace(-1.5, 1.5, 8), np.array([0, 1.5, -2.5, 1.2, -1.1, -2, 1.2, 0]), 0.0, 0.4)),
    "wiggly, backward": Scene(
        ShapeFree(np.linspace(-1.5, 1.5, 9), np.array([1, -2, 1.5, -1, -2.5, 1, -1.5, 1, 0]), 0.1, 0.6),
        (0.1, 0),
        "backward",
    ),
    # Far to the side.
    "far to the right": Scene(Parabola(2.0, 0.2, -0.5), (0.3, -0.2)),
    "far to the left": Scene(Circle(1.5, 0.1, 0.5), (-0.5, -0.1)),
}


@pytest.mark.slow
@pytest.mark.parametrize("scene", HARD.values(), ids=HARD)
def test_hard_cases_down_to_the_snap_off(scene):
    check_against_forty_digits(scene)
    check_that_it_rises(scene)


# --- shooting --------------------------------------------------------------------------------------------------------


def shot(scene, angle, parameter, force, rest, tip, friction_angle=0.0):
    """Loads and contact parameter of the equilibrium at a drive angle. The rod is integrated from the contact, where it
    has no curvature, back to the pivot, which it must hit with the drive's slope: three conditions for three unknowns.
    In tangential contact it leaves along the contour, after an unknown arc length; in tip contact with an unknown
    slope, after arc length one."""
    side = 1.0 if scene.direction == "forward" else -1.0

    def contact(p):
        locus = scene.contour.locate(side * p)
        return side * (float(locus.x) - scene.base[0]), float(locus.y) - scene.base[1], side * float(locus.slope_angle)

    def back(unknown):
        p, force, rest = unknown
        x, y, alpha = contact(p)
        slope, length = (rest, 1.0) if tip else (alpha, rest)

        def rates(_s, z):
            return [-np.cos(z[2]), -np.sin(z[2]), -z[3], -force * np.cos(z[2] - alpha - friction_angle)]

        found = solve_ivp(rates, (0.0, length), [x, y, slope, 0.0], method="DOP853", rtol=1e-13, atol=1e-15)
        return found.y[:3, -1] - [0.0, 0.0, angle]

    solution = root(back, [parameter, force, rest], tol=1e-14)
    assert np.max(np.abs(solution.fun)) < 1e-12, solution.message
    p, force, rest = solution.x
    x, y, alpha = contact(p)
    assert rest >= alpha if tip else rest <= 1.0
    beta = alpha + friction_angle
    return force * np.array([x * np.cos(beta) + y * np.sin(beta), -np.sin(beta), np.cos(beta)]), p


def shot_at(scene, paths, angle, states, k):
    """Loads by shooting, from some way off; from nearer where the shot hits the other equilibrium, beyond the fold."""
    w, delta = states.wrench, paths.sweeps.friction_angle[0]
    tip = w.contact_arclength[k] == 1.0
    force = float(np.hypot(w.force_x[k], w.force_y[k]))
    for off in (0.1, 0.03, 0.01):
        rest = w.tip_angle[k] + 0.1 * off * (w.drive_angle[k] - w.tip_angle[k]) if tip else 1.0 - 0.2 * off
        rest = float(rest if tip else rest * w.contact_arclength[k])
        parameter = states.parameter[k] + off * (states.parameter[k] - paths.snap_parameter[0])
        loads, found = shot(scene, angle, parameter, (1.0 + 0.2 * off) * force, rest, tip, delta)
        if found > paths.snap_parameter[0]:
            return loads
    raise AssertionError("no shot hit an equilibrium on the path")


@pytest.mark.slow
@FEW
@given(scenes(), st.floats(0.05, 0.6), st.floats(0.02, 0.98))
def test_against_shooting_with_friction(scene, friction, share):
    """The force is turned by arctan μ. What 1e-12 of drive angle changes is granted to the shots, as above."""
    try:
        paths = sweep_paths(scene.contour, base=scene.base, direction=scene.direction, acts=Acting(friction=friction))
    except ContourError:
        assume(False)
    first, snap = float(paths.first_angle[0]), float(paths.snap_angle[0])
    angle = first + share * (snap - first)
    (loads, beside), states = told(paths, np.array([angle, angle - 1e-3 * (angle - first)]))
    shooting = shot_at(scene, paths, angle, states, 0)
    slope = np.abs(loads - beside) / (1e-3 * (angle - first))
    assert np.all(np.abs(shooting - loads) <= ACCURACY * greatest_loads(paths) + 1e-12 * slope)


@pytest.mark.slow
@FEW
@given(scenes(), st.tuples(st.floats(0.02, 0.98), st.sampled_from([1e-2, 1e-3, 1e-4])))
def test_against_shooting(scene, where):
    """From starts some per cent off, and told by nothing but the phase. The residual that is left of a shot, 1e-12,
    counts as so much drive angle. And the forty digits must be what the shots find, too."""
    paths, exact = scene.paths(), ExactPath(*scene)
    first, snap = float(paths.first_angle[0]), float(paths.snap_angle[0])
    share, before = where
    angles = np.array([first + share * (snap - first), snap - before * (snap - first)])
    loads, states = told(paths, angles)
    greatest = greatest_loads(paths)
    for k, angle in enumerate(angles):
        shooting = shot_at(scene, paths, angle, states, k)
        start = exact.start(states, k)
        truth, beside = (exact.at_angle(mp.mpf(angle) - h, start).loads() for h in (0, mp.mpf(10) ** -12))
        bound = ACCURACY * greatest + np.abs(beside - truth)
        assert np.all(np.abs(shooting - loads[k]) <= bound)
        assert np.all(np.abs(shooting - truth) <= bound)


# --- sequences of phases ---------------------------------------------------------------------------------------------

SEQUENCES = {
    "B": Scene(paper_profile("II", 0.3)),
    "A": Scene(paper_profile("II", 0.7)),
    "A-B": Scene(paper_profile("II", 0.4)),
    "B-A": Scene(paper_profile("IV", 0.5)),
    "A-B-A": Scene(paper_profile("III", 0.6)),
    "B-A-B": Scene(ShapeFree(np.linspace(-0.6, 1.4, 21), np.repeat([1.5, -2.5, 1.8, -3.0], [8, 4, 2, 7]), 0.15, 0.41)),
    "A-B-A-B-A": Scene(ShapeFree(np.linspace(-0.6, 1.4, 4), np.array([-0.7, 1.1, -1.9, 0.4]), -0.23, 0.61)),
}
LETTER = {"tip": "A", "tangential": "B"}


@pytest.mark.parametrize("direction", ["forward", "backward"])
@pytest.mark.parametrize("sequence", SEQUENCES)
def test_sequences_of_phases(sequence, direction):
    """As events, and as the states at slope angles between them have it; a change is where both phases are one state.
    Backward the contour is its mirror image, which only some of the families can give."""
    contour = SEQUENCES[sequence].contour
    if direction == "backward" and sequence in ("B-A", "B-A-B", "A-B-A-B-A"):
        contour = mirrored(contour)
    events = scan(contour, direction=direction).events[direction]
    changes = [events.first_contact.kind] + [change.kind.split(" → ")[1] for change in events.transitions]
    assert "-".join(LETTER[phase] for phase in changes) == sequence
    at = [events.first_contact, *events.transitions, events.snap_off]
    for phase, begin, end in zip(changes, at, at[1:], strict=False):
        # A tip's onset and a change are on the edge of the phase.
        slopes = begin.slope_angle + (end.slope_angle - begin.slope_angle) * np.linspace(1e-6, 1 - 1e-6, 200)
        states = equilibria(contour, slopes, direction=direction)
        assert set(states.contact_phase.values) == {phase}
        side = 1.0 if direction == "forward" else -1.0
        length = tangential_arclength(side * states.contact_x, states.contact_y, side * slopes)
        assert np.all(length > 1.0) if phase == "tip" else np.all(length <= 1.0)
        assert np.all(np.diff(side * states.drive_angle.values) > 0)
    for change in events.transitions:
        assert change.contact_arclength == pytest.approx(1.0, abs=1e-13)
    for a, b in pairwise(at):
        assert (b.drive_angle > a.drive_angle) == (direction == "forward")


# --- the first maximum -----------------------------------------------------------------------------------------------


def test_profile_four_lets_go_at_its_vertex_without_moment():
    """α = 0, φ0 = π and m0 = 0 at once, by symmetry of the half wave between pivot and contact: by thrust."""
    scene = Scene(paper_profile("IV", 0.3))
    sweep = scan(scene.contour, direction="forward").events["forward"]
    last = sweep.snap_off
    assert (sweep.first_contact.kind, sweep.transitions, last.kind) == ("tangential", (), "thrust")
    assert abs(last.slope_angle) < 1e-13
    assert (last.contact_x, last.contact_y) == (pytest.approx(0.0, abs=1e-13), pytest.approx(0.3, abs=1e-15))
    assert abs(last.drive_angle - np.pi) < SNAP_OFF
    assert abs(last.holding_moment) < 1e-12
    check_against_forty_digits(scene)


TWO_MAXIMA = {
    "edge": Scene(edge(0.08, 0.445, np.arctan([0.847, 2.186]), (0.625, 3.79)), (-0.075, -0.494)),
    "sharp vertex": Scene(PowerLaw(0.147, 1.35, 0.218, -0.143), (0.2815, -0.3946), "backward"),
    "flat vertex": Scene(PowerLaw(16.5, 3.0, 0.742, -0.18), (0.0, 0.0), "backward"),
}


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(scene, id=name, marks=[pytest.mark.slow] if name == "flat vertex" else [])
        for name, scene in TWO_MAXIMA.items()
    ],
)
def test_of_two_maxima_the_first_ends_the_sweep(scene):
    """The drive angle falls and rises again beyond the snap-off, to a greater height: the rod never gets there."""
    events = scan(scene.contour, base=scene.base, direction=scene.direction).events[scene.direction]
    side = 1.0 if scene.direction == "forward" else -1.0
    first, last = side * events.first_contact.slope_angle, side * events.snap_off.slope_angle
    slopes = np.linspace(first, -1.3, 2001)[1:]
    states = equilibria(scene.contour, side * slopes, base=scene.base, direction=scene.direction)
    angles = states.drive_angle.values if side > 0 else np.pi - states.drive_angle.values
    end = events.snap_off.drive_angle if side > 0 else np.pi - events.snap_off.drive_angle
    before, after = angles[slopes >= last], angles[slopes < last]
    assert np.all(np.diff(before) > -1e-12)
    assert np.nanmax(before) == pytest.approx(end, abs=2e-3)
    assert np.all(before <= end + 1e-12)
    assert after[0] < end
    assert np.nanmax(after) > end + 5e-3
    check_against_forty_digits(scene)
