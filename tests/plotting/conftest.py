"""What all tests of figures share."""

import pytest


@pytest.fixture(autouse=True)
def alone(settings_left_alone):
    """Every test of a figure leaves the settings of Matplotlib as they were."""
