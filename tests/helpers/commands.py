"""Calls of the command line, and what a refusal looks like."""

import json
import re

import pytest
from typer.testing import CliRunner

from tactile_bayes.cli import app


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def succeed(*arguments):
    """The result of a call that ends well."""
    result = call(*arguments)
    assert result.exit_code == 0, result.output
    return result


def answered(*arguments):
    """The JSON object that a call answers with."""
    result = succeed(*arguments, "--json")
    return json.loads(result.stdout, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


def assert_files(result, folder, names, block=-1):
    """A block of what is printed lists the files in a folder, which have these names; pictures are PNG."""
    listed = [line.split(maxsplit=1)[1] for line in result.stdout.split("\n\n")[block].splitlines()]
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert sorted(listed) == sorted(map(str, files))
    assert {path.name for path in files} == set(names)
    assert all(path.read_bytes().startswith(b"\x89PNG\r\n") for path in files if path.suffix == ".png")


def assert_refused(result, *fragments):
    """Exit code 2, a line on stderr with these fragments, and nothing else."""
    assert result.exit_code == 2, result.output
    assert isinstance(result.exception, SystemExit)
    assert result.stdout == ""
    assert [words for words in map(str, fragments) if words not in result.stderr] == []
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("tactile-bayes: ")


def assert_misused(result, message):
    """The same for what is no proper call: usage, a hint to --help, and the reason."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    *usage, reason = result.stderr.splitlines()
    assert usage[0].startswith("Usage: ")
    assert reason.startswith("Error: ")
    assert plain(message) in plain(reason)


def plain(message):
    """Words alone: versions of Typer write the same with other signs and capitals."""
    return re.sub(r"[':]", "", message).lower()
