"""How a file is read: what stands for its columns, and what it does not state itself."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, NamedTuple

import xarray as xr

from tactile_bayes.checks import check_choice, check_kind, check_mapping, check_optional, check_switch
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record.schema import FRAMES, Frame
from tactile_bayes.record.units import with_rod

if TYPE_CHECKING:
    from tactile_bayes.rig import Rig

__all__ = ["Reading"]


class Reading(NamedTuple):
    """Options of `read_record`, each from the rig unless it is given itself."""

    columns: Mapping[str, str]
    split_sweeps: bool
    rod: Rod | None
    """The rod, unless it has no length: then it only gives the shape of the one that the file states."""
    missing: Collection[str]
    load_cell_frame: Frame | None
    shape: Rod | None = None
    """A rod without a length, in units of its own."""

    @classmethod
    def of(
        cls,
        rig: Rig | None,
        columns: Mapping[str, str] | None = None,
        split_sweeps: bool = False,
        rod: Rod | None = None,
        missing: Collection[str] = (),
        load_cell_frame: Frame | None = None,
    ) -> Reading:
        """Return the options of `read_record`.

        Raises
        ------
        ParameterError
            If one has another kind.
        """
        check_mapping("columns", columns, "give names by column of a record, like {'force_x': 'Fx[mN]'}")
        for column, origin in (columns or {}).items():
            check_kind(f"columns[{column!r}]", origin, str, "give what stands for it, like 'Fx[mN]'")
        check_switch("split_sweeps", split_sweeps)
        check_optional("the rod", rod, Rod)
        if load_cell_frame is not None:
            check_choice("load_cell_frame", load_cell_frame, FRAMES)
        if rig is None:
            return cls(columns or {}, split_sweeps, rod, missing, load_cell_frame)
        from tactile_bayes.rig.rig import rig_of

        stated = rig_of(rig)
        rod, cell = rod or stated.rod, stated.load_cell
        is_shape = rod is not None and rod.is_dimensionless and rod != Rod()
        return cls(
            {**stated.file.columns, **(columns or {})},
            split_sweeps or stated.file.split_sweeps,
            None if is_shape else rod,
            missing or stated.file.missing,
            load_cell_frame or (None if cell is None else cell.frame),
            rod if is_shape else None,
        )

    def shaped(self, record: xr.Dataset) -> xr.Dataset:
        """Return a record with the shape of the rod."""
        return with_rod(record, self.shape)
