"""Every regular expression of the package takes a time in proportion to the length of a text."""

import ast
import builtins
import importlib
import pkgutil
import re
import time
from pathlib import Path
from re import _constants as codes
from re import _parser as parser

import pytest

import tactile_bayes

LENGTHS = (22, 6_000)  # repetitions of an attack: the first shows an exponential pattern, the second a quadratic one
MOST = 0.03  # processor time of a match [s], hundreds of times that of a linear pattern
METHODS = {"match", "fullmatch", "search", "sub", "subn", "split", "findall", "finditer"}
CLASSES = {
    codes.CATEGORY_DIGIT: "1",
    codes.CATEGORY_SPACE: " ",
    codes.CATEGORY_WORD: "a1",
    codes.CATEGORY_NOT_DIGIT: "a",
    codes.CATEGORY_NOT_SPACE: "a1",
    codes.CATEGORY_NOT_WORD: " -",
}
REPEATS = (codes.MAX_REPEAT, codes.MIN_REPEAT, codes.POSSESSIVE_REPEAT)
USUAL = 'a1 .,-/:[("\\\n'


class _Letter(str):
    """A letter in place of a local variable; its attributes are letters too."""

    def __getattr__(self, name):
        return self


class _Blanks(dict):
    """Names of a module; a local name stands for a letter."""

    def __missing__(self, name):
        return getattr(builtins, name, _Letter("x"))


def patterns():
    """Each pattern, and the methods it is used with."""
    found = {}
    for module in pkgutil.walk_packages(tactile_bayes.__path__, "tactile_bayes."):
        path = Path(importlib.util.find_spec(module.name).origin)
        text = path.read_text(encoding="utf-8")
        if "import re\n" not in text:
            continue
        names = vars(importlib.import_module(module.name))
        compiled = {name: value.pattern for name, value in names.items() if isinstance(value, re.Pattern)}
        for node in ast.walk(ast.parse(text)):
            match node:
                case ast.Attribute(value=ast.Name(id=name), attr=method) if name in compiled and method in METHODS:
                    found.setdefault(compiled[name], set()).add(method)
                case ast.Call(func=ast.Attribute(value=ast.Name(id="re"), attr=method), args=[first, *_]):
                    if method in METHODS | {"compile"}:
                        given = eval(compile(ast.Expression(first), path, "eval"), _Blanks(names))
                        found.setdefault(getattr(given, "pattern", given), set()).add(method)
    return found


def characters(items):
    """Characters that a set takes, some of each kind."""
    items = list(items)
    if items and items[0][0] is codes.NEGATE:
        return "".join(sign for sign in USUAL if not _is_in(sign, items[1:]))
    return "".join(_of(code, value) for code, value in items)


def _of(code, value):
    match code:
        case codes.LITERAL:
            return chr(value)
        case codes.RANGE:
            return chr(value[0]) + chr(value[1])
        case codes.CATEGORY:
            return CLASSES[value]
        case codes.IN:
            return characters(value)
        case codes.ANY:
            return "a1 -"
        case codes.NOT_LITERAL:
            return "".join(sign for sign in USUAL if ord(sign) != value)
    return ""


def _is_in(sign, items):
    return any(
        (code is codes.RANGE and value[0] <= ord(sign) <= value[1]) or sign in _of(code, value) for code, value in items
    )


def _inner(code, value):
    """Patterns in an item of a pattern."""
    if code in REPEATS:
        return [value[2]]
    if code is codes.SUBPATTERN:
        return [value[3]]
    if code is codes.ATOMIC_GROUP:
        return [value]
    return value[1] if code is codes.BRANCH else []


def parts(tree):
    """Yield (text before, what is repeated) for each repetition; return the shortest text with all that is optional."""
    before = ""
    for code, value in tree:
        made = _of(code, value)[:1]
        for number, branch in enumerate(_inner(code, value)):
            one = ""
            for piece in parts(branch):
                if isinstance(piece, str):
                    one = piece
                else:
                    yield before + piece[0], piece[1]
            if code in REPEATS and value[1] > 1:
                yield before, one
                yield from {(before, sign) for item in branch for sign in _of(*item)[:12]}
            if number == 0:
                made = one
        before += made
    yield before


def attacks(pattern):
    """Texts that repeat what the pattern repeats, after what it takes before, and end in what it does not take."""
    tree = parser.parse(pattern)
    pairs = {piece for piece in parts(tree) if not isinstance(piece, str)}
    pairs |= {("", sign) for sign in USUAL}
    pairs |= {(before, pump) for before, _ in pairs for pump in " 1a"}
    for length in LENGTHS:
        for before, pump in sorted(pairs):
            for end in ("", "\n", "!"):
                yield before + pump * length + end


def seconds(pattern, methods, text):
    compiled = re.compile(pattern)
    began = time.thread_time()
    for method in methods & {"match", "fullmatch", "search"} or {"fullmatch"}:
        getattr(compiled, method)(text)
    if methods & {"sub", "subn", "split", "findall", "finditer"}:
        for _ in compiled.finditer(text):
            pass
    return time.thread_time() - began


def slowest(pattern, methods):
    """The time of the slowest attack, and the attack; one that is slow is timed again."""
    worst = (0.0, "")
    for text in attacks(pattern):
        taken = seconds(pattern, methods, text)
        if taken > MOST:
            taken = min(taken, seconds(pattern, methods, text))
        worst = max(worst, (taken, f"{text[:40]!r} … {text[-5:]!r}"))
        if worst[0] > MOST:
            break
    return worst


@pytest.mark.parametrize(
    ("pattern", "methods"), [(one, sorted(methods)) for one, methods in patterns().items()], ids=repr
)
def test_a_pattern_takes_linear_time(pattern, methods):
    taken, text = slowest(pattern, set(methods))
    assert taken < MOST, f"{pattern}: {taken:.2f} s for {text}"


@pytest.mark.parametrize("pattern", [r"a/\s*(?P<slash>[^/]*\S)\s*", r"(?:[a-z]+)*1", r"\s*\s*x"])
def test_a_slow_pattern_is_found(pattern):
    assert slowest(pattern, {"fullmatch"})[0] > MOST
