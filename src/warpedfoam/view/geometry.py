"""Triangles and lines of one foam as the viewer draws them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.foam import Foam
from warpedfoam.io.patches import bubble_patches, film_points

#: What lies on the other side of a line: a wall has nothing there, and where a surface repeats
#: every bubble has its own images of its films.
WALL, OWN_IMAGE = -1, -2


@dataclass(frozen=True, eq=False)
class Geometry:
    """What is drawn of a foam.

    Attributes
    ----------
    points, normals : (n, 3) arrays
        On the surface.
    sunk : (n,) array
        How far below the surface each point is to be drawn, so that its neighbours' patches hide it.
    owner : (n,) array of int
        Bubble (its place) of each point.
    curvature : (n,) array
        Gaussian curvature at the points.
    triangles : (m, 3) array of int
        Counter-clockwise seen from outside.
    line_points, line_normals : (k, 3) arrays
        Along films and walls.
    segments : (s, 2) array of int
        Pieces of films and walls, as places in ``line_points``.
    beside : (s, 2) array of int
        Bubbles left and right of each piece; `WALL` or `OWN_IMAGE` on the right where there is none.
    """

    points: Floats
    normals: Floats
    sunk: Floats
    owner: Ints
    curvature: Floats
    triangles: Ints
    line_points: Floats
    line_normals: Floats
    segments: Ints
    beside: Ints


def detail(n_bubbles: int, n_frames: int = 1) -> tuple[int, int]:
    """Segments of each film and rings of each bubble: finer where a bubble is large in the picture.

    Examples
    --------
    >>> detail(12), detail(200), detail(2000)
    ((24, 10), (8, 4), (4, 2))
    """
    count = n_bubbles * np.sqrt(n_frames)
    for most, segments, rings in ((20, 24, 10), (100, 12, 6), (300, 8, 4), (1000, 6, 3)):
        if count <= most:
            return segments, rings
    return 4, 2


def geometry(foam: Foam, segments: int, rings: int) -> Geometry:
    """Patches of the bubbles, films and walls in pieces."""
    surface = foam.cell.surface
    patches = bubble_patches(foam, curve_points=segments + 1, rings=rings)
    points, sunk = patches.points, np.zeros(len(patches.points))
    low = np.isin(patches.point_bubble, patches.sunk)
    if low.any():
        # the page sinks them away from whoever looks, and both faces of an open surface may be looked at
        points = points.copy()
        points[low] = surface.project(points[low])
        sunk[low] = np.linalg.norm(points[low] - patches.points[low], axis=1)
    lines, pieces, beside = _films(foam, segments)
    if len(foam.walls.bubble):
        more, wall_pieces, wall_beside = _walls(foam, segments)
        pieces = np.concatenate([pieces, wall_pieces + len(lines)])
        lines, beside = np.concatenate([lines, more]), np.concatenate([beside, wall_beside])
    return Geometry(
        points,
        surface.normals(points),
        sunk,
        patches.point_bubble,
        surface.gaussian_curvature(points),
        patches.triangles,
        lines,
        surface.normals(lines),
        pieces,
        beside,
    )


def _films(foam: Foam, segments: int) -> tuple[Floats, Ints, Ints]:
    network = foam.network
    if foam.loop_shifts is None:
        along = film_points(foam, segments + 1)
        points, chains = along.points, along.chains
        beside = np.stack([network.left, network.right], axis=1)
    else:
        # a bubble that reaches over the edge of the unit is drawn whole, with its own images of its films
        halves = network.loops.halves
        curves = foam.film_curves(segments + 1)[halves >> 1] + foam.loop_shifts[:, None]
        points = curves.reshape(-1, 3)
        chains = np.arange(len(points)).reshape(len(halves), segments + 1)
        beside = np.stack([network.bubble[halves], np.full(len(halves), OWN_IMAGE)], axis=1)
    pieces = np.stack([chains[:, :-1].ravel(), chains[:, 1:].ravel()], axis=1)
    return points, pieces, np.repeat(beside, segments, axis=0)


def _walls(foam: Foam, segments: int) -> tuple[Floats, Ints, Ints]:
    walls = foam.walls
    inner, wall = foam.wall_points(segments)
    n = len(walls.bubble)
    points = np.concatenate([foam.vertex_points[walls.tails], inner, foam.vertex_points[walls.heads]])
    owner = np.concatenate([np.arange(n), wall, np.arange(n)])
    # along each wall: its tail, the points between in their order, its head
    rank = np.concatenate([np.full(n, -1), np.arange(len(inner)), np.full(n, len(inner))])
    order = np.lexsort((rank, owner))
    joined = owner[order[1:]] == owner[order[:-1]]
    pieces = np.stack([order[:-1][joined], order[1:][joined]], axis=1)
    bubble = walls.bubble[owner[pieces[:, 0]]]
    return points, pieces, np.stack([bubble, np.full(len(pieces), WALL)], axis=1)
