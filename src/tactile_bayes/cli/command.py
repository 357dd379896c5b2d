"""The skeleton of a command: options, one call of the library, one answer.

A command is a function. Its parameters are options, or groups of them: a group is a dataclass whose fields are options
and whose properties say what they mean. The last group is `Output`. The function returns an `Answer`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from tactile_bayes.cli.answer import Answer, print_answer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

__all__ = ["Out", "Output", "Seed", "as_command"]

Out = Annotated[Path, typer.Option(help="Folder for results; made if it is not there.", file_okay=False)]
Seed = Annotated[int, typer.Option(help="Same seed, same numbers.", min=0)]


@dataclass(frozen=True)
class Output:
    """How a command shows its progress and its answer."""

    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, only the result.")] = False
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object in place of sentences.")] = False

    @property
    def is_silent(self) -> bool:
        """Whether there is no progress."""
        return self.quiet or self.json


def as_command(function: Callable[..., Answer]) -> Callable[..., None]:
    """Return a command as typer takes it: groups are taken apart into options, and the answer is printed."""
    hints: dict[str, Any] = get_type_hints(function)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if name != "return" and is_dataclass(kind)}

    @wraps(function)
    def command(**given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{option.name: given.pop(option.name) for option in fields(group)})
        print_answer(function(**given), given["output"].json)

    options = list(_options(function))
    command.__annotations__ = {option.name: option.annotation for option in options}
    command.__signature__ = Signature(options)  # type: ignore[attr-defined]  # typer reads it
    return command


def _options(owner: Callable[..., Any]) -> Iterator[Parameter]:
    """The options of a command, or of a group, one by one."""
    hints = get_type_hints(owner, include_extras=True)
    for name, parameter in signature(owner).parameters.items():
        if is_dataclass(hints[name]):
            yield from _options(hints[name])
        else:
            yield parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[name])
