"""The tables of bubbles and films as Parquet files."""

from __future__ import annotations

from pathlib import Path

from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_binary, writable_path
from warpedfoam.io.reading import extra
from warpedfoam.io.tables import Columns, bubble_columns, film_columns


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


def _write(target: Path, columns: Columns) -> Path:
    arrow, parquet = extra("pyarrow", "Parquet"), extra("pyarrow.parquet", "Parquet")
    # a column without a value would have no type
    kinds = {name: arrow.float64() if values[0] is None else None for name, values in columns.items()}
    table = arrow.table({name: arrow.array(values, kinds[name]) for name, values in columns.items()})
    with atomic_binary(target) as stream:
        parquet.write_table(table, stream)
    return target
