"""Independent tasks, here or on a Dask cluster; the results store, from which a stopped run resumes; atomic files."""

from tactile_bayes.tasks.files import (
    alone_in,
    check_format,
    errors_of,
    is_temporary,
    refuse_replacing,
    replace_together,
    write_atomically,
)
from tactile_bayes.tasks.results_store import (
    FieldsAlone,
    Kind,
    ResultsStore,
    keep_outcomes,
    open_results_store,
    versions_of,
)
from tactile_bayes.tasks.threads import in_parts, one_thread
from tactile_bayes.tasks.workers import TaskProgress, Workers, run_tasks, workers_of

__all__ = ["FieldsAlone", "Kind", "ResultsStore", "TaskProgress", "Workers", "alone_in", "check_format", "errors_of"]
__all__ += [
    "in_parts",
    "is_temporary",
    "keep_outcomes",
    "one_thread",
    "open_results_store",
    "refuse_replacing",
    "replace_together",
]
__all__ += ["run_tasks", "versions_of", "workers_of", "write_atomically"]
