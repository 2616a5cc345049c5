"""Foams from someone else's cell network: polygons that cover a surface."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from warpedfoam.arrays import Floats, Ints, as_indices, as_instance, as_integer, as_number, as_points
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import FileFormatError, TopologyError
from warpedfoam.foam import MAX_ORDER, Foam, bubble_integrals
from warpedfoam.io.atomic import PathLike, as_path
from warpedfoam.io.polygon_files import obj_polygons, ply_polygons
from warpedfoam.io.reading import existing
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.network import CellNetwork, network_from_loops
from warpedfoam.surfaces.places import Places

#: Steps of the fit of films to their points, and its smallest change worth another.
_FIT_STEPS, _FIT_CHANGE = 12, 1e-14


def import_polygons(
    source: PathLike | tuple[ArrayLike, Sequence[Sequence[int]]],
    cell: HeleShawCell,
    *,
    order: int = 4,
    tolerance: float = 0.05,
    weld: float = 1e-6,
) -> Foam:
    """Foam whose bubbles are the polygons of a cell network that was made elsewhere.

    Points where three polygons meet become vertices, the points between them give films their shapes: the
    offsets of each film are fitted to its points by least squares. Polygons that run clockwise, seen from
    the gap, are turned round. Where a surface repeats in space points and their images are one.

    Parameters
    ----------
    source : str, path, or (points, polygons)
        A PLY or OBJ file, or an (n, 3) array and sequences of its rows, one per bubble.
    cell : HeleShawCell
        Its inner plate is the surface that the polygons cover.
    order : int, optional
        Polynomial order p of the films.
    tolerance : float, optional
        How far points may lie from the surface, in units of the bubble size; they are projected.
    weld : float, optional
        Points closer than that, in units of the bubble size, are one.

    Returns
    -------
    Foam
        Bubble i is polygon i; the target volumes are the present ones.

    Raises
    ------
    TypeError
        If an argument is of the wrong type.
    FileNotFoundError
        If there is no such file.
    FileFormatError
        If the file cannot be read.
    TopologyError
        If the polygons are no foam: an edge with a polygon on one side only, a vertex where more than three
        meet, another Euler characteristic than the surface's.
    ValueError
        If points lie too far from the surface, are not finite, or are named that do not exist.

    Notes
    -----
    A bubble cut into several polygons (as `write_ply` does beyond 255 corners) comes back as several.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> foam = import_polygons((points, loops), HeleShawCell(Sphere(3**0.5), gap=0.1))
    >>> foam.n_bubbles, foam.network.charges.tolist()
    (4, [3, 3, 3, 3])
    """
    as_instance(cell, "cell", HeleShawCell)
    p = as_integer(order, "order", minimum=2, maximum=MAX_ORDER)
    allowed = as_number(tolerance, "tolerance", minimum=0.0)
    close = as_number(weld, "weld", minimum=0.0)
    if isinstance(source, tuple):
        if len(source) != 2:
            raise TypeError(f"source must be a path or (points, polygons), got a tuple of {len(source)}")
        return _foam(cell, source[0], source[1], p, allowed, close)
    path = existing(as_path(source, "source"))
    try:
        return _foam(cell, *_read(path), p, allowed, close)
    except (FileFormatError, TopologyError) as fault:
        raise type(fault)(f"cannot import {path}: {fault}") from None


def _read(path: Path) -> tuple[Floats, list[list[int]]]:
    kind, data = path.suffix.lower(), path.read_bytes()
    if kind == ".ply":
        points, polygons = ply_polygons(data)
    elif kind == ".obj":
        points, polygons = obj_polygons(data)
    else:
        raise ValueError(f"source must be a .ply or .obj file, got {path.name!r}")
    if not len(points) or not polygons:
        raise FileFormatError("it holds no polygons")
    if not np.isfinite(points).all():
        raise FileFormatError("it holds points that are not finite")
    if any(not 0 <= k < len(points) for polygon in polygons for k in polygon):
        raise FileFormatError(f"a polygon names a point that is not one of its {len(points)}")
    return points, polygons


def _foam(
    cell: HeleShawCell,
    points: ArrayLike,
    polygons: Sequence[Sequence[int]],
    order: int,
    tolerance: float,
    weld: float,
) -> Foam:
    x = as_points(points, "points")
    if len(polygons) < 2:
        raise TopologyError(f"polygons must be two at least, got {len(polygons)}")
    loops = [
        as_indices(np.asarray(polygon), f"polygons[{i}]", (None,), below=len(x))
        for i, polygon in enumerate(polygons)
    ]
    unit = float(np.sqrt(cell.surface.area / len(loops)))
    on = _projected(cell, x, np.unique(np.concatenate(loops)), tolerance * unit)
    merged = _welded(on, weld * unit, cell.surface.period)
    sizes = np.array([len(loop) for loop in loops])
    corners = merged[np.concatenate(loops)]
    corners, sizes = _without_repeats(corners, sizes)
    if (sizes < 3).any():
        bad = int(np.flatnonzero(sizes < 3)[0])
        raise TopologyError(f"polygon {bad} has {int(sizes[bad])} different corners; it needs three")
    used, corners = np.unique(corners, return_inverse=True)
    on = on[used]
    rings = np.split(corners, np.cumsum(sizes)[:-1])
    if _turned(cell, on, corners, sizes):
        rings = [ring[::-1] for ring in rings]
    _check_degrees(corners, sizes, on)
    network = network_from_loops([ring.tolist() for ring in rings])
    chi = cell.surface.euler_characteristic
    if network.euler_characteristic != chi:
        raise TopologyError(
            f"the polygons close a surface of Euler characteristic {network.euler_characteristic}, "
            f"the cell's has {chi}"
        )
    short, heads, films, inner, places = _merged(network)
    tails_at, heads_at = on[heads[:, 0]], on[heads[:, 1]]
    offsets = _fitted(cell, tails_at, heads_at, films, on[inner], places, order)
    kept = np.unique(heads)
    return Foam(cell, short, on[kept], offsets, _volumes(cell, short, on[kept], offsets))


def _volumes(cell: HeleShawCell, network: CellNetwork, points: Floats, offsets: Floats) -> Floats:
    """The bubbles' volumes, made to add up: their quadrature has an error."""
    volumes = bubble_integrals(cell, network, points, offsets, cell.layer)
    total = float(volumes.sum())
    if (network.bubble_euler == 1).all() and not abs(total - cell.volume) <= (
        cell.surface.precision * cell.volume
    ):
        raise TopologyError(
            f"the polygons cover {total / cell.volume:.6g} times the cell's volume; they must cover the "
            "surface once, without folds"
        )
    if not (volumes > 0.0).all():
        bad = int(np.argmin(volumes))
        raise TopologyError(f"polygon {bad} has the volume {volumes[bad]:.3g}; it is empty or inside out")
    out: Floats = volumes * (cell.volume / total)
    return out


def _projected(cell: HeleShawCell, points: Floats, used: Ints, allowed: float) -> Floats:
    """Points on the surface; those that no polygon names stay where they are."""
    out = points.copy()
    try:
        out[used] = cell.surface.project(points[used])
    except ValueError as fault:
        raise ValueError(f"points must lie on the cell's surface: {fault}") from None
    away = np.linalg.norm(out[used] - points[used], axis=1)
    worst = int(away.argmax())
    if not away[worst] <= allowed:
        raise ValueError(
            f"points must lie on the cell's surface, but point {int(used[worst])} is {away[worst]:.3g} away "
            f"and {allowed:.3g} is allowed; choose the surface that fits or a larger tolerance"
        )
    return out


def _welded(points: Floats, distance: float, period: Floats | None) -> Ints:
    """The first point at the place of each point."""
    pairs = Places(points, period).pairs(distance)
    n = len(points)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    first = np.full(int(label.max()) + 1, n)
    np.minimum.at(first, label, np.arange(n))
    out: Ints = first[label]
    return out


def _without_repeats(corners: Ints, sizes: Ints) -> tuple[Ints, Ints]:
    """Polygons without corners that repeat the one before."""
    starts = np.cumsum(sizes) - sizes
    before = np.arange(len(corners)) - 1
    before[starts] = starts + sizes - 1
    keep = corners != corners[before]
    loop = np.repeat(np.arange(len(sizes)), sizes)
    return corners[keep], np.bincount(loop[keep], minlength=len(sizes))


def _turned(cell: HeleShawCell, points: Floats, corners: Ints, sizes: Ints) -> bool:
    """Whether most polygons run clockwise seen from the gap."""
    starts = np.cumsum(sizes) - sizes
    first = np.repeat(points[corners[starts]], sizes, axis=0)
    arm = nearest_image(points[corners] - first, cell.surface.period)
    after = np.arange(len(corners)) + 1
    after[starts + sizes - 1] = starts
    vector = np.add.reduceat(np.cross(arm, arm[after]), starts, axis=0)
    normal = np.add.reduceat(cell.surface.normals(points)[corners], starts, axis=0)
    return bool(np.sign(np.einsum("nx,nx->n", vector, normal)).sum() < 0.0)


def _check_degrees(corners: Ints, sizes: Ints, points: Floats) -> None:
    starts = np.cumsum(sizes) - sizes
    after = np.arange(len(corners)) + 1
    after[starts + sizes - 1] = starts
    ends = np.sort(np.stack([corners, corners[after]], axis=1), axis=1)
    keys, count = np.unique(ends, axis=0, return_counts=True)
    if (count != 2).any():
        a, b = keys[np.flatnonzero(count != 2)[0]].tolist()
        raise TopologyError(
            f"the edge from {points[a].round(6).tolist()} to {points[b].round(6).tolist()} has "
            f"{int(count[count != 2][0])} polygons beside it; the polygons must close the surface, two at "
            "every edge"
        )
    degree = np.bincount(keys.ravel(), minlength=len(points))
    if ((degree != 2) & (degree != 3)).any():
        bad = int(np.flatnonzero((degree != 2) & (degree != 3))[0])
        raise TopologyError(
            f"{int(degree[bad])} edges meet at {points[bad].round(6).tolist()}; in a foam three do. "
            "Split the point into points of three, a short edge apart"
        )


def _merged(network: CellNetwork) -> tuple[CellNetwork, Ints, Ints, Ints, Ints]:
    """The network without its markers.

    Returns
    -------
    network : CellNetwork
    ends : (n_films, 2) array of int
        The old vertices where each film starts and ends.
    films, inner, places : (m,) arrays of int
        Film, old vertex, and place along the film (from 1) of each point between.
    """
    corner = network.vertex_degrees == 3
    halves = len(network.next)
    start = corner[network.origin]
    lonely = np.ones(network.n_bubbles, dtype=bool)
    lonely[network.bubble[start]] = False
    if lonely.any():
        # a film that closes on itself keeps its points as markers
        corner = corner | np.isin(np.arange(network.n_vertices), network.origin[lonely[network.bubble]])
        start = corner[network.origin]
    # walk each half-film along its markers until a corner is reached
    last = np.arange(halves)
    films_of: list[Ints] = []
    inner_of: list[Ints] = []
    place_of: list[Ints] = []
    live = np.flatnonzero(start)
    owner = live.copy()
    for place in range(1, halves + 1):
        head = network.origin[live ^ 1]
        going = ~corner[head]
        last[owner[~going]] = live[~going]
        live, owner = network.next[live[going]], owner[going]
        if not live.size:
            break
        films_of.append(owner)
        inner_of.append(network.origin[live])
        place_of.append(np.full(len(live), place))
    first = np.flatnonzero(start)
    twin = last[first] ^ 1  # the half-film that runs back
    lead = first < twin
    film = np.empty(halves, dtype=np.int64)
    film[first[lead]] = 2 * np.arange(int(lead.sum()))
    film[twin[lead]] = film[first[lead]] + 1
    number = np.cumsum(corner) - 1
    following, origin, bubble = (np.empty(len(first), dtype=np.int64) for _ in range(3))
    following[film[first]] = film[network.next[last[first]]]
    origin[film[first]] = number[network.origin[first]]
    bubble[film[first]] = network.bubble[first]
    short = CellNetwork(following, origin, bubble, network.bubble_euler)
    leading = first[lead]
    ends = np.stack([network.origin[leading], network.origin[last[leading] ^ 1]], axis=1)
    if films_of:
        owner, inner, places = (np.concatenate(c) for c in (films_of, inner_of, place_of))
        mine = np.isin(owner, leading)
        return short, ends, film[owner[mine]] >> 1, inner[mine], places[mine]
    none = np.zeros(0, dtype=np.int64)
    return short, ends, none, none, none


def _fitted(
    cell: HeleShawCell, tail: Floats, head: Floats, film: Ints, points: Floats, place: Ints, order: int
) -> Floats:
    """Offsets (n_films, p − 1) of films through points: Gauss and Newton's method for all films at once.

    A film with fewer points than offsets takes the smallest offsets that fit.
    """
    surface, count, p = cell.surface, len(tail), order - 1
    offsets = np.zeros((count, p))
    if not len(film):
        return offsets
    head = tail + nearest_image(head - tail, surface.period)
    offsets = surface.arc_fit(tail, head, film, points, order)
    rule = lobatto(24)
    many = np.bincount(film, minlength=count)
    xi = place / (many[film] + 1.0)
    step = 1e-6
    for _ in range(_FIT_STEPS):
        nodes = surface.arc_points(tail, head, offsets, rule.nodes)
        at, ahead = _along(rule, nodes, film, xi)
        away = nearest_image(points - at, surface.period)
        # the nearest place on the film, then what remains across it
        square = np.einsum("nx,nx->n", ahead, ahead)
        xi = np.clip(xi + np.einsum("nx,nx->n", away, ahead) / square, 0.0, 1.0)
        at, ahead = _along(rule, nodes, film, xi)
        away = nearest_image(points - at, surface.period)
        slopes = np.empty((len(film), 3, p))
        for k in range(p):
            moved = offsets.copy()
            moved[:, k] += step
            slopes[:, :, k] = (
                _along(rule, surface.arc_points(tail, head, moved, rule.nodes), film, xi)[0] - at
            ) / step
        unit = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
        slopes -= unit[:, :, None] * np.einsum("nx,nxk->nk", unit, slopes)[:, None]
        size = np.linalg.norm(head - tail, axis=1)
        normal, right = np.zeros((count, p, p)), np.zeros((count, p))
        np.add.at(normal, film, np.einsum("nxk,nxl->nkl", slopes, slopes))
        np.add.at(right, film, np.einsum("nxk,nx->nk", slopes, away))
        scale = np.maximum(size, 1e-300) ** 2
        change = np.einsum(
            "fkl,fl->fk",
            np.linalg.pinv(normal / scale[:, None, None], rcond=1e-11, hermitian=True),
            right / scale[:, None],
        )
        offsets = offsets + change
        if np.abs(change).max() < _FIT_CHANGE:
            break
    return offsets


def _along(rule: object, nodes: Floats, film: Ints, xi: Floats) -> tuple[Floats, Floats]:
    """Points (n, 3) of films at parameters of their own, and derivatives there."""
    weights = rule.interpolation(xi)  # type: ignore[attr-defined]
    slopes = weights @ rule.derivative  # type: ignore[attr-defined]
    mine = nodes[film]
    return np.einsum("nk,nkx->nx", weights, mine), np.einsum("nk,nkx->nx", slopes, mine)
