"""Public functions can be held in the head: none has more than nine parameters."""

import importlib
import inspect

import tactile_bayes as tb
from helpers.public_names import listed

MOST = 9

EXCEPTIONS = {
    "LoadCell": "a data sheet, whose fields are the numbers of a sensor, each with its name",
    "Rod": "a data sheet too; the modes of its rest curvature come from a trace, with the deviation of their mean",
    "Event": "a result, which is read and never made by hand: the values at one event of a sweep",
    "Wrench": "a result too: the loads of a contact, and their derivatives",
    "Specification": "a result, which read_specification makes from a file with sections",
}


def functions():
    """Functions, classes and methods by name: of the pages of the API, and all that the rooms name as theirs."""
    rooms = {importlib.import_module(f"tactile_bayes.{name}") for name in (*tb._MODULES, *tb._ROOMS)}
    rooms |= {tb, *(module for module, _ in listed())}
    names = {(room, name) for room in rooms for name in getattr(room, "__all__", ())}
    names |= {(module, name) for module, listed_names in listed() for name in listed_names}
    found = {}
    for room, name in sorted(names, key=lambda one: (one[0].__name__, one[1])):
        given = getattr(room, name)
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


def test_only_data_sheets_and_results_have_more_than_nine_parameters():
    found = functions()
    assert {"calibrate", "error_map", "Workers", "Rig.write", "datasets", "generate"} - set(found) == {"datasets"}
    assert {name for name, function in found.items() if len(parameters_of(function)) > MOST} == set(EXCEPTIONS)
