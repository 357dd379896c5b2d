"""Draw the figures of README.md into docs/images, but for that of the demonstration: `python docs/images.py`."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

import tactile_bayes as tb

IMAGES = Path(__file__).parent / "images"


def bases() -> Figure:
    """What one base touches of the paper's profiles, and what three do."""
    figure = Figure(figsize=(10.0, 4.1), layout="compressed")
    limits = {"xlim": (-0.87, 0.87), "ylim": (-0.07, 0.93)}
    rows = figure.subplots(2, 4, sharex=True, sharey=True, subplot_kw=limits)
    for name, column in zip(("I", "II", "III", "IV"), rows.T, strict=True):
        contour = tb.contours.paper_profile(name, q=0.5)
        for pivots, ax in zip(([(0, 0)], [(0, 0), (-0.25, 0), (0.25, 0)]), column, strict=True):
            tb.plotting.touched(tb.scan(contour, base=pivots), ax=ax)
            legend = ax.get_legend_handles_labels()
            ax.get_legend().remove()
            ax.label_outer()
        column[0].set_title(f"profile {name}")
    for (first, *_), label in zip(rows, ("one base", "three bases"), strict=True):
        first.set_ylabel(f"{label}\n{first.get_ylabel()}")
    figure.legend(*legend, loc="outside lower center", ncols=4, frameon=False)
    return figure


if __name__ == "__main__":
    with mpl.rc_context({"font.size": 12.0}):
        bases().savefig(IMAGES / "bases.png", dpi=140, bbox_inches="tight")
