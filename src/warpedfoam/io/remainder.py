"""Triangles for what no fan can fill: the exterior of a cluster, a bubble round a handle."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from warpedfoam.arrays import Floats, Ints
from warpedfoam.foam import Foam

# Samples along each film that tell its left from its right.
_SAMPLES = 24
_N_NODES = 10_000
# How deep the triangles lie below the surface, in mesh edges: neighbours' patches hide the overlap.
_DEPTH = 0.1


def remainder(foam: Foam, bubbles: Ints) -> tuple[Floats, Ints, Ints]:
    """Triangles of the surface's triangulation that reach into ``bubbles``, sunk a little.

    Nodes within an edge or two of the bubbles' films are told apart by the side of the nearest film;
    the other nodes follow the nearest of those along the mesh.

    Returns
    -------
    points : (n, 3) array
    owner : (n,) array of int
        Bubble of each point; none is shared.
    triangles : (m, 3) array of int
    """
    network, surface = foam.network, foam.cell.surface
    mesh = surface.triangulate(_N_NODES)
    wanted = np.zeros(foam.n_bubbles, dtype=bool)
    wanted[bubbles] = True
    rim = np.flatnonzero(wanted[network.left] | wanted[network.right])
    xi = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    step = 0.25 / _SAMPLES
    samples, ahead = (foam.film_curves_at(xi + s)[rim].reshape(-1, 3) for s in (0.0, step))
    film = np.repeat(rim, _SAMPLES)
    tree = cKDTree(samples)
    distance, nearest = tree.query(mesh.nodes)
    across = np.cross(surface.normals(samples), ahead - samples)
    on_left = np.einsum("ni,ni->n", across[nearest], mesh.nodes - samples[nearest]) >= 0.0
    side = np.where(on_left, network.left[film[nearest]], network.right[film[nearest]])
    close = np.asarray(distance < 2.0 * mesh.mean_edge)
    close[np.argmin(distance)] = True
    a, b = mesh.edges.T
    graph = coo_array((mesh.edge_lengths, (a, b)), shape=(mesh.n_nodes, mesh.n_nodes)).tocsr()
    _, _, source = dijkstra(
        graph, directed=False, indices=np.flatnonzero(close), min_only=True, return_predecessors=True
    )
    owner = side[source]
    corner = owner[mesh.triangles]
    inside = wanted[corner]
    keep = inside.any(axis=1)
    corner, inside = corner[keep], inside[keep]
    chosen = corner[np.arange(len(corner)), np.argmax(inside, axis=1)]
    keys, place = np.unique(chosen[:, None] * mesh.n_nodes + mesh.triangles[keep], return_inverse=True)
    nodes = mesh.nodes[keys % mesh.n_nodes]
    sunk = nodes - _DEPTH * mesh.mean_edge * surface.normals(nodes)
    return sunk, keys // mesh.n_nodes, place.reshape(-1, 3)
