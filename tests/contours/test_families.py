"""Families of contours: their priors and their fits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.refusals import refused
from tactile_bayes.contours.families import FAMILIES, FLANKS, family_named
from tactile_bayes.errors import ContourError, ParameterError
from tactile_bayes.inference.parameters.priors import default_priors

OWN = {"parabola": (0.8,), "circle": (0.7,), "ellipse": (0.9, 0.6), "power-law": (1.2, 2.5)}
CASES = {
    name: (*(v for flank in name.split("/") for v in OWN[flank]), 0.3, -0.2)
    for name in FAMILIES
    if name not in ("shape-free", "flat-sided")
}


def test_an_unknown_family_is_refused_with_those_that_there_are():
    with refused(ParameterError, "'blob'", "parabola"):
        family_named("blob")


def test_two_flanks_meet_in_their_vertex():
    contour = family_named("circle/power-law").build(0.7, 1.2, 2.5, 0.3, -0.2)
    left, right = FAMILIES["circle"].build(0.7, 0.3, -0.2), FAMILIES["power-law"].build(1.2, 2.5, 0.3, -0.2)
    assert contour.height(-0.5) == left.height(-0.5)
    assert contour.height(0.5) == right.height(0.5)
    assert contour.height(-0.2) == 0.3


@pytest.mark.parametrize("name", CASES)
def test_a_fit_to_exact_points_is_exact(name):
    family = family_named(name)
    contour = family.build(*CASES[name])
    x = np.linspace(-0.6, 0.3, 40)
    found = family.fit(x, contour.height(x))
    np.testing.assert_allclose([found[n] for n in family.parameters], CASES[name], rtol=1e-5)


@pytest.mark.parametrize("name", [*FLANKS, "ellipse/power-law"])
def test_outliers_do_not_rule_a_fit(name):
    """A tenth of the points is off by 0.15 rod lengths, the others by 1e-3: the contour within 3e-3."""
    family = family_named(name)
    contour = family.build(*CASES[name])
    rng = np.random.default_rng(1)
    x = np.linspace(-0.6, 0.3, 60)
    y = contour.height(x) + 1e-3 * rng.normal(size=x.size)
    y[rng.choice(x.size, 6, replace=False)] += 0.15
    found = family.fit(x, y)
    fitted = family.build(*(found[n] for n in family.parameters))
    np.testing.assert_allclose(fitted.height(x), contour.height(x), atol=3e-3)


@pytest.mark.parametrize("name", [*FLANKS, "ellipse/power-law"])
@settings(deadline=None)
@given(x=st.floats(-2.0, 2.0), y=st.floats(-2.0, 2.0), length=st.floats(0.01, 10.0), u=st.floats(0.01, 0.99))
def test_priors_move_with_the_pivot_and_scale_with_the_rod(name, x, y, length, u):
    family = family_named(name)
    unit = default_priors(family, (0.0, 0.0), 1.0)
    moved = default_priors(family, (x, y), length)
    shift = {"q": y, "x_c": x}
    assert set(unit) == set(moved) == set(family.parameters)
    for parameter, power in family.length_powers.items():
        expected = unit[parameter].ppf(u) * length**power + shift.get(parameter, 0.0)
        assert moved[parameter].ppf(u) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_bounds_are_those_of_the_contour(name):
    """Beyond them it refuses, just within it does not."""
    family = family_named(name)
    for index, parameter in enumerate(family.parameters):
        for end, inward in zip(family.bounds[parameter], (0.01, -0.01), strict=True):
            if np.isfinite(end):
                values = np.array(CASES[name])
                values[index] = end + inward
                family.build(*values)
                values[index] = end - inward
                with pytest.raises(ContourError):
                    family.build(*values)


@pytest.mark.parametrize("name", CASES)
def test_priors_stay_within_the_bounds_mostly(name):
    family = family_named(name)
    for parameter, prior in default_priors(family, (0.0, 0.0), 1.0).items():
        low, high = family.bounds[parameter]
        assert prior.cdf(high) - prior.cdf(low) > 0.999


@pytest.mark.parametrize("length", [0.0, -0.2, np.inf])
def test_a_flat_side_has_a_length(length):
    family = FAMILIES["flat-sided"]
    values = dict.fromkeys(family.parameters, 0.5)
    assert family.contour(values).point(0.6)[0] > FAMILIES["shape-free"].contour(values).point(0.6)[0]
    with refused(ContourError, "flat-sided", "flat_length"):
        family.contour({**values, "flat_length": length})
