"""Trajectories: foams in time, their topology too, in one HDF5 file that grows frame by frame."""

from __future__ import annotations

import io
import json
import os
import secrets
import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import Floats, as_instance, as_integer, as_number, frozen
from warpedfoam.errors import FileFormatError
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, as_path, room_for, writable_path
from warpedfoam.io.hdf5_superblock import (
    SUPERBLOCK,
    USER_BLOCK,
    in_use,
    is_open,
    mark_open,
    released,
    seal,
)
from warpedfoam.io.reading import brief, existing, extra
from warpedfoam.io.state import arrays_of, foam_of, known_surfaces

FORMAT = "warpedfoam trajectory"
VERSION = 1
SUFFIXES = (".h5", ".hdf5")

#: One value after the other, frame after frame; the frame's share is told by ``index``.
_INTS = ("next", "origin", "bubble", "bubble_euler", "bubble_ids")
_FLOATS = ("vertex_points", "film_offsets", "target_volumes", "pressures")
_DATA = (*_INTS, *_FLOATS, "header")
#: Looks at a file that is being written, and seconds between them.
LOOKS, PAUSE = 5, 0.05
#: Pauses of a writer that finds its file being read.
WAITS = 100
_PURPOSE = "HDF5"
#: The oldest HDF5 with a single-writer mode: what a newer one would write, older programs cannot open.
LIBRARIES = ("v110", "v110")
_CHUNK = 4096
#: Bytes that a frame may take besides its own: a chunk of every array, and HDF5's index of them.
_SLACK = (len(_DATA) + 2) * 8 * _CHUNK + (1 << 16)

Arrays = dict[str, NDArray[Any]]
T = TypeVar("T")


class TrajectoryWriter:
    """Writes foams to an HDF5 file, one after the other; a frame that was written is safe.

    Parameters
    ----------
    path : str or path
        Ends in ``.h5`` or ``.hdf5``.
    append : bool, optional
        Go on with the trajectory that is there. By default a file that is there is an error.

    Raises
    ------
    ImportError
        If h5py is not installed (the extra ``formats``).
    TypeError, FileNotFoundError, IsADirectoryError, FileExistsError
        If the path cannot be written, or is taken.
    FileFormatError
        If what is there is no trajectory.

    Notes
    -----
    The file is kept in HDF5's single-writer mode, in which it is sound at any moment: each `append` adds
    to the arrays, flushes, and only then adds its row to ``index``. A writer that is killed loses no frame
    whose `append` has returned. `Trajectory` reads such a file as it is, also while it is written; opening it
    with ``append=True`` first copies its frames to a new file.

    All frames share one cell: surface, gap and heights.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from warpedfoam import Foam, HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> foam = Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name) / "run.h5"
    >>> with TrajectoryWriter(path) as writer:
    ...     writer.append(foam, time=0.0)
    ...     writer.append(foam, time=0.5)
    >>> frames = Trajectory(path)
    >>> len(frames), frames.times.tolist(), frames[1].energy == foam.energy
    (2, [0.0, 0.5], True)
    >>> folder.cleanup()
    """

    def __init__(self, path: PathLike, *, append: bool = False) -> None:
        h5py = extra("h5py", _PURPOSE)
        self._file: Any = None
        target = writable_path(path, suffixes=SUFFIXES)
        if target.exists() and not append:
            raise FileExistsError(
                f"cannot write {target}: it is there already; use append=True or another name"
            )
        self.path = target
        self._h5py = h5py
        self._cell: tuple[str, Arrays] | None = None
        self._count, self._time = 0, -np.inf
        if target.exists():
            self._go_on(target)

    def append(
        self, foam: Foam, time: float | None = None, *, notes: Mapping[str, Any] | None = None
    ) -> None:
        """Add ``foam``; when this returns the frame is in the file.

        Parameters
        ----------
        foam : Foam
            In the cell of the frames before it.
        time : float, optional
            Above the time of the frame before; 1 more than that by default, from 0.
        notes : mapping, optional
            Whatever JSON can hold, kept with the frame; see `Trajectory.notes`.

        Raises
        ------
        TypeError, ValueError
            If an argument is of the wrong type, the time does not rise, the cell is another one, or the
            writer is closed.
        """
        as_instance(foam, "foam", Foam)
        after = self._time + 1.0 if self._count else 0.0
        moment = after if time is None else as_number(time, "time")
        if not moment > self._time:
            raise ValueError(f"time must rise from frame to frame, got {moment:g} after {self._time:g}")
        arrays = arrays_of(foam)
        cell = _cell_of(arrays)
        if notes is not None:
            header = {**json.loads(arrays["header"].tobytes()), "notes": dict(notes)}
            text = json.dumps(header, allow_nan=False, sort_keys=True)
            arrays["header"] = np.frombuffer(text.encode("utf-8"), dtype=np.uint8)
        if self._cell is not None and not _same_cell(cell, self._cell):
            raise ValueError(
                "foam must lie in the cell of the frames before it: same surface, gap and heights"
            )
        if self._file is None and self._cell is not None:
            raise ValueError("the writer is closed; open another with append=True")
        # HDF5 ends the interpreter when the disk is full
        room_for(self.path, _SLACK + 2 * sum(values.nbytes for values in arrays.values()))
        try:
            if self._file is None:
                self._file = _created(self._h5py, self.path, cell)
            self._cell = cell
            _put(self._file, arrays, moment)
        except (OSError, RuntimeError) as fault:  # what h5py makes of the library's faults
            self._give_up()
            raise OSError(f"cannot write {self.path}: {brief(fault)}") from fault
        self._count, self._time = self._count + 1, moment

    def _give_up(self) -> None:
        """Close what cannot be written; without a frame there is no file."""
        with suppress(Exception):
            self.close()
        self._file = None
        if not self._count:
            self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file. Without a frame there is none."""
        if self._file is not None:
            self._file.close()
            self._file = None
            seal(self.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _go_on(self, target: Path) -> None:
        """Copy the frames that are there to a new file that takes the old one's place."""
        temporary = target.with_name(f".{target.name[:200]}.{secrets.token_hex(6)}.part")
        room_for(target, _SLACK + target.stat().st_size)
        with Trajectory(target) as old:
            self._cell = (old._header, old._surface)
            try:
                fresh = _created(self._h5py, temporary, self._cell)
                try:
                    for k in range(len(old)):
                        _put(fresh, old._arrays(k), float(old.times[k]), flush=False)
                finally:
                    fresh.close()
                seal(temporary)
                os.replace(temporary, target)
            except BaseException:
                temporary.unlink(missing_ok=True)
                raise
            self._count = len(old)
            self._time = float(old.times[-1]) if len(old) else -np.inf
        for look in range(WAITS + 1):
            try:
                self._file = self._h5py.File(target, "r+", libver=LIBRARIES)
                break
            except BlockingIOError:
                # somebody is reading it: not for long
                if look == WAITS:
                    raise
                time.sleep(PAUSE)
        self._file.swmr_mode = True
        mark_open(target)


class Trajectory:
    """The frames of an HDF5 trajectory, read when asked for.

    ``len(trajectory)``, ``trajectory[k]`` (a `Foam`, the same to the last bit) and iteration work as for a
    list; ``times`` are the frames' times.

    Parameters
    ----------
    path : str or path
    surfaces : iterable of classes, optional
        Surface classes of your own that the file may name.

    Raises
    ------
    ImportError
        If h5py is not installed (the extra ``formats``).
    TypeError
        If ``path`` is no path.
    FileNotFoundError
        If there is no such file.
    FileFormatError
        If the file is no trajectory, is damaged, or is of a version that is not known here. Frames are
        checked when they are read.
    """

    def __init__(self, path: PathLike, *, surfaces: Iterable[type] = ()) -> None:
        h5py = extra("h5py", _PURPOSE)
        self.path = existing(as_path(path))
        self._known = known_surfaces(surfaces)
        self._file: Any = None
        for look in range(LOOKS):
            try:
                self._read(h5py)
                return
            except Exception as fault:  # whatever a damaged file makes the library raise
                self.close()
                if look + 1 < LOOKS and _held(self.path):
                    # a copy taken while the writer was at it may be torn: the next is not
                    time.sleep(PAUSE)
                    continue
                if isinstance(fault, FileFormatError):
                    raise FileFormatError(f"cannot read {self.path}: {brief(fault)}") from None
                raise FileFormatError(
                    f"cannot read {self.path}: it is no trajectory or it is damaged ({brief(fault)})"
                ) from fault

    def _read(self, h5py: Any) -> None:
        self._file = _opened(h5py, self.path)
        self._size = self.path.stat().st_size
        self._header, self._surface = _checked(h5py, self._file, self._size)
        index = self._file["index"][()]
        if index.ndim != 2 or index.shape[1] != len(_DATA) + 1 or index.dtype != np.int64:
            raise FileFormatError("its index has the wrong shape or type")
        self._ends = np.vstack([np.zeros((1, len(_DATA)), dtype=np.int64), index[:, :-1]])
        if (np.diff(self._ends, axis=0) < 0).any():
            raise FileFormatError("its index does not rise")
        self._sums = index[:, -1]
        self.times: Floats = frozen(np.asarray(self._file["time"][: len(index)], dtype=np.float64))
        if len(self.times) != len(index) or not np.isfinite(self.times).all():
            raise FileFormatError("its times are missing or not finite")

    def __len__(self) -> int:
        return len(self._sums)

    def __getitem__(self, frame: int) -> Foam:
        return self._told(frame, lambda arrays: foam_of(arrays, self._known))

    def notes(self, frame: int) -> dict[str, Any]:
        """What was noted with a frame; empty if nothing was."""
        return self._told(frame, lambda arrays: dict(json.loads(arrays["header"].tobytes()).get("notes", {})))

    def _told(self, frame: int, told: Callable[[Arrays], T]) -> T:
        """What the arrays of a frame tell."""
        if not len(self):
            raise IndexError("the trajectory holds no frame")
        k = as_integer(frame, "frame", minimum=-len(self), maximum=len(self) - 1) % len(self)
        try:
            return told(self._arrays(k))
        except FileFormatError as fault:
            raise FileFormatError(f"cannot read frame {k} of {self.path}: {brief(fault)}") from None
        except Exception as fault:
            raise FileFormatError(
                f"cannot read frame {k} of {self.path}: it is damaged ({brief(fault)})"
            ) from fault

    def __iter__(self) -> Iterator[Foam]:
        return (self[k] for k in range(len(self)))

    def close(self) -> None:
        """Close the file; frames can no longer be read."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _arrays(self, k: int) -> Arrays:
        """The arrays of a frame, as `warpedfoam.io.state.arrays_of` makes them, checked by their sum."""
        if self._file is None:
            raise FileFormatError("the trajectory is closed")
        out: Arrays = {}
        for column, name in enumerate(_DATA):
            start, end = self._ends[k : k + 2, column].tolist()
            data = self._file[name]
            # a file may promise more than it holds
            if end > data.shape[0] or (end - start) * data.dtype.itemsize > self._size:
                raise FileFormatError(f"its {name} end too early")
            out[name] = data[start:end]
        told = np.array([self.times[k]])
        if _checksum(out, told) != self._sums[k]:
            raise FileFormatError("its checksum is wrong: the frame is damaged")
        films = len(out["next"]) // 2
        out["vertex_points"] = out["vertex_points"].reshape(-1, 3)
        out["film_offsets"] = out["film_offsets"].reshape(films, -1)
        if not json.loads(out["header"].tobytes())["pressures"]:
            del out["pressures"]
        return {**out, **self._surface}


def _held(path: Path) -> bool:
    """Whether it says that a writer holds it."""
    try:
        return is_open(path)
    except FileFormatError:
        return False


def _created(h5py: Any, path: Path, cell: tuple[str, Arrays]) -> Any:
    """A new file in single-writer mode, all its datasets there."""
    file = h5py.File(path, "x", libver=LIBRARIES, userblock_size=USER_BLOCK)
    try:
        file.attrs["format"] = FORMAT
        file.attrs["version"] = VERSION
        header, surface = cell
        file.attrs["cell"] = header
        for name, values in surface.items():
            file.create_dataset(f"cell/{name}", data=values, fletcher32=True)
        file.attrs["cell_checksum"] = _checksum(surface, np.frombuffer(header.encode(), dtype=np.uint8))
        for name in _DATA:
            kind = np.int64 if name in _INTS else np.float64 if name in _FLOATS else np.uint8
            file.create_dataset(name, (0,), kind, chunks=(_CHUNK,), maxshape=(None,), fletcher32=True)
        file.create_dataset("time", (0,), np.float64, chunks=(256,), maxshape=(None,), fletcher32=True)
        columns = len(_DATA) + 1
        file.create_dataset(
            "index", (0, columns), np.int64, chunks=(64, columns), maxshape=(None, columns), fletcher32=True
        )
        file["index"].attrs["columns"] = ", ".join([*(f"end of {name}" for name in _DATA), "checksum"])
        file.flush()
        file.swmr_mode = True
        mark_open(path)
    except BaseException:
        file.close()
        raise
    return file


def _put(file: Any, arrays: Mapping[str, NDArray[Any]], time: float, *, flush: bool = True) -> None:
    """Add one frame: the data, then its time, then its row of the index."""
    count = file["index"].shape[0]
    told = np.array([time])
    row: list[int] = []
    frame: Arrays = {}
    for name in _DATA:
        values = arrays.get(name, np.zeros(0)).ravel()
        frame[name] = values
        data = file[name]
        # what a killed writer left behind the last frame is written over
        start = int(file["index"][count - 1, len(row)]) if count else 0
        data.resize((start + len(values),))
        data[start:] = values
        row.append(start + len(values))
        if flush:
            data.flush()
    file["time"].resize((count + 1,))
    file["time"][count] = time
    if flush:
        file["time"].flush()
    file["index"].resize((count + 1, len(_DATA) + 1))
    file["index"][count] = [*row, _checksum(frame, told)]
    if flush:
        file["index"].flush()
        file.flush()


def _opened(h5py: Any, path: Path) -> Any:
    """The file for reading; of one that is still being written, or whose writer was killed, a copy in memory.

    HDF5's own way to read such a file waits for its writer, for ever if the file is damaged.
    """
    if not is_open(path):
        return h5py.File(path, "r")
    data = bytearray(path.read_bytes())
    block = slice(USER_BLOCK, USER_BLOCK + SUPERBLOCK)
    if not in_use(bytes(data[block])):
        raise FileFormatError("its writer ended before the first frame, or it is damaged")
    data[block] = released(bytes(data[block]), len(data))
    return h5py.File(io.BytesIO(data), "r")


def _checked(h5py: Any, file: Any, size: int) -> tuple[str, Arrays]:
    """The cell's header and arrays, if the file of ``size`` bytes is of this format and version."""
    if file.attrs.get("format") != FORMAT:
        raise FileFormatError("it is no trajectory of warpedfoam")
    version = file.attrs.get("version")
    if version != VERSION:
        raise FileFormatError(
            f"it is of version {version!s:.40}, this warpedfoam reads version {VERSION}; use a newer one"
        )
    missing = [name for name in (*_DATA, "time", "index") if not _plain(h5py, file, name)]
    if missing:
        raise FileFormatError(f"it lacks {', '.join(missing)}")
    if strange := sorted(file.keys() - {*_DATA, "time", "index", "cell"}):
        raise FileFormatError(f"it holds what is not known here: {', '.join(map(repr, strange))}")
    for name in (*_DATA, "time"):
        kind = np.int64 if name in _INTS else np.uint8 if name == "header" else np.float64
        if file[name].ndim != 1 or file[name].dtype != kind:
            raise FileFormatError(f"its {name} have the wrong shape or type")
    header = file.attrs["cell"]
    group = file.get("cell", {})
    if any(not _plain(h5py, group, name) or group[name].nbytes > size for name in group):
        raise FileFormatError("the arrays of its cell are damaged")
    if file["index"].nbytes > size or file["time"].nbytes > size + _CHUNK:
        raise FileFormatError("its index is longer than the file")
    surface = {name: np.asarray(group[name][()]) for name in group}
    if _checksum(surface, np.frombuffer(header.encode(), dtype=np.uint8)) != file.attrs["cell_checksum"]:
        raise FileFormatError("the checksum of its cell is wrong: it is damaged")
    return header, surface


def _plain(h5py: Any, group: Any, name: str) -> bool:
    """Whether an array lies in the file itself, its bytes as they are: no link, nothing to unpack."""
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        return False
    data = group[name]
    return isinstance(data, h5py.Dataset) and not (data.compression or data.external or data.is_virtual)


def _cell_of(arrays: Arrays) -> tuple[str, Arrays]:
    """What all frames share: the header's part about the cell, and the surface's arrays."""
    header = json.loads(arrays["header"].tobytes())
    told = json.dumps({key: header[key] for key in ("surface", "gap", "n_heights")}, sort_keys=True)
    return told, {name: values for name, values in arrays.items() if name.startswith("surface")}


def _same_cell(a: tuple[str, Arrays], b: tuple[str, Arrays]) -> bool:
    return (
        a[0] == b[0]
        and a[1].keys() == b[1].keys()
        and all(np.array_equal(values, b[1][name]) for name, values in a[1].items())
    )


def _checksum(arrays: Mapping[str, NDArray[Any]], more: NDArray[Any]) -> int:
    """CRC-32 of the bytes of all arrays, in the order of their names."""
    total = zlib.crc32(more.tobytes())
    for name in sorted(arrays):
        total = zlib.crc32(np.ascontiguousarray(arrays[name]).tobytes(), total)
    return total
