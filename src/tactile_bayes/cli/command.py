"""The skeleton of a command: options, one call of the library, one answer.

A command is a function. Its parameters are options or groups of options: a group is a dataclass whose fields are
options and whose properties interpret them. The last group is `Output`. The function returns an `Answer`.
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

Out = Annotated[Path, typer.Option(help="Folder for results; created if missing.", file_okay=False)]
Seed = Annotated[int, typer.Option(help="Seed of random numbers; the same seed gives the same numbers.", min=0)]


@dataclass(frozen=True)
class Output:
    """Options for the progress and the answer of a command."""

    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, only the result.")] = False
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object in place of sentences.")] = False

    @property
    def is_silent(self) -> bool:
        """True if no progress is shown."""
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
    """Yield the options of a command, or of a group."""
    hints = get_type_hints(owner, include_extras=True)
    for name, parameter in signature(owner).parameters.items():
        if is_dataclass(hints[name]):
            yield from _options(hints[name])
        else:
            yield parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[name])
