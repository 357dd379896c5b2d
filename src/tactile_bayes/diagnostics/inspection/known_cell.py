"""The load cell of a record: given, stated, or known from what it reads without load."""

from __future__ import annotations

from typing import Literal

import xarray as xr

from tactile_bayes.errors import RecordError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import present_channels

__all__ = ["CellSource", "known_cell"]

CellSource = Literal["given", "data sheet", "unloaded samples", "nothing", "too few unloaded samples"]


def known_cell(measured: xr.Dataset, given: LoadCell | None = None) -> tuple[LoadCell | None, CellSource]:
    """The load cell that is given, or the data sheet of the record, or what its unloaded samples tell; and which.

    Parameters
    ----------
    measured : xr.Dataset
        A record.
    given : LoadCell, optional
        In the record's units.

    Returns
    -------
    load_cell : LoadCell or None
        None of a record without noise, and of one with fewer than 3 unloaded samples.
    source : {"given", "data sheet", "unloaded samples", "nothing", "too few unloaded samples"}
        "nothing" is of unloaded samples without noise, as an ideal record has them.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> known_cell(scan(paper_profile("II", q=0.5)).record)
    (None, 'nothing')
    """
    if given is not None:
        return given, "given"
    stated = LoadCell.from_record(measured)
    if stated is not None:
        return stated, "data sheet"
    try:
        found = LoadCell.from_zero_load(measured)
    except RecordError:
        return None, "too few unloaded samples"
    present = present_channels(measured)
    noisy = all(found.standard_deviations[name] for name in present)
    return (found, "unloaded samples") if noisy else (None, "nothing")
