"""The rig that was inferred with a contour: corrections of load cell, drive and pivots, for Step 2."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.inference.parameters.nuisances import CURVE
from tactile_bayes.inference.result import posterior_draws
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.averaged_cell import AveragedCell
from tactile_bayes.load_cell.blocks import are_blocks, elapsed_in
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS, base_of_sample, present_channels, rod_of, to_si, with_rod
from tactile_bayes.tasks.documents import read_json

__all__ = ["FoundRig", "contact_points", "found_rig", "rig_with", "rod_with"]

_PHYSICAL = ("m", "N", "N m", "1/m")
"""Units of what is dimensionless in a dimensionless record."""

_CHANNEL_NAMES = ("moment", "force_x", "force_y")


class FoundRig(NamedTuple):
    """Arguments of `reconstruct` by which Step 2 corrects a record as the posterior does."""

    record: xr.Dataset
    """Record with inferred pivots and the inferred shape of the rod, and without drift."""
    load_cell: LoadCell
    """Load cell with inferred bias, gain (which includes the stiffness of the rod), lever and encoder.

    Its noise is inferred only where it was not stated: `noise_scale` is not applied, so that misfits show it.
    """
    friction: float
    """Coulomb's coefficient."""
    suspension_compliance: float
    """Compliance relative to the stated rod, as in `reconstruct`."""
    units: str
    """Units of the record that was measured. Where it is dimensionless and the rod's length was inferred, `record` is
    in lengths of the stated rod, and SI by name."""

    def contacts(self) -> xr.Dataset:
        """Return contact points from `reconstruct`, constrained if the noise is known, else raw."""
        contacts = reconstruct(
            self.record,
            method="constrained" if self.load_cell.has_variances else "raw",
            load_cell=self.load_cell,
            friction=self.friction,
            suspension_compliance=self.suspension_compliance,
        )
        if self.units == "dimensionless":
            for variable in contacts.variables.values():
                if variable.attrs.get("units") in _PHYSICAL:
                    variable.attrs["units"] = "1"
        return contacts.assign_attrs(units=self.units)


def found_rig(measured: xr.Dataset, load_cell: LoadCell | None, posterior: xr.DataTree) -> FoundRig:
    """Return the rig with the posterior medians of its parameters.

    Parameters
    ----------
    measured : xr.Dataset
        The record.
    load_cell : LoadCell or None
        The argument of `infer_contour`.
    posterior : xr.DataTree
        Its result for the record.
    """
    draws = posterior_draws(posterior)
    found = {str(name): float(values.median()) for name, values in draws.data_vars.items()}
    stated = load_cell or LoadCell.from_record(measured) or LoadCell()
    names = read_json(posterior.attrs.get("nuisances", "[]"), "nuisances")
    noise: dict[str, Any] = {name: found[name] for name in ("moment_noise", "force_noise") if name in found}
    rig = {name: value for name, value in found.items() if name in names}
    return rig_with(measured, replace(stated, **noise), rig, float(posterior.attrs["friction"]))


def rig_with(measured: xr.Dataset, load_cell: LoadCell, rig: Mapping[str, float], friction: float) -> FoundRig:
    """Return the stated rig, corrected by nuisance parameters.

    Parameters
    ----------
    measured : xr.Dataset
        The record.
    load_cell : LoadCell
        The stated load cell.
    rig : mapping of str to float
        Nuisance parameters by name, in the record's units; others have no effect.
    friction : float
        Coulomb's coefficient, if it is not among the parameters.
    """

    def by_channel(kind: str, default: float) -> np.ndarray[Any, np.dtype[np.float64]]:
        return np.array([rig.get(f"{channel}_{kind}", default) for channel in _CHANNEL_NAMES])

    gain: Any = np.array(load_cell.gain) * by_channel("gain", 1.0) * rig.get("rigidity_scale", 1.0)
    quadratic, cubic = (rig.get(name, v) for name, v in zip(CURVE, load_cell.moment_curve, strict=True))
    bias = np.array(load_cell.bias) + by_channel("bias", 0.0)
    averaged = AveragedCell.of(load_cell, measured["block_readings"].values) if are_blocks(measured) else load_cell
    cell = replace(
        averaged,
        gain=gain,
        lever=(load_cell.lever[0] + rig.get("lever_x", 0.0), load_cell.lever[1] + rig.get("lever_y", 0.0)),
        moment_curve=(quadratic, cubic),
        bias=tuple(bias.tolist()),
        drive_angle_offset=load_cell.drive_angle_offset + rig.get("drive_angle_offset", 0.0),
        drive_angle_backlash=load_cell.drive_angle_backlash + rig.get("backlash", 0.0),
    )
    fraction = elapsed_in(measured)
    columns = {
        name: measured[name] - drift * fraction for name, drift in zip(CHANNELS, by_channel("drift", 0.0), strict=True)
    }
    bases, of_sample = base_of_sample(measured)
    for number in range(1, len(bases) + 1):
        at_pivot = of_sample == number - 1
        for name in ("base_x", "base_y"):
            shift = rig.get(f"base_{number}_{name[-1]}", 0.0)
            columns[name] = columns.get(name, measured[name]) + shift * at_pivot
    record = measured.assign({name: values.assign_attrs(measured[name].attrs) for name, values in columns.items()})
    rod = rod_of(measured)
    if "length" in rig:
        record = to_si(record, rod)
    return FoundRig(
        with_rod(record, rod_with(rod, rig)),
        cell,
        rig.get("friction", friction),
        rig.get("suspension_compliance", 0.0) * rig.get("rigidity_scale", 1.0),
        str(measured.attrs["units"]),
    )


def rod_with(rod: Rod, rig: Mapping[str, float]) -> Rod:
    """Return a rod of the shape that nuisance parameters by name give it, others than those of shape without effect."""
    length = rig.get("length", rod.length)
    curvature = rig.get("rest_curvature", rod.mean_rest_curvature * rod.length / length)
    return rod.reshaped(curvature, rig.get("taper", rod.taper), rig.get("stem"), length)


def contact_points(measured: xr.Dataset, load_cell: LoadCell | None, posterior: xr.DataTree) -> xr.Dataset | None:
    """Return contact points by Step 2, with the inferred noise, biases, stiffness, offset and friction.

    Parameters
    ----------
    measured : xr.Dataset
        The record.
    load_cell : LoadCell or None
        The argument of `infer_contour`.
    posterior : xr.DataTree
        Its result for the record.

    Returns
    -------
    xr.Dataset or None
        Result of `reconstruct`; None if a load channel is missing.
    """
    if set(present_channels(measured)) != set(CHANNELS):
        return None
    return found_rig(measured, load_cell, posterior).contacts()
