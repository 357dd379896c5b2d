"""Background of a run as tables: sweeps, rig, priors, settings, attributes of the record, versions and hashes."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

import numpy as np

from tactile_bayes.record import MEASURED, carried_sweeps, travels_of
from tactile_bayes.report.findings import Findings
from tactile_bayes.report.meanings import is_direction, meaning_of
from tactile_bayes.report.wording import PageTable, Shown, fixed, percent, shown_as
from tactile_bayes.tasks.documents import read_json


def background_of(findings: Findings) -> dict[str, PageTable | None]:
    """Return the background tables by their names in the template."""
    return {
        "sweeps": _sweeps(findings),
        "priors": _priors(findings),
        "settings": _settings(findings),
        "rig": _rig(findings),
        "columns": _columns(findings),
        "record_attributes": _statements(findings),
        "versions": _versions(findings),
        "hashes": _hashes(findings),
    }


def _sweeps(findings: Findings) -> PageTable:
    """Return the sweeps, with first contact and snap-off as the readings alone bound them."""
    record, zero = findings.record, findings.zero
    carried, travels = carried_sweeps(record), travels_of(record)
    length = shown_as("contact_x", record["base_x"].attrs, np.r_[record.base_x.values, record.base_y.values])
    rows = []
    for number in zero["sweep"].values:
        rows_of = np.flatnonzero(record.sweep.values == number)
        angle = np.degrees(record.drive_angle.values[rows_of])
        of_sweep = zero.sel(sweep=number)
        drive = [fixed(angle[0], ".1f"), fixed(angle[-1], ".1f")]
        spans = [_between(of_sweep[f"{event}_drive_angle"].values) for event in ("onset", "snap_off")]
        if number in carried:
            unit = shown_as("contact_x", record["base_x"].attrs, travels[rows_of])
            drive.append(f"carried {unit.full(float(travels[rows_of[-1]]))}")
            spans = [_along(of_sweep[f"{event}_travel"].values, unit) for event in ("onset", "snap_off")]
        elif carried:
            drive.append("–")
        unloaded = int(np.count_nonzero(zero["unloaded"].values[rows_of]))
        base = f"({length.text(float(record.base_x[rows_of[0]]))}, {length.text(float(record.base_y[rows_of[0]]))})"
        row = [str(int(number)), str(record.direction.values[rows_of[0]]), f"{base} {length.name}".rstrip()]
        row += [str(rows_of.size), *drive, *spans, str(unloaded)]
        rows.append(row)
    heads = ["sweep", "direction", "base at the beginning" if carried else "pivot", "samples", "from φ₀ [°]", "to"]
    heads += ["base"] if carried else []
    heads += ["first contact between", "snap-off between", "unloaded"]
    return PageTable("Sweeps, with contact as the readings alone bound it", heads, rows, 3)


def _along(travels: Any, unit: Shown) -> str:
    if not np.isfinite(travels).any():
        return "not detected"
    return " and ".join(unit.full(float(travel)) if np.isfinite(travel) else "…" for travel in travels)


def _between(angles: Any) -> str:
    if not np.isfinite(angles).any():
        return "not detected"
    return " and ".join(fixed(float(angle), ".1f") + "°" if np.isfinite(angle) else "…" for angle in np.degrees(angles))


def _priors(findings: Findings) -> PageTable:
    """Return the priors as text."""
    family = str(findings.posterior.attrs["family"])
    stated = read_json(findings.posterior.attrs["priors"], "priors")
    rows = [[name, meaning_of(name, family), words] for name, words in stated.items() if not is_direction(name)]
    share = findings.posterior["prior"].attrs.get("share_within_reach")
    reach = "" if share is None else f"; {percent(round(float(share), 3))} of its draws are within the rod's reach"
    return PageTable(f"Priors, as distributions of scipy.stats{reach}", ["parameter", "meaning", "prior"], rows, 3)


def _settings(findings: Findings) -> PageTable:
    """Return the settings of the sampler."""
    attrs, stats = findings.posterior.attrs, findings.posterior["sample_stats"].attrs
    rows = [["seed", str(attrs["seed"])], ["sampler", str(attrs.get("sampler", ""))]]
    settings = read_json(attrs["settings"], "settings")
    rows += [[name, "none" if value is None else f"{value}"] for name, value in settings.items()]
    rows += [[name, str(int(stats[name]))] for name in ("steps_run", "steps_kept", "evaluations", "stuck")]
    rows.append(["seconds", f"{float(stats['seconds']):.3g}"])
    return PageTable("Sampler", ["setting", "value"], rows, 2)


def _rig(findings: Findings) -> PageTable:
    """Return rod, load cell, friction, and the unknowns of the rig."""
    attrs = findings.posterior.attrs
    names = [name for name in attrs if str(name).startswith(("rod_", "load_cell_"))]
    rows = [[str(name), _plain(attrs[name])] for name in (*names, "units", "friction")]
    unknowns = read_json(attrs["nuisances"], "nuisances")
    rows.append(["inferred beside the contour", ", ".join(unknowns) or "nothing: the rig is taken as stated"])
    return PageTable("Rig, as assumed; numbers in the units of the record", ["entry", "value"], rows, 2)


def _columns(findings: Findings) -> PageTable | None:
    """Return further columns of the record, which inference does not use."""
    rows = [
        [str(name), *(str(values.attrs.get(key, "")) for key in ("units", "long_name"))]
        for name, values in findings.record.data_vars.items()
        if name not in MEASURED
    ]
    return PageTable("Further columns of the record", ["column", "unit", "meaning"], rows, 3) if rows else None


def _statements(findings: Findings) -> PageTable | None:
    """Return attributes of the record that concern neither rod nor load cell."""
    said = read_json(findings.posterior.attrs.get("record_attributes", "{}"), "record_attributes")
    rows = [[name, _plain(value)] for name, value in said.items()]
    return PageTable("Attributes of the record", ["entry", "value"], rows, 2) if rows else None


def _plain(value: Any) -> str:
    return f"{value:.10g}" if isinstance(value, float | np.floating) else str(value)


def _versions(findings: Findings) -> PageTable:
    """Return the software of the inference and of this report."""
    attrs = findings.posterior.attrs
    stated = read_json(attrs.get("versions", "{}"), "versions")
    rows = [[name, of_name] for name, of_name in stated.items()]
    if not rows:
        rows = [["tactile-bayes", str(attrs.get("inference_library_version", "not stated"))]]
    rows.append(["this report: tactile-bayes", version("tactile-bayes")])
    return PageTable("Software of the inference", ["name", "version"], rows, 2)


def _hashes(findings: Findings) -> PageTable:
    """Return digests of the files and of the record."""
    attrs = findings.posterior.attrs
    rows = [["posterior.nc", findings.posterior_sha256], ["record, as stored in it", findings.record_sha256]]
    if attrs["data_sha256"] != findings.record_sha256:
        rows.append(["record, as used in the inference", str(attrs["data_sha256"])])
    if "record_file_sha256" in attrs:
        rows.append([f"file {attrs['record_file']}", str(attrs["record_file_sha256"])])
    return PageTable("SHA-256", ["of", "digest"], rows, 2)
