"""The samples of a record: which of them are loaded, on which side of the object, and with which uncertainty."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.special import chdtri

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.errors import RecordError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.contacts.fits import Reading
from tactile_bayes.mechanics.rods.profile import Rods
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.reconstruction.sides import contact_sides
from tactile_bayes.record import CHANNELS, frame_of, loads_of, present_channels, rod_of, turned
from tactile_bayes.record.frame import to_fixed_axes

FALSE_ALARM = 1e-3  # share of unloaded samples that count as loaded because of noise
_MIRROR = np.array([-1.0, -1.0, 1.0])  # signs of the loads of a backward contact that is mirrored to a forward one


class Samples(NamedTuple):
    """Samples of a record as arrays, dimensionless, with backward contacts mirrored to forward ones."""

    rod: Rod
    reading: Reading  # readings corrected for known errors, with forces along the axes of the laboratory
    side: Floats  # +1, or −1 where a sample is mirrored, shape (n,)
    rods: Rods  # their rods, mirrored with them
    loaded: Flags
    cut_off: Flags  # true if a channel is at the end of its range
    has_noise: bool  # true if any noise level is known
    sense: Floats  # +1, or −1 where the contact slides the other way than on the side of a rotation, shape (n,)
    is_sure: Flags  # false where it may also slide the other way, or stick, shape (n,)

    def friction_angles(self, friction: float) -> Floats:
        """Return the friction angles with which the centreline touches, shape (n,)."""
        return np.asarray(self.sense * np.arctan(friction) - self.rod.surface.half_angle)

    def take(self, where: Index) -> Samples:
        """Select samples."""
        return self._replace(
            reading=self.reading.take(where),
            side=self.side[where],
            rods=self.rods.take(where),
            loaded=self.loaded[where],
            cut_off=self.cut_off[where],
            sense=self.sense[where],
            is_sure=self.is_sure[where],
        )


def samples_of(measured: xr.Dataset, cell: LoadCell, suspension_compliance: float = 0.0) -> Samples:
    """Return the samples of a valid record with all load channels, on a suspension that may turn under the moment."""
    absent = [name for name in CHANNELS if name not in present_channels(measured)]
    if absent:
        raise RecordError(
            f"a contact point takes all of {', '.join(CHANNELS)}, and {', '.join(absent)} was not measured: "
            "infer_contour works without"
        )
    rod = rod_of(measured)
    loaded = loaded_samples(measured, cell)
    readings = loads_of(measured)
    cut_off: Flags = np.any(cell.cuts_off(readings), axis=-1)
    corrected = cell.corrected(measured)
    side = contact_sides(corrected, cell)
    units = rod.load_units
    angle = corrected.drive_angle.values
    with np.errstate(over="ignore", invalid="ignore"):  # an infinite load has no zero of curvature
        loads = loads_of(corrected) / units
        loads[~loaded] = 0.0
        cell = cell.dimensionless(rod)
        has_noise = bool(np.any(cell.unrest) or cell.relative_noise or cell.drive_angle_deviation)
        covariance = np.zeros((1, 3, 3))
        if has_noise:
            for_covariance = loads[:1] if cell.is_alike else loads
            inverse = np.linalg.inv(cell.slopes(loads))
            covariance = inverse @ cell.covariance(for_covariance) @ np.swapaxes(inverse, -1, -2)
        leaning = np.zeros(loads.shape)
        if frame_of(measured) == "turning":
            loads[:, 1], loads[:, 2] = turned(loads[:, 1], loads[:, 2], -angle)
            leaning[:, 1], leaning[:, 2] = -loads[:, 2], loads[:, 1]
            turn = to_fixed_axes(angle)
            covariance = turn @ covariance @ np.swapaxes(turn, 1, 2)
        angle = angle - suspension_compliance * rod.moment_unit * loads[:, 0]
    signs = np.where(side[:, None] < 0.0, _MIRROR, 1.0)
    covariance = signs[:, :, None] * covariance * signs[:, None, :]
    reading = Reading(
        np.where(side < 0.0, np.pi - angle, angle),
        signs * loads,
        np.full(angle.size, cell.drive_angle_deviation),
        side[:, None] * signs * leaning,
        np.broadcast_to(covariance, (angle.size, 3, 3)),
    )
    return Samples(
        rod,
        reading,
        side,
        rod.mirrored(side),
        loaded,
        cut_off,
        has_noise,
        np.ones(angle.size),
        np.ones(angle.size, dtype=bool),
    )


def loaded_samples(measured: xr.Dataset, load_cell: LoadCell | None = None) -> Flags:
    """Find the samples whose load is significant. Returns shape (samples,)."""
    load_cell = load_cell or LoadCell.from_record(measured) or LoadCell()
    present = present_channels(measured)
    readings = np.full((measured.sizes["sample"], len(CHANNELS)), np.nan)
    loaded = np.zeros(len(readings), dtype=bool)
    for index, name in enumerate(CHANNELS):
        if name not in present:
            continue
        if load_cell.unrest[index]:
            readings[:, index] = measured[name].values
        else:
            loaded |= measured[name].values != load_cell.bias[index]
    noisy = int(np.count_nonzero(~np.isnan(readings).all(axis=0)))
    return loaded | (load_cell.squared_mahalanobis_distance(readings) > chdtri(noisy, FALSE_ALARM)) if noisy else loaded
