"""Writing of the page: template, style and script in one file that loads nothing."""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

from markupsafe import Markup

from tactile_bayes.checks import check_function, check_path
from tactile_bayes.report.findings import FINDING_STEPS, findings_of
from tactile_bayes.report.page import page_of
from tactile_bayes.tasks import refuse_replacing, write_atomically

__all__ = ["rendered", "write_report"]

_ESCAPES = {code: f"\\u{code:04x}" for code in (ord("<"), ord(">"), ord("&"), 0x2028, 0x2029)}


def write_report(
    run: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    *,
    compare: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Path:
    """Write the report of a run: one HTML page that needs no network and no other file.

    It states the results, how far to trust them, the readings, and how to reproduce the run. A slider moves the rod
    along the most probable contour through the samples of the record.

    Parameters
    ----------
    run : path-like
        Folder that `tactile-bayes infer` has written, of which posterior.nc is read.
    out : path-like, optional
        File for the page; by default report.html in that folder. An existing file is replaced.
    compare : path-like, optional
        Folder of `tactile-bayes compare` for the same record, whose probabilities of shapes the report then states; by
        default `run`, if it holds a comparison that states its record.
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
        If the page would replace one of these files.
    OSError
        If the page cannot be written.
    """
    folder = check_path("run", run, "give the folder of a run")
    path = folder / "report.html" if out is None else check_path("out", out, "give a path, like 'report.html', or None")
    check_function("progress", progress)
    compare = None if compare is None else check_path("compare", compare)
    sources = [folder / "posterior.nc", folder / "trust.nc", (compare or folder) / "comparison.nc"]
    refuse_replacing([path], [source for source in sources if source.exists()])
    report = progress or (lambda done, count: None)
    findings = findings_of(folder, compare, lambda done: report(done, FINDING_STEPS + 1))
    text = _rendered(page_of(findings, folder.resolve().name))
    with write_atomically(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    report(FINDING_STEPS + 1, FINDING_STEPS + 1)
    return path


def _rendered(page: dict[str, Any]) -> str:
    values = {name: value for name, value in page.items() if name != "data"}
    return rendered("template.html.jinja", _resource("report.js"), data=Markup(_as_json(page["data"])), **values)


def rendered(template: str, script: str = "", **values: Any) -> str:
    """Return a page from a template, with the style of the report and a policy that loads nothing."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("tactile_bayes", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style = _resource("report.css")
    return environment.get_template(template).render(
        **values, style=Markup(style), script=Markup(script), policy=_policy(style, script)
    )


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
