"""A rig: its rod and its load cell, its unknowns, and its files."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, cast

import xarray as xr

from tactile_bayes.checks import check_kind, check_optional, check_path, check_whole_number
from tactile_bayes.distributions import Distribution, in_words, stated_text, text_or_unwritten
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng, generator
from tactile_bayes.record import rod_of, validate
from tactile_bayes.rig.corrected import measured_by
from tactile_bayes.rig.file_format import FileFormat
from tactile_bayes.rig.parameters import GROUPS, STANDARD, members
from tactile_bayes.rig.rig_file import file_of, named_in_errors, read_tables, stated_in, tables_of, text_of
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.rig.stated import Stated, rod_with, within_bounds
from tactile_bayes.rig.unknown import DEFAULT, Unknown, checked_unknown, expanded, of_modes, of_pivots
from tactile_bayes.tasks import write_atomically
from tactile_bayes.tasks.documents import read_toml

_SHAPE = ("rest_curvature", "taper", "taper_error", "stem", "length", *GROUPS["rest_shape"])
# Parameters that are not drawn, and what to do.
_UNDRAWN = {
    **dict.fromkeys(GROUPS["discrepancy"], "a discrepancy is a function and no number: leave it out where you draw"),
    **dict.fromkeys(("moment_noise", "force_noise"), "state it in the load cell, and give noise_scale where it varies"),
}


@dataclass(frozen=True, eq=False)
class Rig:
    """A rig: what its data sheets state, and how far the rig on the table may be from it.

    A number is known, a distribution is unknown: it is inferred when measuring, with that distribution as its prior,
    and drawn when simulating.

    Parameters
    ----------
    rod : Rod, optional
        The rod of the data sheet; by default that of the record, or the dimensionless one.
    load_cell : LoadCell, optional
        The load cell of the data sheet, in the units of the rod; by default the one that the record states. Its noise
        is known up to the factor `noise_scale`; if no noise is stated, it is inferred.
    unknown : mapping of str to number, distribution or "default", or "nothing"
        Parameters of the rig, or groups of them (`tactile-bayes rig --parameters` lists them), in the units of the
        record: a number is known; a frozen distribution of scipy.stats is unknown, and "default" stands for the default
        distribution. What is not named is unknown if it is unknown of a real rig: `rigidity_scale`,
        `drive_angle_offset`, `bias`, `lever`, `backlash`, `friction`, of a traced rod `rest_shape`, and of one whose
        diameter was measured along it `taper_error`, each where the record shows it; everything else is as stated.
        "nothing": all is as stated, without friction.
    calibration : RigPrior, optional
        Joint distribution of parameters that a known object has shown, from `calibrate_rig`.
    file : FileFormat or mapping
        How the rig writes its records; a mapping is the table [file] of rig.toml, like
        {"force_x": "-Fx[mN]", "split_sweeps": True}.

    Raises
    ------
    ParameterError
        If there is no such parameter, or what is said of it is neither a number nor a distribution.

    Examples
    --------
    >>> from scipy import stats
    >>> rig = Rig(load_cell=LoadCell(force_noise=0.05, moment_noise=0.02), unknown={"lever": 0.0})
    >>> rig.known
    {'lever_x': 0.0, 'lever_y': 0.0}
    >>> Rig(unknown={"friction": stats.halfnorm(scale=0.3)}, file={"force_x": "-Fx[mN]"})
    Rig(unknown={'friction': halfnorm(0, 0.3)}, file={'force_x': '-Fx[mN]'})
    """

    rod: Rod | None = None
    load_cell: LoadCell | None = None
    unknown: Mapping[str, Unknown] | Literal["nothing"] = field(default_factory=dict)
    calibration: RigPrior | None = None
    file: FileFormat | Mapping[str, Any] = field(default_factory=FileFormat)

    def __post_init__(self) -> None:
        check_optional("the rod", self.rod, Rod)
        check_optional("load_cell", self.load_cell, LoadCell, "give LoadCell(force_noise=0.05, moment_noise=0.02)")
        check_optional("calibration", self.calibration, RigPrior, "give that of a rig from calibrate_rig")
        if not isinstance(self.file, FileFormat):
            object.__setattr__(self, "file", FileFormat.of(self.file))
        object.__setattr__(self, "unknown", MappingProxyType(checked_unknown(self.unknown)))
        if self.calibration is not None:
            both = sorted(set(self._expanded) & set(self.calibration.priors))
            if both:
                raise ParameterError(
                    f"unknown has {', '.join(both)}, which the calibration of the rig has found: leave one of the two"
                )

    def __repr__(self) -> str:
        cell, found = self.load_cell, self.calibration
        of_cell = "" if cell is None else ", ".join(f"{name}={value!r}" for name, value in cell.entries().items())
        words = [(n, repr(v) if isinstance(v, float | str) else in_words(v)) for n, v in self.entries.items()]
        said = {
            "rod": "" if self.rod is None else repr(self.rod),
            "load_cell": "" if cell is None else f"LoadCell({of_cell})",
            "unknown": f"{{{', '.join(f'{name!r}: {text}' for name, text in words)}}}" if words else "",
            "calibration": "" if found is None else repr(found),
            "file": repr(self.format.table) if self.format.table else "",
        }
        return f"Rig({', '.join(f'{name}={text}' for name, text in said.items() if text)})"

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "unknown": self.entries}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        self.__dict__.update(state)

    @property
    def entries(self) -> dict[str, Unknown]:
        """What `unknown` says of parameters and groups."""
        return dict(cast("Mapping[str, Unknown]", self.unknown))  # checked and written out at the beginning

    @property
    def format(self) -> FileFormat:
        """How the rig writes its records."""
        return cast("FileFormat", self.file)  # made at the beginning

    @property
    def _expanded(self) -> dict[str, Unknown]:
        return expanded(self.entries)

    @property
    def said(self) -> dict[str, Unknown]:
        """What is said of each parameter, those included that are unknown of a real rig; "base" stays a group."""
        return {**{name: DEFAULT for of in STANDARD for name in members(of)}, **self._expanded}

    @property
    def known(self) -> dict[str, float]:
        """Numbers of the parameters that are said to be known."""
        return {name: value for name, value in self._expanded.items() if isinstance(value, float)}

    @property
    def known_rod(self) -> Rod:
        """The rod with the deviations that are numbers; by default the dimensionless one."""
        rod, known = self.rod or Rod(), self.known
        stiffer = known.get("rigidity_scale", 1.0)
        if stiffer != 1.0:
            rod = replace(rod, flexural_rigidity=stiffer * rod.flexural_rigidity)
        return rod_with(rod, known) if not known.keys().isdisjoint(_SHAPE) else rod

    @property
    def friction(self) -> float:
        """Coulomb's coefficient, if it is known, else 0."""
        return self.known.get("friction", 0.0)

    @property
    def without_bare_cell(self) -> Rig:
        """The rig without a load cell of which only the frame is stated: the cell is then the one of the record."""
        cell = self.load_cell
        return replace(self, load_cell=None) if cell is not None and cell == LoadCell(frame=cell.frame) else self

    @property
    def distributions(self) -> dict[str, Distribution]:
        """Distributions of the parameters of which one is given."""
        said = self._expanded.items()
        return {name: value for name, value in said if not isinstance(value, float | str)}

    def is_named(self, name: str) -> bool:
        """Return True if something is said of a parameter."""
        return name in self._expanded

    def with_unknown(self, **said: Unknown) -> Rig:
        """Return the rig of which something else is said about some parameters."""
        return replace(self, unknown={**self.entries, **said})

    def with_session(self, **deviations: float) -> Rig:
        """Return the calibrated rig as it is in another session, in which some of its parameters differ.

        Parameters
        ----------
        **deviations : float
            Standard deviations by which calibrated parameters differ from session to session, in the record's units; of
            gains and stiffness relative ones.

        Raises
        ------
        ParameterError
            If the rig is not calibrated, or the calibration has found no such parameter, or one that may vanish.

        Examples
        --------
        >>> import numpy as np
        >>> from scipy import stats
        >>> found = RigPrior({"drive_angle_offset": stats.norm(0.01, 0.003)}, np.eye(1), 0.0, "")
        >>> Rig(calibration=found).with_session(drive_angle_offset=0.004).calibration
        RigPrior(drive_angle_offset=norm(0.01, 0.005))
        """
        if self.calibration is None:
            raise ParameterError("a session differs from a calibration: give a rig from calibrate_rig")
        return replace(self, calibration=self.calibration.in_a_session(deviations))

    def draw(self, rng: Rng, *, pivots: int = 1) -> Rig:
        """Draw a rig of numbers: each unknown has a value, and is known.

        Parameters
        ----------
        rng : int, SeedSequence or Generator
        pivots : int
            Number of pivots of its records, the shifts of which are drawn if they are unknown.

        Returns
        -------
        Rig
            With the rod and the load cell of the data sheets, and numbers for what `scan` and `measure` apply.

        Raises
        ------
        ParameterError
            If a discrepancy is unknown, or a noise that the load cell does not state, or a distribution has no
            quantiles.

        Examples
        --------
        >>> drawn = Rig(unknown={"lever": 0.0}).draw(rng=1)
        >>> drawn.distributions, drawn.known["lever_x"], round(drawn.known["rigidity_scale"], 4)
        ({}, 0.0, 1.0015)
        """
        check_whole_number("pivots", pivots, 1)
        cell = self.load_cell or LoadCell()
        uncertain = [name for name, size in zip(GROUPS["bias"], cell.bias_uncertainty, strict=True) if size > 0.0]
        said = unknown_of(self, pivots, uncertain)
        stated, random = Stated.of(self.rod or Rod(), cell), generator(rng)
        numbers: dict[str, Unknown] = {}
        for name, value in said.items():
            if not isinstance(value, float):
                distribution = stated.default(name) if isinstance(value, str) else value
                value = float(within_bounds(name, distribution, random.random(1))[0])
            numbers[name] = value
        if self.calibration is not None:
            found = self.calibration.at_shares(random.random((1, len(self.calibration.priors))))
            numbers |= {name: float(value[0]) for name, value in found.items()}
        return replace(self, unknown=numbers, calibration=None)

    def measure(self, record: xr.Dataset, *, rng: Rng) -> xr.Dataset:
        """Return the record of this rig, from `scan`, as its load cell and its encoder read it.

        The deviations that are numbers act: lever, gains, curve, zeros and drifts of the load cell, the factor on its
        noise, and offset and backlash of the encoder. The record states rod, load cell and pivots of the data sheets,
        as one from a laboratory does (the rod of the record, if the rig has none), and the truth in columns that begin
        with "truth_".

        Parameters
        ----------
        record : xr.Dataset
            An ideal record, in the units of the load cell.
        rng : int, SeedSequence or Generator

        Returns
        -------
        xr.Dataset

        Raises
        ------
        RecordError, ParameterError
            As in `LoadCell.measure`.

        Examples
        --------
        >>> from tactile_bayes import LoadCell, Rig, scan
        >>> from tactile_bayes.contours import paper_profile
        >>> drawn = Rig(load_cell=LoadCell(force_noise=0.05, moment_noise=0.02)).draw(rng=1)
        >>> record = drawn.measure(scan(paper_profile("II", q=0.5), drawn).record, rng=1)
        >>> record.attrs["units"], record.attrs["load_cell_force_noise"]
        ('dimensionless', 0.05)
        """
        rod = self.rod
        if rod is None and (of_record := rod_of(validate(record))) != self.known_rod:
            rod = of_record
        return measured_by(rod, self.load_cell or LoadCell(), self.known, record, rng)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Rig:
        """Read a rig from a TOML file; see docs/formats.md.

        Raises
        ------
        ParameterError
            If an entry is unknown, misspelt or impossible; the message names it.
        FileNotFoundError
            If there is no such file.
        """
        path = check_path("the rig", path, "give a file rig.toml")
        with named_in_errors(path):
            return cls.of_tables(read_tables(path), path.parent)

    @classmethod
    def of_tables(cls, tables: Mapping[str, Any], folder: Path = Path()) -> Rig:
        """Return the rig that tables state, as in rig.toml; the path of the rod's shape is relative to the folder.

        Raises
        ------
        ParameterError
            If an entry is unknown, misspelt or impossible.
        """
        return cls(**stated_in(tables, folder))

    @classmethod
    def of(cls, posterior: xr.DataTree) -> Rig:
        """Return the rig of a posterior, from `infer_contour`.

        Raises
        ------
        ParameterError
            If the posterior does not state it, since a distribution was none of SciPy's.
        """
        check_kind("posterior", posterior, xr.DataTree, "give a result of infer_contour")
        return cls.of_tables(read_toml(stated_text(posterior.attrs, "rig")))

    @property
    def tables(self) -> dict[str, Any]:
        """Tables that state the rig, as in rig.toml; the inverse of `of_tables`.

        Raises
        ------
        ParameterError
            If a distribution is none of SciPy's, which text cannot state.
        """
        return tables_of(self.rod, self.load_cell, self.entries, self.calibration, self.format)

    @property
    def text(self) -> str:
        """The rig as text, as in its file; "not written" if one of its distributions is none of SciPy's."""
        return text_or_unwritten(lambda: text_of(self.tables))

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the rig to a TOML file, whole or not at all.

        Raises
        ------
        ParameterError
            If a distribution is none of SciPy's, which text cannot state.
        """
        text = file_of(self.tables)
        with write_atomically(check_path("path", path, "give a file rig.toml")) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")


def rig_of(rig: Rig | None) -> Rig:
    """Return a rig, by default one that says nothing."""
    check_optional("rig", rig, Rig, "give Rig(rod=..., load_cell=...), or Rig.read(path)")
    return rig or Rig()


def unknown_of(rig: Rig, pivots: int, uncertain: Collection[str] = ()) -> dict[str, Unknown]:
    """Return what is said of all parameters but calibrated ones, and biases that the load cell itself draws."""
    found = () if rig.calibration is None else tuple(rig.calibration.priors)
    said = of_pivots({name: value for name, value in rig.said.items() if name not in found}, pivots)
    said = of_modes(said, rig.rod or Rod())
    for name, value in said.items():
        if name in _UNDRAWN and not isinstance(value, float):
            raise ParameterError(f"{name} is unknown, and is not drawn: {_UNDRAWN[name]}")
    hidden = {name for name in uncertain if not rig.is_named(name)}
    drawn = {*found, *(name for name, value in said.items() if not isinstance(value, float))}
    if drawn.issuperset(GROUPS["gain"]) and not rig.is_named("rigidity_scale"):
        hidden.add("rigidity_scale")  # a stiffer rod and larger gains have the same effect
    return {name: value for name, value in said.items() if name not in hidden}
