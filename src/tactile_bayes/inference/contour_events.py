"""First contact and snap-off on many contours, in every sweep segment of a record."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Contour
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.inference.record_likelihood.rig_values import RigValues

__all__ = ["events_of"]


def events_of(
    likelihood: RecordLikelihood, contours: Contour, rig: RigValues | None = None, *, exact: bool = True
) -> dict[str, Floats]:
    """Return drive angle and contact point of first contact and snap-off in every sweep segment.

    Returns shape (n, segments).
    """
    count = contours.shape[0]
    paths = likelihood.paths(contours, rig, exact=exact)
    batch = np.arange(paths.sweep_frame.size)
    backward = paths.sweep_frame.mirrored
    out = {}
    for label, angle, parameter in (
        ("first", paths.first_angle, paths.first_parameter),
        ("snap_off", paths.snap_angle, paths.snap_parameter),
    ):
        locus = paths.sweep_frame.contour.take(batch).locate(np.where(backward, -parameter, parameter))
        turned = paths.drive_angles_at(angle)
        out[f"{label}_drive_angle"] = np.where(backward, np.pi - turned, turned)
        if paths.lines is not None:
            out[f"{label}_travel"] = likelihood.segments.ways(angle.reshape(-1, count).T).T.ravel()
        out[f"{label}_contact_x"], out[f"{label}_contact_y"] = locus.x, locus.y
    return {name: values.reshape(-1, count).T for name, values in out.items()}
