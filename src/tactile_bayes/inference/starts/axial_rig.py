"""The rig that the readings show without a contour, by the axial force."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.least_squares import descend
from tactile_bayes.record import CHANNELS, carried_sweeps, frame_of, present_channels

__all__ = ["axial_rig"]

_ROUNDING = 1e-6  # share of the force to which the axial force of a sample is believed
_SAMPLES_PER_PARAMETER = 2  # least number of loaded samples for each parameter
# Parts of the names of parameters by which the axial force does not follow from a sample's moment in this form.
_NOT_LINEAR = ("rest_curvature", "taper", "stem", "drift", "moment_curve")


def axial_rig(model: ContourModel, loaded: Flags) -> dict[str, float] | None:
    """Return the rig for which the axial forces of tangential contacts agree with their moments.

    In tangential contact the axial component of the reaction follows from the moment, whatever the contour is:
    fAx cos φ0 + fAy sin φ0 = m0²/(2 EI) − f sin δ, with the contact force f and the angle of friction δ. This is the
    first integral of the elastica at the pivot and at the contact (Love 1927, A Treatise on the Mathematical Theory of
    Elasticity, § 262). Of a sample's four numbers one is thus redundant, which determines stiffness, encoder, lever,
    zeros and friction where loads are large. Tip contacts deviate, and have little weight.

    Shapes: loaded (samples,).
    """
    if not _is_determined(model, loaded):
        return None
    names, likelihood = model.unknowns.names, model.likelihood
    middle = np.array([float(model.priors[name].median()) for name in names])  # type: ignore[attr-defined]
    spread = np.array([float(model.priors[name].std()) for name in names])
    readings, deviation = likelihood.measured[loaded], model.deviation
    sign = likelihood.segments.signs_of_samples[loaded]
    angle = likelihood.segments.angles_in_sweep_frame[loaded]
    turning = frame_of(model.measured) == "turning"

    def residuals(steps: Floats) -> Floats:
        """Return axial forces less those that follow from the moments, in standard deviations, (n, samples)."""
        values = dict(zip(names, (middle + spread * steps).T, strict=True))
        rig = model.unknowns.rig(values)
        # Readings are affine functions of loads, known by their values at no load and at unit loads.
        none_and_units = np.tile(np.vstack([np.zeros(3), np.eye(3)]), (len(steps), 1, 1))
        read = likelihood.load_cell.expected(model.unknowns.sensed(none_and_units, values, likelihood.load_cell))
        slopes, left = read[:, 1:] - read[:, :1], readings - read[:, :1]
        loads = np.linalg.solve(np.swapaxes(slopes, 1, 2), np.swapaxes(left, 1, 2))
        moment, force_x, force_y = np.moveaxis(loads, 1, 0)
        compliance, friction, rigidity = (
            np.reshape(v, (-1, 1)) for v in (rig.suspension_compliance, rig.friction, rig.rigidity_scale)
        )
        axial = force_x
        if not turning:
            there = angle - sign * (likelihood.misread(rig)[:, loaded] + compliance * moment)
            axial = sign * force_x * np.cos(there) + force_y * np.sin(there)
        force = np.hypot(force_x, force_y)
        surplus = axial + force * np.sin(np.arctan(friction)) - moment**2 / (2.0 * rigidity)
        return surplus / np.sqrt(deviation[1] ** 2 + np.square(deviation[0] * moment) + np.square(_ROUNDING * force))

    none = np.zeros(len(names))
    steps = descend(residuals, none, none, np.ones(len(names))).point
    which = [model.names.index(name) for name in names]
    found = np.clip(middle + spread * steps, model.ends.low[which], model.ends.high[which])
    return dict(zip(names, found.tolist(), strict=True))


def _is_determined(model: ContourModel, loaded: Flags) -> bool:
    """Return True if the rod and what is unknown of the rig have that redundancy, with enough loaded samples."""
    names, rod = model.unknowns.names, model.likelihood.rod
    return (
        bool(names)
        and bool(np.count_nonzero(loaded) >= _SAMPLES_PER_PARAMETER * len(names))
        and len(present_channels(model.measured)) == len(CHANNELS)
        and not carried_sweeps(model.measured)
        and rod.is_uniform
        and rod.mean_rest_curvature == 0.0
        and rod.stem <= 0.0
        and not any(part in name for name in names for part in _NOT_LINEAR)
    )
