"""The skeleton of a command: options, one call of the library, one answer.

A command is a function. Its parameters are options or groups of options: a group is a dataclass whose fields are
options and whose properties interpret them. The last group is `Output`. The function returns an `Answer`.

An option is annotated with its type and its help, beside what else Typer is to know of it. A switch that is off is
turned on by its name alone. A path is read by the command unless it is marked with `Writes`, and a text that is marked
with `Reads` may be a path. An output that is an input is refused before the function is called.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer
from typer.models import ParameterInfo

import tactile_bayes as tb
from tactile_bayes.cli.answer import Answer, print_answer

Out = Annotated[Path, "Folder for results; created if missing."]
Seed = Annotated[int, "Seed of random numbers; the same seed gives the same numbers.", typer.Option(min=0)]


@dataclass(frozen=True)
class Reads:
    """Mark of a path that a command reads: a file, or a folder with files of these names, where * is any text."""

    names: tuple[str, ...] = ("*",)

    def files(self, path: Path) -> Iterator[Path]:
        """Yield the files that are there."""
        if path.is_dir():
            yield from (file for name in self.names for file in path.glob(name) if file.is_file())
        else:
            yield path


@dataclass(frozen=True)
class Writes:
    """Mark of a path that a command writes: a file, or a folder for files of these names, where * is any text."""

    names: tuple[str, ...] = ()

    def files(self, path: Path) -> Iterator[Path]:
        """Yield the files that it may replace."""
        if not self.names:
            yield path
        for name in self.names:
            yield from path.glob(name) if "*" in name else [path / name]


@dataclass(frozen=True)
class Output:
    """Options for the progress and the answer of a command."""

    quiet: Annotated[bool, "No progress, only the result.", typer.Option("--quiet", "-q")] = False
    json: Annotated[bool, "Print one JSON object in place of sentences."] = False

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
        _refuse_replaced_inputs(options, given)
        for name, group in groups.items():
            given[name] = group(**{option.name: given.pop(option.name) for option in fields(group)})
        print_answer(function(**given), given["output"].json)

    options = list(_options(function))
    command.__annotations__ = {option.name: option.annotation for option in options}
    command.__signature__ = Signature(options)  # type: ignore[attr-defined]  # typer reads it
    return command


def _refuse_replaced_inputs(options: Iterable[Parameter], given: Mapping[str, Any]) -> None:
    """Refuse options by which the command would replace a file that it reads."""

    outputs, inputs = list[Path](), list[Path]()
    for option in options:
        value, marks = given.get(option.name), getattr(option.annotation, "__metadata__", ())
        stated = next((mark for mark in marks if isinstance(mark, Writes | Reads)), None)
        mark, kinds = stated or Reads(), Path if stated is None else Path | str
        paths = [Path(path) for path in (value if isinstance(value, list) else [value]) if isinstance(path, kinds)]
        (outputs if isinstance(mark, Writes) else inputs).extend(file for path in paths for file in mark.files(path))
    if outputs and inputs:
        tb.tasks.refuse_replacing(outputs, inputs)


def _options(owner: Callable[..., Any]) -> Iterator[Parameter]:
    """Yield the options of a command, or of a group, as Typer takes them."""
    hints = get_type_hints(owner, include_extras=True)
    for name, parameter in signature(owner).parameters.items():
        if is_dataclass(hints[name]):
            yield from _options(hints[name])
        else:
            option = parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[name])
            yield option if get_origin(hints[name]) is None else _as_typer_takes_it(option)


def _as_typer_takes_it(option: Parameter) -> Parameter:
    """Return an option whose help, and kind of path, Typer is told."""
    kind, *marks = get_args(option.annotation)
    info: Any = next((mark for mark in marks if isinstance(mark, ParameterInfo)), None)
    if info is None:
        names = [f"--{option.name.replace('_', '-')}"] if option.default is False else []
        info = typer.Option(*names)
        marks.append(info)
    info.help = next(mark for mark in marks if isinstance(mark, str))
    if written := [mark for mark in marks if isinstance(mark, Writes)]:
        info.file_okay, info.dir_okay = not written[0].names, bool(written[0].names)
    return option.replace(annotation=Annotated[kind, *marks])
