"""The units that people measure in."""

import math
from fractions import Fraction

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from tactile_bayes.record import CHANNELS, column_of
from tactile_bayes.record.quantity import accepted_units, converted, unit_of, units_disagree
from tactile_bayes.record.schema import ATTRIBUTE_UNITS, COLUMNS


@pytest.mark.parametrize(
    ("spellings", "scale", "expected"),
    [
        (["m", "metre"], 1, "m"),
        (["cm"], Fraction(1, 100), "m"),
        (["mm", " mm "], Fraction(1, 1000), "m"),
        (["µm", "μm", "um"], Fraction(1, 10**6), "m"),
        (["N", "newton"], 1, "N"),
        (["mN", "m\N{FULLWIDTH LATIN CAPITAL LETTER N}", "\N{ZERO WIDTH NO-BREAK SPACE}mN"], Fraction(1, 1000), "N"),
        (["\N{MICRO SIGN}N", "\N{GREEK SMALL LETTER MU}N", "uN"], Fraction(1, 10**6), "N"),
        (["kN"], 1000, "N"),
        (["gf"], Fraction("0.00980665"), "N"),
        (["kgf"], Fraction("9.80665"), "N"),
        (["N m", "Nm", "N·m", "N⋅m", "N*m", "N-m", "N.m", "m N", "kN mm", "N×m", "N\N{THIN SPACE}m"], 1, "N m"),
        (["N mm", "Nmm", "mN m", "mNm", "N·mm", "N\N{DOT OPERATOR}mm", "mN*m"], Fraction(1, 1000), "N m"),
        (["µN m", "uNm", "mN mm", "mNmm"], Fraction(1, 10**6), "N m"),
        (["N m²", "N·m^2", "N*m2", "Nm²", "N m^2"], 1, "N m²"),
        (["N mm²", "Nmm2", "N·mm^2"], Fraction(1, 10**6), "N m²"),
        (["rad", "radians"], 1, "rad"),
        (["mrad"], Fraction(1, 1000), "rad"),
        (["deg", "°", "degree", "Degrees", "º", "\N{RING ABOVE}"], Fraction(math.pi) / 180, "rad"),
        (["1/mm"], 1000, "1/m"),
        (["1", "-", ""], 1, "1"),
    ],
)
def test_a_unit_is_known_by_all_its_spellings(spellings, scale, expected):
    for text in spellings:
        unit = unit_of(text)
        assert unit is not None, text
        assert (unit.scale, unit.dimension) == (scale, unit_of(expected).dimension), text


@pytest.mark.parametrize(
    "text", ["furlong", "g", "V", "degC", "mm/", "N m ?", "forward", "ch1", "kg", "%", "2 mm", "Grad", "krad"]
)
def test_what_is_no_unit_of_a_record(text):
    assert unit_of(text) is None


def test_every_scaled_column_has_the_unit_that_its_scale_says():
    units = {"length_unit": "m", "moment_unit": "N m", "force_unit": "N", None: None}
    for name in (*COLUMNS, *(f"truth_{name}" for name in (*CHANNELS, "contact_x", "contact_y", "contact_arclength"))):
        column = column_of(name)
        assert column.unit == (units[column.scale] or column.unit), name
        assert column.unit_in("SI") == column.unit, name
        assert column.unit_in("dimensionless") == (column.unit if column.scale is None else "1"), name


def test_every_unit_of_the_schema_is_known_accepts_itself_first_and_offers_its_own_kind():
    for text in {*ATTRIBUTE_UNITS.values(), *(column.unit for column in COLUMNS.values())}:
        unit, offered = unit_of(text), accepted_units(text).replace(" or ", ", ").split(", ")
        assert unit.scale == 1
        assert not units_disagree(offered[0], text)
        assert {unit_of(other).dimension for other in offered} == {unit.dimension}


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_power_of_ten_costs_one_rounding(number):
    # Division by a power of ten that is a double itself is correctly rounded.
    assert converted(number, unit_of("mm"), unit_of("m")) == number / 1000
    assert converted(number, unit_of("N mm²"), unit_of("N m²")) == number / 1e6
    assert converted(number, unit_of("kN"), unit_of("N")) == number * 1000
    assert converted(number, unit_of("deg"), unit_of("rad")) == np.radians(number)


def test_arrays_are_converted_in_place():
    values = np.array([1.0, 2.0])
    assert converted(values, unit_of("mN"), unit_of("N")) is values
    assert values.tolist() == [1e-3, 2e-3]
