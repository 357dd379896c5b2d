"""The figure of a design: a map of places where they form a grid, lines otherwise."""

import itertools

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import QuadMesh

from helpers.pictures import difference, labels
from tactile_bayes.plotting import design

XS, YS = (-0.3, -0.1, 0.1, 0.3), (-0.2, -0.1, 0.0)


def made_up(xs, ys, *, steps=(0.05,), criterion="band", length=None, missing=(), pivots=()):
    """Candidates on a grid, best at the second column of the last row; lengths in metres if a rod's is given."""
    scale, unit = (1.0, {"units": "1"}) if length is None else (length, {"units": "m"})
    rows = list(itertools.product(ys, xs, steps))
    y, x, step = np.array(rows, dtype=float).T
    width = 0.01 * scale * (1.0 + (x - xs[1]) ** 2 + (y - ys[-1]) ** 2 + step)
    width[list(missing)] = np.nan
    present = np.array(pivots, dtype=float).reshape(-1, 2).T
    variables = {"best": ((), int(np.nanargmin(width))), "is_pivot": ("candidate", np.ones(step.size, dtype=bool))}
    variables |= {f"base_{axis}": ("candidate", scale * at, unit) for axis, at in (("x", x), ("y", y))}
    variables |= {f"present_base_{axis}": ("pivot", at, unit) for axis, at in zip("xy", present, strict=True)}
    variables |= {"drive_step": ("candidate", step, {"units": "rad"}), "present_width": ((), 0.05 * scale, unit)}
    criteria = {"width": (width, unit), "gap": (2.0 * width, unit), "information": (1.0 / width, {"units": "nat"})}
    for name, (values, attrs) in criteria.items():
        variables |= {name: ("candidate", values, attrs), f"{name}_error": ("candidate", 0.1 * values, attrs)}
    return xr.Dataset(variables, attrs={"criterion": criterion, "probability": 0.95})


def tiles(ax):
    (mesh,) = (part for part in ax.collections if isinstance(part, QuadMesh))
    return mesh


def test_a_grid_of_three_heights_is_a_map_of_the_criterion():
    found = made_up(XS, YS)
    ax = design(found)
    np.testing.assert_allclose(tiles(ax).get_array().reshape(3, 4), found.width.values.reshape(3, 4))
    edges = tiles(ax).get_coordinates()
    np.testing.assert_allclose(edges[0, :, 0], [-0.4, -0.2, 0.0, 0.2, 0.4])
    np.testing.assert_allclose(edges[:, 0, 1], [-0.25, -0.15, -0.05, 0.05])
    assert len(ax.figure.axes) == 2
    assert "expected width of the band [$L$]" in (ax.figure.axes[1].get_xlabel(), ax.figure.axes[1].get_ylabel())


def test_the_order_of_candidates_does_not_matter():
    found = made_up(XS, YS)
    order = np.random.default_rng(1).permutation(found.sizes["candidate"])
    shuffled = found.isel(candidate=order).assign(best=int(np.flatnonzero(order == int(found.best))[0]))
    np.testing.assert_array_equal(tiles(design(shuffled)).get_array(), tiles(design(found)).get_array())


def test_the_best_place_and_the_pivots_so_far_are_marked():
    found = made_up(XS, YS, pivots=[(0.1, -0.1), (0.3, 0.0)])
    ax = design(found)
    (star,) = (line for line in ax.lines if line.get_marker() == "*")
    best = found.isel(candidate=int(found.best))
    assert (*star.get_xdata(), *star.get_ydata()) == (best.base_x, best.base_y)
    pivots = [line for line in ax.lines if line.get_marker() == "o"]
    assert [(*line.get_xdata(), *line.get_ydata()) for line in pivots] == [(0.1, -0.1), (0.3, 0.0)]
    assert labels(ax) == ["pivot so far", f"best: {float(best.width):.3g} $L$"]


def test_of_several_steps_the_map_is_that_of_the_best():
    found = made_up(XS, YS, steps=(0.1, 0.05))
    ax = design(found)
    chosen = found.width.values[found.drive_step.values == 0.05]
    np.testing.assert_allclose(tiles(ax).get_array().ravel(), chosen)
    assert ax.get_legend().get_title().get_text() == "steps of 2.86°"


@pytest.mark.parametrize(("criterion", "words"), [("gap", "width that no sweep touches"), ("information", "[nat]")])
def test_other_criteria_have_maps_too(criterion, words):
    found = made_up(XS, YS, criterion=criterion)
    ax = design(found)
    np.testing.assert_allclose(tiles(ax).get_array().ravel(), found[criterion].values)
    scale = ax.figure.axes[1]
    assert words in scale.get_xlabel() + scale.get_ylabel()
    better = tiles(ax).cmap(1.0 if criterion == "information" else 0.0)
    np.testing.assert_allclose(better, mpl.colormaps["cividis"](1.0))  # the best is bright


def test_in_si_the_axes_are_in_millimetres():
    ax = design(made_up(XS, YS, length=0.1, pivots=[(0.0, 0.0)]))
    assert ax.get_xlabel() == "position of the pivot $x$ [mm]"
    assert ax.get_xlim() == pytest.approx((-0.04, 0.04))
    assert labels(ax)[1].endswith("µm") or labels(ax)[1].endswith("mm")


@pytest.mark.parametrize("ys", [(0.0,), (-0.1, 0.0)])
def test_fewer_heights_are_lines(ys):
    found = made_up(XS, ys, pivots=[(0.1, 0.0)])
    ax = design(found)
    assert not [part for part in ax.collections if isinstance(part, QuadMesh)]
    assert len(ax.containers) == len(ys)
    (pivot,) = (line for line in ax.lines if line.get_label() == "pivot so far")
    assert list(pivot.get_xdata()) == [0.1, 0.1]


def test_a_grid_with_gaps_is_grey_there_and_what_is_no_full_grid_is_lines():
    ax = design(made_up(XS, YS, missing=[0, 1]))
    assert np.ma.getmaskarray(tiles(ax).get_array()).sum() == 2
    assert "out of reach" in labels(ax)
    found = made_up(XS, YS).isel(candidate=slice(1, None))
    ax = design(found.assign(best=int(np.argmin(found.width.values))))
    assert len(ax.containers) == 3
    assert "$y$ = −0.2 $L$" in labels(ax)


@pytest.mark.parametrize("shape", ["low", "high", "square"])
def test_the_figure_is_as_large_as_its_map(shape):
    few = (-0.1, 0.0, 0.1)
    xs, ys = np.linspace(-0.4, 0.4, 9) if shape == "low" else few, np.linspace(-0.8, 0.1, 9) if shape == "high" else few
    figure = design(made_up(xs, ys)).figure
    figure.draw_without_rendering()
    box, size = figure.get_tightbbox().extents.reshape(2, 2), figure.get_size_inches()
    assert (box[0] >= 0.0).all()
    assert (box[1] <= size).all()
    assert (np.diff(box, axis=0) > 0.95 * size).all()
    assert size[0] <= 7.0


def test_the_map_looks_as_it_did(tmp_path):
    ax = design(made_up(XS, YS, pivots=[(0.1, -0.1)]), ax=mpl.figure.Figure(figsize=(5.0, 3.0)).subplots())
    assert difference(ax.figure, "design_map", tmp_path) is None


@pytest.mark.parametrize("steps", [(0.05,), (0.05, 0.1)])
def test_other_drives_have_a_row_each(steps):
    found = made_up((0.0, 0.1), (0.0,), steps=steps)
    count = found.sizes["candidate"]
    words = ["carried from (0.8, 0) to (-0.8, 0) at 65°", *(f"turned about (0, 0.{k})" for k in range(1, count))]
    found = found.assign(drive=("candidate", words), is_pivot=("candidate", np.arange(count) > 0))
    ax = design(found)
    said = [" ".join(label.get_text().split()) for label in ax.get_yticklabels()]
    assert len(said) == count
    assert all(one.startswith(words[k]) for k, one in enumerate(said))
    assert ("or as many" in said[0]) == (len(steps) == 2)
    ring = next(line for line in ax.lines if line.get_label() == "best")
    assert (ring.get_xdata()[0], ring.get_ydata()[0]) == (found.width.values[int(found.best)], int(found.best))
