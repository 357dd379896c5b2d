"""What several tests of the command line share: the file of a record, and files of rigs."""

import pytest

from tactile_bayes.record import write_record


@pytest.fixture(scope="session")
def record(measured, tmp_path_factory):
    path = tmp_path_factory.mktemp("record") / "record.csv"
    write_record(measured, path)
    return path


@pytest.fixture(scope="session")
def bare(record):
    """The same without header."""
    path = record.with_name("bare.csv")
    lines = record.read_text(encoding="utf-8").splitlines(keepends=True)
    path.write_text("".join(line for line in lines if not line.startswith("#")), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def as_stated(tmp_path_factory):
    """A rig of which nothing is unknown."""
    path = tmp_path_factory.mktemp("as stated") / "rig.toml"
    path.write_text('unknown = "nothing"\n', encoding="utf-8")
    return path


@pytest.fixture
def rig_file(tmp_path):
    """Write a rig.toml, and return its path."""

    def write(text, name="rig.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write
