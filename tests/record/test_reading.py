"""A record that is read by its rig."""

import numpy as np
import pytest
import xarray as xr

from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import GrowingRecord, make_record, read_record, rod_of, with_rod, write_record
from tactile_bayes.rig import Rig
from tactile_bayes.rig.file_format import FileFormat

RIG = Rig(
    rod=WIRE,
    load_cell=LoadCell(frame="turning"),
    file=FileFormat({"drive_angle": "phi[deg]", "holding_moment": "Mz[N mm]"}, split_sweeps=True, missing=("force_y",)),
)


@pytest.fixture
def path(tmp_path):
    angles = np.degrees(columns()["drive_angle"])
    rows = [f"{angle!r},{moment},1" for moment, angle in enumerate(angles.tolist())]
    path = tmp_path / "rig.csv"
    path.write_text("\n".join(["phi,Mz,force_x [N]", *rows, ""]), encoding="utf-8")
    return path


def test_a_rig_says_what_the_arguments_say(path):
    by_rig = read_record(path, RIG)
    given = {"columns": dict(RIG.file.columns), "split_sweeps": True, "rod": WIRE, "missing": ("force_y",)}
    xr.testing.assert_identical(by_rig, read_record(path, **given, load_cell_frame="turning"))
    assert by_rig.attrs["load_cell_frame"] == "turning"
    xr.testing.assert_identical(GrowingRecord(path, RIG).poll().record, by_rig)


def test_an_argument_comes_before_the_rig(path):
    halved = read_record(path, RIG, columns={"holding_moment": "0.5*Mz[N mm]"}, rod=Rod(0.3, 1e-3))
    np.testing.assert_allclose(halved.holding_moment, 0.5 * read_record(path, RIG).holding_moment)
    assert rod_of(halved) == Rod(0.3, 1e-3)


def test_a_rod_without_a_length_gives_the_shape_of_the_one_in_the_file(tmp_path):
    record = make_record(columns(), rod=WIRE)
    write_record(record, tmp_path / "record.csv")
    tapered = Rod(WIRE.length, WIRE.flexural_rigidity, WIRE.diameter, taper=0.4)
    assert rod_of(read_record(tmp_path / "record.csv", Rig(rod=Rod(taper=0.4)))) == tapered
    assert rod_of(with_rod(record, Rod(taper=0.4))) == tapered
    assert rod_of(with_rod(make_record(columns()), Rod(taper=0.4))) == Rod(taper=0.4)
    with refused(RecordError, "but"):
        read_record(tmp_path / "record.csv", Rig(rod=Rod(2 * WIRE.length, 1.0)))


def test_what_is_no_rig_is_refused(path):
    with refused(ParameterError, "rig"):
        read_record(path, "rig.toml")
