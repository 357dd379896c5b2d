"""Rods whose base is carried, against integration of the rod and shooting."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar, root

from helpers.profiled_rods import integrated_pose, rod_along
from tactile_bayes.contours import Circle, Parabola, PowerLaw
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.mechanics.branches.line import lines_through
from tactile_bayes.mechanics.branches.readings import STATE_COLUMNS
from tactile_bayes.mechanics.paths import trace
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.mechanics.reachability import Reachability, SnapOff
from tactile_bayes.mechanics.rods.profile import Profile
from tactile_bayes.mechanics.rods.rod import Rod

TURN = np.array([[0.9, 0.0, 0.9], [-0.7, 0.1, 1.7]])
FAR_TURN = np.array([[0.9, 0.0, 0.9], [-1.2, 0.1, 2.0]])
SHIFT = np.array([[0.9, 0.05, 1.1], [-0.8, 0.05, 1.1]])
TAPERED = Rod(taper=0.5).as_profile()
STRAIGHT = rod_along(0.0, 1.0, 0.0)


def carried(contour, poses, ways=(), *, backward=False, friction=0.0, compliance=0.0, curvature=0.0, profile=None):
    """Path along one contour, with states at travels in the forward model's own measure."""
    path, base = lines_through(poses, 1.0, backward=backward), np.asarray(poses)[:1]
    frame = SweepFrame(
        contour.broadcast_to((1,)), base[:, 0], base[:, 1], 1.0, 0.0, np.array([backward]), curvature, _taper(profile)
    )
    return trace(
        frame,
        friction_angle=friction,
        suspension_compliance=compliance,
        profile=profile,
        drive_angles=np.asarray(ways, dtype=float),
        lines=path.lines[None],
    )


def _taper(profile: Profile | None) -> float:
    return 0.0 if profile is None else profile.taper


def base_of(contact, force, friction, arclength, compliance, rod):
    """Pose of the base from the contact, (x, y, slope angle, slope of the rod there), by integration."""
    x, y, alpha, slope = contact
    u, v, turn = integrated_pose(rod, slope - alpha - friction, arclength, force)
    cos, sin = np.cos(alpha + friction), np.sin(alpha + friction)
    return x - u * cos + v * sin, y - u * sin - v * cos, slope + turn + compliance * force * u


def drawn(number):
    """Contour, poses, and options of `carried`."""
    rng = np.random.default_rng(number)
    size, q, x_c = np.exp(rng.normal(0.0, 0.4)), rng.uniform(0.4, 0.8), rng.normal(0.0, 0.1)
    contour = [Parabola(size, q, x_c), Circle(0.4 * size, q, x_c), PowerLaw(size, 1.6, q, x_c)][number % 3]
    angle, turn = rng.uniform(0.5, 1.3), rng.choice([0.0, 0.5, -0.3])
    poses = np.array([[1.0, 0.0, angle], [-0.8, rng.uniform(-0.2, 0.2), angle + turn]])
    friction, compliance = rng.choice([0.0, 0.2]), rng.choice([0.0, 0.1])
    profile = TAPERED if number % 4 == 3 else None
    curvature = 0.0 if profile is not None else rng.choice([0.0, 0.4, -0.4])
    return contour, poses, {"friction": friction, "compliance": compliance, "curvature": curvature, "profile": profile}


@pytest.mark.parametrize("number", range(24))
def test_states_satisfy_the_integrated_equations(number):
    """From the contact and its force the rod ends at the base, where the drive has brought it."""
    contour, poses, rig = drawn(number)
    friction, compliance, curvature, profile = rig.values()
    rod = rod_along(curvature, 1.0, _taper(profile))
    whole = np.linalg.norm(poses[1] - poses[0])
    ways = np.linspace(0.0, whole, 25)
    paths = carried(contour, poses, ways, **rig)
    states = paths.sampled[0]
    with np.errstate(invalid="ignore"):
        in_contact = (ways >= paths.first_angle[0]) & (ways <= paths.snap_angle[0])
    np.testing.assert_array_equal(states[:, 0] != NONE, in_contact)
    for way, state in zip(ways, states, strict=True):
        if state[0] == NONE:
            continue
        phase, _, x, y, alpha, _, moment, force_x, force_y, arclength, slope = state[:11]
        delta = np.arctan2(-force_x, force_y) - alpha
        assert abs(delta) == pytest.approx(friction, abs=1e-10)
        assert arclength == 1.0 if phase == TIP else slope == pytest.approx(alpha, abs=1e-10)
        contact, force = (x, y, alpha, slope), np.hypot(force_x, force_y)
        found = base_of(contact, force, delta, arclength, compliance, rod)
        expected = (poses[1] - poses[0]) * way / whole + [0.0, 0.0, poses[0, 2]]
        # The compliance turns the base by the moment.
        assert found == pytest.approx(expected, abs=2e-10)
        assert moment == pytest.approx(
            force * (x - found[0]) * np.cos(alpha + delta) + force * (y - found[1]) * np.sin(alpha + delta), abs=1e-9
        )


def test_enough_of_them_touch():
    """Of the drawn ones above: they have states to check."""
    found = (carried(contour, poses, **rig) for contour, poses, rig in map(drawn, range(24)))
    assert sum(paths.reach[0] == Reachability.TOUCHES for paths in found) > 8


@pytest.mark.parametrize("contour", [Parabola(0.5, 0.5), Circle(0.5, 0.6, 0.1), PowerLaw(1.0, 1.7, 0.5)])
@pytest.mark.parametrize("backward", [False, True])
def test_a_rotation_is_a_line_along_the_drive_angle(contour, backward):
    one = np.zeros(1)
    sweep_frame = SweepFrame(
        contour.broadcast_to((1,)), one, one, 1.0, 0.0, np.array([backward]), 0.3 if backward else -0.3
    )
    angles = np.linspace(0.0, 3.5, 40)
    turned = trace(sweep_frame, friction_angle=0.1, suspension_compliance=0.02, drive_angles=angles)
    line = np.array([[[0.0, 0.0, -0.5 * np.pi, 0.0, 0.0, 1.0, -0.5 * np.pi, 1.5 * np.pi]]])
    as_line = trace(sweep_frame, friction_angle=0.1, suspension_compliance=0.02, drive_angles=angles, lines=line)
    assert turned.reach == as_line.reach == Reachability.TOUCHES
    assert as_line.first_angle == pytest.approx(turned.first_angle, abs=1e-12)
    assert as_line.snap_angle == pytest.approx(turned.snap_angle, abs=1e-12)
    np.testing.assert_allclose(as_line.sampled, turned.sampled, atol=1e-9)
    assert as_line.modes() == turned.modes()
    assert as_line.is_clear() == turned.is_clear()


def test_a_drive_in_parts_is_one_drive():
    """Poses on a line change nothing, and the same holds for the fast mode of likelihoods."""
    contour, ways = Circle(0.3, 0.8), np.linspace(0.0, 1.7, 60)
    whole = carried(contour, SHIFT, ways)
    parts = SHIFT[0] + np.array([0.0, 0.2, 0.53, 0.9, 1.0])[:, None] * (SHIFT[1] - SHIFT[0])
    assert len(lines_through(parts, 1.0).lines) == 1
    off = parts + 1e-7 * np.array(
        [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 0.0]]
    )
    assert len(lines_through(off, 1.0).lines) == 4
    kinked = carried(contour, off, ways)
    assert kinked.snap_angle == pytest.approx(whole.snap_angle, abs=1e-5)
    loaded = whole.sampled[0, :, 0] != NONE
    np.testing.assert_allclose(kinked.sampled[0, loaded, 6:9], whole.sampled[0, loaded, 6:9], atol=1e-4)


@pytest.mark.parametrize(
    ("poses", "contour"), [(SHIFT, Circle(0.3, 0.8)), (TURN, Circle(0.3, 0.8)), (FAR_TURN, Parabola(2.0, 0.7))]
)
def test_a_fold_is_the_greatest_travel(poses, contour):
    """By shooting: the travel of the states that integration finds for a force is greatest where the path ends."""
    paths = carried(contour, poses)
    assert paths.snap_off[0] == SnapOff.FOLD
    last = dict(zip(STATE_COLUMNS, paths.events[0, -1], strict=True))
    tip, p, force = last["phase"] == TIP, last["parameter"], np.hypot(last["force_x"], last["force_y"])
    q = last["tip_angle"] - last["slope_angle"] if tip else last["arclength"]
    whole = np.linalg.norm(poses[1] - poses[0])
    along = (poses[1] - poses[0]) / whole

    def travel(force, guess):
        def off(z):
            spot = contour.locate(z[0])
            contact = float(spot.x), float(spot.y), float(spot.slope_angle), float(spot.slope_angle) + z[1]
            arclength = 1.0
            if not tip:
                contact, arclength = (*contact[:3], contact[2]), z[1]
            pose = np.array(base_of(contact, force, 0.0, arclength, 0.0, STRAIGHT)) - poses[0]
            way = pose @ along
            return way, pose - way * along

        found = root(lambda z: off(z)[1] @ np.linalg.svd(along[None])[2][1:].T, guess, tol=1e-12)
        assert np.abs(found.fun).max() < 1e-11
        return off(found.x)[0], found.x

    start = np.array([p, q])
    best = minimize_scalar(lambda f: -travel(f, start)[0], bracket=(0.97 * force, force, 1.03 * force), tol=1e-9)
    assert -best.fun == pytest.approx(paths.snap_angle[0], abs=1e-10)
    assert best.x == pytest.approx(force, rel=1e-3)


def test_first_contact_is_where_the_unloaded_rod_touches():
    """Tip and flank, from geometry alone."""
    contour, angle = Circle(0.3, 0.8), 1.1
    centre = np.array([0.0, 1.1])
    paths = carried(contour, np.array([[0.9, 0.0, angle], [-0.9, 0.0, angle]]))
    # The tip of a straight rod meets the circle, or its flank is a tangent.
    tip = np.array([0.9 + np.cos(angle), np.sin(angle)])
    across = centre[1] - tip[1]
    by_tip = tip[0] - np.sqrt(0.09 - across**2) if abs(across) < 0.3 else np.inf
    normal = np.array([np.sin(angle), -np.cos(angle)])
    touch = centre + 0.3 * normal
    base_x = touch[0] - touch[1] / np.tan(angle)
    by_flank = 0.9 - base_x if touch[1] / np.sin(angle) <= 1.0 else np.inf
    assert paths.first_angle[0] == pytest.approx(min(by_tip, by_flank), abs=1e-12)
    low = carried(contour, np.array([[1.5, 0.4, 0.8], [-0.9, 0.4, 0.8]]))
    normal = np.array([np.sin(0.8), -np.cos(0.8)])
    touch = centre + 0.3 * normal
    assert low.first_angle[0] == pytest.approx(1.5 - (touch[0] - (touch[1] - 0.4) / np.tan(0.8)), abs=1e-12)
    assert low.events[0, 0, 0] == TANGENTIAL


def test_a_rod_that_is_drawn_back_is_released_without_a_jump():
    poses = np.array([[0.9, 0.0, 1.1], [-0.4, 0.0, 1.1], [-0.4, -0.9, 1.1]])
    ways = np.linspace(0.0, 2.2, 400)
    paths = carried(Circle(0.3, 0.8), poses, ways)
    assert paths.reach[0] == Reachability.TOUCHES
    assert paths.snap_off[0] == SnapOff.RELEASE
    loads = np.hypot(*paths.sampled[0, :, 7:9].T)
    last = np.flatnonzero(loads)[-1]
    assert 0.0 < loads[last] < 0.1 * loads.max()
    assert ways[last] <= paths.snap_angle[0] < ways[last + 1]


def test_friction_opposes_the_slip_and_holds_the_contact_where_the_drive_turns_back():
    contour = Circle(0.3, 0.8)
    poses = np.array([[0.9, 0.0, 1.1], [-0.3, 0.0, 1.1], [0.9, 0.0, 1.1]])
    without = carried(contour, poses)
    assert without.snap_off[0] == SnapOff.RELEASE
    assert without.snap_angle[0] == pytest.approx(2.4 - without.first_angle[0], abs=1e-9)
    rubbed = carried(contour, poses, np.linspace(0.0, 2.4, 481), friction=0.2)
    there, back = (rubbed.sampled[0, part] for part in (slice(0, 240), slice(241, None)))
    there, back = there[there[:, 0] > 0.0], back[back[:, 0] > 0.0]
    assert np.all(there[:, 12] == 0.2)
    assert rubbed.snap_off[0] == SnapOff.RELEASE
    assert [mode.sticks for mode in rubbed.modes()[0]].count(True) == 1
    assert np.all(np.diff(back[:, 12]) <= 0.0)
    assert back[-1, 12] == -0.2


def test_a_backward_sweep_is_the_mirror_image():
    ways = np.linspace(0.0, 1.7, 50)
    forward = carried(Circle(0.3, 0.8, 0.05), TURN, ways, friction=0.1, curvature=0.3)
    mirrored = TURN * [-1.0, 1.0, -1.0] + [0.0, 0.0, np.pi]
    backward = carried(Circle(0.3, 0.8, -0.05), mirrored, ways, backward=True, friction=0.1, curvature=-0.3)
    np.testing.assert_allclose(backward.sampled, forward.sampled, atol=1e-9)
    assert backward.snap_angle == pytest.approx(forward.snap_angle, abs=1e-12)


@pytest.mark.parametrize(
    ("poses", "reach"),
    [
        ([[0.05, 0.0, 1.4], [-0.9, 0.0, 1.4]], Reachability.BEGINS_INSIDE),
        ([[0.9, -2.0, 1.4], [-0.9, -2.0, 1.4]], Reachability.TOO_FAR),
        ([[0.9, 0.7, 1.4], [0.1, 0.7, 1.4]], Reachability.TOO_CLOSE),
        ([[0.9, 0.0, 0.5 * np.pi], [-0.9, 0.0, 0.5 * np.pi]], Reachability.ENDS),
    ],
)
def test_what_has_no_path_says_why(poses, reach):
    assert carried(Circle(0.3, 0.6), np.array(poses)).reach[0] == reach


def test_an_object_that_is_hardly_reached_is_found():
    """The tip enters the object by less than the distance of two looks."""
    depth = 2e-5
    paths = carried(Parabola(3.0, 1.0 - depth), np.array([[0.9, 0.0, 0.5 * np.pi], [-0.9, 0.0, 0.5 * np.pi]]))
    assert paths.reach[0] == Reachability.TOUCHES
    assert paths.first_angle[0] == pytest.approx(0.9 - np.sqrt(depth / 3.0), abs=1e-9)


def test_tapers_and_profiles_follow_the_same_equations_in_the_fast_mode():
    contour, ways = Circle(0.3, 0.8), np.linspace(0.0, 1.7, 80)
    exact = carried(contour, TURN, ways, profile=TAPERED)
    path = lines_through(TURN, 1.0)
    frame = SweepFrame(contour.broadcast_to((1,)), TURN[:1, 0], TURN[:1, 1], 1.0, 0.0, np.array([False]), 0.0, 0.5)
    fast = trace(frame, profile=TAPERED, tolerance=np.full(3, 1e-4), drive_angles=ways, lines=path.lines[None])
    assert fast.snap_angle == pytest.approx(exact.snap_angle, abs=2e-6)
    inside = (exact.sampled[0, :, 0] != NONE) & (ways < exact.snap_angle[0] - 1e-3)
    np.testing.assert_allclose(fast.sampled[0, inside, 6:9], exact.sampled[0, inside, 6:9], atol=2e-3)
