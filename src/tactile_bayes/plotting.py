"""Figures: every function takes and returns Axes.

Without Axes a function makes a figure itself, about 7 inches wide. Axes hold data in the units of the record, angles in
degrees; in SI their tick labels carry the prefix that the axis label names. Matplotlib is loaded when a figure is
made; its settings are left alone, and nothing is shown.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.errors import ParameterError
from tactile_bayes.record import CHANNELS, COLUMNS, rod_of
from tactile_bayes.shape import rod_shape

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

    from tactile_bayes.contours.base import Contour
    from tactile_bayes.scanning import Event, Scan, SweepEvents

__all__ = ["PALETTE", "contour", "observables", "pairs", "predictive", "rods", "trace"]

Floats = NDArray[np.float64]
AxesArray = NDArray[np.object_]

PALETTE: Mapping[str, str] = {
    "tip": "#0072B2",
    "tangential": "#D55E00",
    "change": "#000000",
    "none": "#8C8C8C",
    "sample": "#9A9A9A",
    "object": "#EFEFEF",
    "band": "#9CCBE8",
    "median": "#0072B2",
    "gap": "#F0E442",
}
"""Colours after Okabe and Ito, told apart with any colour vision."""

_CHAINS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_PHASES = {"tip": "tip contact", "tangential": "tangential contact"}
_CONTACT_MARKERS = {"tip": "o", "tangential": "s"}
_LINES = {"forward": "-", "backward": "--"}
_SAMPLES = {"forward": "o", "backward": "^"}

_LABELS = {
    "drive_angle": r"drive angle $\varphi_0$",
    "holding_moment": "holding moment $m_0$",
    "force_x": r"force $f_{\mathrm{A}x}$",
    "force_y": r"force $f_{\mathrm{A}y}$",
    "contact_x": "$x$",
    "contact_y": "$y$",
}
_DIMENSIONLESS = {"length_unit": "$L$", "moment_unit": "$EI$/$L$", "force_unit": "$EI$/$L^2$"}
_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n"}

_MOST_DRAWS = 2000
_INTERVAL = 0.95
_REGIONS = (0.95, 0.5)


def observables(
    record: xr.Dataset, *, events: Mapping[str, SweepEvents] | None = None, axes: Sequence[Axes] | None = None
) -> AxesArray:
    """Holding moment and support reaction over the drive angle, like Figures 3 to 6 of Merker et al. 2018.

    Doi 10.1155/2018/1613945. A record without noise, as `scan` gives it, is drawn as lines coloured by contact phase;
    any other as points, with its truth, where it has one, as thin lines.

    Parameters
    ----------
    record : xr.Dataset
        A record.
    events : mapping of str to SweepEvents, optional
        By direction, as a scan has them; first contact, phase changes and snap-off are marked.
    axes : sequence of 3 Axes, optional
        One for each of holding_moment, force_x and force_y.

    Returns
    -------
    ndarray of Axes, shape (3,)
        Drive angles are in degrees.

    Raises
    ------
    ParameterError
        If there are not three axes.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> result = scan(paper_profile("II", q=0.5))
    >>> axes = observables(result.record, events=result.events)
    >>> axes[-1].get_xlabel()
    'drive angle $\\\\varphi_0$ [°]'
    """
    panels, own = _panels(axes)
    _draw_observables(panels, record, events, with_truth=True)
    _finish_panels(panels, own)
    return panels


def predictive(
    record: xr.Dataset, predicted: xr.Dataset, *, axes: Sequence[Axes] | None = None, label: str = "predicted"
) -> AxesArray:
    """Measured observables over their posterior predictive interval.

    Parameters
    ----------
    record : xr.Dataset
        A record.
    predicted : xr.Dataset
        Over "sample" as the record: for a channel, say force_x, the interval is force_x_lower to force_x_upper, in the
        units of the record. Channels without an interval are drawn without.
    axes : sequence of 3 Axes, optional
        One for each of holding_moment, force_x and force_y.
    label : str
        What the interval is called in the legend.

    Returns
    -------
    ndarray of Axes, shape (3,)
        Drive angles are in degrees.

    Raises
    ------
    ParameterError
        If there are not three axes, or `predicted` has not the samples of the record.
    """
    if predicted.sizes.get("sample") != record.sizes["sample"]:
        raise ParameterError(
            f"predicted has {predicted.sizes.get('sample', 'no')} samples and the record {record.sizes['sample']}: "
            "give the prediction for every sample of this record"
        )
    panels, own = _panels(axes)
    _draw_observables(panels, record, None, with_truth=False)
    for panel, channel in zip(panels, CHANNELS, strict=True):
        if f"{channel}_lower" not in predicted or np.isnan(record[channel].values).all():
            continue
        for number in np.unique(record["sweep"].values):
            of_sweep = record["sweep"].values == number
            angle = _degrees(record["drive_angle"].values[of_sweep])
            order = np.argsort(angle, kind="stable")
            lower, upper = (predicted[f"{channel}_{end}"].values[of_sweep][order] for end in ("lower", "upper"))
            style = {"color": PALETTE["band"], "linewidth": 0.5, "zorder": 0.5, "label": label}
            panel.fill_between(angle[order], lower, upper, **style)
    _finish_panels(panels, own)
    return panels


def rods(
    scan: Scan, *, direction: Literal["forward", "backward"] = "forward", count: int = 15, ax: Axes | None = None
) -> Axes:
    """Deformed rods along a sweep, coloured by contact phase, like Figures 7 to 10 of Merker et al. 2018.

    Doi 10.1155/2018/1613945.

    Parameters
    ----------
    scan : Scan
        A scan.
    direction : {"forward", "backward"}
        Which sweep.
    count : int
        How many of its states are drawn at most, evenly over the samples in contact; first contact, phase changes and
        snap-off come on top.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If the scan has no sweep in this direction, or the count is not positive.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> rods(scan(paper_profile("I", q=0.4)), direction="backward").get_xlabel()
    '$x$ [$L$]'
    """
    if direction not in scan.events:
        raise ParameterError(f"the scan has no {direction} sweep: choose from {', '.join(scan.events)}")
    if count < 1:
        raise ParameterError(f"count is {count!r}: at least one rod must be drawn")
    record, events, rod = scan.record, scan.events[direction], rod_of(scan.record)
    in_contact = (record["direction"].values == direction) & (record["truth_contact_phase"].values != "none")
    samples = np.flatnonzero(in_contact)
    samples = (
        samples[np.unique(np.linspace(0, samples.size - 1, count).round().astype(int))] if samples.size else samples
    )
    base = np.array([record[f"base_{axis}"].values[record["direction"].values == direction][0] for axis in "xy"])

    def shape(state: Mapping[str, Any]) -> tuple[Floats, Floats]:
        x, y = rod_shape(
            state["drive_angle"],
            state["holding_moment"] / rod.moment_unit,
            state["force_x"] / rod.force_unit,
            state["force_y"] / rod.force_unit,
            side=1 if direction == "forward" else -1,
        )
        return base[0] + rod.length_unit * x, base[1] + rod.length_unit * y

    own = ax is None
    ax = _axes() if ax is None else ax
    wrench = ("drive_angle", *CHANNELS)
    names = {name: f"truth_{name}" if f"truth_{name}" in record else name for name in wrench}
    phases = record["truth_contact_phase"].values[samples]
    x, y = shape({name: record[column].values[samples] for name, column in names.items()})
    for phase, label in _PHASES.items():
        chosen = phases == phase
        if chosen.any():
            ax.plot(x[chosen].T, y[chosen].T, color=PALETTE[phase], linewidth=0.9, label=label)
            at = samples[chosen]
            ax.plot(
                record["truth_contact_x"].values[at],
                record["truth_contact_y"].values[at],
                linestyle="none",
                marker=_CONTACT_MARKERS[phase],
                markersize=3.0,
                color=PALETTE[phase],
                zorder=3,
            )
    marked: list[tuple[Event, str, str]] = [
        (events.first_contact, "first contact", ":"),
        *((event, "phase change", "-") for event in events.transitions),
        (events.snap_off, "snap-off", "--"),
    ]
    extent = [x, y]
    for event, label, style in marked:
        x, y = shape(vars(event))
        extent = [np.append(a, b) for a, b in zip(extent, (x, y), strict=True)]
        ax.plot(x, y, color=PALETTE["change"], linestyle=style, linewidth=1.4, zorder=2.5, label=label)
        ax.plot(event.contact_x, event.contact_y, "o", color=PALETTE["change"], markersize=4.0, zorder=3.5)
    _draw_pivot(ax, (base[0], base[1]))
    room = 0.05 * rod.length_unit
    box = np.array([[e.min() - room, e.max() + room] for e in extent])
    ax.update_datalim(box.T)
    ax.margins(0.0)
    _draw_object(ax, scan.contour, (box[0, 0], box[0, 1]), box[1, 1])
    _finish_map(ax, own, record["base_x"].attrs)
    return ax


def contour(
    x: ArrayLike,
    *,
    truth: Contour | None = None,
    contacts: xr.Dataset | None = None,
    band: xr.Dataset | None = None,
    gap: tuple[float, float] | None = None,
    base: tuple[float, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """The contour as it was found: contact points, band and gap, with the true contour where it is known.

    Parameters
    ----------
    x : array_like
        The range drawn, from its least to its greatest value, in the unit of the record.
    truth : Contour, optional
        The true contour.
    contacts : xr.Dataset, optional
        Over "sample": contact_x, contact_y, and where present contact_phase, which colours the points, and status, of
        which only "ok" is drawn.
    band : xr.Dataset, optional
        Over coordinate "x": lower, upper and median, with the probability of the band as attribute.
    gap : (float, float), optional
        x of the contacts between which nothing was touched; if the first is the greater one, they overlap.
    base : (float, float), optional
        The pivot.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If `x` is no range.

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> contour([-0.6, 0.6], truth=paper_profile("II", q=0.5), gap=(-0.1, 0.1), base=(0.0, 0.0)).get_ylabel()
    '$y$ [$L$]'
    """
    drawn = np.asarray(x, dtype=float)
    if not (drawn.size >= 2 and np.all(np.isfinite(drawn)) and np.ptp(drawn) > 0.0):
        raise ParameterError("x must span the range to be drawn: at least two different finite numbers")
    low, high = float(drawn.min()), float(drawn.max())
    own = ax is None
    ax = _axes() if ax is None else ax

    if gap is not None:
        _draw_gap(ax, (float(gap[0]), float(gap[1])))
    attrs: Mapping[Any, Any] = {}
    if band is not None:
        attrs = band["lower"].attrs or band["x"].attrs
        slack = 1e-9 * (high - low)
        inside = band.isel(x=np.flatnonzero((band["x"].values >= low - slack) & (band["x"].values <= high + slack)))
        probability = band.attrs.get("probability")
        label = "band" if probability is None else f"{100.0 * float(probability):.6g} % band"
        lower, upper = inside["lower"].values, inside["upper"].values
        ax.fill_between(inside["x"].values, lower, upper, color=PALETTE["band"], linewidth=0.5, zorder=1.5, label=label)
        if "median" in inside:
            ax.plot(inside["x"].values, inside["median"].values, color=PALETTE["median"], linewidth=1.0, label="median")
    if truth is not None:
        ax.plot(
            *_outline(truth, low, high), color=PALETTE["change"], linewidth=1.0, linestyle="--", label="true contour"
        )
    if contacts is not None:
        attrs = contacts["contact_x"].attrs or attrs
        _draw_contacts(ax, contacts, low, high)
    if base is not None:
        _draw_pivot(ax, base)
    margin = 0.03 * (high - low)
    ax.set_xlim(low - margin, high + margin)
    _finish_map(ax, own, attrs)
    return ax


def trace(posterior: xr.DataTree | xr.Dataset, *, names: Sequence[str] | None = None, axes: Any = None) -> AxesArray:
    """Draws of each chain, and their density chain by chain: chains that agree look alike.

    Parameters
    ----------
    posterior : xr.DataTree or xr.Dataset
        Group "posterior" of a tree, or that dataset: variables over "chain" and "draw".
    names : sequence of str, optional
        Which variables; by default all.
    axes : array_like of Axes, shape (parameters, 2), optional
        One row for each parameter; a variable with further dimensions is one parameter for each of its elements.

    Returns
    -------
    ndarray of Axes, shape (parameters, 2)
        Left the draws in their order, thinned to at most 2000 a chain; right a histogram for each chain.

    Raises
    ------
    ParameterError
        If a name is unknown, or the axes have another shape.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> posterior = xr.Dataset({"q": (("chain", "draw"), rng.normal(0.5, 0.01, (4, 500)))})
    >>> trace(posterior).shape
    (1, 2)
    """
    parameters = _parameters(posterior, names)
    grid = _grid(axes, (len(parameters), 2), (7.0, 0.5 + 1.2 * len(parameters)), width_ratios=(2.0, 1.0))
    for (left, right), parameter in zip(grid, parameters, strict=True):
        edges = np.linspace(*_core(parameter.draws), 41)
        for number, draws in enumerate(parameter.draws):
            colour = _CHAINS[number % len(_CHAINS)]
            step = -(-draws.size // _MOST_DRAWS)
            drawn = np.arange(0, draws.size, step)
            left.plot(drawn, draws[drawn], color=colour, linewidth=0.4, alpha=0.7)
            density = np.histogram(draws[np.isfinite(draws)], edges, density=True)[0]
            right.stairs(density, edges, color=colour, linewidth=1.0, label=f"chain {number}")
        left.margins(x=0.01)
        right.set_ylim(bottom=0.0)
        right.set_yticks([])
        right.set_xlim(_view(parameter))
        _label_parameter(left.yaxis, parameter, 4)
        _label_parameter(right.xaxis, parameter, 3, lines=False)
        if left is not grid[-1, 0]:
            left.tick_params(labelbottom=False)
    grid[-1, 0].set_xlabel("draw")
    if axes is None:
        grid[0, 0].figure.align_ylabels(list(grid[:, 0]))
    return grid


def pairs(
    posterior: xr.DataTree | xr.Dataset,
    *,
    names: Sequence[str] | None = None,
    truth: Mapping[str, float] | None = None,
    axes: Any = None,
) -> AxesArray:
    """Marginals of the posterior, one by one and in pairs.

    On the diagonal a histogram, its central 95 % interval dark; below it the regions of highest density that hold 50 %
    and 95 % of the draws, from a histogram smoothed by one bin.

    Parameters
    ----------
    posterior : xr.DataTree or xr.Dataset
        Group "posterior" of a tree, or that dataset: variables over "chain" and "draw".
    names : sequence of str, optional
        Which variables; by default all.
    truth : mapping of str to float, optional
        True values, by name of the parameter; drawn as dashed lines.
    axes : array_like of Axes, shape (parameters, parameters), optional
        A variable with further dimensions is one parameter for each of its elements.

    Returns
    -------
    ndarray of Axes, shape (parameters, parameters)
        Those above the diagonal are switched off.

    Raises
    ------
    ParameterError
        If a name is unknown, or the axes have another shape.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> draws = {name: (("chain", "draw"), rng.normal(0.5, 0.01, (4, 500))) for name in ("a", "q")}
    >>> pairs(xr.Dataset(draws), truth={"a": 0.5}).shape
    (2, 2)
    """
    parameters = _parameters(posterior, names)
    truth = truth or {}
    unknown = set(truth) - {parameter.name for parameter in parameters}
    if unknown and names is None:
        raise ParameterError(
            f"truth names {', '.join(sorted(unknown))}, and the parameters are {', '.join(p.name for p in parameters)}"
        )
    size = len(parameters)
    side = max(2.6, min(7.0, 1.75 * size), 1.15 * size)
    grid = _grid(axes, (size, size), (side, side))
    limits = [_view(p, truth.get(p.name)) for p in parameters]
    for row, column in np.ndindex(size, size):
        ax: Axes = grid.item(row, column)
        if column > row:
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
                ax.axhline(truth[parameters[row].name], color=PALETTE["change"], linestyle="--", linewidth=0.9)
        ax.set_xlim(limits[column])
        _label_parameter(ax.xaxis, across, 3)
        if across.name in truth:
            ax.axvline(truth[across.name], color=PALETTE["change"], linestyle="--", linewidth=0.9)
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


# Axes, labels, legends


def _axes() -> Axes:
    from matplotlib import pyplot as plt

    return plt.subplots(figsize=(7.0, 4.0), layout="compressed")[1]


def _panels(axes: Sequence[Axes] | None) -> tuple[AxesArray, bool]:
    from matplotlib import pyplot as plt

    if axes is None:
        _, panels = plt.subplots(3, 1, sharex=True, figsize=(7.0, 5.4), layout="constrained")
        return panels, True
    panels = np.asarray(axes, dtype=object)
    if panels.shape != (3,):
        raise ParameterError(f"axes have shape {panels.shape}: give three, for {', '.join(CHANNELS)}")
    return panels, False


def _grid(axes: Any, shape: tuple[int, int], figsize: tuple[float, float], **gridspec: Any) -> AxesArray:
    from matplotlib import pyplot as plt

    if axes is None:
        return plt.subplots(*shape, figsize=figsize, layout="constrained", squeeze=False, gridspec_kw=gridspec)[1]
    grid = np.asarray(axes, dtype=object)
    if grid.shape != shape:
        raise ParameterError(f"axes have shape {grid.shape}, and {shape} is wanted: rows are parameters")
    return grid


def _finish_panels(panels: AxesArray, own: bool) -> None:
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    bottom = panels[-1]
    bottom.set_xlabel(f"{_LABELS['drive_angle']} [°]")
    span = np.ptp(bottom.get_xlim())
    if 60.0 < span < 400.0:
        bottom.xaxis.set_major_locator(MultipleLocator(15.0 if span < 150.0 else 30.0))
    for panel in panels:
        if len(panel.get_yticks()):
            panel.yaxis.set_major_locator(MaxNLocator(4))
    if own:
        bottom.figure.align_ylabels(list(panels))
        for panel in panels[:-1]:
            panel.tick_params(labelbottom=False)
    found = {label: handle for panel in panels for handle, label in zip(*_handles(panel), strict=True)}
    labelled = {label: found[label] for label in sorted(found, key=_legend_order)}
    if labelled:
        panels[0].legend(
            list(labelled.values()),
            list(labelled),
            loc="lower center",
            bbox_to_anchor=(0.5, 1.0),
            ncols=min(4, len(labelled)),
            fontsize="small",
            frameon=False,
        )


def _finish_map(ax: Axes, own: bool, attrs: Mapping[Any, Any]) -> None:
    """Equal scales, labels, and a legend beside or above the data, whichever leaves them larger."""
    ax.set_aspect("equal", adjustable="box")
    ax.autoscale_view()
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    limits = np.array([left, right, bottom, top])
    _set_unit(ax.xaxis, _LABELS["contact_x"] + " ", "contact_x", attrs, limits)
    _set_unit(ax.yaxis, _LABELS["contact_y"] + " ", "contact_y", attrs, limits)
    handles, labels = _handles(ax)
    if not labels:
        return
    beside = (right - left) < 1.6 * (top - bottom)
    place: dict[str, Any] = (
        {"loc": "center left", "bbox_to_anchor": (1.01, 0.5)}
        if beside
        else {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": min(4, len(labels))}
    )
    ax.legend(handles, labels, fontsize="small", frameon=False, **place)


def _legend_entry(ax: Axes, label: str, **style: Any) -> None:
    """An entry of the legend for a style that is shared by many lines."""
    ax.plot([], [], label=label, **style)


def _handles(ax: Axes) -> tuple[list[Any], list[str]]:
    """Handles and labels of a legend, each label once."""
    unique = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    return list(unique.values()), list(unique)


def _set_unit(axis: Axis, label: str, name: str, attrs: Mapping[Any, Any], values: Floats) -> None:
    """Label of an axis with its unit, and in SI tick labels in the fitting multiple of it."""
    from matplotlib.ticker import FuncFormatter

    unit = str(attrs.get("units", "1"))
    column = COLUMNS[name]
    if unit == "1":
        axis.set_label_text(f"{label}[{_DIMENSIONLESS[column.scale]}]" if column.scale else label.strip())
        return
    power = _power(values) if unit == column.unit else 0
    axis.set_label_text(f"{label}[{_PREFIXES[power]}{unit}]")
    if power:
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / 10.0**power:.6g}".replace("-", "−")))


def _power(values: Floats) -> int:
    largest = np.max(np.abs(values), initial=0.0, where=np.isfinite(values))
    return int(np.clip(3 * np.floor(np.log10(largest) / 3), -9, 0)) if largest > 0.0 else 0


def _label_parameter(axis: Axis, parameter: _Parameter, most_ticks: int, *, lines: bool = True) -> None:
    """Label and ticks of an axis; where values are small or large, in a power of ten that the label names."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator, ScalarFormatter

    largest = np.max(np.abs(_core(parameter.draws)))
    power = int(3 * np.floor(np.log10(largest) / 3)) if largest > 0.0 else 0
    power = power if largest < 2e-3 or largest >= 1e4 else 0
    unit = " ".join(part for part in (f"$10^{{{power}}}$" if power else "", parameter.unit) if part)
    label = parameter.label + (f" [{unit}]" if unit else "")
    if lines:
        label = parameter.label.replace(" ", "\n") + (f"\n[{unit}]" if unit else "")
    axis.set_label_text(label)
    axis.set_major_locator(MaxNLocator(most_ticks, min_n_ticks=2))
    axis.set_major_formatter(
        FuncFormatter(lambda value, _: f"{value / 10.0**power:.10g}".replace("-", "−"))
        if power
        else ScalarFormatter(useOffset=False)
    )


def _degrees(angle: ArrayLike) -> Floats:
    return np.degrees(np.asarray(angle, dtype=float))


# Observables


def _legend_order(label: str) -> int:
    """Directions, then phases, then the rest in the order of the sweep."""
    words = ("forward", "backward", "tip contact", "tangential contact", "truth", "first", "change", "snap")
    return next((i for i, word in enumerate(words) if word in label), len(words))


def _draw_observables(
    panels: AxesArray, record: xr.Dataset, events: Mapping[str, SweepEvents] | None, *, with_truth: bool
) -> None:
    for panel, channel in zip(panels, CHANNELS, strict=True):
        if np.isnan(record[channel].values).all():
            _not_measured(panel, channel)
            continue
        panel.axhline(0.0, color="0.85", linewidth=0.8, zorder=0)
        for sweep in _sweeps(record):
            direction = str(sweep["direction"].values[0])
            of_sweep = events.get(direction) if events is not None else None
            if _is_exact(sweep, channel):
                _draw_line(panel, sweep, channel, channel, of_sweep, linewidth=1.6)
                _legend_entry(panel, direction, color="0.35", linestyle=_LINES[direction], linewidth=1.6)
            else:
                style = {"marker": _SAMPLES[direction], "markersize": 2.6, "color": PALETTE["sample"]}
                style |= {"linestyle": "none", "markerfacecolor": "none", "markeredgewidth": 0.6}
                panel.plot(_degrees(sweep["drive_angle"].values), sweep[channel].values, **style)
                _legend_entry(panel, f"measured {direction}", **style)
                if with_truth and f"truth_{channel}" in sweep:
                    _draw_line(panel, sweep, f"truth_{channel}", channel, of_sweep, linewidth=1.0)
            if of_sweep is not None:
                _draw_events(panel, of_sweep, channel)
        values = record[channel].values
        _set_unit(panel.yaxis, f"{_LABELS[channel]}\n", channel, record[channel].attrs, values)


def _sweeps(record: xr.Dataset) -> Iterator[xr.Dataset]:
    for number in np.unique(record["sweep"].values):
        yield record.isel(sample=np.flatnonzero(record["sweep"].values == number))


def _is_exact(sweep: xr.Dataset, channel: str) -> bool:
    """Whether a channel is that of a scan, or of a load cell without noise."""
    if "truth_contact_phase" not in sweep:
        return False
    truth = f"truth_{channel}"
    return truth not in sweep or bool(np.array_equal(sweep[truth].values, sweep[channel].values))


def _draw_line(
    ax: Axes, sweep: xr.Dataset, column: str, channel: str, events: SweepEvents | None, *, linewidth: float
) -> None:
    """A channel without noise, coloured by phase, and complete up to the events."""
    angle_column = "truth_drive_angle" if "truth_drive_angle" in sweep else "drive_angle"
    angle, value = sweep[angle_column].values, sweep[column].values
    direction = str(sweep["direction"].values[0])
    style: dict[str, Any] = {"linestyle": _LINES[direction], "linewidth": linewidth, "zorder": 2.5}
    phase = sweep["truth_contact_phase"].values.astype(object) if "truth_contact_phase" in sweep else None
    if phase is None:
        ax.plot(_degrees(angle), value, color=PALETTE["change"], **style)
        _legend_entry(ax, "truth", color=PALETTE["change"], linewidth=linewidth)
        return
    if events is not None:
        marked = [events.first_contact, *events.transitions, events.snap_off]
        following = [event.kind.split(" → ")[-1] for event in marked[:-1]]
        angle = np.append(angle, [event.drive_angle for event in marked])
        value = np.append(value, [getattr(event, channel) for event in marked])
        phase = np.append(phase, [*following, following[-1]])
        order = np.argsort(angle if direction == "forward" else -angle, kind="stable")
        angle, value, phase = angle[order], value[order], phase[order]
    starts = np.flatnonzero(np.append(True, phase[1:] != phase[:-1]))
    for start, stop in zip(starts, np.append(starts[1:], phase.size), strict=True):
        # A run goes on to the first state of the next one, unless the rod has let go in between.
        joined = stop < phase.size and (phase[stop] != "none")
        run = slice(start, stop + 1 if joined else stop)
        name = str(phase[start])
        ax.plot(_degrees(angle[run]), value[run], color=PALETTE[name], **style)
        if name in _PHASES:
            prefix = "true " if column != channel else ""
            _legend_entry(ax, prefix + _PHASES[name], color=PALETTE[name], linewidth=linewidth)


def _draw_events(ax: Axes, events: SweepEvents, channel: str) -> None:
    styles: list[tuple[tuple[Event, ...], str, dict[str, Any]]] = [
        ((events.first_contact,), "first contact", {"marker": "o", "markerfacecolor": "white", "markersize": 4.5}),
        (events.transitions, "phase change", {"marker": "D", "markersize": 4.0}),
        ((events.snap_off,), "snap-off", {"marker": "X", "markersize": 7.0, "markeredgecolor": "white"}),
    ]
    for marked, label, style in styles:
        if marked:
            angles = _degrees([event.drive_angle for event in marked])
            values = [getattr(event, channel) for event in marked]
            ax.plot(angles, values, color=PALETTE["change"], linestyle="none", zorder=4, label=label, **style)


def _not_measured(ax: Axes, channel: str) -> None:
    ax.text(0.5, 0.5, "not measured", transform=ax.transAxes, ha="center", va="center", color=PALETTE["none"])
    ax.set_yticks([])
    ax.set_ylabel(f"{_LABELS[channel]}\n")


# Maps: what lies in the plane of object and rod


def _outline(contour: Contour, low: float, high: float) -> tuple[Floats, Floats]:
    """Points of a contour between two values of x, closest where it may be upright."""
    ends = [float(np.asarray(contour.locate(end).x)) if np.isfinite(end) else float(end) for end in contour.domain]
    low, high = max(low, ends[0]), min(high, ends[1])
    x = low + 0.5 * (high - low) * (1.0 - np.cos(np.linspace(0.0, np.pi, 801)))
    return x, np.asarray(contour.height(x))


def _draw_object(ax: Axes, contour: Contour, across: tuple[float, float], top: float) -> None:
    x, y = _outline(contour, *across)
    shown = y <= top
    ax.fill_between(x, y, top, where=shown, color=PALETTE["object"], linewidth=0.0, zorder=0)
    ax.plot(np.where(shown, x, np.nan), y, color="0.35", linewidth=1.6, zorder=1.2, label="contour")


def _draw_pivot(ax: Axes, base: tuple[float, float]) -> None:
    ax.plot(
        *base,
        linestyle="none",
        marker="o",
        markersize=6.0,
        markerfacecolor="white",
        markeredgecolor="black",
        markeredgewidth=1.2,
        zorder=5,
        label="pivot",
    )


def _draw_gap(ax: Axes, gap: tuple[float, float]) -> None:
    left, right = sorted(gap)
    overlap = gap[0] > gap[1]
    ax.axvspan(
        left,
        right,
        facecolor=PALETTE["gap"],
        alpha=0.25,
        edgecolor="0.5",
        linewidth=0.0,
        hatch=None if overlap else "///",
        zorder=0.5,
    )
    ax.text(
        0.5 * (left + right),
        0.98,
        "overlap" if overlap else "gap",
        transform=ax.get_xaxis_transform(),
        ha="center",
        va="top",
        fontsize="small",
        clip_on=True,
    )


def _draw_contacts(ax: Axes, contacts: xr.Dataset, low: float, high: float) -> None:
    x, y = contacts["contact_x"].values, contacts["contact_y"].values
    drawn = np.isfinite(x) & np.isfinite(y) & (x >= low) & (x <= high)
    if "status" in contacts:
        drawn &= contacts["status"].values == "ok"
    phase = contacts["contact_phase"].values if "contact_phase" in contacts else np.full(x.shape, "none")
    for name, label in (*_PHASES.items(), ("none", "contact")):
        chosen = drawn & (phase == name)
        if chosen.any():
            style: dict[str, Any] = {
                "color": PALETTE[name],
                "marker": _CONTACT_MARKERS.get(name, "o"),
                "linestyle": "none",
            }
            ax.plot(x[chosen], y[chosen], markersize=2.6, markeredgewidth=0.0, alpha=0.6, zorder=3, **style)
            _legend_entry(ax, label, markersize=4.0, **style)


# Posteriors


class _Parameter(NamedTuple):
    name: str
    label: str
    unit: str
    draws: Floats
    """Shape (chains, draws)."""


def _parameters(posterior: xr.DataTree | xr.Dataset, names: Sequence[str] | None) -> list[_Parameter]:
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
        unit = str(values.attrs.get("units", "1")).removeprefix("1")
        for index in np.ndindex(values.shape[2:]):
            inside = ", ".join(map(str, index))
            element, label = (f"{name}[{inside}]", f"{_symbol(name)}[{inside}]") if index else (name, _symbol(name))
            draws = np.asarray(values.values[(slice(None), slice(None), *index)], dtype=float)
            parameters.append(_Parameter(element, label, unit, draws))
    return parameters


def _symbol(name: str) -> str:
    """Short names are symbols, longer ones words."""
    if match := re.fullmatch(r"([A-Za-z])(?:_([A-Za-z0-9]{1,3}))?", name):
        letter, index = match.groups()
        return f"${letter}$" if index is None else rf"${letter}_{{\mathrm{{{index}}}}}$"
    return name.replace("_", " ")


def _core(draws: Floats) -> tuple[float, float]:
    """Where the draws are, but for one in a thousand on either side."""
    finite = draws[np.isfinite(draws)]
    if not finite.size:
        return 0.0, 1.0
    low, high = (float(q) for q in np.quantile(finite, [0.001, 0.999]))
    if high > low:
        return low, high
    room = 0.05 * abs(low) or 0.5
    return low - room, high + room


def _view(parameter: _Parameter, truth: float | None = None) -> tuple[float, float]:
    """The same with the truth and some room."""
    low, high = _core(parameter.draws)
    if truth is not None:
        low, high = min(low, truth), max(high, truth)
    room = 0.08 * (high - low)
    return low - room, high + room


def _bins(draws: Floats, most: int) -> int:
    return int(np.clip(2.0 * draws.size ** (1 / 3), 10, most))


def _draw_marginal(ax: Axes, draws: Floats) -> None:
    density, edges = np.histogram(draws[np.isfinite(draws)], _bins(draws, 40), _core(draws))
    ends = np.nanquantile(draws, [0.5 - 0.5 * _INTERVAL, 0.5 + 0.5 * _INTERVAL])
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
    # A rim of zeros closes the regions where the draws end, at a wall too.
    at = [np.concatenate([e[:1], 0.5 * (e[1:] + e[:-1]), e[-1:]]) for e in edges]
    rimmed = np.pad(density, 1).T
    colours = [PALETTE["band"], PALETTE["median"]]
    ax.contourf(*at, rimmed, levels=[*levels, 1.01 * density.max()], colors=colours, alpha=0.6)
    ax.contour(*at, rimmed, levels=levels, colors=PALETTE["median"], linewidths=0.8)


def _highest_density(density: Floats, probabilities: Sequence[float]) -> list[float]:
    """Levels above which a density holds given probabilities, from the greatest probability to the least."""
    falling = np.sort(density, axis=None)[::-1]
    mass = np.cumsum(falling) / falling.sum()
    levels = [float(falling[min(int(np.searchsorted(mass, p)), falling.size - 1)]) for p in sorted(probabilities)]
    for i in range(1, len(levels)):
        levels[i] = min(levels[i], levels[i - 1] * (1.0 - 1e-6))
    return levels[::-1]
