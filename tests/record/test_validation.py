"""What is refused as a record, and why."""

import numpy as np
import pytest
import xarray as xr

from helpers.record_tables import WIRE, columns, edited
from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record import CHANNELS, validate
from tactile_bayes.rig import Rig, make_record

ONLY_MOMENT = Rig(file={"missing": ("force_x", "force_y")})


def test_validation_completes_a_dataset_and_leaves_its_argument_alone():
    bare = xr.Dataset({name: ("sample", values) for name, values in columns(base_x=None).items()})
    bare.attrs["units"] = "dimensionless"
    before = bare.copy(deep=True)
    record = validate(bare)
    assert bare.identical(before)
    assert record.identical(make_record(columns()))
    record = make_record(columns()).assign_coords(time=("sample", np.arange(6.0)), sample=np.arange(6))
    assert set(validate(record).coords) == {"time", "sample"}


@pytest.mark.parametrize(
    ("table", "named"),
    [
        (columns(drive_angle=None), ["column 'drive_angle'", "(columns: sweep, direction, base_x, base_y,"]),
        (columns(drive_angle=None, DriveAngle=np.zeros(6)), ["no column 'drive_angle'", "a column 'DriveAngle'"]),
        (columns(force_x=None, force_z=np.zeros(6)), ["no column 'force_x'", "a column 'force_z'"]),
        (columns(force_x=None), ["Rig(file={'missing': ['force_x']})"]),
        (columns(base_x=None, Base_X=np.zeros(6)), ["no column 'base_x'", "a column 'Base_X'"]),
        (columns(force_y=np.zeros(5)), ["'force_y'", "(5,)", "(6,)"]),
        (edited("force_x", 4, "0,3"), ["sample 4, column 'force_x'", "'0,3'"]),
        (edited("force_x", 4, np.nan), ["sample 4, column 'force_x'", "nan"]),
        (edited("holding_moment", 1, -np.inf), ["sample 1, column 'holding_moment'", "-inf"]),
        (edited("drive_angle", 2, "up"), ["sample 2, column 'drive_angle'", "'up'"]),
        (edited("sweep", 3, 0.5), ["sample 3, column 'sweep'", "0.5"]),
        (edited("direction", 5, "back"), ["sample 5, column 'direction'", "'back'", "'forward' or"]),
        (columns(direction=np.zeros(6)), ["sample 0, column 'direction'", "0.0"]),
        (columns(drive_angle=np.degrees(columns()["drive_angle"])), ["sample 0, column 'drive_angle'", "degrees"]),
        (columns(drive_angle=[1.0, 1.1, 1.2, 1.8, 1.9, 2.0]), ["sweep 1", "1.8 rad (sample 3)", "2.0 rad (sample 5)"]),
        (edited("direction", 1, "backward"), ["sweep 0", "'forward' (sample 0)", "'backward' (sample 1)"]),
        (columns(base_x=[0.0, 0.0, 0.5, 1.0, 1.0, 1.0]), ["sweep 0", "'base_x'", "0.0 (sample 0)", "0.5 (sample 2)"]),
        ({name: [] for name in columns()}, ["no samples"]),
        (columns(**dict.fromkeys(CHANNELS, [np.nan] * 6)), ["is empty", "holding_moment, force_x"]),
        (columns(truth_force_x=["a"] * 6), ["sample 0, column 'truth_force_x'", "'a'"]),
        (columns(time=np.zeros(6, "datetime64[s]")), ["column 'time'", "np.datetime64('1970-01-01T00:00:00')"]),
        (columns(**{"a/b": np.zeros(6), "a|b": np.zeros(6)}), ["'a/b'", "cannot be stored"]),
        (columns(**{".": np.zeros(6)}), ["'.'", "cannot be stored"]),
    ],
)
def test_what_cannot_be_a_record_is_refused(table, named):
    with refused(RecordError, *named):
        make_record(table)


@pytest.mark.parametrize(
    ("attrs", "named"),
    [
        *(
            ({"units": "dimensionless", "rod_rest_shape_modes": text}, ["rest_shape_modes"])
            for text in ("none", "{}", '{"modes": 3}', '{"modes": [3]}', '{"modes": [{"edges": [0, 1]}]}')
        ),
        ({"record_format": 1}, ["record_format"]),
        ({"units": "mm"}, ["'units'", "'mm'", "'SI' or 'dimensionless'"]),
        ({"rod_length": 0.2}, ["'rod_length'", "no units"]),
        ({"units": "SI"}, ["rod_length and rod_flexural_rigidity", "Rod(length=...,"]),
        ({"units": "SI", "rod_length": 0.2}, ["rod_flexural_rigidity", "not stated"]),
        ({"units": "SI", "rod_length": "long", "rod_flexural_rigidity": 1.0}, ["'rod_length'", "'long'"]),
        ({"units": "SI", "rod_length": -1.0, "rod_flexural_rigidity": 1.0}, ["length", "-1.0"]),
        ({"units": "dimensionless", "rod_length": 0.2}, ["dimensionless", "rod_length 0.2"]),
        ({"load_cell_force_noise": -1.0}, ["'load_cell_force_noise'", "-1.0"]),
        ({"load_cell_force_noise": "low"}, ["'load_cell_force_noise'", "'low'"]),
        ({"rig": [1, 2]}, ["'rig'", "[1, 2]"]),
        ({"good": True}, ["'good'", "True"]),
        ({"load_cell_force_noise": True}, ["'load_cell_force_noise'", "True"]),
    ],
)
def test_impossible_attributes_are_refused(attrs, named):
    with refused(RecordError, *named):
        make_record(columns(), attrs=attrs)


def test_what_is_no_dataset_or_has_other_dimensions_or_units_is_refused():
    record = make_record(columns(), Rig(rod=WIRE))
    record["force_x"].attrs["units"] = "mN"
    with refused(RecordError, "'force_x'", "[mN]", "SI"):
        validate(record)
    with refused(RecordError, "xarray.Dataset", "dict"):
        validate(columns())
    with refused(RecordError, "variable 'image' has dimensions ('sample', 'pixel')"):
        validate(make_record(columns()).assign(image=(("sample", "pixel"), np.zeros((6, 2)))))


@pytest.mark.parametrize("direction", ["forward", "backward"])
@pytest.mark.parametrize("noise", [0.0, 0.5, 3.0])
def test_encoder_noise_does_not_hide_the_direction_of_a_sweep(direction, noise):
    # Noise in steps of the drive. With 200 steps the trend is at least 60 of its standard errors, so that either
    # outcome is certain for every seed.
    angle = np.radians(60 + 0.25 * (np.arange(200) + noise * np.random.default_rng(1).standard_normal(200)))
    table = {"sweep": 0, "drive_angle": angle if direction == "forward" else angle[::-1], "holding_moment": 0.1}
    other = "backward" if direction == "forward" else "forward"
    make_record({**table, "direction": direction}, ONLY_MOMENT)
    with refused(RecordError, f"sweep 0 is labelled {other!r}"):
        make_record({**table, "direction": other}, ONLY_MOMENT)


@pytest.mark.parametrize("samples", [1, 2, 100])
@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_a_drive_at_rest_has_either_direction(samples, direction):
    table = {"sweep": 0, "direction": direction, "drive_angle": np.full(samples, 1.1), "holding_moment": 0.1}
    make_record(table, ONLY_MOMENT)


def test_a_whole_turn_may_be_read_by_an_encoder_whose_zero_is_off():
    table = columns(drive_angle=[6.0, 6.2, 6.5, 1.2, 1.1, 1.0])
    assert make_record(table).drive_angle.values.max() == 6.5
    with refused(RecordError, "sample 2, column 'drive_angle'", "more than a turn"):
        make_record(table | {"drive_angle": [6.0, 6.2, 6.9, 1.2, 1.1, 1.0]})


def test_sweeps_may_be_interleaved():
    order = [0, 3, 1, 4, 2, 5]
    make_record({name: np.asarray(values)[order] for name, values in columns().items()})
