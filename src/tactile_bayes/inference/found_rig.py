"""The rig that a posterior has found beside a contour: a load cell that is off, a drive that is, pivots that are."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.inference.likelihood import bases_of
from tactile_bayes.inference.result import posterior_draws
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS, present_channels

__all__ = ["FoundRig", "contact_points", "found_rig", "rig_with"]

_SHORT = ("moment", "force_x", "force_y")


class FoundRig(NamedTuple):
    """What Step 2 needs to take a record as the posterior does."""

    record: xr.Dataset
    """With pivots as they were found, and without drift."""
    load_cell: LoadCell
    """Bias, gain (a rod that is stiffer than stated makes it larger), lever and encoder as they were found.

    So is noise that was not stated; else it is as stated, whatever `noise_scale` says, so that misfits tell of it.
    """
    friction: float
    suspension_compliance: float
    """Per moment of the rod as stated, as `reconstruct` takes it."""

    def contacts(self) -> xr.Dataset:
        """Return contact points by Step 2, as from `reconstruct`: constrained where the noise is known, else raw."""
        return reconstruct(
            self.record,
            method="constrained" if self.load_cell.has_variances else "raw",
            load_cell=self.load_cell,
            friction=self.friction,
            suspension_compliance=self.suspension_compliance,
        )


def found_rig(measured: xr.Dataset, load_cell: LoadCell | None, posterior: xr.DataTree) -> FoundRig:
    """Medians of what was inferred of the rig beside a contour, put where `reconstruct` takes it.

    Parameters
    ----------
    measured : xr.Dataset
        The record.
    load_cell : LoadCell or None
        As `infer_contour` was given it.
    posterior : xr.DataTree
        What that made of the record.
    """
    draws = posterior_draws(posterior)
    found = {str(name): float(values.median()) for name, values in draws.data_vars.items()}
    stated = load_cell or LoadCell.from_record(measured) or LoadCell()
    names = json.loads(posterior.attrs.get("nuisances", "[]"))
    noise: dict[str, Any] = {name: found[name] for name in ("moment_noise", "force_noise") if name in found}
    rig = {name: value for name, value in found.items() if name in names}
    return rig_with(measured, replace(stated, **noise), rig, float(posterior.attrs["friction"]))


def rig_with(measured: xr.Dataset, load_cell: LoadCell, rig: Mapping[str, float], friction: float) -> FoundRig:
    """What nuisance parameters, by name and in the record's units, make of a rig that was stated.

    Parameters
    ----------
    measured : xr.Dataset
        The record.
    load_cell : LoadCell
        As it was stated.
    rig : mapping of str to float
        What differs from that.
    friction : float
        Coulomb's coefficient, where it is not among the parameters.
    """

    def of_channels(what: str, otherwise: float) -> np.ndarray[Any, np.dtype[np.float64]]:
        return np.array([rig.get(f"{channel}_{what}", otherwise) for channel in _SHORT])

    gain: Any = np.array(load_cell.gain) * of_channels("gain", 1.0) * rig.get("rigidity_scale", 1.0)
    bias = np.array(load_cell.bias) + of_channels("bias", 0.0)
    cell = replace(
        load_cell,
        gain=gain,
        lever=(load_cell.lever[0] + rig.get("lever_x", 0.0), load_cell.lever[1] + rig.get("lever_y", 0.0)),
        bias=tuple(bias.tolist()),
        drive_angle_offset=load_cell.drive_angle_offset + rig.get("drive_angle_offset", 0.0),
        drive_angle_backlash=load_cell.drive_angle_backlash + rig.get("backlash", 0.0),
    )
    way = np.linspace(-0.5, 0.5, measured.sizes["sample"])
    columns = {
        name: measured[name] - drift * way for name, drift in zip(CHANNELS, of_channels("drift", 0.0), strict=True)
    }
    pivots = np.stack([measured.base_x.values, measured.base_y.values], axis=1)
    for number, pivot in enumerate(bases_of(measured), start=1):
        here = np.all(pivots == np.asarray(pivot), axis=1)
        for name in ("base_x", "base_y"):
            shift = rig.get(f"base_{number}_{name[-1]}", 0.0)
            columns[name] = columns.get(name, measured[name]) + shift * here
    record = measured.assign({name: values.assign_attrs(measured[name].attrs) for name, values in columns.items()})
    return FoundRig(
        record,
        cell,
        rig.get("friction", friction),
        rig.get("suspension_compliance", 0.0) * rig.get("rigidity_scale", 1.0),
    )


def contact_points(measured: xr.Dataset, load_cell: LoadCell | None, posterior: xr.DataTree) -> xr.Dataset | None:
    """Return contact points by Step 2, with the rig that was found: noise, biases, stiffness, offset, friction.

    Parameters
    ----------
    measured : xr.Dataset
        The record.
    load_cell : LoadCell or None
        As `infer_contour` was given it.
    posterior : xr.DataTree
        What that made of the record.

    Returns
    -------
    xr.Dataset or None
        From `reconstruct`; None where a load channel is missing.
    """
    if set(present_channels(measured)) != set(CHANNELS):
        return None
    return found_rig(measured, load_cell, posterior).contacts()
