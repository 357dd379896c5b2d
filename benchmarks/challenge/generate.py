"""Makes records, truth and metadata of the challenge: `python -m benchmarks.challenge.generate OUT/`.

They follow from challenge.toml. Each record is read back as its rig.toml states it, and compared.
"""

from __future__ import annotations

import io
import json
import re
import sys
import tarfile
import tomllib
import warnings
from collections.abc import Iterator, Mapping
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

import tactile_bayes as tb
from benchmarks.challenge.score import HERE, RECORDS, STEP, TRUTH
from benchmarks.traced import KINDS, SWEPT, points
from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.errors import ClearanceWarning, ContourError, ParameterError, ReachError
from tactile_bayes.record.quantity import converted, unit_of
from tactile_bayes.rig.rig_file import file_of

DESIGN: dict[str, Any] = tomllib.loads((HERE / "challenge.toml").read_text(encoding="utf-8"))
RODS = ((0.12, 206e9), (0.2, 206e9), (0.06, 60e9))  # length [m] and Young's modulus [N/m²]: steel, and nitinol
THICKNESS, SCATTER = 0.003, 1e-3  # of rods, and of 25 traced points, over the length
# How laboratories write their files: the separator (with a semicolon, decimal commas), and columns as in rig.toml.
COLUMNS = ("base_x", "base_y", "drive_angle", "holding_moment", "force_x", "force_y")
STYLES = (
    (",", "slide_mm", "lift_mm", "motor_deg", "Mz_Nmm", "Fx_mN", "Fy_mN"),
    (";", "Schlitten [mm]", "Hub [mm]", "90-Winkel [deg]", "-Mz [N mm]", "-Fx [mN]", "-Fy [mN]"),
    ("\t", "X [m]", "Y [m]", "phi [rad]", "M0 [N m]", "FAx [N]", "FAy [N]"),
    (",", "slide_mm", "lift_mm", "-180+encoder [deg]", "T [gf mm]", "-Lx [gf]", "Ly [gf]"),
)
_SOURCE = re.compile(r"(?P<shift>-?\d+(?=[-+]))?(?P<sign>[-+]?)(?P<name>\w+ \[(?P<unit>.+)\]|\w+_(?P<end>\w+))")


class Swept(NamedTuple):
    """A record in rod lengths; its contour, with the family and its parameters; its rig; its traced points, if any."""

    record: xr.Dataset
    contour: tb.contours.Contour
    family: str
    stated: dict[str, float]
    rig: Mapping[str, float]
    trace: tuple[Any, Any] | None = None


def specification(stratum: dict[str, Any], **other: Any) -> dict[str, Any]:
    own = {name: value for name, value in stratum.items() if name not in ("suspected", "hidden", "traced")}
    return {**DESIGN["common"], **own, "seed": DESIGN["seed"] + DESIGN["strata"].index(stratum), **other}


def drawn(spec: dict[str, Any], index: int) -> Swept:
    record = tb.datasets.record(spec, index)
    truth = {n.removeprefix("truth_"): v for n, v in record.attrs.items() if n.startswith("truth_")}
    family = truth.pop("family")
    stated = {n.removeprefix("contour_"): truth.pop(n) for n in [*truth] if n.startswith("contour_")}
    return Swept(record, tb.datasets.contour_of(record), family, stated, truth)


def traced(stratum: dict[str, Any]) -> Iterator[Swept]:
    """Yield sweeps with rods of their own, that were traced, along contours of the specification."""
    spec = specification(stratum, records=20 * stratum["records"])
    for index in range(spec["records"]):
        one, rng = drawn(spec, index), np.random.default_rng([spec["seed"], index])
        curvature = KINDS[SWEPT[index % len(SWEPT)]](rng)
        try:
            rod = tb.Rod(diameter=THICKNESS, rest_curvature=curvature)
            rig = tb.Rig(rod, tb.LoadCell.from_record(one.record)).draw(rng)
            with warnings.catch_warnings(action="ignore", category=ClearanceWarning):  # those are left out below
                scan = tb.scan(one.contour, rig, drive_angles=np.radians(np.linspace(0.0, 180.0, 91)))
        except (ContourError, ParameterError, ReachError):
            continue
        if all(sweep.clear for sweep in scan.sweeps):
            trace = points(curvature, 25, SCATTER, rng)[:2]
            yield one._replace(record=rig.measure(scan.record, rng=rng), rig=rig.known, trace=trace)


def records(only: str = "") -> Iterator[tuple[str, dict[str, bytes], dict[str, Any]]]:
    """Yield the number, the files and the truth of each record, or of those of one stratum."""
    every = [(stratum, index) for stratum in DESIGN["strata"] for index in range(stratum["records"])]
    numbers = np.random.default_rng(DESIGN["seed"]).permutation(len(every))  # which do not tell the stratum
    of_traced = {stratum["name"]: traced(stratum) for stratum in DESIGN["strata"] if stratum.get("traced")}
    for (stratum, index), number in zip(every, numbers.tolist(), strict=True):
        if only not in ("", stratum["name"]):
            continue
        own = of_traced.get(stratum["name"])
        yield f"{number:03}", *written(next(own) if own else drawn(specification(stratum), index), stratum, number)


def written(swept: Swept, stratum: dict[str, Any], number: int) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Return the files of a record by name, and its truth."""
    length, modulus = RODS[number % len(RODS)]
    shape = tb.record.rod_of(swept.record) if swept.trace is None else tb.Rod(diameter=THICKNESS)
    rod = tb.Rod(
        length,
        _rounded(tb.Rod.circular(length, THICKNESS * length, modulus).flexural_rigidity),
        diameter=_rounded(shape.diameter * length),
        rest_curvature=_rounded(float(shape.rest_curvature) / length),
        taper=_rounded(shape.taper),
    )
    plain = tb.record.with_rod(swept.record, tb.Rod())
    record = tb.record.to_si(plain, tb.Rod(length, rod.flexural_rigidity))
    entries = tb.LoadCell.from_record(record).entries().items()
    cell: dict[str, Any] = {n: _rounded(v) for n, v in entries if n not in stratum.get("hidden", ())}
    if (frame := record.attrs["load_cell_frame"]) != "fixed":
        cell["frame"] = frame
    separator, *style = STYLES[number % len(STYLES)]
    sources = {name: of for name, of in zip(COLUMNS, style, strict=True) if np.any(record[name])}
    noise = (cell["moment_noise"], cell["force_noise"], cell["force_noise"])
    resolutions = dict(zip(COLUMNS, (1e-6, 1e-6, 1e-4, *(0.1 * of for of in noise)), strict=True))
    table = {name: record[name].values.astype(str).tolist() for name in ("sweep", "direction")}
    for name, source in sources.items():
        head, cells = _as_written(record[name], source, resolutions[name])
        table[head] = cells
    unknown: Any = dict.fromkeys(stratum.get("suspected", ()), "default")
    tables = tb.Rig(rod, tb.LoadCell.from_entries(cell), unknown, file=sources).tables
    files = {}
    if swept.trace is not None:
        tables["rod"] = {"shape": "shape.csv", "flexural_rigidity": rod.flexural_rigidity, "diameter": rod.diameter}
        trace = zip("xy", swept.trace, strict=True)
        files["shape.csv"] = _csv(",", {name: [f"{length * v:.7f}" for v in of] for name, of in trace})
    files |= {"record.csv": _csv(separator, table), "rig.toml": file_of(tables).encode()}
    _compare(files, record, {name: resolutions[name] for name in sources})
    return files, {"stratum": stratum["name"], "length": length, **_truth(swept, record, length)}


def _rounded(number: float, digits: int = 6) -> float:
    return float(f"{number:.{digits}g}")


def _as_written(values: xr.DataArray, source: str, resolution: float) -> tuple[str, list[str]]:
    """Return the head and the cells of a column, with the digits that a resolution needs."""
    found = _SOURCE.fullmatch(source)
    assert found is not None, source
    units = unit_of(values.attrs["units"]), unit_of(found["unit"] or found["end"])
    inside = converted(values.values.copy(), *units) - float(found["shift"] or 0.0)
    digits = max(0, int(np.ceil(-np.log10(converted(resolution, *units)))))
    return found["name"], [f"{value:.{digits}f}" for value in (-inside if found["sign"] == "-" else inside) + 0.0]


def _csv(separator: str, columns: Mapping[str, list[str]]) -> bytes:
    rows = (separator.join(row) for row in zip(*columns.values(), strict=True))
    text = "\n".join([separator.join(columns), *(row.replace(".", ",") if separator == ";" else row for row in rows)])
    return f"{text}\n".encode()


def _compare(files: Mapping[str, bytes], record: xr.Dataset, resolutions: Mapping[str, float]) -> None:
    """Read a record as a laboratory does, and refuse what has become another."""
    with TemporaryDirectory() as folder:
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        found = tb.read_record(Path(folder) / "record.csv", tb.Rig.read(Path(folder) / "rig.toml"))
    assert all(np.array_equal(found[name], record[name]) for name in ("sweep", "direction"))
    for name, resolution in resolutions.items():
        assert np.allclose(found[name], record[name], rtol=0.0, atol=resolution), name


def _truth(swept: Swept, record: xr.Dataset, length: float) -> dict[str, Any]:
    """Return true heights at the grid points between the outermost contacts, and which of these the rod touched."""
    x = record.truth_contact_x.values
    sweeps = [x[(record.sweep.values == sweep) & np.isfinite(x)] for sweep in np.unique(record.sweep)]
    ends = np.array([(of.min(), of.max()) for of in sweeps if of.size]) / (STEP * length)
    grid = np.arange(np.ceil(ends.min()), np.floor(ends.max()) + 1)
    touched = np.any([(low <= grid) & (grid <= high) for low, high in ends], axis=0)
    powers = FAMILIES[swept.family].length_powers
    return {
        "object": "any" if swept.family == "shape-free" else swept.family,
        "contour": {name: _rounded(v * length ** powers[name], 9) for name, v in swept.stated.items()},
        "rig": {name: _rounded(value) for name, value in swept.rig.items()},
        "first": int(grid[0]),
        "height": [_rounded(height, 7) for height in length * swept.contour.height(STEP * grid)],
        "touched": "".join(map(str, touched.astype(int))),
    }


def archive(files: Mapping[str, bytes]) -> bytes:
    """Return the same bytes for the same files."""
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w:xz", preset=9, format=tarfile.USTAR_FORMAT) as tar:
        for name, content in files.items():
            entry = tarfile.TarInfo(f"records/{name}")
            entry.size = len(content)
            tar.addfile(entry, io.BytesIO(content))
    return out.getvalue()


def main(out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    made = {number: (files, truth) for number, files, truth in sorted(records(), key=lambda each: each[0])}
    inside = {f"{number}/{name}": content for number, (files, _) in made.items() for name, content in files.items()}
    truths = {number: truth for number, (_, truth) in made.items()}
    objects = {"record": [*truths], "object": [], "length_m": []}
    for truth in truths.values():
        objects["object"].append(truth["object"])
        objects["length_m"].append(f"{truth['length']:g}")
    lines = ",\n".join(f'"{number}": {json.dumps(truth)}' for number, truth in truths.items())
    contents = {
        RECORDS: archive({**inside, "objects.csv": _csv(",", objects)}),
        TRUTH: f"{{\n{lines}\n}}\n".encode(),
    }
    sums = {name: {"bytes": len(content), "sha256": sha256(content).hexdigest()} for name, content in contents.items()}
    metadata = json.dumps({**DESIGN["metadata"], "version": DESIGN["version"], "files": sums}, indent=1)
    for name, content in {**contents, "metadata.json": f"{metadata}\n".encode()}.items():
        (out / name).write_bytes(content)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
