"""Independent tasks, here or on a Dask cluster; the ledger that a stopped run goes on from; files written whole."""

from tactile_bayes.tasks.files import alone_in, is_temporary, write_atomically
from tactile_bayes.tasks.ledger import Kind, Ledger, TaskProgress, keep_outcomes, open_ledger
from tactile_bayes.tasks.workers import run_tasks

__all__ = [
    "Kind",
    "Ledger",
    "TaskProgress",
    "alone_in",
    "is_temporary",
    "keep_outcomes",
    "open_ledger",
    "run_tasks",
    "write_atomically",
]
