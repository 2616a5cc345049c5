"""From labelled mesh nodes to a cell network: films are chains of two-coloured mesh edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.errors import ResolutionError
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.network import CellNetwork
from warpedfoam.surfaces.mesh import TriangleMesh


@dataclass(frozen=True, eq=False)
class RegionNetwork:
    """A network read off a mesh.

    ``corners`` (n_threefold,) are the triangles of three labels, in vertex order; then come the rim
    vertices, on ``rim_crossings`` (k,) of the ``crossings`` (m, 2), the two-coloured mesh edges;
    ``film`` (m,) is the film on which each of those lies.
    """

    network: CellNetwork
    corners: Ints
    rim_crossings: Ints
    crossings: Ints
    film: Ints


def tidy_labels(mesh: TriangleMesh, labels: Ints, homes: Ints) -> Ints:
    """Give every region a home node, and every island of a region to the regions round it.

    ``homes`` (n_regions, k) are the nodes nearest to the seeds, nearest first; a region that owns no
    node takes the first that is not another's last. Islands are the pieces of a region that do not
    hold its largest part.
    """
    count = len(homes)
    owned = np.bincount(labels, minlength=count)
    missing = np.flatnonzero(owned == 0)
    if missing.size:
        labels = labels.copy()
    for region in missing:
        free = homes[region][owned[labels[homes[region]]] > 1]
        if free.size:
            owned[labels[free[0]]] -= 1
            labels[free[0]] = region
            owned[region] = 1
    for _ in range(20):
        island = _islands(mesh, labels, count)
        if not island.any():
            break
        labels = _absorbed(mesh, labels, island)
    return labels


def opened_rings(mesh: TriangleMesh, labels: Ints, seeds: Floats) -> Ints:
    """Labels with no region shut in by a single other one, where two seeds nearly coincide.

    The shut-in region gets the nodes of the one round it that lie farther on its side of the plane
    between the two seeds than its own nodes do: so close by, a bisector is straight.
    """
    count = len(seeds)
    rings = np.flatnonzero(_euler(mesh, labels, count) < 1)
    if not rings.size:
        return labels
    labels = labels.copy()
    a, b = labels[mesh.edges].T
    pairs = np.unique(np.sort(np.stack([a, b], axis=1)[a != b], axis=1), axis=0)
    degree = np.bincount(pairs.ravel(), minlength=count)
    for ring in rings:
        beside = pairs[(pairs == ring).any(axis=1)].sum(axis=1) - ring
        for inner in beside[degree[beside] == 1]:
            across = nearest_image(seeds[inner] - seeds[ring], mesh.period)
            side = nearest_image(mesh.nodes - seeds[ring], mesh.period) @ across
            labels[(labels == ring) & (side >= side[labels == inner].min())] = inner
    return labels


def _euler(mesh: TriangleMesh, labels: Ints, count: int) -> Ints:
    """Euler characteristic of each region: its nodes, the edges and the triangles inside it."""
    nodes = np.bincount(labels, minlength=count)
    a, b = labels[mesh.edges].T
    edges = np.bincount(a[a == b], minlength=count)
    x, y, z = labels[mesh.triangles].T
    triangles = np.bincount(x[(x == y) & (y == z)], minlength=count)
    out: Ints = nodes - edges + triangles
    return out


def _islands(mesh: TriangleMesh, labels: Ints, count: int) -> Bools:
    a, b = mesh.edges.T
    same = labels[a] == labels[b]
    n = mesh.n_nodes
    graph = coo_array((np.ones(int(same.sum())), (a[same], b[same])), shape=(n, n))
    n_pieces, piece = connected_components(graph, directed=False)
    if n_pieces == count:
        return np.zeros(n, dtype=np.bool_)
    sizes = np.bincount(piece)
    owner = np.empty(n_pieces, dtype=np.int64)
    owner[piece] = labels
    order = np.lexsort((sizes, owner))
    main = np.zeros(n_pieces, dtype=np.bool_)
    main[order[np.append(np.flatnonzero(np.diff(owner[order])), n_pieces - 1)]] = True
    out: Bools = ~main[piece]
    return out


def _absorbed(mesh: TriangleMesh, labels: Ints, island: Bools) -> Ints:
    a, b = np.concatenate([mesh.edges, mesh.edges[:, ::-1]]).T
    use = island[a] & ~island[b]
    out = labels.copy()
    out[a[use]] = labels[b[use]]
    return out


def region_network(mesh: TriangleMesh, labels: Ints, count: int) -> RegionNetwork:
    """Network of labelled regions, each of which must be a disk.

    The dual of a triangle mesh is threefold, so triangles of three labels are vertices and chains of
    two-coloured edges between them are films. A two-coloured edge of the mesh's rim is a rim vertex.

    Raises
    ------
    ResolutionError
        If a region is empty, in pieces or not a disk, or fewer than two vertices exist.
    """
    _require_disks(mesh, labels, count)
    tri = mesh.triangles
    corner = labels[tri]
    threefold = (
        (corner[:, 0] != corner[:, 1]) & (corner[:, 1] != corner[:, 2]) & (corner[:, 2] != corner[:, 0])
    )
    vertices = np.flatnonzero(threefold)
    on_rim, left_of, rim_after = _rim_crossings(mesh, labels)
    if len(vertices) + len(on_rim) < 2:
        raise ResolutionError(
            f"{count} bubbles meet nowhere in threefold vertices; use more bubbles (at least 4 on a sphere)"
        )
    # two-coloured edges, linked through the triangles that have exactly two of them
    n = mesh.n_nodes
    crossing = mesh.edges[labels[mesh.edges[:, 0]] != labels[mesh.edges[:, 1]]]
    keys = crossing[:, 0] * n + crossing[:, 1]
    start, end = tri, np.roll(tri, -1, axis=1)
    edge_key = np.minimum(start, end) * n + np.maximum(start, end)
    two = labels[start] != labels[end]
    place = np.minimum(np.searchsorted(keys, edge_key), len(keys) - 1)
    pair = np.flatnonzero((two.sum(axis=1) == 2) & ~threefold)
    linked = place[pair][two[pair]].reshape(-1, 2)
    graph = coo_array((np.ones(len(linked)), (linked[:, 0], linked[:, 1])), shape=(len(keys),) * 2)
    _, chain = connected_components(graph, directed=False)
    # ends of chains: the three edges of each threefold triangle, and those on the rim
    rim_edge = mesh.rim_edges[on_rim]
    rim_place = np.searchsorted(keys, rim_edge.min(axis=1) * n + rim_edge.max(axis=1))
    ends = np.concatenate([chain[place[vertices]].ravel(), chain[rim_place]])
    order = np.argsort(ends, kind="stable")
    film_of, tally = np.unique(ends, return_counts=True)
    if (tally != 2).any():
        raise ResolutionError("a film has no two ends; use more mesh nodes (n_nodes)")
    half = np.empty(len(ends), dtype=np.int64)
    half[order] = np.arange(len(order))
    film_index = np.full(int(chain.max()) + 1, -1, dtype=np.int64)
    film_index[film_of] = np.arange(len(film_of))
    if (film_index[chain] < 0).any():
        raise ResolutionError("two bubbles share a closed film; use more bubbles")
    # leaving the triangle through its edge i → j, the label at j is on the left
    corner_labels = corner[vertices]
    left = np.roll(corner_labels, -1, axis=1).ravel()
    half_of, half_rim = half[: 3 * len(vertices)].reshape(-1, 3), half[3 * len(vertices) :]
    origin = np.empty(len(half), dtype=np.int64)
    bubble = np.empty(len(half), dtype=np.int64)
    following = np.empty(len(half), dtype=np.int64)
    origin[half_of.ravel()] = np.repeat(np.arange(len(vertices)), 3)
    origin[half_rim] = len(vertices) + np.arange(len(half_rim))
    bubble[half_of.ravel()], bubble[half_rim] = left, left_of
    # arriving with bubble(i) on the left, go on through the edge before: k → i
    following[half_of ^ 1] = np.roll(half_of, 1, axis=1)
    following[half_rim ^ 1] = half_rim[rim_after]
    network = CellNetwork(following, origin, bubble)
    return RegionNetwork(network, vertices, rim_place, crossing, film_index[chain])


def _rim_crossings(mesh: TriangleMesh, labels: Ints) -> tuple[Ints, Ints, Ints]:
    """Two-coloured edges of the rim, as indices (k,) into ``mesh.rim_edges``.

    Also the label before each, which a film that leaves from there has on its left, and which of them
    comes next along the rim.
    """
    start, end = labels[mesh.rim_edges].T.reshape(2, -1)
    found = np.flatnonzero(start != end)
    rank = np.full(len(mesh.rim_edges), -1)
    rank[found] = np.arange(len(found))
    place = np.full(mesh.n_nodes, -1)
    place[mesh.rim_edges[:, 0]] = np.arange(len(mesh.rim_edges))
    after = np.empty(len(found), dtype=np.int64)
    for loop in mesh.rim_loops:
        here = rank[place[loop]]
        here = here[here >= 0]
        after[here] = np.roll(here, -1)
    return found, start[found], after


def _require_disks(mesh: TriangleMesh, labels: Ints, count: int) -> None:
    nodes = np.bincount(labels, minlength=count)
    if (nodes == 0).any():
        raise ResolutionError(
            f"{int((nodes == 0).sum())} of {count} bubbles own no mesh node; use more nodes (n_nodes)"
        )
    euler = _euler(mesh, labels, count)
    if _islands(mesh, labels, count).any() or (euler != 1).any():
        bad = int((euler != 1).sum())
        hole = ", nor round a hole: close those that are damage" if mesh.rim_loops else ""
        raise ResolutionError(
            f"{bad} of {count} bubbles would not be disks: too few bubbles for the surface (a bubble "
            f"must not reach round it{hole}), or too few mesh nodes"
        )


def corner_weights(squares: Floats, known: Bools) -> Floats:
    """Barycentric place (m, 3) in each triangle where the three d² are equal, kept inside.

    ``squares`` (m, 3, 3): at node i of the triangle, d² to the region of node j.
    """
    # differences are linear over the triangle: solve λ·(s0 − s1) = 0, λ·(s0 − s2) = 0, Σ λ = 1
    first = squares[:, :, 0] - squares[:, :, 1]
    second = squares[:, :, 0] - squares[:, :, 2]
    weight = np.cross(first, second)
    total = weight.sum(axis=1, keepdims=True)
    sound = known & (np.abs(total[:, 0]) > 1e-300)
    weight = np.where(sound[:, None], weight / np.where(sound[:, None], total, 1.0), 1.0 / 3.0)
    weight = np.clip(weight, 0.05, None)
    out: Floats = weight / weight.sum(axis=1, keepdims=True)
    return out
