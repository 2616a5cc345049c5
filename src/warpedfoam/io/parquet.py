"""Tables as Parquet files: those of bubbles and films, and any columns of plain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_binary, writable_path
from warpedfoam.io.reading import extra
from warpedfoam.io.tables import bubble_columns, film_columns


def write_bubbles_parquet(path: PathLike, foam: Foam) -> Path:
    """Write one row per bubble, the columns of `write_bubbles_csv` with their types.

    Pressures that the foam does not have are null.

    Parameters
    ----------
    path : str or path
        Ends in ``.parquet``.
    foam : Foam

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    ImportError
        If pyarrow is not installed (the extra ``formats``).
    TypeError, ValueError, FileNotFoundError, IsADirectoryError
        As `write_bubbles_csv`; a name that does not end in ``.parquet``.
    """
    return _write(writable_path(path, suffixes=(".parquet",)), bubble_columns(foam))


def write_films_parquet(path: PathLike, foam: Foam) -> Path:
    """Write one row per film, the columns of `write_films_csv` with their types.

    Parameters
    ----------
    path : str or path
        Ends in ``.parquet``.
    foam : Foam

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    ImportError, TypeError, ValueError, OSError
        As `write_bubbles_parquet`.
    """
    return _write(writable_path(path, suffixes=(".parquet",)), film_columns(foam))


def write_columns_parquet(path: PathLike, columns: Mapping[str, Sequence[Any]]) -> Path:
    """Write columns of plain values: integers of 64 bits, doubles, truth values, texts; None is null.

    Parameters
    ----------
    path : str or path
    columns : mapping of str to sequences
        Of equal length; the values of a column are of one type. A column without a value is one of doubles.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    ImportError
        If pyarrow is not installed (the extra ``formats``).
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.
    """
    return _write(writable_path(path), columns)


def _write(target: Path, columns: Mapping[str, Sequence[Any]]) -> Path:
    arrow, parquet = extra("pyarrow", "Parquet"), extra("pyarrow.parquet", "Parquet")
    types = {bool: arrow.bool_(), int: arrow.int64(), float: arrow.float64(), str: arrow.string()}
    arrays = {}
    for name, values in columns.items():
        kinds = {type(value) for value in values if value is not None}
        arrays[name] = arrow.array(values, types[kinds.pop()] if kinds else types[float])
    with atomic_binary(target) as stream:
        parquet.write_table(arrow.table(arrays), stream)
    return target
