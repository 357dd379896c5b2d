"""One wrong argument in a call of anything public: an error that says which, or a result that makes sense."""

import random
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot as plt

import tactile_bayes as tb
from helpers.pages import ROOT
from helpers.public_calls import AcceptedError
from helpers.public_names import public
from helpers.refusals import refused
from helpers.wrong_values import MORE, RESULTS, WRONG
from tactile_bayes.checks import as_number, shown
from tactile_bayes.errors import ParameterError, TactileBayesError, TactileBayesWarning
from tactile_bayes.tasks import Workers

# Bases and results.
NOT_CALLED = {
    *(f"contours.{name}" for name in ("Contour", "Graph", "Single", "Locus")),
    *(f"datasets.{name}" for name in ("Specification", "Verification")),
    "TaskProgress",
    *(f"elastica.{name}" for name in ("Contact", "Wrench")),
}
# What takes parameters of a contour or a rig by name.
OF_ANY_NAME = ("Family", "Family.only", "Rig.with_session", "Rig.with_unknown")
pytestmark = pytest.mark.usefixtures("before_sampling")

MOST_OBSCURE = 0.02  # largest share of wrong calls that end in an error of another library
PARTS = 10  # parts of all wrong calls, of which each seed of the day makes one


def a_number(low, high):
    return lambda value: (number := as_number(value)) is not None and low <= number <= high


def a_kind(*kinds):
    return lambda value: value is None or isinstance(value, kinds)


def a_seed(value):
    return (type(value) is int and value >= 0) or isinstance(value, np.random.Generator | np.random.SeedSequence)


# What an accepted value of an argument can be: of one function, or wherever it is an argument.
SENSIBLE = {
    "probability": lambda value: value is None or a_number(1e-323, 1.0 - 1e-16)(value),
    "false_alarm": a_number(1e-323, 1.0 - 1e-16),
    "friction": lambda value: value is None or a_number(0.0, 100.0)(value) or hasattr(value, "logpdf"),
    "rng": a_seed,
    **dict.fromkeys(
        ("paper_figures.figure(rng)", "paper_figures.caption(rng)"), lambda value: value is None or a_seed(value)
    ),
    "workers": lambda value: value is None or isinstance(value, str | Workers) or (type(value) is int and value > 0),
    "rod": a_kind(tb.Rod),
    "load_cell": a_kind(tb.LoadCell),
    "rig": a_kind(tb.Rig),
    "settings": a_kind(tb.SamplerSettings),
    "datasets.record(truth)": lambda value: isinstance(value, bool | np.bool_),
    "truth": a_kind(tb.contours.Contour, tb.Rig, tb.calibration.Misspecification),
    "posterior": a_kind(xr.DataTree, xr.Dataset),
    "record": a_kind(xr.Dataset),
    "measured": a_kind(xr.Dataset, np.ndarray),
    "ax": a_kind(),
    "path": a_kind(str, Path),
    "out": a_kind(str, Path),
    **dict.fromkeys(("progress", "keep", "stop"), lambda value: value is None or callable(value)),
    "plotting.pairs(truth)": lambda value: value is None or (isinstance(value, dict) and set(value) <= {"a", "q"}),
}


@pytest.fixture(scope="module")
def wrong():
    return [*WRONG, *MORE, *(make() for make in RESULTS)]


def outcome(call, argument, value):
    """How a call ends: "fine", "clear", or the obscure error."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", TactileBayesWarning)
            call.function(**{**call.arguments, argument: value})
    except AcceptedError:
        return "fine"
    except TactileBayesError as error:
        return "clear" if len(str(error)) > 20 else repr(error)
    except OSError as error:
        return "clear" if error.filename is not None else repr(error)
    except Exception as error:
        if argument in ("progress", "keep", "stop") and callable(value):
            return "clear"  # the given function's own
        return repr(error)[:200]
    finally:
        plt.close("all")
    return "fine"


def names_on_first_pages():
    """Names that README, the tutorial and the notebooks call."""
    pages = [ROOT / "README.md", ROOT / "docs" / "tutorial.md", *(ROOT / "notebooks").glob("*.ipynb")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    return set(re.findall(r"\btb\.([\w.]*\w)", text)), set(re.findall(r"\w\.(\w+)\(", text))


def is_on_first_pages(name, names, methods):
    owner, _, method = name.rpartition(".")
    return name in names or (owner.rpartition(".")[2][:1].isupper() and method in methods)


def test_every_public_name_is_called(calls):
    names = {label for module, name, label in public() if callable(getattr(module, name))}
    assert names - NOT_CALLED <= set(calls)


@pytest.mark.slow
def test_right_calls_succeed(calls):
    """Else what is wrong with a call is not the wrong argument."""
    for name, call in calls.items():
        argument, value = next(iter(call.arguments.items()))
        assert outcome(call, argument, value) == "fine", name


def test_an_unknown_keyword_is_python_s_to_refuse(calls):
    for name, call in calls.items():
        with refused(ParameterError if name in OF_ANY_NAME else TypeError, "left"):
            call.function(**call.arguments, left=1)


def test_a_wrong_argument_gets_a_clear_error(calls, wrong, fuzz_seed, request):
    """A value for every second argument, or, by a seed of the day, a tenth of all."""
    rng = random.Random(fuzz_seed)
    tried = [(name, argument, value) for name, call in calls.items() for argument in call.arguments for value in wrong]
    if request.node.get_closest_marker("slow") is None:
        arguments = [(name, argument) for name, call in calls.items() for argument in call.arguments]
        tried = [(*where, rng.choice(wrong)) for where in arguments[fuzz_seed % 2 :: 2]]
    else:
        random.Random(0).shuffle(tried)
        tried = tried[fuzz_seed % PARTS :: PARTS]
    first_pages = names_on_first_pages()
    obscure, worst, nonsense = [], [], []
    for name, argument, value in tried:
        found = outcome(calls[name], argument, value)
        if found not in ("fine", "clear"):
            kept = worst if is_on_first_pages(name, *first_pages) else obscure
            kept.append(f"{name}({argument}={shown(value)}): {found}")
        is_sensible = SENSIBLE.get(f"{name}({argument})", SENSIBLE.get(argument, lambda value: True))
        if found == "fine" and not is_sensible(value):
            nonsense.append(f"{name}({argument}={shown(value)})")
    assert not nonsense, "accepted: " + "\n".join(nonsense)
    assert not worst, "of the first pages:\n" + "\n".join(worst)
    assert len(obscure) <= MOST_OBSCURE * len(tried), f"{len(obscure)} of {len(tried)}:\n" + "\n".join(obscure)
