"""Predictive intervals against the draws that they come from, and against the record."""

import numpy as np

from helpers.contour_posteriors import posterior
from tactile_bayes.record import CHANNELS
from tactile_bayes.uncertainty.predictive_interval import predictive_interval


def test_quantiles_of_the_draws_and_coverage_of_the_record():
    """Outside a 95 % interval lie about 5 % of the samples: within 4 binomial standard errors, false alarm 6e-5."""
    tree = posterior()
    interval = predictive_interval(tree, 0.95)
    for name in CHANNELS:
        draws = tree["posterior_predictive"].to_dataset()[name].values
        flat = draws.reshape(-1, draws.shape[-1])
        np.testing.assert_allclose(interval[f"{name}_lower"], np.quantile(flat, 0.025, axis=0))
        np.testing.assert_allclose(interval[f"{name}_upper"], np.quantile(flat, 0.975, axis=0))
        observed = tree["observed_data"].to_dataset()[name]
        outside = (observed < interval[f"{name}_lower"]) | (observed > interval[f"{name}_upper"])
        error = np.sqrt(0.05 * 0.95 / outside.size)
        assert abs(float(outside.mean()) - 0.05) < 4 * error
