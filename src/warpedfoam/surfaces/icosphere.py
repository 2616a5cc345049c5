"""Subdivision of the icosahedron at any whole frequency: 10 m² + 2 nodes on the unit sphere."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats, Ints


def icosphere(frequency: int) -> tuple[Floats, Ints]:
    """Nodes (10 m² + 2, 3) and triangles (20 m², 3) of the m-fold subdivided icosahedron.

    Edges of the icosahedron's faces are divided evenly in angle, which keeps the triangles' sizes
    within about 1.5 of each other.

    Examples
    --------
    >>> nodes, triangles = icosphere(3)
    >>> nodes.shape, triangles.shape
    ((92, 3), (180, 3))
    """
    corners, faces = _icosahedron()
    m = frequency
    i, j = (g.ravel() for g in np.meshgrid(np.arange(m + 1), np.arange(m + 1), indexing="ij"))
    inside = i + j <= m
    i, j = i[inside], j[inside]
    place = np.full((m + 1, m + 1), -1)
    place[i, j] = np.arange(len(i))
    up = [(a, b) for a, b in zip(i, j, strict=True) if a + b < m]
    down = [(a, b) for a, b in up if a + b < m - 1]
    local = np.array(
        [(place[a, b], place[a + 1, b], place[a, b + 1]) for a, b in up]
        + [(place[a + 1, b], place[a + 1, b + 1], place[a, b + 1]) for a, b in down]
    )
    edge = np.arccos(corners[faces[0, 0]] @ corners[faces[0, 1]])
    # weights sin(edge·t) per corner divide each edge evenly in angle
    t = np.stack([m - i - j, i, j], axis=1) / m
    weights = np.sin(edge * t)
    points = np.einsum("nc,fcx->fnx", weights, corners[faces])
    points /= np.linalg.norm(points, axis=2, keepdims=True)
    flat = points.reshape(-1, 3)
    merged, inverse = _merge(flat)
    triangles = inverse[(np.arange(20)[:, None, None] * len(i) + local[None]).reshape(-1, 3)]
    return merged, triangles


def _merge(points: Floats) -> tuple[Floats, Ints]:
    """Merge points of neighbouring faces that coincide to round-off (a k-d tree, no rounding edges)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(1e-9, output_type="ndarray")
    n = len(points)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    return points[first], inverse


def _icosahedron() -> tuple[Floats, Ints]:
    from scipy.spatial import ConvexHull

    g = (1.0 + np.sqrt(5.0)) / 2.0
    signs = np.array([(a, b) for a in (-1.0, 1.0) for b in (-g, g)])
    zero = np.zeros((4, 1))
    base = np.hstack([zero, signs])
    corners = np.concatenate([np.roll(base, s, axis=1) for s in range(3)])
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    faces = ConvexHull(corners).simplices.astype(np.int64)
    a, b, c = (corners[faces[:, k]] for k in range(3))
    inward = np.einsum("fi,fi->f", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return corners, faces
