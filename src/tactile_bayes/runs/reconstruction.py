"""A reconstruction of contact points, in one folder."""

from __future__ import annotations

import math
import os
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import xarray as xr

from tactile_bayes import plotting
from tactile_bayes.arrays import Floats
from tactile_bayes.diagnostics.findings import contradiction
from tactile_bayes.diagnostics.inspection import CellSource, known_cell
from tactile_bayes.diagnostics.result_check import CONTRADICTION, doubtful_sides
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction import AXIAL_ALARM, contacts_of
from tactile_bayes.record import bases_of, carried_sweeps, validate, with_rod
from tactile_bayes.record.rig_entry import rig_entry
from tactile_bayes.rig.corrected import corrected
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.runs.folder import Folder, Run, panels
from tactile_bayes.runs.names import RECONSTRUCTION

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
