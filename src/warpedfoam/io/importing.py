"""Foams from someone else's cell network: polygons that cover a surface."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Bools, Floats, Ints, as_indices, as_instance, as_integer, as_number, as_points
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import FileFormatError, TopologyError
from warpedfoam.foam import MAX_ORDER, Foam, bubble_integrals
from warpedfoam.io.atomic import PathLike, as_path
from warpedfoam.io.evolver_polygons import evolver_polygons
from warpedfoam.io.polygon_files import Polygons, obj_polygons, ply_polygons
from warpedfoam.io.reading import brief, existing
from warpedfoam.io.welding import welded, without_repeats
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.network import CellNetwork, network_from_loops

#: Steps of the fit of films to their points, and its smallest change worth another.
_FIT_STEPS, _FIT_CHANGE = 12, 1e-14
#: In sizes of the surface, how far a point may be to be looked at.
_FAR = 1e9


def import_polygons(
    source: PathLike | tuple[ArrayLike, Sequence[Sequence[int]]],
    cell: HeleShawCell,
    *,
    order: int = 4,
    tolerance: float = 0.05,
    weld: float = 1e-6,
    exterior: int | str | None = None,
) -> Foam:
    """Foam whose bubbles are the polygons of a cell network that was made elsewhere.

    Points where three polygons meet become vertices, the points between them give films their shapes: the
    offsets of each film are fitted to its points by least squares. Polygons that run clockwise, seen from
    the gap, are turned round. Where a surface repeats in space points and their images are one. Where it
    has a rim edges along it are walls, and films end on it.

    Parameters
    ----------
    source : str, path, or (points, polygons)
        A PLY or OBJ file, a string model of `write_fe` or a dump that the Surface Evolver made of it, or
        an (n, 3) array and sequences of its rows, one per bubble.
    cell : HeleShawCell
        Its inner plate is the surface that the polygons cover.
    order : int, optional
        Polynomial order p of the films.
    tolerance : float, optional
        How far points may lie from the surface, in units of the bubble size; they are projected.
    weld : float, optional
        Points closer than that, in units of the bubble size, are one.
    exterior : int or "holes", optional
        The polygon that is the exterior of open clusters, or that all which the polygons leave open is: it
        becomes the last bubble. Its pressure is 0.

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
        If the polygons are no foam: an edge off the rim with a polygon on one side only and no exterior
        beyond it, a vertex where more than three meet, another Euler characteristic than the surface's.
    ValueError
        If points lie too far from the surface, are not finite, or are named that do not exist.

    Notes
    -----
    A bubble cut into several polygons (as `write_ply` does beyond 255 corners) comes back as several.
    Vertices where only two films meet are told from other points in files of `write_ply` and `write_obj`
    only; elsewhere the films on either side become one, which wants a higher ``order`` if it is long.

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
    if isinstance(exterior, str) and exterior != "holes":
        raise ValueError(f"exterior must be the place of a polygon, 'holes' or None, got {exterior!r}")
    if isinstance(source, tuple):
        if len(source) != 2:
            raise TypeError(f"source must be a path or (points, polygons), got a tuple of {len(source)}")
        return _foam(cell, source[0], source[1], 0, p, allowed, close, exterior, chords=False)
    path = existing(as_path(source, "source"))
    try:
        chords = path.suffix.lower() in (".fe", ".dmp")
        return _foam(cell, *_read(path, cell), p, allowed, close, exterior, chords=chords)
    except (FileFormatError, TopologyError) as fault:
        raise type(fault)(f"cannot import {path}: {brief(fault)}") from None


def _read(path: Path, cell: HeleShawCell) -> Polygons:
    kind, data = path.suffix.lower(), path.read_bytes()
    if kind == ".ply":
        points, polygons, vertices = ply_polygons(data)
    elif kind == ".obj":
        points, polygons, vertices = obj_polygons(data)
    elif kind in (".fe", ".dmp"):
        points, polygons, vertices = evolver_polygons(data, cell.surface.rim)
    else:
        raise ValueError(f"source must be a .ply, .obj, .fe or .dmp file, got {path.name!r}")
    if not len(points) or not polygons:
        raise FileFormatError("it holds no polygons")
    if not np.isfinite(points).all():
        raise FileFormatError("it holds points that are not finite")
    if any(len(polygon) < 3 for polygon in polygons):
        bad = next(k for k, polygon in enumerate(polygons) if len(polygon) < 3)
        raise FileFormatError(f"polygon {bad} has {len(polygons[bad])} corners; it needs three")
    if any(not 0 <= k < len(points) for polygon in polygons for k in polygon):
        raise FileFormatError(f"a polygon names a point that is not one of its {len(points)}")
    return points, polygons, min(vertices, len(points))


def _foam(
    cell: HeleShawCell,
    points: ArrayLike,
    polygons: Sequence[Sequence[int]],
    vertices: int,
    order: int,
    tolerance: float,
    weld: float,
    exterior: int | str | None,
    *,
    chords: bool,
) -> Foam:
    x = as_points(points, "points")
    holes = exterior == "holes"
    if len(polygons) < 2 - holes:
        raise TopologyError(f"polygons must be two at least, got {len(polygons)}")
    loops = [
        as_indices(np.asarray(polygon), f"polygons[{i}]", (None,), below=len(x))
        for i, polygon in enumerate(polygons)
    ]
    unit = float(np.sqrt(cell.surface.area / len(loops)))
    on = _projected(cell, x, np.unique(np.concatenate(loops)), tolerance * unit)
    merged = welded(on, weld * unit, cell.surface.period)
    sizes = np.array([len(loop) for loop in loops])
    corners = merged[np.concatenate(loops)]
    corners, sizes = without_repeats(corners, sizes)
    if (sizes < 3).any():
        bad = int(np.flatnonzero(sizes < 3)[0])
        raise TopologyError(f"polygon {bad} has {int(sizes[bad])} different corners; it needs three")
    marked = np.zeros(len(x), dtype=bool)
    marked[merged[:vertices]] = True
    used, corners = np.unique(corners, return_inverse=True)
    on, marked = on[used], marked[used]
    if _turned(cell, on, corners, sizes):
        corners = np.concatenate([ring[::-1] for ring in np.split(corners, np.cumsum(sizes)[:-1])])
    corners, sizes, on, kept = _rimmed(cell, corners, sizes, on, tolerance * unit)
    marked = marked[kept]
    rings = [ring.tolist() for ring in np.split(corners, np.cumsum(sizes)[:-1])]
    if holes:
        rings += _holes(cell, corners, sizes, on)
    _check_degrees(rings, on, _on_rim(cell, on))
    network = network_from_loops(rings, rims=cell.surface.rim is not None)
    place = exterior if isinstance(exterior, int) else None
    if holes:
        place = len(sizes)
        if network.n_bubbles == place:
            raise TopologyError("the polygons leave no hole for an exterior")
        network = _one_exterior(network, place, cell.surface.euler_characteristic)
    chi = cell.surface.euler_characteristic
    if network.euler_characteristic != chi:
        raise TopologyError(
            f"the polygons close a surface of Euler characteristic {network.euler_characteristic}, "
            f"the cell's has {chi}"
        )
    short, heads, films, inner, places = _merged(network, marked)
    tails_at, heads_at = on[heads[:, 0]], on[heads[:, 1]]
    offsets = _fitted(cell, tails_at, heads_at, films, on[inner], places, order)
    if chords:
        # those of the Evolver cut off 1/n² of the area under a parabola, so that its points lie farther out
        offsets *= 1.0 - (np.bincount(films, minlength=len(heads))[:, None] + 1.0) ** -2.0
    ends = on[np.unique(heads)]
    volumes = _volumes(cell, short, ends, offsets, place)
    return Foam(cell, short, ends, offsets, volumes, exterior=place)


def _volumes(
    cell: HeleShawCell, network: CellNetwork, points: Floats, offsets: Floats, exterior: int | None
) -> Floats:
    """The bubbles' volumes, made to add up: their quadrature has an error, or an exterior has the rest."""
    volumes = bubble_integrals(cell, network, points, offsets, cell.layer)
    if exterior is not None:
        volumes[exterior] = 0.0
        volumes[exterior] = cell.volume - volumes.sum()
    total = float(volumes.sum())
    if not abs(total - cell.volume) <= cell.surface.precision * cell.volume:
        raise TopologyError(
            f"the polygons cover {total / cell.volume:.6g} times the cell's volume; they must cover the "
            "surface once, without folds"
        )
    if not (volumes > 0.0).all():
        bad = int(np.argmin(volumes))
        raise TopologyError(f"polygon {bad} has the volume {volumes[bad]:.3g}; it is empty or inside out")
    out: Floats = volumes * (cell.volume / total)
    return out


def _lonely(corners: Ints, sizes: Ints, count: int) -> tuple[Ints, Bools]:
    """The corner after each, and whether no polygon runs the other way along the edge to it."""
    starts = np.cumsum(sizes) - sizes
    after = np.arange(len(corners)) + 1
    after[starts + sizes - 1] = starts
    forth = corners * count + corners[after]
    return after, ~np.isin(forth, corners[after] * count + corners)


def _rimmed(
    cell: HeleShawCell, corners: Ints, sizes: Ints, on: Floats, allowed: float
) -> tuple[Ints, Ints, Floats, Ints]:
    """Polygons without the points along walls, where no film ends; points with the ends on the rim.

    The last array holds the places that the points had.
    """
    rim = cell.surface.rim
    if rim is None:
        return corners, sizes, on, np.arange(len(on))
    after, alone = _lonely(corners, sizes, len(on))
    moved = rim.nearest(on)
    near = np.linalg.norm(moved - on, axis=1) <= allowed
    wall = alone & near[corners] & near[corners[after]]
    before = np.empty(len(after), dtype=np.int64)
    before[after] = np.arange(len(after))
    keep = ~(wall & wall[before])
    ends = np.unique(np.concatenate([corners[wall], corners[after[wall]]]))
    on = on.copy()
    on[ends] = moved[ends]
    owner = np.repeat(np.arange(len(sizes)), sizes)
    corners, sizes = corners[keep], np.bincount(owner[keep], minlength=len(sizes))
    if (sizes < 2).any():
        bad = int(np.flatnonzero(sizes < 2)[0])
        raise TopologyError(f"polygon {bad} has walls only, or one film end: no foam has such a bubble")
    used, corners = np.unique(corners, return_inverse=True)
    return corners, sizes, on[used], used


def _on_rim(cell: HeleShawCell, on: Floats) -> Bools:
    """Which points lie on the rim."""
    rim = cell.surface.rim
    if rim is None:
        return np.zeros(len(on), dtype=bool)
    out: Bools = np.linalg.norm(rim.nearest(on) - on, axis=1) <= 1e-9 * cell.surface.size
    return out


def _holes(cell: HeleShawCell, corners: Ints, sizes: Ints, on: Floats) -> list[list[int]]:
    """Loops round what the polygons leave open, seen from there; edges between rim points are walls."""
    after, alone = _lonely(corners, sizes, len(on))
    ends = _on_rim(cell, on)
    alone &= ~(ends[corners] & ends[corners[after]])
    onward = dict(zip(corners[after[alone]].tolist(), corners[alone].tolist(), strict=True))
    if len(onward) != int(alone.sum()):
        raise TopologyError("two holes between the polygons share a point; split it into two")
    out: list[list[int]] = []
    while onward:
        first, at = next(iter(onward.items()))
        ring = [first]
        while at != first:
            ring.append(at)
            if at not in onward:
                raise TopologyError("a hole between the polygons ends on the rim; close it along the rim")
            at = onward.pop(at)
        onward.pop(first, None)
        out.append(ring)
    return out


def _one_exterior(network: CellNetwork, place: int, chi: int) -> CellNetwork:
    """The bubbles from ``place`` on as one, with the Euler characteristic that is left for it."""
    bubble = np.minimum(network.bubble, place)
    euler = np.ones(place + 1, dtype=np.int64)
    euler[place] = chi - (network.euler_characteristic - (network.n_bubbles - place))
    return CellNetwork(network.next, network.origin, bubble, euler)


def _projected(cell: HeleShawCell, points: Floats, used: Ints, allowed: float) -> Floats:
    """Points on the surface; those that no polygon names stay where they are."""
    out = points.copy()
    # squares of such numbers overflow, and no image of a point is that far away
    far = np.flatnonzero(np.abs(points[used]).max(axis=1) > _FAR * cell.surface.size)
    if far.size:
        k = int(used[far[0]])
        raise ValueError(f"points must lie on the cell's surface, but point {k} is at {points[k].tolist()}")
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


def _check_degrees(rings: Sequence[Sequence[int]], points: Floats, on_rim: Bools) -> None:
    sizes = np.array([len(ring) for ring in rings])
    corners = np.concatenate([np.asarray(ring) for ring in rings])
    starts = np.cumsum(sizes) - sizes
    after = np.arange(len(corners)) + 1
    after[starts + sizes - 1] = starts
    ends = np.sort(np.stack([corners, corners[after]], axis=1), axis=1)
    keys, count = np.unique(ends, axis=0, return_counts=True)
    # once along a wall
    bad_edge = (count != 2) & ~((count == 1) & on_rim[keys].all(axis=1))
    if bad_edge.any():
        a, b = keys[np.flatnonzero(bad_edge)[0]].tolist()
        raise TopologyError(
            f"the edge from {points[a].round(6).tolist()} to {points[b].round(6).tolist()} has "
            f"{int(count[bad_edge][0])} polygons beside it; the polygons must close the surface, two at "
            "every edge (exterior='holes' if they are open clusters)"
        )
    degree = np.bincount(keys.ravel(), minlength=len(points))
    if ((degree != 2) & (degree != 3)).any():
        bad = int(np.flatnonzero((degree != 2) & (degree != 3))[0])
        raise TopologyError(
            f"{int(degree[bad])} edges meet at {points[bad].round(6).tolist()}; in a foam three do. "
            "Split the point into points of three, a short edge apart"
        )


def _merged(network: CellNetwork, marked: Bools) -> tuple[CellNetwork, Ints, Ints, Ints, Ints]:
    """The network without its markers, but for those that are ``marked``.

    Returns
    -------
    network : CellNetwork
    ends : (n_films, 2) array of int
        The old vertices where each film starts and ends.
    films, inner, places : (m,) arrays of int
        Film, old vertex, and place along the film (from 1) of each point between.
    """
    corner = (network.vertex_degrees != 2) | marked
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
