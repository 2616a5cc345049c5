"""One run at a time in a folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

LOCK = ".lock"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a lock that the system lets go when the process ends, however it ends.

    Raises
    ------
    BlockingIOError
        If another run holds it.
    """
    try:
        import fcntl
    except ImportError:  # Windows: two runs in one folder are not told apart there
        yield
        return
    with open(folder / LOCK, "ab") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise BlockingIOError(
                f"another run is writing to {folder}; wait for it or choose another folder"
            ) from None
        yield
