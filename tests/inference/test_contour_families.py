"""Posteriors of families beyond parabola and circle: near the truth, and of contours that the rod is clear of."""

import numpy as np
import pytest

from helpers.contour_posteriors import CELL, assert_near, infer_as_stated
from tactile_bayes.contours.families import family_named
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.parameters.priors import default_priors
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.sweep import scan, scan_many

SETTINGS = SamplerSettings(min_ess=300.0, max_r_hat=1.02)
BRIEF = SamplerSettings(ensembles=2, walkers=32, min_ess=150.0, max_r_hat=1.05)
TRUTHS = {
    "ellipse": (0.7, 0.5, 0.5, 0.05),
    "power-law": (1.0, 3.0, 0.5, 0.02),
    "parabola/power-law": (0.5, 1.0, 4.0, 0.4, 0.0),
    "circle/ellipse": (0.7, 0.8, 0.4, 0.5, 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TRUTHS)
def test_posteriors_lie_about_the_truth(name):
    """Within 4.5 posterior standard deviations: false alarm 7e-6 a number, if the posterior is right."""
    family = family_named(name)
    record = scan(family.build(*TRUTHS[name]), drive_step=np.radians(3.0)).record
    settings = BRIEF if name == "ellipse" else SETTINGS
    result = infer_as_stated(CELL.measure(record, rng=3), family=name, rng=1, settings=settings)
    assert_near(result, dict(zip(family.parameters, TRUTHS[name], strict=True)), 4.5)
    contours = contours_of(result["posterior"].to_dataset().isel(draw=slice(None, None, 40)), name)
    many = scan_many(contours, np.full((contours.shape[0], 1), 1.5))
    assert many.clear.all()


@pytest.mark.slow
def test_contours_that_the_rod_would_cut_after_snap_off_are_not_usable():
    """The same as `scan_many` says, of ellipses of which some are not clear."""
    rng = np.random.default_rng(5)
    count = 20_000
    family = family_named("ellipse")
    priors = default_priors(family, (0.0, 0.0), 1.0)
    points = [priors[name].rvs(count, random_state=rng) for name in family.parameters]
    contours = family.build(*points)
    swept = [scan_many(contours, np.full((count, 1), 1.5), direction=way) for way in ("forward", "backward")]
    wanted = np.all([(many.status == "ok").values & many.clear.values.astype(bool) for many in swept], axis=0)
    record = CELL.measure(scan(family.build(*TRUTHS["ellipse"])).record, rng=1)
    usable = RecordLikelihood(record, CELL, is_always_clear=False).usable(contours)
    assert np.count_nonzero(usable != wanted) <= 1  # where snap-off is approximate
    reached = RecordLikelihood(record, CELL).usable(contours)
    assert np.count_nonzero(reached & ~usable) >= 1
