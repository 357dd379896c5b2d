"""Data sets of rods that are carried: truth against scans, files, and refusals."""

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.data_sets import PLAIN, changed
from helpers.refusals import refused
from tactile_bayes.datasets import generate, read_specification, record, verify
from tactile_bayes.datasets.generation import generate_records
from tactile_bayes.errors import SpecificationError
from tactile_bayes.rig import NOTHING

FIRST = {
    "base": [0.9, {"uniform": [-0.1, 0.0]}],
    "heading": {"normal": [3.1, 0.02]},
    "drive_angle": {"choice": [1.3, 1.5]},
    "travel": {"uniform": [1.8, 2.0]},
}
SECOND = {"base": [-0.9, -0.05], "heading": 0.0, "drive_angle": {"each": [1.6, 1.8]}, "step": 0.04}
CARRIED = changed(
    PLAIN,
    records=6,
    shard_records=4,
    contours=[{"family": "circle", "r": {"uniform": [0.4, 0.6]}, "q": {"uniform": [0.6, 0.7]}}],
    scan={"samples": 40, "translations": [FIRST, SECOND]},
)
NEAR, OTHER = {**FIRST, "base": [0.09, 0.0], "travel": 0.18}, {**SECOND, "base": [-0.09, 0], "step": 0.005}
DRAWN = {"length": {"uniform": [0.1, 0.12]}, "rest_curvature": {"normal": [0.0, 1.0]}}
SI = changed(
    CARRIED,
    contours=[{"family": "parabola", "a": {"uniform": [5.0, 8.0]}, "q": {"uniform": [0.06, 0.07]}}],
    rod={**DRAWN, "flexural_rigidity": 1e-4, "diameter": 1e-3, "taper": 0.3},
    scan={"samples": 30, "translations": [NEAR, OTHER]},
    unknown={**NOTHING, "friction": 0.2},
    load_cell={"frame": "turning", "drive_angle_offset": 0.01, "drive_angle_backlash": 0.004, "force_noise": 1e-5},
)
TURNED = changed(
    CARRIED,
    scan__translations=[{**FIRST, "drive_angle": 0.9, "turn": {"uniform": [0.5, 0.7]}}, {**SECOND, "turn": 0.2}],
)
TURNED_SI = changed(SI, scan__translations=[{**NEAR, "turn": -0.1}])
BRIEF = changed(CARRIED, scan__translations=[{**FIRST, "travel": 0.9}])


SPECS = {"dimensionless": CARRIED, "SI": SI, "turned": TURNED, "turned, SI": TURNED_SI, "in contact at the end": BRIEF}


@pytest.mark.parametrize("spec", SPECS.values(), ids=SPECS)
def test_the_truth_is_what_a_scan_along_the_drive_says(spec, assert_truths_are_those_of_scans):
    assert_truths_are_those_of_scans(spec, 4)


def test_drives_follow_their_distributions():
    one, other = record(CARRIED, 1), record(CARRIED, 4)
    for data, angle in ((one, 1.8), (other, 1.6)):
        first, second = (data.isel(sample=data["sweep"].values == k) for k in (0, 1))
        assert [set(sweep.direction.values) for sweep in (first, second)] == [{"forward"}, {"backward"}]
        assert float(first.base_x[0]) == 0.9
        assert -0.1 <= float(first.base_y[0]) <= 0.0
        assert set(first.drive_angle.values) <= {1.3, 1.5}
        np.testing.assert_array_equal(second.drive_angle, angle)
        np.testing.assert_allclose(np.diff(second.base_x), 0.04, atol=1e-12)
        np.testing.assert_array_equal(second.base_y, -0.05)
        way = np.hypot(first.base_x[-1] - first.base_x[0], first.base_y[-1] - first.base_y[0])
        assert 1.8 <= float(way) <= 2.0
    assert float(one.base_y[0]) != float(other.base_y[0])


def test_a_heading_decides_the_direction_record_by_record():
    axis = {"axis": "side"}
    there = {"base": [0.0, -0.1], "heading": {"each": [0.0, 3.1416], **axis}, "drive_angle": 1.5708, "travel": 1.0}
    spec = changed(
        CARRIED,
        records=2,
        contours=[{"family": "parabola", "a": 1.0, "q": 0.5, "x_c": {"each": [0.8, -0.8], **axis}}],
        scan={"samples": 10, "translations": [there]},
    )
    assert [set(record(spec, i).direction.values) for i in range(2)] == [{"backward"}, {"forward"}]


@pytest.mark.parametrize("spec", [CARRIED, changed(SI, precision="single")], ids=["double", "single"])
def test_files_are_verified_and_inferred_from(spec, tmp_path):
    generate(spec, tmp_path / "set", workers=1)
    assert verify(tmp_path / "set", regenerate=1).is_complete
    data = tb.datasets.open(tmp_path / "set")
    assert data.base_x.dims == ("record", "sweep", "sample")
    assert data.direction.dims == data.truth_first_contact_travel.dims == ("record", "sweep")
    card = (tmp_path / "set" / "README.md").read_text()
    assert "a flexible rod that is carried" in card
    assert "| translation 2: step |" in card
    assert "pivot" not in card
    one = record(tmp_path / "set", 3)
    xr.testing.assert_identical(one, record(spec, 3))
    contacts = tb.reconstruct(record(tmp_path / "set", 3, truth=False))
    assert (contacts.status == "ok").sum() > 20


def translation(**changes):
    """PLAIN with one translation, changed; None removes an entry."""
    one = {name: value for name, value in {**FIRST, **changes}.items() if value is not None}
    return {"scan": {"translations": [one]}}


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"scan": {"translations": []}}, ["scan.translations is []", "[[scan.translations]]"]),
        ({"scan": {"translations": [FIRST], "margin": 0.1}}, ["translations, and margin", "rotations"]),
        (translation(speed=1.0), ["no key 'scan.translations[0].speed'"]),
        (translation(heading=None), ["scan.translations[0].heading is missing"]),
        (translation(base=None), ["scan.translations[0].base is missing"]),
        (translation(base=0.0), ["scan.translations[0].base is 0.0", "[x, y]"]),
        (translation(travel=None), ["scan.translations[0] has neither travel nor step"]),
        (translation(step=0.01), ["scan.translations[0] has both travel and step"]),
        (translation(travel=0.0), ["scan.translations[0].travel is 0"]),
        (translation(travel=None, step={"uniform": [-1, 1]}), ["scan.translations[0].step may be negative"]),
        (translation(heading=180.0), ["scan.translations[0].heading may be 180", "radians"]),
        (translation(drive_angle="steep"), ["scan.translations[0].drive_angle is 'steep'"]),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_what_is_no_translation_is_refused_by_its_key(change, named):
    with refused(SpecificationError, "specification", *named):
        read_specification(changed(PLAIN, **change))


@pytest.mark.parametrize(
    ("change", "reason", "correction"),
    [
        ({"base": [4.0, 0.0], "travel": 0.1}, "out of reach", "closer"),
        ({"base": [0.1, 0.0], "drive_angle": 1.6}, "touched at the beginning", "begin the translations farther"),
    ],
)
def test_translations_in_vain_are_given_up_with_a_reason(change, reason, correction):
    spec = changed(PLAIN, records=1, shard_records=1, **translation(**change))
    with refused(SpecificationError, "record 0", f"1000 {reason}", correction):
        generate_records(read_specification(spec), 0, 1)
