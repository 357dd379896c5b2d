"""The frame of a record: its forces are along the axes of the laboratory, or turn with the drive."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_choice
from tactile_bayes.errors import RecordError
from tactile_bayes.record.attributes import stated_frame
from tactile_bayes.record.schema import ATTRIBUTE_UNITS, CHANNELS, FRAMES, LOAD_CELL_UNITS, Frame
from tactile_bayes.record.table import Source
from tactile_bayes.record.validation import validate

# Entries of a load cell's data sheet that are valid only along its own axes; with errors of the encoder the angle
# between the frames is not known.
_BOUND = {name for name in LOAD_CELL_UNITS if "force" in name or name.startswith("drive_angle")} - {"force_noise"}
_BOUND |= {"degrees_of_freedom", "relative_noise", "lever_x", "lever_y"}


def frame_of(record: xr.Dataset) -> Frame:
    """Return the frame of a record's forces, "fixed" or "turning"; "fixed" if the record states none."""
    return stated_frame(record.attrs, Source())


def in_frame(record: xr.Dataset, frame: Frame) -> xr.Dataset:
    """Convert the forces of a record to a frame: along the axes of the laboratory, or along the rod and across it.

    A load cell that turns with the drive measures the support reaction (fAx, fAy) as

        force_x =  fAx cos φ0 + fAy sin φ0,  along the rod at the pivot,
        force_y = −fAx sin φ0 + fAy cos φ0,  across it,

    with the drive angle φ0, in both directions of the sweep. Without friction the first is half the square of the
    holding moment in tangential contact, in units of the rod, and greater in tip contact.

    Parameters
    ----------
    record : xr.Dataset
        A record. If it is in the frame already, it is returned unchanged.
    frame : {"fixed", "turning"}
        Frame of the result.

    Returns
    -------
    xr.Dataset
        The record with `force_x`, `force_y` and, if present, `truth_force_x` and `truth_force_y` in the frame, which
        its attribute `load_cell_frame` states. Forces are turned by the recorded drive angle, their true values by
        `truth_drive_angle` if there is one.

    Raises
    ------
    RecordError
        If `record` is not a record, or has only one of the two forces: a force in one frame depends on both forces in
        the other. (Both may be missing.) Also if its load cell has errors along its own axes, like a bias.
    ParameterError
        If the frame is invalid.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> record = in_frame(scan(paper_profile("II", q=0.5)).record, "turning")
    >>> excess = (record.force_x - record.holding_moment**2 / 2).where(record.truth_contact_phase == "tangential")
    >>> float(abs(excess).max()) < 1e-12
    True
    """
    check_choice("frame", frame, FRAMES)
    converted = validate(record)
    if frame_of(converted) == frame:
        return record
    _refuse_bound_to_frame(converted)
    sense = 1.0 if frame == "turning" else -1.0
    for prefix in ("", "truth_"):
        names = f"{prefix}force_x", f"{prefix}force_y"
        present = [name for name in names if name in converted]
        if not present:
            continue
        forces = _values(converted, names[0]), _values(converted, names[1])
        _refuse_half_a_force(names, forces, frame)
        angle = _values(converted, f"{prefix}drive_angle" if f"{prefix}drive_angle" in converted else "drive_angle")
        with np.errstate(over="ignore"):  # refused below, with the sample that it happened in
            forces = turned(*forces, sense * angle)
        for name in present:
            converted[name].values = forces[names.index(name)]
    converted.attrs["load_cell_frame"] = frame
    return validate(converted)


def turned(force_x: ArrayLike, force_y: ArrayLike, angle: ArrayLike) -> tuple[Floats, Floats]:
    """Return the components of forces along axes that are turned counter-clockwise by an angle [rad]."""
    x, y = np.asarray(force_x, dtype=np.float64), np.asarray(force_y, dtype=np.float64)
    cos, sin = np.cos(angle), np.sin(angle)
    return np.asarray(x * cos + y * sin), np.asarray(y * cos - x * sin)


def to_fixed_axes(angle: Floats) -> Floats:
    """Return matrices, shape (n, 3, 3), that turn loads (in the order of `CHANNELS`) back by angles, shape (n,)."""
    matrices = np.zeros((angle.size, 3, 3))
    matrices[:, 0, 0] = 1.0
    matrices[:, 1, 1] = matrices[:, 2, 2] = np.cos(angle)
    matrices[:, 2, 1] = np.sin(angle)
    matrices[:, 1, 2] = -matrices[:, 2, 1]
    return matrices


def _refuse_bound_to_frame(record: xr.Dataset) -> None:
    """Refuse a record whose data sheet has entries that are valid only in the frame of the measurement."""
    for name, value in record.attrs.items():
        entry = str(name).removeprefix("load_cell_")
        if name in ATTRIBUTE_UNITS and entry in _BOUND:
            raise RecordError(
                f"its load cell's {entry}, {value!r}, holds along the axes that it measured: keep the record in that "
                "frame, or take out what is known of the cell's errors (LoadCell.corrected) and remove what is left"
            )


def _values(record: xr.Dataset, name: str) -> Floats:
    """Return a column, NaN if there is none."""
    return np.asarray(record[name].values) if name in record else np.full(record.sizes["sample"], np.nan)


def _refuse_half_a_force(names: tuple[str, str], forces: tuple[Floats, Floats], frame: Frame) -> None:
    """Refuse samples with only one component of the force."""
    for (name, values), (other, others) in permutations(zip(names, forces, strict=True)):
        lacks = np.flatnonzero(np.isnan(values) & ~np.isnan(others))
        if not lacks.size:
            continue
        takes = f"a force in the {frame} frame takes both of the other frame"
        if name in CHANNELS:
            raise RecordError(
                f"{name} was not measured, and {takes}, so {other} would be lost too: keep the record in the frame in "
                "which it was measured; infer_contour takes it as it is"
            )
        what = f"sample {lacks[0]} has a {other}, but no {name}, and {takes}"
        raise RecordError(f"{what}: complete {name}, or remove {other}")
