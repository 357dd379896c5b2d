"""The rig that axial forces show without a contour."""

import numpy as np
import pytest

from tactile_bayes import LoadCell, scan
from tactile_bayes.contours import Circle, Parabola, PowerLaw
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.starts.axial_rig import axial_rig
from tactile_bayes.rig import Rig

RIG = {"rigidity_scale": 1.06, "drive_angle_offset": 0.01, "lever_x": 0.006, "lever_y": -0.004, "backlash": 0.003}
TRUE = LoadCell(
    force_noise=1e-3,
    moment_noise=4e-4,
    gain=tuple(map(tuple, 1.06 * np.eye(3))),
    lever=(0.006, -0.004),
    drive_angle_offset=0.01,
    drive_angle_backlash=0.003,
    bias=(0.05, -0.1, 0.08),
)
STATED = LoadCell(force_noise=1e-3, moment_noise=4e-4)
ALL: dict[str, float] = {}
"""All that is unknown of a real rig."""


def model_of(contour, unknown=ALL):
    record = scan(contour, drive_step=np.radians(1.0), rig=Rig(unknown={"friction": 0.2})).record
    model = Experiment(TRUE.measure(record, rng=1), Rig(load_cell=STATED, unknown=unknown)).model
    return model, (record.holding_moment != 0.0).values


@pytest.mark.parametrize("contour", [Parabola(0.9, 0.12), Circle(0.4, 0.1, x_c=0.05), PowerLaw(1.0, 3.0, 0.1)], ids=str)
def test_stiffness_encoder_lever_and_friction_are_found_without_the_contour(contour):
    """Within a fifth of their priors, of contours near the pivot; the fitted family would not describe two of them."""
    model, loaded = model_of(contour)
    found = axial_rig(model, loaded)
    spread = {name: float(model.priors[name].std()) for name in found}
    for name, value in {**RIG, "friction": 0.2}.items():
        assert abs(found[name] - value) < 0.2 * spread[name], name


def test_it_is_not_asked_where_it_does_not_follow():
    """Of a rod that may be curved, without unknowns of the rig, or from a few samples."""
    contour = Parabola(0.9, 0.12)
    model, loaded = model_of(contour)
    assert axial_rig(model, loaded) is not None
    assert axial_rig(model, loaded & (np.cumsum(loaded) < 10)) is None
    assert axial_rig(model_of(contour, "nothing")[0], loaded) is None
    assert axial_rig(model_of(contour, {"rest_curvature": "default"})[0], loaded) is None
