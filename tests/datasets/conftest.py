"""What tests of data sets share: one that is made, copies of it, and a check of truths against scans."""

import shutil

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.data_sets import PLAIN
from tactile_bayes.datasets import contour_of, generate, read_specification, record
from tactile_bayes.datasets.generation import generate_records
from tactile_bayes.datasets.shard import records_as_dataset
from tactile_bayes.record import CHANNELS, in_frame, rod_of
from tactile_bayes.rig import Rig


@pytest.fixture(scope="session")
def plain_set(tmp_path_factory):
    """The folder of a data set as PLAIN specifies it, to be read only."""
    folder = tmp_path_factory.mktemp("plain set")
    generate(PLAIN, folder, workers=1)
    return folder


@pytest.fixture
def folder(plain_set, tmp_path):
    """A copy of that data set, to be damaged."""
    return shutil.copytree(plain_set, tmp_path / "copy")


@pytest.fixture(scope="session")
def assert_truths_are_those_of_scans():
    """Loads to 1e-6 of the largest of a channel, contacts to 2e-5 of the rod, events to rounding."""

    def check(spec, count):
        said = read_specification(spec)
        whole = records_as_dataset(said, generate_records(said, 0, count))
        for i in range(count):
            mine = record(said, i)
            for number in range(said.sweep_count):
                _compare(said, mine, whole.isel(record=i), number)

    return check


def _compare(said, mine, row, number):
    sweep, row = mine.isel(sample=mine["sweep"].values == number), row.isel(sweep=number)
    angle = sweep["truth_drive_angle" if "truth_drive_angle" in sweep else "drive_angle"].values
    base, rod = (sweep.base_x.values, sweep.base_y.values), rod_of(mine)
    carried = bool(np.ptp(base, axis=1).any())
    if carried:
        drive = tb.Motion(*base, angle)
    else:
        drive = tb.Rotation((float(base[0][0]), float(base[1][0])), str(sweep.direction.values[0]), drive_angles=angle)
    for name in {"rod_length", "rod_rest_curvature", "rod_taper"} & set(row):
        assert float(row[name]) == getattr(rod, name.removeprefix("rod_"))
    scan = tb.scan(contour_of(mine), drive=drive, rig=Rig(rod=rod, unknown={"friction": said.friction}))
    theirs, events = in_frame(scan.record, said.frame), scan.sweeps[0]
    assert set(sweep.direction.values) == {events.direction}
    assert theirs.sizes["sample"] == said.drive.samples
    sure = np.ones(angle.size, dtype=bool)
    if not carried:
        assert events.direction == said.sweeps[number][1]
        assert np.all(np.diff(angle) * (1.0 if events.direction == "forward" else -1.0) > 0.0)
        # Whether a sample at the very snap-off is loaded, rounding decides.
        for event in (events.first_contact, events.snap_off):
            sure &= np.abs(angle - event.drive_angle) > 1e-9
    tolerances = {name: 1e-6 * np.abs(theirs[name].values).max() for name in CHANNELS}
    tolerances |= {f"truth_contact_{name}": 2e-5 * rod.length for name in ("x", "y", "arclength")}
    if not carried:
        tolerances |= {"truth_slope_angle": 2e-5, "truth_tip_angle": 2e-5}
        assert np.mean((sweep.truth_contact_phase.values == theirs.truth_contact_phase.values)[sure]) > 0.95
        kinds = [events.first_contact.kind, *(change.kind.split(" → ")[1] for change in events.transitions)]
        words = row.truth_phases.attrs["flag_meanings"].split()
        assert words[int(row.truth_phases)] == "-".join("A" if kind == "tip" else "B" for kind in kinds)
    for name, tolerance in tolerances.items():
        ours = sweep[name if name.startswith("truth_") else f"truth_{name}"].values
        np.testing.assert_allclose(ours[sure], theirs[name].values[sure], rtol=0, atol=tolerance, err_msg=name)
    for event in ("first_contact", "snap_off"):
        for name in ("drive_angle", "slope_angle", "contact_x", "contact_y", *["travel"] * carried):
            there = getattr(getattr(events, event), name)
            np.testing.assert_allclose(float(row[f"truth_{event}_{name}"]), there, rtol=1e-7, atol=1e-9, err_msg=name)
    kinds = row.truth_snap_off_kind.attrs["flag_meanings"].split()
    assert kinds[int(row.truth_snap_off_kind)] == {"smooth": "fold"}.get(events.snap_off.kind, events.snap_off.kind)
