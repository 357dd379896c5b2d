"""Points of a rod at rest, found on its kept steps and by following it."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.profiled_rods import drawn_rods
from tactile_bayes.mechanics.compiler import cached
from tactile_bayes.mechanics.poses import beam, profile_shape

_chord_along, _chord_at_rest = profile_shape.chord_along, profile_shape.chord_at_rest
_beam_of, _mirrored_beam = beam.beam_of, beam.mirrored_beam


@cached
def _found(varied, stem, mirrored, distances, kept, followed):
    rod = _beam_of(0.0, varied, stem)
    if mirrored:
        rod = _mirrored_beam(rod)
    profile, work = rod.varied.profile, rod.varied.work
    for i in range(distances.size):
        for k, value in enumerate(_chord_at_rest(profile, stem, distances[i], rod.varied.at_rest, work)):
            kept[i, k] = value
        for k, value in enumerate(_chord_along(profile, stem, distances[i], work)):
            followed[i, k] = value


@pytest.mark.parametrize("rows", [400, 3], ids=["all kept", "room for two steps"])
@pytest.mark.parametrize("stem", [0.0, 0.2])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("rod", ["uniform", "cone", "parabolic", "wavy", "table"])
def test_points_by_distance(rod, mirrored, stem, rows):
    """Also beyond the tip, beyond all of the rod, and of a rod that curls; the shape at rest has no taper."""
    varied = beam.varied(drawn_rods()[rod].profile._replace(bend=0.1))
    room = profile_shape.AtRest(np.full((rows, 8), np.nan), np.empty((rows, *varied.at_rest.series.shape[1:])))
    distances = stem + np.array([0.01, 0.3, 0.7, 0.9, 0.97, 1.2, 9.0])
    kept, followed = np.empty((2, distances.size, 5))
    _found(varied._replace(at_rest=room), stem, mirrored, distances, kept, followed)
    assert np.isfinite(followed).all()
    np.testing.assert_allclose(kept, followed, rtol=0.0, atol=1e-12)
    reached = followed[:, 1] >= distances - 1e-9
    assert reached[0]
    assert not reached[-1]


def test_a_curled_rod_is_met_at_its_first_point_or_its_farthest():
    varied = beam.varied(drawn_rods()["arc"].profile._replace(bend=7.0))
    kept, followed = np.empty((2, 3, 5))
    _found(varied, 0.0, False, np.array([0.1, 0.2, 0.5]), kept, followed)
    np.testing.assert_allclose(kept, followed, rtol=0.0, atol=1e-12)
    curvature = 7.8
    np.testing.assert_allclose(kept[:2, 0], 2.0 / curvature * np.arcsin(0.5 * curvature * np.array([0.1, 0.2])))
    np.testing.assert_allclose(kept[2, 1], 2.0 / curvature)  # its farthest point is passed again and again
