"""Draw the figures of the pages into docs/images, except that of the demonstration: `python docs/images.py`.

Those of a real cylinder and a real square are of `benchmarks.whisker_sweeps` and `benchmarks.whisker_square`.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import cumulative_simpson

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
    measured = cell.measure(tb.scan(contour, direction="forward", drive_step=np.radians(2)).record, rng=5)
    figure = Figure(figsize=(11.0, 3.6), layout="compressed")
    columns = figure.subplots(1, 3, sharex=True, sharey=True, subplot_kw={"xlim": (0.03, 0.83), "ylim": (0.35, 0.85)})
    constrained = tb.reconstruct(measured, method="constrained")
    drawn = np.flatnonzero(constrained.status.values != "no contact")[::6]
    options = {"samples": drawn, "truth": contour}
    tb.plotting.contact_ellipses(tb.reconstruct(measured), ax=columns[0], **options)
    tb.plotting.contact_ellipses(constrained, ax=columns[1], **options)
    tb.plotting.contact_regions(tb.infer_contacts(measured, rng=1, draws=4000), ax=columns[2], **options)
    for ax, title in zip(columns, ("raw, first order", "constrained, first order", "posterior"), strict=True):
        ax.set(title=title, xlim=(0.03, 0.83), ylim=(0.35, 0.85))
        ax.get_legend().remove()
        ax.label_outer()
    return figure


def whisker() -> Figure:
    """A traced whisker, and contact points that it and a straight one imply."""
    s = np.linspace(0.0, 0.1, 41)
    slope = 2.0 * s + 20.0 * s**2
    x, y = (cumulative_simpson(way, x=s, initial=0.0) for way in (np.cos(slope), np.sin(slope)))
    scatter = np.random.default_rng(1).normal(scale=1e-4, size=(2, s.size))
    rigidity = 3e9 * np.pi * 1e-3**4 / 64
    traced = tb.Rod.from_shape(x + scatter[0], y + scatter[1], rigidity, taper=0.5)
    true = tb.Rod(0.1, rigidity, rest_curvature=lambda s: 2.0 + 40.0 * s, taper=0.5)
    parabola = tb.contours.Parabola(a=5.0, q=0.07)
    cell = tb.LoadCell(force_noise=3e-4, moment_noise=1.5e-5)
    measured = cell.measure(tb.scan(parabola, tb.Rig(rod=true), drive_step=np.radians(3)).record, rng=2)

    figure = Figure(figsize=(8.0, 6.5), layout="constrained")
    above, below = figure.subplots(2, 1)
    along = np.linspace(0.0, traced.length, 501)
    turn = cumulative_simpson(traced.rest_curvature(along), x=along, initial=0.0)
    shape = [cumulative_simpson(way, x=along, initial=0.0) for way in (np.cos(turn), np.sin(turn))]
    drawn, points = shape[0] + 1j * shape[1], x + scatter[0] + 1j * (y + scatter[1])
    points = points - points[0]
    drawn = drawn * np.exp(1j * np.angle(points[-1] / drawn[-1]))
    above.plot(1e3 * points.real, 1e3 * points.imag, "o", markersize=4.0, color="#0072B2", label="traced")
    above.plot(1e3 * drawn.real, 1e3 * drawn.imag, color="#D55E00", label="rod")
    above.set(xlabel="$x$ / mm", ylabel="$y$ / mm", ylim=(-3.0, 25.0), aspect="equal")
    above.legend(frameon=False, loc="upper left")

    width = np.linspace(-0.06, 0.06, 201)
    below.plot(1e3 * width, 1e3 * parabola.height(width), color="black", label="object")
    straight = tb.Rod(traced.length, rigidity, taper=0.5)
    drawn_for = (("traced rod", traced, "o", "#0072B2"), ("straight rod", straight, "^", "#D55E00"))
    for name, rod, marker, colour in drawn_for:
        found = tb.reconstruct(measured, tb.Rig(rod=rod, load_cell=cell), method="constrained")
        below.plot(
            1e3 * found.contact_x, 1e3 * found.contact_y, marker, markersize=4.0, color=colour, label=name, mfc="none"
        )
    below.set(xlabel="$x$ / mm", ylabel="$y$ / mm", ylim=(54.0, 98.0), aspect="equal")
    below.legend(frameon=False, loc="lower left", ncols=3)
    return figure


if __name__ == "__main__":
    with mpl.rc_context({"font.size": 12.0}):
        for draw in (bases, contacts, whisker):
            draw().savefig(IMAGES / f"{draw.__name__}.png", dpi=140, bbox_inches="tight")
