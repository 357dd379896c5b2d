"""The command `infer` of several records."""

from unittest import mock

import pytest

from helpers.commands import answered, assert_misused, call, succeed
from tactile_bayes.runs import many


@pytest.fixture
def quick(monkeypatch):
    """Records are not analysed, but have a row; in this process, so that it is seen."""
    monkeypatch.setattr(many, "run_tasks", lambda function, tasks, **_: ((task, function(task)) for task in tasks))
    row = {"error": "", "seconds": 2.0, "verdict": "All is well.", "quantities": {"q": [0.5, 0.49, 0.51]}}
    with mock.patch.object(many, "_analysed", return_value=row) as analysed:
        yield analysed


def test_each_has_a_row_and_one_table(quick, record, as_stated, tmp_path):
    other = tmp_path / "b" / record.name
    other.parent.mkdir()
    other.write_bytes(record.read_bytes())
    names = [f"{record.parent.name}-record", "b-record"]  # the same but for the folder
    options = ("--rig", as_stated, "--force-noise", 0.04, "--max-seconds", 3, "--out", tmp_path / "runs")
    result = succeed("infer", record, other, *options)
    assert [line.split()[0] for line in result.stdout.splitlines()[1:3]] == names
    assert "0.500" in result.stdout
    assert (tmp_path / "runs" / "runs.csv").is_file()
    tasks = [one.args[0] for one in quick.call_args_list]
    assert [task.out.name for task in tasks] == names
    assert tasks[0].rig.load_cell.force_noise == 0.04
    assert tasks[0].settings.max_seconds == 3.0


def test_a_folder_is_all_records_in_it_and_programs_get_the_table(quick, record, tmp_path):
    folder = tmp_path / "day"
    folder.mkdir()
    (folder / "one.csv").write_bytes(record.read_bytes())
    assert answered("infer", folder, "--out", tmp_path / "runs")["records"]["verdict"]["data"] == ["All is well."]
    assert_misused(call("infer", folder, "--checkpoint", tmp_path / "steps", "--out", tmp_path / "x"), "for one record")
