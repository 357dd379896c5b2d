"""Stability along the path, judged by the second variation of the energy: it is lost at the snap-off, and only there.

The eigenvalues are those of `helpers.second_variation`, from the rod's shape by integration and the contour's radius.
With 24 terms of its basis or 60 they are the same to 1e-8; states are exact to 1e-12, and the eigenvalues' derivatives
by the state are some hundreds: 1e-7 bounds what is not true of them (`EIGENVALUE`).
"""

import numpy as np
import pytest
from scipy.optimize import brentq

from helpers.integration import shoot
from helpers.second_variation import Held, eigenvalues, held
from tactile_bayes.contours import Circle, Joined, Parabola, paper_profile
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import equilibria, scan

EIGENVALUE = 1e-7
# The second eigenvalues of all cases lie above: a free rod's own are (π/2)² and (3π/2)² = 22 over squared lengths below
# one, and the contact takes the first of them away.
FAR = 20.0
FLAT_ROOF = Joined(Parabola(0.2, 0.3, 1.0), Parabola(0.2, 0.3, -1.0), x=0.0)
HIGH_ROOF = Joined(Parabola(0.2, 0.5, 1.0), Parabola(0.2, 0.5, -1.0), x=0.0)
SHARP_LEFT = Joined(Parabola(5.0, 0.3), Parabola(0.2, 0.3))
EDGE_LEFT = Joined(Parabola(1.0, 0.3775, 0.15), Parabola(0.2, 0.3995, -0.05), x=0.0)

# Rest curvature and taper.
RODS = {
    "arc": (0.4, 0.0),
    "other arc": (-0.6, 0.0),
    "half cone": (0.0, 0.5),
    "cone": (0.0, 0.9),
    "curved to its tip": (lambda s: -0.8 * s, 0.6),
    "the other way": (lambda s: 0.3 * s, 0.6),
    "curved cone": (lambda s: 0.5 - 2.0 * s + 1.5 * s * s, 0.3),
}


def snap_off(contour, base):
    event = scan(contour, base=base, direction="forward").events["forward"]
    return event.first_contact, event.snap_off


def lowest(contour, slope_angles, base=(0.0, 0.0)):
    """The two lowest eigenvalues at slope angles, shape (n, 2)."""
    states = equilibria(contour, slope_angles, base=base)
    return np.array([eigenvalues(held(contour, states.isel(slope_angle=k)))[:2] for k in range(len(slope_angles))])


def assert_zero_is_crossed(eigenvalue, last, near=1e-3):
    """Where the lowest eigenvalue crosses zero is known to its error over its slope, and the snap-off is there."""
    before, after = eigenvalue(last.slope_angle + near), eigenvalue(last.slope_angle - near)
    assert before > 1e3 * EIGENVALUE
    assert after < -1e3 * EIGENVALUE
    crossing = brentq(eigenvalue, last.slope_angle - near, last.slope_angle + near, xtol=1e-14)
    assert abs(crossing - last.slope_angle) < EIGENVALUE / ((before - after) / (2 * near))
    return crossing


@pytest.mark.parametrize("terms", [20, 40, 60])
def test_a_free_rod_has_its_textbook_spectrum(terms):
    """Without force Q is ∫ η'², with a clamped and a free end: ((k + 1/2) π)², less the one that N takes away. In tip
    contact of a straight rod that stands on the contour (ψ = π/2) N vanishes identically but for the rounding of π/2;
    with ψ = 0 it is ∫ η, and the spectrum is that of tan z = z: z = 4.4934…, 7.7252…."""
    rod = Held(0.3, 0.0, 0.0, 0.3, 1.0, 1.0, True)
    roots = [brentq(lambda z: np.sin(z) - z * np.cos(z), k * np.pi, (k + 0.5) * np.pi) for k in (1, 2)]
    np.testing.assert_allclose(eigenvalues(rod, terms)[:2], np.square(roots), rtol=1e-10)


@pytest.mark.parametrize("contour", [paper_profile("II", 0.3), paper_profile("II", 0.7), FLAT_ROOF])
def test_the_basis_is_large_enough(contour):
    """An eigenfunction of a smooth problem: its series ends like a power of what is left, not slowly."""
    _, last = snap_off(contour, (0.0, 0.0))
    for state in (equilibria(contour, [last.slope_angle + away]).isel(slope_angle=0) for away in (0.2, 0.0)):
        few, many = (eigenvalues(held(contour, state), terms)[:2] for terms in (24, 60))
        np.testing.assert_allclose(few, many, rtol=1e-9, atol=0.1 * EIGENVALUE)


FOLDS = {
    "profile II, B": (paper_profile("II", 0.3), (0.0, 0.0), "tangential"),
    "profile II, A": (paper_profile("II", 0.7), (0.0, 0.0), "tip"),
    "circle, A-B-A": (paper_profile("III", 0.6), (0.0, 0.0), "tip"),
    "small circle": (Circle(0.2, 0.3), (0.1, -0.05), "tangential"),
    "profile IV, B-A": (paper_profile("IV", 0.5), (0.0, 0.0), "tip"),
    "within an edge": (FLAT_ROOF, (0.0, 0.0), "tangential"),
}


@pytest.mark.parametrize(
    ("contour", "base", "phase"),
    [
        pytest.param(*case, id=name, marks=[] if name in ("profile II, B", "profile IV, B-A") else [pytest.mark.slow])
        for name, case in FOLDS.items()
    ],
)
def test_at_a_smooth_fold_the_lowest_eigenvalue_crosses_zero(contour, base, phase):
    first, last = snap_off(contour, base)
    assert last.kind == "fold"
    crossing = assert_zero_is_crossed(lambda alpha: lowest(contour, [alpha], base)[0, 0], last)
    assert str(equilibria(contour, [crossing], base=base).contact_phase.values[0]) == phase

    # Stable all the way from first contact; and at the snap-off one mode only is lost.
    way = last.slope_angle + (first.slope_angle - last.slope_angle) * np.linspace(0.02, 0.9, 8)
    assert np.all(lowest(contour, way, base)[:, 0] > 1e3 * EIGENVALUE)
    around = lowest(contour, last.slope_angle + 1e-3 * np.linspace(-1, 1, 5), base)
    assert np.all(around[:, 1] > FAR)


CORNERS = {
    "change of phase": (paper_profile("II", 0.5), (0.0, 0.0), "tangential", "tip"),
    "curvature jumps": (SHARP_LEFT, (-0.05, 0.0), "tangential", "tangential"),
    "rod meets an edge": (EDGE_LEFT, (-0.1, 0.0), "tangential", "tangential"),
    "tip meets an edge": (HIGH_ROOF, (0.0, 0.0), "tip", "tip"),
}


@pytest.mark.parametrize(("contour", "base", "before", "after"), CORNERS.values(), ids=CORNERS)
def test_at_a_corner_the_lowest_eigenvalue_jumps_below_zero(contour, base, before, after):
    """It keeps away from zero on both sides, within a billionth of a radian of the corner as farther off."""
    _, last = snap_off(contour, base)
    assert last.kind == "corner"
    for near in (1e-9, 1e-6, 1e-3):
        sides = last.slope_angle + near * np.array([1.0, -1.0])
        phases = equilibria(contour, sides, base=base).contact_phase.values.tolist()
        assert phases == [before, after]
        found = lowest(contour, sides, base)
        assert found[0, 0] > 0.1
        assert found[1, 0] < -0.1
        assert np.all(found[:, 1] > FAR)


@pytest.mark.slow
def test_at_the_vertex_of_profile_four():
    """It falls to zero like the distance x from the vertex, where the radius 1/(12 x²) grows beyond all bounds: there
    the form is that of a rod which cannot turn at its contact, with a half wave from pivot to contact. λ = c x + O(x²),
    so that 2 λ(x/2) − λ(x) is O(x²): eight times less whenever x is halved would be O(x³), four times O(x²). Beyond,
    the radius is one and the contact turns freely: the eigenvalue jumps below zero."""
    contour = paper_profile("IV", 0.3)
    _, last = snap_off(contour, (0.0, 0.0))
    assert last.slope_angle == pytest.approx(0.0, abs=1e-12)
    x = 0.02 * 0.5 ** np.arange(5)
    found = lowest(contour, np.arctan(4 * x**3))
    assert np.all(found[:, 0] > 0.0)
    assert np.all(found[:, 1] > FAR)
    at_vertex = 2 * found[1:, 0] - found[:-1, 0]
    np.testing.assert_allclose(at_vertex[1:] / at_vertex[:-1], 0.25, rtol=0.1)

    # There no forward contact is left; by shooting the branch goes on, with a moment that pulls the drive.
    f = float(np.hypot(last.force_x, last.force_y))
    for alpha in (-1e-6, -1e-4):
        at = contour.point(alpha)
        guess = (np.pi, -1e-3, f, last.contact_arclength)
        drive, moment, force, arclength = shoot(tuple(float(v) for v in at), alpha, guess, alpha)
        assert moment < 0.0
        assert drive < np.pi
        beyond = eigenvalues(Held(drive, moment, force, alpha, 1.0, arclength, False))
        assert beyond[0] < -0.1
        assert beyond[1] > FAR


@pytest.mark.filterwarnings("ignore::tactile_bayes.errors.ClearanceWarning")
@pytest.mark.parametrize("q", [0.5, *(pytest.param(q, marks=pytest.mark.slow) for q in (0.3, 0.7))])
@pytest.mark.parametrize("name", RODS)
def test_curved_and_tapered_rods_are_stable_up_to_their_snap_off(name, q):
    """Also while the load only straightens the rod, and the contact moves outward: the drive angle grows there too."""
    bent, taper = RODS[name]
    rod, contour = Rod(rest_curvature=bent, taper=taper), Parabola(0.5, q)
    along = {
        "curvature": bent if callable(bent) else lambda s: np.full_like(s, bent),
        "rigidity": lambda s: (1.0 - taper * s) ** 4,
    }

    def of_state(state):
        return eigenvalues(held(contour, state, **along), terms=40)[:2]

    def eigenvalue(alpha):
        return of_state(equilibria(contour, [alpha], rig=Rig(rod=rod)).isel(slope_angle=0))[0]

    swept = scan(contour, direction="forward", rig=Rig(rod=rod), drive_step=0.02)
    record, last = swept.record, swept.events["forward"].snap_off
    names = ("slope_angle", "contact_phase", "contact_arclength")
    record = record.rename({f"truth_{name}": name for name in names})
    loaded = np.flatnonzero(record.contact_phase.values != "none")
    way = [of_state(record.isel(sample=k)) for k in loaded[1 : -1 : max(1, loaded.size // 10)]]
    assert np.min(way) > 1e3 * EIGENVALUE

    if last.kind == "fold":
        assert_zero_is_crossed(eigenvalue, last)
    else:
        assert last.kind == "corner"  # it jumps where the phase changes
        for near in (1e-3, 1e-9):
            assert eigenvalue(last.slope_angle + near) > 1e3 * EIGENVALUE
            assert eigenvalue(last.slope_angle - near) < -1e3 * EIGENVALUE
