"""Save a foam and get the very same foam back."""

from __future__ import annotations

import dataclasses
import io
import json
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import warpedfoam.surfaces as _surfaces
from warpedfoam.arrays import as_indices, as_instance
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import FileFormatError
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, as_path, atomic_binary, writable_path
from warpedfoam.io.reading import brief, existing
from warpedfoam.network import CellNetwork

FORMAT = "warpedfoam foam"
VERSION = 1

_INTS = ("next", "origin", "bubble", "bubble_euler", "bubble_ids")
_FLOATS = ("vertex_points", "film_offsets", "target_volumes")
_AXES = {"vertex_points": 2, "film_offsets": 2}
#: What a header must tell, and what it may; a trajectory keeps its notes there.
_TOLD = {"format", "version", "surface", "gap", "n_heights", "tension", "seed", "pressures"}
_MAY_TELL = {"exterior", "notes"}

Arrays = dict[str, NDArray[Any]]


def save(path: PathLike, foam: Foam) -> Path:
    """Write ``foam`` to ``path``, an uncompressed NumPy ``.npz`` archive without pickles.

    The archive holds the arrays as they are, and ``header``: JSON with the version of this schema,
    the surface (class and fields), gap, tension and seed. The file appears whole or not at all.

    Parameters
    ----------
    path : str or path
        Written under exactly this name.
    foam : Foam

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError
        If ``foam`` is not a Foam, or its surface is not a dataclass of numbers and arrays.
    FileNotFoundError, IsADirectoryError, ValueError
        If the path cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from warpedfoam import Foam, HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> foam = Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = save(pathlib.Path(folder.name) / "foam.npz", foam)
    >>> path.name, len(load(path).vertex_points)
    ('foam.npz', 4)
    >>> folder.cleanup()
    """
    target = writable_path(path)
    arrays = arrays_of(foam)
    with atomic_binary(target) as stream:
        np.savez(stream, allow_pickle=False, **arrays)
    return target


def arrays_of(foam: Foam) -> Arrays:
    """The arrays of a foam and its ``header``, as `save` and other formats write them.

    Raises
    ------
    TypeError
        If ``foam`` is not a Foam, or its surface or gap is not a dataclass of numbers and arrays.
    """
    as_instance(foam, "foam", Foam)
    network = foam.network
    arrays: Arrays = {
        "next": network.next,
        "origin": network.origin,
        "bubble": network.bubble,
        "bubble_euler": network.bubble_euler,
        "bubble_ids": foam.bubble_ids,
        "vertex_points": foam.vertex_points,
        "film_offsets": foam.film_offsets,
        "target_volumes": foam.target_volumes,
    }
    if foam.pressures is not None:
        arrays["pressures"] = foam.pressures
    header = {
        "format": FORMAT,
        "version": VERSION,
        "surface": _described(foam.cell.surface, "surface", arrays),
        "gap": _described_gap(foam.cell, arrays),
        "n_heights": foam.cell.n_heights,
        "tension": foam.tension,
        "seed": foam.seed,
        "exterior": foam.exterior,
        "pressures": foam.pressures is not None,
    }
    text = json.dumps(header, allow_nan=False, sort_keys=True)
    arrays["header"] = np.frombuffer(text.encode("utf-8"), dtype=np.uint8)
    return arrays


def load(path: PathLike, *, surfaces: Iterable[type] = ()) -> Foam:
    """Read a foam that `save` wrote; its arrays are the same to the last bit.

    Parameters
    ----------
    path : str or path
    surfaces : iterable of classes, optional
        Classes of your own, of surfaces or gaps, that the file may name besides those of
        `warpedfoam.surfaces`.

    Returns
    -------
    Foam

    Raises
    ------
    TypeError
        If ``path`` is no path.
    FileNotFoundError
        If there is no such file.
    FileFormatError
        If the file is no foam, is damaged, or is of a version or a surface that is not known here.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from warpedfoam import Foam, HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> foam = Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)
    >>> folder = tempfile.TemporaryDirectory()
    >>> again = load(save(pathlib.Path(folder.name) / "foam.npz", foam))
    >>> again.cell == foam.cell, again.energy == foam.energy
    (True, True)
    >>> folder.cleanup()
    """
    source = existing(as_path(path))
    data = source.read_bytes()
    known = known_surfaces(surfaces)
    try:
        return foam_of(_members(data), known)
    except FileFormatError as fault:
        raise FileFormatError(f"cannot read {source}: {brief(fault)}") from None
    except Exception as fault:  # whatever a damaged file makes the parsers raise
        raise FileFormatError(
            f"cannot read {source}: it is no foam of warpedfoam or it is damaged ({brief(fault)})"
        ) from fault


def known_surfaces(own: Iterable[type] = ()) -> dict[str, type]:
    """Surface classes by name: those of `warpedfoam.surfaces`, and the caller's own."""
    known = {name: getattr(_surfaces, name) for name in _surfaces.__all__}
    known.update({kind.__name__: kind for kind in own})
    return known


def _members(data: bytes) -> Arrays:
    """Arrays of the archive; zipfile compares the checksums of all it reads."""
    if not zipfile.is_zipfile(io.BytesIO(data)):
        raise FileFormatError("it is not an .npz archive, or its end is missing")
    arrays: Arrays = {}
    left = len(data)  # many members may name the same bytes
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for member in archive.infolist():
            name = member.filename.removesuffix(".npy")
            left -= member.file_size
            if member.compress_type != zipfile.ZIP_STORED or left < 0:
                raise FileFormatError(f"its member {member.filename!r} is compressed or damaged")
            if name in arrays:
                raise FileFormatError(f"it holds {member.filename!r} twice")
            arrays[name] = _array(archive.read(member), member.filename)
    return arrays


def _array(raw: bytes, name: str) -> NDArray[Any]:
    stream = io.BytesIO(raw)
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):
        raise FileFormatError(f"its member {name!r} is of array format {version}, 1.0 is known")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    if dtype.kind not in "iuf" or fortran:
        raise FileFormatError(f"its member {name!r} holds {dtype} values, not plain numbers")
    body = raw[stream.tell() :]
    count = 1
    for length in shape:
        count *= length
    if count * dtype.itemsize != len(body):
        raise FileFormatError(f"its member {name!r} holds {len(body)} bytes, not {count * dtype.itemsize}")
    return np.frombuffer(body, dtype=dtype).reshape(shape)


def foam_of(arrays: Arrays, known: Mapping[str, type]) -> Foam:
    """The foam of `arrays_of`.

    Raises
    ------
    FileFormatError
        If something is missing, of the wrong type, or not known here; other errors of `Foam` may follow.
    """
    if "header" not in arrays:
        raise FileFormatError("it has no header: it is not a foam of warpedfoam")
    header = json.loads(arrays["header"].tobytes().decode("utf-8"))
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise FileFormatError("its header is not that of a foam of warpedfoam")
    if header.get("version") != VERSION:
        raise FileFormatError(
            f"it is of version {header.get('version')!r:.40}, this warpedfoam reads version {VERSION}; "
            "use a newer warpedfoam"
        )
    wanted = {*_INTS, *_FLOATS, *(["pressures"] if header.get("pressures") is True else [])}
    lacking = sorted(_TOLD - header.keys()) + sorted(wanted - arrays.keys())
    if lacking:
        raise FileFormatError(f"it lacks {', '.join(lacking)}")
    known_arrays = {name for name in arrays if name.startswith(("surface.", "gap."))} | {*wanted, "header"}
    strange = sorted(header.keys() - _TOLD - _MAY_TELL) + sorted(arrays.keys() - known_arrays)
    if strange:
        raise FileFormatError(
            f"it holds what is not known here: {', '.join(map(repr, strange))}; use a newer warpedfoam"
        )
    for name in (*_INTS, *_FLOATS):
        kinds = "i" if name in _INTS else "f"
        if arrays[name].dtype.kind not in kinds or arrays[name].ndim != _AXES.get(name, 1):
            raise FileFormatError(f"its array {name!r} has the wrong type or shape")
    count = len(arrays["next"])
    for name in ("next", "origin", "bubble"):  # before anything is allocated by the largest index
        as_indices(arrays[name], name, (count,), below=count)
    surface = _restored(header["surface"], "surface", arrays, known)
    gap = _restored(header["gap"], "gap", arrays, known)
    cell = HeleShawCell(surface, gap, header["n_heights"])
    network = CellNetwork(*(arrays[name] for name in ("next", "origin", "bubble", "bubble_euler")))
    return Foam(
        cell,
        network,
        arrays["vertex_points"],
        arrays["film_offsets"],
        arrays["target_volumes"],
        arrays["bubble_ids"],
        tension=header["tension"],
        pressures=arrays["pressures"] if header["pressures"] is True else None,
        seed=header["seed"],
        exterior=header.get("exterior"),
    )


def _described_gap(cell: HeleShawCell, arrays: Arrays) -> float | dict[str, Any]:
    """A number, or class and fields of a gap that varies."""
    if cell.parallel:
        return cell.mean_gap
    if isinstance(cell.gap, _surfaces.FunctionGap):
        raise TypeError(
            "cannot save the gap: it is a plain function; LinearGap, ShiftedSphereGap, ShiftedTubeGap, "
            "FormulaGap and dataclasses of your own can be saved"
        )
    return _described(cell.gap, "gap", arrays)


def _described(value: object, place: str, arrays: Arrays) -> dict[str, Any]:
    """Class and fields of a dataclass for JSON; arrays go to ``arrays`` under their place."""
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        raise TypeError(f"cannot save the {place}: {type(value).__name__} is not a dataclass")
    fields: dict[str, Any] = {}
    for field in dataclasses.fields(value):
        if field.name.startswith("_") or not field.init:
            continue
        item, where = getattr(value, field.name), f"{place}.{field.name}"
        if isinstance(item, np.ndarray) and item.dtype.kind in "iuf":
            arrays[where] = item
            fields[field.name] = {"array": where}
        elif dataclasses.is_dataclass(item) and not isinstance(item, type):
            fields[field.name] = _described(item, where, arrays)
        elif item is None or isinstance(item, (bool, int, float, str)):
            fields[field.name] = item
        elif isinstance(item, tuple) and all(isinstance(x, (int, float)) for x in item):
            fields[field.name] = {"tuple": list(item)}
        else:
            hint = "; surfaces made by from_formula can be saved" if callable(item) else ""
            raise TypeError(f"cannot save {where}: it is a {type(item).__name__}{hint}")
    return {"class": type(value).__name__, "fields": fields}


def _restored(entry: Any, place: str, arrays: Arrays, known: Mapping[str, type]) -> Any:
    if not isinstance(entry, dict):
        return entry
    if "array" in entry:
        return arrays[entry["array"]]
    if "tuple" in entry:
        return tuple(entry["tuple"])
    kind = known.get(entry["class"])
    if kind is None or not dataclasses.is_dataclass(kind):
        raise FileFormatError(
            f"its {place} is a {entry['class']!r}, which is not known here; "
            "use a newer warpedfoam, or pass its class in load(..., surfaces=[...])"
        )
    fields = {
        name: _restored(item, f"{place}.{name}", arrays, known) for name, item in entry["fields"].items()
    }
    return kind(**fields)
