"""A right call of every public function, class and method, with small arguments, for tests of wrong ones."""

import functools
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers.contour_posteriors import BRIEF, CELL, infer_as_stated, swept
from tactile_bayes.diagnostics.inspection import Inspection
from tactile_bayes.load_cell.discrepancy import Course, Discrepancy
from tactile_bayes.mechanics import elastica
from tactile_bayes.planning.error_map import Bands
from tactile_bayes.rig import FileFormat, Rig

PARABOLA = tb.contours.Parabola(0.5, 0.5)
STATED = Rig(load_cell=CELL, unknown="nothing")
ROD = tb.Rod.circular(0.1, 1e-3, 1e9)
SI_CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.002)
CARRIED = tb.Translation(base=(0.9, 0.0), heading=np.pi, drive_angle=1.5, travel=1.8)
DRIVE_ANGLES = np.linspace(0.5, 3.5, 20)
SPECIFICATION = {
    "records": 2,
    "seed": 1,
    "contours": [{"family": "parabola", "a": 0.5, "q": 0.5}],
    "load_cell": {"moment_noise": 0.02, "force_noise": 0.05},
}


# Functions that begin what takes seconds, when all arguments have been checked, by their modules.
_SLOW = (
    ("inference.contour", "sampled"),
    ("inference.point_load", "sample"),
    ("inference.contact_posterior.posterior", "draw_contacts"),
    ("comparison.families", "walk_of"),
    ("calibration.calibrate", "replicate"),
    ("calibration.calibrate", "make_replicate"),
    ("assessment.trust", "sampling_error"),
    ("report.writing", "page_of"),
)


class AcceptedError(Exception):
    """Something that takes seconds is about to begin: all arguments were accepted."""


def end_before_sampling(patch: pytest.MonkeyPatch) -> None:
    """Have calls that would sample, or the like, end where they would begin to."""

    def reach(*args, **options):
        raise AcceptedError

    for module, name in _SLOW:
        patch.setattr(importlib.import_module(f"tactile_bayes.{module}"), name, reach)


class Call(NamedTuple):
    """A function and arguments with which it succeeds."""

    function: Callable[..., Any]
    arguments: dict[str, Any]


@functools.cache
def ideal() -> xr.Dataset:
    return swept(PARABOLA, step=0.1)


@functools.cache
def measured() -> xr.Dataset:
    return CELL.measure(ideal(), rng=1)


@functools.cache
def scanned():
    return tb.scan(PARABOLA, drive_step=0.1)


@functools.cache
def posterior() -> xr.DataTree:
    """A posterior of a few draws: enough for every figure and summary, not for numbers."""
    return infer_as_stated(measured(), load_cell=CELL, rng=1, settings=BRIEF)


@functools.cache
def contacts_drawn() -> xr.DataTree:
    return tb.infer_contacts(measured(), rig=Rig(load_cell=CELL), rng=1, draws=40)


@functools.cache
def contacts() -> xr.Dataset:
    return tb.reconstruct(measured(), method="constrained", rig=Rig(load_cell=CELL))


@functools.cache
def implied() -> xr.DataTree:
    return tb.uncertainty.implied_contacts(posterior(), draws=10)


@functools.cache
def band() -> xr.Dataset:
    return tb.contour_band(posterior(), np.linspace(-0.3, 0.3, 5))


@functools.cache
def gap() -> xr.Dataset:
    return tb.gap(posterior())


@functools.cache
def plan() -> tb.planning.Plan:
    return tb.planning.Plan(PARABOLA, rig=STATED, drive=tb.Rotation(drive_step=0.1))


@functools.cache
def plan_si() -> tb.planning.Plan:
    contour = tb.contours.Parabola(5.0, 0.05)
    return tb.planning.Plan(
        contour, rig=Rig(rod=ROD, load_cell=SI_CELL, unknown="nothing"), drive=tb.Rotation(drive_step=0.1)
    )


@functools.cache
def sensitivity() -> xr.DataTree:
    return tb.sensitivity(PARABOLA, rng=1, rig=STATED, drive=tb.Rotation(drive_step=0.1), samples=8)


@functools.cache
def designed() -> xr.Dataset:
    return tb.design(posterior(), drives=[tb.Rotation((0.0, y), drive_step=0.1) for y in (0.0, -0.1)], draws=2, rng=1)


@functools.cache
def mapped() -> xr.Dataset:
    options = {"over": {"noise_factor": [0.1, 1.0]}, "replicates": 1, "drive": tb.Rotation(drive_step=0.1)}
    return tb.planning.error_map(["II"], rig=STATED, rng=1, workers=1, **options)


@functools.cache
def rods_required() -> xr.Dataset:
    options = {"lengths": [0.1], "diameters": [1e-3], "youngs_modulus": 1e9, "elastic_strain": 0.05}
    return tb.planning.required_rod(plan_si(), **options)


@functools.cache
def inspected() -> Inspection:
    return tb.inspect_record(measured(), rig=Rig(load_cell=CELL))


@functools.cache
def stream() -> tb.Stream:
    """A stream before its first update."""
    return tb.Stream(rig=STATED, rng=1, particles=100)


@functools.cache
def updated() -> tb.Stream:
    made = tb.Stream(rig=STATED, rng=1, particles=100)
    made.update(measured().isel(sample=slice(0, 10)))
    return made


@functools.cache
def streams() -> tb.comparison.StreamComparison:
    made = tb.comparison.StreamComparison(families=["parabola", "circle"], rig=STATED, rng=1, particles=100)
    made.update(measured().isel(sample=slice(0, 10)))
    return made


def compared() -> xr.Dataset:
    """A comparison of families, made up."""
    return xr.Dataset(
        {
            "probability": ("family", [0.9, 0.1]),
            "probability_by_width": (("prior_width", "family"), [[0.85, 0.15], [0.9, 0.1], [0.95, 0.05]]),
            "fits": ("family", [True, True]),
            "sampled": ("family", [True, True]),
            "converged": ("family", [True, True]),
        },
        coords={"family": ["circle", "ellipse"], "prior_width": [0.5, 1.0, 2.0]},
        attrs={"verdict": "circle with probability 0.9, ellipse with probability 0.1", "none_fits": 0},
    )


def trusted() -> xr.Dataset:
    """Assumptions that `trust` tried, made up."""
    return xr.Dataset(
        {
            "moved_in_gap": ("assumption", [0.1, 2.0]),
            "moved_beside": ("assumption", [0.05, 3.0]),
            "fits": ("assumption", [1, 0]),
        },
        coords={"assumption": ["friction as stated", "family circle"]},
    )


def calibrated() -> xr.Dataset:
    """A calibration, made up."""
    return xr.Dataset(
        {
            "ranks": (("replicate", "quantity"), np.random.default_rng(1).integers(0, 100, (50, 2))),
            "rank_p_value": ("quantity", [0.4, 0.8]),
            "coverage": ("claim", [0.89, 0.93]),
            "coverage_error": ("claim", [0.02, 0.018]),
            "coverage_replicates": ("claim", [200, 198]),
        },
        coords={"quantity": ["a", "q"], "claim": ["pointwise_in_gap", "snap_off"]},
        attrs={"level": 0.001, "probability": 0.9},
    )


CONTOURS = {
    "Circle": tb.contours.Circle(0.5, 0.5),
    "Ellipse": tb.contours.Ellipse(0.5, 0.4, 0.5),
    "Parabola": PARABOLA,
    "PowerLaw": tb.contours.PowerLaw(0.5, 3.0, 0.5),
    "Joined": tb.contours.paper_profile("IV", 0.5),
    "Smooth": tb.contours.Smooth(np.zeros(5), 0.5),
    "ShapeFree": tb.contours.ShapeFree(np.linspace(-1.5, 1.5, 5), np.zeros(5), 0.0, 0.5),
    "from_function": tb.contours.from_function(lambda x: 0.5 + 0.5 * x**2, (-1.0, 1.0)),
    "from_points": tb.contours.from_points(np.linspace(-1, 1, 30), 0.5 + 0.5 * np.linspace(-1, 1, 30) ** 2),
}


def _contour_calls() -> dict[str, Call]:
    c = tb.contours
    at = np.linspace(-1.0, 1.0, 30)
    calls = {
        "contours.Circle": Call(c.Circle, {"r": 0.5, "q": 0.5, "x_c": 0.0}),
        "contours.Ellipse": Call(c.Ellipse, {"a": 0.5, "b": 0.4, "q": 0.5, "x_c": 0.0}),
        "contours.Parabola": Call(c.Parabola, {"a": 0.5, "q": 0.5, "x_c": 0.0}),
        "contours.PowerLaw": Call(c.PowerLaw, {"a": 0.5, "n": 3.0, "q": 0.5, "x_c": 0.0}),
        "contours.PowerLaw.of_width": Call(c.PowerLaw.of_width, {"w": 0.5, "n": 3.0, "q": 0.5, "x_c": 0.0}),
        "contours.Joined": Call(c.Joined, {"left": PARABOLA, "right": c.PowerLaw(1.0, 4.0, 0.5), "x": None}),
        "contours.Smooth": Call(c.Smooth, {"log_radius": np.zeros(5), "q": 0.5, "x_c": 0.0}),
        "contours.Smooth.nodes": Call(c.Smooth.nodes, {"count": 5}),
        "contours.ShapeFree": Call(
            c.ShapeFree,
            {"slope_angles": np.linspace(-1.5, 1.5, 5), "log_radius": np.zeros(5), "x": 0.0, "y": 0.5, "at": 0.0},
        ),
        "contours.MeasuredContour": Call(
            c.MeasuredContour, {k: v for k, v in vars(CONTOURS["from_points"]).items() if not k.startswith("_")}
        ),
        "contours.check": Call(c.check, {"contour": PARABOLA}),
        "contours.from_function": Call(
            c.from_function,
            {
                "g": lambda x: 0.5 + 0.5 * x**2,
                "domain": (-1.0, 1.0),
                "slope": lambda x: 1.0 * x,
                "curvature": lambda x: 1.0 + 0.0 * x,
            },
        ),
        "contours.from_points": Call(c.from_points, {"x": at, "y": 0.5 + 0.5 * at**2, "scatter": None}),
        "contours.Polyline": Call(c.Polyline, {"pieces": [[(0.0, 0.0), (1.0, 0.0)]]}),
        "contours.Polyline.distance": Call(c.Polyline([[(0, 0), (1, 0)]]).distance, {"x": at, "y": at}),
        "contours.Polyline.height": Call(c.Polyline([[(0, 0), (1, 0)]]).height, {"x": at, "near": at}),
        "contours.paper_profile": Call(c.paper_profile, {"name": "II", "q": 0.5}),
    }
    for name, contour in CONTOURS.items():
        for method, argument, value in (
            ("height", "x", [0.0, 0.1]),
            ("locate", "parameter", [0.0, 0.1]),
            ("parameter_of_slope", "slope_angle", [0.0, 0.1]),
            ("parameter_of_x", "x", [0.0, 0.1]),
            ("point", "slope_angle", [0.0, 0.1]),
            ("radius_of_curvature", "slope_angle", [0.0, 0.1]),
        ):
            calls[f"contours.{name}.{method}"] = Call(getattr(contour, method), {argument: value})
    many = c.Parabola([0.5, 0.6], [0.5, 0.5], [0.0, 0.0])
    calls["contours.Contour.broadcast_to"] = Call(PARABOLA.broadcast_to, {"shape": (2,)})
    calls["contours.Contour.take"] = Call(many.take, {"index": np.array([0, 1])})
    calls["contours.Contour.end_name"] = Call(PARABOLA.end_name, {"side": "left"})
    return calls


def _load_cell_calls() -> dict[str, Call]:
    loads = np.zeros((4, 3))
    course = Course.along(np.arange(4.0), [np.arange(4)])
    discrepancy = Discrepancy(course, np.full((4, 3), 0.01), np.asarray(1.0))
    density = {"measured": loads, "predicted": loads, "noise_scale": 1.0, "discrepancy": None}
    zero = {"record": measured(), "false_alarm": 1e-3}
    return {
        "LoadCell": Call(tb.LoadCell, dict(vars(tb.LoadCell()))),
        "LoadCell.corrected": Call(CELL.corrected, {"record": measured()}),
        "LoadCell.covariance": Call(CELL.covariance, {"loads": loads}),
        "LoadCell.dimensionless": Call(SI_CELL.dimensionless, {"rod": ROD}),
        "LoadCell.expected": Call(CELL.expected, {"loads": loads}),
        "LoadCell.from_record": Call(tb.LoadCell.from_record, {"record": measured()}),
        "LoadCell.from_zero_load": Call(tb.LoadCell.from_zero_load, zero),
        "LoadCell.log_density_left_out": Call(CELL.log_density_left_out, density),
        "LoadCell.log_likelihood": Call(CELL.log_likelihood, {**density, "pointwise": False}),
        "LoadCell.measure": Call(CELL.measure, {"record": ideal(), "rng": 1}),
        "LoadCell.refuse_other_frame": Call(tb.LoadCell(frame="fixed").refuse_other_frame, {"record": measured()}),
        "LoadCell.simulate": Call(CELL.simulate, {"loads": loads, "rng": 1, "noise_scale": 1.0, "discrepancy": None}),
        "LoadCell.squared_mahalanobis_distance": Call(CELL.squared_mahalanobis_distance, {"readings": loads}),
        "OrnsteinUhlenbeck": Call(tb.load_cell.OrnsteinUhlenbeck, {"moment": 0.1, "force": 0.1, "time": 100.0}),
        "RandomWalk": Call(tb.load_cell.RandomWalk, {"moment": 0.1, "force": 0.1}),
        "discrepancy.Course.along": Call(Course.along, {"coordinate": np.arange(4.0), "sweeps": [np.arange(4)]}),
        "discrepancy.Discrepancy": Call(Discrepancy, dict(vars(discrepancy))),
        "zero_load": Call(tb.load_cell.zero_load, zero),
    }


def _rod_and_sweep_calls() -> dict[str, Call]:
    x = np.linspace(0.0, 0.1, 20)
    scan = {"contour": PARABOLA, "base": (0.0, 0.0), "rig": None}
    shape = {"length": None, "diameter": 0.0, "taper": 0.0, "rigidity_profile": None, "stem": 0.0}
    motion = tb.Motion(x=[0.8, -0.7], y=0.0, drive_angle=[0.8, 1.6])
    return {
        "Rod": Call(tb.Rod, dict(vars(tb.Rod()))),
        "Rod.circular": Call(
            tb.Rod.circular,
            {
                "length": 0.1,
                "diameter": 1e-3,
                "youngs_modulus": 1e9,
                "elastic_strain": None,
                "rest_curvature": 0.0,
                "taper": 0.0,
            },
        ),
        "Rod.from_shape": Call(
            tb.Rod.from_shape, {"x": x, "y": x**2, "flexural_rigidity": 1e-5, "scatter": 1e-5, **shape}
        ),
        "Rod.mirrored": Call(tb.Rod().mirrored, {"side": [1.0, -1.0]}),
        "Rotation": Call(
            tb.Rotation,
            {"base": (0.0, 0.0), "direction": "both", "drive_step": 0.1, "drive_angles": None},
        ),
        "Translation": Call(tb.Translation, dict(vars(CARRIED))),
        "Translation.at": Call(CARRIED.at, {"travels": [0.0, 0.5]}),
        "Translation.side": Call(CARRIED.side, {"length": 1.0}),
        "Motion": Call(tb.Motion, {"x": [0.8, -0.7], "y": 0.0, "drive_angle": [0.8, 1.6], "drive_step": 0.1}),
        "Motion.at": Call(motion.at, {"travels": [0.0, 0.5]}),
        "scan": Call(tb.scan, {**scan, "drive": None, "direction": "both", "drive_step": 0.1, "drive_angles": None}),
        "scan_many": Call(
            tb.scan_many,
            {
                "contours": tb.contours.Parabola([0.5, 0.6], 0.5),
                "drive_angles": DRIVE_ANGLES,
                "direction": "forward",
                "base": (0.0, 0.0),
                "rig": None,
            },
        ),
        "equilibria": Call(tb.equilibria, {**scan, "slope_angles": [0.1], "direction": "forward"}),
        "elastica.tangential_arclength": Call(
            elastica.tangential_arclength,
            {"contact_x": 0.2, "contact_y": 0.6, "slope_angle": 0.1, "friction_angle": 0.0, "rest_curvature": 0.0},
        ),
        "elastica.wrench_from_contact": Call(
            elastica.wrench_from_contact,
            {
                "contact_x": 0.2,
                "contact_y": 0.6,
                "slope_angle": [0.1],
                "friction_angle": 0.0,
                "side": 1,
                "phase": None,
                "rest_curvature": 0.0,
                "profile": None,
                "stem": 0.0,
            },
        ),
        "elastica.contact_from_wrench": Call(
            elastica.contact_from_wrench,
            {
                "drive_angle": 2.9,
                "holding_moment": 2.2,
                "force_x": -0.3,
                "force_y": 3.0,
                "friction_angle": 0.0,
                "side": None,
                "rest_curvature": 0.0,
                "profile": None,
                "stem": 0.0,
            },
        ),
        "elastica.largest_curvature": Call(
            elastica.largest_curvature,
            {"wrench": elastica.wrench_from_contact(0.2, 0.6, [0.1, 0.8]), "rest_curvature": 0.0},
        ),
    }


def _record_calls(folder: Path) -> dict[str, Call]:
    file = folder / "good.csv"
    tb.write_record(ideal(), file)
    posterior_file, points = folder / "posterior.nc", folder / "points.csv"
    tb.write_result(posterior(), posterior_file)
    points.write_text("x,y\n-0.3,0.6\n0.3,0.6\n", encoding="utf-8")
    line = tb.contours.Polyline([[(-0.3, 0.6), (0.3, 0.6)]])
    columns = {
        name: measured()[name].values for name in ("sweep", "direction", "drive_angle", "holding_moment", "force_x")
    }
    return {
        "make_record": Call(
            tb.make_record, {"columns": columns, "rig": Rig(file={"missing": "force_y"}), "attrs": {"rig": "1"}}
        ),
        "read_record": Call(tb.read_record, {"path": file, "rig": None}),
        "write_record": Call(tb.write_record, {"record": ideal(), "path": folder / "out.csv"}),
        "read_points": Call(tb.record.read_points, {"path": points}),
        "read_overlay": Call(
            tb.uncertainty.read_overlay, {"path": points, "posterior": posterior(), "probability": 0.9}
        ),
        "Overlay": Call(
            tb.uncertainty.Overlay, {"name": "line", "polyline": line, "band": band(), "is_unit_assumed": False}
        ),
        "Overlay.of_band": Call(tb.uncertainty.Overlay.of_band, {"name": "band", "band": band()}),
        "overlay_distance": Call(
            tb.uncertainty.overlay_distance, {"band": band(), "overlay": tb.uncertainty.Overlay("line", line)}
        ),
        "in_frame": Call(tb.record.in_frame, {"record": measured(), "frame": "turning"}),
        "inspect_record": Call(
            tb.inspect_record,
            {"record": measured(), "rig": STATED, "false_alarm": 1e-3, "progress": None},
        ),
        "read_result": Call(tb.read_result, {"path": posterior_file}),
        "write_result": Call(tb.write_result, {"result": posterior(), "path": folder / "out.nc"}),
        "to_arviz": Call(tb.to_arviz, {"posterior": posterior()}),
        "datasets.contour_of": Call(tb.datasets.contour_of, {"record": tb.datasets.record(SPECIFICATION, 0)}),
        "datasets.generate": Call(
            tb.datasets.generate,
            {"spec": SPECIFICATION, "out": folder / "set", "workers": 1},
        ),
        "datasets.open": Call(tb.datasets.open, {"path": _data_set(folder)}),
        "datasets.read_specification": Call(tb.datasets.read_specification, {"source": SPECIFICATION}),
        "datasets.record": Call(tb.datasets.record, {"source": SPECIFICATION, "index": 0}),
        "datasets.verify": Call(tb.datasets.verify, {"path": _data_set(folder), "regenerate": 0, "progress": None}),
        "write_report": Call(
            tb.write_report,
            {"run": folder, "out": folder / "report.html", "compare": None, "overlay": None, "progress": None},
        ),
    }


def _data_set(folder: Path) -> Path:
    if not (folder / "data").exists():
        tb.datasets.generate(SPECIFICATION, folder / "data", workers=1)
    return folder / "data"


def _inference_calls(folder: Path) -> dict[str, Call]:
    rig = {"rig": STATED, "rng": 1}
    sampled = {"settings": BRIEF, "progress": None}
    stored = {**rig, **sampled, "checkpoint": None, "keep": None}
    streamed = {**rig, "particles": 100, "x": [0.0, 0.1], "stop": None}
    file, both = folder / "stream.nc", folder / "streams.nc"
    rig_file = folder / "rig.toml"
    STATED.write(rig_file)
    updated().save(file)
    streams().save(both)
    kept = {**rig, "particles": 100}
    broken = folder / "broken.csv"
    broken.write_text("no record", encoding="utf-8")
    rest = measured().isel(sample=slice(10, 15))
    return {
        "infer_contour": Call(tb.infer_contour, {**stored, "measured": measured(), "family": "parabola"}),
        "infer_contours": Call(
            tb.infer_contours,
            {
                **rig,
                "rng": 1,
                "settings": BRIEF,
                "records": [broken],
                "out": folder / "many",
                "family": "parabola",
                "probability": 0.9,
                "workers": 1,
            },
        ),
        "calibrate_rig": Call(
            tb.calibrate_rig,
            {**stored, "rig": STATED.with_unknown(lever="default"), "records": measured(), "contour": PARABOLA},
        ),
        "Rig": Call(
            tb.Rig,
            {"rod": None, "load_cell": CELL, "unknown": {"lever": 0.0}, "calibration": None, "file": {}},
        ),
        "FileFormat": Call(FileFormat, {"columns": {"force_x": "Fx[mN]"}, "split_sweeps": False, "missing": ()}),
        "FileFormat.of": Call(FileFormat.of, {"table": {"force_x": "Fx[mN]"}}),
        "Rig.is_named": Call(STATED.is_named, {"name": "lever_x"}),
        "Rig.of": Call(tb.Rig.of, {"posterior": posterior()}),
        "Rig.of_tables": Call(tb.Rig.of_tables, {"tables": STATED.tables, "folder": folder}),
        "Rig.read": Call(tb.Rig.read, {"path": rig_file}),
        "Rig.with_unknown": Call(STATED.with_unknown, {"friction": 0.2}),
        "Rig.write": Call(STATED.write, {"path": folder / "other.toml"}),
        "Family": Call(functools.partial(tb.Family, "circle"), {"r": 0.2, "x_c": stats.norm(0.0, 0.1)}),
        "Family.of": Call(tb.Family.of, {"posterior": posterior()}),
        "Family.only": Call(tb.Family("circle").only, {"r": 0.2}),
        "infer_contacts": Call(
            tb.infer_contacts,
            {
                "progress": None,
                "measured": measured(),
                "rig": STATED,
                "prior": "flat",
                "rng": 1,
                "draws": 40,
            },
        ),
        "infer_point_load": Call(
            tb.infer_point_load,
            {
                **sampled,
                "axial": np.linspace(0.2, 0.6, 20),
                "lateral": np.linspace(0.01, 0.05, 20),
                "reading": np.linspace(0.1, 0.9, 20) ** 2,
                "rng": 1,
                "priors": None,
                "full_scale": None,
            },
        ),
        "compare_families": Call(
            tb.compare_families,
            {
                **sampled,
                "measured": measured(),
                "families": ["parabola", "circle"],
                "rig": STATED,
                "rng": 1,
                "false_alarm": 1e-3,
            },
        ),
        "SamplerSettings": Call(tb.SamplerSettings, dict(vars(tb.SamplerSettings()))),
        "SamplerSettings.walkers_for": Call(tb.SamplerSettings().walkers_for, {"parameters": 4}),
        "Stream": Call(tb.Stream, {**streamed, "family": "parabola"}),
        "Stream.update": Call(stream().update, {"samples": rest}),
        "Stream.contour_draws": Call(updated().contour_draws, {"count": 10}),
        "Stream.save": Call(updated().save, {"path": folder / "other.nc"}),
        "Stream.resume": Call(tb.Stream.resume, {**kept, "path": file, "record": None}),
        "StreamComparison": Call(
            tb.comparison.StreamComparison,
            {"families": ["parabola", "circle"], "x": [0.0, 0.1], "stop": None, **kept},
        ),
        "StreamComparison.update": Call(
            tb.comparison.StreamComparison(families=["parabola", "circle"], **kept).update, {"samples": rest}
        ),
        "StreamComparison.posterior": Call(streams().posterior, {"family": "circle"}),
        "StreamComparison.save": Call(streams().save, {"path": folder / "other.nc"}),
        "StreamComparison.resume": Call(
            tb.comparison.StreamComparison.resume,
            {**kept, "families": ["parabola", "circle"], "path": both, "record": None},
        ),
        "reconstruct": Call(
            tb.reconstruct,
            {
                "measured": measured(),
                "method": "constrained",
                "rig": STATED,
            },
        ),
    }


def _summary_calls() -> dict[str, Call]:
    x = [0.0, 0.1]
    return {
        "contour_band": Call(tb.contour_band, {"posterior": posterior(), "x": x, "probability": 0.9}),
        "normal_band": Call(
            tb.uncertainty.normal_band, {"posterior": posterior(), "x": x, "probability": 0.9, "reference": None}
        ),
        "predictive_interval": Call(tb.uncertainty.predictive_interval, {"posterior": posterior(), "probability": 0.9}),
        "gap": Call(tb.gap, {"posterior": posterior(), "probability": 0.9, "without_events": posterior()}),
        "implied_contacts": Call(tb.uncertainty.implied_contacts, {"posterior": posterior(), "draws": 5}),
        "contact_moments": Call(tb.uncertainty.contact_moments, {"posterior": contacts_drawn()}),
        "contact_region": Call(
            tb.uncertainty.contact_region, {"posterior": contacts_drawn(), "sample": 20, "probability": 0.9}
        ),
        "check": Call(tb.check, {"posterior": posterior(), "contacts": contacts(), "trust": None, "false_alarm": 1e-3}),
        "trust": Call(
            tb.trust,
            {
                "run_or_posterior": posterior(),
                "replicates": 0,
                "assumptions": False,
                "probability": None,
                "family": None,
                "rig": None,
                "rng": 1,
                "out": None,
                "workers": 1,
            },
        ),
    }


def _planning_calls() -> dict[str, Call]:
    sweep = {"rig": STATED, "family": None, "drive": tb.Rotation(drive_step=0.1)}
    tasks = {"out": None, "workers": 1}
    made = updated().posterior()
    calibration = {"rig": STATED, "rng": 1, "family": "parabola", "settings": None, "drive": None, "truth": None}
    return {
        "Plan": Call(tb.planning.Plan, {**sweep, "contour": PARABOLA}),
        "Plan.reconstruct": Call(plan().reconstruct, {"record": measured(), "method": "raw"}),
        "Plan.with_noise": Call(plan().with_noise, {"factor": 2.0}),
        "Plan.certain": Call(plan().certain, {"record": ideal()}),
        "sensitivity": Call(
            tb.sensitivity,
            {
                **sweep,
                "contour": PARABOLA,
                "rng": 1,
                "band_widths": [0.01],
                "probability": 0.9,
                "samples": 8,
                "parts": ["information", "required_noise"],
            },
        ),
        "design": Call(
            tb.design,
            {
                **tasks,
                "known": posterior(),
                "rng": 1,
                "drives": [tb.Rotation(drive_step=0.2)],
                "criterion": "band",
                "nested": False,
                "draws": 2,
                "rig": None,
            },
        ),
        "Bands": Call(Bands, {"probability": 0.9, "family": None, "posterior_cells": 0, "posterior_replicates": 1}),
        "Criterion": Call(tb.planning.Criterion, {"name": "band", "span": None, "probability": 0.9}),
        "usual_drives": Call(tb.planning.usual_drives, {"known": posterior(), "rig": None, "drive_step": 0.1}),
        "Workers": Call(tb.tasks.Workers, {"where": 1, "progress": None}),
        "error_map": Call(
            tb.planning.error_map,
            {
                **tasks,
                "contours": ["II"],
                "rig": STATED,
                "rng": 1,
                "over": {"distance": [0.5], "noise_factor": [1.0]},
                "drive": tb.Rotation(drive_step=0.2),
                "replicates": 1,
                "bands": Bands(),
            },
        ),
        "required_noise": Call(
            tb.planning.required_noise, {"plan": plan(), "band_width": 0.01, "where": "everywhere", "probability": 0.9}
        ),
        "required_rod": Call(
            tb.planning.required_rod,
            {
                "plan": plan_si(),
                "lengths": [0.1],
                "diameters": [1e-3],
                "youngs_modulus": 1e9,
                "elastic_strain": 0.05,
                "where": "everywhere",
                "probability": 0.9,
                "progress": None,
            },
        ),
        "rest_of_sweep": Call(
            tb.planning.rest_of_sweep,
            {
                "posterior": made,
                "drive_angles": measured().drive_angle[10:20].values,
                "x": [0.0, 0.1],
                "rng": 1,
                "probability": 0.9,
                "draws": 2,
            },
        ),
        "calibrate": Call(tb.calibrate, {**calibration, **tasks, "replicates": 1}),
        "calibration_replicate": Call(tb.calibration.calibration_replicate, {**calibration, "number": 0, "out": None}),
        "Misspecification": Call(
            tb.calibration.Misspecification,
            {"rig": STATED, "base_shift": (0.0, 0.0), "flat_spot": (0.1, 2.0), "family": "circle"},
        ),
    }


def _styled(**arguments: Any) -> None:
    with tb.plotting.style(**arguments):
        pass


def _figure_calls(folder: Path) -> dict[str, Call]:
    p = tb.plotting
    several = {"probability": 0.9, "samples": None, "truth": PARABOLA}
    figure = {
        "number": 3,
        "distances": [0.5],
        "drive_step": 0.1,
        "rods": 3,
        "load_cell": None,
        "rng": 1,
        "width": 7.0,
    }
    files = {
        "out": folder / "figures",
        "only": [3],
        "formats": ["png"],
        "style": "print",
        "progress": None,
        "distances": [0.5],
    }
    return {
        "plotting.amplification": Call(p.amplification, {"found": sensitivity(), "sweep": 0, "ax": None}),
        "plotting.assumptions": Call(p.assumptions, {"found": trusted(), "ax": None}),
        "plotting.band_detail": Call(p.band_detail, {"band": band(), "truth": PARABOLA, "gap": gap(), "ax": None}),
        "plotting.calibration_ranks": Call(p.calibration_ranks, {"calibration": calibrated(), "axes": None}),
        "plotting.contact_ellipses": Call(p.contact_ellipses, {"contacts": contacts(), **several, "ax": None}),
        "plotting.contact_regions": Call(p.contact_regions, {"posterior": contacts_drawn(), **several, "ax": None}),
        "plotting.contour": Call(
            p.contour,
            {
                "x": [-0.5, 0.0, 0.5],
                "truth": PARABOLA,
                "contacts": contacts(),
                "band": band(),
                "gap": gap(),
                "base": (0.0, 0.0),
                "ax": None,
            },
        ),
        "plotting.coverage": Call(p.coverage, {"calibration": calibrated(), "ax": None}),
        "plotting.design": Call(p.design, {"found": designed(), "ax": None}),
        "plotting.error_map": Call(
            p.error_map, {"found": mapped(), "quantity": "across", "reconstruction": "constrained", "ax": None}
        ),
        "plotting.families": Call(p.families, {"comparison": compared(), "axes": None}),
        "plotting.gap": Call(p.gap, {"found": gap(), "truth": PARABOLA, "ax": None}),
        "plotting.information": Call(p.information, {"found": sensitivity(), "ax": None}),
        "plotting.inspection": Call(p.inspection, {"inspected": inspected(), "axes": None}),
        "plotting.noise_shares": Call(
            p.noise_shares,
            {"found": sensitivity(), "reconstruction": "raw", "error": "across", "sweep": 0, "ax": None},
        ),
        "plotting.observables": Call(
            p.observables, {"record": scanned().record, "events": scanned().events, "axes": None}
        ),
        "plotting.overlaid": Call(
            p.overlaid,
            {"bands": {"one": band()}, "contacts": {"one": contacts()}, "overlay": None, "enlarged": False, "ax": None},
        ),
        "plotting.pairs": Call(
            p.pairs, {"posterior": posterior(), "names": ["a", "q"], "truth": {"a": 0.5}, "axes": None}
        ),
        "plotting.posterior_contours": Call(
            p.posterior_contours, {"posterior": posterior(), "contours": 4, "truth": PARABOLA, "ax": None}
        ),
        "plotting.predictive": Call(
            p.predictive,
            {
                "record": measured(),
                "predicted": tb.uncertainty.predictive_interval(posterior()),
                "axes": None,
                "residuals": None,
                "label": "predicted",
            },
        ),
        "plotting.prior_contours": Call(
            p.prior_contours, {"posterior": posterior(), "contours": 4, "truth": PARABOLA, "ax": None}
        ),
        "plotting.required_noise": Call(p.required_noise, {"found": sensitivity(), "ax": None}),
        "plotting.required_rod": Call(p.required_rod, {"found": rods_required(), "ax": None}),
        "plotting.rods": Call(
            p.rods, {"scan": scanned(), "direction": "forward", "sweep": None, "count": 3, "ax": None}
        ),
        "plotting.style": Call(_styled, {"name": "print"}),
        "plotting.tightening": Call(
            p.tightening, {"implied": implied(), "single": contacts(), **several, "axes": None}
        ),
        "plotting.touched": Call(p.touched, {"scan": scanned(), "ax": None}),
        "plotting.trace": Call(p.trace, {"posterior": posterior(), "names": ["a"], "axes": None}),
        "paper_figures.caption": Call(tb.paper_figures.caption, figure),
        "paper_figures.figure": Call(tb.paper_figures.figure, figure),
        "paper_figures.draw_all": Call(tb.paper_figures.draw_all, files),
    }


def right_calls(folder: Path) -> dict[str, Call]:
    """Return a right call of each public name, by the name; files are in a folder."""
    return {
        **_contour_calls(),
        **_load_cell_calls(),
        **_rod_and_sweep_calls(),
        **_record_calls(folder),
        **_inference_calls(folder),
        **_summary_calls(),
        **_planning_calls(),
        **_figure_calls(folder),
    }
