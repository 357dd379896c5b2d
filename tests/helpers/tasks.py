"""Tasks for `run_tasks` to send to other processes: module-level functions, of plain arguments."""

import os
import signal
import time
from multiprocessing import Pipe
from pathlib import Path


def double(number):
    return 2 * number


def fail(number):
    if number == 3:
        raise ValueError(f"no {number} here")
    return number


class StrangeError(Exception):
    """Cannot be made again from its arguments: its class wants two."""

    def __init__(self, one, two):
        super().__init__(f"{one} {two}")


def fail_strangely(number):
    raise StrangeError("strange", number)


def die_once(task):
    """Of (folder, number): is killed over number 2 the first time."""
    folder, number = task
    if number == 2:
        try:
            (Path(folder) / "died").touch(exist_ok=False)
        except FileExistsError:
            return number
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def die(number):
    if number == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def note_and_sleep(task):
    """Of (folder, seconds): writes down which process it is."""
    folder, seconds = task
    (Path(folder) / str(os.getpid())).touch()
    time.sleep(seconds)


def alive(pid):
    """Whether there is a process of this number that is more than an entry in the table."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


def wait_until(condition, seconds=120.0):
    """Time enough for processes that begin on a machine that others use, too; what hangs fails."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"it did not happen in {seconds:g} s")
        time.sleep(0.01)


def through_a_pipe(value):
    """A value as another process of the machine receives it."""
    one, other = Pipe()
    with one, other:
        one.send(value)
        return other.recv()
