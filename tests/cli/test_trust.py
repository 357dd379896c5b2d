"""The command trust, and what the report says of it."""

import pytest

from helpers import commands
from helpers.contour_posteriors import posterior
from helpers.report_pages import Page
from tactile_bayes.inference.result import write_result
from tactile_bayes.runs.names import OF_POSTERIOR


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
