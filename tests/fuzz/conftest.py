"""Seeds of the fuzz tests: two that stay, and in the slow run ten more of the day, named in each test's identifier."""

import datetime

import pytest

FIXED = (0, 1)
BY_DAY = 10


def pytest_generate_tests(metafunc):
    """A test that takes `fuzz_seed` runs once a seed; a failure is repeated by its identifier, the same day."""
    if "fuzz_seed" in metafunc.fixturenames:
        day = datetime.date.today().toordinal() * BY_DAY
        metafunc.parametrize(
            "fuzz_seed", [*FIXED, *(pytest.param(day + number, marks=pytest.mark.slow) for number in range(BY_DAY))]
        )
