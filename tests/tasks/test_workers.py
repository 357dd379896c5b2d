"""Tasks in this process, in others, and what becomes of them when processes die."""

import multiprocessing
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.refusals import refused
from helpers.tasks import alive, die, die_once, double, fail, fail_strangely, note_and_sleep, wait_until
from tactile_bayes.checks import shown
from tactile_bayes.errors import ParameterError, TaskError
from tactile_bayes.tasks import run_tasks
from tactile_bayes.tasks import workers as tasks

TESTS = Path(__file__).resolve().parents[1]
on_linux = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks processes up in /proc")


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_every_task_is_done_once(workers):
    tasks = list(range(7))
    assert sorted(run_tasks(double, tasks, workers=workers)) == [(task, 2 * task) for task in tasks]
    assert list(run_tasks(double, [], workers=workers)) == []


@pytest.mark.parametrize("workers", [1, 2])
def test_what_a_task_raises_is_raised(workers):
    with pytest.raises(ValueError, match="no 3 here") as caught:
        list(run_tasks(fail, list(range(5)), workers=workers))
    if workers == 2:
        assert "in fail" in "".join(caught.value.__notes__)  # where it happened there


def test_what_cannot_travel_is_told_in_words():
    with refused(TaskError, "StrangeError", "strange 1"):
        list(run_tasks(fail_strangely, [1, 1], workers=2))


@on_linux
def test_the_task_of_a_killed_process_is_done_again_unless_it_always_kills(tmp_path):
    tasks = [(str(tmp_path), number) for number in range(6)]
    assert sorted(result for _, result in run_tasks(die_once, tasks, workers=2)) == list(range(6))
    assert (tmp_path / "died").exists()
    with refused(TaskError, "4 times", "task 1"):
        list(run_tasks(die, [0, 1], workers=2))


def test_processes_end_when_the_results_are_wanted_no_more(tmp_path):
    results = run_tasks(note_and_sleep, [(str(tmp_path), 0.0), *[(str(tmp_path), 60.0)] * 2], workers=2)
    next(results)
    team = multiprocessing.active_children()
    assert len(team) == 2
    results.close()
    assert not multiprocessing.active_children()


SLEEPING = """
import sys
from tactile_bayes.tasks import run_tasks
from helpers.tasks import note_and_sleep
print("now", flush=True)
list(run_tasks(note_and_sleep, [(sys.argv[1], 60.0)] * 2, workers=2))
"""


def group_lives(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@on_linux
@pytest.mark.parametrize(
    "end",
    [
        "killed",
        pytest.param("interrupted", marks=pytest.mark.slow),
        pytest.param("interrupted as it begins", marks=pytest.mark.slow),
    ],
)
def test_processes_end_with_their_parent(tmp_path, end):
    """From a terminal the whole group hears an interrupt; the processes for the work keep silent."""
    command = [sys.executable, "-c", SLEEPING, str(tmp_path)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    parent = subprocess.Popen(command, cwd=TESTS, start_new_session=True, **pipes)
    parent.stdout.readline()
    if end == "interrupted as it begins":
        wait_until(lambda: Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().count(" ") >= 2)
    else:
        wait_until(lambda: len(list(tmp_path.iterdir())) == 2)
    if end == "killed":
        parent.kill()
    else:
        os.killpg(parent.pid, signal.SIGINT)
    _, words = parent.communicate(timeout=10.0)
    wait_until(lambda: not any(alive(path.name) for path in tmp_path.iterdir()), seconds=5.0)
    if end != "killed":
        assert words.count("Traceback") == 1, words
        assert words.rstrip().endswith("KeyboardInterrupt")
        wait_until(lambda: not group_lives(parent.pid), seconds=5.0)


@pytest.mark.parametrize("workers", [0, -1, 1.5, "2", True, "nonsense", "foo://1", "tcp://x:y", "http://a:8786", ""])
def test_what_is_no_number_or_address_is_refused_at_once(workers, monkeypatch):
    """Before there is a client, whose destructor would fail."""
    monkeypatch.setattr(pytest.importorskip("distributed"), "Client", None)
    with refused(ParameterError, "tcp:" if isinstance(workers, str) else "workers", shown(workers)):
        list(run_tasks(double, [1, 2], workers=workers))


def test_a_scheduler_without_dask_is_told_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with refused(ParameterError, "Dask", "'tactile-bayes[cluster]'"):
        list(run_tasks(double, [1, 2], workers="tcp://127.0.0.1:1"))


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "127.0.0.1:1"])
def test_a_scheduler_that_does_not_answer_is_waited_for_no_longer_than_it_takes(address, monkeypatch):
    pytest.importorskip("distributed")
    assert tasks._PATIENCE == "10s"
    monkeypatch.setattr(tasks, "_PATIENCE", "0.2s")
    with refused(ParameterError, f"'{address}'"):
        list(run_tasks(double, [1, 2], workers=address))


def test_a_script_without_guard_is_told_so(tmp_path):
    path = tmp_path / "unguarded.py"
    path.write_text("from tactile_bayes.tasks import run_tasks\nprint(list(run_tasks(abs, [1, 2], workers=2)))\n")
    done = subprocess.run([sys.executable, path], cwd=TESTS, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    for part in ("TaskError: ", "before it began", "if __name__ == '__main__'"):
        assert part in done.stderr.splitlines()[-1]
