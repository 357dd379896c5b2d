"""What is refused as a record, and why."""

import numpy as np
import pytest
import xarray as xr

from helpers.record_tables import WIRE, columns, edited
from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record import validate
from tactile_bayes.rig import Rig, make_record


def test_validation_completes_a_dataset_and_leaves_its_argument_alone():
    bare = xr.Dataset({name: ("sample", values) for name, values in columns(base_x=None).items()})
    bare.attrs["units"] = "dimensionless"
    before = bare.copy(deep=True)
    record = validate(bare)
    assert bare.identical(before)
    assert record.identical(make_record(columns()))


def test_coordinates_stay_coordinates():
    record = make_record(columns()).assign_coords(time=("sample", np.arange(6.0)), sample=np.arange(6))
    assert set(validate(record).coords) == {"time", "sample"}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (columns(drive_angle=None), "there is no column 'drive_angle' (columns: sweep, direction, base_x, base_y, "),
        (
            columns(drive_angle=None, DriveAngle=np.zeros(6)),
            "there is no column 'drive_angle', but a column 'DriveAngle': did you mean 'drive_angle'? Rename it",
        ),
        (
            columns(force_x=None, force_z=np.zeros(6)),
            "there is no column 'force_x', but a column 'force_z': did you mean 'force_x'? Rename it, or declare the "
            "channel missing, with an empty column, Rig(file={'missing': ['force_x']})",
        ),
        (
            columns(force_x=None),
            "declare the channel missing, with an empty column, Rig(file={'missing': ['force_x']})",
        ),
        (
            columns(base_x=None, Base_X=np.zeros(6)),
            "there is no column 'base_x', but a column 'Base_X': did you mean 'base_x'? Rename it, or add a column "
            "'base_x' (0 for a pivot in the origin)",
        ),
        (edited("force_x", 4, "0,3"), "sample 4, column 'force_x': '0,3' is not a number"),
        (edited("force_x", 4, "1_0"), "sample 4, column 'force_x': '1_0' is not a number"),
        (edited("force_x", 4, np.nan), "sample 4, column 'force_x': the value is missing (nan)"),
        (edited("holding_moment", 1, -np.inf), "sample 1, column 'holding_moment': the value is -inf"),
        (edited("drive_angle", 2, np.nan), "sample 2, column 'drive_angle': the value is missing (nan)"),
        (edited("drive_angle", 2, "up"), "sample 2, column 'drive_angle': 'up' is not a number"),
        (edited("base_y", 3, np.inf), "sample 3, column 'base_y': the value is inf"),
        (edited("sweep", 3, "one"), "sample 3, column 'sweep': 'one' is not an integer"),
        (edited("sweep", 3, 0.5), "sample 3, column 'sweep': 0.5 is not an integer"),
        (edited("direction", 5, "back"), "sample 5, column 'direction': 'back' is no direction: write 'forward' or"),
        (columns(direction=np.zeros(6)), "sample 0, column 'direction': 0.0 is not text"),
        (
            columns(drive_angle=np.degrees(columns()["drive_angle"])),
            "sample 0, column 'drive_angle': 57.29577951308232 is more than a turn (2π), so the angles look like "
            "degrees: convert the column to radians, with numpy.radians or times 0.017453292519943295",
        ),
        (
            columns(drive_angle=[1.0, 1.1, 1.2, 1.8, 1.9, 2.0]),
            "sweep 1 is labelled 'backward', but its drive angle increases, from 1.8 rad (sample 3) to 2.0 rad "
            "(sample 5): label it 'forward'",
        ),
        (
            edited("direction", 1, "backward"),
            "sweep 0 mixes two values of 'direction', 'forward' (sample 0) and 'backward' (sample 1)",
        ),
        (
            columns(base_x=[0.0, 0.0, 0.5, 1.0, 1.0, 1.0]),
            "sweep 0 mixes two values of 'base_x', 0.0 (sample 0) and 0.5 (sample 2)",
        ),
        ({name: [] for name in columns()}, "there are no samples"),
        (
            columns(holding_moment=[np.nan] * 6, force_x=[np.nan] * 6, force_y=[np.nan] * 6),
            "every load channel is empty: a record needs measurements of at least one of holding_moment, force_x",
        ),
        (columns(truth_force_x=["a"] * 6), "sample 0, column 'truth_force_x': 'a' is not a number"),
        (columns(time=np.zeros(6, "datetime64[s]")), "column 'time': np.datetime64('1970-01-01T00:00:00') is a time"),
        (columns(**{"a/b": np.zeros(6), "a|b": np.zeros(6)}), "the name 'a/b' cannot be stored in every file"),
        (columns(**{".": np.zeros(6)}), "the name '.' cannot be stored in every file"),
    ],
)
def test_what_cannot_be_a_record_is_refused(table, message):
    with refused(RecordError, message):
        make_record(table)


@pytest.mark.parametrize(
    ("attrs", "message"),
    [
        ({"units": "mm"}, "the record has units 'mm': its attribute 'units' has to be 'SI' or 'dimensionless'"),
        ({"rod_length": 0.2}, "'rod_length' is stated, but no units"),
        ({"units": "SI"}, "rod_length and rod_flexural_rigidity of its rod are not stated: give rod=Rod(length=..., "),
        ({"units": "SI", "rod_length": 0.2}, "rod_flexural_rigidity of its rod is not stated"),
        ({"units": "SI", "rod_length": "long", "rod_flexural_rigidity": 1.0}, "attribute 'rod_length' is 'long'"),
        ({"units": "SI", "rod_length": -1.0, "rod_flexural_rigidity": 1.0}, "the rod's length is -1.0"),
        ({"units": "dimensionless", "rod_length": 0.2}, "the record is dimensionless, but states rod_length 0.2"),
        ({"load_cell_force_noise": -1.0}, "attribute 'load_cell_force_noise' is -1.0"),
        ({"load_cell_force_noise": "low"}, "attribute 'load_cell_force_noise' is 'low'"),
        ({"rig": [1, 2]}, "attribute 'rig' is [1, 2]: attributes of a record are strings or numbers"),
        ({"good": True}, "attribute 'good' is True: attributes of a record are strings or numbers"),
        ({"load_cell_force_noise": True}, "attribute 'load_cell_force_noise' is True"),
    ],
)
def test_impossible_attributes_are_refused(attrs, message):
    with refused(RecordError, message):
        make_record(columns(), attrs=attrs)


def test_a_column_in_another_unit_is_refused():
    record = make_record(columns(), Rig(rod=WIRE))
    record["force_x"].attrs["units"] = "mN"
    with refused(RecordError, "column 'force_x' is in [mN], but the record is SI"):
        validate(record)


def test_what_is_no_dataset_or_has_other_dimensions_is_refused():
    with refused(RecordError, "a record is an xarray.Dataset, not a dict"):
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
    make_record({**table, "direction": direction}, Rig(file={"missing": ("force_x", "force_y")}))
    with refused(RecordError, f"sweep 0 is labelled {other!r}"):
        make_record({**table, "direction": other}, Rig(file={"missing": ("force_x", "force_y")}))


@pytest.mark.parametrize("samples", [1, 2, 100])
def test_a_drive_at_rest_has_either_direction(samples):
    for direction in ("forward", "backward"):
        table = {"sweep": 0, "direction": direction, "drive_angle": np.full(samples, 1.1), "holding_moment": 0.1}
        make_record(table, Rig(file={"missing": ("force_x", "force_y")}))


def test_a_whole_turn_may_be_read_by_an_encoder_whose_zero_is_off():
    table = columns(drive_angle=[6.0, 6.2, 6.5, 1.2, 1.1, 1.0])
    assert make_record(table).drive_angle.values.max() == 6.5
    with refused(RecordError, "sample 2, column 'drive_angle'", "more than a turn"):
        make_record(table | {"drive_angle": [6.0, 6.2, 6.9, 1.2, 1.1, 1.0]})


def test_sweeps_may_be_interleaved():
    order = [0, 3, 1, 4, 2, 5]
    make_record({name: np.asarray(values)[order] for name, values in columns().items()})
