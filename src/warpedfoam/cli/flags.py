"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Annotated

import typer


def _colours() -> Iterable[str]:
    from warpedfoam.io.colours import COLOR_CHOICES

    return COLOR_CHOICES


def among(words: Callable[[], Iterable[str]]) -> Callable[[], list[str]]:
    """What the shell offers for an option: words that are imported only when it asks."""
    return lambda: list(words())


def _seeds() -> Iterable[str]:
    from warpedfoam.tessellate.build import SEED_KINDS

    return SEED_KINDS


def _cells() -> Iterable[str]:
    from warpedfoam.tessellate.build import CELL_KINDS

    return CELL_KINDS


def _solvers() -> Iterable[str]:
    from warpedfoam.relax.linear import SOLVERS

    return SOLVERS


def _methods() -> Iterable[str]:
    from warpedfoam.cli.potentials import METHODS

    return METHODS


def _figures() -> Iterable[str]:
    from warpedfoam.cli.figures import NAMES

    return NAMES


def _shown() -> Iterable[str]:
    from warpedfoam.view.scalars import SCALARS

    return SCALARS


def _surfaces() -> Iterable[str]:
    from warpedfoam.studies.options import MAKERS

    return MAKERS


#: Completions, by what is asked for.
SEEDS, CELLS, SOLVER, METHOD = among(_seeds), among(_cells), among(_solvers), among(_methods)
FIGURE, SHOWN, SURFACE = among(_figures), among(_shown), among(_surfaces)
COLORS = among(_colours)
LAYOUT = among(lambda: ("hexagonal", "random"))

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
        autocompletion=COLORS,
    ),
]
FoamFile = Annotated[str, typer.Argument(help="A foam: NPZ, VTP or HDF5 of warpedfoam.", metavar="FOAM")]
Frame = Annotated[int, typer.Option("--frame", help="Frame of a trajectory, from 0; -1 is the last.")]
