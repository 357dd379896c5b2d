"""An inspection of a record, in one folder."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tactile_bayes import plotting
from tactile_bayes.diagnostics.inspection import Inspection
from tactile_bayes.runs.folder import Folder
from tactile_bayes.runs.names import INSPECTION

__all__ = ["write_inspection"]


def write_inspection(
    inspection: Inspection, out: str | os.PathLike[str], *, text: Sequence[str] = ()
) -> Mapping[str, Path]:
    """Write an inspection to a folder.

    Parameters
    ----------
    inspection : Inspection
        From `inspect_record`.
    out : path-like
        Folder for inspection.txt, sweeps.csv, channels.csv, samples.csv (a line for every sample, with 1 where
        something looks wrong) and inspection.png; created if missing. Files of these names in it are
        replaced, all together.
    text : sequence of str
        Lines that follow the messages in inspection.txt.

    Returns
    -------
    mapping of str to Path
        Files by content.

    Examples
    --------
    >>> import tempfile
    >>> from tactile_bayes import inspect_record, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> record = scan(paper_profile("II", q=0.5), drive_step=0.05).record
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sorted(path.name for path in write_inspection(inspect_record(record), folder).values())
    ['channels.csv', 'inspection.png', 'inspection.txt', 'samples.csv', 'sweeps.csv']
    """
    with Folder(out, INSPECTION) as folder:
        folder.write_lines("words", "inspection.txt", (*inspection.messages, *text))
        sweeps = inspection.sweeps
        named = {f"{event}_drive_angle": event for event in ("onset", "snap_off")}
        named |= {name: name for name in ("onset_travel", "snap_off_travel") if name in sweeps}
        sides = {
            f"{short}_{side}": sweeps[name].sel(side=side, drop=True)
            for name, short in named.items()
            for side in ("before", "after")
        }
        flat = sweeps.drop_vars(["side", *named]).assign(sides)
        folder.write_table("sweeps", "sweeps.csv", flat)
        folder.write_table("channels", "channels.csv", inspection.channels)
        flags = inspection.samples
        by_channel = {
            f"{name}_{channel}": flags[name].sel(channel=channel, drop=True)
            for name in ("outlier", "stuck", "cut_off")
            for channel in flags.channel.values
        }
        samples = flags.drop_vars(["outlier", "stuck", "cut_off", "channel"]).assign(by_channel)
        kept = inspection.record[["sweep", "drive_angle"]].drop_attrs(deep=False)
        numbers = {name: values.astype(int) if values.dtype == np.bool_ else values for name, values in samples.items()}
        folder.write_table("samples", "samples.csv", kept.assign(numbers))
        folder.draw("figure", "inspection.png", plotting.inspection, inspection)
    return folder.files
