"""Records with and without dimension."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis.extra import numpy as hnp

from helpers.record_tables import WIRE, columns, edited
from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS, rod_of, to_dimensionless, to_si
from tactile_bayes.rig import Rig, make_record

# Numbers whose quotients are far from underflow, where digits would be lost.
moderate = st.floats(-1e6, 1e6).filter(lambda value: value == 0 or abs(value) > 1e-280)
scales = st.floats(1e-3, 1e3)


@settings(max_examples=15, deadline=None)
@given(hnp.arrays(float, (6, 5), elements=moderate), scales, scales, scales, st.floats(-3.0, 3.0))
def test_units_convert_there_and_back(values, length, rigidity, diameter, turn):
    rod = Rod(length, rigidity, min(diameter, length), rest_curvature=turn / length)
    assume(not rod.is_dimensionless)
    names = (*CHANNELS, "truth_contact_x", "truth_force_y")
    si = make_record(
        columns(**dict(zip(names, values.T, strict=True)), base_x=np.full(6, values[0, 0])),
        Rig(rod=rod),
        attrs={"load_cell_force_noise": 0.5, "load_cell_moment_noise": 0.25, "rig": "bench"},
    )
    dimensionless = to_dimensionless(si)
    # One division or multiplication each, correctly rounded.
    units = {"force": rod.force_unit, "moment": rod.moment_unit, "base": rod.length, "contact": rod.length}
    for name in (*names, "base_x", "drive_angle"):
        unit = next((size for part, size in units.items() if part in name), 1.0)
        assert np.array_equal(dimensionless[name], si[name] / unit), name
    curvature = rod.rest_curvature / rod.curvature_unit
    assert rod_of(dimensionless) == Rod(diameter=rod.diameter / length, rest_curvature=curvature)
    assert dimensionless.attrs["load_cell_force_noise"] == 0.5 / rod.force_unit
    assert dimensionless.attrs["load_cell_moment_noise"] == 0.25 / rod.moment_unit
    assert to_dimensionless(dimensionless) is dimensionless

    back = to_si(dimensionless, rod)
    assert rod_of(back) == rod
    for name in back.data_vars:
        assert back[name].attrs == si[name].attrs
        if back[name].dtype.kind == "f":
            np.testing.assert_allclose(back[name], si[name], rtol=4 * np.finfo(float).eps, atol=0)
    assert back.attrs["load_cell_force_noise"] == pytest.approx(0.5, rel=1e-15)


def test_what_cannot_be_converted_is_refused():
    si = make_record(columns(), Rig(rod=WIRE))
    assert to_si(si, WIRE) is si
    with refused(RecordError, "SI already", "Rod(length=0.2,"):
        to_si(si, Rod(0.1, 1e-5))
    with refused(RecordError, "Rod(length=1.0, flexural_rigidity=1.0, diameter=0.0)", "rod lengths"):
        to_si(make_record(columns()), WIRE)
    with refused(RecordError, "sample 5, column 'force_y'", "inf"):
        to_dimensionless(make_record(edited("force_y", 5, 1e308), Rig(rod=WIRE)))
