"""Sweeps and directions, found where the drive turns."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record import write_record
from tactile_bayes.record.sweep_segments import split_at_turns, turning_points
from tactile_bayes.record.table import Source, Table
from tactile_bayes.rig import Rig, make_record, read_record


def split(angle, **columns):
    table = split_at_turns(Table({"drive_angle": (np.asarray(angle, float), {}), **columns}, {}, Source()))
    sweep, direction = table.columns["sweep"][0], table.columns["direction"][0]
    starts = [0, *(np.flatnonzero(np.diff(sweep)) + 1).tolist()]
    assert sweep[starts].tolist() == list(range(len(starts)))
    return starts, "".join(direction[starts].astype("U1").tolist())


UP, DOWN = np.linspace(1.0, 2.0, 101), np.linspace(2.0, 1.0, 101)


FULL = [0.0, 2.0, 4.0, 6.1]


@pytest.mark.parametrize(
    ("parts", "base", "starts", "directions"),
    [
        ([UP], None, [0], "f"),
        ([DOWN], None, [0], "b"),
        ([UP, DOWN], None, [0, 101], "fb"),
        ([DOWN, UP[1:], DOWN[1:]], None, [0, 101, 201], "bfb"),
        ([UP, UP, UP], None, [0, 101, 202], "fff"),  # the drive goes back between samples
        ([DOWN, DOWN], None, [0, 101], "bb"),
        ([UP, np.full(40, 2.0), DOWN], None, [0, 101], "fb"),  # it rests: in which sweep does not matter
        ([UP[:2], DOWN[:0]], None, [0], "f"),
        ([range(6), range(6)], None, [0, 6], "ff"),  # a reset by less than a turn
        # A pivot that moves begins a sweep, and may have its angle reset by a turn.
        ([UP, DOWN[1:]], np.repeat([0.0, 0.5], [101, 100]), [0, 101], "fb"),
        ([UP], np.repeat([0.0, 0.5], [50, 51]), [0, 50], "ff"),
        ([FULL, FULL], np.repeat([0.0, 0.5], 4), [0, 4], "ff"),
    ],
)
def test_segments_without_noise(parts, base, starts, directions):
    for columns in [{}] if base is None else [{"base_x": (base, {})}, {"base_y": (base, {})}]:
        assert split(np.concatenate(parts), **columns) == (starts, directions)


@given(st.integers(0, 2**32), st.floats(0.0, 0.02), st.integers(1, 7), st.booleans())
def test_encoder_noise_makes_no_segments(seed, noise, segments, downwards):
    # Noise is uniform within ±0.02 of the range at most, so it cannot come back by a tenth, whatever the seed; an
    # extreme lies where the angle is within 0.04 of the end, that is within 4 samples of the turn.
    angle = np.concatenate([DOWN[k > 0 :] if (k + downwards) % 2 else UP[k > 0 :] for k in range(segments)])
    noisy = angle + np.random.default_rng(seed).uniform(-noise, noise, angle.size)
    starts, directions = split(noisy)
    assert directions == ("bf" * 4 if downwards else "fb" * 4)[:segments]
    assert np.abs(np.array(starts) - [0, *(101 + 100 * k for k in range(segments - 1))]).max() <= 4


@given(st.lists(st.integers(-20, 20), min_size=1, max_size=700), st.integers(0, 25))
def test_turning_points_are_those_of_the_definition(angle, least):
    """Against the definition, sample by sample."""
    expected, sense, extreme = [], 0, 0
    for i, value in enumerate(angle):
        if sense == 0:
            rises, falls = value - min(angle[: i + 1]) > least, max(angle[: i + 1]) - value > least
            sense, extreme = int(rises) - int(falls), i
        elif sense * value > sense * angle[extreme]:
            extreme = i
        elif sense * (angle[extreme] - value) > least:
            expected.append(extreme)
            sense, extreme = -sense, i
    assert turning_points(np.array(angle, float), least) == expected


@pytest.mark.parametrize("suffix", [".csv", ".nc"])
def test_a_file_without_sweeps_is_split(tmp_path, suffix):
    missing = ("force_x", "force_y")
    labels = {"sweep": np.repeat([0, 1], 101), "direction": np.repeat(["forward", "backward"], 101)}
    table = {"drive_angle": np.concatenate([UP, DOWN]), "holding_moment": 0.1}
    record = make_record(table | labels, Rig(file={"missing": missing}))
    path = tmp_path / f"record{suffix}"
    if suffix == ".nc":
        record.drop_vars(["sweep", "direction"]).to_netcdf(path, engine="h5netcdf")
    else:
        record.drop_vars(["sweep", "direction"]).to_dataframe().to_csv(path, index=False)
        path.write_text("# units: dimensionless\n" + path.read_text())
    assert read_record(path, Rig(file={"split_sweeps": True})).identical(record)
    there = "(columns: base_x, base_y, drive_angle, holding_moment, force_x, force_y)"
    entries = ("Rig(file={'split_sweeps': True})", "split_sweeps = true")
    with refused(RecordError, "no column 'sweep'", there, *entries):
        read_record(path)
    write_record(record, path)
    with refused(RecordError, "'sweep' is there", "split_sweeps"):
        read_record(path, Rig(file={"split_sweeps": True}))


@pytest.mark.parametrize(
    ("angle", "named"),
    [
        ([1.0, 1.0, 1.0], ["line 2 to line 4", "no direction"]),
        ([1.0, np.nan, 1.2], ["line 3, column 'drive_angle'", "nan"]),
        ([], ["no samples"]),
        ([1.0], ["one sample, line 2", "no direction", "'sweep'"]),
        (
            [6.0, 6.1, 6.2, 0.1, 0.2],
            ["6.2 rad (line 4)", "0.1 rad (line 5)", "360°", "(numpy.unwrap)", "'sweep' and 'direction'"],
        ),
        ([6.2, 6.3, 6.4, 0.2, 0.3], ["a turn", "6.4 rad (line 4)", "0.2 rad (line 5)"]),
        ([-3.0, -3.1, 3.1, 3.0], ["a turn", "-3.1 rad (line 3)", "3.1 rad (line 4)"]),
        ([60.0, 66.3, 72.6], ["line 2, column 'drive_angle'", "60.0", "(2π)", "degrees"]),
    ],
)
def test_what_cannot_be_split_is_refused_with_its_place(tmp_path, angle, named):
    path = tmp_path / "record.csv"
    path.write_text("drive_angle,holding_moment\n" + "".join(f"{value},0.1\n" for value in angle))
    with refused(RecordError, path, *named):
        read_record(path, Rig(file={"split_sweeps": True, "missing": ("force_x", "force_y")}))
