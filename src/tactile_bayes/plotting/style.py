"""The looks of figures, for print and for the screen; and colours, lines and markers of one meaning in all of them."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tactile_bayes.checks import check_choice

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Style = Literal["print", "screen"]

COLUMN_WIDTH = 3.5  # width of a figure that fills one column of a journal [inches]
PAGE_WIDTH = 7.0  # width of a figure that fills both columns, or a page, and of figures by default [inches]
_COMMON: dict[str, Any] = {"font.family": ["sans-serif"], "font.sans-serif": ["DejaVu Sans"], "text.usetex": False}
_COMMON |= {"mathtext.fontset": "dejavusans", "pdf.fonttype": 42, "ps.fonttype": 42, "svg.fonttype": "none"}
_COMMON |= {"svg.hashsalt": "tactile-bayes", "savefig.bbox": None, "savefig.facecolor": "white"}
_TICKS = {"major.width": 0.6, "minor.width": 0.4, "major.size": 3.0, "minor.size": 1.8}  # ticks of both axes, in print
# Colours after Okabe and Ito, distinguishable with any colour vision.
PALETTE = {"tip": "#0072B2", "tangential": "#D55E00", "change": "#000000", "none": "#8C8C8C", "sample": "#9A9A9A"}
PALETTE |= {"object": "#EFEFEF", "band": "#9CCBE8", "median": "#0072B2", "gap": "#F0E442"}
# Colours of bases in their order, after Okabe and Ito, without the gap's; the seventh base has the first again.
BASES = ("#0072B2", "#E69F00", "#CC79A7", "#009E73", "#56B4E9", "#D55E00")
# The mark on the best of several choices.
BEST: Mapping[str, Any] = {"marker": "*", "color": "#D55E00", "markeredgecolor": "white", "linestyle": "none"}
SWEEP_LINES: Mapping[str, str] = {"forward": "-", "backward": "--"}
SWEEP_MARKERS: Mapping[str, str] = {"forward": "o", "backward": "^"}

PHASES = {"tip": "tip contact", "tangential": "tangential contact"}
CONTACT_MARKERS = {"tip": "o", "tangential": "s", "none": "o"}

# The line of the true contour.
TRUTH: Mapping[str, Any] = {"color": PALETTE["change"], "linewidth": 1.0, "linestyle": "--"}


def _letters(size: float, at_ticks: float) -> dict[str, float]:
    names = ("font.size", "axes.labelsize", "axes.titlesize", "figure.titlesize", "figure.labelsize", "legend.fontsize")
    return dict.fromkeys(names, size) | dict.fromkeys(("xtick.labelsize", "ytick.labelsize"), at_ticks)


_PRINT = {f"{axis}tick.{name}": value for axis in "xy" for name, value in _TICKS.items()}
_PRINT |= {"axes.linewidth": 0.6, "axes.labelpad": 3.0, "axes.titlepad": 4.0, "hatch.linewidth": 0.5}
_PRINT |= {"legend.handlelength": 1.8, "legend.columnspacing": 1.4, "savefig.dpi": 300.0}
# Settings of matplotlib by the name of the style.
STYLES: Mapping[Style, Mapping[str, Any]] = {
    "print": {**_COMMON, **_letters(8.0, 8.0), **_PRINT},
    "screen": {**_COMMON, **_letters(10.0, 9.0), "axes.linewidth": 0.8, "hatch.linewidth": 0.8, "savefig.dpi": 150.0},
}


@contextmanager
def style(name: Style = "print") -> Iterator[None]:
    """Give figures that are made and saved inside the block one look; Matplotlib's settings are restored after it.

    Fonts go into a file when it is saved: `savefig` belongs inside the block, too.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> with style("screen"):
    ...     axes = Figure().subplots()
    """
    check_choice("style", name, STYLES)
    import matplotlib as mpl

    settings: Any = dict(STYLES[name])
    with mpl.rc_context(settings):
        yield


@contextmanager
def own_style(name: Style = "screen") -> Iterator[None]:
    """Give figures of commands one look, whatever the user's settings of Matplotlib are; they are restored after it."""
    import matplotlib as mpl

    settings: Any = {key: value for key, value in mpl.rcParamsDefault.items() if key != "backend"}
    with mpl.rc_context(settings), style(name):
        yield


def save_figure(figure: Figure, path: Path, form: str, **options: Any) -> None:
    """Write a figure to a file of this format: in memory first, so that a full disk raises an error that says so."""
    from matplotlib import rcParams

    memory = io.BytesIO()
    if form == "png":
        options = {"pil_kwargs": {"compress_level": 1}, **options}  # a tenth larger, in half the time
        if (engine := figure.get_layout_engine()) is not None:  # else the whole figure is drawn once more for it
            figure.set_dpi(rcParams["savefig.dpi"])
            engine.execute(figure)
            figure.set_layout_engine(None)
    figure.savefig(memory, format=form, **options)
    path.write_bytes(memory.getbuffer())
