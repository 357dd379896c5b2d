"""The catalogue of figures: numbers, captions and default distances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.numerics.random_numbers import Rng, seed_words
from tactile_bayes.paper_figures.choice import Choice, Direction, Profile, choice_of
from tactile_bayes.paper_figures.contact_kinds import draw_contact_kinds
from tactile_bayes.paper_figures.deformed_rods import draw_deformed_rods
from tactile_bayes.paper_figures.observable_curves import draw_observable_curves
from tactile_bayes.paper_figures.reconstructed_points import draw_reconstructed_points
from tactile_bayes.plotting.style import PAGE_WIDTH

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tactile_bayes.sweep import Carried

_PROFILES: tuple[Profile, ...] = ("I", "II", "III", "IV")
_SWEEPS: Mapping[Profile, Direction] = {"I": "forward", "II": "both", "III": "both", "IV": "both"}
_OBSERVED = (0.3, 0.4, 0.5, 0.6)
_SEEN = (0.4, 0.6)
_TOUCHED = (0.3, 0.6)
_EXPLAINED = (0.5,)


class _Entry(NamedTuple):
    draw: Callable[[Choice], Figure]
    words: str  # a caption, without the drive and distances, "{along}" for what changes along the drive
    direction: Direction  # direction of rotations
    distances: tuple[float, ...]  # default distances q [L]


def _observables(profile: Profile) -> _Entry:
    direction = _SWEEPS[profile]
    words = f"Holding moment and support reaction over the {{along}}, profile {profile}"
    return _Entry(partial(draw_observable_curves, profile, direction), words, direction, _OBSERVED)


def _rods(profile: Profile) -> _Entry:
    direction = _SWEEPS[profile]
    words = f"Deformed rods, profile {profile}"
    return _Entry(partial(draw_deformed_rods, profile, direction), words, direction, _SEEN)


_ENTRIES: Mapping[int, _Entry] = {
    2: _Entry(partial(draw_contact_kinds, "II"), "Tip and tangential contact, profile II", "forward", _EXPLAINED),
    **{number: _observables(profile) for number, profile in zip(range(3, 7), _PROFILES, strict=True)},
    **{number: _rods(profile) for number, profile in zip(range(7, 11), _PROFILES, strict=True)},
    11: _Entry(
        partial(draw_reconstructed_points, _PROFILES),
        "Reconstructed contact points, profiles I to IV",
        "both",
        _TOUCHED,
    ),
}

NUMBERS = tuple(_ENTRIES)  # numbers of the figures, in order


def figure(
    number: int,
    *,
    distances: Sequence[float] | None = None,
    drive: Carried | None = None,
    drive_step: float | None = None,
    rods: int = 15,
    load_cell: LoadCell | None = None,
    rng: Rng | None = None,
    width: float = PAGE_WIDTH,
) -> Figure:
    """Draw a figure of Merker et al. 2018 (doi 10.1155/2018/1613945), computed anew.

    Figure 2 explains tip and tangential contact. Figures 3 to 6 show moment and forces over the drive angle for
    profiles I to IV, Figures 7 to 10 the deformed rods, and Figure 11 the contact points that Step 2 reconstructs from
    these records. Profile I is swept forward; the others are swept forward and backward.

    With a drive that carries the base, the figures show its one sweep in place of these rotations: moment and forces
    over the travel of the base, rods with the path of the base, and the points that this sweep touches.

    Parameters
    ----------
    number : int
        Number of the figure, from 2 to 11.
    distances : sequence of float, optional
        Distances of the profile's vertex above the origin, which is the pivot of the rotations, q [L]. By default 0.5
        in Figure 2 (of several the first at which a phase occurs); 0.3, 0.4, 0.5 and 0.6 in Figures 3 to 6; 0.4 and 0.6
        in Figures 7 to 10; 0.3 and 0.6 in Figure 11.
    drive : Translation or Motion, optional
        Drive that carries the base [L], the same for every distance; it must move the base. By default the rod is
        turned about the origin, as in the paper.
    drive_step : float, optional
        Step of the rotations [rad], at most 0.5 and by default 1°, or of the drive, in its travel [L], as in `scan`.
    rods : int
        Number of rods drawn of a sweep in Figures 7 to 10, except those at first contact, phase changes and the end of
        contact.
    load_cell : LoadCell, optional
        Load cell that measures the records of Figure 11; by default they are without noise.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator, optional
        Random numbers of the load cell's noise, needed with a load cell.
    width : float
        Width of the figure [inches]: 7 for a page, 3.5 for a column, with panels below one another.

    Returns
    -------
    matplotlib.figure.Figure
        Figure outside pyplot. Its look follows the settings while it is made and saved: see `plotting.style`.

    Raises
    ------
    ParameterError
        If there is no such figure, or an argument is not valid.
    ContourError
        If a distance is beyond the rod's reach, or the rod would cut the profile where the drive begins.

    Examples
    --------
    >>> from tactile_bayes.plotting import style
    >>> with style("print"):
    ...     made = figure(3, distances=[0.3, 0.5])
    >>> len(made.axes)
    3

    The rod is carried upright from the right to the left:

    >>> from tactile_bayes.sweep import Translation
    >>> drive = Translation(base=(1.4, 0.0), heading=np.pi, drive_angle=np.pi / 2, travel=2.8)
    >>> figure(3, distances=[0.5], drive=drive).axes[-1].get_xlabel()
    'travel of the base [$L$]'
    """
    entry, choice = _chosen(
        number,
        distances=distances,
        drive=drive,
        drive_step=drive_step,
        rods=rods,
        load_cell=load_cell,
        rng=rng,
        width=width,
    )
    return entry.draw(choice)


def caption(number: int, **options: Any) -> str:
    """Return the caption of a figure.

    Parameters
    ----------
    number, options
        As in `figure`.

    Returns
    -------
    str
        The caption, with the sweep, the distances and the seed of the noise.

    Raises
    ------
    ParameterError
        As `figure`.

    Examples
    --------
    >>> caption(7, distances=[0.5])
    'Deformed rods, profile I, forward sweep, q = 0.5 L.'
    """
    usual: Mapping[str, Any] = figure.__kwdefaults__ or {}
    entry, choice = _chosen(number, **{**usual, **options})
    distances = ", ".join(f"{q:g}" for q in choice.distances)
    noise = ""
    if number == 11:
        noise = (
            ", without noise"
            if choice.load_cell is None or choice.seed is None
            else f", measured with noise (seed {seed_words(choice.seed)})"
        )
    along = "drive angle" if choice.drive is None else "travel of the base"
    return f"{entry.words.format(along=along)}, {_sweep_in_words(entry, choice)}{noise}, q = {distances} L."


def _sweep_in_words(entry: _Entry, choice: Choice) -> str:
    if choice.drive is None:
        return "forward and backward sweep" if entry.direction == "both" else f"{entry.direction} sweep"
    poses = choice.drive.poses
    begin, end = (f"({_number(x)}, {_number(y)})" for x, y in poses[[0, -1], :2])
    path = "" if len(poses) == 2 else f"along {len(poses)} poses "
    angles = np.degrees([poses[:, 2].min(), poses[:, 2].max()])
    at = list(dict.fromkeys(f"{_number(angle)}°" for angle in angles))
    return f"base carried {path}from {begin} to {end} L, drive angle {' to '.join(at)}"


def _number(value: float) -> str:
    return f"{np.round(value, 6) + 0.0:g}"


def _chosen(number: int, *, distances: Sequence[float] | None, **options: Any) -> tuple[_Entry, Choice]:
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number not in _ENTRIES:
        raise ParameterError(f"there is no figure {number!r}: choose from {NUMBERS[0]} to {NUMBERS[-1]}")
    entry = _ENTRIES[number]
    return entry, choice_of(entry.distances if distances is None else distances, **options)
