"""A rig: its rod and its load cell, its unknowns, and its files."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from tactile_bayes.checks import as_number, check_kind, check_mapping, check_optional, shown
from tactile_bayes.distributions import Distribution, check_distribution, frozen
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record.spelling import nearest
from tactile_bayes.rig.file_format import FileFormat
from tactile_bayes.rig.parameters import BASE, GROUPS, MAY_VANISH, PARAMETERS, STANDARD, members, parameter_named
from tactile_bayes.rig.rig_prior import RigPrior

if TYPE_CHECKING:
    import xarray as xr

    from tactile_bayes.random_numbers import Rng

__all__ = ["DEFAULT", "NOTHING", "Rig", "Unknown", "cell_with", "expanded", "of_pivots", "rig_of", "rod_with"]

Unknown = float | Distribution | Literal["default"]
"""What is said of a parameter: a number if it is known, a distribution, or "default" for its default distribution."""

DEFAULT: Literal["default"] = "default"

NOTHING: Mapping[str, float] = MappingProxyType(
    {name: float(PARAMETERS[next(members(name))].neutral or 0.0) for name in STANDARD}
)
"""Unknowns of a rig that is as stated: everything that is unknown of a real rig is known, and is as stated."""

UNWRITTEN = "not written"
"""Text of a rig of which a distribution is none of SciPy's."""

_SHAPE = ("rest_curvature", "taper", "stem", "length")

_BASES = ("base", "base_x", "base_y")
"""Names of the shifts of all pivots but the first."""


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
        `drive_angle_offset`, `bias`, `lever`, `backlash` and `friction`, each where the record shows it; everything
        else is as stated. "nothing": all is as stated, without friction.
    calibration : RigPrior, optional
        Joint distribution of parameters that a known object has shown, from `calibrate_rig`.
    file : FileFormat
        How the rig writes its records.

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
    """

    rod: Rod | None = None
    load_cell: LoadCell | None = None
    unknown: Mapping[str, Unknown] | Literal["nothing"] = field(default_factory=dict)
    calibration: RigPrior | None = None
    file: FileFormat = field(default_factory=FileFormat)

    def __post_init__(self) -> None:
        check_optional("the rod", self.rod, Rod)
        check_optional("load_cell", self.load_cell, LoadCell, "give LoadCell(force_noise=0.05, moment_noise=0.02)")
        check_optional("calibration", self.calibration, RigPrior, "give that of a rig from calibrate_rig")
        check_kind("file", self.file, FileFormat, "give FileFormat(columns={'force_x': '-Fx[mN]'})")
        object.__setattr__(self, "unknown", MappingProxyType(_checked(self.unknown)))
        if self.calibration is not None:
            both = sorted(set(self._expanded) & set(self.calibration.priors))
            if both:
                raise ParameterError(
                    f"unknown has {', '.join(both)}, which the calibration of the rig has found: leave one of the two"
                )

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "unknown": self.entries}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        self.__dict__.update(state)

    @property
    def entries(self) -> dict[str, Unknown]:
        """What `unknown` says of parameters and groups."""
        return dict(cast("Mapping[str, Unknown]", self.unknown))  # checked and written out at the beginning

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
        from tactile_bayes.rig.drawn import drawn_rig

        return drawn_rig(self, rng, pivots)

    def measure(self, record: xr.Dataset, *, rng: Rng) -> xr.Dataset:
        """Return the record of this rig, from `scan`, as its load cell and its encoder read it.

        The deviations that are numbers act: lever, gains, curve, zeros and drifts of the load cell, the factor on its
        noise, and offset and backlash of the encoder. The record states rod, load cell and pivots of the data sheets,
        as one from a laboratory does, and the truth in columns that begin with "truth_".

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
        >>> from tactile_bayes import scan
        >>> from tactile_bayes.contours import paper_profile
        >>> drawn = Rig(load_cell=LoadCell(force_noise=0.05, moment_noise=0.02)).draw(rng=1)
        >>> record = drawn.measure(scan(paper_profile("II", q=0.5), drawn).record, rng=1)
        >>> record.attrs["units"], record.attrs["load_cell_force_noise"]
        ('dimensionless', 0.05)
        """
        from tactile_bayes.rig.measured import measured_by

        return measured_by(self, record, rng)

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
        from tactile_bayes.rig.rig_file import read_rig

        return read_rig(path)

    @classmethod
    def of(cls, posterior: xr.DataTree) -> Rig:
        """Return the rig of a posterior, from `infer_contour`.

        Raises
        ------
        ParameterError
            If the posterior does not state it, since a distribution was none of SciPy's.
        """
        import xarray as xr  # takes long to load

        from tactile_bayes.rig.rig_file import rig_of_tables
        from tactile_bayes.tasks.documents import read_toml

        check_kind("posterior", posterior, xr.DataTree, "give a result of infer_contour")
        text = posterior.attrs.get("rig")
        if not isinstance(text, str) or text == UNWRITTEN:
            raise ParameterError("the posterior does not state its rig, as one of its distributions is none of SciPy's")
        return rig_of_tables(read_toml(text))

    @property
    def text(self) -> str:
        """The rig as text, as in its file; "not written" if one of its distributions is none of SciPy's."""
        from tactile_bayes.rig.rig_file import text_of_rig

        try:
            return text_of_rig(self)
        except ParameterError:
            return UNWRITTEN

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the rig to a TOML file, whole or not at all.

        Raises
        ------
        ParameterError
            If a distribution is none of SciPy's, which text cannot state.
        """
        from tactile_bayes.rig.rig_file import write_rig

        write_rig(self, path)


def rig_of(rig: Rig | None) -> Rig:
    """Return a rig, by default one that says nothing.

    Raises
    ------
    ParameterError
        If it is none.
    """
    check_optional("rig", rig, Rig, "give Rig(rod=..., load_cell=...), or Rig.read(path)")
    return rig or Rig()


def rod_with(rod: Rod, rig: Mapping[str, float]) -> Rod:
    """Return a rod of the shape that nuisance parameters by name give it, others than those of shape without effect."""
    length = rig.get("length", rod.length)
    curvature = rig.get("rest_curvature", rod.mean_rest_curvature * rod.length / length)
    return rod.reshaped(curvature, rig.get("taper", rod.taper), rig.get("stem"), length)


def expanded(unknown: Mapping[str, Unknown]) -> dict[str, Unknown]:
    """Return what is said of each parameter, groups first, so that one of a group may be an exception.

    Examples
    --------
    >>> expanded({"moment_bias": 0.1, "bias": "default"})
    {'moment_bias': 0.1, 'force_x_bias': 'default', 'force_y_bias': 'default'}
    """
    of_groups = {member: value for name, value in unknown.items() if name in GROUPS for member in GROUPS[name]}
    return {**of_groups, **{name: value for name, value in unknown.items() if name not in GROUPS}}


def of_pivots(said: Mapping[str, Unknown], pivots: int) -> dict[str, Unknown]:
    """Return what is said of each parameter, with the shifts of so many pivots in place of their group."""
    every: dict[str, Unknown] = {}
    for name, value in said.items():
        if name in _BASES:
            shifts = (f"base_{k}_{axis}" for k in range(2, pivots + 1) for axis in (name[5:] or "xy"))
            every = dict.fromkeys(shifts, value) | every
        else:
            every[name] = value
    return {n: v for n, v in every.items() if (shift := BASE.fullmatch(n)) is None or int(shift[1]) <= pivots}


def cell_with(cell: LoadCell, rig: Mapping[str, float]) -> LoadCell:
    """Return a load cell with the errors that parameters by name give it; drift and noise have no effect."""
    gain = np.array(cell.gain) * [rig.get(name, 1.0) for name in GROUPS["gain"]]
    bias, lever = (
        np.add(stated, [rig.get(name, 0.0) for name in GROUPS[what]]).tolist()
        for what, stated in (("bias", cell.bias), ("lever", cell.lever))
    )
    curve = (rig.get(name, v) for name, v in zip(GROUPS["moment_curve"], cell.moment_curve, strict=True))
    return replace(
        cell,
        gain=gain.tolist(),
        bias=bias,
        lever=lever,
        moment_curve=(next(curve), next(curve)),
        drive_angle_offset=cell.drive_angle_offset + rig.get("drive_angle_offset", 0.0),
        drive_angle_backlash=cell.drive_angle_backlash + rig.get("backlash", 0.0),
    )


def _checked(unknown: Any) -> dict[str, Unknown]:
    if isinstance(unknown, str) and unknown == "nothing":
        return dict(NOTHING)
    correction = 'give numbers and distributions by name, like {"lever": 0.0}, or "nothing"'
    check_kind("unknown", unknown, Mapping, correction)
    check_mapping("unknown", unknown, correction)
    return {name: _said_of(name, frozen(value)) for name, value in unknown.items()}


def _said_of(name: str, value: Any) -> Unknown:
    _refuse_unknown_name(name)
    if isinstance(value, str):
        if value == DEFAULT:
            return DEFAULT
        raise ParameterError(f'unknown[{name!r}] is {shown(value)}: give a number, a distribution, or "default"')
    number = as_number(value)
    if number is None:
        check_distribution(name, value)
        found: Distribution = value
        return found
    for member in members(name):
        parameter = PARAMETERS.get(member)
        low, high = (parameter.low, parameter.high) if parameter is not None else (-np.inf, np.inf)
        if not low and member not in (*MAY_VANISH, *GROUPS["discrepancy"]):
            low = math.ulp(0.0)
        if not (math.isfinite(number) and low <= number <= high):
            raise ParameterError(f"unknown[{name!r}] is {number!r}: give a finite number from {low:.4g} to {high:.4g}")
    return number


def _refuse_unknown_name(name: Any) -> None:
    names: Collection[str] = (*PARAMETERS, *GROUPS, *_BASES)
    if isinstance(name, str) and (name in names or parameter_named(name) is not None):
        if (shift := BASE.fullmatch(name)) and int(shift[1]) < 2:
            raise ParameterError(
                f"{name} is never unknown: a shift of pivot and object together changes no reading. Results are "
                "relative to the first pivot as stated; add the uncertainty of its position"
            )
        return
    near = nearest(str(name), names)
    hint = f"did you mean {near!r}?" if near else f"there are {', '.join((*GROUPS, *PARAMETERS))} and base"
    raise ParameterError(f"a rig has no parameter {name!r}: {hint}")
