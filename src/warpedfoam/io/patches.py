"""Bubbles as triangulated patches that lie on the surface, for files and pictures."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints, as_instance, as_integer, as_number, frozen
from warpedfoam.foam import Foam
from warpedfoam.io.remainder import remainder

# Patches of more than this share of the surface get many rings: they bend a lot.
_LARGE = 1.0 / 10.0
_MANY_RINGS = 24
# A fan whose area is off by more than this share covers the wrong side of the surface.
_AREA_TOLERANCE = 0.3


@dataclass(frozen=True, eq=False)
class FilmPoints:
    """Points along the films, each once: the vertices first, then film by film the points between.

    Attributes
    ----------
    points : (n, 3) array
    chains : (n_films, k) array of int
        The points of each film from tail to head.
    """

    points: Floats
    chains: Ints


@dataclass(frozen=True, eq=False)
class Patches:
    """Triangles on the surface; no point is shared by two bubbles.

    Attributes
    ----------
    points : (n, 3) array
    point_bubble : (n,) array of int
        Bubble (its place, not its id) of each point.
    point_rim : (n,) array of bool
        True for the points of the strips along the films.
    triangles : (m, 3) array of int
        Counter-clockwise seen from outside.
    sunk : (k,) array of int
        Bubbles filled by triangles a little below the surface, which reach under their neighbours.
    """

    points: Floats
    point_bubble: Ints
    point_rim: Bools
    triangles: Ints
    sunk: Ints

    @property
    def triangle_bubble(self) -> Ints:
        """Bubble of each triangle, (m,)."""
        return self.point_bubble[self.triangles[:, 0]]

    @property
    def triangle_rim(self) -> Bools:
        """True for the triangles of the strips along the films, (m,)."""
        return self.point_rim[self.triangles[:, 0]]


@dataclass(frozen=True, eq=False)
class _Outline:
    """Boundary points of loops, loop after loop, counter-clockwise."""

    points: Floats
    sizes: Ints
    bubble: Ints

    @property
    def starts(self) -> Ints:
        return np.concatenate([[0], np.cumsum(self.sizes)[:-1]])

    def only(self, keep: Bools) -> _Outline:
        return _Outline(self.points[np.repeat(keep, self.sizes)], self.sizes[keep], self.bubble[keep])


def film_points(foam: Foam, curve_points: int) -> FilmPoints:
    """``curve_points`` points along each film, ends included and shared.

    Raises
    ------
    TypeError, ValueError
        If ``curve_points`` is not an integer of at least 2.
    """
    k = as_integer(curve_points, "curve_points", minimum=2)
    network = foam.network
    between = foam.film_curves(k)[:, 1:-1]
    places = network.n_vertices + np.arange(network.n_films * (k - 2)).reshape(network.n_films, k - 2)
    points = np.concatenate([foam.vertex_points, between.reshape(-1, 3)])
    heads = network.heads
    if foam.cell.surface.period is not None:
        images = foam.film_ends[1] - foam.vertex_points[heads]
        points, heads = _with_images(points, heads, images, foam.bubble_size)
    chains = np.concatenate([network.tails[:, None], places, heads[:, None]], axis=1)
    return FilmPoints(frozen(points), frozen(chains))


def _with_images(points: Floats, places: Ints, shifts: Floats, unit: float) -> tuple[Floats, Ints]:
    """Points and places once those that are shifted are points of their own, each image once."""
    moved = np.flatnonzero(np.abs(shifts).max(axis=1) > 0.01 * unit)
    keys = np.column_stack([places[moved], np.round(shifts[moved] / (0.01 * unit)).astype(np.int64)])
    _, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    out = places.copy()
    out[moved] = len(points) + which.reshape(-1)
    chosen = moved[first]
    return np.concatenate([points, points[places[chosen]] + shifts[chosen]]), out


def loop_points(foam: Foam, along: FilmPoints) -> tuple[Floats, Ints, Ints, Ints]:
    """Points along each boundary loop, counter-clockwise and none twice.

    Returns
    -------
    points : (n, 3) array
        Those of ``along``, and images of them where a surface repeats in space and a loop goes on there.
    places : (m,) array of int
        Points of the loops, loop after loop.
    sizes, bubble : (n_loops,) arrays of int
        Points and bubble of each loop.
    """
    network, chains = foam.network, along.chains
    loops = network.loops
    film, back = loops.halves >> 1, (loops.halves & 1).astype(bool)
    rows = np.where(back[:, None], chains[film, ::-1], chains[film])
    if len(network.walls):
        return _with_walls(foam, along.points, rows)
    rows = rows[:, :-1]
    points, places = along.points, rows.ravel()
    if foam.loop_shifts is not None:
        shifts = np.repeat(foam.loop_shifts, rows.shape[1], axis=0)
        points, places = _with_images(points, places, shifts, foam.bubble_size)
    return points, places, loops.sizes * rows.shape[1], network.bubble[loops.halves[loops.starts]]


def _with_walls(foam: Foam, points: Floats, rows: Ints) -> tuple[Floats, Ints, Ints, Ints]:
    """As `loop_points`, where loops go on along the rim; ``rows`` are the points of their half-films."""
    network, loops = foam.network, foam.network.loops
    on_wall, wall = foam.wall_points(rows.shape[1] - 1)
    n_halves, k = rows.shape
    half = np.full(2 * network.n_films, -1)
    half[loops.halves] = np.arange(n_halves)
    # the last point of a half-film is the first of the next, unless a wall lies between
    before_wall = np.zeros(n_halves, dtype=bool)
    before_wall[half[network.walls]] = True
    keep = np.ones(rows.shape, dtype=bool)
    keep[:, -1] = before_wall
    row, column = np.nonzero(keep)
    places = np.concatenate([rows[keep], len(points) + np.arange(len(on_wall))])
    owner = np.concatenate([row, half[network.walls][wall]])
    rank = np.concatenate([column, k + np.arange(len(on_wall))])
    order = np.lexsort((rank, owner))
    count = np.add.reduceat(np.bincount(owner, minlength=n_halves), loops.starts)
    bubble = network.bubble[loops.halves[loops.starts]]
    return np.concatenate([points, on_wall]), places[order], count, bubble


def bubble_patches(foam: Foam, *, curve_points: int = 9, rings: int = 4, rim_width: float = 0.0) -> Patches:
    """Fill every bubble with rings of triangles between its films and its middle.

    Rays run along the surface from the middle to each boundary point, so the patch bends with the
    surface. What is no disk, or has no middle from which the rays cover it, is filled with triangles
    of the surface's own triangulation, sunk a little below the films.

    Parameters
    ----------
    foam : Foam
    curve_points : int, optional
        Points along each film, at least 2.
    rings : int, optional
        Rings of triangles from the middle to the films, at least 1; large bubbles get more.
    rim_width : float, optional
        Width of a strip along the films, in units of the bubble size; 0 makes none.

    Raises
    ------
    TypeError, ValueError
        Numbers of the wrong kind or out of range.

    Notes
    -----
    O(n_bubbles · sides · curve_points · rings), array operations only.
    """
    as_instance(foam, "foam", Foam)
    n_rings = as_integer(rings, "rings", minimum=1)
    width = as_number(rim_width, "rim_width", minimum=0.0) * foam.bubble_size
    along = film_points(foam, curve_points)
    points, places, sizes, bubble = loop_points(foam, along)
    every = _Outline(points[places], sizes, bubble)
    disk = foam.network.bubble_euler[bubble] == 1
    large = foam.bubble_areas[bubble] > _LARGE * foam.cell.surface.area
    patches: list[Patches] = []
    left = disk
    tries = ((True, ~large, n_rings), (True, disk, _MANY_RINGS), (False, disk, _MANY_RINGS))
    for near, allowed, count in tries:
        tried = left & allowed
        if not tried.any():
            continue
        outline = every.only(tried)
        fan = _fan(foam, outline, _middles(foam, outline, near), count, width)
        good = _covers(foam, fan)
        patches.append(_kept(fan, good))
        left = left & ~(tried & good[bubble])
    unfilled = np.unique(bubble[left | ~disk])
    if unfilled.size:
        nodes, owner, triangles = remainder(foam, unfilled)
        patches.append(Patches(nodes, owner, np.zeros(len(nodes), dtype=bool), triangles, unfilled))
    return _joined(patches)


def _middles(foam: Foam, outline: _Outline, near: bool) -> Floats:
    """A point inside each loop: beside the mean of its boundary, or far along its vector area.

    The vector area of a counter-clockwise loop points to the side that the loop encloses, also where
    that is the larger part of a sphere. The small step keeps the mean off the surface's singular points.
    """
    starts = outline.starts
    following = np.arange(len(outline.points)) + 1
    following[starts + outline.sizes - 1] = starts
    mean = np.add.reduceat(outline.points, starts, axis=0) / outline.sizes[:, None]
    arm = outline.points - np.repeat(mean, outline.sizes, axis=0)
    vector = np.add.reduceat(np.cross(arm, arm[following]), starts, axis=0)
    norm = np.linalg.norm(vector, axis=1, keepdims=True)
    unit = np.where(norm > 0.0, vector / np.where(norm > 0.0, norm, 1.0), [0.6, 0.0, 0.8])
    reach = np.sqrt(foam.bubble_areas[outline.bubble])[:, None]
    return foam.cell.surface.project(mean + (1e-7 if near else 1.0) * reach * unit)


def _fan(foam: Foam, outline: _Outline, middles: Floats, rings: int, width: float) -> Patches:
    """Triangles between each loop's middle and its boundary; points ring by ring."""
    n_loops, n = len(outline.sizes), len(outline.points)
    loop = np.repeat(np.arange(n_loops), outline.sizes)
    starts = outline.starts
    here = np.arange(n)
    after = here + 1
    after[starts + outline.sizes - 1] = starts
    surface = foam.cell.surface
    levels = np.linspace(0.0, 1.0, rings + 1)[1:-1]
    rays = surface.arc_points(middles[loop], outline.points, np.zeros((n, 0)), levels)
    layers = [rays[:, k] for k in range(rings - 1)] + [outline.points]
    if width:
        inward = (layers[-2] if rings > 1 else middles[loop]) - outline.points
        length = np.linalg.norm(inward, axis=1, keepdims=True)
        inward *= np.minimum(width / np.where(length > 0.0, length, 1.0), 0.5)
        edge = surface.project(outline.points + inward)
        # the strip has points of its own, so that a colour ends sharply there
        layers[-1:] = [edge, edge, outline.points]
    offsets = n_loops + n * np.arange(len(layers))
    triangles = [np.stack([loop, offsets[0] + here, offsets[0] + after], axis=1)]
    seam = rings - 1 if width else -1
    for k, (a, b) in enumerate(pairwise(offsets)):
        if k != seam:
            triangles.append(np.stack([a + here, b + here, b + after], axis=1))
            triangles.append(np.stack([a + here, b + after, a + after], axis=1))
    rim = np.zeros(n_loops + n * len(layers), dtype=bool)
    if width:
        rim[offsets[-2] :] = True
    return Patches(
        np.concatenate([middles, *layers]),
        np.concatenate([outline.bubble, np.tile(outline.bubble[loop], len(layers))]),
        rim,
        np.concatenate(triangles),
        outline.bubble[:0],
    )


def _covers(foam: Foam, fan: Patches) -> Bools:
    """Bubbles whose triangles, counted with their orientation, have the bubble's area."""
    a, b, c = (fan.points[fan.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    outward = foam.cell.surface.normals(fan.points)[fan.triangles[:, 1]]
    signed = 0.5 * np.einsum("ti,ti->t", normal, outward)
    total = np.bincount(fan.triangle_bubble, signed, minlength=foam.n_bubbles)
    out: Bools = np.abs(total - foam.bubble_areas) < _AREA_TOLERANCE * foam.bubble_areas
    return out


def _kept(fan: Patches, good: Bools) -> Patches:
    point, triangle = good[fan.point_bubble], good[fan.triangle_bubble]
    if point.all():
        return fan
    place = np.cumsum(point) - 1
    return Patches(
        fan.points[point],
        fan.point_bubble[point],
        fan.point_rim[point],
        place[fan.triangles[triangle]],
        fan.sunk,
    )


def _joined(parts: list[Patches]) -> Patches:
    shift = np.concatenate([[0], np.cumsum([len(p.points) for p in parts])[:-1]])
    return Patches(
        frozen(np.concatenate([p.points for p in parts])),
        frozen(np.concatenate([p.point_bubble for p in parts])),
        frozen(np.concatenate([p.point_rim for p in parts])),
        frozen(np.concatenate([p.triangles + s for p, s in zip(parts, shift, strict=True)])),
        frozen(np.concatenate([p.sunk for p in parts])),
    )
