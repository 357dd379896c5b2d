"""Sentences on the likely causes of a misfit, from the group "causes" of a posterior."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.diagnostics.findings import joined

# Log-evidence above that of the model as it is from which a cause is named, and below the likeliest one's within which
# another one is not told apart from it: as one to a hundred and fifty.
_GAIN, _APART = 5.0, 5.0


def likely_causes(posterior: xr.DataTree) -> str:
    """Return sentences on what describes the record, from the group "causes"; empty without it, or if nothing does."""
    if "causes" not in posterior.children:
        return ""
    causes = posterior["causes"].to_dataset()
    if "misread" in causes.attrs:
        return str(causes.attrs["misread"])
    said, missed = _said(causes), str(causes.attrs.get("no_time_for", ""))
    if not missed:
        return said
    return f"{said or 'Nothing that was tried describes it better.'} No time for: {missed}."


def _said(causes: xr.Dataset) -> str:
    gains = causes.log_evidence.values
    order = np.flatnonzero(gains > _GAIN)
    if not order.size:
        return ""
    names, remedies = causes.cause.values, causes.remedy.values
    first, describes = order[0], causes.describes.values == 1
    if not describes[first]:
        return f"Nothing that was tried describes it alone; nearest comes {names[first]}: infer with {remedies[first]}."
    alike = [k for k in order if describes[k] and gains[first] - gains[k] < _APART]
    others = [names[k] for k in order if describes[k] and k not in alike]
    more = f" Less likely, and possible: {joined(others)}." if others else ""
    if len(alike) == 1:
        return f"Most likely the cause is {names[first]}, which describes it: infer with {remedies[first]}.{more}"
    tries = "; or ".join(remedies[k] for k in alike)
    known = " or ".join(names[k] for k in alike)
    return (
        f"The cause is {known}, which this record does not tell apart: infer with {tries}. A sweep along a gauge, of "
        f"known contour, would tell (calibrate-rig).{more}"
    )
