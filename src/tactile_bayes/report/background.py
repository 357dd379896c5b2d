"""Background of a run as tables, from its sweeps to its hashes; its command, and lines of Python that repeat it."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from tactile_bayes.distributions import UNWRITTEN
from tactile_bayes.inference.result import OTHER, is_streamed
from tactile_bayes.record import MEASURED, carried_sweeps, travels_of
from tactile_bayes.report.findings import Findings
from tactile_bayes.report.wording import PageTable, fixed, is_direction, meaning_of, percent, shown_as
from tactile_bayes.tasks.documents import read_json


def background_of(findings: Findings) -> dict[str, Any]:
    """Return the background tables, and how to repeat the run, by their names in the template."""
    attrs = findings.posterior.attrs
    return {
        "sweeps": _sweeps(findings),
        "priors": _priors(findings),
        "settings": _settings(findings),
        "rig": _rig(findings),
        "columns": _columns(findings),
        "record_attributes": _statements(findings),
        "versions": _versions(findings),
        "hashes": _hashes(findings),
        "command": shlex.join(read_json(attrs["command"], "command")) if "command" in attrs else "",
        "python": python_lines(attrs),
        "hindrances": hindrances(attrs),
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
        drive, place = [fixed(angle[0], ".1f"), fixed(angle[-1], ".1f")], "drive_angle"
        text: Callable[[float], str] = _degrees
        if number in carried:
            unit = shown_as("contact_x", record["base_x"].attrs, travels[rows_of])
            drive.append(f"carried {unit.full(float(travels[rows_of[-1]]))}")
            place, text = "travel", unit.full
        elif carried:
            drive.append("–")
        spans = [_between(of_sweep[f"{event}_{place}"].values, text) for event in ("onset", "snap_off")]
        unloaded = int(np.count_nonzero(zero["unloaded"].values[rows_of]))
        base = f"({length.text(float(record.base_x[rows_of[0]]))}, {length.text(float(record.base_y[rows_of[0]]))})"
        row = [str(int(number)), str(record.direction.values[rows_of[0]]), f"{base} {length.name}".rstrip()]
        row += [str(rows_of.size), *drive, *spans, str(unloaded)]
        rows.append(row)
    heads = ["sweep", "direction", "base at the beginning" if carried else "pivot", "samples", "from φ₀ [°]", "to"]
    heads += ["base"] if carried else []
    heads += ["first contact between", "snap-off between", "unloaded"]
    return PageTable("Sweeps, with contact as the readings alone bound it", heads, rows, 3)


def _degrees(angle: float) -> str:
    return fixed(math.degrees(angle), ".1f") + "°"


def _between(values: Any, text: Callable[[float], str]) -> str:
    if not np.isfinite(values).any():
        return "not detected"
    return " and ".join(text(float(value)) if np.isfinite(value) else "…" for value in values)


def _priors(findings: Findings) -> PageTable:
    family = str(findings.posterior.attrs["family"])
    stated = read_json(findings.posterior.attrs["priors"], "priors")
    rows = [[name, meaning_of(name, family), words] for name, words in stated.items() if not is_direction(name)]
    share = findings.posterior["prior"].attrs.get("share_within_reach")
    reach = "" if share is None else f"; {percent(round(float(share), 3))} of its draws are within the rod's reach"
    return PageTable(f"Priors, as distributions of scipy.stats{reach}", ["parameter", "meaning", "prior"], rows, 3)


def _settings(findings: Findings) -> PageTable:
    attrs, stats = findings.posterior.attrs, findings.posterior["sample_stats"].attrs
    rows = {"seed": attrs["seed"], "sampler": attrs.get("sampler", "")}
    rows |= {name: "none" if v is None else v for name, v in read_json(attrs["settings"], "settings").items()}
    rows |= {name: int(stats[name]) for name in ("steps_run", "steps_kept", "evaluations", "stuck")}
    return _pairs("Sampler", {**rows, "seconds": f"{float(stats['seconds']):.3g}"}, "setting")


def _rig(findings: Findings) -> PageTable:
    """Return rod, load cell, friction, and the unknowns of the rig."""
    attrs = findings.posterior.attrs
    names = [str(name) for name in attrs if str(name).startswith(("rod_", "load_cell_"))]
    unknowns = ", ".join(read_json(attrs["nuisances"], "nuisances")) or "nothing: the rig is taken as stated"
    rows = {name: _plain(attrs[name]) for name in (*names, "units", "friction")}
    caption = "Rig, as assumed; numbers in the units of the record"
    return _pairs(caption, {**rows, "inferred beside the contour": unknowns}, "entry")


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
    rows = {name: _plain(value) for name, value in said.items()}
    return _pairs("Attributes of the record", rows, "entry") if rows else None


def _plain(value: Any) -> str:
    return f"{value:.10g}" if isinstance(value, float | np.floating) else str(value)


def _versions(findings: Findings) -> PageTable:
    """Return the software of the inference and of this report."""
    attrs = findings.posterior.attrs
    rows = read_json(attrs.get("versions", "{}"), "versions")
    rows = rows or {"tactile-bayes": attrs.get("inference_library_version", "not stated")}
    own = {"this report: tactile-bayes": version("tactile-bayes")}
    return _pairs("Software of the inference", rows | own, "name", "version")


def _hashes(findings: Findings) -> PageTable:
    """Return digests of the files and of the record."""
    attrs = findings.posterior.attrs
    rows = {"posterior.nc": findings.posterior_sha256, "record, as stored in it": findings.record_sha256}
    if attrs["data_sha256"] != findings.record_sha256:
        rows["record, as used in the inference"] = attrs["data_sha256"]
    if "record_file_sha256" in attrs:
        rows[f"file {attrs['record_file']}"] = attrs["record_file_sha256"]
    return _pairs("SHA-256", rows, "of", "digest")


def _pairs(caption: str, rows: Mapping[str, Any], first: str, second: str = "value") -> PageTable:
    return PageTable(caption, [first, second], [[name, str(value)] for name, value in rows.items()], 2)


def python_lines(attrs: Mapping[Any, Any]) -> str:
    """Return lines of Python that infer the posterior again from the record in its file, and compare the draws."""
    seed, settings = str(attrs["seed"]), read_json(attrs["settings"], "settings")
    streamed = is_streamed(attrs)
    options = ["family=tb.Family.of(stored),", "rig=tb.Rig.of(stored),", f"rng={_seed(seed)},"]
    if streamed:
        options += [f"{name}={value!r}," for name, value in settings.items()]
    else:
        options += ["settings=tb.SamplerSettings(", *(f"    {n}={v!r}," for n, v in settings.items()), "),"]
    lines = [
        *(["import numpy as np"] if not seed.isdigit() else []),
        "import tactile_bayes as tb",
        "import xarray as xr",
        "",
        'stored = tb.read_result("posterior.nc")',
        'columns = [stored[group].to_dataset() for group in ("constant_data", "observed_data")]',
        "record = xr.merge(columns).assign_attrs(stored.attrs)",
        *(["stream = tb.Stream("] if streamed else ["again = tb.infer_contour(", "    record,"]),
        *(f"    {option}" for option in options),
        ")",
        *(["stream.update(record)", "again = stream.posterior()"] if streamed else []),
        'print(again["posterior"].equals(stored["posterior"]))',
    ]
    return "\n".join(lines)


def hindrances(attrs: Mapping[Any, Any]) -> list[str]:
    """Return reasons why the lines of Python may not give the same draws."""
    found = []
    if is_streamed(attrs):
        found.append("The samples came in blocks: taken at once, they give other draws of the same posterior.")
    elif str(attrs.get("sampler")).startswith(OTHER):
        found.append(f"The draws are of {attrs['sampler']}: infer_contour gives others of the same posterior.")
    if read_json(attrs["settings"], "settings").get("max_seconds") is not None:
        found.append("The run could end by the clock, after max_seconds: then the number of its steps is not repeated.")
    if "interrupted" in attrs["message"]:
        found.append("The run was interrupted: without an interrupt it makes more steps.")
    for text, argument in (("rig", "rig"), ("family_parameters", "family")):
        if attrs.get(text) == UNWRITTEN:
            found.append(f"A prior of your own is none of SciPy's: give {argument}= as before.")
    if not attrs.get("events", 1):
        found.append("Unloaded samples were left out (events=False), and are not in the file: drifts may differ.")
    return found


def _seed(words: str) -> str:
    """Return Python code for the seed, from the text of the attribute."""
    if words.isdigit():
        return words
    entropy, _, key = words.partition(", spawn key ")
    return f"np.random.SeedSequence({entropy}, spawn_key={key or '()'})"
