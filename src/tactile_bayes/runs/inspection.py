"""An inspection of a record, in one folder."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from tactile_bayes import plotting
from tactile_bayes.diagnostics.inspection import Inspection
from tactile_bayes.diagnostics.inspection.inspection import shown_rig
from tactile_bayes.errors import ParameterError
from tactile_bayes.rig import Rig
from tactile_bayes.rig.rig_file import file_of
from tactile_bayes.runs.folder import Folder
from tactile_bayes.runs.names import INSPECTION


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
