"""What several tests of the command line share: the file of a record."""

import pytest

from tactile_bayes.record import write_record


@pytest.fixture(scope="session")
def record(measured, tmp_path_factory):
    path = tmp_path_factory.mktemp("record") / "record.csv"
    write_record(measured, path)
    return path
