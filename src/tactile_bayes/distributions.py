"""Distributions of a number: frozen ones of `scipy.stats`, read from tables and text and written to them.

A number is known, a distribution is unknown.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from scipy import stats
from scipy.special import ndtri

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import as_number, refused, shown
from tactile_bayes.errors import ParameterError

_TRIED = 16  # number of draws with which a distribution is tried
_NARROWEST = 64.0 * float(np.finfo(float).eps)  # range of draws over their size up to which they count as one number
UNWRITTEN = "not written"  # text of what has a distribution that is none of SciPy's
_ROOT_2PI = 0.5 * math.log(2.0 * math.pi)


@runtime_checkable
class Distribution(Protocol):
    """Protocol of a distribution of a number, which frozen ones of scipy.stats satisfy."""

    def logpdf(self, x: Any) -> Any: ...
    def rvs(self, size: int, random_state: np.random.Generator) -> Any: ...
    def std(self) -> Any: ...


class DistributionKind(NamedTuple):
    """A distribution by the name and the numbers that a table states."""

    size: int  # how many numbers
    is_possible: Callable[..., bool]
    rule: str  # for the numbers, for messages
    text: str
    frozen: Callable[..., Distribution]
    # Its numbers from those of a frozen distribution of the same name; None if they do not state all of it.
    numbers: Callable[[Mapping[str, Any]], tuple[float, ...] | None]
    at: Callable[..., Any]  # quantile function of numbers and probabilities


# Distributions that a table states by a name and a list of numbers, as { normal = [0.0, 0.1] }.
KINDS = {
    "uniform": DistributionKind(
        2,
        lambda low, high: low < high,
        "the first must be below the second",
        "uniform from {} to {}",
        lambda low, high: stats.uniform(low, high - low),
        lambda n: (n["loc"], n["loc"] + n["scale"]),
        lambda low, high, share: low + (high - low) * share,
    ),
    "log_uniform": DistributionKind(
        2,
        lambda low, high: 0.0 < low < high,
        "both must be positive, the first below the second",
        "log-uniform from {} to {}",
        lambda low, high: stats.loguniform(low, high),
        lambda n: None if n["loc"] else (n["a"] * n["scale"], n["b"] * n["scale"]),
        lambda low, high, share: np.exp(math.log(low) + math.log(high / low) * share),
    ),
    "normal": DistributionKind(
        2,
        lambda mean, deviation: deviation >= 0.0,
        "they are mean and standard deviation, which is not negative",
        "normal, mean {}, standard deviation {}",
        lambda mean, deviation: stats.norm(mean, deviation),
        lambda n: (n["loc"], n["scale"]),
        lambda mean, deviation, share: mean + deviation * ndtri(open_share(share)),
    ),
    "log_normal": DistributionKind(
        2,
        lambda median, deviation: median > 0.0 and deviation >= 0.0,
        "they are the median, positive, and the logarithm's standard deviation, which is not negative",
        "log-normal, median {}, standard deviation of the logarithm {}",
        lambda median, deviation: stats.lognorm(s=deviation, scale=median),
        lambda n: None if n["loc"] else (n["scale"], n["s"]),
        lambda median, deviation, share: median * np.exp(deviation * ndtri(open_share(share))),
    ),
    "half_normal": DistributionKind(
        1,
        lambda scale: scale >= 0.0,
        "it is the scale, which is not negative",
        "half-normal, scale {}",
        lambda scale: stats.halfnorm(scale=scale),
        lambda n: None if n["loc"] else (n["scale"],),
        lambda scale, share: -scale * ndtri(0.5 - 0.5 * share),
    ),
}
# Names of these distributions in SciPy.
_NAMES = dict(zip(("uniform", "reciprocal", "norm", "lognorm", "halfnorm"), KINDS, strict=True))
_NAMES["loguniform"] = "log_uniform"
_USUAL = {("loc", 0.0), ("scale", 1.0)}  # numbers of a distribution that need no mention


def distribution_of_table(
    value: Any, name: str, number: Callable[[Any], float | None] = as_number
) -> float | Distribution:
    """Return what a value of a table states: a number, or a frozen distribution."""
    hint = (
        f"give a number, or a distribution like {{ normal = [0.0, 0.1] }} (there are {', '.join(KINDS)}, and those of "
        "scipy.stats by name, like { beta = { a = 2.0, b = 3.0 } })"
    )
    plain = number(value)
    if plain is not None and math.isfinite(plain):
        return plain
    if not isinstance(value, Mapping) or len(value) != 1:
        raise refused(name, value, hint)
    ((kind, given),) = value.items()
    of_scipy = getattr(stats, str(kind), None)
    if isinstance(given, Mapping) and isinstance(of_scipy, stats.rv_continuous):
        found = _of_scipy(of_scipy, f"{name}.{kind}", given, number)
    elif kind in KINDS and not isinstance(given, Mapping):
        found = _of_kind(KINDS[kind], f"{name}.{kind}", given, number)
    else:
        raise ParameterError(f"{name} has the distribution {shown(kind)}, which is unknown: {hint}")
    check_distribution(name, found)
    return found


def _of_kind(kind: DistributionKind, name: str, given: Any, number: Callable[[Any], float | None]) -> Distribution:
    numbers = [number(each) for each in (given if isinstance(given, list | tuple) else [given])]
    if len(numbers) != kind.size or not all(each is not None and math.isfinite(each) for each in numbers):
        wanted = "a finite number" if kind.size == 1 else f"a list of {kind.size} finite numbers"
        raise refused(name, given, f"give {wanted}")
    if not kind.is_possible(*numbers):
        raise refused(name, given, kind.rule)
    return kind.frozen(*numbers)


def _of_scipy(
    of_scipy: stats.rv_continuous, name: str, given: Mapping[str, Any], number: Callable[[Any], float | None]
) -> Distribution:
    numbers, known = {each: number(value) for each, value in given.items()}, _names_of(of_scipy)
    if set(numbers) - set(known) or None in numbers.values() or set(known[:-2]) - set(numbers):
        raise refused(name, dict(given), f"give numbers for {', '.join(known)}")
    found: Distribution = of_scipy(**numbers)
    return found


def _names_of(of_scipy: stats.rv_continuous) -> list[str]:
    """Return the names of the numbers of a distribution of SciPy."""
    return [*(of_scipy.shapes.split(", ") if of_scipy.shapes else []), "loc", "scale"]


def table_of_distribution(value: float | Distribution) -> Any:
    """Return the value of a table that states a number or a distribution, as `distribution_of_table` takes it."""
    plain = as_number(value)
    if plain is not None:
        return plain
    numbers = {name: float(each) for name, each in numbers_of(value).items()}
    scipy_name = getattr(getattr(value, "dist", None), "name", "")
    if not numbers or not isinstance(getattr(stats, scipy_name, None), stats.rv_continuous):
        raise ParameterError(f"{shown(value)} cannot be written as text: give a distribution of scipy.stats by numbers")
    kind = _NAMES.get(scipy_name, "")
    short = KINDS[kind].numbers(numbers) if kind else None
    if short is None:
        return {scipy_name: {name: each for name, each in numbers.items() if (name, each) not in _USUAL}}
    return {kind: list(short) if len(short) > 1 else short[0]}


def text_or_unwritten(text: Callable[[], str]) -> str:
    """Return a text, or "not written" if a distribution in it is none of SciPy's."""
    try:
        return text()
    except ParameterError:
        return UNWRITTEN


def stated_text(attrs: Mapping[Any, Any], entry: str) -> str:
    """Return the text of `text_or_unwritten` in the attributes of a posterior, or refuse one that is not written."""
    text = attrs.get(entry, UNWRITTEN)
    if not isinstance(text, str) or text == UNWRITTEN:
        what = entry.partition("_")[0]
        raise ParameterError(f"the posterior does not state its {what}, as a distribution of it is none of SciPy's")
    return text


def open_share(share: Floats) -> Floats:
    """Bound probabilities away from 0, where a normal quantile would be infinite."""
    return np.maximum(share, 2.0**-54)


def frozen(value: Any) -> Any:
    """Return a distribution of SciPy's newer kind, as `scipy.stats.Normal`, like a frozen one; all else as it is."""
    if isinstance(value, Distribution) or not all(hasattr(value, each) for each in ("logpdf", "sample", "support")):
        return value
    numbers = {name: as_number(each) for name, each in getattr(value, "_parameters", {}).items()}
    match (type(value).__name__, numbers):
        case ("Normal", {"mu": float(mean), "sigma": float(deviation)}):
            return stats.norm(mean, deviation)
        case ("Uniform", {"a": float(low), "b": float(high)}):
            return stats.uniform(low, high - low)
    return _Newer(value)


@dataclass(frozen=True)
class _Newer:
    """A distribution of SciPy's newer kind with the methods of a frozen one."""

    of: Any

    def __getattr__(self, name: str) -> Any:
        """Return what has the same name in both kinds, like cdf, median and support."""
        return getattr(object.__getattribute__(self, "of"), name)

    def __repr__(self) -> str:
        return repr(self.of)

    def logpdf(self, x: Any) -> Any:
        return self.of.logpdf(x)

    def rvs(self, size: int, random_state: np.random.Generator) -> Any:
        return self.of.sample(size, rng=random_state)

    def std(self) -> Any:
        return self.of.standard_deviation()

    def ppf(self, q: Any) -> Any:
        return self.of.icdf(q)


def check_distribution(parameter: str, distribution: Any) -> None:
    """Refuse what is no distribution, or has no density."""
    if not isinstance(distribution, Distribution) or isinstance(distribution, stats.rv_continuous):
        is_table = isinstance(distribution, Mapping)
        more = "; tables like this one are for rig.toml, which Rig.read reads" if is_table else ""
        correction = f"give a frozen distribution, like scipy.stats.norm(0.5, 0.1){more}"
        raise refused(f"the prior of {parameter}", distribution, correction)
    flaw = _flaw_of(distribution)
    if flaw:
        kind = getattr(getattr(distribution, "dist", None), "name", "")
        raise ParameterError(f"the prior of {parameter}{f', {kind},' if kind else ''} {flaw}")


def _flaw_of(distribution: Distribution) -> str:
    """Return what keeps a distribution from having a density, and what to do; "" if nothing does."""
    numbers = numbers_of(distribution)
    for name, value in numbers.items():
        number = as_number(value)
        if number is None or np.isnan(number):
            return f"has the {name} {shown(value)}: give a number"
    no_width = "has no width, and so no density: it is known, so give the number, {:.6g}"
    if numbers.get("scale") == 0.0:
        return no_width.format(numbers["loc"])
    try:
        with np.errstate(all="ignore"):
            low, high = support_of(distribution)
            draws = np.asarray(distribution.rvs(_TRIED, random_state=np.random.default_rng(0)), dtype=float)
            density = np.asarray(distribution.logpdf(draws), dtype=float)
    except (TypeError, ValueError) as error:
        return f"cannot be drawn from ({error}): check its numbers"
    if draws.shape != (_TRIED,) or density.shape != (_TRIED,):
        return "does not give one number for each draw: give the distribution of a single number"
    if not low <= high or not np.isfinite(draws).all() or np.isnan(density).any() or np.isneginf(density).any():
        return "has no finite draws, or no density there: check its numbers"
    if not np.ptp(draws) > _NARROWEST * float(np.abs(draws).max()):
        return no_width.format(draws[0])
    return ""


def refuse_unknown_names(given: Mapping[str, Any], names: Collection[str], whose: str = "") -> None:
    """Refuse distributions by names that are no parameters."""
    unknown = sorted(set(given) - set(names))
    if unknown:
        raise ParameterError(f"{', '.join(unknown)} is no parameter{whose}: there are {', '.join(names)}")


def numbers_of(distribution: Any) -> dict[str, Any]:
    """Return shapes, loc and scale of a frozen distribution of scipy.stats by name; {} for another object."""
    of_scipy = getattr(distribution, "dist", None)
    if not isinstance(of_scipy, stats.rv_continuous):
        return {}
    shapes, loc, scale = of_scipy._parse_args(*distribution.args, **distribution.kwds)  # type: ignore[attr-defined]
    return dict(zip(_names_of(of_scipy), (*shapes, loc, scale), strict=True))


def support_of(distribution: Distribution) -> tuple[float, float]:
    """Return the ends of a distribution's support."""
    low, high = distribution.support() if hasattr(distribution, "support") else (-np.inf, np.inf)
    return float(low), float(high)


def in_words(distribution: Distribution) -> str:
    """Return a distribution as text, the same however its numbers were given: its identity."""
    of_scipy = getattr(distribution, "dist", None)
    if isinstance(of_scipy, stats.rv_histogram):
        counts, edges = of_scipy._histogram  # type: ignore[attr-defined]
        return f"histogram of {len(counts)} bins ({zlib.crc32(np.concatenate([counts, edges]).tobytes()):08x})"
    numbers = numbers_of(distribution)
    if of_scipy is None or not numbers:
        return repr(distribution)
    written = [f"{name}={value:g}" for name, value in numbers.items() if name != "loc" or value]
    if len(numbers) == 2:
        written = [f"{value:g}" for value in numbers.values()]
    return f"{of_scipy.name}({', '.join(written)})"


def all_in_words(distributions: Mapping[str, Distribution]) -> str:
    """Return distributions by name as text, for an attribute."""
    return json.dumps({name: in_words(each) for name, each in distributions.items()})


def log_density_of(distribution: Distribution) -> Callable[[Floats], Floats]:
    """Return the log-density of a distribution, its `logpdf`, in a closed form for common ones, ten times faster."""
    closed = _CLOSED.get(type(getattr(distribution, "dist", None)))
    values = numbers_of(distribution)
    if closed is None or any(np.ndim(value) for value in values.values()):
        return distribution.logpdf
    return partial(closed, **{name: float(value) for name, value in values.items()})


def quantiles_of(distribution: Distribution, name: str) -> Callable[[Floats], Floats]:
    """Return the quantile function of the prior of a parameter, in a closed form for those of `KINDS`."""
    kind = KINDS.get(_NAMES.get(getattr(getattr(distribution, "dist", None), "name", ""), ""))
    numbers = kind.numbers(numbers_of(distribution)) if kind else None
    if kind is not None and numbers is not None:
        return partial(kind.at, *numbers)
    if not hasattr(distribution, "ppf"):
        raise ParameterError(f"the prior of {name} has no quantile function: give it a method ppf")
    quantiles: Callable[[Floats], Floats] = distribution.ppf
    return quantiles


def _norm(x: Floats, *, loc: float, scale: float) -> Floats:
    return np.asarray(-0.5 * ((x - loc) / scale) ** 2 - (_ROOT_2PI + math.log(scale)))


def _halfnorm(x: Floats, *, loc: float, scale: float) -> Floats:
    return np.where(x >= loc, _norm(x, loc=loc, scale=scale) + math.log(2.0), -np.inf)


def _lognorm(x: Floats, *, s: float, loc: float, scale: float) -> Floats:
    inside = x > loc
    logarithm = np.log(np.where(inside, x - loc, 1.0)) - math.log(scale)
    values = -0.5 * (logarithm / s) ** 2 - logarithm - (_ROOT_2PI + math.log(s) + math.log(scale))
    return np.where(inside, values, -np.inf)


def _uniform(x: Floats, *, loc: float, scale: float) -> Floats:
    return np.where((x >= loc) & (x <= loc + scale), -math.log(scale), -np.inf)


_CLOSED: dict[type, Callable[..., Any]] = {
    type(stats.norm): _norm,
    type(stats.halfnorm): _halfnorm,
    type(stats.lognorm): _lognorm,
    type(stats.uniform): _uniform,
}
