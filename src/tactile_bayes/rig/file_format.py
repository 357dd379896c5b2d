"""The format of a rig's files: how it writes its records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from tactile_bayes.checks import check_kind, check_mapping, check_names, check_switch, refused
from tactile_bayes.record.schema import CHANNELS

__all__ = ["FileFormat"]


@dataclass(frozen=True)
class FileFormat:
    """How a rig writes its records.

    Parameters
    ----------
    columns : mapping of str to str
        Source of each column of a record in the file, as of `read_record`: name, unit, factor, sign and zero.
    split_sweeps : bool
        Whether sweeps and directions are found by the turns of the drive.
    missing : tuple of str
        Channels that the rig does not measure.

    Raises
    ------
    ParameterError
        If an entry is impossible.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    split_sweeps: bool = False
    missing: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        correction = "give names by column of a record, like {'force_x': '-Fx[mN]'}"
        check_mapping("columns", self.columns, correction)
        for column, origin in self.columns.items():
            check_kind(f"columns[{column!r}]", origin, str, "give what stands for it, like 'Fx[mN]'")
        check_switch("split_sweeps", self.split_sweeps)
        missing = (self.missing,) if isinstance(self.missing, str) else tuple(check_names("missing", self.missing))
        object.__setattr__(self, "missing", missing)
        for name in missing:
            if name not in CHANNELS:
                raise refused("missing", missing, f"{name!r} is no channel; the channels are {', '.join(CHANNELS)}")
