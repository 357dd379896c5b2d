import numpy as np
import pytest
import xarray as xr
from scipy import stats

from tactile_bayes.assessment.sampling_error import sampling_error
from tactile_bayes.errors import InferenceError


def flat(q, x_c=0.0, family="parabola"):
    values = {"a": np.full_like(q, 0.5), "q": q, "x_c": np.full_like(q, x_c)}
    tree = xr.DataTree.from_dict({"posterior": xr.Dataset({k: (("chain", "draw"), v) for k, v in values.items()})})
    tree.attrs = {"family": family, "units": "dimensionless"}
    return tree


def test_error_of_independent_normal_draws_is_that_of_order_statistics():
    """The standard error of a quantile is √(p(1 − p)/n)/density; an estimate scatters by a fifth, their mean by 4 %."""
    rng = np.random.default_rng(3)
    found = [sampling_error(flat(rng.normal(size=(4, 1000))), [0.0], 0.9) for _ in range(30)]
    level = stats.norm.ppf(0.05)
    exact = np.sqrt(0.05 * 0.95 / 4000) / stats.norm.pdf(level)
    assert np.mean([float(each.lower_error[0]) for each in found]) == pytest.approx(exact, rel=0.16)
    assert np.mean([float(each.upper_error[0]) for each in found]) == pytest.approx(exact, rel=0.16)
    larger = [float(max(each.lower_error[0], each.upper_error[0])) / (-2.0 * level) for each in found]
    assert [float(each.share[0]) for each in found] == pytest.approx(larger, rel=0.1)  # the band's width to some 2 %


def test_walkers_that_repeat_themselves_need_more_draws():
    rng = np.random.default_rng(4)
    independent = rng.normal(size=(4, 1000))
    repeated = np.repeat(rng.normal(size=(4, 50)), 20, axis=1)
    few, many = (sampling_error(flat(q), [0.0]) for q in (repeated, independent))
    assert float(few.share[0]) > 2.0 * float(many.share[0])  # √20 on the mean, each to a quarter
    assert int(few.draws_needed) > 4 * int(many.draws_needed)
    assert float(few.effective_draws) < 0.3 * float(many.effective_draws)


def test_draws_needed_follow_from_the_square_of_the_share():
    found = sampling_error(flat(np.random.default_rng(5).normal(size=(2, 30))), [0.0])
    assert int(found.draws_needed) == int(np.ceil(60 * (float(found.share.max()) / 0.1) ** 2))


def test_where_contours_end_there_is_no_error():
    r = np.random.default_rng(6).uniform(0.5, 0.6, (4, 50))
    tree = flat(np.full_like(r, 0.3))
    tree["posterior"] = tree["posterior"].to_dataset().rename(a="r").assign(r=(("chain", "draw"), r))
    tree.attrs["family"] = "circle"
    found = sampling_error(tree, [0.0, 0.55])
    assert np.isfinite(found.lower_error[0])
    assert np.isnan(found.lower_error[1])
    with pytest.raises(InferenceError, match="no grid point"):
        sampling_error(tree, [2.0])
