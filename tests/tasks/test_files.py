"""Files written whole."""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from helpers.refusals import refused
from tactile_bayes.tasks import alone_in, check_format, files, is_temporary, write_atomically

CHILD = """
import sys, time
from pathlib import Path
from tactile_bayes.tasks import alone_in, write_atomically

with alone_in(Path(sys.argv[1]).parent, RuntimeError), write_atomically(sys.argv[1]) as temporary:
    temporary.write_text("half of the n")
    print(temporary, flush=True)
    time.sleep(600)
"""


def written(path, content="new"):
    with write_atomically(path) as temporary:
        temporary.write_text(content)


def test_the_new_file_appears_only_at_the_end_and_where_a_link_points(tmp_path):
    target, link = tmp_path / "a.txt", tmp_path / "link.txt"
    target.write_text("old")
    link.symlink_to(target)

    def written(error=None):
        with write_atomically(link) as temporary:
            assert temporary.parent.parent == tmp_path.resolve()  # on the same file system
            assert temporary.name == "a.txt"
            temporary.write_text("new")
            assert target.read_text() == "old"
            if error is not None:
                raise error

    with pytest.raises(KeyboardInterrupt):
        written(KeyboardInterrupt())
    assert target.read_text() == "old"
    written()
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert sorted(tmp_path.iterdir()) == [target, link]


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileNotFoundError) as refusal, write_atomically(tmp_path / "nowhere" / "a.txt"):
        pass
    assert refusal.value.filename == str(tmp_path.resolve() / "nowhere")


@pytest.mark.skipif(sys.platform == "win32", reason="there are no locks")
def test_what_a_killed_process_left_is_removed_by_the_next_and_nothing_else(tmp_path):
    """The file stays as long as the process is there; after that, whatever is written next beside it removes it."""
    strangers = [".0123456789abcdef.tmp", ".tactile-bayes-notes.tmp", "a.tmp"]
    for name in strangers:
        (tmp_path / name).mkdir()
        (tmp_path / name / "years of work").write_text("")
    strangers.append(f".tactile-bayes-{files._HOST}-{0:016x}.tmp")
    (tmp_path / strangers[-1]).write_text("a file, no folder")
    command = [sys.executable, "-c", CHILD, str(tmp_path / "a.txt")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        half = Path(process.stdout.readline().strip())
        written(tmp_path / "b.txt")
        assert half.read_text() == "half of the n"
        assert is_temporary(half.parent)
        process.kill()
    assert half.exists()
    with alone_in(tmp_path, RuntimeError):
        written(tmp_path / "b.txt")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*strangers, "b.txt"])
    assert (tmp_path / strangers[0] / "years of work").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="there are no locks")
@pytest.mark.parametrize(("days", "stays"), [(0, True), (2, False)])
def test_what_another_machine_writes_is_left_alone_for_a_day(tmp_path, days, stays):
    """A lock may not reach across machines."""
    folder = tmp_path / f".tactile-bayes-{0:08x}-{1:016x}.tmp"
    folder.mkdir()
    (folder / "a.txt").write_text("half")
    then = time.time() - days * 86400
    os.utime(folder, (then, then))
    written(tmp_path / "b.txt")
    assert folder.exists() == stays


def test_without_locks_nothing_is_removed(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)
    folder = tmp_path / f".tactile-bayes-{files._HOST}-{1:016x}.tmp"
    folder.mkdir()
    written(tmp_path / "b.txt")
    assert sorted(tmp_path.iterdir()) == [folder, tmp_path / "b.txt"]


def test_many_write_into_one_folder_at_once(tmp_path):
    """No thread takes the file of another for a leftover."""
    failures = []

    def write(number):
        try:
            for _ in range(40):
                written(tmp_path / f"{number}.txt", str(number))
        except OSError as error:
            failures.append(error)

    threads = [threading.Thread(target=write, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{number}.txt" for number in range(8)]


@pytest.mark.parametrize(
    ("platform", "times", "is_there"), [("win32", 3, True), ("win32", 99, False), ("linux", 1, False)]
)
def test_a_file_that_another_program_keeps_open_is_replaced_a_little_later_on_windows(
    tmp_path, monkeypatch, platform, times, is_there
):
    refusals, replace = iter(range(times)), os.replace
    target = tmp_path / "a.txt"
    target.write_text("old")

    def kept_open(*paths):
        if next(refusals, None) is None:
            return replace(*paths)
        raise PermissionError(13, "in use by another process", str(paths[0]))

    monkeypatch.setattr(os, "replace", kept_open)
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(time, "sleep", lambda seconds: None)
    if is_there:
        written(target)
    else:
        with pytest.raises(PermissionError) as refusal:
            written(target)
        assert refusal.value.filename == str(target)
    assert target.read_text() == ("new" if is_there else "old")
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("stated", [2, 3.0, np.int64(3), None])
def test_a_format_that_is_read_is_accepted_and_that_of_a_file_without_is_the_first(stated):
    check_format(stated, 3, ValueError, oldest=1 if stated is None else 2)


@pytest.mark.parametrize("stated", [4, 1, 0, -1, 2.5, float("inf"), float("nan"), True, "2", [2], np.ones(1), None])
def test_another_format_is_refused_with_what_is_read(stated):
    with refused(ValueError, "formats 2 to 3"):
        check_format(stated, 3, ValueError, oldest=2)
