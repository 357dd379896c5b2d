"""The public names, as the pages of the API list them."""

import importlib
import inspect
import pathlib
import re

import tactile_bayes as tb

API = pathlib.Path(__file__).parents[2] / "docs" / "api"
# Modules of many names, which are named by them in tables of calls.
PREFIXES = {
    **{f"tactile_bayes.{name}": f"{name}." for name in ("contours", "datasets", "paper_figures", "plotting")},
    "tactile_bayes.mechanics.elastica": "elastica.",
}
# Modules of what functions return or raise.
_ROOMS = ("errors", "sweep", "diagnostics", "diagnostics.inspection", "inference.target", "load_cell.discrepancy")
RESULTS = {f"tactile_bayes.{name}" for name in _ROOMS}


def listed():
    """(module, names) of each table of the pages: those that stand there, or all."""
    for path in sorted(API.glob("*.md")):
        for name, names in re.findall(r"```\{public\} (tactile_bayes[\w.]*)\n(.*?)```", path.read_text(), re.DOTALL):
            module = importlib.import_module(name)
            yield module, names.split() or list(module.__all__)


def public():
    """(module, name, name in tables of calls) of what the pages of the API list, but for results and errors."""
    for module, names in listed():
        for name in names:
            if module.__name__ not in RESULTS or not inspect.isclass(getattr(module, name)):
                yield module, name, PREFIXES.get(module.__name__, "") + name


def left_out():
    """Names of `tb` that no page lists."""
    modules = {module.__name__.removeprefix("tactile_bayes.") for module, _ in listed()}
    names = {name for module, names in listed() if module is tb for name in names}
    return set(tb.__all__) - names - modules - {"__version__"}
