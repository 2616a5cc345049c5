"""VTM and PVD files for ParaView: a foam in named blocks, and foams in time."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import quoteattr

from numpy.typing import ArrayLike

from warpedfoam.arrays import as_floats, as_instance
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_text, writable_path
from warpedfoam.io.vtp import collection, write_vtp


def write_vtm(path: PathLike, foam: Foam, *, curve_points: int | None = None) -> Path:
    """Write ``foam`` as a multi-block of ``bubbles`` and ``films``, to show and colour each on its own.

    Beside ``foam.vtm`` the folder ``foam`` holds ``bubbles.vtp`` (triangles on the surface) and
    ``films.vtp``; see `write_vtp` for what they carry. The ``.vtm`` is written last.

    Parameters
    ----------
    path : str or path
        Ends in ``.vtm``.
    foam : Foam
    curve_points : int, optional
        See `write_vtp`.

    Returns
    -------
    pathlib.Path
        The ``.vtm`` file.

    Raises
    ------
    TypeError, ValueError, FileNotFoundError, IsADirectoryError
        As `write_vtp`.
    """
    target = writable_path(path, suffixes=(".vtm",))
    as_instance(foam, "foam", Foam)
    folder = _folder(target)
    write_vtp(folder / "bubbles.vtp", foam, curve_points=curve_points, fill="triangles", parts="bubbles")
    write_vtp(folder / "films.vtp", foam, curve_points=curve_points, parts="films")
    blocks = [
        f'<DataSet index="{k}" name="{name}" file={quoteattr(f"{folder.name}/{name}.vtp")}/>'
        for k, name in enumerate(("bubbles", "films"))
    ]
    text = collection(
        "vtkMultiBlockDataSet",
        ["<vtkMultiBlockDataSet>", *blocks, "</vtkMultiBlockDataSet>"],
        {"version": "1.0"},
    )
    with atomic_text(target) as stream:
        stream.write(text)
    return target


def write_pvd(
    path: PathLike,
    foams: Iterable[Foam],
    times: ArrayLike | None = None,
    *,
    curve_points: int | None = None,
    fill: str = "polygons",
) -> Path:
    """Write foams as a time series: ``series.pvd`` and the folder ``series`` with a VTP file for each.

    The foams may differ in everything, their topology too. They are taken one by one, so that they need
    not fit into memory. The ``.pvd`` is written last.

    Parameters
    ----------
    path : str or path
        Ends in ``.pvd``.
    foams : iterable of Foam
    times : (n,) array, optional
        Rising; 0, 1, 2, … by default.
    curve_points, fill : optional
        See `write_vtp`.

    Returns
    -------
    pathlib.Path
        The ``.pvd`` file.

    Raises
    ------
    TypeError, ValueError, FileNotFoundError, IsADirectoryError
        As `write_vtp`; no foams, or not as many as times, or times that do not rise.
    """
    target = writable_path(path, suffixes=(".pvd",))
    moments = None if times is None else as_floats(times, "times", (None,)).tolist()
    if moments is not None and any(b <= a for a, b in pairwise(moments)):
        raise ValueError("times must rise from each foam to the next")
    if isinstance(foams, Foam) or not isinstance(foams, Iterable):
        raise TypeError(f"foams must be an iterable of Foams, got {type(foams).__name__}")
    folder = _folder(target)
    rows: list[str] = []
    for k, foam in enumerate(foams):
        as_instance(foam, f"foams[{k}]", Foam)
        if moments is not None and k >= len(moments):
            raise ValueError(f"times must hold a time for every foam, got {len(moments)} for more foams")
        time = float(k) if moments is None else moments[k]
        file = write_vtp(folder / f"{k:06d}.vtp", foam, curve_points=curve_points, fill=fill, time=time)
        name = quoteattr(f"{folder.name}/{file.name}")
        rows.append(f'<DataSet timestep="{time!r}" group="" part="0" file={name}/>')
    if not rows or (moments is not None and len(rows) != len(moments)):
        raise ValueError(f"foams must hold a foam for every time and at least one, got {len(rows)}")
    with atomic_text(target) as stream:
        stream.write(collection("Collection", ["<Collection>", *rows, "</Collection>"], {"version": "0.1"}))
    return target


def _folder(target: Path) -> Path:
    """The folder beside the file that takes its parts."""
    folder = target.with_suffix("")
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"cannot write {target}: {folder} must be a folder, but it is a file")
    folder.mkdir(exist_ok=True)
    return folder
