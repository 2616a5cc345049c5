"""``warpedfoam view``: saved foams as one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warpedfoam.cli.converting import TRAJECTORIES, read_foam
from warpedfoam.foam import Foam
from warpedfoam.io import Trajectory
from warpedfoam.io.atomic import writable_path
from warpedfoam.view import write_view


def view_files(
    files: Sequence[str], *, out: str | None, color_by: str, title: str | None, frame: int | None = None
) -> tuple[Path, dict[str, Any]]:
    """Write the viewer's page for the foams in ``files`` and return its path and facts.

    A trajectory gives all its frames, or the one asked for; other files one each.

    Raises
    ------
    ValueError, OSError
        If a file is no foam, the colour is unknown or cannot be had, or the page cannot be written.
    """
    first = Path(files[0])
    target = writable_path(first.with_suffix(".html") if out is None else Path(out))
    foams: list[Foam] = []
    labels: list[str] = []
    for file in files:
        if Path(file).suffix.lower() in TRAJECTORIES and frame is None:
            with Trajectory(file) as frames:
                foams += frames
                labels += [f"{Path(file).stem}, time {time:.6g}" for time in frames.times.tolist()]
        else:
            foams.append(read_foam(file, -1 if frame is None else frame).foam)
            labels.append(Path(file).stem)
    several = labels if len(foams) > 1 else None
    path = write_view(target, foams, color_by=color_by, title=title, labels=several)
    return path, {
        "view": str(path),
        "frames": len(foams),
        "bubbles": [foam.n_bubbles for foam in foams],
        "bytes": path.stat().st_size,
    }
