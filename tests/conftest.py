"""What several files of tests share: an analysed record, and a quick stand-in for the slow parts of a run."""

import functools
import os
import re
import signal
from dataclasses import replace
from pathlib import Path

import pytest
import typer.testing
from hypothesis import settings

import tactile_bayes as tb
from helpers.contour_posteriors import QUICK
from helpers.forward_models import compile_share
from helpers.report_pages import quickly, undrawn
from tactile_bayes.runs.demonstration import CONTOUR, LOAD_CELL, ROD

os.environ["MPLBACKEND"] = "Agg"  # figures need no screen

settings.register_profile("few", max_examples=8, derandomize=True)


def pytest_configure(config):
    """Fewer examples of everything, the same each time, but where all tests or the slow ones are asked for."""
    if config.getoption("markexpr") == "not slow":
        settings.load_profile("few")


def pytest_sessionstart(session):
    """Of processes that share the tests, each compiles others of the forward models, which are cached on disk."""
    worker = getattr(session.config, "workerinput", None)
    if worker is not None and worker["workercount"] > 1:
        compile_share(int(worker["workerid"][2:]), worker["workercount"])


# Calls that take a second or more.
SAMPLING = re.compile(
    r"\b(infer_(contours?|rig|point_load)|calibrat(e|ion_replicate)|compare_families|Stream(Comparison)?|design)\("
)
OWN_EXAMPLES = "inference.contour.infer_contour"

# Tests and cases that take a second or more, beside which others alike are quick.
LONG = frozenset(Path(__file__).with_name("long_cases.txt").read_text(encoding="utf-8").splitlines()[1:])


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Long cases are slow, and so are examples of docstrings that sample a posterior or plan, but for one."""
    for item in items:
        if item.nodeid in LONG:
            item.add_marker("slow")
        if isinstance(item, pytest.DoctestItem) and not item.name.endswith(OWN_EXAMPLES):
            source = "".join(example.source for example in item.dtest.examples)
            if SAMPLING.search(source):
                item.add_marker("slow")


@pytest.fixture(scope="session", autouse=True)
def interruptible():
    """Processes that tests start hear interrupts, also where the tests run in the background and ignore them."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def commands_built_once():
    """Typer's runner puts all commands together for each call, which takes longer than most calls."""
    with pytest.MonkeyPatch.context() as patch:
        build = getattr(typer.testing, "_get_command", None)
        if build is not None:
            patch.setattr(typer.testing, "_get_command", functools.cache(build))
        yield


@pytest.fixture(scope="session")
def measured():
    """The demonstration's record, in coarse steps: SI, both directions, all channels."""
    record = LOAD_CELL.measure(tb.scan(CONTOUR, rig=tb.Rig(rod=ROD), drive_step=0.05).record, rng=1)
    return record.drop_vars([name for name in record.data_vars if name.startswith("truth_")])


@pytest.fixture(scope="session")
def analysed(measured, tmp_path_factory):
    """That record, analysed: the run and its folder."""
    from tactile_bayes.runs.contour import analyse

    folder = tmp_path_factory.mktemp("analysed") / "made" / "on the way"
    return analyse(measured, folder, rig=tb.Rig(unknown="nothing"), settings=QUICK, truth=CONTOUR, rng=1), folder


@pytest.fixture(name="undrawn")
def runs_without_figures():
    with undrawn():
        yield


@pytest.fixture
def quick(undrawn):
    """Runs without figures and of few steps, whatever settings they are given."""
    with quickly(replace(QUICK, walkers=28)):  # enough for all that is standard
        yield


@pytest.fixture(scope="module")
def coarse_pictures():
    """Figures are written in few pixels, for tests that ask only whether they are there."""
    from matplotlib.figure import Figure

    write = Figure.savefig

    def coarsely(figure, *arguments, dpi=None, **options):
        write(figure, *arguments, dpi=25, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", coarsely)
        yield


@pytest.fixture(scope="session")
def calls(tmp_path_factory):
    """A right call of every public name; not to be changed."""
    from helpers.public_calls import right_calls

    return right_calls(tmp_path_factory.mktemp("calls"))


@pytest.fixture
def before_sampling(monkeypatch, tmp_path):
    """Calls that would sample end where they would begin to; files are written to a folder of the test's own."""
    from helpers.public_calls import end_before_sampling

    end_before_sampling(monkeypatch)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def settings_left_alone():
    """Matplotlib's settings are the same after a test, and its figures are closed."""
    import matplotlib as mpl
    from matplotlib import pyplot as plt

    before = dict(mpl.rcParams)
    yield
    plt.close("all")
    assert dict(mpl.rcParams) == before
