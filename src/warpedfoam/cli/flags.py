"""Options that several commands share."""

from __future__ import annotations

from typing import Annotated

import typer

Seed = Annotated[int, typer.Option("--seed", help="Random seed.")]
Folder = Annotated[str, typer.Option("-o", "--out", help="Folder for the results.")]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as one JSON object.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No progress and no summary (but --json).")]
Debug = Annotated[bool, typer.Option("--debug", help="On an error print the traceback.")]
