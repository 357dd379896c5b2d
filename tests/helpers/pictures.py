"""Pictures of figures without letters, which look alike in every version of matplotlib, and their comparison."""

import os
import shutil
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.testing.compare import compare_images

BASELINE = Path(__file__).parents[1] / "baseline"

# Root mean square difference of colours, of 255: edges are smoothed a little differently from version to version.
TOLERANCE = 2.0
DPI = 60


def plain(figure):
    """The same figure without text, and with panels where no text has moved them."""
    figure.set_layout_engine(None)
    figure.set_size_inches(*(round(float(size), 1) for size in figure.get_size_inches()))
    figure.subplots_adjust(left=0.05, right=0.95, bottom=0.05, top=0.95, wspace=0.1, hspace=0.1)
    for legend in figure.legends[:]:
        legend.remove()
    for ax in figure.axes:
        if ax.get_legend() is not None:
            ax.get_legend().remove()
        for text in ax.texts:
            text.set_text("")
        ax.set_title("")
        ax.set(xlabel="", ylabel="")
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_formatter(mpl.ticker.NullFormatter())
            axis.set_minor_formatter(mpl.ticker.NullFormatter())
    return figure


def difference(figure, name, folder):
    """How the picture differs from the one in tests/baseline, in words; None if it does not.

    With the environment's NEW_BASELINES=1 a picture that differs takes the place of the one that is there.
    """
    found = differs(figure, name, folder)
    if found is not None and os.environ.get("NEW_BASELINES") == "1":
        shutil.copyfile(folder / f"{name}.png", BASELINE / f"{name}.png")
        return None
    return found


def differs(figure, name, folder):
    """The same, and nothing is replaced."""
    made = folder / f"{name}.png"
    plain(figure).savefig(made, dpi=DPI, metadata={"Software": None})
    if not (BASELINE / made.name).exists():
        return f"there is no {BASELINE / made.name}"
    return compare_images(BASELINE / made.name, made, tol=TOLERANCE)


def own_axes(*shape):
    """Axes of a figure that pyplot does not know."""
    return Figure().subplots(*shape)


def labels(ax):
    """What the legend says."""
    return [text.get_text() for text in ax.get_legend().get_texts()]


def texts(ax):
    return [text.get_text() for text in ax.texts]


def row_labels(ax):
    return [label.get_text() for label in ax.get_yticklabels()]
