"""A fine triangulation of the surroundings of a point, cut from a coarse mesh and refined there only."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.errors import MeshError, ResolutionError
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import Surface

#: Paths along edges are at most so much longer than geodesics on even triangles, with some room.
DETOUR = 1.25
#: Nodes at most.
MOST_NODES = 200_000
#: Nodes of the whole surface's mesh at least.
LEAST_NODES = 1000


@dataclass(frozen=True, eq=False)
class MeshDisk:
    """Nodes and triangles round a point, laid out without periods; nodes lie on the surface."""

    nodes: Floats
    triangles: Ints
    edges: Ints
    rim: Bools  # which edges have one triangle only
    sides: Ints  # (m, 3), edge of each triangle from its corner i to i + 1

    @property
    def lengths(self) -> Floats:
        """Length of each edge."""
        a, b = self.nodes[self.edges.T]
        out: Floats = np.linalg.norm(b - a, axis=1)
        return out

    def doubled(self) -> TriangleMesh:
        """Two copies joined along the rim: closed, and distances from a point of one are those of the disk.

        A path through the other copy can be mirrored into this one, so none is shorter. Node i has its
        mirror image at i, if on the rim, or behind the nodes of the first copy.
        """
        if not self.rim.any():
            return TriangleMesh(self.nodes, self.triangles)
        mirror = self.mirror
        inner = np.flatnonzero(mirror >= len(self.nodes))
        nodes = np.concatenate([self.nodes, self.nodes[inner]])
        return TriangleMesh(nodes, np.concatenate([self.triangles, mirror[self.triangles][:, ::-1]]))

    @property
    def mirror(self) -> Ints:
        """Index of each node's image in `doubled`."""
        n = len(self.nodes)
        out = np.arange(n)
        if self.rim.any():
            inner = np.setdiff1d(out, self.edges[self.rim])
            out[inner] = n + np.arange(len(inner))
        return out


def mesh_disk(surface: Surface, centre: Floats, radius: float, spacing: float) -> MeshDisk:
    """All that lies within ``radius`` of ``centre`` (3,) and a little more, with edges of about ``spacing``.

    Raises
    ------
    ResolutionError
        If that takes too many nodes.
    ValueError
        If the disk reaches round a surface that repeats in space.
    """
    mesh = _start(surface, spacing)
    edges = mesh.edge_lengths
    graph = csr_array(coo_array((edges, tuple(mesh.edges.T)), shape=(mesh.n_nodes,) * 2))
    start = int((nearest_image(mesh.nodes - centre, mesh.period) ** 2).sum(axis=1).argmin())
    reach = DETOUR * (radius + 2.0 * float(edges.max())) + float(edges.max())
    near = np.isfinite(dijkstra(graph, directed=False, indices=np.array([start]), min_only=True, limit=reach))
    triangles = mesh.triangles[near[mesh.triangles].any(axis=1)]
    nodes = centre + nearest_image(mesh.nodes - centre, mesh.period)
    if mesh.period is not None:
        corners = nodes[triangles]
        if (np.abs(corners - np.roll(corners, 1, axis=1)) > 0.5 * mesh.period).any():
            raise ValueError(
                f"radius must be well below half the period, got {radius:g}: the surroundings of the circle "
                "reach round the surface that repeats in space; take method='jacobi'"
            )
    disk = _disk(nodes, triangles, start)
    while (size := float(disk.lengths.mean())) > 1.3 * spacing:
        if 4 * len(disk.nodes) * min(1.0, 1.6 * (radius / max(radius, size)) ** 2) > MOST_NODES:
            raise ResolutionError(
                f"spacing {spacing:g} takes more than {MOST_NODES} nodes within {radius:g} of the centre; "
                "take a larger one"
            )
        disk = _cut(_halved(surface, disk), centre, radius)
    return disk


def _start(surface: Surface, spacing: float) -> TriangleMesh:
    """The surface's own mesh, or a coarser one if that is fine enough."""
    count = int(1.3 * surface.area / spacing**2) if spacing < surface.size else LEAST_NODES
    if count < 10_000:
        with suppress(MeshError):
            mesh = surface.triangulate(max(count, LEAST_NODES))
            mesh.require_closed_surface()
            if mesh.euler_characteristic == surface.euler_characteristic:
                return mesh
    return surface.mesh


def finer(surface: Surface, disk: MeshDisk) -> MeshDisk:
    """Every edge halved, new nodes on the surface."""
    return _halved(surface, disk)


def _cut(disk: MeshDisk, centre: Floats, radius: float) -> MeshDisk:
    """Leave out what is farther from the centre than paths along edges can be."""
    lengths = disk.lengths
    n = len(disk.nodes)
    graph = csr_array(coo_array((lengths, tuple(disk.edges.T)), shape=(n, n)))
    start = int(((disk.nodes - centre) ** 2).sum(axis=1).argmin())
    limit = DETOUR * (radius + 2.0 * float(lengths.max())) + float(lengths.max())
    near = np.isfinite(dijkstra(graph, directed=False, indices=np.array([start]), min_only=True, limit=limit))
    return _disk(disk.nodes, disk.triangles[near[disk.triangles].any(axis=1)], start)


def _disk(nodes: Floats, triangles: Ints, start: int) -> MeshDisk:
    """The component of triangles round ``start``, without nodes at which two rims meet."""
    while True:
        used, tri = np.unique(triangles, return_inverse=True)
        tri = tri.reshape(-1, 3)
        edges, sides, counts = _edges(tri, len(used))
        rim_nodes = edges[counts == 1].ravel()
        pinched = np.flatnonzero(np.bincount(rim_nodes, minlength=len(used)) > 2)
        touching = np.isin(tri, pinched).any(axis=1)
        if not pinched.size:
            break
        triangles = triangles[~touching]
    if not (used[tri] == start).any():
        raise ResolutionError(
            "the mesh is too coarse round the centre to cut a disk from it; take a finer one"
        )
    links = coo_array(
        (np.ones(3 * len(tri)), (np.repeat(np.arange(len(tri)), 3), sides.ravel())),
        shape=(len(tri), len(edges)),
    ).tocsr()
    _, piece = connected_components(links @ links.T, directed=False)
    here = int(np.searchsorted(used, start))
    kept = piece == piece[np.flatnonzero((tri == here).any(axis=1))[0]]
    if not kept.all():
        return _disk(nodes, triangles[kept], start)
    return MeshDisk(nodes[used], tri, edges, counts == 1, sides)


def _edges(triangles: Ints, n_nodes: int) -> tuple[Ints, Ints, Ints]:
    """Edges (e, 2), edge of each triangle's sides (m, 3), triangles at each edge."""
    after = np.roll(triangles, -1, axis=1)
    keys = np.minimum(triangles, after) * n_nodes + np.maximum(triangles, after)
    found, sides, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return np.stack([found // n_nodes, found % n_nodes], axis=1), sides.reshape(-1, 3), counts


def _halved(surface: Surface, disk: MeshDisk) -> MeshDisk:
    a, b = disk.nodes[disk.edges.T]
    nodes = np.concatenate([disk.nodes, surface.project(0.5 * (a + b))])
    x, y, z = disk.triangles.T
    p, q, r = (len(disk.nodes) + disk.sides).T
    quarters = [(x, p, r), (p, y, q), (r, q, z), (p, q, r)]
    triangles = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
    edges, sides, counts = _edges(triangles, len(nodes))
    return MeshDisk(nodes, triangles, edges, counts == 1, sides)
