"""The compiled forward model: the same loads and the same usable contours as the arrays give, as far as noise shows."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_bayes.compiled import compiler
from tactile_bayes.contours import Joined, Parabola, ShapeFree
from tactile_bayes.inference.family_names import family_named
from tactile_bayes.inference.likelihood import FAST_ORDER, FINE_ORDER, RecordLikelihood, Rig
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import in_frame
from tactile_bayes.rod import Rod
from tactile_bayes.scanning import scan

CELL = LoadCell(force_noise=0.05, moment_noise=0.02)
THIN = Rod()
THICK = Rod(length=0.1, flexural_rigidity=1e-4, diameter=0.002)
NAMES = ["parabola", "circle", "ellipse", "power-law", "parabola/power-law", "circle/ellipse"]


def likelihood_of(rod, **options):
    """A record in both directions from two pivots, one of them to the side."""
    length = rod.length
    bases = [(0.0, 0.0), (0.15 * length, -0.1 * length)]
    record = scan(Parabola(0.5 / length, 0.5 * length), rod=rod, base=bases).record
    unit = LoadCell(force_noise=0.05 * rod.force_unit, moment_noise=0.02 * rod.moment_unit)
    return RecordLikelihood(record, unit, **options)


def drawn(name, rod, count, seed=1):
    family = family_named(name)
    rng = np.random.default_rng(seed)
    priors = family.default_priors((0.0, 0.0), rod.length)
    points = np.stack([priors[one].rvs(count, random_state=rng) for one in family.parameters])
    low, high = np.array([family.bounds.get(one, (-np.inf, np.inf)) for one in family.parameters]).T
    inside = ((points > low[:, None]) & (points < high[:, None])).all(axis=0)
    return family.build(*points[:, inside])


def arrays_of(likelihood, contours):
    loads, usable, _ = likelihood._by_arrays(contours)
    return loads[:, 0], usable


ALWAYS = (
    ("parabola", "thin"),
    ("circle", "thick"),
    ("ellipse", "thin"),
    ("power-law", "thick"),
    ("parabola/power-law", "thick"),
    ("circle/ellipse", "thin"),
)
"""Each family, and each rod with halves of two kinds."""


@pytest.mark.parametrize(
    ("name", "rod"),
    [
        pytest.param(name, rod, id=f"{name}-{kind}", marks=[] if (name, kind) in ALWAYS else pytest.mark.slow)
        for name in NAMES
        for kind, rod in (("thin", THIN), ("thick", THICK))
    ],
)
def test_loads_and_usable_contours_are_those_of_the_arrays(name, rod):
    likelihood = likelihood_of(rod, is_always_clear=False)
    contours = drawn(name, rod, 400)
    loads, usable = likelihood.predict(contours)
    _, usable_by_arrays = arrays_of(likelihood, contours)
    # Snap-off is as good as the interpolation on both sides: a contour may be clear by less than that.
    assert np.count_nonzero(usable != usable_by_arrays) <= 2
    both = usable & usable_by_arrays
    assert np.count_nonzero(both) > 30
    assert np.count_nonzero(~usable) > 30
    likelihood.order = FINE_ORDER
    exact, _ = arrays_of(likelihood, contours)
    off = np.abs(loads[both] - exact[both]) / likelihood.noise
    # Except for a sample at an event that falls on its other side.
    assert np.quantile(np.sqrt(np.square(off).sum(axis=(1, 2))), 0.95) < 0.015
    assert np.mean(off > 0.01) < 2e-3


def test_events_are_those_of_the_arrays():
    """To the tolerance of a snap-off, as read: with an offset, and with the backlash of each direction."""
    likelihood = likelihood_of(THIN, is_always_clear=False)
    contours = drawn("ellipse", THIN, 200)
    rig = Rig(drive_angle_offset=0.02, drive_angle_backlash=0.01)
    *_, usable, events = likelihood.predict_with_events(contours, rig)
    likelihood.order = FINE_ORDER
    *_, expected = likelihood.predict_with_events(contours, rig)
    assert events.shape == (contours.shape[0], len(likelihood.strokes), 2)
    assert np.count_nonzero(usable) > 30
    off = np.abs(events - expected)[usable]
    assert np.quantile(off, 0.99) < 1e-6
    assert off[..., 0].max() < 1e-9


def test_a_joint_with_an_edge_and_a_measured_shape_are_left_to_the_arrays():
    edge = Joined(Parabola(0.5, 0.5, 0.1), Parabola(0.5, 0.5, -0.1), x=0.0)
    assert edge.halves is None
    assert ShapeFree(np.linspace(-1.5, 1.5, 7), np.zeros(7), x=0.0, y=0.3).halves is None
    assert Joined(Parabola(0.5, 0.5), Parabola(1.0, 0.5)).halves is not None


@pytest.mark.parametrize("options", [{"friction": 0.2}, {"order": FINE_ORDER}], ids=["friction", "fine"])
def test_friction_and_fine_interpolation_are_left_to_the_arrays(options, monkeypatch):
    likelihood = likelihood_of(THIN, **options)
    monkeypatch.setattr(RecordLikelihood, "_by_compiled", lambda *_: pytest.fail("not by compiled code"))
    contours = drawn("parabola", THIN, 10)
    for made, expected in zip(likelihood.predict(contours), arrays_of(likelihood, contours), strict=True):
        np.testing.assert_array_equal(made, expected)


def test_what_is_known_of_a_contour_does_not_depend_on_others_beside_it():
    likelihood = likelihood_of(THIN)
    contours = drawn("power-law", THIN, 40)
    together = likelihood.log_likelihood(contours)
    apart = [likelihood.log_likelihood(contours.take(np.array([i])))[0] for i in range(contours.shape[0])]
    np.testing.assert_array_equal(together, apart)


def test_forces_are_in_the_frame_of_the_record():
    record = CELL.measure(scan(Parabola(0.5, 0.5)).record, seed=1)
    contours = drawn("parabola", THIN, 40)
    fixed = RecordLikelihood(record, CELL, order=FAST_ORDER).log_likelihood(contours)
    turning = RecordLikelihood(in_frame(record, "turning"), CELL, order=FAST_ORDER).log_likelihood(contours)
    np.testing.assert_allclose(turning, fixed, rtol=1e-9)


def test_where_nothing_can_be_kept_it_is_compiled_each_time(monkeypatch):
    njit = compiler.numba.njit

    def without_a_place(function, *, cache=False, **options):
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return njit(function, **options)

    monkeypatch.setattr(compiler.numba, "njit", without_a_place)

    def twice(x):
        return 2.0 * x

    assert compiler.kept(twice)(2.0) == 4.0
