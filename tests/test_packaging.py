"""What is installed elsewhere: wheel, source distribution, and what the package does without."""

import email
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

import tactile_bayes as tb

ROOT = Path(__file__).parents[1]

CITATION, RECIPE = "CITATION.cff", "recipe/recipe.yaml"
ELSEWHERE = {"matplotlib": "matplotlib-base"}  # names that the recipe's packages have there

OPTIONAL = ("matplotlib", "distributed", "dask", "jinja2", "arviz", "emcee", "rich", "sklearn")


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Wheel and source distribution, built without anything that is not declared."""
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    (wheel,), (source,) = out.glob("*.whl"), out.glob("*.tar.gz")
    return wheel, source


def test_the_wheel_holds_the_package_and_nothing_else(built):
    names = zipfile.ZipFile(built[0]).namelist()
    there = {name.removeprefix("tactile_bayes/") for name in names if name.startswith("tactile_bayes/")}
    package = ROOT / "src" / "tactile_bayes"
    wanted = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert there == wanted
    assert "py.typed" in there
    assert all(name.startswith(("tactile_bayes/", "tactile_bayes-")) for name in names)


def test_the_source_distribution_holds_what_tests_need(built):
    with tarfile.open(built[1]) as archive:
        names = {name.split("/", 1)[1] for name in archive.getnames() if "/" in name}
    for needed in ("pyproject.toml", "README.md", "LICENSE", "Makefile", "tests/conftest.py", "CITATION.cff"):
        assert needed in names, needed
    assert not [name for name in names if name.startswith(("results/", ".venv/", "docs/_build/")) or ".pyc" in name]


def test_indexes_would_take_both(built):
    checked = subprocess.run(
        [sys.executable, "-m", "twine", "check", "--strict", *map(str, built)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert checked.returncode == 0, checked.stdout
    assert checked.stdout.count("PASSED") == 2


def test_the_metadata_says_what_it_is(built):
    wheel = zipfile.ZipFile(built[0])
    (name,) = [name for name in wheel.namelist() if name.endswith(".dist-info/METADATA")]
    metadata = email.message_from_bytes(wheel.read(name))
    assert metadata["Name"] == "tactile-bayes"
    assert metadata["Requires-Python"] == ">=3.11"
    assert metadata["License-Expression"] == "MIT"
    assert {"cluster", "notebooks"} <= set(metadata.get_all("Provides-Extra"))


def test_all_files_that_state_the_version_state_the_same():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    cited, recipe = (yaml.safe_load((ROOT / name).read_text(encoding="utf-8")) for name in (CITATION, RECIPE))
    heading = f"## [{tb.__version__}]"
    assert project["version"] == cited["version"] == recipe["context"]["version"] == tb.__version__
    assert heading in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_recipe_requires_what_the_package_requires():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    recipe = yaml.safe_load((ROOT / RECIPE).read_text(encoding="utf-8"))["requirements"]

    def named(requirements):
        return {ELSEWHERE.get(each.name, each.name): str(each.specifier) for each in map(Requirement, requirements)}

    wanted = named(project["project"]["dependencies"]) | {"xarray-einstats": ""}  # of the extra of arviz-stats
    (python, *run), (_, pip, *host) = recipe["run"], recipe["host"]
    assert (python, pip) == ("python >=${{ python_min }}", "pip")
    assert named(run) == wanted
    assert named(host) == named(project["build-system"]["requires"])


def test_it_starts_without_what_is_loaded_when_used():
    """With matplotlib, Dask, Jinja and others out of sight, importing and a scan work; importing does without Numba."""
    code = f"""
import sys
sys.modules.update(dict.fromkeys({OPTIONAL!r}))
import tactile_bayes as tb
from tactile_bayes import contours, load_cell, record
from tactile_bayes.mechanics import elastica
assert "numba" not in sys.modules
measured = tb.LoadCell(force_noise=0.05, moment_noise=0.02).measure(
    tb.scan(tb.contours.paper_profile("II", q=0.5), drive_step=0.2).record, rng=1
)
print(tb.reconstruct(measured).sizes["sample"] > 10)
"""
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert said.returncode == 0, said.stderr
    assert said.stdout.strip() == "True"


@pytest.mark.slow
def test_it_installs_in_an_empty_environment(built, tmp_path):
    """And makes a record, infers a contour from it and draws it, away from its sources."""
    venv.create(tmp_path / "empty", with_pip=True)
    python = tmp_path / "empty" / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "--quiet", str(built[0])], check=True, timeout=900)
    command = [tmp_path / "empty" / "bin" / "tactile-bayes", "demo", "--out", str(tmp_path / "demo"), "--quiet"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert said.returncode == 0, said.stderr
    assert said.stdout.startswith("All is well")
    assert (tmp_path / "demo" / "contour.png").is_file()
