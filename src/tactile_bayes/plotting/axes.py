"""Axes: new ones, checks of given ones, and notes where nothing is drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from inspect import cleandoc, signature
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_numbers, check_optional, refused
from tactile_bayes.contours.base import check_single
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.style import PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AxesArray = NDArray[np.object_]
Plot = TypeVar("Plot", bound=Callable[..., Any])

# What many plots take, by the name of the parameter, as their docstrings state it.
_TAKEN = {"truth": "truth : Contour, optional\n    The true contour.", "ax": "ax : Axes, optional"}
# What their examples begin with, by the name that it makes.
_MADE = {
    "scanned": """
>>> import tactile_bayes as tb
>>> scanned = tb.scan(tb.contours.paper_profile("II", q=0.5), drive_step=0.1)""",
    "measured": """
>>> cell = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
>>> measured = cell.measure(scanned.record, rng=1)""",
    "inferred": """
>>> from matplotlib.figure import Figure
>>> stated, quick = tb.Rig(unknown="nothing"), tb.SamplerSettings(min_ess=100, max_r_hat=1.1)
>>> inferred = tb.infer_contour(measured, rig=stated, rng=1, settings=quick)""",
}


def plot(refusal: str = "", example: str = "") -> Callable[[Plot], Plot]:
    """Complete the docstring of a plot by what many of them take, when it raises ParameterError, and its example."""

    def completed(function: Plot) -> Plot:
        said, _, examples = cleandoc(function.__doc__ or "").partition("\nExamples\n")
        taken = [
            _TAKEN[name] for name in signature(function).parameters if name in _TAKEN and f"\n{name} :" not in said
        ]
        said = "\n".join([said.rstrip(), *taken, ""])
        raises = f"\nRaises\n------\nParameterError\n    If {refusal}.\n" if refusal else ""
        made = "".join([*_MADE.values()][: 1 + list(_MADE).index(example)]) if example else ""
        function.__doc__ = f"{said}{raises}\nExamples\n" + examples.replace("\n", f"{made}\n", 1)
        return function

    return completed


def axes_for(ax: Axes | None, truth: Any = None, *, height: float | None = None) -> Axes:
    """Return the given Axes, or those of a new figure, after `check_drawing`; a height is that of rows of labels."""
    check_drawing(ax, truth)
    if ax is not None:
        return ax
    if height is not None:
        return new_panels(1, 1, height).item()
    from matplotlib import pyplot as plt

    return plt.subplots(figsize=(7.0, 4.0), layout="compressed")[1]


def label_rows(ax: Axes, labels: Sequence[str], above: float = 0.5, below: float = 0.5) -> None:
    """Label rows at 0, 1, …, from top to bottom, without a frame at the top and at the right."""
    ax.set_ylim(len(labels) - 1 + below, -above)
    ax.set_yticks(np.arange(len(labels)), labels)
    ax.tick_params(axis="y", length=0.0)
    ax.spines[["top", "right"]].set_visible(False)


def new_panels(rows: int, columns: int, height: float, width: float = 7.0, **options: Any) -> AxesArray:
    """Return Axes of a new figure, shape (rows, columns); options are those of `pyplot.subplots`."""
    from matplotlib import pyplot as plt

    options |= {"figsize": (width, height), "layout": "constrained", "squeeze": False}
    return plt.subplots(rows, columns, **options)[1]


def check_drawing(ax: Any = None, truth: Any = None) -> None:
    """Refuse Axes that are not Matplotlib's, and a truth that is not one contour; both are optional."""
    from matplotlib.axes import Axes

    check_optional("ax", ax, Axes, "give Axes of Matplotlib")
    if truth is not None:
        check_single("truth", truth, "give one contour, or None")


def checked_samples(samples: Any) -> NDArray[np.intp] | None:
    """Return numbers of samples as an array; None for the usual ones."""
    if samples is None:
        return None
    correction = "give a list of numbers of samples, or None"
    numbers = np.atleast_1d(check_numbers("samples", samples, correction, least=0, most=10**9))
    if numbers.ndim != 1 or np.any(numbers != np.round(numbers)):
        raise refused("samples", samples, correction)
    return numbers.astype(np.intp)


def check_panels(axes: Any, shape: tuple[int, ...], meaning: str, *, lower: bool = False) -> AxesArray:
    """Return the given Axes if they have the wanted shape; with `lower` there may be None above the diagonal."""
    from matplotlib.axes import Axes

    panels = np.atleast_1d(np.array(None if hasattr(axes, "data_vars") else axes, dtype=object))
    if panels.shape != shape:
        raise ParameterError(f"axes have shape {panels.shape}, and {shape} is wanted: {meaning}")
    wanted = panels[np.tril_indices(len(panels))] if lower else panels.ravel()
    if not all(isinstance(ax, Axes) for ax in wanted):
        raise refused("axes", axes, f"give an array of Axes of Matplotlib, shape {shape}: {meaning}")
    return panels


def check_dataset(found: Any, names: set[str], kind: str, source: str, attrs: Sequence[str] = ()) -> None:
    """Refuse objects other than a dataset with these variables and attributes; `source` names the function for it."""
    if not (isinstance(found, xr.Dataset) and names <= set(found.variables) and set(attrs) <= set(found.attrs)):
        raise ParameterError(f"this is no {kind}: give what {source} returned")


def group_of(found: Any, name: str, variables: set[str]) -> xr.Dataset:
    """Return the dataset of a figure, given as a dataset, as a group, or in a whole result of `sensitivity`."""
    if isinstance(found, xr.DataTree):
        found = (found[name] if name in found.children else found).to_dataset()
    if not isinstance(found, xr.Dataset) or not variables <= set(found.variables):
        raise ParameterError(f"there is no {name} in this: give what sensitivity returned, or its group {name!r}")
    return found


def check_among(name: str, value: str, found: xr.Dataset) -> None:
    """Refuse a value that is not a label along a dimension."""
    if not isinstance(value, str) or value not in found[name].values:
        raise ParameterError(f"{name} is {value!r}: there are {', '.join(map(str, found[name].values))}")


def write_instead(ax: Axes, words: str) -> Axes:
    """Write why nothing is drawn in the middle of Axes that are switched off."""
    ax.set_axis_off()
    ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", va="center")
    return ax


def write_not_measured(ax: Axes, label: str) -> None:
    """Write that a channel was not measured."""
    ax.text(0.5, 0.5, "not measured", transform=ax.transAxes, ha="center", va="center", color=PALETTE["none"])
    ax.set_yticks([])
    ax.set_ylabel(label)


def tile_edges(values: Floats) -> Floats:
    """Return the edges, shape (n + 1,), of tiles around increasing values, shape (n,): midway between neighbours."""
    if values.size == 1:
        return np.array([0.95, 1.05]) * values
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]])
