"""An inspection of a record, in one folder."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tactile_bayes.files import write_atomically
from tactile_bayes.inspection import Inspection
from tactile_bayes.runs.picture import write_picture

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
        something looks wrong) and inspection.png; made if it is not there. Files of these names in it are replaced.
    text : sequence of str
        Lines that follow what looks wrong in inspection.txt.

    Returns
    -------
    mapping of str to Path
        By what they hold.

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
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        "words": folder / "inspection.txt",
        "sweeps": folder / "sweeps.csv",
        "channels": folder / "channels.csv",
        "samples": folder / "samples.csv",
        "figure": folder / "inspection.png",
    }
    with write_atomically(files["words"]) as temporary:
        temporary.write_text("\n".join((*inspection.words, *text)) + "\n", encoding="utf-8")
    sweeps = inspection.sweeps
    flat = sweeps.drop_vars(["side", "onset_drive_angle", "snap_off_drive_angle"]).assign(
        {
            f"{event}_{side}": sweeps[f"{event}_drive_angle"].sel(side=side, drop=True)
            for event in ("onset", "snap_off")
            for side in ("before", "after")
        }
    )
    tables = {"sweeps": flat.to_dataframe(), "channels": inspection.channels.to_dataframe()}
    flags = inspection.samples
    by_channel = {
        f"{name}_{channel}": flags[name].sel(channel=channel, drop=True)
        for name in ("outlier", "stuck", "cut_off")
        for channel in flags.channel.values
    }
    samples = flags.drop_vars(["outlier", "stuck", "cut_off", "channel"]).assign(by_channel)
    kept = inspection.record[["sweep", "drive_angle"]].drop_attrs(deep=False)
    samples = kept.assign(
        {name: values.astype(int) if values.dtype == np.bool_ else values for name, values in samples.items()}
    )
    tables["samples"] = samples.to_dataframe()
    for name, table in tables.items():
        with write_atomically(files[name]) as temporary:
            table.to_csv(temporary)
    _draw(inspection, files["figure"])
    return files


def _draw(inspection: Inspection, path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from tactile_bayes import plotting

    figure = Figure(figsize=(7.0, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    plotting.inspection(inspection, axes=figure.subplots(3, 2, sharex="col", width_ratios=(2.2, 1.0)))
    write_picture(figure, path)
