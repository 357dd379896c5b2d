"""What CONTRIBUTING.md shows is done to a copy of the source, and the examples run on that."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.pages import ROOT, Block, agree, blocks

TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PARTS = {part.partition("\n")[0]: part for part in re.split(r"^## ", TEXT, flags=re.MULTILINE)}
FILE = re.compile(r"\A# (?P<file>src/\S+\.py)\n")
PATCH = re.compile(r"\A--- (?P<file>src/\S+\.py)\n(?P<lines>.*)\Z", flags=re.DOTALL)


def patched(source: str, lines: str) -> str:
    """A file with the change that a block of diff shows, whose lines must be in it, once."""
    kinds = {line[0] for line in lines.splitlines()}
    assert kinds <= {" ", "-", "+"}, f"a line of a diff begins with {kinds}"
    before = "".join(f"{line[1:]}\n" for line in lines.splitlines() if line[0] != "+")
    after = "".join(f"{line[1:]}\n" for line in lines.splitlines() if line[0] != "-")
    assert source.count(before) == 1, f"not there, or more than once:\n{before}"
    return source.replace(before, after)


def applied(found: list[Block], clone: Path) -> list[Block]:
    """Write and change the files that blocks show; the blocks that are left are to be run, or what these print."""
    rest = []
    for block in found:
        if new := FILE.match(block.code):
            (clone / new["file"]).write_text(block.code[new.end() :], encoding="utf-8")
        elif change := PATCH.match(block.code):
            path = clone / change["file"]
            path.write_text(patched(path.read_text(encoding="utf-8"), change["lines"]), encoding="utf-8")
        elif block.language in ("python", "text"):
            rest.append(block)
    return rest


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the source, to which one thing after the other is added."""
    folder = tmp_path_factory.mktemp("clone")
    # With what has been compiled, which takes half a minute.
    shutil.copytree(ROOT / "src" / "tactile_bayes", folder / "src" / "tactile_bayes")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("title", ["A family of contours", "A flaw of a load cell", "An unknown of a rig"])
def test_what_is_added_works(title: str, clone: Path) -> None:
    example, stated = applied(blocks(PARTS[title]), clone)
    environment = os.environ | {"PYTHONPATH": str(clone / "src"), "PYTHONWARNINGS": "error"}
    where = f"import tactile_bayes\nassert tactile_bayes.__file__.startswith({str(clone)!r})\n"
    command = [sys.executable, "-c", where + example.code]
    done = subprocess.run(command, cwd=clone, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert agree(done.stdout, stated.code, 0.05), done.stdout


def test_a_change_that_does_not_fit_is_told() -> None:
    assert patched("a\nb\nc\n", " a\n-b\n+d\n") == "a\nd\nc\n"
    with pytest.raises(AssertionError, match="not there"):
        patched("a\nb\n", "-c\n+d\n")
    with pytest.raises(AssertionError, match="more than once"):
        patched("a\na\n", "-a\n+d\n")


def test_every_room_and_every_file_beside_them_is_in_the_house() -> None:
    """As the table and the line below it draw it."""
    drawn = re.search(r"\| floor.*?\n\n.*?\n\n", TEXT, flags=re.DOTALL)[0]
    package = ROOT / "src" / "tactile_bayes"
    rooms = {f"{path.parent.name}/" for path in package.glob("*/__init__.py")}
    files = {path.name for path in package.glob("*.py")}
    assert sorted(re.findall(r"`(\w+/|\w+\.py)`", drawn)) == sorted(rooms | files)


def test_the_targets_are_there() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"^make ([\w-]+)", TEXT, flags=re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target
