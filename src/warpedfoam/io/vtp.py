"""VTP files for ParaView: bubbles as polygons, films as lines, every number, and the foam itself.

VTK's XML is written and read here by hand: meshio has no polygonal data, and vtk is a package of 100 MB.
"""

from __future__ import annotations

import base64
import binascii
import xml.etree.ElementTree as ET
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TextIO
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import Ints, as_choice, as_instance, as_integer, as_number
from warpedfoam.errors import FileFormatError
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, as_path, atomic_text, writable_path
from warpedfoam.io.patches import bubble_patches, film_points, loop_points
from warpedfoam.io.reading import brief, text_of
from warpedfoam.io.scalars import bubble_scalars, film_scalars
from warpedfoam.io.state import arrays_of, foam_of, known_surfaces

Arrays = dict[str, NDArray[Any]]

#: What is drawn: all, or one kind of cells.
PARTS = ("all", "bubbles", "films")
FILLS = ("polygons", "triangles")
#: Arrays of the foam's state have this before their name in the field data.
STATE = "warpedfoam."
_TYPES = {"i8": "Int64", "i4": "Int32", "f8": "Float64", "u1": "UInt8"}


def write_vtp(
    path: PathLike,
    foam: Foam,
    *,
    curve_points: int | None = None,
    fill: str = "polygons",
    parts: str = "all",
    time: float | None = None,
) -> Path:
    """Write ``foam`` as VTK polygonal data, which ParaView opens and `read_vtp` reads back bit for bit.

    *Cells*: first the films as polylines, then the bubbles. *Cell data*: ``kind`` (0 film, 1 bubble);
    of bubbles ``bubble`` (id), ``sides``, ``charge``, ``area``, ``volume``, ``gaussian_curvature``
    (mean) and ``pressure``; of films ``film``, ``left``, ``right`` (ids), ``length``, ``film_area``
    and ``pressure_jump``. Where a number has no meaning it is NaN or −1 (``charge``: 0). *Field data*: the
    arrays of `warpedfoam.save`, named ``warpedfoam.…`` (none where the surface is made of Python functions,
    which no file can hold), and ``TimeValue`` if a time is given.

    Parameters
    ----------
    path : str or path
        Ends in ``.vtp``.
    foam : Foam
    curve_points : int, optional
        Points along each film, ends included. By default 9, or 5 above 2000 bubbles.
    fill : {"polygons", "triangles"}, optional
        Bubbles as one polygon each (what is no disk has none), or as triangles that lie on the surface.
    parts : {"all", "bubbles", "films"}, optional
    time : float, optional

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError, ValueError
        Arguments of the wrong type or out of range, a name that does not end in ``.vtp``.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.

    References
    ----------
    VTK XML file formats, docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from warpedfoam import Foam, HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> foam = Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)
    >>> folder = tempfile.TemporaryDirectory()
    >>> read_vtp(write_vtp(pathlib.Path(folder.name) / "foam.vtp", foam)).energy == foam.energy
    True
    >>> folder.cleanup()
    """
    target = writable_path(path, suffixes=(".vtp",))
    as_instance(foam, "foam", Foam)
    state = _stored(foam)
    if time is not None:
        state["TimeValue"] = np.array([as_number(time, "time")])
    part = as_choice(parts, "parts", PARTS)
    filled = as_choice(fill, "fill", FILLS)
    default = 5 if foam.n_bubbles > 2000 else 9
    k = default if curve_points is None else as_integer(curve_points, "curve_points", minimum=2)
    along = film_points(foam, k)
    points, chains = along.points, along.chains
    sizes = bubble = corners = np.zeros(0, dtype=np.int64)
    if part == "films":
        pass
    elif filled == "triangles":
        patches = bubble_patches(foam, curve_points=k, rings=2 if foam.n_bubbles > 2000 else 4)
        corners = patches.triangles.ravel() + len(points)
        points = np.concatenate([points, patches.points])
        sizes, bubble = np.full(len(patches.triangles), 3), patches.triangle_bubble
    else:
        points, corners, sizes, bubble = loop_points(foam, along)
        disk = foam.network.bubble_euler[bubble] == 1
        corners, sizes, bubble = corners[np.repeat(disk, sizes)], sizes[disk], bubble[disk]
    if part == "bubbles":
        chains = chains[:0]
    films = foam.network.n_films if len(chains) else 0
    data: Arrays = {"kind": np.repeat([0, 1], [films, len(sizes)]).astype(np.uint8)}
    for name, values in bubble_scalars(foam).items():
        data[name] = np.concatenate([_nothing(values, films, name), values[bubble]])
    for name, values in film_scalars(foam).items():
        data[name] = np.concatenate([values[:films], _nothing(values, len(sizes), name)])
    with atomic_text(target) as stream:
        _write(stream, points, chains, corners, sizes, data, state)
    return target


def read_vtp(path: PathLike, *, surfaces: Iterable[type] = ()) -> Foam:
    """Read the foam that `write_vtp` put into a file; its arrays are the same to the last bit.

    Parameters
    ----------
    path : str or path
    surfaces : iterable of classes, optional
        Surface classes of your own that the file may name.

    Raises
    ------
    TypeError
        If ``path`` is no path.
    FileNotFoundError
        If there is no such file.
    FileFormatError
        If the file is no such VTP file, is damaged, or holds no foam of warpedfoam.
    """
    source = as_path(path)
    text = text_of(source)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise FileFormatError(f"cannot read {source}: it defines entities, which VTP files do not")
    try:
        return foam_of(_state(ET.fromstring(text)), known_surfaces(surfaces))
    except FileFormatError as fault:
        raise FileFormatError(f"cannot read {source}: {brief(fault)}") from None
    except Exception as fault:  # whatever a damaged file makes the parsers raise
        raise FileFormatError(
            f"cannot read {source}: it is no VTP file or it is damaged ({brief(fault)})"
        ) from fault


def _stored(foam: Foam) -> Arrays:
    """The foam's arrays for the field data."""
    try:
        arrays = arrays_of(foam)
    except TypeError:  # functions: there is still a picture
        return {}
    state = {STATE + name: array for name, array in arrays.items()}
    state[STATE + "checksum"] = np.array([_checksum(arrays)])
    return state


def _nothing(like: NDArray[Any], count: int, name: str) -> NDArray[Any]:
    """What stands where a number has no meaning."""
    void = np.nan if like.dtype.kind == "f" else 0 if name == "charge" else -1
    return np.full(count, void, dtype=like.dtype)


def _write(
    stream: TextIO,
    points: NDArray[Any],
    chains: Ints,
    corners: Ints,
    sizes: Ints,
    data: Arrays,
    state: Arrays,
) -> None:
    stream.write(
        '<?xml version="1.0"?>\n'
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n<PolyData>\n'
        "<FieldData>\n"
    )
    for name, values in state.items():
        columns = values.shape[1] if values.ndim == 2 else 1
        shape = f'NumberOfComponents="{columns}" NumberOfTuples="{len(values)}"'
        stream.write(_array(name, values, shape))
    n_lines, n_polygons = len(chains), len(sizes)
    stream.write(
        f'</FieldData>\n<Piece NumberOfPoints="{len(points)}" NumberOfVerts="0" NumberOfLines="{n_lines}" '
        f'NumberOfStrips="0" NumberOfPolys="{n_polygons}">\n<Points>\n'
    )
    stream.write(_array("Points", points, 'NumberOfComponents="3"'))
    stream.write("</Points>\n")
    ends = np.cumsum(np.full(n_lines, chains.shape[1]))
    for name, connectivity, offsets in (
        ("Lines", chains.ravel(), ends),
        ("Polys", corners, np.cumsum(sizes)),
    ):
        stream.write(
            f"<{name}>\n{_array('connectivity', connectivity)}{_array('offsets', offsets)}</{name}>\n"
        )
    stream.write('<CellData Scalars="charge">\n')
    for name, values in data.items():
        stream.write(_array(name, values))
    stream.write("</CellData>\n</Piece>\n</PolyData>\n</VTKFile>\n")


def _array(name: str, values: NDArray[Any], more: str = "") -> str:
    """A DataArray: its length in bytes and its bytes, in base 64."""
    code = values.dtype.str[1:]
    kind = _TYPES[code]
    raw = np.ascontiguousarray(values, dtype="<" + code if code != "u1" else "u1").tobytes()
    # one stream of length and bytes, as VTK reads it
    body = base64.b64encode(len(raw).to_bytes(8, "little") + raw).decode("ascii")
    return f'<DataArray type="{kind}" Name={quoteattr(name)} {more} format="binary">{body}</DataArray>\n'


def _state(root: ET.Element) -> Arrays:
    """The foam's arrays in the field data."""
    wanted = {"type": "PolyData", "byte_order": "LittleEndian", "header_type": "UInt64"}
    if root.tag != "VTKFile" or any(root.get(key) != value for key, value in wanted.items()):
        raise FileFormatError("it is no VTP file as write_vtp writes it")
    field = root.find("PolyData/FieldData")
    arrays: Arrays = {}
    for entry in () if field is None else field.iter("DataArray"):
        name = entry.get("Name", "")
        if name.startswith(STATE):
            arrays[name.removeprefix(STATE)] = _values(entry, name)
    if not arrays:
        raise FileFormatError(
            "it holds no foam: another program wrote it, or its surface is made of Python functions"
        )
    if (
        arrays.get("next") is not None and "film_offsets" in arrays
    ):  # one column or none has no shape of its own
        films = max(len(arrays["next"]) // 2, 1)
        arrays["film_offsets"] = arrays["film_offsets"].reshape(films, -1)
    told = arrays.pop("checksum", None)
    if told is None or told.tolist() != [_checksum(arrays)]:
        raise FileFormatError("its checksum is missing or wrong: it is damaged")
    return arrays


def _checksum(arrays: Arrays) -> int:
    """CRC-32 of the bytes of all arrays, in the order of their names."""
    total = 0
    for name in sorted(arrays):
        total = zlib.crc32(np.ascontiguousarray(arrays[name]).tobytes(), zlib.crc32(name.encode(), total))
    return total


def _values(entry: ET.Element, name: str) -> NDArray[Any]:
    if entry.get("format") != "binary":
        raise FileFormatError(f"its array {name!r} is not binary")
    code = {kind: code for code, kind in _TYPES.items()}.get(entry.get("type", ""))
    if code is None:
        raise FileFormatError(f"its array {name!r} is of type {entry.get('type')!r}")
    text = "".join((entry.text or "").split())
    try:
        whole = base64.b64decode(text, validate=True)
    except binascii.Error as fault:
        raise FileFormatError(f"its array {name!r} is damaged ({fault})") from None
    length, raw = int.from_bytes(whole[:8], "little"), whole[8:]
    if len(raw) != length:
        raise FileFormatError(f"its array {name!r} holds {len(raw)} bytes, not {length}")
    columns = int(entry.get("NumberOfComponents", "1"))
    flat = np.frombuffer(raw, dtype="u1" if code == "u1" else "<" + code)
    return flat if columns == 1 else flat.reshape(-1, columns)


def collection(kind: str, inside: Iterable[str], attributes: Mapping[str, str] | None = None) -> str:
    """The XML of a file that names other files."""
    more = "".join(f" {key}={quoteattr(value)}" for key, value in (attributes or {}).items())
    lines = "\n".join(inside)
    return (
        f'<?xml version="1.0"?>\n<VTKFile type="{kind}"{more} byte_order="LittleEndian" '
        f'header_type="UInt64">\n{lines}\n</VTKFile>\n'
    )
