"""The commands `compare` and `trust`: what they print, write and refuse, and what the report says of it."""

import pandas as pd
import pytest
import xarray as xr

from helpers import commands
from helpers.commands import call
from helpers.comparisons import NAMES, made_up
from helpers.contour_posteriors import posterior
from helpers.report_pages import Page
from tactile_bayes.inference.ensembles import Progress
from tactile_bayes.inference.result import write_result
from tactile_bayes.record.netcdf import RESULT_FORMAT
from tactile_bayes.runs import verdicts as comparison_run
from tactile_bayes.runs.names import OF_POSTERIOR

pytestmark = pytest.mark.usefixtures("coarse_pictures")

FILES = {"comparison.nc", "comparison.csv", "families.png"}


@pytest.fixture(scope="module")
def compared(record, as_stated, tmp_path_factory, coarse_pictures):
    folder = tmp_path_factory.mktemp("compared") / "made" / "on the way"
    two = ["--family", "parabola", "--family", "circle", "--rig", as_stated]
    options = [*two, "--no-leave-one-out", "--max-seconds", 0.5, "--quiet"]
    return call("compare", record, "--out", folder, *options), folder


@pytest.fixture
def instead(monkeypatch):
    """Have a comparison made up in place of one that is computed."""

    def put(comparison, *, before=lambda progress: None):
        def compare_families(measured, *, progress, **options):
            before(progress)
            return comparison

        monkeypatch.setattr(comparison_run, "compare_families", compare_families)

    return put


def rows(output):
    """Cells of the table by family."""
    table = output.split("\n\n")[1].splitlines()
    return {line.split()[0]: line.split()[1:] for line in table if line.split()[0] in NAMES}


def test_the_verdict_comes_first_then_the_table_then_the_files(compared):
    result, folder = compared
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    assert result.stdout.splitlines()[0].startswith("parabola with probability above 0.999")
    assert set(rows(result.stdout)) == {"parabola", "circle"}
    assert rows(result.stdout)["circle"][-1] == "no"
    assert "not sampled: circle" in result.stdout
    assert "elpd" not in result.stdout
    commands.assert_files(result, folder, FILES)
    stored = xr.load_dataset(folder / "comparison.nc", engine="h5netcdf")
    assert stored.attrs["verdict"] == result.stdout.splitlines()[0]
    assert stored.fits.dtype == bool
    table = pd.read_csv(folder / "comparison.csv", index_col="family")
    assert table.index.tolist() == ["parabola", "circle"]
    assert table["fits"].tolist() == [1, 0]
    assert all(kind.kind in "if" for kind in table.dtypes)
    for width, column in ((0.5, "probability_half_width"), (1.0, "probability"), (2.0, "probability_twice_width")):
        assert table[column].tolist() == stored.probability_by_width.sel(prior_width=width).values.tolist()


@pytest.mark.parametrize(
    "comparison",
    [made_up([0.2, 0.8], elpd=[-1.0, 0.0]), made_up([0.0, 1.0], sampled=[False, True]), made_up([float("nan")] * 3)],
    ids=["all", "one given up", "no probabilities"],
)
def test_what_is_written_is_read_back(comparison, tmp_path):
    files = comparison_run.write_comparison(comparison, tmp_path)
    assert xr.load_dataset(files["comparison"], engine="h5netcdf").identical(comparison.assign_attrs(RESULT_FORMAT))
    assert {path.name for path in tmp_path.iterdir()} == FILES


def test_the_table_says_how_samples_are_predicted(instead, record, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    flags = {"sampled": [False, True, True], "fits": [False, True, False]}
    instead(made_up([0.0, 0.9997, 0.0003], **flags, elpd=[0.0, 0.0, -9.0], k=0.9))
    result = call("compare", record, "--out", tmp_path)
    assert "elpd diff.  weight  check p  fits" in result.stdout
    found = {name: " ".join(cells) for name, cells in rows(result.stdout).items()}
    assert found == {
        "parabola": "0 – – 0 – no",
        "circle": ">0.999 -100.0 0 1 0.400 yes",
        "ellipse": "<0.001 -108.1 -9.0 ± 3.0 0 0.001 no",
    }
    assert "(Pareto k̂ above 0.7) for circle, ellipse\n" in result.stdout
    instead(made_up([0.4, 0.6], fits=False))
    assert call("compare", record, "--out", tmp_path).stdout.startswith("None fits: ")


def test_progress_names_the_family(instead, record, tmp_path, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # which rich takes for a terminal
    state = Progress(steps=50, max_steps=100, r_hat=1.02, ess=300.0, seconds=1.0)
    instead(made_up([0.4, 0.6]), before=lambda progress: progress("circle", state))
    result = call("compare", record, "--out", tmp_path)
    assert "circle, step 50: R̂ 1.020, effective draws 300" in result.stderr
    assert "effective draws" not in result.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trust") / "run"
    folder.mkdir()
    write_result(posterior(), folder / "posterior.nc")
    return folder


@pytest.fixture(scope="module")
def written(folder):
    return commands.answered("trust", folder, "--replicates", 1, "--no-assumptions", "--workers", 1)


def test_it_prints_one_object_and_writes_into_the_run(folder, written):
    assert written["conclusion"] == "holds"
    assert "0.95 holds" in written["words"][0]
    assert written["parts"][0]["part"] == "sweep 1"
    assert {claim["claim"] for claim in written["claims"]} >= {"pointwise_in_gap", "contact_region"}
    assert written["files"] == {"trust": str(folder / "trust.nc"), "words": str(folder / "trust.txt")}
    assert (folder / "trust.txt").read_text(encoding="utf-8").splitlines()[0] == written["words"][0]
    names = {name for name in OF_POSTERIOR if (folder / name).exists()}
    assert names == {"trust.nc", "trust.txt", "trust/replicates.json"}


@pytest.mark.usefixtures("written")
def test_the_report_states_it(folder):
    assert commands.call("report", folder).exit_code == 0
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    assert any("band hold" in words for words in page.texts["h3"])
    assert (folder / "trust.txt").read_text(encoding="utf-8").splitlines()[0] in page.texts["p"]
    assert any(caption.startswith("Prediction of the rest") for caption in page.texts["caption"])


@pytest.mark.usefixtures("written")
def test_the_report_refuses_that_of_another_posterior(folder, tmp_path):
    tree = posterior().copy()
    tree["posterior"] = tree["posterior"].to_dataset() * 1.0000001
    write_result(tree, tmp_path / "posterior.nc")
    (tmp_path / "trust.nc").write_bytes((folder / "trust.nc").read_bytes())
    commands.assert_refused(commands.call("report", tmp_path), "another posterior")
