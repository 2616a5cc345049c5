"""The folder that a command writes to."""

from __future__ import annotations

import os
from pathlib import Path


def output_folder(name: str) -> Path:
    """Make the folder, or say now, not after the work, that it cannot be written.

    Raises
    ------
    NotADirectoryError, PermissionError
        If it is a file, or may not be written to.
    """
    folder = Path(name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise NotADirectoryError(f"the output folder {name} is a file; choose another with -o") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"the output folder {name} cannot be written; choose another with -o")
    return folder
