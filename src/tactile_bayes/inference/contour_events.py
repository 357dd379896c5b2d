"""Where contact begins and ends on many contours, in every stroke of a record."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Contour
from tactile_bayes.inference.likelihood import RecordLikelihood, Rig

__all__ = ["events_of"]


def events_of(
    likelihood: RecordLikelihood, contours: Contour, rig: Rig | None = None, *, exact: bool = True
) -> dict[str, Floats]:
    """First contact and snap-off in every stroke, in the record's units, each of shape (n, strokes).

    What is not exact is right to 1e-6 rad and 1e-5 rod lengths, at a quarter of the cost.
    """
    count = contours.shape[0]
    paths = likelihood.paths(contours, rig, exact=exact)
    lanes = np.arange(paths.sweep_frame.size)
    backward = paths.sweep_frame.mirrored
    out = {}
    for label, angle, parameter in (
        ("first", paths.first_angle, paths.first_parameter),
        ("snap_off", paths.snap_angle, paths.snap_parameter),
    ):
        locus = paths.sweep_frame.contour.take(lanes).locate(np.where(backward, -parameter, parameter))
        out[f"{label}_drive_angle"] = np.where(backward, np.pi - angle, angle)
        out[f"{label}_contact_x"], out[f"{label}_contact_y"] = locus.x, locus.y
    return {name: values.reshape(-1, count).T for name, values in out.items()}
