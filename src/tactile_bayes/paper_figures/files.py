"""The figures as files, each written whole."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tactile_bayes.checks import check_function, check_names, check_optional, check_path
from tactile_bayes.errors import ParameterError
from tactile_bayes.paper_figures.catalogue import NUMBERS, caption, figure
from tactile_bayes.plotting.style import Style, own_style, save_figure
from tactile_bayes.tasks import write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FORMATS = ("pdf", "svg", "png")


def draw_all(
    out: str | os.PathLike[str],
    *,
    only: Sequence[int] | None = None,
    formats: Sequence[str] = ("pdf", "png"),
    style: Style = "print",
    progress: Callable[[int], object] | None = None,
    **options: Any,
) -> dict[int, dict[str, Path]]:
    """Write figures of the paper to a folder, and return their files.

    Files are named figure_02.pdf and so on, figure_02_translation.pdf or figure_02_motion.pdf with a drive of this
    kind, and hold their caption. They are written whole: after an interrupt each
    file is the old or the new one, and the same call makes all of them anew. The same options give the same bytes.

    Parameters
    ----------
    out : path-like
        Folder, created if missing.
    only : sequence of int, optional
        Numbers of the figures, from 2 to 11; by default all.
    formats : sequence of {"pdf", "svg", "png"}
        File formats of each figure.
    style : {"print", "screen"}
        Look of the figures, as in `plotting.style`.
    progress : callable, optional
        Called with the number of figures done, after each.
    **options
        Options of `figure`.

    Returns
    -------
    dict of int to dict of str to Path
        Files by number and format.

    Raises
    ------
    ParameterError, ContourError
        As in `figure`, or if there is no such format. Figures are made one by one: those made before an error remain.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = draw_all(folder, only=[3], formats=["svg"], distances=[0.5])
    ...     files[3]["svg"].name
    'figure_03.svg'
    """
    wanted = list(dict.fromkeys(check_names("formats", formats)))
    absent = [name for name in wanted if name not in _FORMATS]
    if absent or not wanted:
        raise ParameterError(f"formats are {list(formats)!r}: choose from {', '.join(_FORMATS)}")
    only = only.tolist() if isinstance(only, np.ndarray) else only
    check_optional("only", only, Sequence, "give a list of numbers of figures")
    numbers = NUMBERS if only is None else only
    captions = {number: caption(number, **options) for number in numbers}  # refuses before anything is written
    check_function("progress", progress)
    drive = options.get("drive")
    kind = "" if drive is None else f"_{type(drive).__name__.lower()}"
    folder = check_path("out", out, "give the path of a folder")
    files: dict[int, dict[str, Path]] = {}
    with own_style(style):
        for done, (number, text) in enumerate(captions.items(), start=1):
            made = figure(number, **options)
            folder.mkdir(parents=True, exist_ok=True)
            files[number] = {name: folder / f"figure_{number:02d}{kind}.{name}" for name in wanted}
            for name, path in files[number].items():
                with write_atomically(path) as temporary:
                    _save(made, temporary, name, number, text)
            if progress is not None:
                progress(done)
    return files


def _save(made: Figure, path: Path, name: str, number: int, text: str) -> None:
    """Save a figure with a caption, and without a date."""
    title = f"Figure {number}"
    metadata: dict[str, dict[str, Any]] = {
        "pdf": {"Title": title, "Subject": text, "CreationDate": None},
        "svg": {"Title": title, "Description": text, "Date": None},
        "png": {"Title": title, "Description": text},
    }
    save_figure(made, path, name, metadata=metadata[name])
