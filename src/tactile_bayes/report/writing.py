"""Writing of pages: template, style and script in one file that loads nothing."""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr
from markupsafe import Markup

from tactile_bayes.checks import check_function, check_path
from tactile_bayes.errors import ParameterError, TactileBayesError
from tactile_bayes.inference.experiment import contact_points
from tactile_bayes.inference.result import record_of
from tactile_bayes.report.contour_figure import ContourFindings, contour_figure
from tactile_bayes.report.findings import FINDING_STEPS, findings_of
from tactile_bayes.report.overlay import Laid, draw_overlay
from tactile_bayes.report.page import page_of, parameter_cells
from tactile_bayes.report.runs_page import folders_of, runs_page_of
from tactile_bayes.report.wording import PageTable, is_direction, percent
from tactile_bayes.runs.names import MANY, OVERLAY
from tactile_bayes.tasks import refuse_replacing, write_atomically
from tactile_bayes.uncertainty.summary import gap_if_any

_ESCAPES = {code: f"\\u{code:04x}" for code in (ord("<"), ord(">"), ord("&"), 0x2028, 0x2029)}


class WrittenPage(NamedTuple):
    """A page that was written, the distances of its runs from the overlay, and a figure of both."""

    path: Path
    laid: Laid
    figure: Path | None


def write_report(
    run: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str] | None = None,
    *,
    compare: str | os.PathLike[str] | None = None,
    overlay: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Path:
    """Write the report of a run, or of several: one HTML page that needs no network and no other file.

    That of a run states the results, how far to trust them, the readings, and how to reproduce the run. A slider moves
    the rod along the most probable contour through the samples of the record. That of several shows their results side
    by side, and their contours over each other.

    Parameters
    ----------
    run : path-like or sequence of path-like
        Folder that `tactile-bayes infer` has written, of which posterior.nc is read; or a folder of such folders, as it
        writes for many records; or several.
    out : path-like, optional
        File for the page; by default report.html in that folder. An existing file is replaced. For several folders it
        must be given.
    compare : path-like, optional
        Folder of `tactile-bayes compare` for the same record, whose probabilities of shapes the report then states; by
        default `run`, if it holds a comparison that states its record. For one run alone.
    overlay : path-like, optional
        Folder of another run, or points of a contour in the laboratory frame of the record, CSV or DXF
        (`tactile_bayes.record.read_points`): it is drawn over the contour, and its distance is in a table. Of one run,
        overlay.png beside the page shows both.
    progress : callable, optional
        Called with the number of steps done and their total.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    InferenceError
        If the folder holds no posterior of a contour, or a named folder no comparison of its record.
    ParameterError
        If the page would replace one of these files, the overlay cannot be read, or the page of several folders has no
        path.
    OSError
        If the page cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from tactile_bayes import LoadCell, Rig, SamplerSettings, infer_contours, scan, write_record
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> quick = {"rng": 1, "settings": SamplerSettings(min_ess=100, max_r_hat=1.1), "figures": False}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path, out = Path(folder) / "one.csv", Path(folder) / "runs"
    ...     write_record(measured, path)
    ...     table = infer_contours([path], Rig(unknown="nothing"), out=out, **quick)
    ...     write_report(out / "one").name
    'report.html'
    """
    return report_into(run, out, compare, overlay, progress).path


def report_into(
    run: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str] | None,
    compare: str | os.PathLike[str] | None,
    overlay: str | os.PathLike[str] | None,
    progress: Callable[[int, int], object] | None,
) -> WrittenPage:
    """Write the page of `write_report`, and return what a command says of it."""
    given = list(run) if isinstance(run, Sequence) and not isinstance(run, str) else [run]
    folders = [check_path("run", each, "give the folder of a run, of several, or a list of them") for each in given]
    if not folders:
        raise ParameterError("there are no runs: give the folder of one")
    if out is None and len(folders) > 1:
        raise ParameterError("the page of several folders has no place of its own: say --out (out), like 'report.html'")
    path = folders[0] / "report.html" if out is None else check_path("out", out, "give a path, like 'report.html'")
    check_function("progress", progress)
    compared = None if compare is None else check_path("compare", compare)
    other = None if overlay is None else check_path("overlay", overlay)
    runs = folders_of(folders)
    one = folders[0] if list(runs) == folders[:1] else None
    if one is None and compared is not None:
        raise ParameterError("compare is for one run: leave it out, or report on the runs one by one")
    sources = [each / name for each in (*runs, *folders) for name in ("posterior.nc", "trust.nc", MANY[1])]
    sources += [(compared or folders[0]) / "comparison.nc"]
    sources += [] if other is None else [other / "posterior.nc" if other.is_dir() else other]
    figure, laid = path.with_name(OVERLAY), Laid("", {})
    refuse_replacing([path, figure] if other is not None else [path], [source for source in sources if source.exists()])
    count = (FINDING_STEPS if one is not None else len(runs)) + 1
    report = progress or (lambda done, count: None)
    if one is not None:
        findings = findings_of(one, compared, lambda done: report(done, count), other)
        page = page_of(findings, one.resolve().name)
        page["data"] = Markup(_as_json(page["data"]))
        text = rendered("template.html.jinja", _resource("report.js"), **page)
        if other is not None and findings.overlay is not None:
            draw_overlay(one.resolve().name, findings.band, findings.contacts, findings.overlay, figure)
            laid = Laid.over({one.resolve().name: findings.band}, findings.overlay)
    else:
        name = ", ".join(folder.resolve().name for folder in folders)
        values, laid = runs_page_of(runs, path, name, other, lambda done: report(done, count))
        text = rendered("runs.html.jinja", **values)
    with write_atomically(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    report(count, count)
    return WrittenPage(path, laid, figure if other is not None and one is not None else None)


def rendered(template: str, script: str = "", **values: Any) -> str:
    """Return a page from a template, with the style of the report and a policy that loads nothing."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    style, loader = _resource("report.css"), PackageLoader("tactile_bayes", "report")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    values |= {"style": Markup(style), "script": Markup(script), "policy": _policy(style, script)}
    return environment.get_template(template).render(values)


def _resource(name: str) -> str:
    return "\n" + resources.files("tactile_bayes.report").joinpath(name).read_text(encoding="utf-8")


def _policy(style: str, script: str) -> str:
    """Return the content security policy: run this script, apply this style, and load nothing."""
    digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (script, style))
    run, look = (f"'sha256-{digest}'" for digest in digests)
    return f"default-src 'none'; script-src {run}; style-src {look}; base-uri 'none'; form-action 'none'"


def _as_json(data: Any) -> str:
    """Return JSON in which no text can end the script element."""
    return json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":")).translate(_ESCAPES)


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
