"""Planar layouts of clusters: patches of cells with films between them and an outside, in unit cells.

A layout is the Voronoi diagram of the bubbles' centres and of *ghosts* all round them; the ghosts' cells
merge into the outside. Lengths are such that a hexagonal cell has area 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import Voronoi, cKDTree

from warpedfoam.arrays import Bools, Floats, Ints, frozen

#: Distance of neighbours in a honeycomb of cells of unit area.
SPACING = float(np.sqrt(2.0 / np.sqrt(3.0)))
#: Sweeps of Lloyd's method on a random layout, and how often to draw again if it has holes or parts.
LLOYD, DRAWS = 4, 20
#: The relaxed outer film of a bubble of n sides turns by about (6 − n) times this, in degrees.
TURN_PER_SIDE = 60.0


@dataclass(frozen=True, eq=False)
class Layout:
    """Loops of vertices of a planar cluster.

    Attributes
    ----------
    points : (n_vertices, 2) array
        Threefold vertices and markers; the cluster's middle is the origin.
    loops : tuple of integer arrays
        Vertices round each bubble, counter-clockwise.
    outside : tuple of integer arrays
        The outline, clockwise: the loops of the outside.
    """

    points: Floats
    loops: tuple[Ints, ...]
    outside: tuple[Ints, ...]

    @property
    def n_bubbles(self) -> int:
        """Number of bubbles."""
        return len(self.loops)


def hexagonal_centres(n: int) -> Floats:
    """The ``n`` cells of a honeycomb nearest to a point: the most compact of three choices of the point.

    Round a cell (1, 7, 19, 37 …), round a film's middle (2, 4 …) or round a vertex (3, 12 …).

    Examples
    --------
    >>> hexagonal_centres(7).shape
    (7, 2)
    """
    grid = _lattice(2.0 + np.sqrt(n))
    best, least = grid[:0], np.inf
    for about in ([0.0, 0.0], [0.5 * SPACING, 0.0], [0.5 * SPACING, SPACING / np.sqrt(12.0)]):
        away = np.round(np.linalg.norm(grid - about, axis=1), 9)
        chosen = grid[np.lexsort((np.arctan2(grid[:, 1], grid[:, 0]), away))[:n]]
        chosen = chosen - chosen.mean(axis=0)
        moment = float((chosen**2).sum())
        if moment < least - 1e-9:
            best, least = chosen, moment
    return best


def random_centres(n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """``n`` cells nearest to the middle of a disordered sheet, and the others as ghosts, (m, 2) each."""
    count = 4 * n + 40
    radius = float(np.sqrt(count / np.pi))
    points = radius * np.sqrt(rng.random(count))[:, None] * _unit(2.0 * np.pi * rng.random(count))
    fine = radius * np.sqrt(rng.random(60 * count))[:, None] * _unit(2.0 * np.pi * rng.random(60 * count))
    for _ in range(LLOYD):
        owner = cKDTree(points).query(fine)[1]
        size = np.bincount(owner, minlength=count)
        sums = np.stack([np.bincount(owner, fine[:, k], count) for k in range(2)], axis=1)
        points = np.where(size[:, None] > 0, sums / np.maximum(size, 1)[:, None], points)
    order = np.argsort(np.linalg.norm(points, axis=1))
    return points[order[:n]], points[order[n:]]


def ghosts(centres: Floats) -> Floats:
    """Centres of cells of the outside round given ones: the honeycomb through the first of them, (m, 2)."""
    radius = float(np.linalg.norm(centres, axis=1).max()) + 4.0 * SPACING
    grid = _lattice(radius / SPACING + 2.0) + centres[0]
    away = cKDTree(centres).query(grid)[0]
    out: Floats = grid[(away > 0.7 * SPACING) & (away < 3.5 * SPACING)]
    return out


def along_x(layout: Layout, centres: Floats) -> Layout:
    """The layout turned so that the long axis of its ``centres`` (n, 2) is x, if they have one.

    Examples
    --------
    >>> two = hexagonal_centres(2)
    >>> plan = along_x(planar_layout(two, ghosts(two), 60.0), two)
    >>> middles = np.array([plan.points[loop].mean(axis=0) for loop in plan.loops])
    >>> float(np.ptp(middles[:, 1])) < 1e-12
    True
    """
    size, axes = np.linalg.eigh(centres.T @ centres)
    if size[1] - size[0] <= 1e-9 * size[1]:
        return layout
    x, y = axes[:, 1] if axes[0, 1] > 0.0 or (axes[0, 1] == 0.0 and axes[1, 1] > 0.0) else -axes[:, 1]
    return replace(layout, points=frozen(layout.points @ np.array([[x, -y], [y, x]])))


def planar_layout(centres: Floats, around: Floats, max_turn: float) -> Layout:
    """The layout of given centres (n, 2) and ghosts (m, 2).

    Outer films are divided by markers so that no piece turns by much more than ``max_turn`` degrees once
    relaxed: a film is the graph of a function over its chord, and a long arc none.

    Raises
    ------
    ValueError
        If the cells leave a hole in the cluster or touch at points only.
    """
    n = len(centres)
    diagram = Voronoi(np.concatenate([centres, around]))
    pairs, ends = diagram.ridge_points, np.array([r[:2] for r in diagram.ridge_vertices])
    kept = (pairs.min(axis=1) < n) & (ends.min(axis=1) >= 0)
    corner = diagram.vertices
    # ridges of no length join four cells in a point: one of two topologies is as good as the other
    pairs, ends = pairs[kept], ends[kept]
    side = np.cross(
        np.concatenate([corner[ends[:, 1]] - corner[ends[:, 0]], np.zeros((len(ends), 1))], axis=1),
        np.concatenate([diagram.points[pairs[:, 0]] - corner[ends[:, 0]], np.zeros((len(ends), 1))], axis=1),
    )[:, 2]
    swap = side < 0.0
    pairs = np.where(swap[:, None], pairs[:, ::-1], pairs)
    # directed edges with their cell on the left, and the cell on the right
    left = np.concatenate([pairs[:, 0], pairs[:, 1]])
    right = np.concatenate([pairs[:, 1], pairs[:, 0]])
    start = np.concatenate([ends[:, 0], ends[:, 1]])
    stop = np.concatenate([ends[:, 1], ends[:, 0]])
    edges = {(int(a), int(s)): (int(b), int(e)) for a, b, s, e in zip(left, right, start, stop, strict=True)}
    rings = [_ring(edges, k, n) for k in range(n)]
    return _divided(corner, rings, max_turn)


def _ring(edges: dict[tuple[int, int], tuple[int, int]], cell: int, n: int) -> list[tuple[int, int]]:
    """(vertex, cell on the right of the edge that starts there) round a cell; the outside is −1."""
    own = {s: edges[a, s] for a, s in edges if a == cell}
    first = here = min(own)
    out = []
    while True:
        other, after = own[here]
        out.append((here, other if other < n else -1))
        here = after
        if here == first:
            return out


def _divided(corner: Floats, rings: list[list[tuple[int, int]]], max_turn: float) -> Layout:
    """Vertices between three cells kept, outlines divided evenly by markers."""
    kept: set[int] = set()
    for ring in rings:
        for (_, before), (vertex, after) in zip([ring[-1], *ring[:-1]], ring, strict=True):
            if before != after:
                kept.add(vertex)
    names = {v: i for i, v in enumerate(sorted(kept))}
    points = [corner[v] for v in sorted(kept)]
    loops: list[list[int]] = []
    follow: dict[int, int] = {}
    for ring in rings:
        at = next((i for i, (v, _) in enumerate(ring) if v in kept), 0)
        ring = ring[at:] + ring[:at]
        sides = sum(v in kept for v, _ in ring)
        free = sum(v in kept and other < 0 for v, other in ring)
        loop: list[int] = []
        i = 0
        while i < len(ring):
            vertex, other = ring[i]
            if vertex in kept:
                loop.append(names[vertex])
            j = i + 1
            while j < len(ring) and ring[j][0] not in kept:
                j += 1
            if other < 0:
                line = np.array([corner[v] for v, _ in [*ring[i:j], ring[j % len(ring)]]])
                turn = TURN_PER_SIDE * (6 - sides) / max(free, 1) if sides else 360.0
                pieces = max(1 if sides > 2 else 2, int(np.ceil(turn / max_turn - 1e-9)))
                inner = _along(line, pieces if sides else max(pieces, 3), closed=not sides)
                first = len(loop) - 1 if sides else 0
                loop.extend(range(len(points), len(points) + len(inner)))
                points.extend(inner)
                chain = [*loop[first:], names[ring[j % len(ring)][0]] if sides else loop[0]]
                follow.update(zip(chain[1:], chain[:-1], strict=True))
            i = j
        loops.append(loop)
    outside = []
    while follow:
        first = here = min(follow)
        out = []
        while here in follow:
            out.append(here)
            here = follow.pop(here)
        if here != first:
            raise ValueError("the cells of the layout touch each other at points only")
        outside.append(frozen(np.array(out, dtype=np.int64)))
    return Layout(
        frozen(np.array(points)), tuple(frozen(np.array(x, dtype=np.int64)) for x in loops), tuple(outside)
    )


def _along(line: Floats, pieces: int, *, closed: bool) -> list[Floats]:
    """Points that divide a polyline (k, 2) into even pieces, its ends left out (its start kept if closed)."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.arange(0 if closed else 1, pieces) * (length[-1] / pieces)
    return list(np.stack([np.interp(at, length, line[:, k]) for k in range(2)], axis=1))


def _lattice(rings: float) -> Floats:
    """Honeycomb centres within ``rings`` spacings of the origin, itself one of them."""
    m = int(np.ceil(rings * 1.2)) + 1
    i, j = np.meshgrid(np.arange(-m, m + 1), np.arange(-m, m + 1))
    grid = SPACING * np.stack([i + 0.5 * j, 0.5 * np.sqrt(3.0) * j], axis=-1).reshape(-1, 2)
    inside: Bools = np.linalg.norm(grid, axis=1) <= rings * SPACING + 1e-9
    return grid[inside]


def _unit(angle: Floats) -> Floats:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)
