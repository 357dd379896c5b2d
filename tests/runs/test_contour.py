"""A run: every file it names, whatever the record holds."""

import re

import numpy as np
import pandas as pd
import pytest

from helpers.contour_posteriors import QUICK, without
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import contact_points
from tactile_bayes.inference.result import read_result
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.rig import Rig
from tactile_bayes.runs import contour as module
from tactile_bayes.runs.contour import RunFolder, analyse, complete
from tactile_bayes.runs.demonstration import CONTOUR, ROD, TRUTH
from tactile_bayes.runs.names import INFERENCE, OF_POSTERIOR
from tactile_bayes.sweep import scan
from tactile_bayes.uncertainty.summary import summary

FIGURES = ("predictive", "rods", "contour", "gap", "trace", "pairs")


def assert_every_file_is_there(run, folder):
    assert {path.name for path in run.files.values()} == {path.name for path in folder.iterdir()}
    for name in set(FIGURES) & set(run.files):
        content = run.files[name].read_bytes()
        assert content.startswith(b"\x89PNG\r\n")
        assert len(content) > 5000


def test_a_run_writes_every_file_it_names(analysed):
    run, folder = analysed
    assert list(run.files) == ["posterior", "contacts", "band", "messages", "summary", *FIGURES]
    assert_every_file_is_there(run, folder)


def test_the_files_hold_what_the_run_returns(analysed, measured):
    run, _ = analysed
    stored = read_result(run.files["posterior"])
    assert stored["posterior"].to_dataset().identical(run.posterior["posterior"].to_dataset())
    assert stored.attrs["message"] == run.posterior.attrs["message"]

    contacts = pd.read_csv(run.files["contacts"], index_col="sample")
    assert len(contacts) == measured.sizes["sample"]
    np.testing.assert_allclose(contacts["contact_x"], run.contacts.contact_x, rtol=1e-13)
    assert contacts["status"].tolist() == run.contacts.status.values.tolist()

    band = pd.read_csv(run.files["band"], index_col="x")
    np.testing.assert_allclose(band["upper"], run.band.upper, rtol=1e-13)
    assert (band["lower"] <= band["median"]).all()
    assert (band["median"] <= band["upper"]).all()

    table = pd.read_csv(run.files["summary"], index_col="quantity")
    assert table.index.tolist() == ["a", "q", "x_c", "noise_scale", "gap width"]
    assert table["unit"].tolist() == ["1/m", "m", "m", "1", "m"]


def test_the_summary_begins_with_the_messages(analysed):
    run, _ = analysed
    lines = run.files["messages"].read_text(encoding="utf-8").splitlines()
    assert tuple(lines[: lines.index("")]) == run.messages
    assert run.messages[0].kind == "not converged"
    assert "30 steps: largest R̂ " in run.messages[0].details["message"]
    table = lines[lines.index("") + 1 : -2]
    assert [line.split()[0] for line in table] == ["median", "quantity", "a", "q", "x_c", "noise_scale", "gap"]
    assert lines[-1] == run.posterior.attrs["message"]


@pytest.mark.parametrize(
    ("error", "factor", "message"),
    [
        (InferenceError("no parabola was found."), 1.0, r"^no parabola was found\.$"),
        (InferenceError("no parabola was found."), 1e3, r"^no parabola was found\. .*EI/L²"),
        (RuntimeError("it broke"), 1.0, "^it broke$"),
    ],
)
def test_without_a_posterior_the_former_run_stays_whole_and_wrong_units_are_suspected(
    measured, tmp_path, monkeypatch, error, factor, message
):
    def infer_nothing(*arguments, **options):
        raise error

    monkeypatch.setattr(module, "infer_contour", infer_nothing)
    (tmp_path / "report.html").write_text("of the posterior beside it", encoding="utf-8")
    record = measured.assign(force_x=factor * measured.force_x, force_y=factor * measured.force_y)
    with pytest.raises(type(error), match=message):
        analyse(record, tmp_path, rng=1)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.usefixtures("undrawn")
def test_one_step_is_a_result_too(measured, tmp_path):
    few = SamplerSettings(ensembles=2, walkers=10, max_steps=1)
    run = analyse(measured, tmp_path, rig=Rig(unknown="nothing"), settings=few, rng=1)
    assert not run.posterior.attrs["converged"]
    assert "1 step: too few" in run.posterior.attrs["message"]


def test_the_estimate_is_near_the_truth(analysed):
    """Not a test of the posterior: that names and units were not mixed up on the way."""
    run, _ = analysed
    table = summary(run.posterior)
    for name in ("a", "q", "noise_scale"):
        assert table["median"].sel(quantity=name) == pytest.approx(TRUTH[name], rel=0.2)
    assert abs(table["median"].sel(quantity="x_c")) < 0.01 * ROD.length
    np.testing.assert_allclose(run.band["median"], CONTOUR.height(run.band.x), atol=0.01 * ROD.length)


@pytest.mark.slow
def test_a_record_of_the_moment_alone_in_one_direction(tmp_path):
    record = scan(Parabola(0.5, 0.5), direction="backward", base=(0.1, 0.0), drive_step=0.05).record
    measured = LoadCell(force_noise=0.05, moment_noise=0.02).measure(record, rng=1)
    measured["force_x"][:] = measured["force_y"][:] = np.nan
    run = analyse(measured, tmp_path, rig=Rig(unknown="nothing"), settings=QUICK, rng=1)
    assert run.contacts is None
    assert list(run.files) == ["posterior", "band", "messages", "summary", *(f for f in FIGURES if f != "gap")]
    assert_every_file_is_there(run, tmp_path)
    assert summary(run.posterior).quantity.values.tolist() == ["a", "q", "x_c", "noise_scale"]


@pytest.mark.slow
def test_a_dimensionless_record_with_unknown_noise(tmp_path):
    contour = Circle(1.0, 0.5)
    record = scan(contour, direction="forward", drive_step=0.05).record
    measured = LoadCell(force_noise=0.05, moment_noise=0.02).measure(record, rng=1)
    for name in ("load_cell_force_noise", "load_cell_moment_noise"):
        del measured.attrs[name]
    run = analyse(measured, tmp_path, family="circle", rig=Rig(unknown="nothing"), settings=QUICK, truth=contour, rng=1)
    assert_every_file_is_there(run, tmp_path)
    table = summary(run.posterior)
    assert table.quantity.values.tolist() == ["r", "q", "x_c", "moment_noise", "force_noise"]
    assert set(table.unit.values) == {"1"}
    assert table["median"].sel(quantity="q") == pytest.approx(0.5, abs=0.05)
    assert not any("noise" in str(name) for name in run.posterior.attrs)
    # The noise that was found tells unloaded samples from contacts, and weighs the channels.
    loaded = record.truth_contact_phase.values != "none"
    assert np.count_nonzero((run.contacts.status.values == "no contact") & ~loaded) >= np.count_nonzero(~loaded) - 1
    assert run.contacts.contact_arclength.max() <= 1.0
    assert run.contacts.attrs["misfit_probability"] > 1e-4


@pytest.mark.usefixtures("undrawn")
def test_a_run_that_writes_less_leaves_nothing_of_the_former_one(analysed, measured, tmp_path):
    """Neither contacts, if a channel is missing, nor figures, nor what belongs to the former posterior."""
    run, _ = analysed
    former = [*INFERENCE, *OF_POSTERIOR]
    (tmp_path / "trust").mkdir()
    for name in (*former, "notes.txt", "comparison.nc"):
        (tmp_path / name).write_text("former", encoding="utf-8")
    folder = RunFolder(tmp_path)
    folder.write_posterior(run.posterior)  # which removes all that belongs to another one at once
    assert {path.name for path in tmp_path.iterdir()} == {"posterior.nc", "notes.txt", "comparison.nc", "trust"}
    complete(folder, without(measured, "force_x"), Rig(), run.posterior, 0.95)
    left = {path.name for path in tmp_path.rglob("*")} - {"notes.txt", "comparison.nc", "trust"}
    assert left == {"summary.txt", "posterior.nc", "band.csv", "summary.csv"}
    assert all((tmp_path / name).read_bytes() != b"former" for name in left)


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_another_rod_is_that_of_all_results(measured, tmp_path):
    wrong = measured.assign_attrs(rod_length=0.21, rod_diameter=0.0)
    run = analyse(wrong, tmp_path, rig=Rig(ROD, unknown="nothing"), rng=1)
    assert run.posterior.attrs["rod_length"] == ROD.length
    expected = contact_points(measured, run.posterior, None)
    np.testing.assert_array_equal(run.contacts.contact_x, expected.contact_x)


@pytest.fixture
def drawn_before(analysed, monkeypatch):
    """Runs that are given the posterior of another."""
    posterior = analysed[0].posterior

    def infer(measured, *, keep, **options):
        keep(posterior.copy(deep=True))
        return posterior.copy(deep=True)

    monkeypatch.setattr(module, "infer_contour", infer)


def broken(*arguments, **options):
    raise RuntimeError("it broke")


@pytest.mark.parametrize(
    ("function", "what", "file"),
    [
        pytest.param("contact_points", "contacts", "contacts.csv", marks=pytest.mark.slow),
        pytest.param("contour_band", "band", "band.csv", marks=pytest.mark.slow),
        pytest.param("gap_if_any", "gap", None, marks=pytest.mark.slow),
        ("check", "check", None),
    ],
)
@pytest.mark.usefixtures("drawn_before", "undrawn")
def test_what_fails_is_named_and_left_out_and_all_else_is_there(function, what, file, measured, tmp_path, monkeypatch):
    whole = analyse(measured, tmp_path, rng=1)
    monkeypatch.setattr(module, function, broken)
    run = analyse(measured, tmp_path, rng=1)
    assert list(run.left_out) == [what]
    assert str(run.left_out[what]) == "it broke"
    *others, said = run.messages
    assert others == ([] if what == "check" else list(whole.messages))
    assert re.fullmatch(f"Left out: {what}.*RuntimeError: it broke", said)
    lines = run.files["messages"].read_text(encoding="utf-8").splitlines()
    assert tuple(lines[: lines.index("")]) == run.messages
    assert list(run.files) == [name for name in whole.files if name != what or what == "check"]
    assert_every_file_is_there(run, tmp_path)  # of the former run, too, nothing is there that is not of this one
    assert read_result(run.files["posterior"])["posterior"].to_dataset().equals(run.posterior["posterior"].to_dataset())
    gap_row = "gap width" in run.summary.quantity
    assert gap_row == (what != "gap")
    if file is not None:
        assert (run.contacts if what == "contacts" else run.band) is None


@pytest.mark.slow
@pytest.mark.usefixtures("drawn_before", "coarse_pictures")
def test_a_figure_that_fails_is_named_and_the_others_are_drawn(measured, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "scan", broken)
    monkeypatch.setattr(module, "predictive_interval", broken)
    run = analyse(measured, tmp_path, rng=1)
    failed = ("predictive", "rods")
    assert list(run.left_out) == [f"figure {name}" for name in failed]
    assert list(run.files)[5:] == [name for name in FIGURES if name not in failed]
    assert_every_file_is_there(run, tmp_path)
    text = run.files["messages"].read_text(encoding="utf-8")
    assert all(re.search(f"\nLeft out: figure {name}.*RuntimeError: it broke\n", text) for name in failed)


def test_an_interrupt_after_sampling_leaves_out_one_part_alone_and_figures_are_drawn_if_asked_for(
    measured, tmp_path, monkeypatch
):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "contour_band", interrupted)
    (tmp_path / "contour.png").write_bytes(b"of a former run")
    seen = []
    options = {"rig": Rig(unknown="nothing"), "settings": QUICK, "figures": False, "rng": 1}
    run = analyse(measured, tmp_path, follow=seen.append, **options)
    assert list(run.left_out) == ["band"]
    assert seen[0].startswith("contact points")
    assert_every_file_is_there(run, tmp_path)
    assert not set(FIGURES) & set(run.files)


@pytest.mark.usefixtures("undrawn")
def test_a_posterior_outlives_its_predictions(measured, tmp_path, monkeypatch):
    """Its draws and what is made of them alone are there; all else says what it lacks."""
    monkeypatch.setattr("tactile_bayes.inference.contour.predicted_groups", broken)
    run = analyse(measured, tmp_path, rig=Rig(unknown="nothing"), settings=QUICK, rng=1)
    assert list(run.left_out) == ["predictions", "band", "gap", "check"]
    assert re.fullmatch("Left out: predictions.*: it broke", run.messages[0])
    assert re.match("Left out: band.* no events", run.messages[1])
    assert list(run.files) == ["posterior", "contacts", "messages", "summary"]
    assert_every_file_is_there(run, tmp_path)
    stored = read_result(run.files["posterior"])
    assert stored["posterior"].sizes["draw"] == 300
    assert stored.attrs["probability"] == 0.95
    assert run.summary.quantity.values.tolist() == ["a", "q", "x_c", "noise_scale"]
