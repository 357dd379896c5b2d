"""The results store of a calibration: what is written is read, and nothing else is."""

import json
import math

import pytest

from helpers.refusals import refused
from tactile_bayes.calibration.replicate import REPLICATES, Outcome
from tactile_bayes.errors import CalibrationError
from tactile_bayes.tasks import ResultsStore, open_results_store

LEDGER = REPLICATES.file

WORDS = {"family": "parabola", "seed": "1", "friction": "0.0", "load_cell": '{"force_noise": 0.05}'}

ROWS = {
    3: Outcome({"a": 0, "q": 99}, {"seconds": 0.1 + 0.2, "width_in_gap": math.nan, "share": 1.0}, "converged: R̂ 1.01"),
    0: Outcome({}, {"seconds": 1e-300}, 'InferenceError: "nothing"\nfits', 'File "a.py", line 1\n  in f\n'),
    11: Outcome({"a": 50}, {}, ""),
}


def filled(folder, words=WORDS):
    with open_results_store(words, folder, REPLICATES) as store:
        store.outcomes.update(ROWS)
    return folder / LEDGER


def left_alone(folder, *named, words=WORDS):
    """It is refused, and nothing in the folder has changed."""
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with refused(CalibrationError, *named), open_results_store(words, folder, REPLICATES):
        raise AssertionError("the block began")
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_what_is_written_is_read(tmp_path):
    file = filled(tmp_path / "made" / "on the way")
    assert [path.name for path in file.parent.iterdir()] == [LEDGER]
    with open_results_store(WORDS, file.parent, REPLICATES) as store:
        assert repr(store.outcomes) == repr(dict(sorted(ROWS.items())))  # NaN and all
    written = file.read_bytes()
    filled(file.parent)
    assert file.read_bytes() == written
    with open_results_store(WORDS, file.parent, REPLICATES) as store:
        store.outcomes[4] = Outcome({"a": 7}, {}, "new")
    assert list(ResultsStore(WORDS, file.parent, REPLICATES).outcomes) == [0, 3, 4, 11]


def test_the_file_is_plain_json(tmp_path):
    """Without the NaN that the standard does not know; older ones have no tracebacks, and what was lost there is."""
    file = filled(tmp_path)
    table = json.loads(file.read_text(encoding="utf-8"), parse_constant=pytest.fail)
    assert table["experiment"] == WORDS
    assert [row["number"] for row in table["replicates"]] == [0, 3, 11]
    assert table["replicates"][1]["numbers"]["width_in_gap"] is None
    assert [row.pop("traceback", None) is not None for row in table["replicates"]] == [True, False, False]
    file.write_text(json.dumps(table), encoding="utf-8")
    outcomes = ResultsStore(WORDS, tmp_path, REPLICATES).outcomes
    assert repr(outcomes) == repr({number: ROWS[number]._replace(traceback="") for number in (0, 3, 11)})
    assert [outcomes[number].is_lost for number in (0, 3, 11)] == [True, False, False]


def test_without_a_folder_it_is_kept_in_memory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with open_results_store(WORDS, None, REPLICATES) as store:
        store.outcomes.update(ROWS)
        store.write()
    assert store.outcomes == ROWS
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_what_is_done_is_written_however_the_block_ends(tmp_path, error):
    block = open_results_store(WORDS, tmp_path, REPLICATES)
    block.__enter__().outcomes.update(ROWS)
    assert not block.__exit__(error, error(), None)  # which is not swallowed
    assert len(ResultsStore(WORDS, tmp_path, REPLICATES).outcomes) == len(ROWS)


def test_one_run_at_a_time(tmp_path):
    pytest.importorskip("fcntl")
    with open_results_store(WORDS, tmp_path, REPLICATES), refused(CalibrationError, "another run", tmp_path):
        open_results_store(WORDS, tmp_path, REPLICATES).__enter__()
    filled(tmp_path)


def test_another_experiment_is_refused(tmp_path):
    filled(tmp_path)
    for words, named in (
        ({"seed": "2"}, ["seed is 1 there and 2 here"]),
        ({"seed": "2", "friction": "0.3"}, ["seed is 1 there and 2 here", "friction is 0.0 there and 0.3 here"]),
        ({"events": "True"}, ["events", "left out there", "True here"]),
        (dict.fromkeys(WORDS, "x"), ["friction is 0.0 there and x here", "1 more"]),
        ({"load_cell": 99 * "7"}, ["load_cell", f"{57 * '7'}…"]),
    ):
        left_alone(tmp_path, *named, LEDGER, words=WORDS | words)
    left_alone(tmp_path, "seed", "left out here", words={n: w for n, w in WORDS.items() if n != "seed"})


def test_of_another_experiment_without_replicates_nothing_is_lost(tmp_path):
    with open_results_store(WORDS | {"seed": "2"}, tmp_path, REPLICATES):
        pass
    filled(tmp_path)
    assert ResultsStore(WORDS, tmp_path, REPLICATES).outcomes


def row(**changes):
    """A file of one row that has something else in one place."""
    whole = {"number": 0, "ranks": {}, "numbers": {}, "message": ""} | changes
    return json.dumps({"format": 1, "experiment": {}, "replicates": [whole]}).encode()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b'{"format": 1, "experiment": {"family": "par',
        b"\x89HDF\r\n\xff\xfe",
        b"null",
        b"[]",
        b"{}",
        b'{"format": 1, "experiment": {}}',
        b'{"format": 1, "experiment": {}, "replicates": 5}',
        b'{"format": 1, "experiment": 5, "replicates": []}',
        b'{"format": 1, "experiment": {}, "replicates": [{}]}',
        row(ranks={"a": None}),
        row(ranks=[1]),
        row(numbers={"seconds": "long"}),
    ],
)
def test_garbage_is_refused_with_path_and_correction(tmp_path, content):
    (tmp_path / LEDGER).write_bytes(content)
    left_alone(tmp_path, tmp_path / LEDGER, "read")


def test_another_format_and_a_file_in_place_of_the_folder_are_refused(tmp_path):
    file = filled(tmp_path)
    file.write_text(file.read_text(encoding="utf-8").replace('"format": 1', '"format": 2'), encoding="utf-8")
    left_alone(tmp_path, file, "format 2", 1)
    with refused(CalibrationError, file):
        open_results_store(WORDS, file, REPLICATES).__enter__()
