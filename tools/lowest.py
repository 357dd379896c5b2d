"""Prints the lowest versions of the dependencies that pyproject.toml allows, as pip takes them."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path


def lowest(requirement: str) -> str:
    """Of "numpy>=2.0", "numpy==2.0.*": the lowest that is allowed, with its repairs."""
    found = re.fullmatch(r"([\w.-]+(?:\[[\w,-]+\])?)>=([\d.]+)(?:,<[\d.]+)?", requirement)
    if found is None:
        raise SystemExit(f"{requirement!r} has no lowest version: state it as name>=version")
    version = found[2] if "." in found[2] else f"{found[2]}.0"
    return f"{found[1]}=={version}.*" if version.count(".") < 2 else f"{found[1]}=={version}"


if __name__ == "__main__":
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    print("\n".join(map(lowest, project["dependencies"])))
