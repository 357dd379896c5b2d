"""The two looks of figures: for print, and for the screen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Literal

from tactile_bayes.errors import ParameterError

__all__ = ["COLUMN_WIDTH", "PAGE_WIDTH", "STYLES", "Style", "style"]

Style = Literal["print", "screen"]

COLUMN_WIDTH = 3.5
"""Of a figure that fills one column of a journal [inches]."""

PAGE_WIDTH = 7.0
"""Of one that fills both columns, or a page [inches]; every figure that a function of `plotting` makes is as wide."""

_COMMON: Mapping[str, Any] = {
    "font.family": ["sans-serif"],
    "font.sans-serif": ["DejaVu Sans"],
    "mathtext.fontset": "dejavusans",
    "text.usetex": False,
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "tactile-bayes",
    "savefig.bbox": None,
    "savefig.facecolor": "white",
}

STYLES: Mapping[Style, Mapping[str, Any]] = {
    "print": {
        **_COMMON,
        "font.size": 8.0,
        "axes.labelsize": 8.0,
        "axes.titlesize": 8.0,
        "figure.titlesize": 8.0,
        "figure.labelsize": 8.0,
        "legend.fontsize": 8.0,
        "xtick.labelsize": 8.0,
        "ytick.labelsize": 8.0,
        "axes.linewidth": 0.6,
        "axes.labelpad": 3.0,
        "axes.titlepad": 4.0,
        "xtick.major.width": 0.6,
        "ytick.major.width": 0.6,
        "xtick.minor.width": 0.4,
        "ytick.minor.width": 0.4,
        "xtick.major.size": 3.0,
        "ytick.major.size": 3.0,
        "xtick.minor.size": 1.8,
        "ytick.minor.size": 1.8,
        "hatch.linewidth": 0.5,
        "legend.handlelength": 1.8,
        "legend.columnspacing": 1.4,
        "savefig.dpi": 300.0,
    },
    "screen": {
        **_COMMON,
        "font.size": 10.0,
        "axes.labelsize": 10.0,
        "axes.titlesize": 10.0,
        "figure.titlesize": 10.0,
        "figure.labelsize": 10.0,
        "legend.fontsize": 10.0,
        "xtick.labelsize": 9.0,
        "ytick.labelsize": 9.0,
        "axes.linewidth": 0.8,
        "hatch.linewidth": 0.8,
        "savefig.dpi": 150.0,
    },
}
"""Settings of matplotlib by the name of the style."""


@contextmanager
def style(name: Style = "print") -> Iterator[None]:
    """Give figures that are made and saved inside the block one look; matplotlib's settings are put back after it.

    Parameters
    ----------
    name : {"print", "screen"}
        "print" has letters of 8 points and thin axes, for figures that are 7 inches wide or, in one column, 3.5, and
        are put into a text at that size. "screen" has letters of 10 points. In both, PDF holds text in TrueType fonts
        and SVG holds it as text, so that both can be searched and edited.

    Raises
    ------
    ParameterError
        If there is no such style.

    Notes
    -----
    Fonts go into a file when it is saved: `savefig` belongs inside the block, too.

    Examples
    --------
    >>> import io
    >>> from matplotlib.figure import Figure
    >>> with style("print"):
    ...     figure = Figure(figsize=(3.5, 2.0))
    ...     _ = figure.subplots().set_xlabel("drive angle")
    ...     figure.savefig(io.BytesIO(), format="pdf")
    """
    if name not in STYLES:
        raise ParameterError(f"style is {name!r}: choose {' or '.join(map(repr, STYLES))}")
    import matplotlib as mpl

    settings: Any = dict(STYLES[name])
    with mpl.rc_context(settings):
        yield
