"""Figures of a posterior: the draws of its chains, and its marginals."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_kind, check_mapping, check_names, check_number
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import AxesArray, check_panels, new_panels, plot
from tactile_bayes.plotting.labels import number
from tactile_bayes.plotting.style import PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

_CHAINS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_MOST_DRAWS = 500
_REGIONS = (0.95, 0.5)
_ROWS = "rows are parameters"
_TRUTH: dict[str, Any] = {"color": PALETTE["change"], "linestyle": "--", "linewidth": 0.9}


@plot("a name is unknown, or the axes have another shape")
def trace(posterior: xr.DataTree | xr.Dataset, *, names: Sequence[str] | None = None, axes: Any = None) -> AxesArray:
    """Draw the trace of each chain, and its density: chains that agree look alike.

    The left Axes hold the draws in their order, thinned to at most 500 a chain, the right ones a histogram for each
    chain.

    Parameters
    ----------
    posterior : xr.DataTree or xr.Dataset
        Tree with a group "posterior", or that dataset: variables over "chain" and "draw".
    names : sequence of str, optional
        Names of the variables; by default all.
    axes : array_like of Axes, shape (parameters, 2), optional
        One row for each parameter; a variable with further dimensions is one parameter for each of its elements.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> posterior = xr.Dataset({"q": (("chain", "draw"), rng.normal(0.5, 0.01, (4, 500)))})
    >>> trace(posterior).shape
    (1, 2)
    """
    parameters = _parameters(posterior, names)
    count = len(parameters)
    if axes is None:
        grid = new_panels(count, 2, 0.5 + 1.2 * count, width_ratios=(2.0, 1.0))
    else:
        grid = check_panels(axes, (count, 2), _ROWS)
    for (left, right), parameter in zip(grid, parameters, strict=True):
        edges = np.linspace(*_core(parameter.draws), 41)
        for chain, draws in enumerate(parameter.draws):
            colour = _CHAINS[chain % len(_CHAINS)]
            step = -(-draws.size // _MOST_DRAWS)
            drawn = np.arange(0, draws.size, step)
            left.plot(drawn, draws[drawn], color=colour, linewidth=0.4, alpha=0.7)
            density = np.histogram(draws[np.isfinite(draws)], edges, density=True)[0]
            right.stairs(density, edges, color=colour, linewidth=1.0, label=f"chain {chain}")
        left.margins(x=0.01)
        right.set_ylim(bottom=0.0)
        right.set(yticks=[], xlim=_view(parameter))
        _label_parameter(left.yaxis, parameter, 4)
        _label_parameter(right.xaxis, parameter, 3, lines=False)
        if left is not grid[-1, 0]:
            left.tick_params(labelbottom=False)
    grid[-1, 0].set_xlabel("draw")
    if axes is None:
        grid[0, 0].figure.align_ylabels(list(grid[:, 0]))
    return grid


@plot("a name is unknown, in `names` or in `truth`, or the axes have another shape")
def pairs(
    posterior: xr.DataTree | xr.Dataset,
    *,
    names: Sequence[str] | None = None,
    truth: Mapping[str, float] | None = None,
    axes: Any = None,
) -> AxesArray:
    """Draw the marginals of the posterior, one by one and in pairs.

    The diagonal holds histograms, with the central 95 % interval dark; below it are the highest-density regions of 50 %
    and 95 % of the draws, from a histogram smoothed by one bin. Axes above the diagonal are switched off. A figure of
    more than six parameters (seven in print) is wider than 7 inches, so that labels fit: for a page, choose `names`.

    Parameters
    ----------
    posterior, names
        As in `trace`.
    truth : mapping of str to float, optional
        True values by name of the parameter, in its unit; drawn as dashed lines. It may have more parameters than
        `names`, and none that the posterior lacks.
    axes : array_like of Axes, shape (parameters, parameters), optional
        One for each pair of parameters, as in `trace`. Above the diagonal None will do.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> draws = {name: (("chain", "draw"), rng.normal(0.5, 0.01, (4, 500))) for name in ("a", "q")}
    >>> pairs(xr.Dataset(draws), truth={"a": 0.5}).shape
    (2, 2)
    """
    from matplotlib import rcParams

    check_mapping("truth", truth, "give true values by the names of parameters")
    truth = {name: check_number(f"truth of {name}", value) for name, value in (truth or {}).items()}
    parameters = _parameters(posterior, names)
    known = [parameter.name for parameter in _parameters(posterior, None)]
    if unknown := sorted(set(truth) - set(known)):
        raise ParameterError(f"truth names {', '.join(unknown)}, and the parameters are {', '.join(known)}")
    size = len(parameters)
    side = max(2.6, min(7.0, 1.75 * size), 0.115 * rcParams["font.size"] * size)
    grid = new_panels(size, size, side, side) if axes is None else check_panels(axes, (size, size), _ROWS, lower=True)
    limits = [_view(p, truth.get(p.name)) for p in parameters]
    for row, column in np.ndindex(size, size):
        ax: Axes = grid.item(row, column)
        if column > row:
            if ax is not None:
                ax.set_axis_off()
            continue
        across = parameters[column]
        if row == column:
            _draw_marginal(ax, across.draws.ravel())
            ax.set_yticks([])
        else:
            _draw_pair(ax, across.draws.ravel(), parameters[row].draws.ravel())
            ax.set_ylim(limits[row])
            _label_parameter(ax.yaxis, parameters[row], 3)
            if parameters[row].name in truth:
                ax.axhline(truth[parameters[row].name], **_TRUTH)
        ax.set_xlim(limits[column])
        _label_parameter(ax.xaxis, across, 3)
        if across.name in truth:
            ax.axvline(truth[across.name], **_TRUTH)
        ax.tick_params(labelsize="small", labelbottom=row == size - 1, labelleft=column == 0 and row > 0)
        ax.tick_params(axis="x", labelrotation=45.0)
        if row < size - 1:
            ax.set_xlabel("")
        if column > 0:
            ax.set_ylabel("")
    if axes is None:
        figure = grid[0, 0].figure
        figure.align_ylabels(list(grid[:, 0]))
        figure.align_xlabels(list(grid[-1, :]))
    return grid


class _Parameter(NamedTuple):
    name: str
    label: str
    unit: str
    draws: Floats  # shape (chains, draws)


def _parameters(posterior: xr.DataTree | xr.Dataset, names: Sequence[str] | None) -> list[_Parameter]:
    check_kind("posterior", posterior, xr.DataTree | xr.Dataset, "give a posterior, or its group 'posterior'")
    names = None if names is None else check_names("names", names)
    if isinstance(posterior, xr.DataTree):
        posterior = (posterior["posterior"] if "posterior" in posterior.children else posterior).to_dataset()
    known = [str(name) for name, values in posterior.data_vars.items() if {"chain", "draw"} <= set(values.dims)]
    unknown = [name for name in names or () if name not in known]
    if unknown or not known:
        raise ParameterError(
            f"the posterior has no {', '.join(unknown) or 'variables over chain and draw'}: it has {', '.join(known)}"
        )
    parameters = []
    for name in names or known:
        values = posterior[name].transpose("chain", "draw", ...)
        unit = str(values.attrs.get("units", "1"))
        for index in np.ndindex(values.shape[2:]):
            element = f"[{', '.join(map(str, index))}]" if index else ""
            draws = values.values[:, :, *index].astype(float)
            parameters.append(_Parameter(name + element, _symbol(name) + element, "" if unit == "1" else unit, draws))
    return parameters


def _symbol(name: str) -> str:
    """Return the label of a parameter: short names are symbols, longer ones text."""
    if match := re.fullmatch(r"([A-Za-z])(?:_([A-Za-z0-9]{1,3}))?", name):
        letter, index = match.groups()
        return f"${letter}$" if index is None else rf"${letter}_{{\mathrm{{{index}}}}}$"
    return name.replace("_", " ")


def _label_parameter(axis: Axis, parameter: _Parameter, most_ticks: int, *, lines: bool = True) -> None:
    """Set label and ticks of an axis; small or large values are in units of a power of ten that the label names."""
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    largest = np.max(np.abs(_core(parameter.draws)))
    power = int(3 * np.floor(np.log10(largest) / 3)) if largest > 0.0 else 0
    power = power if largest < 2e-3 or largest >= 1e4 else 0
    unit = " ".join(part for part in (f"$10^{{{power}}}$" if power else "", parameter.unit) if part)
    label = parameter.label + (f" [{unit}]" if unit else "")
    if lines:
        label = parameter.label.replace(" ", "\n") + (f"\n[{unit}]" if unit else "")
    axis.set_label_text(label)
    axis.set_major_locator(MaxNLocator(most_ticks, min_n_ticks=2))
    axis.set_major_formatter(ScalarFormatter(useOffset=False))
    if power:
        axis.set_major_formatter(lambda value, _: number(value, power, digits=10))


def _core(draws: Floats) -> tuple[float, float]:
    """Return the range of the draws, except one in a thousand on either side."""
    finite = draws[np.isfinite(draws)]
    if not finite.size:
        return 0.0, 1.0
    low, high = (float(q) for q in np.quantile(finite, [0.001, 0.999]))
    if high > low:
        return low, high
    room = 0.05 * abs(low) or 0.5
    return low - room, high + room


def _view(parameter: _Parameter, truth: float | None = None) -> tuple[float, float]:
    """Return the same range, extended by the truth and a margin."""
    low, high = _core(parameter.draws)
    if truth is not None:
        low, high = min(low, truth), max(high, truth)
    room = 0.08 * (high - low)
    return low - room, high + room


def _bins(draws: Floats, most: int) -> int:
    return int(np.clip(2.0 * draws.size ** (1 / 3), 10, most))


def _draw_marginal(ax: Axes, draws: Floats) -> None:
    density, edges = np.histogram(draws[np.isfinite(draws)], _bins(draws, 40), _core(draws))
    ends = np.nanquantile(draws, [0.025, 0.975])
    inner = np.concatenate([ends[:1], edges[(edges > ends[0]) & (edges < ends[1])], ends[1:]])
    height = density[np.clip(np.searchsorted(edges, inner[:-1], side="right") - 1, 0, density.size - 1)]
    ax.stairs(density, edges, fill=True, color=PALETTE["band"], alpha=0.45)
    ax.stairs(height, inner, fill=True, color=PALETTE["median"], alpha=0.55)
    ax.stairs(density, edges, color=PALETTE["median"], linewidth=0.9)
    ax.set_ylim(0.0, 1.08 * density.max())


def _draw_pair(ax: Axes, x: Floats, y: Floats) -> None:
    from scipy.ndimage import gaussian_filter

    counts, *edges = np.histogram2d(x, y, _bins(x, 30), (_core(x), _core(y)))
    density = gaussian_filter(counts, 1.0, mode="nearest")
    levels = _highest_density(density, _REGIONS)
    # A rim of zeros closes the regions where the draws end, also at a bound of the prior.
    at = [np.concatenate([e[:1], 0.5 * (e[1:] + e[:-1]), e[-1:]]) for e in edges]
    rimmed = np.pad(density, 1).T
    colours = [PALETTE["band"], PALETTE["median"]]
    ax.contourf(*at, rimmed, levels=[*levels, 1.01 * density.max()], colors=colours, alpha=0.6)
    ax.contour(*at, rimmed, levels=levels, colors=PALETTE["median"], linewidths=0.8)


def _highest_density(density: Floats, probabilities: Sequence[float]) -> list[float]:
    """Return levels above which a density holds given probabilities, from the largest probability to the smallest."""
    falling = np.sort(density, axis=None)[::-1]
    mass = np.cumsum(falling) / falling.sum()
    levels = [float(falling[min(int(np.searchsorted(mass, p)), falling.size - 1)]) for p in sorted(probabilities)]
    for i in range(1, len(levels)):
        levels[i] = min(levels[i], levels[i - 1] * (1.0 - 1e-6))
    return levels[::-1]
