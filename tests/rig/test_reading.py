"""A record that is read by its rig."""

import numpy as np
import pytest
import xarray as xr

from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import rod_of, with_rod, write_record
from tactile_bayes.rig import FileFormat, GrowingRecord, Rig, make_record, read_record

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


def test_a_file_is_read_as_its_rig_says(path):
    by_rig = read_record(path, RIG)
    table = {"drive_angle": "phi[deg]", "holding_moment": "Mz[N mm]", "split_sweeps": True, "missing": "force_y"}
    xr.testing.assert_identical(by_rig, read_record(path, Rig(WIRE, LoadCell(frame="turning"), file=table)))
    assert by_rig.attrs["load_cell_frame"] == "turning"
    xr.testing.assert_identical(GrowingRecord(path, RIG).poll().record, by_rig)


def test_a_rod_without_a_length_gives_the_shape_of_the_one_in_the_file(tmp_path):
    record = make_record(columns(), Rig(rod=WIRE))
    write_record(record, tmp_path / "record.csv")
    tapered = Rod(WIRE.length, WIRE.flexural_rigidity, WIRE.diameter, taper=0.4)
    assert rod_of(read_record(tmp_path / "record.csv", Rig(rod=Rod(taper=0.4)))) == tapered
    assert rod_of(with_rod(record, Rod(taper=0.4))) == tapered
    assert rod_of(with_rod(make_record(columns()), Rod(taper=0.4))) == Rod(taper=0.4)
    with refused(RecordError, "but"):
        read_record(tmp_path / "record.csv", Rig(rod=Rod(2 * WIRE.length, 1.0)))


def test_each_row_may_be_a_touch_and_a_condition_takes_rows(tmp_path):
    path = tmp_path / "touches.csv"
    path.write_text("x [mm],y [mm],M [N mm],ring,ok\n1,2,3,0,yes\n4,5,6,1,no\n7,8,9,2,yes\n-1,0,2,3,yes\n")
    columns = {"base_x": "x", "base_y": "y", "holding_moment": "M", "drive_angle": "1[rad]", "direction": "forward"}
    file = {**columns, "split_sweeps": "rows", "where": "ring >= 1 and ok == yes", "missing": ["force_x", "force_y"]}
    rig = Rig(WIRE, file=file)
    record = read_record(path, rig)
    assert record.sweep.values.tolist() == [0, 1]
    np.testing.assert_allclose(record.base_x, [7e-3, -1e-3])
    rig.write(tmp_path / "rig.toml")
    assert Rig.read(tmp_path / "rig.toml").format == rig.format
    xr.testing.assert_identical(read_record(path, Rig.read(tmp_path / "rig.toml")), record)


@pytest.mark.parametrize("where", ["ring", "rign > 0", "ring > 7", "ring > many"])
def test_a_condition_that_chooses_no_rows_is_refused(path, where):
    with refused(RecordError, "where"):
        read_record(path, Rig(WIRE, file={**RIG.format.table, "where": where}))
