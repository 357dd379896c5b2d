"""Wrong arguments of the names that are used first: each is refused, in words, before anything is computed."""

from __future__ import annotations

import functools
import itertools
import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from tactile_bayes.checks import as_number, as_numbers, check_names, check_path, check_probability, check_whole_number
from tactile_bayes.errors import ParameterError, TactileBayesError, TactileBayesWarning

CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
BRIEF = tb.SamplerSettings(ensembles=2, walkers=24, max_steps=2, block_steps=2)


@functools.cache
def ideal():
    return tb.scan(tb.contours.Parabola(0.5, 0.5), drive_step=0.1).record


@functools.cache
def measured():
    return CELL.measure(ideal(), seed=1)


@functools.cache
def posterior():
    """A tree as `infer_contour` returns it, of a few draws."""
    draws = {"a": 0.5, "q": 0.3, "x_c": 0.0}
    ends = {"first_contact_x": [0.9, -0.9], "snap_off_contact_x": [0.2, -0.1], "snap_off_drive_angle": [3.2, -0.1]}
    groups = {
        "posterior": xr.Dataset({k: (("chain", "draw"), np.full((2, 3), v)) for k, v in draws.items()}),
        "events": xr.Dataset(
            {k: (("chain", "draw", "stroke"), np.broadcast_to(v, (2, 3, 2))) for k, v in ends.items()},
            coords={"stroke": ["forward", "backward"]},
        ),
    }
    tree = xr.DataTree.from_dict(groups)
    tree.attrs = {"family": "parabola", "units": "dimensionless"}
    return tree


@functools.cache
def no_posteriors():
    """Trees that lack something."""
    unnamed = posterior().copy()
    unnamed.attrs = {}
    other = posterior().copy()
    other.attrs = {**posterior().attrs, "family": "circle"}
    empty = xr.DataTree.from_dict({name: posterior()[name].to_dataset().isel(draw=[]) for name in ("posterior", "events")})
    empty.attrs = posterior().attrs
    words = posterior().copy()
    words["posterior"] = xr.DataTree(xr.Dataset({k: (("chain", "draw"), [["x"]]) for k in ("a", "q", "x_c")}))
    return [xr.DataTree(), xr.DataTree.from_dict({"posterior": xr.Dataset()}), unnamed, other, empty, words]


def no_records():
    bare = ideal().drop_vars("drive_angle")
    return [
        xr.Dataset(),
        xr.Dataset({"force_x": ("time", [1.0, 2.0])}),
        bare,
        ideal().isel(sample=[]),
        ideal().isel(sample=0),
        ideal().drop_attrs(),
        ideal().assign(force_x=("sample", ["a"] * ideal().sizes["sample"])),
        ideal().assign_attrs(rod_length="long"),
        ideal().assign_attrs(units=None),
        ideal().to_dataframe(),
        ideal()["force_x"],
    ]


WRONG = [
    None,
    "",
    "left",
    b"raw",
    math.nan,
    math.inf,
    -math.inf,
    -1,
    -0.5,
    0,
    0.0,
    1e-320,
    1e308,
    10**400,
    True,
    False,
    1.5,
    2 + 1j,
    np.complex128(1j),
    np.bool_(True),
    np.datetime64("2020-01-01"),
    [],
    [None],
    ["left", 1],
    [math.nan, 1.0],
    [1.0, math.inf],
    [True, 1.0],
    [[1.0, 2.0], [3.0]],
    (),
    {},
    {"left": 1},
    {1: 2.0},
    set(),
    np.array([]),
    np.array([1j, 2.0]),
    np.array(["a", "b"]),
    np.array([None, 1.0]),
    np.zeros((2, 3, 4)),
    np.array(math.nan),
    object(),
    float,
    xr.Dataset(),
    xr.DataArray([1.0, 2.0]),
    xr.DataTree(),
    tb.contours.Circle(0.5, 0.5),
    tb.contours.Circle([0.5, 0.6], 0.5),
    tb.Rod(),
    tb.Rod(0.1, 1e-5),
    CELL,
    BRIEF,
    stats.norm(0.0, 1.0),
    stats.norm,
    np.random.default_rng(1),
]
"""What is wrong for nearly every argument."""

NAMES = [["left"], ["bias", None], ["bias", 1], "bias", ["bias", ["gain"]], {"bias": 1.0}]
PRIORS = [{"q": 0.5}, {"q": None}, {"q": "norm"}, {"left": stats.norm()}, {"q": stats.norm}, {1: stats.norm()}]


def arguments(tmp_path):
    """Of every name a call that is right, by keyword, and further values that are wrong for one of them."""
    good = tmp_path / "good.csv"
    tb.write_record(ideal(), good)
    contours = tb.contours
    inference = {"load_cell": CELL, "seed": 1, "rod": None, "friction": 0.0, "settings": BRIEF, "progress": None}
    contour = {"measured": measured(), **inference, "priors": None, "nuisances": []}
    records, posteriors = {"measured": no_records()}, {"posterior": no_posteriors()}
    paths = ["\0", "folder/\0.csv", tmp_path, tmp_path / "record.txt", 3]
    settings = dict.fromkeys(
        ("ensembles", "walkers", "block_steps", "max_r_hat", "min_ess", "max_steps", "max_seconds"), None
    )
    return {
        "scan": (
            tb.scan,
            {
                "contour": contours.Parabola(0.5, 0.5),
                "direction": "both",
                "base": (0.0, 0.0),
                "drive_step": 0.1,
                "drive_angles": None,
                "rod": None,
                "friction": 0.0,
            },
            {"base": [[(0, 0), (1,)], [0.0, None]], "drive_angles": [["1", "2"], [90.0, 180.0], [[]]]},
        ),
        "LoadCell": (tb.LoadCell, dict(vars(CELL)), {"gain": [np.zeros((3, 3)), [[1, 2, 3]] * 3], "bias": [[0, 0, "1"]]}),
        "measure": (CELL.measure, {"record": ideal(), "seed": 1}, {"record": no_records()}),
        "from_record": (tb.LoadCell.from_record, {"record": measured()}, {}),
        "from_zero_load": (
            tb.LoadCell.from_zero_load,
            {"record": measured(), "false_alarm": 1e-3},
            {"record": no_records()},
        ),
        "read_record": (
            tb.read_record,
            {
                "path": good,
                "columns": None,
                "split_sweeps": False,
                "rod": None,
                "missing": (),
                "load_cell_frame": None,
            },
            {"path": paths, "columns": [{"force_x": 1}, {"force_x": None}, {"left": "Fx"}], "missing": NAMES},
        ),
        "write_record": (
            tb.write_record,
            {"record": ideal(), "path": tmp_path / "out.csv"},
            {"record": no_records(), "path": paths},
        ),
        "reconstruct": (
            tb.reconstruct,
            {
                "measured": measured(),
                "method": "constrained",
                "load_cell": CELL,
                "rod": None,
                "friction": 0.0,
                "suspension_compliance": 0.0,
            },
            records,
        ),
        "infer_contour": (
            tb.infer_contour,
            {**contour, "family": "parabola", "events": True, "checkpoint": None},
            {**records, "priors": PRIORS, "nuisances": NAMES, "checkpoint": ["\0"]},
        ),
        "SamplerSettings": (tb.SamplerSettings, {**vars(tb.SamplerSettings()), **{n: 4 for n in settings}}, {}),
        "contour_band": (
            tb.contour_band,
            {"posterior": posterior(), "x": [0.0, 0.1], "probability": 0.9, "simultaneous": False},
            posteriors,
        ),
        "gap": (
            tb.gap,
            {"posterior": posterior(), "probability": 0.9, "without_events": None},
            {**posteriors, "without_events": no_posteriors()},
        ),
        "Parabola": (contours.Parabola, {"a": 0.5, "q": 0.5, "x_c": 0.0}, {}),
        "Circle": (contours.Circle, {"r": 0.5, "q": 0.5, "x_c": 0.0}, {}),
        "Ellipse": (contours.Ellipse, {"a": 0.5, "b": 0.4, "q": 0.5, "x_c": 0.0}, {}),
        "PowerLaw": (contours.PowerLaw, {"a": 0.5, "n": 2.0, "q": 0.5, "x_c": 0.0}, {}),
        "Rod": (tb.Rod, dict(vars(tb.Rod())), {}),
        "Rod.circular": (
            tb.Rod.circular,
            {"length": 0.1, "diameter": 1e-3, "youngs_modulus": 2e11, "elastic_strain": None},
            {},
        ),
        "compare_families": (
            tb.compare_families,
            {**contour, "families": ["parabola", "circle"], "leave_one_out": False, "false_alarm": 1e-3},
            {
                **records,
                "families": [["parabola"], ["parabola", 1], ["parabola", "left"], ["circle"] * 2],
                "priors": [{"circle": priors} for priors in PRIORS] + [{"circle": 1}],
                "nuisances": NAMES,
            },
        ),
        "infer_contacts": (
            tb.infer_contacts,
            {"measured": measured(), **inference, "settings": None, "prior": "flat", "draws": 4, "method": "importance"},
            records,
        ),
    }
