"""Trajectories of motions: begun whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from warpedfoam.io.trajectory import TrajectoryWriter


def new_trajectory(path: Path, write: Callable[[TrajectoryWriter], None]) -> None:
    """A trajectory with its first frame, there whole or not at all.

    Raises
    ------
    FileExistsError
        If there is a file of that name.
    """
    if path.exists():
        raise FileExistsError(f"cannot write {path}: it is there already; use resume=True or another name")
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        with TrajectoryWriter(temporary) as writer:
            write(writer)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
