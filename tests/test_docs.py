"""The documentation: its code runs and prints what it says, and it names what there is."""

import importlib
import inspect
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
import typer
from benchmarks.calibration import FAMILIES, STICKING, TRACED, Family, published, table

import tactile_bayes as tb
from helpers.commands import call
from helpers.pages import DOCS, ROOT, agree, blocks, commands, matter, run
from helpers.public_names import left_out, listed, public
from tactile_bayes.cli import app
from tactile_bayes.record import COLUMNS, LOAD_CELL_UNITS
from tactile_bayes.rig.parameters import GROUPS

PAGES = sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)
FRONT = [ROOT / f"{name}.md" for name in ("README", "CONTRIBUTING", "VISION", "SECURITY", "SUPPORT", "CODE_OF_CONDUCT")]
FRONT += [ROOT / "benchmarks" / "challenge" / "README.md"]
TEXTS = {path: path.read_text(encoding="utf-8") for path in [*PAGES, *FRONT]}
LINK = re.compile(r"\]\((?!https?:)(?P<target>[^)#\s]*)(?:#(?P<anchor>[^)\s]+))?\)")


def pages_tested(how: str) -> list[Path]:
    return [path for path in PAGES if matter(TEXTS[path]).get("tested") == how]


def identify(path: Path) -> str:
    return str(path.relative_to(DOCS))


# --- Code -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, settings_left_alone: None, coarse_pictures: None) -> Path:
    """A folder of its own, in which a page finds the data that come with the project."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "path",
    [*pages_tested("fast"), *(pytest.param(path, marks=pytest.mark.slow) for path in pages_tested("slow"))],
    ids=identify,
)
def test_blocks_run_and_print_what_the_page_says(path: Path, clone: Path) -> None:
    assert run(path, TEXTS[path]) > 0


@pytest.mark.slow
def test_the_example_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (example,) = (block for block in blocks(TEXTS[ROOT / "README.md"]) if block.language == "python")
    names: dict = {}
    exec(compile(example.code, "README.md", "exec"), names)
    assert names["posterior"].attrs["converged"], names["posterior"].attrs["message"]
    assert (names["band"]["lower"] < names["band"]["upper"]).all()
    assert "converged" in capsys.readouterr().out


def test_a_rigs_file_says_what_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    after = TEXTS[DOCS / "howto" / "your-record.md"].split("## From a rig's file to a report\n")[1]
    section = after.partition("\n## ")[0]
    shown = [block.code for block in blocks(section) if block.language == "text"]
    assert Path("data/synthetic/rig.csv").read_text(encoding="utf-8").startswith(shown[0])
    (asked,) = (words for block in blocks(section) for words in commands(block.code) if words[0] == "inspect")
    asked = [word.replace("inspection/", str(tmp_path)) for word in asked]
    first, *_ = call(*asked).stdout.splitlines(keepends=True)
    assert first == shown[1]
    asked = [word.replace("force_x=Fx", "force_x=-Fx") for word in asked]
    inspected = call(*asked).stdout
    for part in shown[2].split("\n\n"):
        assert part in inspected
    (file,) = (block.code for block in blocks(section) if block.language == "toml")
    assert file in (tmp_path / "rig.toml").read_text(encoding="utf-8")
    found = call("reconstruct", asked[1], "--rig", tmp_path / "rig.toml", "--out", tmp_path).stdout
    assert found.startswith(shown[3])


def test_no_python_block_is_left_untested() -> None:
    """But for pages that show one name, and what is shown elsewhere."""
    free = {path for path in PAGES if "tested" not in matter(TEXTS[path])}
    shown = {path for path in free if any(block.language == "python" for block in blocks(TEXTS[path]))}
    assert {identify(path) for path in shown} == {"api/index.md"}


def test_numbers_agree_up_to_their_last_digit() -> None:
    assert agree("a 0.1234 of 12", "a 0.1235 of 12", 0.0)
    assert not agree("a 0.1234 of 12", "a 0.1237 of 12", 0.0)
    assert not agree("a 0.1234 of 12", "a 0.1234 of 13", 0.0)
    assert not agree("a 0.1", "b 0.1", 0.0)
    assert agree("−0.50 ± 0.11", "−0.51 ± 0.10", 0.1)
    assert not agree("−0.50", "0.50", 0.1)


# --- Names ----------------------------------------------------------------------------------------------------------


def test_every_public_name_is_in_the_api_and_there_are_at_most_forty() -> None:
    assert not left_out()
    assert len(tb.__all__) <= 40
    assert all(hasattr(module, name) for module, names in listed() for name in names)


def test_every_public_name_has_an_example() -> None:
    given = {called: getattr(module, name) for module, name, called in public() if not name.isupper()}
    assert [name for name, each in given.items() if ">>>" not in (inspect.getdoc(each) or "")] == []


def test_the_columns_and_the_data_sheet_are_specified() -> None:
    page = TEXTS[DOCS / "formats.md"]
    assert [name for name in COLUMNS if f"`{name}`" not in page and f"`truth_{name}`" not in page] == []
    assert [name for name in LOAD_CELL_UNITS if f"`load_cell_{name}`" not in page] == []


def test_the_table_of_unknowns_holds_the_defaults_that_the_command_prints() -> None:
    printed = json.loads(call("rig", "--parameters", "--json").output)["parameters"]
    rows = re.findall(r"^\| (`[a-z_`, ]+`) \|.*\| ([^|]*) \|$", TEXTS[DOCS / "howto" / "unknowns.md"], re.MULTILINE)
    found: dict[str, list[str]] = {}
    for names, default in rows:
        for name in re.findall("[a-z_]+", names):
            found |= dict.fromkeys(GROUPS.get(name, (name,)), default.split("; "))
    assert found.pop("base") == ["normal, 0.01 L"]
    assert found.keys() == {row["name"] for row in printed}
    assert [row["name"] for row in printed if row["default"] not in found[row["name"]]] == []


def commands_of(group: click.Group, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands_of(command, (*words, name))
        else:
            yield (*words, name), command


PROGRAM = typer.main.get_command(app)
COMMANDS = dict(commands_of(PROGRAM)) | {(): PROGRAM}


def test_every_command_is_named() -> None:
    named = re.findall(r"^\| `tactile-bayes ([\w -]+)` \|", TEXTS[DOCS / "commands.md"], flags=re.MULTILINE)
    assert set(named) == {" ".join(words) for words in COMMANDS if words}


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.name)
def test_commands_and_options_that_are_shown_exist(path: Path) -> None:
    shell = "".join(block.code for block in blocks(TEXTS[path]) if block.language == "sh")
    for words in commands(shell):
        named = tuple(word for word in words if not word.startswith("--"))
        known = next(named[:count] for count in (2, 1, 0) if named[:count] in COMMANDS)
        assert known or not named, f"there is no command {' '.join(words)}"
        options = {option for parameter in COMMANDS[known].params for option in parameter.opts}
        used = {word.split("=")[0] for word in words if word.startswith("--")}
        assert used <= options, f"{' '.join(known)} has no option {used - options}"


@pytest.mark.parametrize(
    ("families", "noise"),
    [
        (FAMILIES, "usual"),
        pytest.param(FAMILIES, "tenth", marks=pytest.mark.slow),
        (FAMILIES, "threefold"),
        (STICKING, "usual"),
        (TRACED, "usual"),
    ],
)
def test_a_table_of_calibrations_is_that_of_the_published_replicates(families: dict[str, Family], noise: str) -> None:
    assert table(noise, published(families, noise)) in TEXTS[DOCS / "trust.md"]


def test_readme_shows_rows_of_tables_in_the_docs() -> None:
    shown = TEXTS[ROOT / "README.md"]
    calibrations = [line for line in shown.split("\n") if line.startswith(("| band", "| contact"))]
    ratios = [line.rstrip() for line in shown.split("\n") if re.search(r" [mnµ]s +[\d,]+$", line)]
    assert len(calibrations) == 3
    assert len(ratios) == 5
    assert all(line in TEXTS[DOCS / "trust.md"] for line in calibrations)
    assert all(line in TEXTS[DOCS / "comparisons.md"] for line in ratios)


def test_the_paper_cites_what_its_list_has_and_is_of_the_length_that_the_journal_takes() -> None:
    text, listed = ((ROOT / name).read_text(encoding="utf-8") for name in ("paper.md", "paper.bib"))
    _, head, body = text.split("---\n", 2)
    assert "bibliography: paper.bib" in head
    keys = re.findall(r"^@\w+\{(\w+),", listed, flags=re.MULTILINE)
    assert sorted(keys) == sorted(set(re.findall(r"@(\w+)", body)))
    assert len(re.findall(r"^  doi +=", listed, flags=re.MULTILINE)) == len(keys)
    assert 750 <= len(body.split()) <= 1750


def test_every_notebook_is_named() -> None:
    named = re.findall(r"`(\w+\.ipynb)`", TEXTS[DOCS / "notebooks.md"])
    assert named == sorted(path.name for path in (ROOT / "notebooks").glob("*.ipynb"))


# --- Links and style ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    for link in LINK.finditer(re.sub(r"`[^`\n]*`", "", TEXTS[path])):
        target = (path.parent / link["target"]).resolve() if link["target"] else path
        assert target.exists(), f"{path.name}: {link.group()}"
        if link["anchor"] and target.suffix == ".md":
            assert link["anchor"] in anchors(target.read_text(encoding="utf-8")), f"{path.name}: {link.group()}"


def anchors(text: str) -> set[str]:
    heads = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


def test_every_page_can_be_reached() -> None:
    listed = set()
    for path in PAGES:
        for tree in re.findall(r"```\{toctree\}\n(.*?)```", TEXTS[path], flags=re.DOTALL):
            names = [line for line in tree.split("\n") if line and not line.startswith(":")]
            listed |= {(path.parent / f"{name}.md").resolve() for name in names}
    assert {path.resolve() for path in PAGES} - listed == {(DOCS / "index.md").resolve()}


def test_pages_fetch_nothing() -> None:
    settings = (DOCS / "conf.py").read_text(encoding="utf-8")
    assert "intersphinx" not in settings
    assert "http" not in settings + (DOCS / "static" / "site.css").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_site_builds_without_warnings(tmp_path: Path) -> None:
    pytest.importorskip("sphinx", reason="it takes the group docs, which make docs installs")
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--keep-going", "--quiet", "-b", "html"]
    done = subprocess.run([*command, DOCS, tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    fetched = re.compile(r"""<(?:script|link|img)[^>]*(?:src|href)=["'](?:https?:)?//""")
    for page in tmp_path.rglob("*.html"):
        assert not fetched.search(page.read_text(encoding="utf-8")), page


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


NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))


def test_they_are_numbered():
    assert [int(path.name.split("_")[0]) for path in NOTEBOOKS] == list(range(1, 14))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_begins_with_its_number_and_title_and_is_kept_without_outputs(path):
    book = json.loads(path.read_text(encoding="utf-8"))
    assert book["metadata"]["kernelspec"]["name"] == "python3"
    first = book["cells"][0]
    assert first["cell_type"] == "markdown"
    assert first["source"][0].startswith(f"# {int(path.name.split('_')[0])} · ")
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None
    names = [cell["id"] for cell in book["cells"]]
    assert len(set(names)) == len(names)
