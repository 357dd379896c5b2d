"""Checks of arguments: each raises ParameterError with the given value and a description of valid ones."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping, Sequence, Set
from numbers import Real
from pathlib import Path
from types import UnionType
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError

TINY = math.ulp(0.0)  # least positive number
_MOST = 10**9  # largest count, of draws and the like
_SHOWN = 120  # largest number of characters of a value in a message


def shown(value: object) -> str:
    """Return the representation of a value for a message, or its type if that is long."""
    written = repr(value)
    if len(written) <= _SHOWN and "\n" not in written:
        return written
    shape = getattr(value, "shape", None)
    return f"a {type(value).__name__}" + (f" of shape {shape}" if isinstance(shape, tuple) else "")


def refused(name: str, value: object, correction: str) -> ParameterError:
    """Return the error that refuses an argument."""
    return ParameterError(f"{name} is {shown(value)}: {correction}")


def as_number(value: Any) -> float | None:
    """Return a real number as a float; None for a truth value, text, a complex number, or several numbers."""
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    if kind and (kind not in "iuf" or getattr(value, "shape", None) != ()):
        return None
    if not kind and (not isinstance(value, Real) or isinstance(value, bool)):
        return None
    try:
        return float(unmasked(value))
    except OverflowError:
        return None


def unmasked(values: Any) -> Any:
    """Return a masked array as numbers, NaN where it is masked; other values as they are."""
    return np.ma.filled(values.astype(float), np.nan) if isinstance(values, np.ma.MaskedArray) else values


def as_numbers(values: Any) -> Floats | None:
    """Return real numbers as an array of their shape, NaN where masked; None if one of them is not a real number."""
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "iuf":
            return None
        if isinstance(values, list | tuple) and any(
            isinstance(value, bool | np.bool_) for value in np.asarray(values, dtype=object).ravel()
        ):
            return None
    except (TypeError, ValueError):
        return None
    return np.asarray(unmasked(values)) if isinstance(values, np.ma.MaskedArray) else array.astype(float)


def check_array(name: str, values: Any, correction: str = "give a number, or an array of numbers") -> Floats:
    """Return real numbers, which need not be finite, as an array of their shape."""
    if type(values) is np.ndarray and values.dtype == np.float64:  # a short cut, for inner loops
        return values
    numbers = as_numbers(values)
    if numbers is None:
        raise refused(name, values, correction)
    return numbers


def check_arrays(**values: Any) -> list[Floats]:
    """Return arrays of numbers whose shapes broadcast."""
    arrays = {name: check_array(name, given) for name, given in values.items()}
    try:
        np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} of shape {array.shape}" for name, array in arrays.items() if array.shape)
        raise ParameterError(f"{shapes} do not broadcast: give numbers, or arrays of shapes that broadcast") from None
    return list(arrays.values())


def check_number(
    name: str, value: Any, correction: str = "give a finite number", *, least: float = -math.inf, most: float = math.inf
) -> float:
    """Return a finite number from `least` to `most`."""
    number = as_number(value)
    if number is None or not (math.isfinite(number) and least <= number <= most):
        raise refused(name, value, correction)
    return number


def check_numbers(
    name: str,
    values: Any,
    correction: str = "give finite numbers",
    *,
    shape: Sequence[int | None] | None = None,
    least: float = -math.inf,
    most: float = math.inf,
) -> Floats:
    """Return finite numbers from `least` to `most` as an array; None in its shape stands for any size above 0."""
    numbers = as_numbers(values)
    is_right = numbers is not None and (np.isfinite(numbers) & (least <= numbers) & (numbers <= most)).all()
    if numbers is None or not is_right or not (shape is None or _is_of(shape, numbers.shape)):
        raise refused(name, values, correction)
    return numbers


def _is_of(shape: Sequence[int | None], sizes: Sequence[int]) -> bool:
    fits = [size > 0 if wanted is None else size == wanted for wanted, size in zip(shape, sizes, strict=False)]
    return len(shape) == len(sizes) and all(fits)


def check_pivots(name: str, values: Any) -> list[tuple[float, float]]:
    """Return one or several pivots as pairs of finite numbers."""
    correction = "give a pivot (x, y), or several: [(x, y), (x, y)]"
    numbers = np.atleast_2d(check_numbers(name, values, correction))
    if not _is_of((None, 2), numbers.shape):
        raise refused(name, values, correction)
    return [(float(x), float(y)) for x, y in numbers]


def check_positive(name: str, value: Any, correction: str = "give a positive number") -> float:
    """Return a finite number above zero."""
    return check_number(name, value, correction, least=TINY)


def check_probability(
    name: str, value: Any, correction: str = "give a number between 0 and 1, like 0.95", *, below: float = 1.0
) -> float:
    """Return a number between 0 and `below`, exclusive."""
    return check_number(name, value, correction, least=TINY, most=math.nextafter(below, 0.0))


def check_whole_number(name: str, value: Any, least: int, correction: str = "", *, most: float = _MOST) -> int:
    """Return a whole number from `least` to `most`; a truth value is refused."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        raise refused(name, value, correction or f"give a whole number from {least} up, at most {most:g}")
    return int(value)


def check_choice(name: str, value: Any, choices: Collection[str], correction: str = "") -> str:
    """Return a word if it is one of the choices."""
    if isinstance(value, str) and value in choices:
        return value
    *others, last = map(repr, choices)
    raise refused(name, value, correction or f"choose {', '.join(others)} or {last}")


def check_kind(name: str, value: Any, kind: type | UnionType, correction: str) -> None:
    """Refuse a value that is not an instance of a class."""
    if not isinstance(value, kind):
        raise refused(name, value, correction)


def check_optional(name: str, value: Any, kind: type, correction: str = "") -> None:
    """Refuse a value that is neither an instance of a class nor None."""
    if value is not None:
        check_kind(name, value, kind, f"{correction or f'give a {kind.__name__}'}, or None")


def check_switch(name: str, value: Any) -> bool:
    """Return a truth value."""
    if not isinstance(value, bool | np.bool_):
        raise refused(name, value, "give True or False")
    return bool(value)


def check_function(name: str, value: Any) -> None:
    """Refuse a value that is neither callable nor None."""
    if value is not None and not callable(value):
        raise refused(name, value, "give a function, or None")


def check_names(name: str, values: Any) -> list[str]:
    """Return a list of names."""
    listed = values.tolist() if isinstance(values, np.ndarray) and values.dtype.kind in "UO" else values
    if isinstance(listed, str):
        raise refused(name, values, f"give a list of names, like [{listed!r}]")
    if not isinstance(listed, Sequence | Set) or isinstance(listed, bytes | bytearray):
        raise refused(name, values, "give a list of names")
    for one in listed:
        if not isinstance(one, str):
            raise refused(name, values, f"{shown(one)} in it is no name: give a list of names")
    return list(listed)


def check_mapping(name: str, values: Any, correction: str) -> None:
    """Refuse a value that is neither a mapping with names as keys nor None."""
    is_mapping = isinstance(values, Mapping) and not hasattr(values, "data_vars")  # a dataset is one of columns
    if values is not None and not (is_mapping and all(isinstance(key, str) for key in values)):
        raise refused(name, values, correction)


def check_path(name: str, value: Any, correction: str = "give a path, like 'record.csv'") -> Path:
    """Return the path of a file or a folder."""
    text = os.fspath(value) if isinstance(value, str | os.PathLike) else ""
    if not isinstance(text, str) or not text or "\0" in text:
        raise refused(name, value, correction)
    return Path(value)
