"""The evidence of contour families against the mean likelihood over draws from their priors."""

import numpy as np
import pytest
from scipy import stats

from helpers.contour_posteriors import CELL, only, swept
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.evidence import WIDTHS, contour_evidence
from tactile_bayes.inference.experiment import Experiment, contour_problem
from tactile_bayes.inference.family import Family
from tactile_bayes.rig import Rig

NARROW = {
    "parabola": {"a": stats.lognorm(s=0.02, scale=0.5), "q": stats.norm(0.5, 0.0015), "x_c": stats.norm(0.0, 0.005)},
    "circle": {"r": stats.lognorm(s=0.02, scale=0.8), "q": stats.norm(0.5, 0.0015), "x_c": stats.norm(0.0, 0.005)},
}
TRUTHS = {"parabola": Parabola(0.5, 0.5), "circle": Circle(0.8, 0.5, 0.0)}
SETTINGS = SamplerSettings(ensembles=2, min_ess=400, max_r_hat=1.03)


def problem_of(family, truth, noise=1.0):
    measured = CELL.measure(swept(TRUTHS[truth], step=0.15), rng=4)
    rig = Rig(load_cell=CELL, unknown=only(noise_scale=stats.lognorm(s=0.1, scale=noise)))
    return contour_problem(Experiment(measured, rig, Family(family, **NARROW[family])))


@pytest.mark.slow
@pytest.mark.parametrize("family", ["parabola", "circle"])
def test_evidence_is_the_mean_likelihood_over_the_prior(family):
    """Of 20,000 draws from the widest prior, weighed for the others; within 4 standard errors."""
    model = (problem := problem_of(family, family)).model
    found = contour_evidence(model, sampled(problem, seed=1, settings=SETTINGS), np.random.default_rng(1))
    rng, count = np.random.default_rng(2), 20_000
    size = "a" if family == "parabola" else "r"
    priors = {width: stats.lognorm(s=0.02 * width, scale=model.priors[size].median()) for width in WIDTHS}
    widest = {**model.priors, size: priors[2.0]}
    points = np.stack([widest[name].rvs(count, random_state=rng) for name in model.names], axis=1)
    likelihood = model.likelihood.score(*model.loads_and_discrepancy(points)[:2], model.noise_scale(points))
    for log_evidence, prior in zip(found.log_evidence, priors.values(), strict=True):
        logs = likelihood + prior.logpdf(points[:, 0]) - priors[2.0].logpdf(points[:, 0])
        weights = np.exp(logs - logs.max())
        error = np.std(weights) / np.mean(weights) / np.sqrt(count)
        assert error < 0.15
        assert found.standard_error < 0.05
        assert found.overlap > 0.5
        direct = logs.max() + np.log(weights.mean())
        assert abs(log_evidence - direct) < 4.0 * np.hypot(error, found.standard_error)
