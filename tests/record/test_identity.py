"""The hash of a record."""

import math
import re

import numpy as np

from helpers.record_tables import WIRE, columns, edited
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS, record_hash
from tactile_bayes.rig import Rig, make_record


def test_the_hash_ignores_truth_order_and_remarks():
    record = make_record(columns(), Rig(rod=WIRE))
    same = record[list(reversed(list(record.data_vars)))].assign(truth_force_x=record["force_x"], note=record["sweep"])
    same.attrs |= {"rig": "bench", "load_cell_frame": "fixed"}
    assert record_hash(same) == record_hash(record)
    assert re.fullmatch("[0-9a-f]{64}", record_hash(record))


def test_the_hash_sees_every_measured_value_unit_and_rod():
    variants = [
        make_record(columns()),
        make_record(columns(), Rig(rod=WIRE)),
        make_record(columns(), Rig(rod=Rod(0.2, 2.4e-3))),
        make_record(columns(sweep=[0, 0, 0, 2, 2, 2])),
        make_record(columns(direction=["forward"] * 6, drive_angle=[1, 1.1, 1.2, 1.8, 1.8, 1.8])),
        make_record(columns(drive_angle=[1, 1.1, 1.2, 1.8, 1.8, 1.8])),
        make_record(columns(base_x=[1.0] * 6)),
        make_record(columns(base_y=[1.0] * 6)),
        *(make_record(edited(name, 2, math.nextafter(columns()[name][2], 9))) for name in ("drive_angle", *CHANNELS)),
        *(make_record(columns(**{name: [np.nan] * 6})) for name in CHANNELS),
        make_record(columns(), attrs={"load_cell_frame": "turning"}),
    ]
    assert len({record_hash(record) for record in variants}) == len(variants)
