"""What sets the width of a band, against conditional variances of a normal posterior."""

import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm

from helpers.contour_posteriors import touched, tree
from helpers.refusals import refused
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.uncertainty.budget import uncertainty_budget

# Covariance of the height, the stiffness and the lever of a posterior, and of a noise that has nothing to do with it.
HEIGHT = 1e-4 * np.array([1.0, 0.9, -0.7, 0.0])
COVARIANCE = np.diag([1.0, 1.0, 1.0, 1.0])
COVARIANCE[0, 1:], COVARIANCE[1:, 0] = HEIGHT[1:] / 1e-4, HEIGHT[1:] / 1e-4
COVARIANCE[1, 2] = COVARIANCE[2, 1] = -0.6


def shifted(seed=1, size=40_000):
    """Flat circles of which only the height varies, with unknowns of the rig beside them."""
    whole = COVARIANCE[:4, :4]
    z = np.random.default_rng(seed).multivariate_normal(np.zeros(4), whole, size).T.reshape(4, 4, -1)
    none = np.zeros_like(z[0])
    posterior = tree("circle", r=50.0 + none, q=0.4 + 1e-3 * z[0], x_c=none)
    draws = posterior["posterior"].to_dataset()
    over = ("chain", "draw")
    names = ("rigidity_scale", "lever_y", "noise_scale")
    posterior["posterior"] = xr.DataTree(
        draws.assign({name: (over, 2.0 + 3.0 * each) for name, each in zip(names, z[1:], strict=True)})
    )
    return touched(posterior, first_contact_x=0.3, snap_off_contact_x=-0.3)


def test_widths_and_shares_are_those_of_the_conditional_distributions():
    found = uncertainty_budget(shifted(), 0.9)
    half = 1e-3 * norm.ppf(0.95)
    np.testing.assert_allclose(found.half_width, half, rtol=0.05)
    by_name = dict(zip(found.unknown.values.tolist(), found.share.values, strict=True))
    assert by_name["rigidity_scale"] == pytest.approx(0.81, abs=0.02)
    assert by_name["lever_y"] == pytest.approx(0.49, abs=0.03)
    assert by_name["noise_scale"] < 0.01
    known = found.half_width_if_known.sel(unknown="rigidity_scale")
    np.testing.assert_allclose(known, half * np.sqrt(1.0 - 0.81), rtol=0.05)
    rest = 1.0 - COVARIANCE[0, 1:] @ np.linalg.solve(COVARIANCE[1:, 1:], COVARIANCE[1:, 0])
    np.testing.assert_allclose(found.half_width_if_all_known, half * np.sqrt(rest), rtol=0.07)
    assert float(found.half_width_of_shape) < 1e-9


def test_a_rig_without_unknowns_leaves_the_width_to_the_noise():
    posterior = shifted()
    draws = posterior["posterior"].to_dataset()
    posterior["posterior"] = xr.DataTree(draws.drop_vars(["rigidity_scale", "lever_y", "noise_scale"]))
    found = uncertainty_budget(posterior)
    assert found.sizes["unknown"] == 0
    assert float(found.half_width_if_all_known) == float(found.half_width)


def test_what_has_no_band_is_refused():
    posterior = shifted()
    with refused(ParameterError, probability=1.0):
        uncertainty_budget(posterior, 1.0)
    with refused(InferenceError, "events"):
        uncertainty_budget(tree("circle", r=[0.5], q=[0.4], x_c=[0.0]))
