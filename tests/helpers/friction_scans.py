"""Scans of the cases of the stepper of rods with friction."""

import numpy as np

import tactile_bayes as tb

FAMILIES = {"circle": tb.contours.Circle, "ellipse": tb.contours.Ellipse, "parabola": tb.contours.Parabola}


def scanned(case):
    """The package's scan of a case."""
    rod, contour = case["rod"], dict(case["contour"])
    curvature, known = rod.get("curvature", (0.0,)), {}
    if any(curvature):
        known["rest_curvature"] = lambda s: np.polynomial.polynomial.polyval(s, curvature)
    x, y, angle = np.transpose(case["poses"])
    return tb.scan(
        FAMILIES[contour.pop("family")](**contour),
        drive=tb.Motion(x, y, angle, drive_step=case["step"]),
        rig=tb.Rig(rod=tb.Rod(taper=rod.get("taper", 0.0), **known), unknown={"friction": case["friction"]}),
    )
