"""Close holes of few edges in a triangle mesh, each by the best-shaped triangles between its nodes."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.surfaces.mesh import TriangleMesh

#: Holes of more edges are never closed: triangles between far nodes are no surface any more.
MOST_EDGES = 64


def closed_holes(mesh: TriangleMesh, most: int) -> tuple[TriangleMesh, int]:
    """The mesh with every hole of at most ``most`` edges closed, and how many were.

    No node is added or moved. Of all triangulations of a loop the one with the least Σ (a² + b² + c²) over
    its triangles is taken: of triangles of one area the equilateral has the least. Triangles that look
    away from the loop's vector area and chords that are edges of the mesh already are left out; a loop that
    cannot be filled without them stays open.

    Parameters
    ----------
    mesh : TriangleMesh
        That passes `TriangleMesh.require_surface`.
    most : int
        At most 64.
    """
    new = []
    if any(3 <= len(loop) <= most for loop in mesh.rim_loops):
        edges = {(int(a), int(b)) for a, b in mesh.edges}
        for loop in mesh.rim_loops:
            if 3 <= len(loop) <= most:
                # the surface lies left of the loop, so the hole is on the left of its reverse
                filled = _filled(mesh.nodes, loop[::-1], edges)
                if filled is not None:
                    new.append(filled)
    if not new:
        return mesh, 0
    return TriangleMesh(mesh.nodes, np.concatenate([mesh.triangles, *new])), len(new)


def _filled(nodes: Floats, loop: Ints, edges: set[tuple[int, int]]) -> Ints | None:
    """Triangles (k − 2, 3) that fill a loop of k nodes, by Bellman's recursion over its chords."""
    x, k = nodes[loop] - nodes[loop].mean(axis=0), len(loop)
    squared = ((x[:, None] - x[None]) ** 2).sum(axis=2)
    outward = np.cross(x, np.roll(x, -1, axis=0)).sum(axis=0)
    free = np.array([[(min(a, b), max(a, b)) not in edges for b in loop.tolist()] for a in loop.tolist()])
    side = np.arange(k)
    free[side, np.roll(side, -1)] = free[np.roll(side, -1), side] = True
    cost, best = np.zeros((k, k)), np.zeros((k, k), dtype=np.int64)
    for step in range(2, k):
        for i in range(k - step):
            j, between = i + step, np.arange(i + 1, i + step)
            facing = np.cross(x[between] - x[i], x[j] - x[i]) @ outward
            total = cost[i, between] + cost[between, j]
            total = total + squared[i, between] + squared[between, j] + squared[i, j]
            total[(facing <= 0.0) | ~free[i, between] | ~free[between, j]] = np.inf
            best[i, j] = between[np.argmin(total)]
            cost[i, j] = total.min()
    if not np.isfinite(cost[0, k - 1]):
        return None
    out, open_ = [], [(0, k - 1)]
    while open_:
        i, j = open_.pop()
        if j - i > 1:
            m = int(best[i, j])
            out.append((i, m, j))
            open_ += [(i, m), (m, j)]
    filled: Ints = loop[np.array(out)]
    return filled
