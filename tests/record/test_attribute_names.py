"""Names of attributes: misspelt ones are refused in every kind of record, foreign ones are kept."""

import numpy as np
import pytest

from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record import write_record
from tactile_bayes.record.attribute_names import misspelt, stray_attribute, unused
from tactile_bayes.rig import Rig, make_record, read_record

WRONG = [
    ("rod_tapper", 0.4, "taper"),
    ("rod_rest_curvatur", "5 [1/m]", "rest_curvature"),
    ("rod_rest_curvatur", '{"edges": [0, 1], "coefficients": [[1]]}', "rest_curvature"),
    ("rod_tapre", "slight", "taper"),
    ("rod_EI", 2e-4, "rod_"),
    ("load_cell_frame_", "turning", "frame"),
    ("load_cell_axes", "turning", "load_cell_"),
    ("loadcell_force_noise", "1 [mN]", "load_cell_force_noise"),
    ("Rod-Taper", 0.4, "rod_taper"),
    ("RodRestCurvature", 1.0, "rod_rest_curvature"),
    ("rod length", "see below", "rod_length"),
    ("unit", "SI", "units"),
    ("Units", "si", "units"),
]
FOREIGN = [
    *(("rodent", 7), ("serial", 4711), ("serial_number", "FT-4711"), ("rod_material", "nitinol")),
    *(("load_cell_model", "ATI Nano17"), ("record_length", 12.0), ("product", "rod"), ("force", 1.0)),
    *(("unit", "m"), ("length", 3)),
]


@pytest.fixture
def lined(tmp_path):
    """Write the file of a record, with a line above all others, and return its path."""

    def write(line):
        path = tmp_path / "record.csv"
        write_record(make_record(columns(), Rig(rod=WIRE)), path)
        path.write_text(f"# {line}\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(("name", "value", "meant"), WRONG)
def test_a_misspelt_attribute_is_refused_in_memory_and_in_csv_files(lined, name, value, meant):
    with refused(RecordError, f"attribute '{name}'", meant):
        make_record(columns(), Rig(rod=WIRE), attrs={name: value})
    path = lined(f'"{name}": {value}' if " " in name else f"{name}: {value}")
    with refused(RecordError, "line 1", name, meant):
        read_record(path)


@pytest.mark.parametrize(("name", "value"), FOREIGN)
def test_a_foreign_attribute_is_kept_and_known_as_such(name, value):
    assert misspelt(name, value) is None
    record = make_record(columns(), Rig(rod=WIRE), attrs={name: value})
    assert (record.attrs[name], unused(record.attrs)) == (value, [name])


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("rod_taper 0.4", "rod_taper"),
        ("rod_taper,0.4", "rod_taper"),
        ("rod taper: 0.4", "rod_taper"),
        ("Rod-Diameter = 0.5 mm", "rod_diameter"),
        ("load_cell_frame = turning", "load_cell_frame"),
        ("rod_tapper; 0.4", "rod_taper"),
        ("units = SI", "units"),
        ("rod_length\N{FULLWIDTH COLON} 0.1 [m]", "rod_length"),
        ("column force_x: [mN]", "'# column NAME: KIND [UNIT] TEXT'"),
        ("column force_x = number [mN]", "'# column NAME: KIND [UNIT] TEXT'"),
        ("column Fx [mN]: number [N]", "'# column NAME: KIND [UNIT] TEXT'"),
    ],
)
def test_an_attribute_or_a_description_of_a_column_in_another_form_is_refused(tmp_path, line, name):
    path = tmp_path / "record.csv"
    path.write_text(f"# {line}\nsweep,direction,drive_angle,holding_moment,force_x,force_y\n0,forward,1,0,0,0\n")
    with refused(RecordError, "line 1", name):
        read_record(path, Rig(rod=WIRE))


@pytest.mark.parametrize(
    "line", ["wire 120 mm x 0.5 mm", "see rod_taper above", "Units, mN and mm", "a = b", "rods: three", "12:30 x"]
)
def test_words_are_no_attributes(line):
    assert stray_attribute(line) is None


def test_words_about_a_stated_attribute_are_kept_for_inspection(lined):
    record = read_record(lined("rod length = 20 cm, see log"))
    assert record.encoding["remarks"] == ["line 1: rod length = 20 cm, see log"]
    assert np.array_equal(record.force_x, columns()["force_x"])
