"""Distances from seeds on large meshes, domain by domain: time in proportion to the mesh.

A sparse factorisation of n mesh nodes takes n^1.4 or so, and so does the heat method on the whole mesh. Only
distances from near seeds matter, so the mesh is cut into cores of bounded size, each core is widened by all
nodes within reach of the seeds that are wanted, and the heat equations are solved on each such domain.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.errors import ConvergenceError
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.tessellate.intrinsic_heat import IntrinsicHeat

#: Nodes of a core at most, and of the largest mesh that is not cut.
CORE, WHOLE = 32_000, 40_000
#: How much longer than straight lines paths along mesh edges are; edges between sources and the cut.
DETOUR, MARGIN = 1.15, 6.0
#: So many of the seeds near each node of the core lie in its domain for certain, and most of the others.
CERTAIN = 6


@dataclass(frozen=True, eq=False)
class DividedHeat:
    """The heat method on domains of a large mesh; small ones take `HeatGeodesics`.

    Parameters
    ----------
    mesh : TriangleMesh
        A manifold of proper triangles, with or without rims.
    t : float
        Diffusion time.
    core : int
        Nodes of a core at most.
    """

    mesh: TriangleMesh
    t: float
    core: int = CORE

    def from_seeds(
        self,
        source: Ints,
        colours: Ints,
        near: Ints,
        chords: Floats,
        progress: Callable[[float], None] | None = None,
    ) -> Floats:
        """Distance of each node from the seeds near it, less that of the seed's own node.

        Parameters
        ----------
        source : (n_seeds,) integer array
            Mesh node next to each seed.
        colours : (n_seeds,) integer array
            Seeds of one colour share a solve.
        near : (n_nodes, k) integer array
            Seeds whose distances are wanted, nearest first.
        chords : (n_nodes, k) array
            Straight distances from these.
        progress : callable, optional
            Called with the fraction done.

        Returns
        -------
        (n_nodes, k) array
            Where the seed cannot be reached within the domain, the domain's reach.

        Raises
        ------
        ConvergenceError
            If a distance is not finite.
        """
        mesh, out = self.mesh, np.empty(near.shape)
        cores = divided(mesh, self.core)
        graph = _edge_graph(mesh)
        starts, corners = _triangles_at(mesh)
        for k, core in enumerate(cores):
            reach = DETOUR * float(chords[core, :CERTAIN].max()) + MARGIN * mesh.mean_edge
            inside = np.isfinite(dijkstra(graph, indices=core, min_only=True, limit=reach))
            out[core] = self._in_domain(inside, (starts, corners), core, source, colours, near[core], reach)
            if progress is not None:
                progress((k + 1) / len(cores))
        if not np.isfinite(out).all():
            raise ConvergenceError(
                f"the heat method gave distances that are not finite; t = {self.t:g} is too small or too "
                "large, or the mesh too uneven: remesh it with more even triangles"
            )
        return out

    def _in_domain(
        self,
        inside: Bools,
        around: tuple[Ints, Ints],
        core: Ints,
        source: Ints,
        colours: Ints,
        near: Ints,
        reach: float,
    ) -> Floats:
        """Distances (core nodes, k) within one domain, the nodes ``inside``."""
        mesh = self.mesh
        starts, corners = around
        node = np.flatnonzero(inside)
        # triangles that touch a node inside, once each: those with all corners inside
        count = starts[node + 1] - starts[node]
        place = np.arange(int(count.sum())) + np.repeat(starts[node] - (np.cumsum(count) - count), count)
        touched = np.zeros(mesh.n_triangles, dtype=bool)
        touched[corners[place] // 3] = True
        tri = mesh.triangles[touched]
        tri = tri[inside[tri].all(axis=1)]
        local = np.full(mesh.n_nodes, -1, dtype=np.int64)
        local[tri] = 0
        used = np.flatnonzero(local == 0)
        local[used] = np.arange(len(used))
        points = mesh.nodes[tri]
        points = points[:, :1] + nearest_image(points - points[:, :1], mesh.period)
        heat = IntrinsicHeat(points, local[tri], len(used), self.t)
        seeds = np.flatnonzero(local[source] >= 0)
        wanted = np.unique(colours[np.intersect1d(near, seeds)])
        column = np.full(int(colours.max()) + 1, -1, dtype=np.int64)
        column[wanted] = np.arange(len(wanted))
        sets = [local[source[seeds[colours[seeds] == colour]]] for colour in wanted]
        fields = heat.solve_many(sets)
        at, home = local[core], local[source[near]]
        known = (home >= 0) & (heat.piece[at][:, None] == heat.piece[home])
        row, col = np.nonzero(known)
        field = column[colours[near[known]]]
        out = np.full(near.shape, reach)
        out[known] = fields[at[row], field] - fields[home[row, col], field]
        return out


def divided(mesh: TriangleMesh, most: int) -> list[Ints]:
    """Nodes of a mesh in compact groups of at most ``most``, halved across their longest extent."""
    parts, done = [np.arange(mesh.n_nodes)], []
    while parts:
        part = parts.pop()
        if len(part) <= most:
            done.append(part)
            continue
        x = mesh.nodes[part]
        axis = int(np.ptp(x, axis=0).argmax())
        order = np.argsort(x[:, axis], kind="stable")
        half = len(part) // 2
        parts += [np.sort(part[order[half:]]), np.sort(part[order[:half]])]
    return done


def _edge_graph(mesh: TriangleMesh) -> csr_array:
    a, b = mesh.edges.T
    n = mesh.n_nodes
    ends = (np.concatenate([a, b]), np.concatenate([b, a]))
    return csr_array(coo_array((np.tile(mesh.edge_lengths, 2), ends), shape=(n, n)))


def _triangles_at(mesh: TriangleMesh) -> tuple[Ints, Ints]:
    """Corners (3m,) sorted by node, and where each node's begin."""
    flat = mesh.triangles.ravel()
    order = np.argsort(flat, kind="stable")
    return np.searchsorted(flat[order], np.arange(mesh.n_nodes + 1)), order
