"""ArviZ takes a result: every statistic and plot that applies is called, and for the others there is a reason."""

import functools
import importlib
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot as plt
from scipy import stats

from helpers.contour_posteriors import MODEST, infer_as_stated
from tactile_bayes import scan, to_arviz
from tactile_bayes.comparison.leave_one_out import left_out
from tactile_bayes.runs.demonstration import CONTOUR, LOAD_CELL, RIG

# What ArviZ and its parts say of versions to come of themselves and of their dependencies.
pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::FutureWarning"),
    pytest.mark.filterwarnings("ignore:.*eval_points"),
]


@functools.cache
def demonstrated() -> xr.DataTree:
    """A posterior of the demonstration, of a coarser sweep."""
    measured = LOAD_CELL.measure(scan(CONTOUR, RIG, drive_step=0.1).record, rng=1)
    return infer_as_stated(measured, load_cell=LOAD_CELL, rng=1, settings=MODEST)


def library(name: str) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # ArviZ 0.23 announces its refactoring
        return importlib.import_module(name)


def handed(name: str = "arviz_stats") -> Any:
    """The demonstration's result in the form of a library, and for a single channel."""
    given = to_arviz(demonstrated())
    return given if name == "arviz" or isinstance(given, xr.DataTree) else given.to_datatree()


def one_channel(tree: xr.DataTree) -> xr.DataTree:
    return tree.sel(channel="force_x")


def values(tree: Any) -> np.ndarray:
    return tree.posterior.a.values


def predicted(tree: Any) -> tuple[np.ndarray, np.ndarray]:
    """Readings, shape (n,), and predictions, shape (draws, n)."""
    readings = tree.observed_data.record.values.ravel()
    return readings, tree.posterior_predictive.record.values.reshape(-1, readings.size)


def middle(tree: Any) -> float:
    return float(tree.posterior.q.mean())


def two(tree: Any) -> dict[str, Any]:
    return {"one": tree, "other": tree}


Uses = dict[str, Callable[[Any, Any], Any] | str]
"""Calls of a library and a tree by the function's name, or why there is none."""


def plain(names: str) -> Uses:
    """Functions that take the tree alone."""
    return {name: lambda library, tree, name=name: getattr(library, name)(tree) for name in names.split()}


def none(reason: str, names: str) -> Uses:
    return dict.fromkeys(names.split(), reason)


NO_ENERGY = "of Hamiltonian samplers"
REFITS = "infers again through a wrapper of the model, which trust and compare_families do by themselves"
DISCRETE = "of discrete or binary data"
SURVIVAL = "of times of survival"
REGRESSION = "of a regression whose posterior holds a mean for every observation"
TOOL = "a tool for other functions"
ARVIZ: Uses = {
    **none(NO_ENERGY, "bfmi plot_energy plot_parallel"),
    **none(TOOL, "make_ufunc smooth_data wrap_xarray_ufunc"),
    **none(REFITS, "reloo"),
    **none(DISCRETE, "plot_separation"),
    **plain("ess hdi loo mcse rhat summary waic plot_autocorr plot_bpv plot_density plot_dist_comparison plot_ess"),
    **plain("plot_forest plot_mcse plot_pair plot_posterior plot_rank plot_trace plot_violin"),
    "apply_test_function": lambda az, tree: az.apply_test_function(tree, lambda y, _: y.mean(), inplace=False),
    "autocorr": lambda az, tree: az.autocorr(values(tree)),
    "autocov": lambda az, tree: az.autocov(values(tree)),
    "bayes_factor": lambda az, tree: az.bayes_factor(tree, "q", ref_val=middle(tree)),
    "compare": lambda az, tree: az.compare(two(tree)),
    "kde": lambda az, tree: az.kde(values(tree).ravel()),
    "loo_pit": lambda az, tree: az.loo_pit(tree, y="record"),
    "plot_bf": lambda az, tree: az.plot_bf(tree, "q", ref_val=middle(tree)),
    "plot_compare": lambda az, tree: az.plot_compare(az.compare(two(tree))),
    "plot_dist": lambda az, tree: az.plot_dist(values(tree)),
    "plot_dot": lambda az, tree: az.plot_dot(values(tree).ravel()[:100]),
    "plot_ecdf": lambda az, tree: az.plot_ecdf(values(tree).ravel()),
    "plot_elpd": lambda az, tree: az.plot_elpd(two(tree)),
    "plot_hdi": lambda az, tree: az.plot_hdi(
        tree.constant_data.drive_angle.values, tree.posterior_predictive.record.values[..., 0]
    ),
    "plot_kde": lambda az, tree: az.plot_kde(values(tree).ravel()),
    "plot_khat": lambda az, tree: az.plot_khat(az.loo(tree, pointwise=True)),
    "plot_lm": lambda az, tree: az.plot_lm(
        idata=tree, y="record", x=tree.constant_data.drive_angle, plot_dim="row", num_samples=20
    ),
    "plot_loo_pit": lambda az, tree: az.plot_loo_pit(tree, y="record"),
    "plot_ppc": lambda az, tree: az.plot_ppc(tree, num_pp_samples=20),
    "plot_ts": lambda az, tree: az.plot_ts(tree, y="record", plot_dim="row", num_samples=20),
    "psens": lambda az, tree: (az.psens(tree), az.psens(tree, component="likelihood")),
    "psislw": lambda az, tree: az.psislw(-tree.log_likelihood.record.values[..., 0, 0].ravel()),
    "r2_samples": lambda az, tree: az.r2_samples(*predicted(tree)),
    "r2_score": lambda az, tree: az.r2_score(*predicted(tree)),
    "weight_predictions": lambda az, tree: az.weight_predictions([tree, tree]),
}
ARVIZ_STATS: Uses = {
    **none(NO_ENERGY, "bfmi"),
    **none(TOOL, "get_function get_log_likelihood"),
    **none(REFITS, "loo_kfold loo_moment_match reloo"),
    **none(REGRESSION, "bayesian_r2 residual_r2"),
    **none(SURVIVAL, "generate_survival_curves kaplan_meier"),
    "loo_approximate_posterior": "of draws of an approximation, not of the posterior",
    "update_subsample": "goes on with loo_subsample",
    **plain(
        "ess eti hdi histogram kde loo loo_pit loo_score mcse mean median mode psense_summary qds rhat summary thin"
    ),
    "bayes_factor": lambda st, tree: st.bayes_factor(tree, var_names="q", ref_vals=middle(tree)),
    "ci_in_rope": lambda st, tree: st.ci_in_rope(tree, rope=(0.0, 1.0)),
    "compare": lambda st, tree: st.compare(two(tree)),
    "ecdf": lambda st, tree: st.ecdf(tree.posterior.dataset),
    "kl_divergence": lambda st, tree: st.kl_divergence(tree, tree, var_names="a"),
    "loo_expectations": lambda st, tree: st.loo_expectations(one_channel(tree)),
    "loo_i": lambda st, tree: st.loo_i({"row": 3, "channel": "force_x"}, tree),
    "loo_metrics": lambda st, tree: st.loo_metrics(one_channel(tree)),
    "loo_r2": lambda st, tree: st.loo_r2(one_channel(tree), var_name="record"),
    "loo_subsample": lambda st, tree: st.loo_subsample(tree, observations=100).elpd,
    "metrics": lambda st, tree: st.metrics(one_channel(tree)),
    "psense": lambda st, tree: (st.psense(tree), st.psense(tree, group="likelihood")),
    "rhat_nested": lambda st, tree: st.rhat_nested(tree, superchain_ids=[0, 1]),
    "wasserstein": lambda st, tree: st.wasserstein(tree, tree, var_names="a", joint=False, num_samples=50),
    "weight_predictions": lambda st, tree: st.weight_predictions([tree, tree]),
}
ARVIZ_PLOTS: Uses = {
    **none(NO_ENERGY, "plot_energy"),
    **none(DISCRETE, "plot_ppc_pava plot_ppc_pava_residuals plot_ppc_rootogram"),
    **none(SURVIVAL, "plot_ppc_censored"),
    "plot_ecdf_pit": "of ranks of a calibration: tb.calibrate has its own",
    **plain("plot_autocorr plot_convergence_dist plot_dgof plot_dgof_dist plot_dist plot_ess plot_ess_evolution"),
    **plain("plot_forest plot_loo_pit plot_mcse plot_pair plot_parallel plot_ppc_dist plot_ppc_tstat plot_trace_dist"),
    **plain(
        "plot_prior_posterior plot_psense_dist plot_psense_quantities plot_rank plot_rank_dist plot_ridge plot_trace"
    ),
    "add_bands": lambda ap, tree: ap.add_bands(ap.plot_dist(tree), values={"q": [(0.0, middle(tree))]}),
    "add_lines": lambda ap, tree: ap.add_lines(ap.plot_dist(tree), values={"q": middle(tree)}),
    "combine_plots": lambda ap, tree: ap.combine_plots(tree, plots=[(ap.plot_trace, {}), (ap.plot_rank, {})]),
    "plot_bf": lambda ap, tree: ap.plot_bf(tree, var_names="q", ref_val=middle(tree)),
    "plot_compare": lambda ap, tree: ap.plot_compare(library("arviz_stats").compare(two(tree))),
    "plot_khat": lambda ap, tree: ap.plot_khat(library("arviz_stats").loo(tree, pointwise=True)),
    "plot_lm": lambda ap, tree: ap.plot_lm(one_channel(tree), x="drive_angle", y="record"),
    "plot_pair_focus": lambda ap, tree: ap.plot_pair_focus(tree, focus_var="q"),
    "plot_ppc_interval": lambda ap, tree: ap.plot_ppc_interval(one_channel(tree)),
    "plot_ppc_pit": lambda ap, tree: ap.plot_ppc_pit(one_channel(tree)),
}
USES = {"arviz": ARVIZ, "arviz_stats": ARVIZ_STATS, "arviz_plots": ARVIZ_PLOTS}
KNOWN = {"arviz": "0.23", "arviz_stats": "0.8", "arviz_plots": "0.8"}
"""Versions of which all functions are above; later ones have more."""


def installed(name: str) -> Any:
    """A library; those of the versions before or after ArviZ 1.0 may not be there."""
    if name == "arviz_plots":
        pytest.importorskip("arviz_plots", reason="ArviZ has it from 1.0 on")
    found = library(name)
    if name == "arviz" and int(found.__version__.split(".")[0]) >= 1:
        pytest.skip("from 1.0 on it is arviz_stats and arviz_plots")
    return found


def functions(found: Any) -> set[str]:
    """Statistics and plots of a library."""
    if found.__name__ == "arviz_plots":
        kinds = ("plot_", "add_", "combine_")
        return {name for name in dir(found) if name.startswith(kinds) and callable(getattr(found, name))}
    listed = dir(found) if found.__name__ == "arviz_stats" else [*found.stats.__all__, *found.plots.__all__]
    return {name for name in listed if callable(getattr(found, name)) and not name[0].isupper() and name[0] != "_"}


@pytest.mark.parametrize("name", USES)
def test_every_function_is_called_or_the_reason_is_given(name):
    found = installed(name)
    if not found.__version__.startswith(KNOWN[name]):
        pytest.skip(f"the list is of {KNOWN[name]}")
    assert functions(found) - set(USES[name]) == set()


CALLS = [
    pytest.param(
        name, function, id=f"{name}.{function}", marks=[pytest.mark.slow] if function.startswith("plot_") else []
    )
    for name, uses in USES.items()
    for function, use in uses.items()
    if callable(use)
]


@pytest.mark.parametrize(("name", "function"), CALLS)
def test_what_applies_runs(name, function):
    found = installed(name)
    if not hasattr(found, function):
        pytest.skip(f"{found.__version__} has none")
    assert USES[name][function](found, handed(name)) is not None
    plt.close("all")


# ---- what it is given, and finds


def test_all_groups_have_the_same_draws_and_readings():
    own, given = demonstrated(), handed()
    draw = own["log_likelihood"].draw
    for group in ("posterior", "log_prior", "log_likelihood", "posterior_predictive", "events"):
        np.testing.assert_array_equal(given[group].draw, draw)
    for name in ("holding_moment", "force_x", "force_y"):
        for group in ("observed_data", "posterior_predictive"):
            np.testing.assert_array_equal(given[group]["record"].sel(channel=name), own[group][name])
    assert given["observed_data"]["record"].attrs["units"] == "N m, N, N"
    assert given["log_likelihood"]["record"].dims == given["posterior_predictive"]["record"].dims
    np.testing.assert_array_equal(given["posterior"].q, own["posterior"].q.sel(draw=draw))
    of_draws = given["log_likelihood"]["record"].sum(("row", "channel")) + given["log_prior"]["prior"]
    np.testing.assert_allclose(of_draws, given["sample_stats"].lp, rtol=1e-9)


def test_leave_one_out_is_that_of_our_own():
    tree = handed()
    logs = tree["log_likelihood"]["record"].values
    own = left_out(logs.reshape(*logs.shape[:2], -1)).log_density
    found = library("arviz_stats").loo(tree, pointwise=True)
    np.testing.assert_allclose(found.elpd_i.values.ravel(), own, atol=0.02)


def test_readings_left_out_are_predicted_with_uniform_probabilities():
    """By Kolmogorov and Smirnov, of a record of the model: false alarm 0.001."""
    found = library("arviz_stats").loo_pit(handed())["record"].values.ravel()
    assert stats.kstest(found, "uniform").pvalue > 0.001
