"""Public functions can be held in the head: none has more than nine parameters."""

import importlib
import inspect
import re
from pathlib import Path

import pytest

import tactile_bayes as tb

DOCUMENTED = Path(__file__).parents[1] / "docs" / "api"
MOST = 9

EXCEPTIONS = {
    "LoadCell": "a data sheet, whose fields are the numbers of a sensor, each with its name",
    "Rod": "a data sheet too; the modes of its rest curvature come from a trace, with the deviation of their mean",
    "Event": "a result, which is read and never made by hand: the values at one event of a sweep",
    "Specification": "a result, which read_specification makes from a file with sections",
}


def public_names():
    """Names at the top, and those of every room that the pages of the API list."""
    names = {("tactile_bayes", name) for name in tb.__all__}
    for page in DOCUMENTED.glob("*.md"):
        for room, listed in re.findall(
            r"```\{public\} ([\w.]+)\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL
        ):
            names |= {(room, name) for name in listed.split()}
    rooms = {room for room, _ in names} | {f"tactile_bayes.{name}" for name in (*tb._MODULES, *tb._ROOMS)}
    for room in rooms:
        names |= {(room, name) for name in getattr(importlib.import_module(room), "__all__", ())}
    return sorted(names)


def functions():
    """Public functions, classes and methods, by name."""
    found = {}
    for room, name in public_names():
        given = getattr(importlib.import_module(room), name)
        if callable(given):
            found[name] = given
        if inspect.isclass(given):
            methods = inspect.getmembers(given, callable)
            found |= {f"{name}.{n}": method for n, method in methods if not n.startswith("_")}
    return found


def parameters_of(function):
    try:
        names = list(inspect.signature(function).parameters)
    except ValueError:  # of a type without a signature
        return []
    return [name for name in names if name != "self"]


def test_public_functions_are_found():
    assert {"calibrate", "error_map", "Workers", "Rig.write", "datasets", "generate"} - set(functions()) == {"datasets"}


@pytest.mark.parametrize("name", functions())
def test_no_public_function_has_more_than_nine_parameters(name):
    if name not in EXCEPTIONS:
        assert len(parameters_of(functions()[name])) <= MOST, parameters_of(functions()[name])


def test_exceptions_are_some():
    assert all(len(parameters_of(functions()[name])) > MOST for name in EXCEPTIONS)
