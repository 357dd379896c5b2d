"""Runs to report on, without figures, and pages as parsers and browsers see them."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from typing import Any
from unittest import mock

import numpy as np
import xarray as xr

import tactile_bayes as tb
from tactile_bayes.runs import contour as run
from tactile_bayes.runs.demonstration import CONTOUR, LOAD_CELL, ROD

FEW = tb.SamplerSettings(ensembles=2, walkers=20, block_steps=10, max_steps=20)

COLUMN = "<|script><script>alert(1)<|script>"  # what reading makes of a column's name: a slash cannot be stored
LONG_NAME = "</script><script>alert(2)</script>"
UNIT = "\"><svg onload='alert(3)'>"
ENTRY = '"><img src=x onerror="alert(4)">'
VALUE = "</td></table><img src=x onerror=alert(5)><!-- \u2028 {{ 7 * 7 }}"
FILE = "\"'><img src=x onerror=alert(6)>&amp;.csv"
FOLDER = "<b onclick=alert(7)>run&lt;"

VOID = {"meta", "input", "br", "hr", "img", "link"}


def undrawn() -> Any:
    """While it lasts, runs have no figures."""
    return mock.patch.object(run, "_draw", return_value={})


def quickly(settings: tb.SamplerSettings) -> Any:
    """While it lasts, runs take these settings, whatever they are given."""
    infer = run.infer_contour
    return mock.patch.object(
        run, "infer_contour", lambda *given, **options: infer(*given, **options | {"settings": settings})
    )


def analysed_quickly(record: xr.Dataset, folder, **options) -> run.Run:
    """A run of few steps, without figures."""
    with undrawn():
        return run.analyse(record, folder, **({"rng": 1, "settings": FEW} | options))


def coarse_record() -> xr.Dataset:
    """The demonstration's record, in few samples, as it is measured."""
    record = LOAD_CELL.measure(tb.scan(CONTOUR, rig=tb.Rig(rod=ROD), drive_step=np.radians(6.0)).record, rng=1)
    return record.drop_vars([name for name in record.data_vars if str(name).startswith("truth_")])


def comparison(data_sha256: str = "", shares: tuple[float, ...] = (0.9, 0.1, np.nan)) -> xr.Dataset:
    """A comparison of three shapes, made up."""
    return xr.Dataset(
        {
            "probability": ("family", list(shares)),
            "log_evidence": ("family", [10.0, 8.0, np.nan]),
            "p_value": ("family", [0.2, 0.3, np.nan]),
            "fits": ("family", [True, True, False]),
            "sampled": ("family", [True, True, False]),
        },
        coords={"family": ["ellipse", "parabola", "circle"]},
        attrs={"verdict": "ellipse with probability 0.90", "data_sha256": data_sha256},
    )


def hostile_run(parent):
    """A run of a record whose every text is an attack on the page; its folder."""
    record = coarse_record()
    attrs = {"units": UNIT, "long_name": LONG_NAME}
    record[COLUMN] = ("sample", np.arange(float(record.sizes["sample"])), attrs)
    path = parent / FILE
    tb.write_record(record.assign_attrs({ENTRY: VALUE}), path)
    folder = parent / FOLDER
    analysed_quickly(
        tb.read_record(path),
        folder,
        rig=tb.Rig(unknown="nothing"),
        record_file=path,
        command=["tactile-bayes", "infer", FILE, "--out", ENTRY],
    )
    return folder


class Page(HTMLParser):
    """Elements of a page with their attributes, texts of some of them, and whether all are closed."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.tables: list[tuple[str, list[list[str]]]] = []
        self.texts: dict[str, list[str]] = {}
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag in VOID:
            return
        self.open.append(tag)
        self.texts.setdefault(tag, []).append("")
        if tag == "table":
            self.tables.append(("", []))
        elif tag == "tr":
            self.tables[-1][1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][1][-1].append("")

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> without anything open"
        assert self.open.pop() == tag

    def handle_data(self, data):
        for tag in set(self.open):
            self.texts[tag][-1] += data
        if self.open and [tag for tag in self.open if tag != "a"][-1] in ("td", "th"):
            self.tables[-1][1][-1][-1] += data
        elif "caption" in self.open:
            caption, rows = self.tables[-1]
            self.tables[-1] = (caption + data, rows)

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attrs for name, attrs in self.elements if name == tag]

    def table(self, caption: str) -> list[list[str]]:
        """Rows of the table whose caption begins so."""
        return next(rows for words, rows in self.tables if words.startswith(caption))

    @property
    def data(self):
        """What the page's script is given."""
        texts = [text for attrs, text in zip(self.all("script"), self.texts["script"], strict=True) if "type" in attrs]
        return json.loads(texts[0])
