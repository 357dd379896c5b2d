"""The folder of a run of `infer`, as other commands take it."""

from __future__ import annotations

from pathlib import Path

from tactile_bayes.errors import InferenceError

__all__ = ["posterior_in"]

_OTHERS = {"comparison.nc": "a comparison of shapes", "design.nc": "a design", "manifest.json": "a data set"}
"""What else a folder may hold, by a file in it."""


def posterior_in(run: Path) -> Path:
    """The posterior in the folder of a run, which is not opened.

    Raises
    ------
    InferenceError
        If there is none.

    Examples
    --------
    >>> posterior_in(Path("no/such/run"))
    Traceback (most recent call last):
    ...
    tactile_bayes.errors.InferenceError: there is no folder no/such/run: give the folder that `tactile-bayes infer RECORD --out FOLDER` has written
    """  # noqa: E501
    remedy = "give the folder that `tactile-bayes infer RECORD --out FOLDER` has written"
    if not run.exists():
        raise InferenceError(f"there is no folder {run}: {remedy}")
    if not run.is_dir():
        raise InferenceError(f"{run} is a file: {remedy}")
    path = run / "posterior.nc"
    if not path.is_file():
        found = next((f", but {kind}" for name, kind in _OTHERS.items() if (run / name).exists()), "")
        raise InferenceError(f"{run} holds no posterior.nc{found}: {remedy}")
    return path
