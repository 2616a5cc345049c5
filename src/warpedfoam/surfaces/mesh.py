"""`TriangleMesh`: the numerical triangulation of a surface, as two read-only arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Bools, Floats, Ints, as_indices, as_points, frozen
from warpedfoam.errors import MeshError
from warpedfoam.kernels.loops import loops_of
from warpedfoam.kernels.periodic import nearest_image

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Nodes and triangles, checked for shape, range and finiteness; topology is checked on demand.

    Parameters
    ----------
    nodes : (n, 3) array
    triangles : (m, 3) integer array
        Counter-clockwise seen from outside.
    period : (3,) array, optional
        Lengths after which the mesh repeats along x, y, z (infinite where it does not): its edges join
        nearest images.

    Raises
    ------
    ValueError, TypeError
        Wrong shape, NaN, indices out of range, no nodes or no triangles.

    Examples
    --------
    >>> mesh = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> mesh.n_nodes, mesh.area
    (3, 0.5)
    """

    nodes: Floats
    triangles: Ints
    period: Floats | None = None
    _checked: bool = field(default=False, repr=False)

    def __init__(self, nodes: ArrayLike, triangles: ArrayLike, period: Floats | None = None) -> None:
        points = as_points(nodes, "nodes", minimum=3)
        faces = as_indices(triangles, "triangles", (None, 3), below=len(points))
        if not len(faces):
            raise MeshError("triangles is empty: a mesh needs at least one triangle")
        object.__setattr__(self, "nodes", frozen(points))
        object.__setattr__(self, "triangles", frozen(faces))
        object.__setattr__(self, "period", None if period is None else frozen(np.asarray(period, float)))

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    @property
    def n_triangles(self) -> int:
        """Number of triangles."""
        return len(self.triangles)

    @cached_property
    def edges(self) -> Ints:
        """Undirected edges, (n_edges, 2), each once, smaller node first."""
        pairs = np.sort(self.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        keys = np.unique(pairs[:, 0] * self.n_nodes + pairs[:, 1])
        out: Ints = frozen(np.stack([keys // self.n_nodes, keys % self.n_nodes], axis=1))
        return out

    @cached_property
    def edge_lengths(self) -> Floats:
        """Length of each edge, (n_edges,)."""
        a, b = self.nodes[self.edges.T]
        return frozen(np.linalg.norm(nearest_image(b - a, self.period), axis=1))

    @property
    def mean_edge(self) -> float:
        """Mean edge length h."""
        return float(self.edge_lengths.mean())

    @property
    def corners(self) -> Floats:
        """Corners of each triangle, (m, 3, 3), images next to its first."""
        found = self.nodes[self.triangles]
        if self.period is not None:
            found = found[:, :1] + nearest_image(found - found[:, :1], self.period)
        return found

    @cached_property
    def triangle_areas(self) -> Floats:
        """Area of each triangle, (n_triangles,)."""
        a, b, c = self.corners.transpose(1, 0, 2)
        return frozen(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))

    @property
    def area(self) -> float:
        """Total area."""
        return float(self.triangle_areas.sum())

    @cached_property
    def node_areas(self) -> Floats:
        """A third of the area of the triangles round each node, (n,)."""
        share = np.repeat(self.triangle_areas / 3.0, 3)
        return frozen(np.bincount(self.triangles.ravel(), share, minlength=self.n_nodes))

    @property
    def euler_characteristic(self) -> int:
        """χ = nodes − edges + triangles, of the nodes that triangles use."""
        used = len(np.unique(self.triangles))
        return used - len(self.edges) + self.n_triangles

    @cached_property
    def rim_edges(self) -> Ints:
        """Directed edges (k, 2) that only one triangle has, the surface on their left."""
        start, end = self.triangles.ravel(), np.roll(self.triangles, -1, axis=1).ravel()
        keys, reverse = start * self.n_nodes + end, end * self.n_nodes + start
        alone = ~np.isin(keys, reverse)
        out: Ints = frozen(np.stack([start[alone], end[alone]], axis=1))
        return out

    @cached_property
    def rim_loops(self) -> tuple[Ints, ...]:
        """Nodes along each loop of the rim, the surface on the left.

        Raises
        ------
        MeshError
            If a node lies on more than one of them.
        """
        start, end = self.rim_edges.T
        if not len(start):
            return ()
        if len(np.unique(start)) < len(start) or not np.array_equal(np.sort(start), np.sort(end)):
            raise MeshError("rims touch each other at a node: no loop can be told from another")
        place = np.full(self.n_nodes, -1)
        place[start] = np.arange(len(start))
        loops = loops_of(place[end], np.zeros(len(start), dtype=np.int64))
        return tuple(frozen(start[part]) for part in np.split(loops.halves, loops.starts[1:]))

    def require_surface(self, *, closed: bool = False) -> None:
        """Check that the mesh is one consistently oriented manifold of proper triangles.

        Parameters
        ----------
        closed : bool, optional
            Whether rims are faults too.

        Raises
        ------
        MeshError
            With the first fault found: unreferenced nodes, coinciding nodes of a triangle, degenerate
            triangles, edges with more than two triangles, flipped triangles, pinched nodes, several
            components; open edges if the mesh is to be closed.
        """
        if not self._checked:
            _check_manifold(self)
            object.__setattr__(self, "_checked", True)
        if closed and len(self.rim_edges):
            a, b = self.rim_edges[0]
            raise MeshError(
                f"the mesh is open: {len(self.rim_edges)} rim edges (first: ({a}, {b})); "
                "a closed surface is needed, fill the holes"
            )

    def to_trimesh(self) -> trimesh.Trimesh:
        """Return the mesh as a ``trimesh.Trimesh``."""
        import trimesh

        return trimesh.Trimesh(self.nodes.copy(), self.triangles.copy(), process=False)

    @classmethod
    def from_trimesh(cls, mesh: trimesh.Trimesh) -> TriangleMesh:
        """Build from a ``trimesh.Trimesh``; anything else is a ``TypeError``."""
        import trimesh

        if not isinstance(mesh, trimesh.Trimesh):
            raise TypeError(f"mesh must be a trimesh.Trimesh, got {type(mesh).__name__}")
        return cls(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def flat_triangles(mesh: TriangleMesh) -> Bools:
    """Which triangles have no area, as their longest edges go."""
    longest = np.linalg.norm(mesh.corners - np.roll(mesh.corners, 1, axis=1), axis=2).max(axis=1)
    flat: Bools = mesh.triangle_areas <= 1e-10 * longest**2
    return flat


def _check_manifold(mesh: TriangleMesh) -> None:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    tri, n = mesh.triangles, mesh.n_nodes
    unused = np.setdiff1d(np.arange(n), tri)
    if unused.size:
        raise MeshError(f"{unused.size} nodes belong to no triangle (first: node {unused[0]}); remove them")
    same = (tri == np.roll(tri, 1, axis=1)).any(axis=1)
    if same.any():
        raise MeshError(f"triangle {int(np.flatnonzero(same)[0])} uses a node twice; remove such triangles")
    flat = flat_triangles(mesh)
    if flat.any():
        raise MeshError(
            f"{int(flat.sum())} triangles have no area (first: triangle {int(np.flatnonzero(flat)[0])}); "
            "merge coinciding nodes and collapse slivers"
        )
    start, end = tri.ravel(), np.roll(tri, -1, axis=1).ravel()
    keys = start * n + end
    directed, counts = np.unique(keys, return_counts=True)
    undirected, uses = np.unique(np.minimum(start, end) * n + np.maximum(start, end), return_counts=True)
    if (uses > 2).any():
        bad = int(undirected[uses > 2][0])
        raise MeshError(
            f"edge ({bad // n}, {bad % n}) belongs to more than two triangles: the mesh is not a manifold; "
            "split or remove the extra sheets"
        )
    if (counts > 1).any():
        bad = int(directed[counts > 1][0])
        raise MeshError(
            f"the two triangles at edge ({bad // n}, {bad % n}) are oriented against each other; "
            "flip one (warpedfoam check MESH --repair NEW.ply does)"
        )
    graph = coo_array((np.ones(len(start)), (start, end)), shape=(n, n))
    pieces, _ = connected_components(graph, directed=False)
    if pieces > 1:
        raise MeshError(f"the mesh has {pieces} separate components; keep one")
    # a manifold has one fan of triangles per node: corners linked through shared edges
    corner = np.arange(3 * len(tri))
    following = np.roll(corner.reshape(-1, 3), -1, axis=1).ravel()
    order = np.argsort(keys)
    reverse = end * n + start
    twin = order[np.minimum(np.searchsorted(keys[order], reverse), len(order) - 1)]
    paired = keys[twin] == reverse
    links = coo_array(
        (np.ones(int(paired.sum())), (corner[paired], following[twin[paired]])), shape=(len(corner),) * 2
    )
    fans, _ = connected_components(links, directed=False)
    if fans != n:
        raise MeshError("two sheets touch in a single node: the mesh is not a manifold; duplicate that node")
