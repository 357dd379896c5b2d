"""Wrong units and signs, told from the record alone."""

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.load_cells import CELL
from tactile_bayes.contours import Circle, paper_profile
from tactile_bayes.diagnostics.units_and_signs import unit_and_sign_findings
from tactile_bayes.record import CHANNELS, in_frame
from tactile_bayes.runs.demonstration import LOAD_CELL

STEP = 0.05


@pytest.fixture(scope="module")
def record():
    return CELL.measure(tb.scan(paper_profile("II", q=0.5), drive_step=STEP).record, rng=1)


@pytest.mark.parametrize(
    "contour", [*(paper_profile(name, q=0.3) for name in ("I", "II", "III", "IV")), Circle(0.1, 0.7)]
)
@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_a_right_record_is_not_suspected(contour, direction):
    record = tb.scan(contour, direction=direction, drive_step=STEP).record
    assert unit_and_sign_findings(record) == ()
    assert unit_and_sign_findings(in_frame(CELL.measure(record, rng=1), "turning")) == ()


def test_what_is_unloaded_or_missing_is_not_suspected(measured, record):
    assert unit_and_sign_findings(measured, LOAD_CELL) == ()
    alone = record.copy(deep=True)
    alone["force_x"][:] = alone["force_y"][:] = np.nan
    assert unit_and_sign_findings(alone) == ()
    nothing = record.assign({name: 0.0 * record[name] for name in ("holding_moment", "force_x", "force_y")})
    assert unit_and_sign_findings(nothing) == ()


@pytest.mark.parametrize(
    ("factors", "kind"),
    [
        ({"force_x": 1e3, "force_y": 1e3}, "large loads"),
        (dict.fromkeys(CHANNELS, 1e3), "large loads"),
        ({"holding_moment": 1e3}, "long lever"),
        ({"force_x": 1e-3, "force_y": 1e-3}, "long lever"),
        (dict.fromkeys(CHANNELS, 1e-3), "small loads"),
        ({"force_y": -1.0}, "force sign"),
        ({"holding_moment": -1.0}, "moment sign"),
    ],
)
def test_wrong_units_and_signs_are_suspected(factors, kind, record):
    found = unit_and_sign_findings(record.assign({name: factor * record[name] for name, factor in factors.items()}))
    assert [each.kind for each in found] == [kind]


def test_the_unit_of_force_is_told_for_si(measured):
    wrong = measured.assign(force_x=1e3 * measured.force_x, force_y=1e3 * measured.force_y)
    unit = tb.Rod(measured.rod_length, measured.rod_flexural_rigidity).force_unit
    assert f"{unit:.3g} N" in unit_and_sign_findings(wrong)[0].details["stated"]
