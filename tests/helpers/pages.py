"""Pages of the documentation: their blocks of code, and whether what these print is what the page says."""

import contextlib
import io
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from typer.testing import CliRunner

from tactile_bayes.cli import app

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"

_FENCE = re.compile(r"^(?P<ticks>`{3,})(?P<language>[\w-]+)\n(?P<code>.*?)^(?P=ticks)$", flags=re.MULTILINE | re.DOTALL)
_MATTER = re.compile(r"\A---\n(?P<matter>.*?)^---$", flags=re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])[-−+]?\d+(?:[.]\d+)?(?:e[-+]?\d+)?")
_COMMAND = re.compile(r"^\s*(?:\$ )?tactile-bayes (?P<words>.*)", flags=re.MULTILINE)


class Block(NamedTuple):
    """A fenced block of a page."""

    language: str
    code: str
    line: int  # of its first line of code, counted from 1
    follows: bool  # whether nothing stands between it and the block before


def blocks(text: str) -> list[Block]:
    """The fenced blocks of a page, in order; directives are none."""
    found, end = [], 0
    for fence in _FENCE.finditer(text):
        line = text.count("\n", 0, fence.start("code")) + 1
        found.append(Block(fence["language"], fence["code"], line, not text[end : fence.start()].strip()))
        end = fence.end()
    return found


def matter(text: str) -> dict[str, str]:
    """What a page says of itself above its title."""
    found = _MATTER.match(text)
    lines = found["matter"].splitlines() if found else []
    return {key.strip(): value.strip() for key, value in (line.split(":", 1) for line in lines)}


def run(path: Path, text: str) -> int:
    """Run a page's Python blocks one after the other, and compare what they print with the text below them.

    On a page that says "commands: run", commands of ours in blocks of shell run, too. Returns how many were compared.
    """
    names: dict[str, Any] = {"__name__": "__main__"}
    printed, compared = "", 0
    tolerance = float(matter(text).get("tolerance", 0.0))
    for block in blocks(text):
        if block.language == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile("\n" * (block.line - 1) + block.code, str(path), "exec"), names)
            printed = out.getvalue()
        elif block.language == "toml" and (name := re.match(r"# (\w+\.toml)\n", block.code)):
            Path(name[1]).write_text(block.code, encoding="utf-8")
        elif block.language == "sh" and "run" in matter(text).get("commands", ""):
            printed = "".join(_output(command) for command in commands(block.code))
        elif block.language == "text" and block.follows:
            assert agree(printed, block.code, tolerance), (
                f"{path}:{block.line} says\n{block.code}\nbut it is\n{printed}"
            )
            compared += 1
    return compared


def agree(printed: str, stated: str, tolerance: float) -> bool:
    """Whether two texts are the same, numbers up to one unit of their last digit and a relative tolerance."""
    if _skeleton(printed) != _skeleton(stated):
        return False
    pairs = zip(_NUMBER.findall(printed), _NUMBER.findall(stated), strict=True)
    return all(abs(_value(a) - _value(b)) <= 1.01 * _unit(b) + tolerance * abs(_value(b)) for a, b in pairs)


def commands(code: str) -> Iterator[list[str]]:
    """The words of each command of ours in a block of shell."""
    for line in _COMMAND.finditer(re.sub(r"\\\n\s*", "", code)):
        yield shlex.split(line["words"], comments=True)


def _output(command: list[str]) -> str:
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, f"tactile-bayes {' '.join(command)}: {result.output}"
    return result.output


def _skeleton(text: str) -> list[str]:
    """A text without its numbers, and whatever the blanks around them."""
    return _NUMBER.sub(" # ", text).split()


def _value(number: str) -> float:
    return float(number.replace("−", "-"))


def _unit(number: str) -> float:
    """One in the last digit that is written; nothing for whole numbers, which are counts."""
    digits, _, exponent = number.lower().partition("e")
    decimals = len(digits.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals) if decimals or exponent else 0.0
