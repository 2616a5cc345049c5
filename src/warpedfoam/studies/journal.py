"""An ensemble's folder: a journal of finished runs, their foams, and a lock.

A line of the journal is written, and forced to the disk, when its run is finished and its foam is in
place. Whatever ends the process, at most a torn last line is left, which is cut off on opening.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from warpedfoam.errors import FileFormatError
from warpedfoam.io.atomic import atomic_binary, named
from warpedfoam.io.reading import brief
from warpedfoam.io.record import sealed, unsealed
from warpedfoam.studies.lock import locked
from warpedfoam.studies.member import Outcome, environment_name

JOURNAL, STATES = "runs.jsonl", "states"
_ROW = ("key", "status", "reason", "values", "environment", "seconds")


class Journal:
    """Finished runs by key; open one with `opened`.

    Attributes
    ----------
    folder : Path
    rows : dict
        By key: status, reason, values, environment, seconds.
    environments : dict
        By name.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rows: dict[str, dict[str, Any]] = {}
        self.environments: dict[str, Mapping[str, Any]] = {}
        self._path = folder / JOURNAL
        self._read()
        (folder / STATES).mkdir(exist_ok=True)
        self._stream = open(self._path, "ab")  # noqa: SIM115  closed by `close`

    def state_path(self, key: str) -> Path:
        """Where the foam of a run is kept."""
        return self.folder / STATES / f"{key}.npz"

    def add(self, outcome: Outcome) -> None:
        """Put the foam in place and write the line."""
        if outcome.state is not None:
            with atomic_binary(self.state_path(outcome.key)) as stream:
                stream.write(outcome.state)
        name = environment_name(outcome.environment)
        if name not in self.environments:
            self._write({"environment": name, "content": outcome.environment})
            self.environments[name] = outcome.environment
        row = {
            "key": outcome.key,
            "status": outcome.status,
            "reason": outcome.reason,
            "values": dict(outcome.values),
            "environment": name,
            "seconds": outcome.seconds,
        }
        self._write(row)
        self.rows[outcome.key] = row

    def close(self) -> None:
        """Close the file; what a full disk has not taken is lost, as in a kill."""
        with suppress(OSError):
            self._stream.close()

    def _write(self, content: Mapping[str, Any]) -> None:
        # repr of a float, which is what JSON gets, comes back as the same float
        line = json.dumps(sealed(content), allow_nan=False, ensure_ascii=False)
        try:
            self._stream.write(line.encode("utf-8") + b"\n")
            self._stream.flush()
            os.fsync(self._stream.fileno())
        except OSError as fault:
            raise named(fault, self._path) from None

    def _read(self) -> None:
        if not self._path.exists():
            return
        data = self._path.read_bytes()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            with open(self._path, "r+b") as stream:
                stream.truncate(whole)
        for number, line in enumerate(data[:whole].splitlines(), start=1):
            try:
                found = json.loads(line)
                if "content" in found:
                    content = unsealed(found, ("environment", "content"))
                    self.environments[content["environment"]] = content["content"]
                else:
                    row = unsealed(found, _ROW)
                    self.rows[row["key"]] = row
            except (ValueError, KeyError, TypeError, RecursionError) as fault:
                raise FileFormatError(
                    f"cannot read {self._path}: line {number} is damaged ({brief(fault)}); delete that line "
                    "and its run will be computed again"
                ) from None


@contextmanager
def opened(folder: Path) -> Iterator[Journal]:
    """Open the journal of a folder, for one process at a time.

    Raises
    ------
    BlockingIOError
        If another process has it open.
    FileFormatError
        If a line other than the last is damaged.
    """
    with locked(folder):
        journal = Journal(folder)
        try:
            yield journal
        finally:
            journal.close()
