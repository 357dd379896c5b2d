"""A figure as a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tactile_bayes.files import write_atomically

__all__ = ["write_picture"]


def write_picture(figure: Any, path: Path) -> None:
    """Write a Matplotlib figure as PNG, whole or not at all."""
    with write_atomically(path) as temporary:
        figure.savefig(temporary, dpi=200, format="png")
