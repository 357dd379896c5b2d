"""Comparisons of families as `compare_families` returns them, made up."""

import numpy as np
import xarray as xr

from tactile_bayes.comparison.families import verdict_on

NAMES = ("parabola", "circle", "ellipse", "power-law", "power-law/power-law", "shape-free")


def made_up(probability, *, fits=True, sampled=True, converged=True, elpd=None, half=None, twice=None, k=0.5):
    """A comparison of the first few families; what is one value is that of every family."""
    probability = np.array(probability, dtype=float)
    size = probability.size
    sampled, fits, converged = (np.broadcast_to(flags, size).copy() for flags in (sampled, fits, converged))
    logs = np.where(probability > 0.0, np.log(np.maximum(probability, 1e-300)), np.nan) - 100.0
    widths = [probability if other is None else other for other in (half, None, twice)]
    variables = {
        "probability": ("family", probability),
        "log_evidence": ("family", logs),
        "log_evidence_error": ("family", np.where(np.isnan(logs), np.nan, 0.05)),
        "log_likelihood": ("family", np.full(size, -80.0)),
        "probability_by_width": (("prior_width", "family"), np.array(widths, dtype=float)),
        "p_value": ("family", np.where(sampled, np.where(fits, 0.4, 0.001), np.nan)),
        "fits": ("family", fits & sampled),
        "sampled": ("family", sampled),
        "converged": ("family", converged & sampled),
        "steps": ("family", np.where(sampled, 400, 0)),
        "seconds": ("family", np.where(sampled, 4.0, 0.0)),
    }
    if elpd is not None:
        elpd = np.where(sampled, np.array(elpd, dtype=float), np.nan)
        difference = elpd - np.nanmax(elpd)
        variables |= {
            "elpd": ("family", elpd),
            "elpd_error": ("family", 0.1 + 0.0 * elpd),
            "elpd_difference": ("family", difference),
            "elpd_difference_error": ("family", np.sqrt(-difference)),
            "weight": ("family", np.where(difference == 0.0, 1.0, 0.0)),
            "largest_k": ("family", k + 0.0 * elpd),
            "log_density": (("family", "sample"), np.repeat(elpd[:, None] / 7.0, 7, axis=1)),
        }
    result = xr.Dataset(variables, coords={"family": list(NAMES[:size]), "prior_width": [0.5, 1.0, 2.0]})
    known = not np.isnan(probability).any()
    result.attrs = {"nuisances": "[]", "friction": 0.0}
    result.attrs |= {
        "verdict": verdict_on(result),
        "most_probable": NAMES[int(np.argmax(probability))] if known else "",
        "none_fits": int(not result.fits.any()),
    }
    return result
