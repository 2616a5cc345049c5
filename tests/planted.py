"""Foams with known defects, built from triangulations: bubbles at nodes, vertices in triangles."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

import warpedfoam as wf
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.t1 import rewire

#: Rows and columns of the honeycombs that defects are planted in.
SIZE = 12


def loops_of_triangulation(n_nodes: int, triangles: np.ndarray) -> list[list[int]]:
    """Triangles round each node, counter-clockwise."""
    after: list[dict[int, tuple[int, int]]] = [{} for _ in range(n_nodes)]
    for t, corners in enumerate(triangles.tolist()):
        for k in range(3):
            a, b, c = corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]
            after[a][b] = (t, c)
    loops = []
    for steps in after:
        start = here = next(iter(steps))
        loop = []
        while True:
            t, here = steps[here]
            loop.append(t)
            if here == start:
                break
        loops.append(loop)
    return loops


def laid_out(cell: wf.HeleShawCell, network: wf.CellNetwork, centres: np.ndarray) -> wf.Foam:
    """The network with every vertex in the middle of its three bubbles' centres."""
    three = network.bubble[network.outgoing]
    first = centres[three[:, :1]]
    points = (first + nearest_image(centres[three] - first, cell.surface.period)).mean(axis=1)
    order = np.argsort(network.origin[network.outgoing[:, 0]])
    return wf.Foam(cell, network, cell.surface.project(points[order]), np.zeros((network.n_films, 1)))


def foam_of(cell: wf.HeleShawCell, nodes: np.ndarray, triangles: np.ndarray) -> wf.Foam:
    return laid_out(cell, wf.network_from_loops(loops_of_triangulation(len(nodes), triangles)), nodes)


def flat_cell(columns: int, rows: int) -> wf.HeleShawCell:
    return wf.HeleShawCell(wf.FlatTorus(float(columns), rows * np.sqrt(0.75)), gap=0.1)


def lattice(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Triangular lattice of spacing 1 on a flat torus; node (i, j) of the slanted axes is at `at`."""
    i, j = (g.ravel() for g in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    nodes = np.stack([i + 0.5 * (j % 2), np.sqrt(0.75) * j, 0.0 * i], axis=1)
    i = i - j // 2

    def near(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return at(a, b, columns, rows)

    up = np.stack([near(i, j), near(i + 1, j), near(i, j + 1)], axis=1)
    down = np.stack([near(i + 1, j), near(i + 1, j + 1), near(i, j + 1)], axis=1)
    return nodes, np.concatenate([up, down])


def at(i, j, columns: int, rows: int):
    """Node at i steps along 0° and j steps along 60°."""
    wraps = np.floor_divide(j, rows)
    i = i + wraps * (rows // 2)
    j = j - wraps * rows
    return (i + j // 2) % columns * rows + j


def honeycomb(columns: int = 12, rows: int = 12) -> wf.Foam:
    return foam_of(flat_cell(columns, rows), *lattice(columns, rows))


def bond(network: wf.CellNetwork, one: int, two: int) -> int:
    """Half-film of bubble ``one`` towards bubble ``two``."""
    (half,) = np.flatnonzero(
        (network.bubble == one) & (network.bubble[np.arange(len(network.bubble)) ^ 1] == two)
    )
    return int(half)


def glide(foam: wf.Foam, half: int, steps: int) -> wf.Foam:
    """Turn ``steps`` films in a row: each step moves one of the two dislocations on by a bubble."""
    network = foam.network
    before = np.empty_like(network.next)
    before[network.next] = np.arange(len(before))
    films = []
    for _ in range(steps):
        films.append(half >> 1)
        half = int(before[before[before[half]] ^ 1])
    for film in films:
        network = rewire(network, [film])
    return laid_out(foam.cell, network, foam.bubble_centres)


def without(
    foam_nodes: np.ndarray, triangles: np.ndarray, node: int, fan: str
) -> tuple[np.ndarray, np.ndarray]:
    """Remove a sixfold node and fill the hexagon by a fan, a zigzag or a triangle of diagonals."""
    loop = []
    around = {}
    for corners in triangles[(triangles == node).any(axis=1)].tolist():
        k = corners.index(node)
        around[corners[(k + 1) % 3]] = corners[(k + 2) % 3]
    here = next(iter(around))
    for _ in range(6):
        loop.append(here)
        here = around[here]
    cuts = {
        "fan": [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)],
        "zigzag": [(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)],
        "triangle": [(0, 2, 4), (0, 1, 2), (2, 3, 4), (4, 5, 0)],
    }[fan]
    new = np.array([[loop[k] for k in cut] for cut in cuts])
    kept = np.concatenate([triangles[~(triangles == node).any(axis=1)], new])
    return np.delete(foam_nodes, node, axis=0), kept - (kept > node)


def subdivided(corners: np.ndarray, m: int, radius: float = 1.0) -> wf.Foam:
    """Sphere foam from the m-fold subdivided hull of ``corners``; new nodes have six neighbours."""
    corners = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    faces = ConvexHull(corners).simplices
    a, b, c = (corners[faces[:, k]] for k in range(3))
    inward = np.einsum("fi,fi->f", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    number: dict[tuple[tuple[int, int], ...], int] = {}
    points: list[np.ndarray] = []
    triangles = []

    def node(weights: dict[int, int]) -> int:
        key = tuple(sorted((k, w) for k, w in weights.items() if w))
        if key not in number:
            number[key] = len(points)
            points.append(sum(w * corners[k] for k, w in key))
        return number[key]

    for x, y, z in faces.tolist():

        def place(i: int, j: int, x: int = x, y: int = y, z: int = z) -> int:
            return node({x: m - i - j, y: i, z: j})

        for i in range(m):
            for j in range(m - i):
                triangles.append((place(i, j), place(i + 1, j), place(i, j + 1)))
                if i + j < m - 1:
                    triangles.append((place(i + 1, j), place(i + 1, j + 1), place(i, j + 1)))
    nodes = np.array(points)
    nodes *= radius / np.linalg.norm(nodes, axis=1, keepdims=True)
    return foam_of(wf.HeleShawCell(wf.Sphere(radius), gap=0.01 * radius), nodes, np.array(triangles))


def icosahedron() -> np.ndarray:
    g = (1.0 + np.sqrt(5.0)) / 2.0
    signs = np.array([(0.0, a, b) for a in (-1.0, 1.0) for b in (-g, g)])
    return np.concatenate([np.roll(signs, s, axis=1) for s in range(3)])


def turned(foam: wf.Foam, matrix: np.ndarray) -> wf.Foam:
    """The foam after a rotation or a reflection of space (loops reversed) that maps the surface to itself."""
    network = foam.network
    if np.linalg.det(matrix) > 0:
        return wf.Foam(foam.cell, network, foam.vertex_points @ matrix.T, foam.film_offsets)
    before = np.empty_like(network.next)
    before[network.next] = np.arange(len(before))
    mirrored = wf.CellNetwork(before, network.origin[np.arange(len(before)) ^ 1], network.bubble)
    return wf.Foam(foam.cell, mirrored, foam.vertex_points @ matrix.T, foam.film_offsets[:, ::-1])


def relabelled(foam: wf.Foam, seed: int) -> tuple[wf.Foam, np.ndarray]:
    """The foam with bubbles, films and vertices in another order, and the new number of each old bubble."""
    rng = np.random.default_rng(seed)
    network = foam.network
    bubbles, vertices = rng.permutation(network.n_bubbles), rng.permutation(network.n_vertices)
    film = rng.permutation(network.n_films)
    half = np.stack([2 * film, 2 * film + 1], axis=1).ravel()
    following, origin, bubble = (np.empty_like(network.next) for _ in range(3))
    following[half] = half[network.next]
    origin[half] = vertices[network.origin]
    bubble[half] = bubbles[network.bubble]
    points, offsets = np.empty_like(foam.vertex_points), np.empty_like(foam.film_offsets)
    points[vertices], offsets[film] = foam.vertex_points, foam.film_offsets
    return wf.Foam(foam.cell, wf.CellNetwork(following, origin, bubble), points, offsets), bubbles


def with_markers(foam: wf.Foam, films: np.ndarray) -> wf.Foam:
    """The foam with a marker vertex in the middle of each of ``films``."""
    network = foam.network
    following, origin, bubble = list(network.next), list(network.origin), list(network.bubble)
    for film in films.tolist():
        along, back, new, vertex = 2 * film, 2 * film + 1, len(following), max(origin) + 1
        behind = following.index(back)
        following += [following[along], back]
        following[along], following[behind] = new, new + 1
        origin += [vertex, origin[back]]
        origin[back] = vertex
        bubble += [bubble[along], bubble[back]]
    middles = foam.film_curves_at(np.array([0.5]))[films, 0]
    points = np.vstack([foam.vertex_points, foam.cell.surface.project(middles)])
    return wf.Foam(foam.cell, wf.CellNetwork(following, origin, bubble), points)


def node(i: int, j: int) -> int:
    return int(at(i, j, SIZE, SIZE))


def slip(steps: int, one: tuple[int, int] = (3, 4), two: tuple[int, int] = (2, 5)) -> wf.Foam:
    """Shift ``steps`` bubbles of the upper row of a honeycomb by one spacing against the lower row."""
    foam = honeycomb(SIZE, SIZE)
    return glide(foam, bond(foam.network, node(*one), node(*two)), steps)
