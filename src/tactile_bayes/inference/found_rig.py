"""The rig that was inferred with a contour: corrections of load cell, drive and pivots, for Step 2."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import xarray as xr

from tactile_bayes.inference.result import known_of, posterior_draws
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction import contacts_of
from tactile_bayes.record import CHANNELS, present_channels
from tactile_bayes.rig.corrected import Corrected, corrected
from tactile_bayes.tasks.documents import read_json

__all__ = ["contact_points", "found_rig"]


def found_rig(measured: xr.Dataset, posterior: xr.DataTree, load_cell: LoadCell | None = None) -> Corrected:
    """Return the rig with the posterior medians of its parameters."""
    draws = posterior_draws(posterior)
    found = {str(name): float(values.median()) for name, values in draws.data_vars.items()}
    stated = load_cell or LoadCell.from_record(measured) or LoadCell()
    names = read_json(posterior.attrs.get("nuisances", "[]"), "nuisances")
    noise: dict[str, Any] = {name: found[name] for name in ("moment_noise", "force_noise") if name in found}
    rig = {name: value for name, value in found.items() if name in names}
    return corrected(measured, replace(stated, **noise), {**known_of(posterior.attrs), **rig})


def contact_points(
    measured: xr.Dataset, posterior: xr.DataTree, load_cell: LoadCell | None = None
) -> xr.Dataset | None:
    """Return contact points by Step 2, with the inferred noise, biases, stiffness, offset and friction."""
    if set(present_channels(measured)) != set(CHANNELS):
        return None
    found = found_rig(measured, posterior, load_cell)
    return contacts_of(found, "constrained" if found.load_cell.has_variances else "raw")
