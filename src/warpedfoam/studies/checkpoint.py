"""State of a long run on disk: a small JSON file that names the foams that belong to it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.errors import FileFormatError
from warpedfoam.foam import Foam
from warpedfoam.io import load, save, write_record
from warpedfoam.io.atomic import PathLike, as_path
from warpedfoam.io.reading import brief
from warpedfoam.io.record import sealed, unsealed
from warpedfoam.studies.lock import locked
from warpedfoam.surfaces.protocol import Surface

VERSION = 1


class Checkpoint:
    """A folder that holds one run's state.

    Foams are written under new names first, then the state that names them replaces the old one, then
    foams that no state names are removed. So whenever a run is killed, the folder holds one whole state.

    Parameters
    ----------
    folder : str or path
        Made if it does not exist.
    kind : str
        What runs; also the beginning of the files' names.
    key : mapping
        What a run must share with the one in the folder to go on from it.

    Raises
    ------
    NotADirectoryError
        If ``folder`` is a file.
    """

    def __init__(self, folder: PathLike, kind: str, key: Mapping[str, Any]) -> None:
        self._folder = as_path(folder, "folder")
        if self._folder.exists() and not self._folder.is_dir():
            raise NotADirectoryError(f"folder must be a folder, but {self._folder} is a file")
        self._folder.mkdir(parents=True, exist_ok=True)
        self._kind, self._key, self._serial = kind, dict(key), 0
        self._saved: dict[int, tuple[str, Foam]] = {}

    @property
    def path(self) -> Path:
        """The state's file."""
        return self._folder / f"{self._kind}.json"

    def read(self) -> tuple[dict[str, Any], dict[str, Foam]] | None:
        """The state and its foams by role; None if there is none yet.

        Raises
        ------
        ValueError
            If the folder holds another run's state, telling what differs.
        FileFormatError
            If the state is damaged.
        """
        if not self.path.exists():
            return None
        try:
            record = json.loads(self.path.read_text(encoding="utf-8"))
            version = record["version"] if isinstance(record, dict) else None
            if isinstance(version, int) and version > VERSION:
                raise ValueError(f"it is of version {version}, this warpedfoam reads version {VERSION}")
            record = unsealed(record, ("version", "key", "serial", "foams", "state"))
            key, state, foams = record["key"], record["state"], record["foams"]
            if not (version == VERSION and all(isinstance(part, dict) for part in (key, state, foams))):
                raise ValueError("it is no such state")
            if any(Path(name).name != name for name in foams.values()):
                raise ValueError("it names foams in other folders")
            self._serial = int(record["serial"])
        except (ValueError, KeyError, TypeError, RecursionError, OverflowError) as fault:
            raise FileFormatError(
                f"cannot read {self.path}: it is damaged ({brief(fault)}); remove it to begin anew"
            ) from fault
        wanted = json.loads(json.dumps(self._key))
        different = sorted(k for k in {*wanted, *key} if wanted.get(k) != key.get(k))
        if different:
            raise ValueError(
                f"folder {self._folder} holds another run: {', '.join(different)} "
                f"{'differs' if len(different) == 1 else 'differ'}; choose another folder"
            )
        read = {role: load(self._folder / name) for role, name in foams.items()}
        self._saved = {id(foam): (foams[role], foam) for role, foam in read.items()}
        return state, read

    def write(self, state: Mapping[str, Any], foams: Mapping[str, Foam]) -> None:
        """Replace the state; foams written before are not written again."""
        names = {}
        for role, foam in foams.items():
            if id(foam) not in self._saved:
                self._serial += 1
                name = f"{self._kind}-{self._serial:06d}.npz"
                save(self._folder / name, foam)
                self._saved[id(foam)] = (name, foam)
            names[role] = self._saved[id(foam)][0]
        record = {
            "version": VERSION,
            "key": self._key,
            "serial": self._serial,
            "foams": names,
            "state": state,
        }
        write_record(self.path, sealed(record))
        kept = set(names.values())
        self._saved = {i: entry for i, entry in self._saved.items() if entry[0] in kept}
        for path in self._folder.glob(f"{self._kind}-[0-9][0-9][0-9][0-9][0-9][0-9].npz"):
            if path.name not in kept:
                path.unlink(missing_ok=True)


@contextmanager
def kept(folder: PathLike | None, kind: str, key: Mapping[str, Any]) -> Iterator[Checkpoint | None]:
    """The folder's checkpoint, for one run at a time; None if there is no folder.

    Raises
    ------
    NotADirectoryError
        If ``folder`` is a file.
    BlockingIOError
        If another run is writing there.
    """
    if folder is None:
        yield None
        return
    checkpoint = Checkpoint(folder, kind, key)
    with locked(checkpoint.path.parent):
        yield checkpoint


def fingerprint(foam: Foam) -> str:
    """SHA-256 of what a foam is: network, places, shapes, volumes, gap, tension, surface."""
    digest = hashlib.sha256()
    network = foam.network
    for array in (
        network.next,
        network.origin,
        network.bubble,
        foam.vertex_points,
        foam.film_offsets,
        foam.target_volumes,
        np.array([foam.cell.mean_gap, foam.tension]),
        *(() if foam.cell.parallel else (foam.cell.gaps(foam.vertex_points),)),
    ):
        digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(surface_mark(foam.cell.surface).encode("utf-8"))
    return digest.hexdigest()


def surface_mark(surface: Surface) -> str:
    """SHA-256 of a surface's class, area and some of its points: a mesh's ``repr`` does not hold it."""
    digest = hashlib.sha256(type(surface).__name__.encode("utf-8"))
    for array in (np.array([surface.area, surface.size]), surface.random_points(16, 0)):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
