"""The rig that an inspection shows: as it is stated, with the zeros and the noise of the unloaded samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from tactile_bayes.diagnostics.inspection.inspection import Inspection
from tactile_bayes.diagnostics.inspection.messages import far_off
from tactile_bayes.diagnostics.verdicts import OFF_ZERO
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record.origin import column_entry
from tactile_bayes.rig import Rig

_MOVED = 1e-3  # probability that a zero which stays where it is seems to have moved as far between unloaded stretches
_DIGITS = 3  # number of significant digits of a noise that is estimated


def shown_rig(found: Inspection, rig: Rig) -> Rig:
    """Return the rig of an inspected record, with what its unloaded samples show and nobody states.

    That is the noise, and zeros that are clearly off and stay where they are: they are added to the columns of the
    file.
    """
    columns = {name: column_entry(found.record[name], added=-zero) for name, zero in _zeros(found)}
    columns = {name: text for name, text in columns.items() if text}
    rig = replace(rig, file=replace(rig.format, columns={**rig.format.columns, **columns}))
    cell = found.load_cell
    if found.load_cell_source != "unloaded samples" or cell is None:
        return rig
    force_noise, moment_noise = (float(f"{noise:.{_DIGITS}g}") for noise in (cell.force_noise, cell.moment_noise))
    stated = rig.load_cell or LoadCell()
    return replace(rig, load_cell=replace(stated, force_noise=force_noise, moment_noise=moment_noise))


def _zeros(found: Inspection) -> Iterator[tuple[str, float]]:
    """Yield the channels whose zeros are off by many standard errors, or, beside a stated cell, more than it allows."""
    is_stated = found.load_cell_source in ("given", "data sheet")
    far = far_off(found.record, found.channels, found.load_cell if is_stated else None)
    for name in found.channels.channel.values.tolist():
        row = found.channels.sel(channel=name)
        zero, error = float(row.bias), float(row.bias_uncertainty)
        has_moved = float(row.same_bias_p_value) < _MOVED
        is_off = abs(zero) > OFF_ZERO * error > 0.0 and not is_stated
        if (name in far or is_off) and not has_moved:
            yield name, zero
