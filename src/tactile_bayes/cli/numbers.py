"""Numbers in options, and load cells that options describe."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tactile_bayes.load_cell import LoadCell

__all__ = ["load_cell_asked", "numbers_asked"]


def load_cell_asked(force_noise: float | None, moment_noise: float | None) -> LoadCell | None:
    """The load cell that is simulated, if one is given.

    Raises
    ------
    ParameterError
        If it is not given whole.
    """
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.load_cell import LoadCell

    if force_noise is None and moment_noise is None:
        return None
    if not force_noise or not moment_noise:
        raise ParameterError("--force-noise and --moment-noise go together, above zero: give both, or neither")
    return LoadCell(force_noise=force_noise, moment_noise=moment_noise)


def numbers_asked(text: str, option: str, count: int) -> tuple[float, ...]:
    """As many numbers, with commas between them.

    Raises
    ------
    ParameterError
        If there are more or fewer, or one is no number.
    """
    from tactile_bayes.errors import ParameterError

    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        wanted = "a number" if count == 1 else f"{count} numbers with commas between them"
        raise ParameterError(f"{option} is {text!r}: give {wanted}")
    return numbers
