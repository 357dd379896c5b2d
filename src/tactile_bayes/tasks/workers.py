"""Many independent tasks: in this process, in processes here, or on a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple, TypeVar

from threadpoolctl import threadpool_limits

from tactile_bayes.checks import check_function, check_whole_number
from tactile_bayes.errors import ParameterError, TaskError
from tactile_bayes.matplotlib_defaults import ignore_user_settings
from tactile_bayes.tasks.threads import cores, one_thread

Task = TypeVar("Task")
Result = TypeVar("Result")

_PATIENCE = "10s"  # timeout of the connection to a scheduler
_MOST = 60  # largest number of processes: Windows can wait for 63 things at once
_RETRIES = 3  # number of retries of a task after its process died


class TaskProgress(NamedTuple):
    """Progress of many tasks.

    Examples
    --------
    >>> progress = TaskProgress(done=30, wanted=100, made=10, seconds=5.0)
    >>> progress.seconds / progress.made * (progress.wanted - progress.done)  # time that is left [s]
    35.0
    """

    done: int
    wanted: int
    made: int  # number of tasks done in this run
    seconds: float  # time since the beginning of this run [s]


@dataclass(frozen=True)
class Workers:
    """Where many tasks are done, and what hears of their progress.

    Every function with an argument `workers` takes one; a number or an address alone is short for it.

    Parameters
    ----------
    where : int or str, optional
        Number of processes on this machine, by default one for each core that this process may use; or the address of
        a Dask scheduler, such as "tcp://10.0.0.1:8786", whose workers need this package in the same version. With 1 all
        tasks run in this process. Each process begins by importing the script that is run: code that starts processes
        belongs under `if __name__ == "__main__":`.
    progress : callable, optional
        Called with a `TaskProgress` after each task: done, wanted, made (in this run), seconds.

    Raises
    ------
    ParameterError
        If there is no such number, or the progress is not callable.

    Examples
    --------
    >>> Workers(2, progress=print).where
    2
    """

    where: int | str | None = None
    progress: Callable[[Any], object] | None = None

    def __post_init__(self) -> None:
        if self.where is not None and not (isinstance(self.where, str) and ":" in self.where):
            what = "give a positive number, or the address of a Dask scheduler, like 'tcp://10.0.0.1:8786'"
            check_whole_number("workers", self.where, 1, what)
        check_function("progress", self.progress)


def workers_of(workers: int | str | Workers | None) -> Workers:
    """Return workers, from their number or the address of a scheduler."""
    return workers if isinstance(workers, Workers) else Workers(workers)


def run_tasks(
    function: Callable[[Task], Result], tasks: Sequence[Task], *, workers: int | str | Workers | None = None
) -> Generator[tuple[Task, Result], None, None]:
    """Call a function on every task, and yield results in the order in which they are ready.

    A process that dies (killed, out of memory) is replaced, and its task is repeated. Each task runs on one thread.
    Processes end with the iterator, and with this process, however it ends; only this process receives Ctrl-C.
    """
    where = workers_of(workers).where
    if isinstance(where, str):
        yield from _on_cluster(function, tasks, where)
        return
    count = min(where or cores(), len(tasks), _MOST)
    if count <= 1:
        for task in tasks:
            yield task, _alone(function, task)
    else:
        yield from _in_processes(function, tasks, count)


def _alone(function: Callable[[Task], Result], task: Task) -> Result:
    with threadpool_limits(1), one_thread():
        return function(task)


# ---- processes on this machine


class _Process:
    """A process that runs one task after the other."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        context = multiprocessing.get_context("spawn")
        self.task: int | None = None
        self.has_begun = False
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(function, theirs), daemon=True)
        with _interrupts_held():
            self.process.start()
        theirs.close()

    def end(self) -> int | None:
        """End the process, and return its exit code."""
        self.connection.close()
        self.process.terminate()
        self.process.join()
        code = self.process.exitcode
        self.process.close()
        return code


def _in_processes(
    function: Callable[[Task], Result], tasks: Sequence[Task], count: int
) -> Generator[tuple[Task, Result], None, None]:
    fresh, again = iter(range(len(tasks))), list[int]()
    deaths: Counter[int | None] = Counter()
    team: dict[Any, _Process] = {}
    try:
        for _ in range(count):
            process = _Process(function)
            team[process.connection] = process
        while team:
            for connection in wait(list(team)):
                process = team[connection]
                done, outcome = process.task, None
                try:
                    outcome = process.connection.recv()
                    process.has_begun = True
                    process.task = again.pop() if again else next(fresh, None)
                    if process.task is None:
                        team.pop(connection).end()
                    else:
                        process.connection.send(tasks[process.task])
                except (EOFError, OSError):
                    team.pop(connection)
                    _refuse_hopeless(process, process.end(), deaths, count)
                    again += [] if process.task is None else [process.task]
                    process = _Process(function)
                    team[process.connection] = process
                if outcome is not None and done is not None:
                    succeeded, result = outcome
                    if not succeeded:
                        raise result
                    yield tasks[done], result
    finally:
        for process in team.values():
            process.end()


def _refuse_hopeless(process: _Process, code: int | None, deaths: Counter[int | None], count: int) -> None:
    if not process.has_begun and (code is None or code >= 0):
        raise TaskError(
            "a process for the work ended before it began: a script that starts processes must do so under "
            "`if __name__ == '__main__':`, as each of them imports it; or give workers=1"
        ) from None
    deaths[process.task] += 1
    if deaths[process.task] > _RETRIES + (count if process.task is None else 0):
        what = "before their first task" if process.task is None else f"over task {process.task}"
        raise TaskError(
            f"processes died {deaths[process.task]} times {what}: out of memory, with {count} of them? Try "
            "fewer workers"
        ) from None


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Start processes that ignore Ctrl-C; this one receives it afterwards, and SIGTERM if it has a handler for it."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # it starts with the first process and would unblock the signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with _termination_held():
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _termination_held() -> Iterator[None]:
    """Delay SIGTERM without blocking it: the process started here would inherit a blocked signal."""
    handler = signal.getsignal(signal.SIGTERM)
    if not callable(handler) or threading.current_thread() is not threading.main_thread():
        yield
        return
    come: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, frame: come.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, handler)
        if come:
            signal.raise_signal(signal.SIGTERM)


def _work(function: Callable[[Any], Any], connection: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ignore_user_settings()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        connection.send((True, None))
        while True:
            connection.send(_outcome(function, connection.recv()))
    except (EOFError, OSError):  # the parent is gone
        pass


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _outcome(function: Callable[[Any], Any], task: Any) -> tuple[bool, Any]:
    try:
        return True, _alone(function, task)
    except Exception as error:
        error.add_note(f"in another process:\n{traceback.format_exc()}")
        return False, error if _travels(error) else TaskError(f"a task failed: {type(error).__name__}: {error}")


def _travels(error: Exception) -> bool:
    """Return whether an error can be rebuilt from its arguments in another process."""
    if not all(argument is None or isinstance(argument, str | int | float) for argument in error.args):
        return False
    try:
        type(error)(*error.args)
    except Exception:
        return False
    return True


# ---- a cluster


def _refuse_malformed(address: str) -> None:
    """Refuse a malformed address, over which a client would take a minute and fail in its destructor."""
    from distributed.comm.addressing import get_address_host_port, parse_address
    from distributed.comm.registry import get_backend

    try:
        scheme, _ = parse_address(address)
        get_backend(scheme)
        if scheme in ("tcp", "tls", "ws", "wss"):
            get_address_host_port(address)
    except (ValueError, TypeError) as error:
        raise ParameterError(
            f"{address!r} is no address of a Dask scheduler ({error}): give one like 'tcp://10.0.0.1:8786'"
        ) from None


def _on_cluster(
    function: Callable[[Task], Result], tasks: Sequence[Task], address: str
) -> Generator[tuple[Task, Result], None, None]:
    try:
        from distributed import CancelledError, Client, KilledWorker, as_completed
    except ImportError:
        raise ParameterError(
            "a scheduler was given, but Dask is not installed: pip install 'tactile-bayes[cluster]'"
        ) from None
    _refuse_malformed(address)
    try:
        client = Client(address, set_as_default=False, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise ParameterError(f"no Dask scheduler answers at {address!r}: {error}") from error
    with client:
        fresh = iter(range(len(tasks)))
        places: dict[Any, int] = {}

        def submit(index: int) -> Any:
            future = client.submit(_alone, function, tasks[index], pure=False)
            places[future.key] = index
            return future

        ahead = max(8, 4 * sum(client.nthreads().values()))
        ready = as_completed([submit(index) for index in islice(fresh, ahead)], loop=client.loop)
        try:
            for future in ready:
                yield tasks[places.pop(future.key)], future.result()
                for index in islice(fresh, 1):
                    ready.add(submit(index))
        except KilledWorker as error:
            raise TaskError(f"workers of the cluster died over a task again and again: {error}") from error
        except CancelledError as error:
            raise TaskError(f"the Dask scheduler at {address} is lost: {error}") from error
