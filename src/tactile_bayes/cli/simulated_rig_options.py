"""Options that describe a rig of which records are simulated."""

from __future__ import annotations

from typing import Annotated

import typer

__all__ = ["Bases", "Diameter", "FlexuralRigidity", "ForceNoise", "Length", "MomentNoise"]

ForceNoise = Annotated[
    float | None, typer.Option(help="Standard deviation of the forces [N, or EI/L²]; by default 0.05 EI/L².")
]
MomentNoise = Annotated[
    float | None, typer.Option(help="Standard deviation of the moment [N m, or EI/L]; by default 0.02 EI/L.")
]
Length = Annotated[
    float | None, typer.Option(help="Rod length [m]; by default everything is dimensionless, in units of the rod.")
]
FlexuralRigidity = Annotated[float | None, typer.Option(help="EI [N m²], with --length.")]
Diameter = Annotated[float, typer.Option(help="Rod diameter [m], likewise.")]
Bases = Annotated[
    list[str] | None, typer.Option(help="A pivot, X,Y; give it again for another. By default one at 0,0.")
]
