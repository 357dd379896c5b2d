"""Bayesian inverse problems for tactile sensors made of a flexible rod on a pivot.

Contour → scan → record → load cell → contact points and contour posterior → band:

>>> import tactile_bayes as tb
>>> scan = tb.scan(tb.contours.paper_profile("II", q=0.5))
>>> measured = tb.LoadCell(force_noise=0.05, moment_noise=0.02).measure(scan.record, rng=1)
>>> contacts = tb.reconstruct(measured)

Names are loaded when they are first used, so that importing the package is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_MODULES = ("contours", "datasets", "errors", "paper_figures", "plotting")

_HOMES = {
    "Family": "inference.family",
    "LoadCell": "load_cell",
    "Misspecification": "calibration.misspecification",
    "Motion": "sweep",
    "OrnsteinUhlenbeck": "load_cell",
    "Plan": "planning.plan",
    "RandomWalk": "load_cell",
    "Rig": "rig.rig",
    "Rod": "mechanics.rods.rod",
    "Rotation": "sweep",
    "SamplerSettings": "inference.ensembles",
    "Stream": "inference.streams.stream",
    "StreamComparison": "comparison.streams",
    "Translation": "sweep",
    "calibrate": "calibration.calibrate",
    "calibrate_rig": "inference.contour",
    "calibration_replicate": "calibration.calibrate",
    "check_record": "diagnostics.record_check",
    "check_units_and_signs": "diagnostics.units_and_signs",
    "compare_families": "comparison.families",
    "contact_moments": "uncertainty.contact_moments",
    "contact_region": "uncertainty.contact_region",
    "contour_band": "uncertainty.band",
    "design": "planning.design",
    "elastica": "mechanics",
    "equilibria": "sweep",
    "error_map": "planning.error_map",
    "gap": "uncertainty.gap",
    "implied_contacts": "uncertainty.implied_contacts",
    "in_frame": "record",
    "infer_contacts": "inference.contact_posterior",
    "infer_contour": "inference.contour",
    "infer_contours": "runs.many",
    "infer_point_load": "inference.point_load",
    "inspect_record": "diagnostics.inspection",
    "make_record": "record",
    "normal_band": "uncertainty.normal_band",
    "predictive_interval": "uncertainty.predictive_interval",
    "read_record": "record",
    "read_result": "inference.result",
    "reconstruct": "reconstruction",
    "required_noise": "planning.requirement",
    "required_rod": "planning.requirement",
    "rest_of_sweep": "planning.rest_of_sweep",
    "scan": "sweep",
    "scan_many": "sweep",
    "sensitivity": "planning.sensitivity",
    "to_arviz": "inference.result",
    "trust": "assessment.trust",
    "verdicts": "diagnostics.verdicts",
    "write_record": "record",
    "write_report": "report",
    "write_result": "inference.result",
    "zero_load": "load_cell",
}

__all__ = ["__version__", *_MODULES, *_HOMES]

if TYPE_CHECKING:
    from tactile_bayes import contours as contours
    from tactile_bayes import datasets as datasets
    from tactile_bayes import errors as errors
    from tactile_bayes import paper_figures as paper_figures
    from tactile_bayes import plotting as plotting
    from tactile_bayes.assessment.trust import trust as trust
    from tactile_bayes.calibration.calibrate import calibrate as calibrate
    from tactile_bayes.calibration.calibrate import calibration_replicate as calibration_replicate
    from tactile_bayes.calibration.misspecification import Misspecification as Misspecification
    from tactile_bayes.comparison.families import compare_families as compare_families
    from tactile_bayes.comparison.streams import StreamComparison as StreamComparison
    from tactile_bayes.diagnostics.inspection import inspect_record as inspect_record
    from tactile_bayes.diagnostics.record_check import check_record as check_record
    from tactile_bayes.diagnostics.units_and_signs import check_units_and_signs as check_units_and_signs
    from tactile_bayes.diagnostics.verdicts import verdicts as verdicts
    from tactile_bayes.inference.contact_posterior import infer_contacts as infer_contacts
    from tactile_bayes.inference.contour import calibrate_rig as calibrate_rig
    from tactile_bayes.inference.contour import infer_contour as infer_contour
    from tactile_bayes.inference.ensembles import SamplerSettings as SamplerSettings
    from tactile_bayes.inference.family import Family as Family
    from tactile_bayes.inference.point_load import infer_point_load as infer_point_load
    from tactile_bayes.inference.result import read_result as read_result
    from tactile_bayes.inference.result import to_arviz as to_arviz
    from tactile_bayes.inference.result import write_result as write_result
    from tactile_bayes.inference.streams.stream import Stream as Stream
    from tactile_bayes.load_cell import LoadCell as LoadCell
    from tactile_bayes.load_cell import OrnsteinUhlenbeck as OrnsteinUhlenbeck
    from tactile_bayes.load_cell import RandomWalk as RandomWalk
    from tactile_bayes.load_cell import zero_load as zero_load
    from tactile_bayes.mechanics import elastica as elastica
    from tactile_bayes.mechanics.rods.rod import Rod as Rod
    from tactile_bayes.planning.design import design as design
    from tactile_bayes.planning.error_map import error_map as error_map
    from tactile_bayes.planning.plan import Plan as Plan
    from tactile_bayes.planning.requirement import required_noise as required_noise
    from tactile_bayes.planning.requirement import required_rod as required_rod
    from tactile_bayes.planning.rest_of_sweep import rest_of_sweep as rest_of_sweep
    from tactile_bayes.planning.sensitivity import sensitivity as sensitivity
    from tactile_bayes.reconstruction import reconstruct as reconstruct
    from tactile_bayes.record import in_frame as in_frame
    from tactile_bayes.record import make_record as make_record
    from tactile_bayes.record import read_record as read_record
    from tactile_bayes.record import write_record as write_record
    from tactile_bayes.report import write_report as write_report
    from tactile_bayes.rig.rig import Rig as Rig
    from tactile_bayes.runs.many import infer_contours as infer_contours
    from tactile_bayes.sweep import Motion as Motion
    from tactile_bayes.sweep import Rotation as Rotation
    from tactile_bayes.sweep import Translation as Translation
    from tactile_bayes.sweep import equilibria as equilibria
    from tactile_bayes.sweep import scan as scan
    from tactile_bayes.sweep import scan_many as scan_many
    from tactile_bayes.uncertainty.band import contour_band as contour_band
    from tactile_bayes.uncertainty.contact_moments import contact_moments as contact_moments
    from tactile_bayes.uncertainty.contact_region import contact_region as contact_region
    from tactile_bayes.uncertainty.gap import gap as gap
    from tactile_bayes.uncertainty.implied_contacts import implied_contacts as implied_contacts
    from tactile_bayes.uncertainty.normal_band import normal_band as normal_band
    from tactile_bayes.uncertainty.predictive_interval import predictive_interval as predictive_interval


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return importlib.import_module(f"tactile_bayes.{name}")
    if name in _HOMES:
        value = getattr(importlib.import_module(f"tactile_bayes.{_HOMES[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'tactile_bayes' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
