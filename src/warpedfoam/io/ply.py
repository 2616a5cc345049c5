"""PLY files: the cell network as it is, and triangles to look at."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import Floats, Ints, as_integer
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_binary, atomic_text, writable_path
from warpedfoam.io.colours import FILM_COLOUR, BubbleColours, as_rgb, bubble_colours
from warpedfoam.io.patches import bubble_patches, film_points, loop_points

# Lists count with one byte, and Blender and MeshLab fail beyond it.
MOST_CORNERS = 255
# Width of the dark strips of the view file, in units of the bubble size.
_STRIP = 0.02


def write_ply(
    path: PathLike, foam: Foam, *, color_by: str = "charge", curve_points: int | None = None
) -> tuple[Path, Path]:
    """Write the cell network as ``path`` and a coloured surface as ``<stem>_view.ply`` beside it.

    The first is an ASCII PLY. *Vertices*: the foam's vertices, then the points along the films.
    *Faces*: one polygon per bubble, in the order of the bubbles, with a colour and the scalars
    ``area``, ``volume``, ``pressure`` (left out if the foam has none), ``gaussian_curvature`` (mean
    over the bubble), ``sides``, ``charge`` and ``bubble`` (its id). A bubble with more than 255
    boundary points is cut into several polygons with the same id; one that is no disk has none.
    *Edges*: the segments of the films, with ``film``, the ids of the bubbles on its ``left`` and
    ``right``, and ``length`` and ``area`` of the whole film.

    The second is a binary PLY of triangles on the surface with normals, colours and ``quality``, the
    value that the colour stands for; films are dark strips. Every common viewer opens it.

    Parameters
    ----------
    path : str or path
        Ends in ``.ply``.
    foam : Foam
    color_by : {"charge", "pressure", "sides", "area"}, optional
    curve_points : int, optional
        Points along each film, ends included: 2 for straight films. By default 9, or 5 above 2000
        bubbles.

    Returns
    -------
    (pathlib.Path, pathlib.Path)
        The two files.

    Raises
    ------
    TypeError
        If ``foam`` is not a Foam or ``curve_points`` not an integer.
    ValueError
        If the name does not end in ``.ply``, ``color_by`` is unknown or asks for missing pressures,
        or ``curve_points`` is below 2.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from warpedfoam import Foam, HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> foam = Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)
    >>> folder = tempfile.TemporaryDirectory()
    >>> network, view = write_ply(pathlib.Path(folder.name) / "foam.ply", foam, color_by="area")
    >>> network.name, view.name
    ('foam.ply', 'foam_view.ply')
    >>> [line for line in network.read_text().splitlines() if line.startswith("element")]
    ['element vertex 46', 'element face 4', 'element edge 48']
    >>> folder.cleanup()
    """
    target = writable_path(path, suffixes=(".ply",))
    view = writable_path(target.with_name(target.stem + "_view.ply"))
    colours = bubble_colours(foam, color_by)
    many = foam.n_bubbles > 2000
    default = 5 if many else 9
    points = default if curve_points is None else as_integer(curve_points, "curve_points", minimum=2)
    _write_network(target, foam, colours, points)
    _write_view(view, foam, colours, points, rings=2 if many else 4)
    return target, view


def _write_network(path: Path, foam: Foam, colours: BubbleColours, curve_points: int) -> None:
    network = foam.network
    along = film_points(foam, curve_points)
    points, places, sizes, bubble = loop_points(foam, along)
    disk = network.bubble_euler[bubble] == 1
    places, sizes, bubble = places[np.repeat(disk, sizes)], sizes[disk], bubble[disk]
    if (sizes > MOST_CORNERS).any():
        places, sizes, bubble, middles = _cut(places, sizes, bubble, len(points), points)
        points = np.concatenate([points, middles])
    face_kinds, face_columns = _face_scalars(foam, colours)
    chains = along.chains
    segments = np.stack([chains[:, :-1].ravel(), chains[:, 1:].ravel()], axis=1)
    film = np.repeat(np.arange(network.n_films), curve_points - 1)
    with atomic_text(path) as stream:
        stream.write(
            "ply\n"
            "format ascii 1.0\n"
            "comment cell network of a foam between curved plates, written by warpedfoam\n"
            f"comment vertices 0 to {network.n_vertices - 1} are the foam's, the others lie along films\n"
            "comment faces are bubbles, edges are segments of films; bubble, left and right are bubble ids\n"
            f"element vertex {len(points)}\n"
            "property double x\nproperty double y\nproperty double z\n"
            f"element face {len(sizes)}\n"
            "property list uchar int vertex_indices\n"
            + "".join(f"property {kind} {name}\n" for name, kind in face_kinds)
            + f"element edge {len(segments)}\n"
            "property int vertex1\nproperty int vertex2\n"
            "property int film\nproperty int left\nproperty int right\n"
            "property double length\nproperty double area\n"
            "end_header\n"
        )
        stream.write(_lines("%.17g %.17g %.17g\n", points.T))
        stream.write(_polygon_lines(places, sizes, [column[bubble] for column in face_columns], face_kinds))
        columns = [
            *segments.T,
            film,
            foam.bubble_ids[network.left][film],
            foam.bubble_ids[network.right][film],
            foam.film_lengths[film],
            foam.film_areas[film],
        ]
        stream.write(_lines("%d %d %d %d %d %.17g %.17g\n", columns))


def _face_scalars(foam: Foam, colours: BubbleColours) -> tuple[list[tuple[str, str]], list[NDArray[Any]]]:
    """Names and PLY types of the faces' properties, and a value per bubble of each."""
    network = foam.network
    kinds = [(name, "uchar") for name in ("red", "green", "blue")]
    kinds += [("area", "double"), ("volume", "double")]
    columns: list[NDArray[Any]] = [*colours.rgb.T, foam.bubble_areas, foam.bubble_volumes]
    if foam.pressures is not None:
        kinds.append(("pressure", "double"))
        columns.append(foam.pressures)
    kinds += [("gaussian_curvature", "double"), ("sides", "int"), ("charge", "int"), ("bubble", "int")]
    columns += [foam.bubble_curvatures / foam.bubble_areas, network.sides, network.charges, foam.bubble_ids]
    return kinds, columns


def _cut(
    places: Ints, sizes: Ints, bubble: Ints, first_new: int, points: Floats
) -> tuple[Ints, Ints, Ints, Floats]:
    """Cut loops of too many corners into sectors round a middle point each."""
    span = MOST_CORNERS - 2
    loops: list[Ints] = []
    owners: list[int] = []
    middles: list[Floats] = []
    # a plain loop: it runs over the few bubbles with hundreds of corners, the rest is split in one go
    for loop, owner in zip(np.split(places, np.cumsum(sizes)[:-1]), bubble.tolist(), strict=True):
        if len(loop) <= MOST_CORNERS:
            loops.append(loop)
            owners.append(owner)
            continue
        middle = first_new + len(middles)
        middles.append(points[loop].mean(axis=0))
        closed = np.append(loop, loop[0])
        for k in range(0, len(loop), span):
            loops.append(np.append(closed[k : k + span + 1], middle))
            owners.append(owner)
    new_sizes = np.array([len(loop) for loop in loops])
    return np.concatenate(loops), new_sizes, np.array(owners), np.array(middles)


def _lines(form: str, columns: Sequence[NDArray[Any]] | Iterable[NDArray[Any]]) -> str:
    """One line per row, formatted in one call."""
    lists = [column.tolist() for column in columns]
    return (form * len(lists[0])) % tuple(value for row in zip(*lists, strict=True) for value in row)


def _polygon_lines(
    places: Ints, sizes: Ints, columns: list[NDArray[Any]], kinds: list[tuple[str, str]]
) -> str:
    """Corner count, corners and scalars of each face."""
    scalars = "".join(" %.17g" if kind == "double" else " %d" for _, kind in kinds) + "\n"
    tails = _lines(scalars[1:], columns).split("\n")
    heads = (("%d " * len(places)) % tuple(places.tolist())).split(" ")
    ends = np.cumsum(sizes).tolist()
    return "".join(
        f"{size} {' '.join(heads[end - size : end])} {tail}\n"
        for size, end, tail in zip(sizes.tolist(), ends, tails, strict=False)
    )


def _write_view(path: Path, foam: Foam, colours: BubbleColours, curve_points: int, rings: int) -> None:
    patches = bubble_patches(foam, curve_points=curve_points, rings=rings, rim_width=_STRIP)
    fields = [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")]
    fields += [("red", "u1"), ("green", "u1"), ("blue", "u1"), ("quality", "<f4")]
    vertices = np.empty(len(patches.points), dtype=fields)
    normals = foam.cell.surface.normals(patches.points)
    rgb = np.where(patches.point_rim[:, None], as_rgb(FILM_COLOUR), colours.rgb[patches.point_bubble])
    for k, axis in enumerate("xyz"):
        vertices[axis] = patches.points[:, k]
        vertices["n" + axis] = normals[:, k]
    for k, name in enumerate(("red", "green", "blue")):
        vertices[name] = rgb[:, k]
    vertices["quality"] = colours.values[patches.point_bubble]
    faces = np.empty(len(patches.triangles), dtype=[("count", "u1"), ("corners", "<i4", (3,))])
    faces["count"] = 3
    faces["corners"] = patches.triangles
    header = (
        "ply\n"
        "format binary_little_endian 1.0\n"
        f"comment bubbles of a foam coloured by {colours.name}, written by warpedfoam\n"
        f"element vertex {len(vertices)}\n"
        + "".join(f"property {'float' if kind == '<f4' else 'uchar'} {name}\n" for name, kind in fields)
        + f"element face {len(faces)}\n"
        "property list uchar int vertex_indices\n"
        "end_header\n"
    )
    with atomic_binary(path) as stream:
        stream.write(header.encode("ascii"))
        stream.write(vertices.tobytes())
        stream.write(faces.tobytes())
