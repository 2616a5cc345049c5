"""Small sound meshes, and what can be wrong with a mesh."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Mesh = tuple[np.ndarray, np.ndarray]


# ---------------------------------------------------------------------------- sound meshes


def base(name: str) -> Mesh:
    """Nodes and triangles of a small sound mesh."""
    from warpedfoam import Ellipsoid, Sphere, Torus

    surface = {"sphere": Sphere(1.0), "torus": Torus(2.0, 1.0), "ellipsoid": Ellipsoid(1.0, 1.2, 1.5)}[name]
    mesh = surface.triangulate(300)
    return mesh.nodes.copy(), mesh.triangles.copy()


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes as one, nothing merged."""
    starts = np.cumsum([0] + [len(nodes) for nodes, _ in meshes])
    nodes = np.concatenate([nodes for nodes, _ in meshes])
    triangles = np.concatenate([tri + start for (_, tri), start in zip(meshes, starts, strict=False)])
    return nodes, triangles


# ---------------------------------------------------------------------------- mutations of meshes

Mutation = Callable[[np.ndarray, np.ndarray, np.random.Generator], Mesh]


def _cut(nodes, tri, rng, share=0.02):
    return nodes, np.delete(tri, rng.choice(len(tri), max(1, int(share * len(tri))), replace=False), axis=0)


def _cut_half(nodes, tri, rng):
    return _cut(nodes, tri, rng, 0.5)


def _cut_node(nodes, tri, rng):
    gone = int(rng.integers(len(nodes)))
    kept = tri[(tri != gone).all(axis=1)]
    return np.delete(nodes, gone, axis=0), kept - (kept > gone)


def _cut_shifted(nodes, tri, rng):
    """A node deleted but the triangles not renumbered."""
    return np.delete(nodes, rng.integers(len(nodes)), axis=0), tri


def _flip(nodes, tri, rng, share=0.05):
    chosen = rng.choice(len(tri), max(1, int(share * len(tri))), replace=False)
    tri[chosen] = tri[chosen][:, ::-1]
    return nodes, tri


def _inside_out(nodes, tri, rng):
    return nodes, tri[:, ::-1]


def _bad_number(nodes, tri, rng):
    nodes[rng.integers(len(nodes)), rng.integers(3)] = rng.choice([np.nan, np.inf, -np.inf])
    return nodes, tri


def _all_nan(nodes, tri, rng):
    return np.full_like(nodes, np.nan), tri


def _twin_node(nodes, tri, rng):
    """A node given twice, each copy with some of the triangles."""
    node = int(rng.integers(len(nodes)))
    round_ = np.argwhere(tri == node)
    for row, column in round_[: len(round_) // 2]:
        tri[row, column] = len(nodes)
    return np.concatenate([nodes, nodes[node : node + 1]]), tri


def _soup(nodes, tri, rng):
    """Every triangle with corners of its own."""
    return nodes[tri].reshape(-1, 3), np.arange(tri.size).reshape(-1, 3)


def _spare_node(nodes, tri, rng):
    return np.concatenate([nodes, rng.standard_normal((3, 3))]), tri


def _twice(nodes, tri, rng):
    return nodes, np.concatenate([tri, tri[rng.integers(len(tri), size=3)]])


def _back_to_back(nodes, tri, rng):
    return nodes, np.concatenate([tri, tri[:, ::-1]])


def _collapse(nodes, tri, rng):
    """An edge of no length, its triangles kept."""
    a, b = tri[rng.integers(len(tri)), :2]
    nodes[a] = nodes[b]
    return nodes, tri


def _repeat_corner(nodes, tri, rng):
    row = rng.integers(len(tri))
    tri[row, 1] = tri[row, 0]
    return nodes, tri


def _sliver(nodes, tri, rng, share=1e-3):
    """Nodes moved next to a neighbour."""
    for _ in range(3):
        a, b = tri[rng.integers(len(tri)), :2]
        nodes[a] = nodes[b] + share * (nodes[a] - nodes[b])
    return nodes, tri


def _needle(nodes, tri, rng):
    return _sliver(nodes, tri, rng, 1e-11)


def _mild_sliver(nodes, tri, rng):
    return _sliver(nodes, tri, rng, 0.1)


def _cap(nodes, tri, rng):
    """A triangle split at a point next to one of its edges."""
    row = int(rng.integers(len(tri)))
    a, b, c = tri[row]
    middle = nodes[[a, b, c]].T @ [0.5, 0.4999, 0.0001]
    new = len(nodes)
    return np.vstack([nodes, middle]), np.vstack(
        [np.delete(tri, row, axis=0), [[a, b, new], [b, c, new], [c, a, new]]]
    )


def _apart(nodes, tri, rng):
    return joined((nodes, tri), (0.1 * nodes + [10.0, 0.0, 0.0], tri))


def _nested(nodes, tri, rng):
    return joined((nodes, tri), (0.5 * nodes, tri[:, ::-1]))


def _halves(nodes, tri, rng):
    """Two open pieces: a band cut away."""
    middle = np.abs(nodes[tri].mean(axis=1)[:, 0]) > 0.2
    return nodes, tri[middle]


def _kissing(nodes, tri, rng):
    """Two sheets that touch in a node."""
    node = int(np.argmax(nodes[:, 0]))
    both, triangles = joined(
        (nodes, tri), (nodes * [-1.0, 1.0, 1.0] + [2 * nodes[node, 0], 0.0, 0.0], tri[:, ::-1])
    )
    triangles[triangles == node + len(nodes)] = node
    keep = np.arange(len(both)) != node + len(nodes)
    return both[keep], (np.cumsum(keep) - 1)[triangles]


def _fin(nodes, tri, rng):
    """A triangle standing on an edge."""
    a, b = tri[rng.integers(len(tri)), :2]
    return np.vstack([nodes, 1.5 * nodes[a] + [0.0, 0.0, 0.1]]), np.vstack([tri, [[b, a, len(nodes)]]])


def _spike(nodes, tri, rng, factor=3.0):
    node = rng.integers(len(nodes))
    nodes[node] *= factor
    return nodes, tri


def _far_spike(nodes, tri, rng):
    return _spike(nodes, tri, rng, 1e6)


def _absurd_spike(nodes, tri, rng):
    return _spike(nodes, tri, rng, 1e200)


def _through(nodes, tri, rng):
    """A node pushed through to the other side."""
    return _spike(nodes, tri, rng, -1.5)


def _noise(nodes, tri, rng, share=0.05):
    h = np.linalg.norm(nodes[tri[:, 0]] - nodes[tri[:, 1]], axis=1).mean()
    return nodes + share * h * rng.uniform(-1.0, 1.0, nodes.shape), tri


def _much_noise(nodes, tri, rng):
    return _noise(nodes, tri, rng, 0.5)


def _mad_noise(nodes, tri, rng):
    return _noise(nodes, tri, rng, 5.0)


def _shuffled(nodes, tri, rng):
    order = rng.permutation(len(nodes))
    return nodes[order], np.argsort(order)[tri][rng.permutation(len(tri))]


def _mixed_up(nodes, tri, rng):
    """Nodes permuted without their triangles."""
    return nodes[rng.permutation(len(nodes))], tri


def _tiny(nodes, tri, rng):
    return 1e-9 * nodes, tri


def _huge(nodes, tri, rng):
    return 1e9 * nodes, tri


def _vanishing(nodes, tri, rng):
    return 1e-200 * nodes, tri


def _immense(nodes, tri, rng):
    return 1e200 * nodes, tri


def _far_off(nodes, tri, rng):
    return nodes + 1e5, tri


def _off_centre(nodes, tri, rng):
    return nodes + 300.0, tri


def _spindle(nodes, tri, rng):
    """A ring narrower than its tube: it crosses itself."""
    q = np.hypot(nodes[:, 0], nodes[:, 1])
    nodes[:, :2] *= ((q - 1.3) / q)[:, None]
    return nodes, tri


def _lobes(nodes, tri, rng):
    """Bent until its two ends go through each other."""
    turn = np.pi * 1.15 * nodes[:, 2] / np.abs(nodes[:, 2]).max()
    r = 1.5 + nodes[:, 0] * 0.5
    return np.stack([r * np.cos(turn), 0.5 * nodes[:, 1], r * np.sin(turn)], axis=1), tri


def _farthest(nodes, tri, rng):
    return nodes + 1e14, tri


def _flat(nodes, tri, rng):
    return nodes * [1.0, 1.0, 0.0], tri


def _flattened(nodes, tri, rng):
    return nodes * [1.0, 1.0, 1e-3], tri


def _point(nodes, tri, rng):
    return np.zeros_like(nodes), tri


def _pillow(nodes, tri, rng):
    """A triangle and its back: closed, and nothing in it."""
    return nodes[tri[0]], np.array([[0, 1, 2], [0, 2, 1]])


def _one_triangle(nodes, tri, rng):
    return nodes[tri[0]], np.array([[0, 1, 2]])


def _tetrahedron(nodes, tri, rng):
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    return corners, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def _octahedron(nodes, tri, rng):
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    return corners, np.array(faces)


def _hub(nodes, tri, rng):
    """A fan: one node joined to all of a rim, above and below."""
    turn = np.arange(200) * (2.0 * np.pi / 200)
    rim = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    i = np.arange(200)
    j = (i + 1) % 200
    top = np.stack([i, j, 0 * i + 200], axis=1)
    bottom = np.stack([j, i, 0 * i + 201], axis=1)
    return np.concatenate([rim, [[0, 0, 1.0], [0, 0, -1.0]]]), np.concatenate([top, bottom])


#: Mutations, how many seeds each is tried with, and on which meshes.
MUTATIONS: dict[str, tuple[Mutation, int]] = {
    "cut": (_cut, 5), "cut_half": (_cut_half, 2), "cut_node": (_cut_node, 4),
    "cut_shifted": (_cut_shifted, 3), "flip": (_flip, 5), "inside_out": (_inside_out, 1),
    "bad_number": (_bad_number, 6), "all_nan": (_all_nan, 1), "twin_node": (_twin_node, 4),
    "soup": (_soup, 2), "spare_node": (_spare_node, 2), "twice": (_twice, 3),
    "back_to_back": (_back_to_back, 1), "collapse": (_collapse, 4), "repeat_corner": (_repeat_corner, 3),
    "sliver": (_sliver, 1), "needle": (_needle, 3), "mild_sliver": (_mild_sliver, 1), "cap": (_cap, 1),
    "apart": (_apart, 3), "nested": (_nested, 2), "halves": (_halves, 2), "kissing": (_kissing, 2),
    "fin": (_fin, 3), "spike": (_spike, 2), "far_spike": (_far_spike, 2),
    "absurd_spike": (_absurd_spike, 2), "through": (_through, 3), "noise": (_noise, 1),
    "much_noise": (_much_noise, 3), "mad_noise": (_mad_noise, 3), "shuffled": (_shuffled, 1),
    "mixed_up": (_mixed_up, 2), "tiny": (_tiny, 1), "huge": (_huge, 1), "vanishing": (_vanishing, 1),
    "immense": (_immense, 1), "off_centre": (_off_centre, 1), "spindle": (_spindle, 1),
    "lobes": (_lobes, 3), "far_off": (_far_off, 1), "farthest": (_farthest, 1), "flat": (_flat, 1),
    "flattened": (_flattened, 2), "point": (_point, 1), "pillow": (_pillow, 1),
    "one_triangle": (_one_triangle, 1), "tetrahedron": (_tetrahedron, 1), "octahedron": (_octahedron, 1),
    "hub": (_hub, 1),
}  # fmt: skip


#: Mutations that leave a mesh to carry a foam: on the sphere, where foams are quickest.
SOUND = ("sliver", "mild_sliver", "cap", "noise", "tiny", "huge", "off_centre", "twin_node", "soup")
