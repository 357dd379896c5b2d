"""The challenge: its scores on answers made by hand, its data made again, and what is no answer."""

import csv
import json
import subprocess
import sys
import tarfile
from hashlib import sha256
from itertools import islice

import numpy as np
import pytest
from benchmarks.challenge import entries, generate
from benchmarks.challenge.score import (
    HERE,
    RECORDS,
    SWEEPS,
    TRUTH,
    AnswerError,
    interval_score,
    main,
    score,
    score_sweeps,
    table,
)
from benchmarks.whisker_sweeps import MEASURED
from scipy import stats

# A rod of 2 m touches two grid points on either side of a gap of two.
TRUE = {"stratum": "flat", "length": 2.0, "first": -2, "height": [0.8, 0.8, 0.8, 0.8, 0.8, 0.8], "touched": "110011"}
HEAD = "x,lower,middle,upper"


@pytest.fixture(scope="module")
def truth():
    return json.loads((HERE / TRUTH).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """The folder of the records, and their rows in the list of objects."""
    out = tmp_path_factory.mktemp("challenge")
    with tarfile.open(HERE / RECORDS) as archive:
        archive.extractall(out, filter="data")
    with open(out / "records" / "objects.csv", encoding="utf-8", newline="") as file:
        return out / "records", [*csv.DictReader(file)]


def rows_of(folder, *lines, truth=None):
    (folder / "000.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return {row[1]: row[2:] for row in score(folder, truth or {"000": TRUE})}


def test_the_interval_score_is_width_and_twenty_times_what_is_missed():
    assert interval_score(np.array([1.0, 0.5, 2.5]), 1.0, 2.0) == pytest.approx([1.0, 11.0, 11.0])


def test_its_mean_is_least_for_the_quantiles_and_that_of_the_closed_form():
    """For a standard normal distribution, the central interval of 1 − α has the expected score (4/α) φ(z)."""
    y = stats.norm.ppf((np.arange(200_000) + 0.5) / 200_000)
    z = stats.norm.ppf(0.95)
    means = [interval_score(y, -end, end).mean() for end in (0.9 * z, z, 1.1 * z)]
    assert means[1] == pytest.approx(40.0 * stats.norm.pdf(z), rel=1e-4)
    assert means[1] < min(means[0], means[2])


def test_scores_of_an_answer_by_hand(tmp_path):
    """The gap holds at one of two points, by 0.1 m missed at the other; of four touched points two are answered."""
    lines = ["-0.04,,,", "-0.02,0.7,0.8,0.9", "0.00,0.7,0.8,0.9", "0.02,0.9,1.0,1.1", "0.04,0.6,0.7,0.8"]
    found = rows_of(tmp_path, "# seconds: 3", HEAD, *lines)
    assert found["gap"] == pytest.approx((1.0, 0.05, 0.5, 0.1 + 0.5 * 20.0 * 0.05, 3.0))
    # Left out, a point has the middle 0.5 and the width 1 of the rod: 0.1 off, and inside.
    assert found["touched"] == pytest.approx((0.5, (0.0 + 0.05 + 0.1 + 0.1) / 4, 1.0, (0.1 + 0.1 + 1.0 + 1.0) / 4, 3.0))


def test_a_record_without_an_answer_is_vacuous(tmp_path):
    rows_of(tmp_path, HEAD)
    found = score(tmp_path, {"000": TRUE, "001": TRUE})
    assert [row[2] for row in found] == [0.0] * 4
    assert [row[5] for row in found] == pytest.approx([1.0] * 4)
    assert table(found).count("\n") == 5


@pytest.mark.parametrize(
    ("lines", "line"),
    [
        ([], None),
        (["x,lower,upper"], 1),
        ([HEAD, "0.0,0.1,0.2"], 2),
        ([HEAD, "0.0,0.1,0.2,0.3", "0.02,0.1,nan,0.3"], 3),
        (["# seconds: soon", HEAD], 1),
        (["# seconds: 3", HEAD, "0.0,0.3,0.2,0.1"], 3),
        ([HEAD, "0.0,0.1,,0.3"], 2),
        ([HEAD, "0.0,0.1,0.2,0.3", "0.0,0.1,0.2,0.3"], 3),
        ([HEAD, "0.0,0.1,0.2,0.3", "0.00,0.1,0.2,0.3"], None),
        ([HEAD, "0.013,0.1,0.2,0.3"], None),
    ],
)
def test_what_is_no_answer_is_refused_with_its_place(tmp_path, lines, line):
    with pytest.raises(AnswerError) as error:
        rows_of(tmp_path, *lines)
    assert str(tmp_path / "000.csv") in str(error.value)
    assert line is None or f"line {line}" in str(error.value)


def test_common_records_alone_are_scored(tmp_path, truth, capsys):
    for folder, numbers in (("a", ("000", "001")), ("b", ("001",))):
        (tmp_path / folder).mkdir()
        for number in numbers:
            (tmp_path / folder / f"{number}.csv").write_text(f"{HEAD}\n", encoding="utf-8")
    assert main(["--common", *(str(tmp_path / folder) for folder in "ab")]) == 0
    strata = {line.split(" | ")[0].strip("| ") for line in capsys.readouterr().out.splitlines() if " touched " in line}
    assert strata == {truth["001"]["stratum"], "all"}


def test_answers_to_nothing_are_refused(tmp_path, capsys):
    assert main([str(tmp_path / "none")]) == 1
    (tmp_path / "999.csv").write_text(f"{HEAD}\n", encoding="utf-8")
    with pytest.raises(AnswerError):
        score(tmp_path, {"000": TRUE})
    assert "none" in capsys.readouterr().err


def test_radii_of_real_objects_are_scored(tmp_path):
    known = [{"sweep": "a", "radius_m": "0.015"}, {"sweep": "b", "radius_m": ""}]
    path = tmp_path / SWEEPS
    path.write_text("sweep,lower,middle,upper\na,0.016,0.017,0.018\n", encoding="utf-8")
    assert [float(word) for word in score_sweeps(path, known).split() if word[-1].isdigit()] == [1, 2.0, 0, 22.0]
    path.write_text("sweep,lower,middle,upper\nb,0.016,0.017,0.018\n", encoding="utf-8")
    with pytest.raises(AnswerError):
        score_sweeps(path, known)


def test_it_scores_with_numpy_alone(tmp_path, truth):
    true = truth["000"]
    x = (true["first"] + np.arange(len(true["height"]))) * 0.01 * true["length"]
    lines = [f"{at:.6g},{y - 1e-3:.7g},{y:.7g},{y + 1e-3:.7g}" for at, y in zip(x, true["height"], strict=True)]
    (tmp_path / "000.csv").write_text("\n".join([HEAD, *lines]), encoding="utf-8")
    code = (
        "import runpy, sys; sys.modules.update(dict.fromkeys(('tactile_bayes', 'scipy', 'xarray')));"
        f"sys.argv = ['score.py', {str(tmp_path)!r}]; runpy.run_path({str(HERE / 'score.py')!r}, run_name='__main__')"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert said.returncode == 0, said.stderr
    assert said.stdout.count("100 %") == 2 * (1 + ("0" in true["touched"]))


def test_the_metadata_has_the_sums_of_the_files_and_the_version():
    metadata = json.loads((HERE / "metadata.json").read_text(encoding="utf-8"))
    sums = {name: sha256((HERE / name).read_bytes()).hexdigest() for name in metadata["files"]}
    assert sums == {name: stated["sha256"] for name, stated in metadata["files"].items()}
    assert {*sums} == {RECORDS, TRUTH}
    assert {n: metadata[n] for n in generate.DESIGN["metadata"]} == generate.DESIGN["metadata"]
    assert metadata["version"] == generate.DESIGN["version"]


def test_every_record_has_its_files_and_its_truth(records, truth):
    folder, rows = records
    assert [row["record"] for row in rows] == [*truth] == [f"{k:03}" for k in range(len(truth))]
    wanted = {stratum["name"]: stratum["records"] for stratum in generate.DESIGN["strata"]}
    strata = [true["stratum"] for true in truth.values()]
    assert {name: strata.count(name) for name in strata} == wanted
    for row in rows:
        true = truth[row["record"]]
        assert (row["object"], float(row["length_m"])) == (true["object"], true["length"])
        names = {"record.csv", "rig.toml"} | ({"shape.csv"} if true["stratum"] == "traced" else set())
        assert {path.name for path in (folder / row["record"]).iterdir()} == names


@pytest.mark.parametrize("stratum", ["usual", "carried", "traced", pytest.param("", marks=pytest.mark.slow)])
def test_records_are_made_again(records, truth, stratum):
    """The first of a stratum, or all: the same bytes and the same truth."""
    for number, files, true in islice(generate.records(stratum), 1 if stratum else None):
        assert true == truth[number]
        for name, content in files.items():
            there = (records[0] / number / name).read_bytes()
            assert sha256(content).hexdigest() == sha256(there).hexdigest(), (number, name)


@pytest.mark.parametrize("method", ["raw", "laplace", pytest.param("infer", marks=pytest.mark.slow)])
def test_our_answers_are_answers(records, truth, tmp_path, method):
    """On a record of the usual rig, of which they hold at some points; a posterior does at most."""
    number = min(number for number, true in truth.items() if true["stratum"] == "usual")
    row = records[1][int(number)]
    found = rows_of(
        tmp_path, *entries.answer(records[0] / number, row, method).splitlines(), truth={"000": truth[number]}
    )
    answered, error, coverage, _, seconds = found["touched"]
    assert answered > (0.5 if method == "raw" else 0.99)
    assert error < 0.1
    assert coverage > (0.05 if method == "raw" else 0.3)
    assert seconds > 0.0


@pytest.mark.skipif(not MEASURED.is_dir(), reason=f"the measured whisker is not here: no folder {MEASURED}")
def test_real_sweeps_are_those_of_the_list():
    with open(HERE / SWEEPS, encoding="utf-8", newline="") as file:
        sums = {row["sweep"]: row["sha256"] for row in csv.DictReader(file)}
    there = {path.relative_to(MEASURED).with_suffix("").as_posix(): path for path in MEASURED.rglob("*.csv")}
    assert {name: sha256(path.read_bytes()).hexdigest() for name, path in there.items()} == sums
