"""The page of several runs: their results side by side, and their contours and bands over each other."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

import numpy as np
import xarray as xr
from markupsafe import Markup

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.families import family_named
from tactile_bayes.diagnostics.result_check import check, probability_of
from tactile_bayes.errors import InferenceError, ParameterError, TactileBayesError
from tactile_bayes.inference.experiment import contact_points
from tactile_bayes.inference.result import record_of
from tactile_bayes.plotting.maps import contacts_within
from tactile_bayes.record.netcdf import read_netcdf
from tactile_bayes.report.drawing import Plot, dots, figure, legend
from tactile_bayes.report.findings import contour_posterior
from tactile_bayes.report.overlay import DISTANCE_HEADS, Laid, distance_cells, note_of, put_overlay
from tactile_bayes.report.wording import PageTable, percent, rows_of, shown_as, spread
from tactile_bayes.runs.folder import posterior_in
from tactile_bayes.runs.names import MANY
from tactile_bayes.uncertainty.band import contour_band
from tactile_bayes.uncertainty.overlay import Overlay, overlay_distance, read_overlay
from tactile_bayes.uncertainty.rod_reach import reach
from tactile_bayes.uncertainty.summary import gap_if_any, summary

_TABLE = MANY[1]
_COLOURS = 6  # number of colours; of more runs, each has a panel of its own
_PARTS = ("lower", "median", "upper")
_HEIGHT = 260.0


@dataclass(frozen=True)
class _Found:
    """Results of a run."""

    posterior: xr.DataTree
    band: xr.Dataset
    contacts: xr.Dataset | None
    numbers: xr.Dataset
    verdict: str

    @classmethod
    def of(cls, folder: Path) -> _Found:
        """Return the results in a folder."""
        posterior = contour_posterior(posterior_in(folder))
        probability = probability_of(posterior)
        contacts = contact_points(record_of(posterior), posterior)
        return cls(
            posterior,
            contour_band(posterior, reach(posterior), probability),
            contacts,
            summary(posterior, probability, gap_if_any(posterior, probability)),
            check(posterior, contacts).messages[0],
        )

    @property
    def shown(self) -> list[tuple[str, str]]:
        """Names and units of the contour's parameters, and of the gap."""
        family = family_named(self.posterior.attrs["family"])
        names = [name for name in (*family.parameters, "gap width") if name not in family.roughness]
        return [
            (name, str(self.numbers["unit"].sel(quantity=name).values))
            for name in names
            if name in self.numbers["quantity"].values
        ]


def folders_of(runs: Sequence[Path]) -> dict[Path, str]:
    """Return the folders of runs, each with the reason of a record that failed, else ""; of a folder of runs all."""
    found: dict[Path, str] = {}
    for run in runs:
        if (run / "posterior.nc").is_file():
            found[run] = ""
        elif (run / _TABLE).is_file():
            table = read_netcdf(run / _TABLE, xr.open_dataset, lambda what: InferenceError(f"{what}: infer again"))
            found |= {run / name: error for name, error in rows_of(table, "record", "error")}
        elif inside := sorted(path.parent for path in run.glob("*/posterior.nc")):
            found |= dict.fromkeys(inside, "")
        else:
            posterior_in(run)  # which says what is wrong
    return found


def runs_page_of(
    runs: Mapping[Path, str], out: Path, name: str, overlay: Path | None, progress: Callable[[int], object]
) -> tuple[dict[str, Any], Laid]:
    """Return the values of the template's variables, and the distances from the overlay."""
    names, errors, found = _names(list(runs)), dict(runs), dict[Path, _Found]()
    for count, (folder, error) in enumerate(runs.items(), start=1):
        try:
            if not error:
                found[folder] = _Found.of(folder)
        except TactileBayesError as raised:
            errors[folder] = str(raised)
        progress(count)
    if not found:
        raise InferenceError(f"no run has a result: {next(iter(errors.values()))}")
    first, *others = found.values()
    if any(each.posterior.attrs["units"] != first.posterior.attrs["units"] for each in others):
        raise InferenceError("some runs are in SI and some in rod lengths: report on them one by one")
    bands = {names[folder]: each.band for folder, each in found.items()}
    other = None if overlay is None else read_overlay(overlay, first.posterior, probability_of(first.posterior))
    reference = other or _reference(bands)
    contacts = {names[folder]: each.contacts for folder, each in found.items() if each.contacts is not None}
    shares = dict.fromkeys(percent(probability_of(each.posterior)) for each in found.values())
    failed = len(runs) - len(found)
    values = {
        "name": name,
        "count": f"{len(runs)} runs" + (f", {failed} of them without a result" if failed else ""),
        "share": " or ".join(shares),
        "dimensionless": first.posterior.attrs["units"] == "dimensionless",
        "figure": runs_figure(bands, contacts, other, reference),
        "notes": [] if other is None else note_of(other, first.band),
        "table": _table(names, errors, found, out, reference),
    }
    return values, Laid("", {}) if other is None else Laid.over(bands, other)


def _reference(bands: Mapping[str, xr.Dataset]) -> Overlay:
    """Return the contour of the first run that has a band."""
    for name, band in bands.items():
        with suppress(InferenceError):
            return Overlay.of_band(name, band)
    raise InferenceError("no run has a band to be drawn: report on them one by one")


def _names(folders: Sequence[Path]) -> dict[Path, str]:
    """Return the name of each folder, with that of its parent where several have the same."""
    own = Counter(folder.resolve().name for folder in folders)
    named = {path: path.resolve() for path in folders}
    names = {path: at.name if own[at.name] == 1 else f"{at.parent.name}/{at.name}" for path, at in named.items()}
    if len(set(names.values())) < len(names):
        raise ParameterError("two of the runs are the same, or are called so: give each once")
    return names


def _table(
    names: Mapping[Path, str], errors: Mapping[Path, str], found: Mapping[Path, _Found], out: Path, reference: Overlay
) -> PageTable:
    """Return a row for each run, of one that failed with the reason."""
    columns = list(dict.fromkeys(column for each in found.values() for column in each.shown))
    widths = {path: each.band["upper"].values - each.band["lower"].values for path, each in found.items()}
    width = {path: float(np.nanmedian(each)) if np.isfinite(each).any() else np.nan for path, each in widths.items()}
    away = {path: overlay_distance(each.band, reference) for path, each in found.items()}
    attrs = next(iter(found.values())).band["x"].attrs
    fine = shown_as("contact_x", attrs, list(width.values()))
    near = shown_as("contact_x", attrs, [each.largest for each in away.values()])
    rows = []
    for path, name in names.items():
        link = Markup('<a href="{}">{}</a>').format(_address(path, out), name) if path.is_dir() else name
        each = found.get(path)
        if each is None:
            rows.append([link, errors[path], *["–"] * (len(columns) + 3 + len(DISTANCE_HEADS))])
            continue
        is_own = reference.band is each.band
        rows.append(
            [
                link,
                each.verdict,
                str(each.posterior.attrs["family"]),
                fine.text(width[path], 3),
                *(["–"] * len(DISTANCE_HEADS) if is_own else distance_cells(away[path], near)),
                *(_interval(each.numbers, *column) for column in columns),
                f"{float(each.posterior['sample_stats'].attrs['seconds']):.3g}",
            ]
        )
    heads = ["run", "verdict", "family", f"band{fine.bracketed}", *(h.format(near.bracketed) for h in DISTANCE_HEADS)]
    heads += [*(f"{name} [{unit}]" if unit != "1" else name for name, unit in columns), "sampling [s]"]
    caption = (
        "Estimates are medians with central intervals, widths of bands medians over x; distances are those of the "
        f"median contour from {reference.name}"
    )
    return PageTable(caption, heads, rows, 3)


def _interval(numbers: xr.Dataset, name: str, unit: str) -> str:
    """Return the median with its interval, if a run has this quantity in this unit."""
    if name not in numbers["quantity"].values or str(numbers["unit"].sel(quantity=name).values) != unit:
        return "–"
    row = numbers.sel(quantity=name)
    middle, low, high = (float(row[part]) for part in ("median", "lower", "upper"))
    texts = spread([middle, low, high], high - low)
    return Markup("{} <br>{} to {}").format(*texts)


def _address(folder: Path, out: Path) -> str:
    """Return the address of the run's own page, or else of its folder, from the page of several."""
    page = folder / "report.html"
    target = page if page.is_file() and page.resolve() != out.resolve() else folder
    try:
        way = os.path.relpath(target.resolve(), out.resolve().parent)
    except ValueError:  # on another drive of Windows
        return target.resolve().as_uri()
    return quote(Path(way).as_posix())


class RunsFigure(NamedTuple):
    """Drawings of several runs for a page."""

    map: Markup
    panels: list[tuple[str, Markup]]  # bands measured from the reference: of all runs, without a name, or of each
    legend: Markup
    reference: str


def runs_figure(
    bands: Mapping[str, xr.Dataset], contacts: Mapping[str, xr.Dataset], overlay: Overlay | None, reference: Overlay
) -> RunsFigure:
    """Draw the bands of runs over each other, and measured from a reference: the overlay, or one of the runs."""
    are_few = len(bands) <= _COLOURS
    colours = {name: f"run-{number if are_few else 0}" for number, name in enumerate(bands)}
    entries = [(f"key-run {colour}", name) for name, colour in colours.items()]
    if not are_few:
        entries = [("key-run run-0", "runs"), ("key-other", "other runs, in each panel")]
    x, median = (np.concatenate([band[part].values for band in bands.values()]) for part in ("x", "median"))
    attrs = next(iter(bands.values()))["x"].attrs
    unit = shown_as("contact_x", attrs, x)
    overview, height = Plot.map_of(x, median, unit)
    for name, band in bands.items():
        _put_band(overview, band["x"].values, [band[part].values for part in _PARTS], colours[name])
        if are_few and name in contacts:
            _put_contacts(overview, contacts[name], band["x"].values, colours[name])
    if overlay is not None:
        put_overlay(overview, overlay)
        entries.append(("key-overlay", overlay.name))

    offsets = {name: _offsets(band, reference) for name, band in bands.items()}
    places = np.concatenate([np.tile(band["x"].values, 3) for band in bands.values()])
    shown = np.concatenate([np.ravel(offsets[name]) for name in bands])
    fine = shown_as("contact_x", attrs, shown)
    labels = overview.x_label, f"y − {reference.name}{fine.bracketed}"
    panels = []
    for number, names in enumerate([list(bands)] if are_few else [[name] for name in bands]):
        plot = Plot.around(places, shown, labels, _HEIGHT, (unit.power, fine.power))
        for other in bands:
            if other not in names:
                plot.path(bands[other]["x"].values, offsets[other][1], "other")
        plot.path([plot.x.low, plot.x.high], [0.0, 0.0], "zero" if overlay is None else "overlay")
        for name in names:
            _put_band(plot, bands[name]["x"].values, offsets[name], colours[name])
        title = f"Bands of {', '.join(names)}, measured from {reference.name}"
        words = "The widths of the bands, and their distances from that contour, are in the table."
        drawing = figure(f"runs-{number}", title, words, _HEIGHT, *plot.drawn(f"runs-clip-{number}"))
        panels.append(("" if are_few else names[0], drawing))
    title, words = "Contours of the runs", f"Map of the contours of {', '.join(bands)} over each other."
    drawing = figure("runs-map", title, words, height, *overview.drawn("runs-map-clip"))
    return RunsFigure(drawing, panels, legend(entries), reference.name)


def _offsets(band: xr.Dataset, reference: Overlay) -> list[Floats]:
    """Return lower edge, median and upper edge of a band, measured from a reference."""
    base = reference.polyline.height(band["x"].values, band["median"].values)
    return [band[part].values - base for part in _PARTS]


def _put_band(plot: Plot, x: Floats, edges: Sequence[Floats], colour: str) -> None:
    plot.area(x, edges[0], edges[2], f"run-band {colour}")
    plot.path(x, edges[1], f"run-median {colour}")


def _put_contacts(plot: Plot, contacts: xr.Dataset, x: Floats, colour: str) -> None:
    good = contacts.isel(sample=contacts_within(contacts, x[0], x[-1]))
    at_x, at_y = plot.x(good["contact_x"].values), plot.y(good["contact_y"].values)
    plot.put(dots(at_x, at_y, 1.8, f"run-contact {colour}", square=False))
