"""Draw the figures of the pages into docs/images, except that of the demonstration: `python docs/images.py`."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
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


def contacts() -> Figure:
    """The same contacts, raw, constrained, and as posteriors."""
    contour = tb.contours.paper_profile("II", q=0.5)
    cell = tb.LoadCell(force_noise=0.1, moment_noise=0.04)
    measured = cell.measure(tb.scan(contour, direction="forward", drive_step=np.radians(2)).record, seed=5)
    figure = Figure(figsize=(11.0, 3.6), layout="compressed")
    columns = figure.subplots(1, 3, sharex=True, sharey=True, subplot_kw={"xlim": (0.03, 0.83), "ylim": (0.35, 0.85)})
    constrained = tb.reconstruct(measured, method="constrained")
    drawn = np.flatnonzero(constrained.status.values != "no contact")[::6]
    options = {"samples": drawn, "truth": contour}
    tb.plotting.contact_ellipses(tb.reconstruct(measured), ax=columns[0], **options)
    tb.plotting.contact_ellipses(constrained, ax=columns[1], **options)
    tb.plotting.contact_regions(tb.infer_contacts(measured, seed=1, draws=4000), ax=columns[2], **options)
    for ax, title in zip(columns, ("raw, first order", "constrained, first order", "posterior"), strict=True):
        ax.set(title=title, xlim=(0.03, 0.83), ylim=(0.35, 0.85))
        ax.get_legend().remove()
        ax.label_outer()
    return figure


if __name__ == "__main__":
    with mpl.rc_context({"font.size": 12.0}):
        for draw in (bases, contacts):
            draw().savefig(IMAGES / f"{draw.__name__}.png", dpi=140, bbox_inches="tight")
