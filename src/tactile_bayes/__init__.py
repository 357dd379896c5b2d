"""Bayesian inverse problems for tactile sensors made of a flexible rod on a pivot.

Contour → scan → record → load cell → contact points and contour posterior → band:

>>> import tactile_bayes as tb
>>> scan = tb.scan(tb.contours.paper_profile("II", q=0.5))
>>> measured = tb.LoadCell(force_noise=0.05, moment_noise=0.02).measure(scan.record, rng=1)
>>> contacts = tb.reconstruct(measured)

Names are loaded when they are first used, so that importing the package is quick. What is needed more seldom lies in
rooms, like `tb.planning`, `tb.uncertainty`, `tb.diagnostics`, `tb.load_cell` and `tb.mechanics`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "1.0.0"

_MODULES = ("contours", "datasets", "errors", "plotting")
_ROOMS = (
    "calibration",
    "comparison",
    "diagnostics",
    "load_cell",
    "mechanics",
    "paper_figures",
    "planning",
    "record",
    "tasks",
    "uncertainty",
)
"""Reached as attributes, for what is needed more seldom."""

_HOMES = {
    "Family": "inference.family",
    "LoadCell": "load_cell",
    "Motion": "sweep",
    "Rig": "rig.rig",
    "Rod": "mechanics.rods.rod",
    "Rotation": "sweep",
    "SamplerSettings": "inference.ensembles",
    "Stream": "inference.streams.stream",
    "Translation": "sweep",
    "calibrate": "calibration.calibrate",
    "calibrate_rig": "inference.contour",
    "causes": "assessment.causes",
    "check": "diagnostics.result_check",
    "compare_families": "comparison.families",
    "contour_band": "uncertainty.band",
    "design": "planning.design",
    "equilibria": "sweep",
    "gap": "uncertainty.gap",
    "infer_contacts": "inference.contact_posterior",
    "infer_contour": "inference.contour",
    "infer_contours": "runs.many",
    "inspect_record": "diagnostics.inspection",
    "make_record": "rig",
    "read_record": "rig",
    "read_result": "inference.result",
    "reconstruct": "reconstruction",
    "result": "inference.target",
    "scan": "sweep",
    "sensitivity": "planning.sensitivity",
    "target": "inference.target",
    "to_arviz": "inference.result",
    "trust": "assessment.trust",
    "write_record": "record",
    "write_report": "report",
    "write_result": "inference.result",
}

__all__ = ["__version__", *_MODULES, *_HOMES]

if TYPE_CHECKING:
    from tactile_bayes import calibration as calibration
    from tactile_bayes import comparison as comparison
    from tactile_bayes import contours as contours
    from tactile_bayes import datasets as datasets
    from tactile_bayes import diagnostics as diagnostics
    from tactile_bayes import errors as errors
    from tactile_bayes import load_cell as load_cell
    from tactile_bayes import mechanics as mechanics
    from tactile_bayes import paper_figures as paper_figures
    from tactile_bayes import planning as planning
    from tactile_bayes import plotting as plotting
    from tactile_bayes import record as record
    from tactile_bayes import tasks as tasks
    from tactile_bayes import uncertainty as uncertainty
    from tactile_bayes.assessment.causes import causes as causes
    from tactile_bayes.assessment.trust import trust as trust
    from tactile_bayes.calibration.calibrate import calibrate as calibrate
    from tactile_bayes.comparison.families import compare_families as compare_families
    from tactile_bayes.diagnostics.inspection import inspect_record as inspect_record
    from tactile_bayes.diagnostics.result_check import check as check
    from tactile_bayes.inference.contact_posterior import infer_contacts as infer_contacts
    from tactile_bayes.inference.contour import calibrate_rig as calibrate_rig
    from tactile_bayes.inference.contour import infer_contour as infer_contour
    from tactile_bayes.inference.ensembles import SamplerSettings as SamplerSettings
    from tactile_bayes.inference.family import Family as Family
    from tactile_bayes.inference.result import read_result as read_result
    from tactile_bayes.inference.result import to_arviz as to_arviz
    from tactile_bayes.inference.result import write_result as write_result
    from tactile_bayes.inference.streams.stream import Stream as Stream
    from tactile_bayes.inference.target import result as result
    from tactile_bayes.inference.target import target as target
    from tactile_bayes.load_cell import LoadCell as LoadCell
    from tactile_bayes.mechanics.rods.rod import Rod as Rod
    from tactile_bayes.planning.design import design as design
    from tactile_bayes.planning.sensitivity import sensitivity as sensitivity
    from tactile_bayes.reconstruction import reconstruct as reconstruct
    from tactile_bayes.record import write_record as write_record
    from tactile_bayes.report import write_report as write_report
    from tactile_bayes.rig import make_record as make_record
    from tactile_bayes.rig import read_record as read_record
    from tactile_bayes.rig.rig import Rig as Rig
    from tactile_bayes.runs.many import infer_contours as infer_contours
    from tactile_bayes.sweep import Motion as Motion
    from tactile_bayes.sweep import Rotation as Rotation
    from tactile_bayes.sweep import Translation as Translation
    from tactile_bayes.sweep import equilibria as equilibria
    from tactile_bayes.sweep import scan as scan
    from tactile_bayes.uncertainty.band import contour_band as contour_band
    from tactile_bayes.uncertainty.gap import gap as gap


def __getattr__(name: str) -> Any:
    if name in _MODULES or name in _ROOMS:
        return importlib.import_module(f"tactile_bayes.{name}")
    if name in _HOMES:
        value = getattr(importlib.import_module(f"tactile_bayes.{_HOMES[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'tactile_bayes' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *_ROOMS])
