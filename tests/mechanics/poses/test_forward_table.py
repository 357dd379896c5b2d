"""Poses from tables against integrated ones."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.profiled_rods import drawn_rods
from tactile_bayes.mechanics.compiler import cached
from tactile_bayes.mechanics.poses import beam, forward_table, taylor
from tactile_bayes.mechanics.poses.forward_table import NO_TABLE, Box
from tactile_bayes.mechanics.poses.forward_table import forward_table as tabulated
from tactile_bayes.mechanics.rods.profile import profile_of

_beam_of, _beam_pose, _prepare, _Varied = beam.beam_of, beam.beam_pose, forward_table.prepare, beam.Varied
_most = taylor.most_rest_curvature

RODS = {name: drawn_rods()[name].profile for name in ("uniform", "half cone", "cone", "parabolic")}

# Largest errors of a pose, over the arc length, and of its derivatives by share of the ranges.
ERROR, ERROR_OF_SLOPES = 1e-5, 1e-3


@cached
def _poses(varied, table, delta, psi1, arclength, force, tip, out):
    profile, work, remainder, at_rest, sheet, _, _ = varied
    slenderness = table.slenderness if _prepare(table, profile, delta, sheet) else 0.0
    known = _Varied(profile, work, remainder, at_rest, sheet, slenderness, profile.sign)
    rod = _beam_of(0.0, known, 0.0)
    for i in range(psi1.size):
        for k, pose in enumerate(_beam_pose(rod, psi1[i], arclength[i], force[i], tip)):
            out[i, k, 0], out[i, k, 1], out[i, k, 2] = pose
    return slenderness > 0.0


@cached
def bound(profile):
    return _most(profile)


def poses(profile, table, delta, psi1, arclength, force, tip):
    """Poses and slopes, shape (n, 3, 3), and whether the table holds the rod."""
    columns = [np.array(a, dtype=float) for a in np.broadcast_arrays(psi1, arclength, force)]
    out = np.empty((columns[0].size, 3, 3))
    return _poses(beam.varied(profile), table, delta, *columns, tip, out), out


def assert_integrated(profile, table, tip, places):
    """Beyond the ranges of a table that holds the rod poses are those without one."""
    held, found = poses(profile, table, 0.0, *np.transpose(places), tip)
    assert held
    np.testing.assert_array_equal(found, poses(profile, NO_TABLE, 0.0, *np.transpose(places), tip)[1])


def length(profile, arclength):
    """Λ of a rod without a rigidity profile."""
    return arclength / (1.0 - profile.taper * arclength)


def compared(profile, table, delta, seed=1):
    """Compare poses before the thrust in all of a table's ranges, with those at their ends."""
    rng = np.random.default_rng(seed)
    share = np.concatenate([rng.uniform(size=200), [0.0, 1.0, 0.0, 1.0, 0.5]])
    scaled = 18.0 * np.concatenate([rng.uniform(size=200), [0.0, 0.0, 1.0, 1.0, 0.0]])
    for tip in (True, False):
        psi1 = 1.39 * share - delta * (1.0 - share) if tip else np.full(share.size, -delta)
        arclength = np.ones(share.size) if tip else np.maximum(share, 1e-3)
        force = scaled / length(profile, arclength) ** 2
        held, found = poses(profile, table, delta, psi1, arclength, force, tip)
        _, exact = poses(profile, NO_TABLE, delta, psi1, arclength, force, tip)
        assert held
        before = exact[:, 0, 0] >= 0.0
        scale = np.stack([arclength, arclength, np.ones(share.size)], axis=1)
        np.testing.assert_array_less((np.abs(found - exact)[:, 0] / scale)[before], ERROR)
        by_q = np.abs(found - exact)[:, 1]
        by_force = np.abs(found - exact)[:, 2] / length(profile, arclength)[:, None] ** 2 / scale
        assert by_q[before].max() < ERROR_OF_SLOPES
        assert by_force[before].max() < ERROR_OF_SLOPES


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("rod", RODS)
def test_poses_of_a_rod(rod, sign):
    profile = RODS[rod]
    table = tabulated(profile, Box((profile.taper,) * 2, (0.0, 0.0), (0.3, 0.3)))
    compared(profile._replace(sign=sign), table, 0.3)


@pytest.mark.parametrize("sign", [1.0, pytest.param(-1.0, marks=pytest.mark.slow)])
def test_poses_of_rods_between_nodes_and_at_the_ends_of_ranges(sign):
    profile = profile_of(lambda s: 0.5 - s, 1.0, 0.5)
    table = tabulated(profile, Box((0.35, 0.65), (-0.2, 0.2), (0.0, 0.5)))
    for taper, bend, delta in ((0.35, 0.2, 0.0), (0.65, -0.2, 0.5), (0.41, 0.07, 0.2), (0.6, 0.0, 0.01)):
        compared(profile._replace(taper=taper, bend=bend, sign=sign), table, delta)


@pytest.mark.slow
def test_beyond_its_ranges_a_pose_is_integrated():
    """A table never extrapolates, in what differs between sweeps and in what differs in one."""
    profile = RODS["half cone"]
    table = tabulated(profile, Box((0.45, 0.55), (-0.1, 0.1), (0.0, 0.5)))
    for far in ({"taper": 0.56}, {"taper": 0.44}, {"bend": -0.11}):
        assert not poses(profile._replace(**far), table, 0.0, [0.1], [1.0], [1.0], True)[0]
    assert not poses(profile, table, 0.51, [0.1], [1.0], [1.0], True)[0]
    assert_integrated(profile, table, True, [[-1.1, 1.0, 1.0], [1.5, 1.0, 1.0], [0.2, 1.0, 40.0]])
    assert_integrated(profile, table, False, [[0.0, -0.01, 1.0], [0.0, 1.4, 1.0], [0.0, 0.5, 400.0]])


def test_a_rod_that_needs_too_many_terms_has_no_table():
    wavy = profile_of(lambda s: 4.0 * np.cos(40.0 * s))
    for profile in (wavy, drawn_rods()["stepped"].profile):
        assert tabulated(profile, Box((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))) is NO_TABLE


def test_the_bound_of_the_rest_curvature_is_not_below_it():
    for rod in drawn_rods().values():
        for sign in (1.0, -1.0):
            profile = rod.profile._replace(sign=sign, bend=0.1)
            s = np.linspace(0.0, 1.0, 1001)
            most = max(sign * (rod.curvature(at) + 0.1) for at in s)
            assert bound(profile) >= most - 1e-9
