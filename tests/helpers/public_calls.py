"""A right call of every public function, class and method, with small arguments, for tests of wrong ones."""

import functools
import importlib
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers import comparisons
from helpers.contour_posteriors import BRIEF, CELL, infer_as_stated, swept
from tactile_bayes.inference.point_load import infer_point_load
from tactile_bayes.load_cell.discrepancy import Course, Discrepancy
from tactile_bayes.mechanics import elastica
from tactile_bayes.planning.error_map import Bands
from tactile_bayes.rig import FileFormat, Rig
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.sweep import scan_many

PARABOLA = tb.contours.Parabola(0.5, 0.5)
STATED = Rig(load_cell=CELL, unknown="nothing")
ROD = tb.Rod.circular(0.1, 1e-3, 1e9)
SI_CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.002)
CARRIED = tb.Translation(base=(0.9, 0.0), heading=np.pi, drive_angle=1.5, travel=1.8)
COARSE = tb.Rotation(drive_step=0.1)
STREAM: dict[str, Any] = {"rig": STATED, "rng": 1, "particles": 100}
SPECIFICATION = {
    "records": 2,
    "seed": 1,
    "contours": [{"family": "parabola", "a": 0.5, "q": 0.5}],
    "load_cell": {"moment_noise": 0.02, "force_noise": 0.05},
}


# Functions that begin what takes seconds, when all arguments have been checked.
_SLOW = (
    *(
        "inference.contour.spawn",
        "inference.point_load.sample",
        "inference.contact_posterior.posterior.draw_contacts",
        "inference.target.whole_groups",
    ),
    *("comparison.families.walk_of", "calibration.calibrate.replicate", "calibration.calibrate.make_replicate"),
    *("assessment.trust.sampling_error", "report.writing.page_of"),
)


class AcceptedError(Exception):
    """Something that takes seconds is about to begin: all arguments were accepted."""


def end_before_sampling(patch: pytest.MonkeyPatch) -> None:
    """Have calls that would sample, or the like, end where they would begin to."""

    def reach(*args, **options):
        raise AcceptedError

    for function in _SLOW:
        module, _, name = function.rpartition(".")
        patch.setattr(importlib.import_module(f"tactile_bayes.{module}"), name, reach)


class Call(NamedTuple):
    """A function and arguments with which it succeeds."""

    function: Callable[..., Any]
    arguments: dict[str, Any]


def right(function: Callable[..., Any], /, **arguments: Any) -> Call:
    """A call with these arguments, and the defaults of all others."""
    parameters = inspect.signature(function).parameters.values()
    defaults = {one.name: one.default for one in parameters if one.default is not one.empty}
    return Call(function, {**defaults, **arguments})


ideal = functools.cache(lambda: swept(PARABOLA, step=0.1))
measured = functools.cache(lambda: CELL.measure(ideal(), rng=1))
target = functools.cache(lambda: tb.target(measured(), rig=STATED))
scanned = functools.cache(lambda: tb.scan(PARABOLA, drive_step=0.1))
# A posterior of a few draws: enough for every figure and summary, not for numbers.
posterior = functools.cache(lambda: infer_as_stated(measured(), load_cell=CELL, rng=1, settings=BRIEF))
contacts_drawn = functools.cache(lambda: tb.infer_contacts(measured(), rig=Rig(load_cell=CELL), rng=1, draws=40))
contacts = functools.cache(lambda: tb.reconstruct(measured(), method="constrained", rig=Rig(load_cell=CELL)))
implied = functools.cache(lambda: tb.uncertainty.implied_contacts(posterior(), draws=10))
band = functools.cache(lambda: tb.contour_band(posterior(), np.linspace(-0.3, 0.3, 5)))
gap = functools.cache(lambda: tb.gap(posterior()))
plan = functools.cache(lambda: tb.planning.Plan(PARABOLA, rig=STATED, drive=COARSE))


@functools.cache
def plan_si() -> tb.planning.Plan:
    rig = Rig(rod=ROD, load_cell=SI_CELL, unknown="nothing")
    return tb.planning.Plan(tb.contours.Parabola(5.0, 0.05), rig=rig, drive=COARSE)


sensitivity = functools.cache(lambda: tb.sensitivity(PARABOLA, rng=1, rig=STATED, drive=COARSE, samples=8))
designed = functools.cache(
    lambda: tb.design(posterior(), drives=[tb.Rotation((0.0, y), drive_step=0.1) for y in (0.0, -0.1)], draws=2, rng=1)
)


@functools.cache
def mapped() -> xr.Dataset:
    options = {"over": {"noise_factor": [0.1, 1.0]}, "replicates": 1, "drive": COARSE}
    return tb.planning.error_map(["II"], rig=STATED, rng=1, workers=1, **options)


@functools.cache
def rods_required() -> xr.Dataset:
    options = {"lengths": [0.1], "diameters": [1e-3], "youngs_modulus": 1e9, "elastic_strain": 0.05}
    return tb.planning.required_rod(plan_si(), **options)


inspected = functools.cache(lambda: tb.inspect_record(measured(), rig=Rig(load_cell=CELL)))


def stream() -> tb.Stream:
    """A stream before its first update."""
    return tb.Stream(**STREAM)


@functools.cache
def updated() -> tb.Stream:
    made = stream()
    made.update(measured().isel(sample=slice(0, 10)))
    return made


@functools.cache
def streams() -> tb.comparison.StreamComparison:
    made = tb.comparison.StreamComparison(families=["parabola", "circle"], **STREAM)
    made.update(measured().isel(sample=slice(0, 10)))
    return made


def compared() -> xr.Dataset:
    return comparisons.made_up([0.9, 0.1])


def trusted() -> xr.Dataset:
    """Assumptions that `trust` tried, made up."""
    columns = {"moved_in_gap": [0.1, 2.0], "moved_beside": [0.05, 3.0], "fits": [1, 0]}
    names = ["friction as stated", "family circle"]
    return xr.Dataset({name: ("assumption", values) for name, values in columns.items()}, {"assumption": names})


def calibrated() -> xr.Dataset:
    """A calibration, made up."""
    ranks = {"ranks": (("replicate", "quantity"), np.random.default_rng(1).integers(0, 100, (50, 2)))}
    ranks["rank_p_value"] = "quantity", [0.4, 0.8]
    shares = {"coverage": [0.89, 0.93], "coverage_error": [0.02, 0.018], "coverage_replicates": [200, 198]}
    labels = {"quantity": ["a", "q"], "claim": ["pointwise_in_gap", "snap_off"]}
    attrs = {"level": 0.001, "probability": 0.9}
    return xr.Dataset(ranks | {name: ("claim", values) for name, values in shares.items()}, labels, attrs)


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
# Methods of every contour, each with its argument.
METHODS = {"height": "x", "locate": "parameter", "parameter_of_slope": "slope_angle", "parameter_of_x": "x"}
METHODS |= {"point": "slope_angle", "radius_of_curvature": "slope_angle"}


def _contour_calls() -> dict[str, Call]:
    c = tb.contours
    at = np.linspace(-1.0, 1.0, 30)
    line = c.Polyline([[(0, 0), (1, 0)]])
    many = c.Parabola([0.5, 0.6], [0.5, 0.5], [0.0, 0.0])
    fit = {k: v for k, v in vars(CONTOURS["from_points"]).items() if not k.startswith("_")}
    function = {"g": lambda x: 0.5 + 0.5 * x**2, "slope": lambda x: 1.0 * x, "curvature": lambda x: 1.0 + 0.0 * x}
    return {
        "contours.Circle": right(c.Circle, r=0.5, q=0.5),
        "contours.Ellipse": right(c.Ellipse, a=0.5, b=0.4, q=0.5),
        "contours.Parabola": right(c.Parabola, a=0.5, q=0.5),
        "contours.PowerLaw": right(c.PowerLaw, a=0.5, n=3.0, q=0.5),
        "contours.PowerLaw.of_width": right(c.PowerLaw.of_width, w=0.5, n=3.0, q=0.5),
        "contours.Joined": right(c.Joined, left=PARABOLA, right=c.PowerLaw(1.0, 4.0, 0.5)),
        "contours.Smooth": right(c.Smooth, log_radius=np.zeros(5), q=0.5),
        "contours.Smooth.nodes": right(c.Smooth.nodes, count=5),
        "contours.ShapeFree": right(
            c.ShapeFree, slope_angles=np.linspace(-1.5, 1.5, 5), log_radius=np.zeros(5), x=0.0, y=0.5
        ),
        "contours.MeasuredContour": right(c.MeasuredContour, **fit),
        "contours.check": right(c.check, contour=PARABOLA),
        "contours.from_function": right(c.from_function, domain=(-1.0, 1.0), **function),
        "contours.from_points": right(c.from_points, x=at, y=0.5 + 0.5 * at**2),
        "contours.Polyline": right(c.Polyline, pieces=[[(0.0, 0.0), (1.0, 0.0)]]),
        "contours.Polyline.distance": right(line.distance, x=at, y=at),
        "contours.Polyline.height": right(line.height, x=at, near=at),
        "contours.paper_profile": right(c.paper_profile, name="II", q=0.5),
        "contours.Contour.broadcast_to": right(PARABOLA.broadcast_to, shape=(2,)),
        "contours.Contour.take": right(many.take, index=np.array([0, 1])),
        "contours.Contour.end_name": right(PARABOLA.end_name, side="left"),
        **{
            f"contours.{name}.{method}": right(getattr(contour, method), **{argument: [0.0, 0.1]})
            for name, contour in CONTOURS.items()
            for method, argument in METHODS.items()
        },
    }


def _load_cell_calls() -> dict[str, Call]:
    loads = np.zeros((4, 3))
    course = Course.along(np.arange(4.0), [np.arange(4)])
    discrepancy = Discrepancy(course, np.full((4, 3), 0.01), np.asarray(1.0))
    return {
        "LoadCell": right(tb.LoadCell),
        "LoadCell.corrected": right(CELL.corrected, record=measured()),
        "LoadCell.covariance": right(CELL.covariance, loads=loads),
        "LoadCell.dimensionless": right(SI_CELL.dimensionless, rod=ROD),
        "LoadCell.expected": right(CELL.expected, loads=loads),
        "LoadCell.from_record": right(tb.LoadCell.from_record, record=measured()),
        "LoadCell.from_zero_load": right(tb.LoadCell.from_zero_load, record=measured()),
        "LoadCell.log_density_left_out": right(CELL.log_density_left_out, measured=loads, predicted=loads),
        "LoadCell.log_likelihood": right(CELL.log_likelihood, measured=loads, predicted=loads),
        "LoadCell.measure": right(CELL.measure, record=ideal(), rng=1),
        "LoadCell.refuse_other_frame": right(tb.LoadCell(frame="fixed").refuse_other_frame, record=measured()),
        "LoadCell.simulate": right(CELL.simulate, loads=loads, rng=1),
        "LoadCell.squared_mahalanobis_distance": right(CELL.squared_mahalanobis_distance, readings=loads),
        "OrnsteinUhlenbeck": right(tb.load_cell.OrnsteinUhlenbeck, moment=0.1, force=0.1),
        "RandomWalk": right(tb.load_cell.RandomWalk, moment=0.1, force=0.1),
        "discrepancy.Course.along": right(Course.along, coordinate=np.arange(4.0), sweeps=[np.arange(4)]),
        "discrepancy.Discrepancy": right(Discrepancy, **vars(discrepancy)),
        "zero_load": right(tb.load_cell.zero_load, record=measured()),
    }


def _rod_and_sweep_calls() -> dict[str, Call]:
    x = np.linspace(0.0, 0.1, 20)
    motion = {"x": [0.8, -0.7], "y": 0.0, "drive_angle": [0.8, 1.6]}
    contact = {"contact_x": 0.2, "contact_y": 0.6}
    loads = {"holding_moment": 2.2, "force_x": -0.3, "force_y": 3.0}
    wrench = elastica.wrench_from_contact(0.2, 0.6, [0.1, 0.8])
    two = tb.contours.Parabola([0.5, 0.6], 0.5)
    return {
        "Rod": right(tb.Rod, length=0.1, flexural_rigidity=1e-5),
        "Rod.circular": right(tb.Rod.circular, length=0.1, diameter=1e-3, youngs_modulus=1e9),
        "Rod.from_shape": right(tb.Rod.from_shape, x=x, y=x**2, flexural_rigidity=1e-5, scatter=1e-5),
        "Rod.mirrored": right(tb.Rod().mirrored, side=[1.0, -1.0]),
        "Rotation": right(tb.Rotation, drive_step=0.1),
        "Translation": right(tb.Translation, **vars(CARRIED)),
        "Translation.at": right(CARRIED.at, travels=[0.0, 0.5]),
        "Translation.side": right(CARRIED.side, length=1.0),
        "Motion": right(tb.Motion, **motion, drive_step=0.1),
        "Motion.at": right(tb.Motion(**motion).at, travels=[0.0, 0.5]),
        "scan": right(tb.scan, contour=PARABOLA, drive_step=0.1),
        "scan_many": right(scan_many, contours=two, drive_angles=np.linspace(0.5, 3.5, 20)),
        "equilibria": right(tb.equilibria, contour=PARABOLA, slope_angles=[0.1]),
        "elastica.tangential_arclength": right(elastica.tangential_arclength, **contact, slope_angle=0.1),
        "elastica.wrench_from_contact": right(elastica.wrench_from_contact, **contact, slope_angle=[0.1]),
        "elastica.contact_from_wrench": right(elastica.contact_from_wrench, drive_angle=2.9, **loads),
        "elastica.largest_curvature": right(elastica.largest_curvature, wrench=wrench),
    }


def _record_calls(folder: Path) -> dict[str, Call]:
    file, posterior_file, points = folder / "good.csv", folder / "posterior.nc", folder / "points.csv"
    tb.write_record(ideal(), file)
    tb.write_result(posterior(), posterior_file)
    points.write_text("x,y\n-0.3,0.6\n0.3,0.6\n", encoding="utf-8")
    tb.datasets.generate(SPECIFICATION, folder / "data", workers=1)
    line = tb.contours.Polyline([[(-0.3, 0.6), (0.3, 0.6)]])
    overlay = tb.uncertainty.Overlay("line", line)
    names = ("sweep", "direction", "drive_angle", "holding_moment", "force_x")
    table = {"columns": {name: measured()[name].values for name in names}, "attrs": {"rig": "1"}}
    return {
        "make_record": right(tb.make_record, **table, rig=Rig(file={"missing": "force_y"})),
        "read_record": right(tb.read_record, path=file),
        "write_record": right(tb.write_record, record=ideal(), path=folder / "out.csv"),
        "read_points": right(tb.record.read_points, path=points),
        "read_overlay": right(tb.uncertainty.read_overlay, path=points, posterior=posterior(), probability=0.9),
        "Overlay": right(tb.uncertainty.Overlay, name="line", polyline=line, band=band()),
        "Overlay.of_band": right(tb.uncertainty.Overlay.of_band, name="band", band=band()),
        "overlay_distance": right(tb.uncertainty.overlay_distance, band=band(), overlay=overlay),
        "in_frame": right(tb.record.in_frame, record=measured(), frame="turning"),
        "inspect_record": right(tb.inspect_record, record=measured(), rig=STATED),
        "read_result": right(tb.read_result, path=posterior_file),
        "write_result": right(tb.write_result, result=posterior(), path=folder / "out.nc"),
        "to_arviz": right(tb.to_arviz, posterior=posterior()),
        "datasets.contour_of": right(tb.datasets.contour_of, record=tb.datasets.record(SPECIFICATION, 0)),
        "datasets.generate": right(tb.datasets.generate, spec=SPECIFICATION, out=folder / "set", workers=1),
        "datasets.open": right(tb.datasets.open, path=folder / "data"),
        "datasets.read_specification": right(tb.datasets.read_specification, source=SPECIFICATION),
        "datasets.record": right(tb.datasets.record, source=SPECIFICATION, index=0),
        "datasets.verify": right(tb.datasets.verify, path=folder / "data"),
        "write_report": right(tb.write_report, run=folder, out=folder / "report.html"),
    }


def _inference_calls(folder: Path) -> dict[str, Call]:
    rig_file, file, both, broken = (folder / name for name in ("rig.toml", "stream.nc", "streams.nc", "broken.csv"))
    STATED.write(rig_file)
    updated().save(file)
    streams().save(both)
    broken.write_text("no record", encoding="utf-8")
    rest = measured().isel(sample=slice(10, 15))
    deflections = {"axial": np.linspace(0.2, 0.6, 20), "lateral": np.linspace(0.01, 0.05, 20)}
    deflections["reading"] = np.linspace(0.1, 0.9, 20) ** 2
    several = {"families": ["parabola", "circle"], **STREAM}
    sampled = {"rig": STATED, "rng": 1, "settings": BRIEF}
    found = RigPrior({"lever_x": stats.norm(0.0, 0.01)}, np.eye(1), 0.0, "")
    unknown_lever = {"rig": STATED.with_unknown(lever="default")}
    comparison = tb.comparison.StreamComparison
    return {
        "infer_contour": right(tb.infer_contour, **sampled, measured=measured()),
        "infer_contours": right(
            tb.infer_contours, **sampled, records=[broken], out=folder / "many", probability=0.9, workers=1
        ),
        "calibrate_rig": right(tb.calibrate_rig, **sampled | unknown_lever, records=measured(), contour=PARABOLA),
        "Rig": right(tb.Rig, load_cell=CELL, unknown={"lever": 0.0}, file={}),
        "FileFormat": right(FileFormat, columns={"force_x": "Fx[mN]"}),
        "FileFormat.of": right(FileFormat.of, table={"force_x": "Fx[mN]"}),
        "Rig.is_named": right(STATED.is_named, name="lever_x"),
        "Rig.of": right(tb.Rig.of, posterior=posterior()),
        "Rig.of_tables": right(tb.Rig.of_tables, tables=STATED.tables, folder=folder),
        "Rig.read": right(tb.Rig.read, path=rig_file),
        "Rig.with_session": right(Rig(calibration=found).with_session, lever_x=0.01),
        "Rig.with_unknown": right(STATED.with_unknown, friction=0.2),
        "Rig.write": right(STATED.write, path=folder / "other.toml"),
        "Family": right(functools.partial(tb.Family, "circle"), r=0.2, x_c=stats.norm(0.0, 0.1)),
        "Family.of": right(tb.Family.of, posterior=posterior()),
        "Family.only": right(tb.Family("circle").only, r=0.2),
        "infer_contacts": right(tb.infer_contacts, measured=measured(), rig=STATED, rng=1, draws=40),
        "infer_point_load": right(infer_point_load, **deflections, rng=1, settings=BRIEF),
        "target": right(tb.target, measured=measured(), rig=STATED),
        "result": right(tb.result, target=target(), draws=np.full((2, 10, 4), [0.5, 0.5, 0.0, 1.0]), rng=1),
        "compare_families": right(tb.compare_families, **sampled, measured=measured(), families=["parabola", "circle"]),
        "SamplerSettings": right(tb.SamplerSettings),
        "SamplerSettings.walkers_for": right(tb.SamplerSettings().walkers_for, parameters=4),
        "Stream": right(tb.Stream, **STREAM, x=[0.0, 0.1]),
        "Stream.update": right(stream().update, samples=rest),
        "Stream.contour_draws": right(updated().contour_draws, count=10),
        "Stream.save": right(updated().save, path=folder / "other.nc"),
        "Stream.resume": right(tb.Stream.resume, **STREAM, path=file),
        "StreamComparison": right(comparison, **several, x=[0.0, 0.1]),
        "StreamComparison.update": right(comparison(**several).update, samples=rest),
        "StreamComparison.posterior": right(streams().posterior, family="circle"),
        "StreamComparison.save": right(streams().save, path=folder / "other.nc"),
        "StreamComparison.resume": right(comparison.resume, **several, path=both),
        "reconstruct": right(tb.reconstruct, measured=measured(), method="constrained", rig=STATED),
    }


def _summary_calls() -> dict[str, Call]:
    drawn = {"posterior": posterior(), "probability": 0.9}
    return {
        "contour_band": right(tb.contour_band, **drawn, x=[0.0, 0.1]),
        "uncertainty_budget": right(tb.uncertainty.uncertainty_budget, **drawn),
        "normal_band": right(tb.uncertainty.normal_band, **drawn, x=[0.0, 0.1], align="rigid"),
        "predictive_interval": right(tb.uncertainty.predictive_interval, **drawn),
        "gap": right(tb.gap, **drawn, without_events=posterior()),
        "implied_contacts": right(tb.uncertainty.implied_contacts, posterior=posterior(), draws=5),
        "contact_moments": right(tb.uncertainty.contact_moments, posterior=contacts_drawn()),
        "contact_region": right(tb.uncertainty.contact_region, posterior=contacts_drawn(), sample=20),
        "causes": right(tb.causes, posterior=posterior()),
        "check": right(tb.check, posterior=posterior(), contacts=contacts()),
        "trust": right(tb.trust, run_or_posterior=posterior(), rng=1, replicates=0, assumptions=False, workers=1),
    }


def _planning_calls() -> dict[str, Call]:
    p = tb.planning
    sweep = {"rig": STATED, "drive": COARSE}
    coarser = tb.Rotation(drive_step=0.2)
    planned = {"band_widths": [0.01], "samples": 8, "parts": ["information", "required_noise"]}
    mapped_over = {"contours": ["II"], "over": {"distance": [0.5], "noise_factor": [1.0]}, "replicates": 1}
    rods = {"lengths": [0.1], "diameters": [1e-3], "youngs_modulus": 1e9, "elastic_strain": 0.05}
    rest = {"drive_angles": measured().drive_angle[10:20].values, "x": [0.0, 0.1]}
    replicate = {"rig": STATED, "rng": 1, "settings": None, "drive": None, "truth": None}
    wrong = {"base_shift": (0.0, 0.0), "flat_spot": (0.1, 2.0), "family": "circle"}
    return {
        "Plan": right(p.Plan, **sweep, contour=PARABOLA),
        "Plan.reconstruct": right(plan().reconstruct, record=measured(), method="raw"),
        "Plan.with_noise": right(plan().with_noise, factor=2.0),
        "Plan.certain": right(plan().certain, record=ideal()),
        "sensitivity": right(tb.sensitivity, **sweep, **planned, contour=PARABOLA, rng=1, probability=0.9),
        "design": right(tb.design, known=posterior(), rng=1, drives=[coarser], draws=2),
        "Bands": right(Bands, probability=0.9, posterior_replicates=1),
        "Criterion": right(p.Criterion, probability=0.9),
        "usual_drives": right(p.usual_drives, known=posterior(), drive_step=0.1),
        "Workers": right(tb.tasks.Workers, where=1),
        "error_map": right(p.error_map, **mapped_over, rig=STATED, rng=1, drive=coarser, bands=Bands(), workers=1),
        "required_noise": right(p.required_noise, plan=plan(), band_width=0.01, probability=0.9),
        "required_rod": right(p.required_rod, plan=plan_si(), probability=0.9, **rods),
        "rest_of_sweep": right(
            p.rest_of_sweep, posterior=updated().posterior(), rng=1, probability=0.9, draws=2, **rest
        ),
        "calibrate": right(tb.calibrate, rig=STATED, rng=1, replicates=1, workers=1),
        "calibration_replicate": right(tb.calibration.calibration_replicate, number=0, **replicate),
        "Misspecification": right(tb.calibration.Misspecification, rig=STATED, **wrong),
    }


def _styled(**arguments: Any) -> None:
    with tb.plotting.style(**arguments):
        pass


def _figure_calls(folder: Path) -> dict[str, Call]:
    p, f = tb.plotting, tb.paper_figures
    truth = {"truth": PARABOLA}
    predicted = tb.uncertainty.predictive_interval(posterior())
    figure = {"number": 3, "distances": [0.5], "drive_step": 0.1, "rods": 3, "rng": 1}
    files = {"out": folder / "figures", "only": [3], "formats": ["png"], "distances": [0.5]}
    return {
        "plotting.amplification": right(p.amplification, found=sensitivity()),
        "plotting.assumptions": right(p.assumptions, found=trusted()),
        "plotting.band_detail": right(p.band_detail, band=band(), gap=gap(), **truth),
        "plotting.calibration_ranks": right(p.calibration_ranks, calibration=calibrated()),
        "plotting.contact_ellipses": right(p.contact_ellipses, contacts=contacts(), **truth),
        "plotting.contact_regions": right(p.contact_regions, posterior=contacts_drawn(), **truth),
        "plotting.contour": right(
            p.contour, x=[-0.5, 0.0, 0.5], contacts=contacts(), band=band(), gap=gap(), base=(0.0, 0.0), **truth
        ),
        "plotting.coverage": right(p.coverage, calibration=calibrated()),
        "plotting.design": right(p.design, found=designed()),
        "plotting.error_map": right(p.error_map, found=mapped()),
        "plotting.families": right(p.families, comparison=compared()),
        "plotting.gap": right(p.gap, found=gap(), **truth),
        "plotting.information": right(p.information, found=sensitivity()),
        "plotting.inspection": right(p.inspection, inspected=inspected()),
        "plotting.noise_shares": right(p.noise_shares, found=sensitivity()),
        "plotting.observables": right(p.observables, record=scanned().record, events=scanned().events),
        "plotting.overlaid": right(p.overlaid, bands={"one": band()}, contacts={"one": contacts()}),
        "plotting.pairs": right(p.pairs, posterior=posterior(), names=["a", "q"], truth={"a": 0.5}),
        "plotting.posterior_contours": right(p.posterior_contours, posterior=posterior(), contours=4, **truth),
        "plotting.predictive": right(p.predictive, record=measured(), predicted=predicted),
        "plotting.prior_contours": right(p.prior_contours, posterior=posterior(), contours=4, **truth),
        "plotting.required_noise": right(p.required_noise, found=sensitivity()),
        "plotting.required_rod": right(p.required_rod, found=rods_required()),
        "plotting.rods": right(p.rods, scan=scanned(), direction="forward", count=3),
        "plotting.style": right(_styled, name="print"),
        "plotting.tightening": right(p.tightening, implied=implied(), single=contacts(), **truth),
        "plotting.touched": right(p.touched, scan=scanned()),
        "plotting.trace": right(p.trace, posterior=posterior(), names=["a"]),
        "paper_figures.caption": right(f.caption, **figure, load_cell=None, width=7.0),
        "paper_figures.figure": right(f.figure, **figure),
        "paper_figures.draw_all": right(f.draw_all, **files),
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
