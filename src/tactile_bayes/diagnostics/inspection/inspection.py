"""The inspection of a record: its sweeps, its channels, its samples, and in words what looks wrong."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_optional, check_probability
from tactile_bayes.diagnostics.inspection.fit import Fit, fit_of
from tactile_bayes.diagnostics.inspection.known_cell import known_cell
from tactile_bayes.diagnostics.inspection.stretches import rows_of_sweeps, unloaded_stretches
from tactile_bayes.diagnostics.inspection.tables import channel_table, sample_table, sweep_table
from tactile_bayes.diagnostics.inspection.words import UNFIT, in_words
from tactile_bayes.diagnostics.suspicions import suspicions
from tactile_bayes.errors import DriftWarning
from tactile_bayes.load_cell import LoadCell, zero_load
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS, present_channels, validate

__all__ = ["Inspection", "inspect_record"]

_STEPS = 3
"""Of an inspection: unloaded samples, Step 2, whether contacts fit. Each remedy that is tried is a further one."""


@dataclass(frozen=True, eq=False)
class Inspection:
    """What `inspect_record` found.

    Attributes
    ----------
    record : xr.Dataset
        The record.
    words : tuple of str
        What looks wrong, the most serious first, or "Nothing looks wrong.".
    is_suspect : bool
        Whether anything does.
    sweeps : xr.Dataset
        Over "sweep": direction, samples, base_x, base_y, drive_angle_from, drive_angle_to and drive_step (the median)
        [rad], and from `zero_load` contact, p_value, onset_drive_angle and snap_off_drive_angle [rad] (over "side"
        too, NaN where there is none), and unloaded, the number of such samples.
    channels : xr.Dataset
        Over "channel", NaN where it is missing: smallest, largest, bias, bias_uncertainty, noise, noise_uncertainty,
        resolution and same_bias_p_value (see `zero_load`), stated_noise (NaN if none is, or one without a standard
        deviation), neighbour_correlation of the unloaded samples with its neighbour_score (about standard normal for
        white noise), and coordinate "unit".
    samples : xr.Dataset
        Over "sample" (and "channel"): unloaded; outlier, stuck and cut_off of each channel; repeated and uneven_step;
        and status, what raw Step 2 makes of it ("" where a load channel is missing).
    statuses : mapping of str to int
        How many samples have which status in raw Step 2; empty where a load channel is missing.
    load_cell : LoadCell or None
        What is known of the noise, and from what in `load_cell_source`: "given", "data sheet", "unloaded samples",
        "nothing" (an ideal record) or "too few unloaded samples".
    load_cell_source : str
    """

    record: xr.Dataset
    words: tuple[str, ...]
    is_suspect: bool
    sweeps: xr.Dataset
    channels: xr.Dataset
    samples: xr.Dataset
    statuses: Mapping[str, int]
    load_cell: LoadCell | None
    load_cell_source: str


def inspect_record(
    record: xr.Dataset,
    *,
    load_cell: LoadCell | None = None,
    friction: float = 0.0,
    false_alarm: float = 1e-3,
    progress: Callable[[int, int], object] | None = None,
) -> Inspection:
    """What is in a record, and what looks wrong with it, before anything is inferred.

    Nothing of it depends on a family of contours.

    Parameters
    ----------
    record : xr.Dataset
        A record.
    load_cell : LoadCell, optional
        In the record's units; by default its data sheet, or what its unloaded samples tell of bias and noise.
    friction : float
        Coulomb's coefficient μ, for Step 2.
    false_alarm : float
        Level of every test: the probability that it speaks of a record in white normal noise with nothing wrong, for
        each sweep in `zero_load`, and for all channels and samples together in the others.
    progress : callable, optional
        Is given the number of steps that are done, and of how many; these become more where samples do not fit, as
        what would mend it is tried.

    Returns
    -------
    Inspection

    Raises
    ------
    RecordError
        If `record` is no record.
    ParameterError
        If `false_alarm` is not a probability below a half.

    Notes
    -----
    Told are, in this order: a record without contact; channels that never change; loads that no such rod can have
    (`suspicions`); samples whose loads contradict one another by so much that no contact gives them, with the sign, the
    frame, the exchange of forces or the friction that would mend it, if one does; readings cut off at the end of a
    range; a sweep without contact; readings that are stuck or stored twice; readings that stand out; a zero that moved,
    and one that is not what the data sheet says; noise that is not white, and noise that is not as stated; steps of the
    drive that differ; sweeps that begin or end in contact.

    A rod that is a few per cent stiffer or longer than stated, or an encoder that is a degree off, are not told here,
    as `infer_contour` finds them. Of 1536 simulated records with eight kinds of load cell and nothing wrong, none was
    suspected.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02, bias=(0.1, 0.0, 0.0))
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5)).record, seed=1)
    >>> inspect_record(measured).words
    ('Nothing looks wrong.',)
    >>> knocked = measured.holding_moment.copy()
    >>> knocked[5] += 1.0
    >>> for sentence in inspect_record(measured.assign(holding_moment=knocked)).words:
    ...     print(sentence)
    1 reading of holding_moment stands out from its neighbours (sample 5): a knock? If there are more, ...
    """
    check_optional("load_cell", load_cell, LoadCell)
    check_probability("false_alarm", false_alarm, "give a probability between 0 and 0.5, such as 1e-3", below=0.5)
    record = validate(record)
    told = progress or (lambda done, count: None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DriftWarning)  # which is told in words
        found = zero_load(record, false_alarm=false_alarm)
        cell, source = known_cell(record, load_cell)
    sweeps = rows_of_sweeps(record["sweep"].values)
    stretches = unloaded_stretches(sweeps, found["unloaded"].values)
    channels = channel_table(record, found, stretches, cell if source in ("given", "data sheet") else None)
    samples = sample_table(record, found, sweeps, stretches, cell, false_alarm=false_alarm)
    told(1, _STEPS)
    statuses: dict[str, int] = {}
    fit = Fit(math.nan, math.nan, 0, "")
    if len(present_channels(record)) == len(CHANNELS):
        status = reconstruct(record, method="raw", load_cell=cell, friction=friction).status.values
        samples["status"] = ("sample", status, {"long_name": "what becomes of it in raw Step 2"})
        statuses = dict(Counter(status.tolist()).most_common())
        told(2, _STEPS)
        dead = any(np.ptp(record[name].values) == 0.0 for name in CHANNELS)
        if cell is not None and cell.has_variances and found["contact"].values.any() and not dead:
            fit = fit_of(
                record,
                _with_zero(cell, found),
                most=UNFIT,
                friction=friction,
                progress=lambda done, count: told(_STEPS + done, _STEPS + count),
            )
    else:
        samples["status"] = ("sample", np.full(record.sizes["sample"], ""), {"long_name": "none: a channel is missing"})
    table = sweep_table(record, found, sweeps)
    doubts = suspicions(record, _with_zero(cell, found)) if found["contact"].values.any() else ()
    against = in_words(record, table, channels, samples, doubts, fit, cell, source, false_alarm)
    return Inspection(
        record,
        against or ("Nothing looks wrong.",),
        bool(against),
        table,
        channels,
        samples,
        statuses,
        cell,
        source,
    )


def _with_zero(cell: LoadCell | None, found: xr.Dataset) -> LoadCell:
    """The load cell, with the bias that the record shows: a tare that was forgotten is told by itself."""
    if not np.isfinite(found["bias"].values).any():
        return cell or LoadCell()
    one, two, three = np.nan_to_num(found["bias"].values).tolist()
    uncertainty = np.nan_to_num(found["bias_uncertainty"].values).tolist()
    return replace(cell or LoadCell(), bias=(one, two, three), bias_uncertainty=tuple(uncertainty))
