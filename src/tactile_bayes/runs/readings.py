"""What is found in the readings of a record, each in one folder: contact points, and an inspection."""

from __future__ import annotations

import hashlib
import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import xarray as xr

from tactile_bayes import plotting
from tactile_bayes.arrays import Floats
from tactile_bayes.diagnostics.findings import contradiction
from tactile_bayes.diagnostics.inspection import CellSource, Inspection, known_cell
from tactile_bayes.diagnostics.inspection.inspection import shown_rig
from tactile_bayes.diagnostics.result_check import CONTRADICTION, doubtful_sides
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction import AXIAL_ALARM, contacts_of
from tactile_bayes.record import bases_of, carried_sweeps, validate, with_rod
from tactile_bayes.record.rig_entry import rig_entry
from tactile_bayes.rig.corrected import corrected
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.rig.rig_file import file_of
from tactile_bayes.runs.folder import Folder, Run, panels
from tactile_bayes.runs.names import INSPECTION, RECONSTRUCTION

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class ReconstructionRun(Run[xr.Dataset]):
    """Contacts from `reconstruct`, with the load cell that was assumed, and its source as of `known_cell`."""

    load_cell: LoadCell | None
    source: CellSource


def reconstruct_into(
    measured: xr.Dataset,
    out: str | os.PathLike[str],
    *,
    method: Literal["raw", "constrained"] | None = None,
    rig: Rig | None = None,
) -> ReconstructionRun:
    """Write contact points of a record, and a map of them, to a folder."""
    rig = rig_of(rig)
    measured = with_rod(validate(measured), rig.rod)
    cell, source = known_cell(measured, rig.load_cell)
    if method is None:
        method = "constrained" if cell is not None and cell.has_variances else "raw"
    contacts = contacts_of(corrected(measured, cell or LoadCell(), rig.known), method)
    with Folder(out, RECONSTRUCTION) as folder:
        folder.write_table("contacts", "contacts.csv", contacts)
        shown = contacts.contact_x.values[contacts.status.values == "ok"]
        if shown.size > 1 and np.ptp(shown) > 0.0:
            folder.draw("map", "contacts.png", _map, measured, contacts, shown)
    return ReconstructionRun(contacts, folder.files, cell, source)


def reconstruction_messages(contacts: xr.Dataset) -> tuple[str, ...]:
    """Return messages on the samples' statuses and the agreement of their loads; what is wrong comes first."""
    counts = Counter(contacts.status.values.tolist())
    fates = ", ".join(f"{count} {fate}" for fate, count in counts.most_common())
    found = int(np.count_nonzero(np.isfinite(contacts.contact_x.values)))
    sentences = [
        f"{found} contact point{'s' * (found != 1)} by the {contacts.attrs['method']} method; samples: {fates}."
    ]
    against: list[str] = [*doubtful_sides(contacts.attrs)]
    samples = int(contacts.attrs.get("misfit_samples", 0))
    if samples:
        total, chance = (float(contacts.attrs[name]) for name in ("misfit_sum", "misfit_probability"))
        words = f"Misfit {total:.0f} in {samples} samples"
        if math.isnan(chance):
            sentences.append(f"{words}; they share an unknown bias, so that no probability can be stated.")
        elif chance < CONTRADICTION:
            sentences.append(f"{words}.")
            against.append(contradiction(chance))
        else:
            sentences.append(f"{words}, which noise explains with probability {chance:.2g}.")
        score = float(contacts.attrs["axial_score"])
        if score < -AXIAL_ALARM:
            against.append(
                f"In tangential contact the force along the rod is too small by {-score:.0f} standard errors, as "
                f"with friction: state it (as in {rig_entry('friction', 0.2, 'unknown')}), or have infer find it."
            )
        elif score > AXIAL_ALARM:
            against.append(
                f"In tangential contact the force along the rod is too large by {score:.0f} standard errors: check the "
                "zero of the drive angle, the axes of the forces, and the rod."
            )
        elif math.isfinite(score):
            sentences.append(
                f"In tangential contact the force along the rod agrees with the moment ({score:+.1f} standard errors)."
            )
    return (*against, *sentences)


def _map(measured: xr.Dataset, contacts: xr.Dataset, shown: Floats) -> Axes:
    pivots = bases_of(measured)
    base = pivots[0] if len(pivots) == 1 and not carried_sweeps(measured) else None
    low, high = (float(end) for end in np.quantile(shown, [0.01, 0.99]))
    ends = [low, high] if high > low else [shown.min(), shown.max()]
    return plotting.contour(ends, contacts=contacts, base=base, ax=panels(1, 1, 7.0, 4.0)[0, 0])


def write_inspection(
    inspection: Inspection, out: str | os.PathLike[str], *, text: Sequence[str] = (), rig: Rig
) -> Mapping[str, Path]:
    """Write an inspection to a folder."""
    rig_file = _rig_file(inspection, rig)
    _refuse_edited(Path(out) / "rig.toml")
    with Folder(out, INSPECTION) as folder:
        with folder.file("rig", "rig.toml") as temporary:
            temporary.write_text(rig_file, encoding="utf-8", newline="\n")
        folder.write_lines("words", "inspection.txt", (*inspection.messages, *text))
        events = {f"{event}_drive_angle": event for event in ("onset", "snap_off")}
        folder.write_table("sweeps", "sweeps.csv", _spread(inspection.sweeps.rename(events), "side"))
        folder.write_table("channels", "channels.csv", inspection.channels)
        samples = _spread(inspection.samples, "channel")
        kept = inspection.record[["sweep", "drive_angle"]].drop_attrs(deep=False)
        numbers = {name: values.astype(int) if values.dtype == np.bool_ else values for name, values in samples.items()}
        folder.write_table("samples", "samples.csv", kept.assign(numbers))
        folder.draw("figure", "inspection.png", plotting.inspection, inspection)
    return folder.files


def _spread(table: xr.Dataset, dim: str) -> xr.Dataset:
    """Return a table in which each variable along a dimension is one for each label of it."""
    along = {name: values for name, values in table.data_vars.items() if dim in values.dims}
    labels = table[dim].values.tolist()
    columns = {f"{name}_{one}": values.sel({dim: one}, drop=True) for name, values in along.items() for one in labels}
    return table.drop_dims(dim).assign(columns)


def _rig_file(inspection: Inspection, rig: Rig) -> str:
    """Return the text of rig.toml, with a last line by which it is known again as long as nobody edits it."""
    against = [" ".join(message.split()) for message in inspection.messages] if inspection.is_suspect else []
    comments = "".join(f"# {message}\n" for message in ["inspect has found:", *against]) if against else ""
    text = file_of(shown_rig(inspection, rig).tables) + ("\n" + comments if comments else "")
    return f"{text}\n{_last_line(text)}"


def _last_line(text: str) -> str:
    return f"# Written by inspect ({hashlib.sha256(text.encode()).hexdigest()[:12]}), and not edited since.\n"


def _refuse_edited(path: Path) -> None:
    """Refuse to replace a rig.toml that inspect has not written, or that was edited since."""
    if not path.exists():
        return
    text, _, last = path.read_bytes().decode("utf-8", "replace").rstrip("\n").rpartition("\n")
    if f"{last}\n" != _last_line(text.removesuffix("\n") + "\n"):
        raise ParameterError(
            f"{path} was edited, or is another one, and would be lost: give it with --rig and another folder with "
            "--out, or remove it first"
        )
