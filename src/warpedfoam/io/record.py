"""Run records: what was asked for, with which seed, by which versions."""

from __future__ import annotations

import json
import math
import os
import platform
import zlib
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.errors import FileFormatError
from warpedfoam.io.atomic import PathLike, atomic_text, writable_path

_PACKAGES = ("warpedfoam", "numpy", "scipy", "libigl", "trimesh", "networkx", "matplotlib")
#: Listed where they are installed: another solver rounds differently.
_OPTIONAL = ("pypardiso",)


def write_record(path: PathLike, record: Mapping[str, Any]) -> Path:
    """Write ``record`` as sorted, indented UTF-8 JSON.

    NumPy numbers and arrays become numbers and lists, paths become strings.

    Parameters
    ----------
    path : str or path
    record : mapping of str to numbers, strings, None, sequences, arrays or mappings

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError
        If a key is not a string or a value has no counterpart in JSON; names the place.
    ValueError
        If a number is NaN or infinite (JSON has neither); names the place.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = write_record(pathlib.Path(folder.name) / "run.json", {"seed": np.int64(3)})
    >>> print(path.read_text().strip())
    {
      "seed": 3
    }
    >>> folder.cleanup()
    """
    target = writable_path(path)
    if not isinstance(record, Mapping):
        raise TypeError(f"record must be a mapping, got {type(record).__name__}")
    text = json.dumps(_plain(record, "record"), allow_nan=False, ensure_ascii=False, indent=2, sort_keys=True)
    with atomic_text(target) as stream:
        stream.write(text + "\n")
    return target


def sealed(record: Mapping[str, Any]) -> dict[str, Any]:
    """The record and its ``sum``, the CRC-32 of its JSON: a digit that changes on the disk is noticed.

    Raises
    ------
    TypeError, ValueError
        As `write_record`.

    Examples
    --------
    >>> sealed({"seed": 3})
    {'seed': 3, 'sum': 552043143}
    >>> unsealed({"seed": 3, "sum": 552043143}, {"seed"})
    {'seed': 3}
    """
    plain = _plain(record, "record")
    return {**plain, "sum": _sum(plain)}


def unsealed(record: Any, names: Iterable[str]) -> dict[str, Any]:
    """A record that holds ``names`` and nothing else, without its sum; older ones have none.

    Raises
    ------
    FileFormatError
        If it is another record or its sum is wrong.
    """
    if not isinstance(record, dict):
        raise FileFormatError("it is no record")
    known = set(names)
    if record.keys() - {"sum"} != known:
        wrong = sorted(map(repr, (record.keys() - {"sum"}) ^ known))
        raise FileFormatError(f"it lacks, or holds beyond what is known: {', '.join(wrong)}")
    plain = {name: value for name, value in record.items() if name != "sum"}
    if "sum" in record and record["sum"] != _sum(plain):
        raise FileFormatError("its checksum is wrong")
    return plain


def _sum(plain: Mapping[str, Any]) -> int:
    return zlib.crc32(json.dumps(plain, ensure_ascii=True, sort_keys=True).encode("ascii"))


def versions() -> dict[str, str]:
    """Versions of Python, warpedfoam and the packages its results depend on, and of pypardiso if installed.

    Examples
    --------
    >>> sorted(versions().keys() - {"pypardiso"})
    ['libigl', 'matplotlib', 'networkx', 'numpy', 'python', 'scipy', 'trimesh', 'warpedfoam']
    """
    found = {"python": platform.python_version()}
    for name in (*_PACKAGES, *_OPTIONAL):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            if name not in _OPTIONAL:
                found[name] = "not installed"
    return found


def _plain(value: Any, place: str) -> Any:
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "O":
            raise TypeError(f"{place} is an array of objects; use numbers, strings or lists")
        return _plain(value.tolist(), place)
    if isinstance(value, np.generic):
        return _plain(value.item(), place)
    if value is None or isinstance(value, (bool, str, int)):
        return value
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{place} is {value}, which JSON cannot hold; leave it out or use None")
        return value
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        wrong = [key for key in value if not isinstance(key, str)]
        if wrong:
            raise TypeError(f"the keys of {place} must be strings, got {wrong[0]!r}")
        return {str(key): _plain(item, f"{place}[{key!r}]") for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item, f"{place}[{i}]") for i, item in enumerate(value)]
    raise TypeError(f"{place} is a {type(value).__name__}, which JSON cannot hold; convert it first")
