"""The verdict of a comparison of families."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.inference.misfit import what_to_try
from tactile_bayes.tasks.documents import read_json

# Beginning of the verdict if no family passes the check.
NONE_FITS = "None fits: with the rig as assumed, the record does not look like one of any of these shapes"
_LIKELY = 0.05  # smallest probability with which a family is named


def verdict_on(result: xr.Dataset) -> str:
    """Return the verdict on a comparison of families, from the result of `compare_families`."""
    names = [str(name) for name in result.family.values]
    fits, checked = result.fits.values, np.isfinite(result.p_value.values)
    if checked.any() and not fits.any():
        return f"{NONE_FITS} ({', '.join(names)}). Probabilities say which of them is the least wrong. " + what_to_try(
            names, read_json(result.attrs["nuisances"], "nuisances"), friction=result.attrs["friction"]
        )
    parts = []
    probability = result.probability.values
    if np.isnan(probability).any():
        lacking = [name for name, value in zip(names, result.log_evidence.values, strict=True) if np.isnan(value)]
        parts.append(f"No probabilities: the evidence of {', '.join(lacking)} cannot be computed from its draws")
    else:
        order = np.argsort(probability)[::-1]
        likely = [i for i in order if probability[i] >= _LIKELY]
        parts.append(", ".join(f"{names[i]} with probability {_share(probability[i])}" for i in likely))
        if checked[order[0]] and not fits[order[0]]:
            parts.append(f"but a record of a {names[order[0]]} would not look like this one")
        elif names[order[0]] == "shape-free":
            parts.append("that is, a smooth contour of none of the other shapes")
        firm = result.probability_by_width.values[:, order[0]]
        if firm.min() < 0.5 <= firm.max():
            parts.append(
                f"which depends on the width of the priors: from {_share(firm.min())} to {_share(firm.max())} with "
                "half and twice the width"
            )
    if not checked.any():
        parts.append("whether the record looks like one of them was not checked: too few samples are loaded")
    poor = [name for name, good in zip(names, (result.converged | ~result.sampled).values, strict=True) if not good]
    if poor:
        parts.append(f"not converged: {', '.join(poor)}")
    return "; ".join(parts)


def _share(probability: float) -> str:
    return "above 0.999" if probability > 0.999 else f"{probability:.2g}"
