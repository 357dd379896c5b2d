"""The schema of a record."""

import pytest

from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS, COLUMNS, column_of


def test_every_scaled_column_has_the_unit_that_its_scale_says():
    units = {"length_unit": "m", "moment_unit": "N m", "force_unit": "N"}
    for column in COLUMNS.values():
        if column.scale is not None:
            assert column.unit == units[column.scale]
            assert hasattr(Rod(), column.scale)
        assert column.unit_in("SI") == column.unit
    assert COLUMNS["force_y"].unit_in("dimensionless") == "1"
    assert COLUMNS["drive_angle"].unit_in("dimensionless") == "rad"


@pytest.mark.parametrize("name", [*CHANNELS, "contact_x", "contact_y", "contact_arclength"])
def test_truth_scales_like_what_it_is_the_truth_of(name):
    truth = column_of(f"truth_{name}")
    assert truth is not None
    assert (truth.kind, truth.unit, truth.scale) == (COLUMNS[name].kind, COLUMNS[name].unit, COLUMNS[name].scale)


def test_an_unknown_column_has_no_meaning():
    assert column_of("temperature") is None
    assert column_of("truth_temperature") is None
