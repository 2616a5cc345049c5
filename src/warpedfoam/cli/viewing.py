"""``warpedfoam view``: saved foams as one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warpedfoam.io import load
from warpedfoam.io.atomic import writable_path
from warpedfoam.view import write_view


def view_files(
    files: Sequence[str], *, out: str | None, color_by: str, title: str | None
) -> tuple[Path, dict[str, Any]]:
    """Write the viewer's page for the foams in ``files``, one frame each, and return its path and facts.

    Raises
    ------
    ValueError, OSError
        If a file is no foam, the colour is unknown or cannot be had, or the page cannot be written.
    """
    first = Path(files[0])
    target = writable_path(first.with_suffix(".html") if out is None else Path(out))
    foams = [load(file) for file in files]
    labels = [Path(file).stem for file in files] if len(files) > 1 else None
    path = write_view(target, foams, color_by=color_by, title=title, labels=labels)
    return path, {
        "view": str(path),
        "frames": len(foams),
        "bubbles": [foam.n_bubbles for foam in foams],
        "bytes": path.stat().st_size,
    }
