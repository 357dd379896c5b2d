"""The two looks, and pictures of the main figures."""

import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from helpers.pictures import difference
from helpers.refusals import refused
from tactile_bayes import plotting
from tactile_bayes.checks import shown
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting import style
from tactile_bayes.plotting.style import STYLES
from tactile_bayes.sweep import scan


@pytest.fixture(scope="module")
def swept():
    return scan(paper_profile("II", q=0.5), drive_step=np.radians(4.0))


@pytest.mark.parametrize("name", list(STYLES))
def test_settings_hold_inside_and_are_put_back_also_after_an_error(name):
    before = dict(mpl.rcParams)
    with pytest.raises(ZeroDivisionError), style(name):  # noqa: PT012
        assert {key: mpl.rcParams[key] for key in STYLES[name]} == dict(STYLES[name])
        1 / 0  # noqa: B018
    assert dict(mpl.rcParams) == before


def test_another_style_is_refused():
    for name in ("poster", None):
        with refused(ParameterError, shown(name), "'print'", "'screen'"), style(name):
            pass


def test_letters_have_eight_points_in_print_and_ten_on_screen():
    assert [STYLES[name]["axes.labelsize"] for name in ("print", "screen")] == [8.0, 10.0]


def test_paper_figures_do_not_load_matplotlib():
    code = (
        "import sys, tactile_bayes.paper_figures, tactile_bayes.plotting.style; sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


LOOKS = {
    "rods": lambda swept, figure: plotting.rods(swept, count=6, ax=figure.subplots()),
    "touched": lambda swept, figure: plotting.touched(swept, ax=figure.subplots()),
    "observables": lambda swept, figure: plotting.observables(
        swept.record, events=swept.events, axes=figure.subplots(3)
    ),
    "contour": lambda swept, figure: plotting.contour(
        [-0.8, 0.8], truth=swept.contour, gap=(-0.06, 0.06), base=(0.0, 0.0), ax=figure.subplots()
    ),
}


@pytest.mark.parametrize("name", LOOKS)
def test_it_looks_as_it_did(name, swept, tmp_path):
    figure = Figure(figsize=(4.0, 3.0))
    with style("print"):
        LOOKS[name](swept, figure)
        assert difference(figure, name, tmp_path) is None
