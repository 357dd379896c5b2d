"""The file of a rig: written and read, in units as text, from hostile text; what is refused, with the file's name."""

import math
import re

import numpy as np
import pytest
from scipy import stats

from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell, OrnsteinUhlenbeck, RandomWalk
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import Rig
from tactile_bayes.rig.file_format import FileFormat
from tactile_bayes.rig.parameters import GROUPS, PARAMETERS
from tactile_bayes.rig.rig_prior import RigPrior

S = np.linspace(0.0, 1.0, 40)
RODS = {
    "dimensionless": Rod(),
    "dimensionless, curved": Rod(rest_curvature=0.3, taper=0.2, stem=0.01, diameter=0.01),
    "SI": Rod(0.2, 3.1e-4),
    "SI, all": Rod(0.2, 3.1e-4, diameter=1e-3, elastic_strain=0.02, rest_curvature=1.2, taper=0.4, stem=0.003),
    "curved along": Rod(0.2, 3.1e-4, rest_curvature=lambda s: 3.0 * s - 0.1, rigidity_profile=lambda s: 1.0 - 0.3 * s),
    "traced": Rod.from_shape(0.1 * S, 0.02 * S**2, 1e-5),
    "numbers of NumPy": Rod(0.1, 1e-5, taper=np.float64(0.5), stem=np.float64(0.01)),
    "measured": Rod(0.2, 3.1e-4, diameter=1e-3, taper=0.4, taper_deviation=0.02),
}
CELLS = {
    "noise": LoadCell(force_noise=0.05, moment_noise=0.02),
    "everything": LoadCell(
        force_noise=0.05,
        moment_noise=0.02,
        relative_noise=0.01,
        force_resolution=1e-3,
        moment_resolution=2e-3,
        force_range=5.0,
        moment_range=7.0,
        bias=(0.1, -0.2, 0.3),
        gain=((1.0, 0.0, 0.02), (0.01, 1.1, 0.0), (0.0, 0.03, 0.95)),
        lever=(-0.01, 0.04),
        moment_curve=(0.01, 0.002),
        lag=(0.5, 1.0, 0.0),
        lag_seconds=0.1,
        play=(0.01, 0.0, 0.02),
        drive_angle_offset=-0.02,
        drive_angle_backlash=0.01,
        drive_angle_noise=0.001,
        frame="turning",
    ),
    "drifts": LoadCell(force_noise=0.05, moment_noise=0.02, drift=RandomWalk(moment=0.1, force=0.2)),
    "wanders": LoadCell(force_noise=0.05, moment_noise=0.02, drift=OrnsteinUhlenbeck(0.1, 0.2, 50.0)),
    "doubtful zero": LoadCell(force_noise=0.05, moment_noise=0.02, bias_uncertainty=(0.1, 0.0, 0.2)),
    "dependent": LoadCell(force_noise=0.05, moment_noise=0.02, correlation=(0.1, -0.2, 0.3)),
    "heavy tails": LoadCell(force_noise=0.05, moment_noise=0.02, degrees_of_freedom=4.0),
}
SAID = {
    "nothing": "nothing",
    "numbers": {"friction": 0.2, "lever": 0.0, "base_3_x": -1e-17},
    "distributions": {
        "friction": stats.halfnorm(scale=1.0 / 3.0),
        "bias": stats.norm(0.1, 0.3),
        "rigidity_scale": stats.lognorm(s=0.1, scale=1.02),
        "drive_angle_offset": stats.uniform(-0.1, 0.3),
        "moment_noise": stats.loguniform(1e-5, 0.3),
        "taper": stats.truncnorm(-1.0, 2.0, loc=0.2, scale=0.1),
        "backlash": stats.t(df=4.0, scale=0.01),
    },
    "defaults": {"drift": "default", "gain": "default", "discrepancy": "default", "base": "default"},
}
FORMATS = {
    "as of records": FileFormat(),
    "of a rig": FileFormat(
        {"force_x": "-Fx[mN]", "drive_angle": '"angle" [deg]', "base_x": "2e-3"}, True, ("force_y",)
    ),
}
CALIBRATION = RigPrior(
    {
        "rigidity_scale": stats.lognorm(s=0.013, scale=1.03),
        "lever_x": stats.norm(0.001, 1.0 / 3e3),
        "taper": stats.truncnorm(-0.5, np.inf, loc=0.05, scale=0.1),
    },
    np.array([[1.0, 0.3, -0.1], [0.3, 1.0, 0.2], [-0.1, 0.2, 1.0]]),
    0.0123,
    "0f 1e",
    {"rod_length": 0.2, "units": "SI", "load_cell_gain_force_x_moment": 0.0, "rod_count": 3},
)


RIGS = {
    **{f"rod, {name}": Rig(rod=rod) for name, rod in RODS.items()},
    **{f"load cell, {name}": Rig(load_cell=cell) for name, cell in CELLS.items()},
    **{f"unknown, {name}": Rig(unknown=said) for name, said in SAID.items()},
    **{f"file, {name}": Rig(file=form) for name, form in FORMATS.items()},
    "calibration": Rig(calibration=CALIBRATION),
    "all": Rig(
        rod=RODS["SI, all"],
        load_cell=CELLS["everything"],
        unknown={"friction": stats.halfnorm(scale=0.1), "bias": 0.0},
        calibration=CALIBRATION,
        file=FORMATS["of a rig"],
    ),
}


def read(path, text):
    path.write_text(text, encoding="utf-8")
    return Rig.read(path)


@pytest.mark.parametrize("rig", RIGS.values(), ids=RIGS)
def test_what_is_written_is_read_as_it_was(rig, tmp_path):
    path = tmp_path / "rig.toml"
    rig.write(path)
    again = Rig.read(path)
    assert (again.text, again.rod, again.load_cell, again.file) == (rig.text, rig.rod, rig.load_cell, rig.file)
    assert list(again.entries) == list(rig.entries)
    for name, value in rig.entries.items():
        other = again.entries[name]
        if isinstance(value, float | str):
            assert other == value
        else:
            np.testing.assert_array_equal(other.ppf([0.1, 0.5, 0.9]), value.ppf([0.1, 0.5, 0.9]))
    assert path.read_text(encoding="utf-8").startswith("# A rig")


def test_distributions_of_ones_own_are_not_written(tmp_path):
    own = stats.rv_histogram((np.ones(4), np.linspace(0.3, 0.7, 5)))()
    rig = Rig(unknown={"friction": own})
    with refused(ParameterError, "written"):
        rig.write(tmp_path / "rig.toml")
    assert list(tmp_path.iterdir()) == []
    assert rig.text == "not written"


UNITS = """
[rod]
length = "200 mm"
diameter = "0.4 mm"
youngs_modulus = "2.1e11 N/m²"
stem = "3 mm"

[load_cell]
force_noise = "5 mN"
moment_noise = "0.2 mN m"
lever = ["1 mm", "-2 mm"]
lag = [1.0, 0.0, 2.0]
lag_seconds = ["50 ms", 0.0, "0.2 s"]
play = 0.01
play_force_x = 0.02
drive_angle_offset = "1 deg"

[unknown]
lever_x = "0.5 mm"
lag_seconds = "20 ms"
drive_angle_offset = "2 deg"
moment_bias = { normal = ["0 mN m", "1 mN m"] }
base_2_x = "3 mm"
length = { normal = ["201 mm", "1 mm"] }
"""


@pytest.mark.parametrize("name", ["bias", "bias_uncertainty", "gain", "lever", "moment_curve", "correlation", "lag"])
def test_entries_of_several_numbers_are_lists(tmp_path, name):
    value = np.ravel(getattr(CELLS["everything"], name)).tolist()
    rig = read(tmp_path / "rig.toml", f"[load_cell]\n{name} = {value}\n")
    assert np.ravel(getattr(rig.load_cell, name)).tolist() == value


def test_units_are_texts(tmp_path):
    rig = read(tmp_path / "rig.toml", UNITS)
    assert rig.rod == Rod(0.2, 2.1e11 * math.pi * 4e-4**4 / 64.0, diameter=4e-4, stem=0.003)
    assert rig.load_cell.force_noise == pytest.approx(5e-3)
    assert rig.load_cell.moment_noise == pytest.approx(2e-4)
    assert rig.load_cell.lever == pytest.approx((1e-3, -2e-3))
    assert rig.load_cell.drive_angle_offset == pytest.approx(np.radians(1.0))
    assert (rig.load_cell.lag, rig.load_cell.play) == ((1.0, 0.0, 2.0), (0.01, 0.02, 0.01))
    assert rig.load_cell.lag_seconds == pytest.approx((0.05, 0.0, 0.2))
    known = {"lever_x": 5e-4, "lag_seconds": 0.02, "drive_angle_offset": np.radians(2.0), "base_2_x": 3e-3}
    assert rig.known == pytest.approx(known)
    assert rig.distributions["moment_bias"].std() == pytest.approx(1e-3)
    assert rig.distributions["length"].mean() == pytest.approx(0.201)


SHAPED = '[rod]\nshape = "shape.csv"\nflexural_rigidity = 1e-5\n'


def write_shape(folder, x, y, names="x,y"):
    rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    (folder / "shape.csv").write_text(f"{names}\n{rows}", encoding="utf-8")


def test_a_shape_is_found_beside_the_file(tmp_path, monkeypatch):
    folder = tmp_path / "rigs"
    folder.mkdir()
    write_shape(folder, 0.1 * S, 0.02 * S**2)
    monkeypatch.chdir(tmp_path)
    assert read(folder / "rig.toml", SHAPED).rod == RODS["traced"]
    assert read(folder / "rig.toml", SHAPED + "elastic_strain = 0.002\n").rod.elastic_strain == 0.002
    with pytest.raises((ParameterError, FileNotFoundError), match=r"other\.csv"):
        read(folder / "rig.toml", SHAPED.replace("shape.csv", "other.csv"))


def test_a_file_may_name_that_of_another_rig(tmp_path):
    """It says only what is otherwise, and each of its tables replaces that of the other."""
    other = tmp_path / "calibrated" / "rig.toml"
    other.parent.mkdir()
    RIGS["all"].write(other)
    named = 'rig = "calibrated/rig.toml"\n'
    rig = read(tmp_path / "rig.toml", named + "[file]\nforce_y = 'Fy[N]'\n[unknown]\nlever_y = '1 mm'\n")
    assert (rig.rod, rig.load_cell, rig.calibration.source) == (RODS["SI, all"], CELLS["everything"], "0f 1e")
    assert (rig.format.table, rig.entries) == ({"force_y": "Fy[N]"}, {"lever_y": 0.001})
    assert read(tmp_path / "rig.toml", named).text == RIGS["all"].text
    (tmp_path / "third.toml").write_text('rig = "rig.toml"\n')
    with refused(ParameterError, "third.toml", "rig.toml", "calibrated/rig.toml"):
        Rig.read(tmp_path / "third.toml")


def test_a_session_differs_from_a_calibration(tmp_path):
    """Its rig is that of the calibration plus independent normal deviations, of log-normal ones in the logarithm."""
    Rig(calibration=CALIBRATION, rod=RODS["SI, all"]).write(tmp_path / "calibrated.toml")
    differs = 'rig = "calibrated.toml"\n[session]\nlever_x = "1 mm"\nrigidity_scale = 0.02\n'
    rig = read(tmp_path / "rig.toml", differs)
    assert rig.text == Rig.read(tmp_path / "calibrated.toml").with_session(lever_x=0.001, rigidity_scale=0.02).text
    found = rig.calibration.draw(np.random.default_rng(1), 40000)
    expected = CALIBRATION.draw(np.random.default_rng(2), 40000)
    expected[:, 0] *= np.exp(np.random.default_rng(3).normal(0.0, 0.02, 40000))
    expected[:, 1] += np.random.default_rng(4).normal(0.0, 0.001, 40000)
    np.testing.assert_allclose(found.std(axis=0), expected.std(axis=0), rtol=0.02)
    np.testing.assert_allclose(np.corrcoef(found.T), np.corrcoef(expected.T), atol=0.02)
    for wrong, words in (("taper = 0.1", "taper"), ("friction = 0.1", "friction"), ("lever_x = -1.0", "lever_x")):
        with refused(ParameterError, "session", words):
            read(tmp_path / "rig.toml", f'rig = "calibrated.toml"\n[session]\n{wrong}\n')
    with refused(ParameterError, "session", "calibrated"):
        read(tmp_path / "rig.toml", "[session]\nlever_x = 0.1\n")
    with refused(ParameterError, "session", "calibrate_rig"):
        Rig().with_session(lever_x=0.1)


@pytest.mark.parametrize("key", ["rest_curvature = 1.0", "rest_curvature_deviation = 0.1", "taper_deviation = 0.01"])
def test_what_follows_from_a_shape_is_not_stated_beside_it(tmp_path, key):
    write_shape(tmp_path, S, 0.2 * S**2)
    with refused(ParameterError, "shape and", key.split()[0]):
        read(tmp_path / "rig.toml", f"{SHAPED}{key}\n")


def test_a_shape_may_have_diameters(tmp_path):
    lines = "".join(f"{x};0.0;{2.0 - 0.01 * x}\n" for x in np.linspace(0.0, 100.0, 20))
    (tmp_path / "shape.csv").write_text(f"x[mm];y[mm];diameter[mm]\n{lines}", encoding="utf-8")
    by_modulus = read(tmp_path / "rig.toml", '[rod]\nshape = "shape.csv"\nyoungs_modulus = "200 GPa"\n').rod
    assert by_modulus.diameter == pytest.approx(2e-3)
    assert by_modulus.taper == pytest.approx(0.5)
    assert by_modulus.flexural_rigidity == pytest.approx(2e11 * np.pi * 2e-3**4 / 64.0)


def test_a_shape_has_the_unit_in_its_names(tmp_path):
    write_shape(tmp_path, 10.0 * S, 2.0 * S**2, "x [cm],y [cm]")
    assert read(tmp_path / "rig.toml", SHAPED).rod.length == pytest.approx(RODS["traced"].length, rel=1e-12)
    write_shape(tmp_path, 0.1 * S, 0.02 * S**2, "x [L],y [L]")
    with refused(ParameterError, "shape.csv", "rod lengths"):
        read(tmp_path / "rig.toml", SHAPED)


def test_a_rig_without_a_rod_in_metres_has_no_units(tmp_path):
    plain = read(
        tmp_path / "rig.toml", '[load_cell]\nforce_noise = 0.05\nmoment_noise = 0.02\n[unknown]\nbacklash = "1 deg"'
    )
    assert plain.load_cell == CELLS["noise"]
    assert plain.known["backlash"] == pytest.approx(np.radians(1.0))
    for text in ('[load_cell]\nforce_noise = "5 mN"', '[unknown]\nlever_x = "1 mm"', '[rod]\nstem = "1 mm"'):
        with refused(ParameterError, "dimensionless"):
            read(tmp_path / "rig.toml", text)


def test_a_file_states_its_format_and_one_that_states_none_has_the_first(tmp_path):
    rig = Rig(unknown={"friction": 0.2})
    rig.write(tmp_path / "rig.toml")
    text = (tmp_path / "rig.toml").read_text(encoding="utf-8")
    assert text.count("\nformat = 1\n") == 1
    for said in (text, text.replace("format = 1\n", "")):
        assert read(tmp_path / "rig.toml", said).tables == rig.tables


def calibrated(parameters, correlation):
    stated = 'source = "0"\nerror = 0.01\nstated = {}'
    return f"[calibration]\n{stated}\nparameters = {parameters}\ncorrelation = {correlation}"


TWO = "{ lever_x = { normal = [0.0, 0.1] }, lever_y = { normal = [0.0, 0.1] } }"
WRONG = {
    "a newer format": ("format = 2\n[road]", "format 2"),
    "no format": ('format = "1"', "format '1'"),
    "no table": ("[road]", "did you mean 'rod'"),
    "no parameter": ("[unknown]\nfrictoin = 0.1", "did you mean 'friction'"),
    "no entry": ("[rod]\nlenght = 0.1", "did you mean 'length'"),
    "another table's": ("[rod]\nforce_noise = 0.1", "load_cell"),
    "no column": ("[file]\nforce_z = 'Fz'", "force_z"),
    "a table that is none": ("rod = 1", "rod"),
    "another unit": ('[rod]\nlength = "3 N"\nflexural_rigidity = 1e-5', "rod.length.*not in"),
    "a list": ("[rod]\nlength = [1.0]\nflexural_rigidity = 1e-5", "rod.length"),
    "a length alone": ("[rod]\nlength = 0.1", "flexural_rigidity"),
    "a modulus alone": ("[rod]\nlength = 0.1\nyoungs_modulus = 1e11", "diameter"),
    "a shape alone": ("[rod]\nshape = 'shape.csv'", "flexural_rigidity"),
    "a lag in seconds": ("[load_cell]\nlag = '50 ms'", "lag_seconds"),
    "two of three lags": ("[load_cell]\nlag = [1.0, 2.0]", "lag_force_y"),
    "too few": ("[load_cell]\nlever = [0.1]", "lever"),
    "no distribution": ("[unknown]\nfriction = { wide = 1.0 }", "unknown.friction"),
    "no width": ("[unknown]\nfriction = { normal = [0.1, 0.0] }", "give the number"),
    "out of bounds": ("[unknown]\nfriction = -1.0", "friction"),
    "text": ('[unknown]\nfriction = "wide"', "friction"),
    "everything": ('unknown = "everything"', "unknown"),
    "no number": ("[rod]\nlength = nan\nflexural_rigidity = 1.0", "length"),
    "half a calibration": ("[calibration]\nerror = 0.1", "parameters"),
    "one correlation of two": (calibrated(TWO, "[[1.0]]"), "does not fit"),
    "correlations above one": (calibrated(TWO, "[[1.0, 2.0], [2.0, 1.0]]"), "no matrix of correlations"),
    "covariances": (calibrated(TWO, "[[2.0, 0.0], [0.0, 1.0]]"), "no matrix of correlations"),
    "correlations that are no number": (calibrated(TWO, "[[1.0, nan], [nan, 1.0]]"), "does not fit"),
    "correlations that are text": (calibrated(TWO, '[["a", 0.0], [0.0, 1.0]]'), "correlation"),
    "ragged correlations": (calibrated(TWO, "[[1.0, 0.0], [0.0]]"), "correlation"),
    "a calibrated number": (calibrated("{ lever_x = 0.1 }", "[[1.0]]"), "lever_x"),
    "nothing calibrated": (calibrated("{}", "[]"), "does not fit"),
    "no calibrated parameter": (calibrated("{ rust = { normal = [0.0, 0.1] } }", "[[1.0]]"), "rust"),
    "a list of calibrated ones": (calibrated("[1.0]", "[[1.0]]"), "parameters"),
    "no TOML": ("[rod\nlength", "line"),
    "deep": ("x = " + "[" * 5000 + "]" * 5000, "nested deeper"),
    "deep tables": ("[" + "a." * 5000 + "a]", "5001 parts"),
    "large": ("#" * (1 << 20) + "\n#", "more than"),
    "digits": ("[rod]\nlength = " + "9" * 5000 + "\nflexural_rigidity = 1.0", "no TOML|not TOML|number"),
    "a zero byte": ("[rod]\nlength = 0.1\x00", "line 2"),
}


@pytest.mark.parametrize(("text", "words"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_with_a_file_is_named_with_it(text, words, tmp_path):
    where = re.escape(str(tmp_path / "rig.toml"))
    with pytest.raises(ParameterError, match=f"(?s)^{where}: .*({words})"):
        read(tmp_path / "rig.toml", text)


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "rig.toml").write_bytes(b"[rod]\nlength = 0.1 # \xff")
    with refused(ParameterError, "rig.toml"):
        Rig.read(tmp_path / "rig.toml")
    with pytest.raises(FileNotFoundError):
        Rig.read(tmp_path / "none.toml")


@pytest.mark.parametrize("name", [*PARAMETERS, *GROUPS, "base", "base_x", "base_2_y"])
def test_of_every_parameter_all_that_can_be_said_is_written(name, tmp_path):
    row = PARAMETERS.get(GROUPS.get(name, (name,))[0])
    number = 0.5 if row is None else float(np.clip(0.5, row.low, row.high))
    for value in (number, "default", stats.norm(number, 0.1)):
        Rig(unknown={name: value}).write(tmp_path / "rig.toml")
        again = Rig.read(tmp_path / "rig.toml").entries
        assert list(again) == [name]
        assert (again[name] == value) if isinstance(value, float | str) else again[name].mean() == number
