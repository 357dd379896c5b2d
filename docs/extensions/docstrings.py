"""Docstrings as Sphinx takes them: they are written to be read as they are, and reStructuredText sees more in them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_CODE = re.compile(r"``.+?``|`[^`]+`")
_ATTRIBUTE = re.compile(r":(?P<part>ivar|vartype) (?P<names>[^:]+): ?(?P<text>.*)")
"""What napoleon makes of attributes: fields, in which every word is a link to whatever is called like it."""

_NAME = re.compile(r"(?<=\w)_(?!\w)")
"""The end of a name like left_, which would be a link."""


def as_restructured_text(line: str) -> str:
    """A line of a docstring with signs that mean themselves.

    Names like `left_` are no links, and |x| is no substitution.
    """
    if line.lstrip().startswith((">>>", "...")):
        return line
    parts, end = [], 0
    for code in _CODE.finditer(line):
        parts += [_escaped(line[end : code.start()]), code.group()]
        end = code.end()
    return "".join([*parts, _escaped(line[end:])])


def _escaped(text: str) -> str:
    return _NAME.sub(r"\\_", text).replace("|", r"\|")


def with_whole_terms(lines: list[str]) -> list[str]:
    """Lines with every term of a definition list on one line, as reStructuredText wants it.

    What follows something deeper, and has something deeper below it, is a term, however many lines it takes.
    """
    whole: list[str] = []
    begin = 0
    while begin < len(lines):
        depth, end = _depth(lines[begin]), begin + 1
        while depth and end < len(lines) and _depth(lines[end]) == depth:
            end += 1
        above, below = _depth(lines[begin - 1]) if begin else 0, _depth(lines[end]) if end < len(lines) else 0
        is_term = depth and above > depth and below > depth
        joined = lines[begin] + "".join(f" {line.strip()}" for line in lines[begin + 1 : end])
        whole += [joined] if is_term else lines[begin:end]
        begin = end
    return whole


def with_listed_attributes(lines: list[str]) -> list[str]:
    """Lines with attributes as a list: their names, their type, and what they are."""
    listed: list[str] = []
    texts: dict[str, list[str]] = {}
    current: list[str] | None = None
    for line in lines:
        if found := _ATTRIBUTE.fullmatch(line):
            if found["part"] == "vartype":
                text = " ".join(texts.pop(found["names"]))
                listed += [f"- **{found['names']}** (*{found['text']}*)" + (f" – {text}" if text else "")]
                current = None
            else:
                listed += [] if listed and listed[-1].startswith("- **") else [".. rubric:: Attributes", ""]
                current = texts[found["names"]] = [found["text"]] if found["text"] else []
        elif current is not None and line.startswith(" "):
            current.append(line.strip())
        else:
            listed.append(line)
    return listed


def _depth(line: str) -> int:
    """By how much a line is indented; 0 if it is empty."""
    return len(line) - len(line.lstrip()) if line.strip() else 0


def _process(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    lines[:] = [as_restructured_text(line) for line in with_listed_attributes(with_whole_terms(lines))]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.connect("autodoc-process-docstring", _process, priority=600)  # after napoleon
    return {"parallel_read_safe": True, "parallel_write_safe": True}
