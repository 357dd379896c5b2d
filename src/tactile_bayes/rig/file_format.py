"""The format of a rig's files: how it writes its records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from tactile_bayes.checks import as_number, check_kind, check_mapping, check_names, check_switch, refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.record.schema import CHANNELS, COLUMNS, MEASURED, column_of
from tactile_bayes.record.spelling import nearest

OPTIONS = ("split_sweeps", "where", "missing")  # entries of a format beside the columns


@dataclass(frozen=True)
class FileFormat:
    """How a rig writes its records.

    Parameters
    ----------
    columns : mapping of str to str
        Source of a column of a record in the file: `NAME`, or `NAME[UNIT]` if the file does not state the unit. A minus
        before it, `-NAME[UNIT]`, reverses the sign, a factor scales it to the unit, `1e-3*NAME[N]`, and a number with a
        sign shifts the zero, in the same unit: `90-NAME[deg]` or `NAME[mN]+12.5`. For base_x, base_y, drive_angle,
        sweep and direction one value for all samples can be given, as "12[mm]", "90[deg]", "0" or "forward"; so can a
        line of the header, `# drive_angle: 90 [deg]`, for a rod that is clamped while its base is carried. A unit in
        the name of a column may be left out. Further columns keep their names, except for a slash, which no NetCDF file
        can store: "Temp / °C" becomes "Temp [°C]", and another slash "|".
    split_sweeps : bool or "rows"
        Whether to derive the columns sweep and direction from the drive angle if the file lacks them. A sweep ends
        where the angle returns from an extreme by more than a tenth of its whole range, or where the pivot moves; its
        direction is that of a straight line fitted to its angles. An angle that returns within one sample was reset,
        and the sweeps before and after it have the same direction. Where the base moves in more than half of the steps,
        a sweep ends where the base turns back, and it is forward if the left side of the rod leads; turned here and
        carried there in one file takes columns sweep and direction. "rows": each row is a touch of its own, a sweep of
        one sample, in the direction that a column or an entry states.
    missing : str or collection of str
        Channels that the file has no column for, because the rig does not measure them.
    where : str
        Condition on the columns of the file that a row must meet, "trial == 3 and force > 0.1"; others are left out.
        By default all rows.

    Raises
    ------
    ParameterError
        If an entry is impossible, or a key of `columns` is no column of a record.

    Examples
    --------
    >>> FileFormat.of({"force_x": "-Fx[mN]", "missing": "force_y"})
    FileFormat(columns={'force_x': '-Fx[mN]'}, split_sweeps=False, missing=('force_y',), where='')
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    split_sweeps: bool | Literal["rows"] = False
    missing: tuple[str, ...] = ()
    where: str = ""

    def __post_init__(self) -> None:
        _check_table("columns", self.columns)
        for column, origin in self.columns.items():
            check_kind(f"columns[{column!r}]", origin, str, "give what stands for it, like 'Fx[mN]'")
            if column_of(column) is None:
                near = nearest(column, (*COLUMNS, *OPTIONS))
                hint = f"did you mean {near!r}?" if near else f"choose from {', '.join(MEASURED)}"
                raise ParameterError(f"columns: {column!r} is no column of a record: {hint}")
        if self.split_sweeps != "rows":
            check_switch("split_sweeps", self.split_sweeps)
        check_kind("where", self.where, str, 'give a condition on columns, like "trial == 3"')
        missing = (self.missing,) if isinstance(self.missing, str) else tuple(check_names("missing", self.missing))
        object.__setattr__(self, "missing", missing)
        for name in missing:
            if name not in CHANNELS:
                raise refused("missing", missing, f"{name!r} is no channel; the channels are {', '.join(CHANNELS)}")

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> FileFormat:
        """Return the format that a table states: columns by name, beside its options."""
        _check_table("file", table)
        options = {name: table[name] for name in OPTIONS if name in table}
        columns = {name: origin for name, origin in table.items() if name not in options}
        texts = {name: repr(of) if as_number(of) is not None else of for name, of in columns.items()}
        return cls(texts, **options)

    @property
    def table(self) -> dict[str, Any]:
        """The format as a table, which `of` takes."""
        options = {"split_sweeps": self.split_sweeps, "where": self.where, "missing": list(self.missing)}
        return {**self.columns, **{name: value for name, value in options.items() if value}}


def _check_table(name: str, table: Any) -> None:
    correction = "give names by column of a record, like {'force_x': '-Fx[mN]'}"
    check_kind(name, table, Mapping, correction)
    check_mapping(name, table, correction)
