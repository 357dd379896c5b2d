"""The skeleton of a command: groups of options are taken apart, and an answer is printed in words or as JSON."""

import inspect
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
import typer
import xarray as xr
from typer.testing import CliRunner

from tactile_bayes.cli.answer import Answer, columns_of, table_of
from tactile_bayes.cli.command import Output, Seed, as_command


@dataclass(frozen=True)
class SpringOptions:
    """A spring."""

    stiffness: Annotated[float, typer.Option(help="In N/m.", min=0.0)] = 2.0
    coils: Annotated[list[int] | None, typer.Option(help="How many.")] = None


def stretch(
    *, force: Annotated[float, typer.Argument()], spring: SpringOptions, seed: Seed = 1, output: Output
) -> Answer:
    """Stretch a spring."""
    length = force / spring.stiffness
    return Answer(
        [
            f"{length:g} m",
            "",
            table_of(["coil", "m"], [["a [mm]", "1"]], left=["coil"]),
            {"spring": Path("a/spring.csv")},
        ],
        lambda: {"length": np.float64(length), "coils": spring.coils, "seed": seed, "files": {"spring": Path("a")}},
        interrupted="interrupted: stretch again" if seed == 2 else "",
    )


@pytest.fixture(scope="module")
def app():
    app = typer.Typer()
    app.command()(as_command(stretch))
    return app


def call(app, *words):
    return CliRunner().invoke(app, list(words))


def test_groups_are_options_one_by_one_in_their_order():
    options = inspect.signature(as_command(stretch)).parameters
    assert list(options) == ["force", "stiffness", "coils", "seed", "quiet", "json"]
    assert options["stiffness"].default == 2.0


def test_it_answers_people_in_words_tables_and_files(app):
    result = call(app, "3")
    assert result.exit_code == 0
    assert result.stdout.splitlines() == ["1.5 m", "", "coil    m", "a [mm]  1", "spring       a/spring.csv"]


def test_it_answers_programs_in_one_object(app):
    result = call(app, "inf", "--stiffness", "4", "--coils", "1", "--coils", "2", "--json")
    assert json.loads(result.stdout) == {"length": None, "coils": [1, 2], "seed": 1, "files": {"spring": "a"}}


def test_what_an_interrupt_has_left_is_answered_too(app):
    result = call(app, "3", "--seed", "2")
    assert result.exit_code == 130
    assert result.stdout.startswith("1.5 m\n")
    assert result.stderr == "tactile-bayes: interrupted: stretch again\n"


def test_limits_of_options_in_groups_hold(app):
    assert call(app, "3", "--stiffness", "-1").exit_code == 2


def test_columns_are_rows_of_what_lies_along_one_dimension_alone():
    found = xr.Dataset(
        {"x": ("coil", [1.0, 2.0]), "both": (("coil", "end"), np.zeros((2, 2))), "alone": 3.0},
        coords={"coil": ["a", "b"], "unit": ("coil", ["m", "1"])},
    )
    assert columns_of(found, "coil") == [{"coil": "a", "x": 1.0, "unit": "m"}, {"coil": "b", "x": 2.0, "unit": "1"}]
