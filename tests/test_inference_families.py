"""Families of contours: their priors and their fits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.families import FAMILIES, family_named

CASES = {"parabola": (0.8, 0.3, -0.2), "circle": (0.7, 0.3, -0.2)}


def test_an_unknown_family_is_refused_with_those_that_there_are():
    with pytest.raises(ParameterError, match="no family 'ellipse': choose 'parabola' or 'circle'"):
        family_named("ellipse")


@pytest.mark.parametrize("name", FAMILIES)
def test_a_fit_to_exact_points_is_exact(name):
    family = family_named(name)
    contour = family.build(*CASES[name])
    x = np.linspace(-0.6, 0.3, 40)
    found = family.fit(x, contour.height(x))
    np.testing.assert_allclose([found[n] for n in family.parameters], CASES[name], rtol=1e-6)


@pytest.mark.parametrize("name", FAMILIES)
def test_outliers_do_not_rule_a_fit(name):
    """A tenth of the points is off by 0.15 rod lengths, the others by 1e-3: parameters within 0.02."""
    family = family_named(name)
    contour = family.build(*CASES[name])
    rng = np.random.default_rng(1)
    x = np.linspace(-0.6, 0.3, 60)
    y = contour.height(x) + 1e-3 * rng.normal(size=x.size)
    y[rng.choice(x.size, 6, replace=False)] += 0.15
    found = family.fit(x, y)
    np.testing.assert_allclose([found[n] for n in family.parameters], CASES[name], atol=0.02)


@pytest.mark.parametrize("name", FAMILIES)
@given(x=st.floats(-2.0, 2.0), y=st.floats(-2.0, 2.0), length=st.floats(0.01, 10.0), u=st.floats(0.01, 0.99))
def test_priors_move_with_the_pivot_and_scale_with_the_rod(name, x, y, length, u):
    family = family_named(name)
    unit = family.default_priors((0.0, 0.0), 1.0)
    moved = family.default_priors((x, y), length)
    shift = {"q": y, "x_c": x}
    assert set(unit) == set(moved) == set(family.parameters)
    for parameter, power in family.length_powers.items():
        expected = unit[parameter].ppf(u) * length**power + shift.get(parameter, 0.0)
        assert moved[parameter].ppf(u) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", FAMILIES)
def test_positive_parameters_are_those_that_the_contour_refuses(name):
    family = family_named(name)
    for parameter in family.parameters:
        values = dict(zip(family.parameters, CASES[name], strict=True)) | {parameter: -0.1}
        if parameter in family.positive:
            with pytest.raises(ValueError, match="positive"):
                family.build(**values)
        else:
            family.build(**values)
