"""Exact geodesic distances on triangle meshes, whole or on patches, and how far they are from the surface.

Calls libigl, whose `exact_geodesic` ends the interpreter on bad meshes and gives 0 for nodes it never
reached: meshes pass `require_surface`, and patches are cut so that they are manifolds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.sparse.linalg import spsolve_triangular

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.errors import ConvergenceError
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.places import Places

#: Share of a triangle's corner below which a source counts as lying on the edge across.
SNAP = 1e-9

# paths along edges are longer than geodesics, by 2/√3 at worst on equilateral triangles
_DETOUR, _GROWTH = 1.3, 1.4

# error of distances over the integral of `_shortening`: 0.76 on a sphere of even triangles
_SAFETY = 1.5

_NEAREST = 6  # nodes whose triangles are searched for a point


@dataclass(frozen=True, eq=False)
class _Patch:
    """Part of a mesh, laid out without periods; ``origin`` is the mesh's node of each of its nodes."""

    nodes: Floats
    triangles: Ints
    origin: Ints
    chosen: Ints  # the mesh's triangle of each triangle

    def reach(self, distances: Floats) -> float:
        """Distance from the sources that no path out of the patch can undercut."""
        start, end = self.triangles.ravel(), np.roll(self.triangles, -1, axis=1).ravel()
        keys = np.minimum(start, end) * len(self.nodes) + np.maximum(start, end)
        found, uses = np.unique(keys, return_counts=True)
        rim = found[uses == 1]
        if not rim.size:
            return np.inf
        a, b = rim // len(self.nodes), rim % len(self.nodes)
        length = np.linalg.norm(self.nodes[a] - self.nodes[b], axis=1)
        return float((0.5 * (distances[a] + distances[b] - length)).min())


def exact_distances(mesh: TriangleMesh, sources: Ints | Floats, radius: float | None = None) -> Floats:
    """Distance of every node from the nearest source along the mesh itself (Mitchell, Mount, Papadimitriou).

    Parameters
    ----------
    mesh : TriangleMesh
    sources : (k,) integer array or (k, 3) float array
        Node indices, which share one run unless the mesh repeats in space; or points near the mesh,
        each put into its nearest triangle as a node of its own in a run of its own.
    radius : float, optional
        Farther nodes get infinity. The patch that is measured grows until no path out of it can be
        shorter than ``radius``, so that the answer is that of the whole mesh.

    Returns
    -------
    (n_nodes,) array

    Raises
    ------
    MeshError
        If the mesh is not one closed manifold.
    ValueError
        If the mesh repeats in space and ``radius`` is missing or too large.
    ConvergenceError
        If libigl leaves nodes out.
    """
    mesh.require_surface()
    if mesh.period is not None:
        half = 0.5 * float(np.min(mesh.period))
        if radius is None or radius >= half:
            raise ValueError(
                f"radius must be below half the period, {half:g}, for exact distances on a mesh that repeats "
                f"in space, got {radius}; give a smaller one or take method='heat'"
            )
    best = np.full(mesh.n_nodes, np.inf)
    if sources.dtype.kind == "f":
        triangles, shares = locate(mesh, np.asarray(sources, dtype=np.float64))
        for triangle, share in zip(triangles, shares, strict=True):
            np.minimum(best, _from(mesh, mesh.triangles[triangle], int(triangle), share, radius), out=best)
    elif mesh.period is None:
        best = _from(mesh, np.asarray(sources, dtype=np.int64), None, None, radius)
    else:
        for node in sources:
            np.minimum(best, _from(mesh, np.array([node]), None, None, radius), out=best)
    return best


def locate(mesh: TriangleMesh, points: Floats) -> tuple[Ints, Floats]:
    """Nearest triangle of each point, (k,), and the barycentric coordinates of its nearest place, (k, 3)."""
    order = np.argsort(mesh.triangles.ravel(), kind="stable")
    first = np.searchsorted(mesh.triangles.ravel()[order], np.arange(mesh.n_nodes + 1))
    count = min(_NEAREST, mesh.n_nodes)
    near = np.reshape(Places(mesh.nodes, mesh.period).nearest(points, count)[1], (len(points), count))
    corners = mesh.corners
    triangles, shares = np.empty(len(points), dtype=np.int64), np.empty((len(points), 3))
    for k, (point, nodes) in enumerate(zip(points, near, strict=True)):
        choice = np.unique(np.concatenate([order[first[i] : first[i + 1]] for i in nodes]) // 3)
        share, gap = _foot(nearest_image(corners[choice, 0] - point, mesh.period), corners[choice])
        best = int(gap.argmin())
        triangles[k], shares[k] = choice[best], share[best]
    return triangles, shares


def _foot(first: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """Barycentric coordinates of the places nearest to the origin, and their squared distances.

    ``first`` (m, 3) is where the first corners lie; only differences of ``corners`` (m, 3, 3) matter.
    """
    at = first[:, None] + corners - corners[:, :1]
    b, c = at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]
    normal = np.cross(b, c)
    scale = (normal**2).sum(axis=1)
    beta = (np.cross(-first, c) * normal).sum(axis=1) / scale
    gamma = (np.cross(b, -first) * normal).sum(axis=1) / scale
    inside = np.stack([1.0 - beta - gamma, beta, gamma], axis=1)
    options = [np.where(inside.min(axis=1, keepdims=True) >= 0.0, inside, np.nan)]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        side = at[:, j] - at[:, i]
        along = np.clip(-(at[:, i] * side).sum(axis=1) / (side**2).sum(axis=1), 0.0, 1.0)
        share = np.zeros_like(inside)
        share[:, i], share[:, j] = 1.0 - along, along
        options.append(share)
    choice = np.stack(options)
    gaps = (np.einsum("omi,mix->omx", choice, at) ** 2).sum(axis=2)
    best = np.nanargmin(gaps, axis=0)
    rows = np.arange(len(first))
    return choice[best, rows], gaps[best, rows]


def _from(
    mesh: TriangleMesh, starts: Ints, triangle: int | None, share: Floats | None, radius: float | None
) -> Floats:
    """Distances from nodes ``starts`` or, given ``triangle`` and ``share``, from a place between them."""
    out = np.full(mesh.n_nodes, np.inf)
    centre = mesh.nodes[starts[0]]
    if radius is None:
        every = np.arange(mesh.n_nodes)
        whole = _Patch(mesh.nodes, mesh.triangles, every, np.arange(mesh.n_triangles))
        return _measure(mesh, whole, starts, triangle, share)
    i, j = mesh.edges.T
    graph = csr_array(coo_array((mesh.edge_lengths, (i, j)), shape=(mesh.n_nodes,) * 2))
    limit, before = _DETOUR * radius + float(mesh.edge_lengths.max()), -1
    while True:
        walk = dijkstra(graph, directed=False, indices=starts, min_only=True, limit=limit)
        patch = _cut(mesh, np.isfinite(walk), starts, centre)
        if len(patch.triangles) == before:
            raise ValueError(
                f"radius must be smaller on this mesh, got {radius:g}: nodes within it lie less than about "
                "two edges from where the mesh begins to repeat"
            )
        found = _measure(mesh, patch, starts, triangle, share)
        if patch.reach(found) >= radius:
            break
        before = len(patch.triangles)
        limit *= _GROWTH
    np.minimum.at(out, patch.origin, found)
    out[out > radius] = np.inf
    return out


def _cut(mesh: TriangleMesh, near: Bools, starts: Ints, centre: Floats) -> _Patch:
    """Triangles that touch ``near`` nodes and hang together with ``starts``, without pinched nodes."""
    chosen = np.flatnonzero(near[mesh.triangles].any(axis=1))
    nodes = mesh.triangles[chosen]
    at = mesh.nodes[nodes]
    if mesh.period is not None:
        at = centre + nearest_image(at - centre, mesh.period)
        # triangles that reach from one end of the unit to the other are left out
        spread = np.abs(at - np.roll(at, 1, axis=1)).max(axis=1)
        kept = (spread < 0.5 * mesh.period).all(axis=1)
        chosen, nodes, at = chosen[kept], nodes[kept], at[kept]
    start, end = nodes.ravel(), np.roll(nodes, -1, axis=1).ravel()
    n = mesh.n_nodes
    keys = start * n + end
    order = np.argsort(keys)
    place = np.searchsorted(keys[order], end * n + start).clip(max=len(keys) - 1)
    twin = order[place]
    met = np.flatnonzero(keys[twin] == end * n + start)
    corner = np.arange(len(keys))
    following = np.roll(corner.reshape(-1, 3), -1, axis=1).ravel()
    # a node for each fan of corners that hang together through edges, as in a sound manifold
    links = coo_array((np.ones(len(met)), (met, following[twin[met]])), shape=(len(keys),) * 2)
    _, fan = connected_components(links, directed=False)
    sides = coo_array((np.ones(len(met)), (met // 3, twin[met] // 3)), shape=(len(chosen),) * 2)
    _, piece = connected_components(sides, directed=False)
    # libigl would call nodes of pieces without a source sources
    touched = np.isin(piece, piece[np.isin(nodes, starts).any(axis=1)])
    used, compact = np.unique(fan.reshape(-1, 3)[touched], return_inverse=True)
    triangles = compact.reshape(-1, 3).astype(np.int64)
    points, origin = np.empty((len(used), 3)), np.empty(len(used), dtype=np.int64)
    points[triangles], origin[triangles] = at[touched], nodes[touched]
    return _Patch(points, triangles, origin, chosen[touched])


def _measure(
    mesh: TriangleMesh, patch: _Patch, starts: Ints, triangle: int | None, share: Floats | None
) -> Floats:
    """Distances of the patch's nodes by libigl, whose tolerances suit edges of length 1."""
    import igl

    nodes, triangles = patch.nodes, patch.triangles
    if triangle is None or share is None:
        sources = np.flatnonzero(np.isin(patch.origin, starts))
    else:
        at = int(np.flatnonzero(patch.chosen == triangle)[0])
        nodes, triangles, source = _with_node(nodes, triangles, at, share)
        sources = np.array([source])
    unit = mesh.mean_edge
    scaled = np.ascontiguousarray((nodes - nodes[sources[0]]) / unit)
    targets = np.arange(len(patch.nodes))
    found = np.asarray(
        igl.exact_geodesic(V=scaled, F=np.ascontiguousarray(triangles), VS=sources, VT=targets), dtype=float
    )
    left_out = ~np.isfinite(found) | (found < 0.0) | ((found == 0.0) & ~np.isin(targets, sources))
    if found.shape != targets.shape or left_out.any():
        raise ConvergenceError("libigl left nodes out of its exact distances; remesh, or take method='heat'")
    out: Floats = found * unit
    return out


def _with_node(nodes: Floats, triangles: Ints, at: int, share: Floats) -> tuple[Floats, Ints, int]:
    """Nodes and triangles with one more node in triangle ``at``, and its index."""
    corners = triangles[at]
    order = np.argsort(share)
    low, middle, high = order
    if share[middle] < SNAP:
        return nodes, triangles, int(corners[high])
    new = len(nodes)
    if share[low] < SNAP:
        a, b = corners[middle], corners[high]
        part = share[[middle, high]] / share[[middle, high]].sum()
        hit = ((triangles == a) | (triangles == b)).sum(axis=1) == 2
        halves = [np.where(triangles[hit] == old, new, triangles[hit]) for old in (a, b)]
        place = part @ nodes[[a, b]]
        rest = triangles[~hit]
    else:
        halves = [np.where(np.arange(3) == k, new, corners)[None] for k in range(3)]
        place = share @ nodes[corners]
        rest = np.delete(triangles, at, axis=0)
    return np.concatenate([nodes, place[None]]), np.concatenate([rest, *halves]), new


def polyhedral_error(mesh: TriangleMesh, distances: Floats) -> Floats:
    """How far distances along the mesh may be from those on the smooth surface its nodes lie on.

    The integral of `_shortening` along the geodesics, which follow the gradient of ``distances``, times
    a safety of 1.5.

    Parameters
    ----------
    mesh : TriangleMesh
    distances : (n_nodes,) array
        Infinite where unknown.

    Returns
    -------
    (n_nodes,) array
        Infinite where ``distances`` is.
    """
    known: Bools = np.isfinite(distances)
    out = np.full(mesh.n_nodes, np.inf)
    inner: Bools = np.asarray(known[mesh.triangles].all(axis=1))
    tri = mesh.triangles[inner]
    rate, slope = _shortening(mesh, inner, distances[tri])
    lower = distances[tri[:, :, None]] > distances[tri[:, None, :]]
    # λ_i falls along the path at slope_i, so that the path from corner i is 1/slope_i long
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.where(lower, np.maximum(-slope[:, None, :] / slope[:, :, None], 0.0), 0.0)
    weight = np.where(slope[:, :, None] > 0.0, weight, 0.0)
    weight[~np.isfinite(weight)] = 0.0
    total = weight.sum(axis=2)
    # the best triangle for a node is the one its path crosses: weights add up to 1, none cut off
    fit = np.where(total > 0.0, -np.abs(total - 1.0), -np.inf).ravel()
    order = np.lexsort((-fit, tri.ravel()))
    node, top = np.unique(tri.ravel()[order], return_index=True)
    pick = order[top]
    good = np.isfinite(fit[pick])
    node, pick = node[good], pick[good]
    face, corner = pick // 3, pick % 3
    share = weight[face, corner] / total[face, corner][:, None]
    back = (share[:, :, None] * mesh.corners[inner][face]).sum(axis=1) - mesh.corners[inner][face, corner]
    gain = rate[face] * np.linalg.norm(back, axis=1)
    # nodes with none lower are next to a source
    greatest = np.zeros(mesh.n_nodes)
    np.maximum.at(greatest, tri, rate[:, None])
    right = np.where(known, greatest * np.where(known, distances, 0.0), 0.0)
    right[node] = gain
    rank = np.empty(mesh.n_nodes, dtype=np.int64)
    rank[np.argsort(distances, kind="stable")] = np.arange(mesh.n_nodes)
    entries = (share.ravel(), (np.repeat(rank[node], 3), rank[tri[face]].ravel()))
    kept = entries[0] > 0.0
    carried = coo_array((entries[0][kept], tuple(e[kept] for e in entries[1])), shape=(mesh.n_nodes,) * 2)
    system = csr_array(eye_array(mesh.n_nodes) - csr_array(carried))
    sorted_right = np.empty(mesh.n_nodes)
    sorted_right[rank] = right
    summed = spsolve_triangular(system, sorted_right, lower=True)[rank]
    out[known] = _SAFETY * np.maximum(summed[known], 0.0)
    return out


def _shortening(mesh: TriangleMesh, inner: Bools, values: Floats) -> tuple[Floats, Floats]:
    """Relative error of lengths along the gradient of ``values`` (m, 3), and the gradient's d λ_i, (m, 3).

    Between its nodes the surface stands δ = ½ Σ λ_i λ_j II_ij above the triangle, II_ij = (n_j − n_i) ·
    (x_j − x_i) being its second form along the edges. A path along s is II(s, s) δ longer there, to first
    order, and ½ (∂_s δ)² for the slope; cancellation between the two is not counted on.
    """
    corners = mesh.corners
    sides = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    normal = np.cross(sides[:, 0], sides[:, 1])
    # Max's weights: exact on a sphere
    squares = (sides**2).sum(axis=2)
    weights = normal[:, None] / (np.roll(squares, -1, axis=1) * np.roll(squares, -2, axis=1))[:, :, None]
    at_node = np.zeros_like(mesh.nodes)
    np.add.at(at_node, mesh.triangles, weights)
    at_node /= np.maximum(np.linalg.norm(at_node, axis=1, keepdims=True), 1e-300)
    sides, normal, tri = sides[inner], normal[inner], mesh.triangles[inner]
    double = np.linalg.norm(normal, axis=1)
    gradients = np.cross(normal[:, None], sides) / (double**2)[:, None, None]
    slope = np.einsum("mi,mix->mx", values, gradients)
    along = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-300)
    change = np.einsum("mix,mx->mi", gradients, along)
    turned = at_node[tri]
    form = ((np.roll(turned, -2, axis=1) - np.roll(turned, -1, axis=1)) * sides).sum(axis=2)
    after, last = np.roll(change, -1, axis=1), np.roll(change, -2, axis=1)
    bend = -(after * last * form).sum(axis=1)
    depth = form.sum(axis=1) / 24.0
    # ∂_s δ at the middles of the sides, whose mean square is that over the triangle
    parts = np.empty((len(tri), 3))
    for k in range(3):
        middle = np.full(3, 0.5)
        middle[k] = 0.0
        b, c = np.roll(middle, -1), np.roll(middle, -2)
        parts[:, k] = 0.5 * ((after * c + last * b) * form).sum(axis=1)
    rate: Floats = np.abs(bend * depth) + 0.5 * (parts**2).mean(axis=1)
    return rate, change
