"""Options that several commands share."""

from __future__ import annotations

from typing import Annotated

import typer


def _colours() -> list[str]:
    from warpedfoam.io.colours import COLOR_CHOICES

    return list(COLOR_CHOICES)


#: Names of the option that says where results go; ``--out`` is the older one.
OUTPUT = ("-o", "--output", "--out")

Seed = Annotated[int, typer.Option("--seed", help="Random seed.")]
Folder = Annotated[str, typer.Option(*OUTPUT, help="Folder for the results.")]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as one JSON object.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No progress and no summary (but --json).")]
Debug = Annotated[bool, typer.Option("--debug", help="On an error print the traceback.")]
Picture = Annotated[bool, typer.Option("--picture/--no-picture", help="Draw pictures too.")]
Color = Annotated[
    str,
    typer.Option(
        "--color-by",
        help="Colour by charge, pressure, sides, area, volume or curvature.",
        autocompletion=_colours,
    ),
]
FoamFile = Annotated[str, typer.Argument(help="A foam: NPZ, VTP or HDF5 of warpedfoam.", metavar="FOAM")]
Frame = Annotated[int, typer.Option("--frame", help="Frame of a trajectory, from 0; -1 is the last.")]
