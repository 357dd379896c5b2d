"""The page of a watch: the band so far, in one file that loads itself again."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import xarray as xr

from tactile_bayes.errors import TactileBayesError
from tactile_bayes.inference.experiment import contact_points
from tactile_bayes.inference.result import record_of
from tactile_bayes.report.contour_figure import ContourFindings, contour_figure
from tactile_bayes.report.meanings import is_direction
from tactile_bayes.report.page import parameter_cells
from tactile_bayes.report.wording import PageTable, percent
from tactile_bayes.report.writing import rendered
from tactile_bayes.tasks import write_atomically
from tactile_bayes.uncertainty.summary import gap_if_any


def write_watch_page(
    posterior: xr.DataTree,
    numbers: xr.Dataset,
    band: xr.Dataset | None,
    path: Path,
    *,
    headline: str,
    sentences: Sequence[str],
    is_well: bool,
    refresh: int | None,
) -> None:
    """Write the page of a record so far, which needs no network and no other file."""
    family, probability = str(posterior.attrs["family"]), float(numbers.attrs["probability"])
    contour = None
    if band is not None:
        record, contacts, edges = record_of(posterior), None, None
        with suppress(TactileBayesError):  # as long as too little is known of the rig
            contacts = contact_points(record, posterior)
        with suppress(TactileBayesError):
            edges = gap_if_any(posterior, probability)
        contour = contour_figure(ContourFindings(posterior, record, contacts, band, edges, probability, None, None))
    names = [name for name in numbers["quantity"].values if not is_direction(name)]
    rows = [parameter_cells(numbers.sel(quantity=name), family) for name in names]
    heads = ["quantity", "meaning", "unit", "estimate", f"{percent(probability)} from", "to"]
    text = rendered(
        "watch.html.jinja",
        name=str(posterior.attrs["record_file"]),
        headline=headline,
        sentences=sentences,
        refresh=refresh,
        is_well=is_well,
        contour=contour,
        parameters=PageTable("Estimates are medians, intervals central", heads, rows, 3),
    )
    with write_atomically(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
