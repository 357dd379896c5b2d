"""The command figures."""

import pytest
from PIL import Image

from helpers.commands import answered, succeed
from tactile_bayes.paper_figures import caption

QUICK = ["--only", "3", "--only", "7", "--distance", "0.5", "--drive-step", "5", "--rods", "3"]

pytestmark = pytest.mark.usefixtures("settings_left_alone")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    out = tmp_path_factory.mktemp("figures") / "new"
    return succeed("figures", "--out", out, *QUICK, "--format", "png"), out


def test_it_says_what_is_where(drawn):
    result, out = drawn
    assert result.stdout.splitlines() == [
        f"Figure 3: {caption(3, distances=[0.5])}",
        f"    {out / 'figure_03.png'}",
        f"Figure 7: {caption(7, distances=[0.5])}",
        f"    {out / 'figure_07.png'}",
    ]
    assert sorted(path.name for path in out.iterdir()) == ["figure_03.png", "figure_07.png"]


def test_figures_are_as_wide_as_a_page_at_print_resolution(drawn):
    with Image.open(drawn[1] / "figure_03.png") as image:
        assert image.size[0] == 2100  # 7 inches at 300 dpi
        assert image.info["Description"] == caption(3, distances=[0.5])


def test_a_column_on_screen_as_json(tmp_path):
    options = ("--only", 3, *QUICK[4:], "--format", "png", "--column", "--style", "screen")
    (only,) = answered("figures", "--out", tmp_path, *options)["figures"]
    assert only["number"] == 3
    assert only["files"] == {"png": str(tmp_path / "figure_03.png")}
    with Image.open(only["files"]["png"]) as image:
        assert image.size[0] == 525  # 3.5 inches at 150 dpi


def test_noise_is_said_in_the_caption(tmp_path):
    noise = ["--force-noise", "0.05", "--moment-noise", "0.02", "--seed", "4"]
    options = ("--only", 11, "--distance", 0.5, "--drive-step", 10, "--format", "svg", *noise)
    assert "measured with noise (seed 4)" in succeed("figures", "--out", tmp_path, *options).stdout
