"""Geodesic distances on a triangle mesh: by the heat method, one factorisation and many solves, or exact.

Calls libigl, which ends the interpreter on bad input and answers some of it wrongly without a word:
everything is checked first.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from hashlib import blake2b
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpedfoam.arrays import Floats, Ints, as_choice, as_indices, as_number, as_points, frozen
from warpedfoam.errors import ConvergenceError, MeshError
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.places import Places
from warpedfoam.tessellate.exact_geodesics import exact_distances, locate, polyhedral_error
from warpedfoam.tessellate.intrinsic_heat import IntrinsicHeat

if TYPE_CHECKING:
    import trimesh

    from warpedfoam.surfaces.protocol import Surface

#: Diffusion time in squared mean edges, for solves from one source: the default.
TIME_FACTOR = 4.0

#: The same for solves from many sources, one in each colour of `colouring.colour_seeds`.
COLOUR_TIME_FACTOR = 1.0

# below 0.1 squared mean edges heat dies out on its way, above 10⁶ areas the matrix has no mass left
_LEAST_FACTOR, _GREATEST_FACTOR = 0.1, 1e6

#: Ways to measure distances.
METHODS = ("heat", "exact")

# the heat method's own error: this share of the distance, at most so many edges, and so many times what
# another t changes (seams shift distances by a multiple of √t, behind them too)
_HEAT_SHARE, _HEAT_EDGES, _HEAT_CHANGE = 0.3, 0.4, 3.0

_KEPT = 2  # factorisations that `factored` remembers


class HeatGeodesics:
    """Geodesic distances from nodes of a closed mesh (Crane, Weischedel and Wardetzky 2013).

    Heat diffuses from the sources for a time t; minus its normalised gradient is the gradient of the
    distance, found by a Poisson equation. Both matrices are factored once, here.

    Parameters
    ----------
    surface_or_mesh : Surface, TriangleMesh or trimesh.Trimesh
        A surface stands for its ``.mesh``. The mesh must be one closed, consistently oriented
        manifold of proper triangles.
    t : float, optional
        Diffusion time, a length squared, from 0.1 h² to 10⁶ areas, h being the mean edge. The default
        `TIME_FACTOR` h² = 4h² suits one source; for many, h² is better (see Notes).

    Raises
    ------
    MeshError
        If the mesh is open, in pieces, not a manifold, badly oriented or degenerate.
    TypeError, ValueError
        If the mesh is something else, or ``t`` is not a number in its range.
    ConvergenceError
        If a trial solve falls far short of straight distances, as with a ``t`` so small for an uneven
        mesh that heat dies out before it has crossed it.

    Notes
    -----
    Accuracy, on spheres of 1000 to 64 000 nodes with t = 4h²: farther than 4 edges from the source a
    distance is low by 0.11 to 0.16 h on average (0.24 h at most). Where paths from two sides meet, and
    behind that seam, it is off by up to 1 h a short way from the source and is too long by 2 to 5 h at
    50 edges (tori, seen from anywhere), by half as much with h²; within 3 edges it is low by 3
    to 16 % *at every refinement* (23 % if the nodes are jittered). Meshes that repeat in space take the own
    solver `IntrinsicHeat`, which mends the seams: 0.2 h root mean square and 1 h at most too long at 40 000
    nodes with t = 4h², instead of 0.4 h and 2.5 h. Never quote it as a length without
    that error. The bisector of two sources, placed by interpolating d1² − d2² linearly along mesh
    edges (never d1 − d2), is off by 0.006 h on average 7 edges from them, by 0.04 h 40 edges away.

    One solve from several sources smooths the field over √t where their regions meet, which shifts it
    by a constant round each source (up to 0.25 h with t = h², 0.5 h with 4h²) and by more towards
    the seams (up to 1.5 and 3 h). Where that matters take the minimum of one solve a source, as
    `geodesic_distances` does. Near the sources the shift hardly varies: with equal colours 5 spacings
    apart, t = h² (`COLOUR_TIME_FACTOR`) and the value at its source taken off each region, the
    bisectors of 400 to 3000 seeds are off by 0.02 h on average and 0.2 h at most; with 4h² by twice
    as much.

    Factoring takes 0.03 s at 4000 nodes and 1.5 s at 64 000, about n^1.4; a solve 1 and 35 ms.

    Examples
    --------
    >>> from warpedfoam.surfaces import Sphere
    >>> heat = HeatGeodesics(Sphere(radius=1.0).triangulate(2562))
    >>> south = int(heat.mesh.nodes[:, 2].argmin())
    >>> north = int(heat.mesh.nodes[:, 2].argmax())
    >>> float(heat.distances(south)[north].round(1))
    3.1
    """

    __slots__ = ("_data", "_mesh", "_t")

    def __init__(
        self, surface_or_mesh: Surface | TriangleMesh | trimesh.Trimesh, t: float | None = None
    ) -> None:
        self._mesh = as_mesh(surface_or_mesh)
        self._mesh.require_surface()
        self._t = _time(self._mesh, t)
        self._data = _factor(self._mesh, self._t)
        self._try_out()

    @property
    def mesh(self) -> TriangleMesh:
        """The mesh that was factored."""
        return self._mesh

    @property
    def t(self) -> float:
        """Diffusion time."""
        return self._t

    def distances(self, sources: ArrayLike) -> Floats:
        """Distance of every node from the nearest of the sources.

        Parameters
        ----------
        sources : int or (k,) integer array
            Node indices; repeats count once.

        Returns
        -------
        (n_nodes,) array
            From one solve. With one source 0 there; with several only its mean over the sources is 0, so
            that it may be a little negative, and it is less accurate (see `HeatGeodesics`).

        Raises
        ------
        TypeError, ValueError
            If ``sources`` is empty, not integers, or out of range.
        ConvergenceError
            If a distance is not finite: ``t`` is too small or too large for the mesh.
        """
        import igl

        nodes = _source_nodes(sources, self._mesh.n_nodes)
        if isinstance(self._data, IntrinsicHeat):
            found = self._data.solve(nodes)
        else:
            found = igl.heat_geodesics_solve(self._data, nodes)
        out: Floats = np.asarray(found, dtype=np.float64)
        if out.shape != (self._mesh.n_nodes,) or not np.isfinite(out).all():
            raise ConvergenceError(f"the heat method gave distances that are not finite; {self._advice()}")
        return out

    def _try_out(self) -> None:
        """Refuse a t whose distances are shorter than straight lines by more than a fifth and 2 edges."""
        nodes = self._mesh.nodes
        source = int(((nodes - nodes[0]) ** 2).sum(axis=1).argmax())
        straight = np.linalg.norm(nearest_image(nodes - nodes[source], self._mesh.period), axis=1)
        short = 0.8 * straight - 2.0 * self._mesh.edge_lengths.max() - self.distances(source)
        if short[worst := int(short.argmax())] > 0.0:
            raise ConvergenceError(
                f"the heat method puts nodes {source} and {worst} closer together than the straight line "
                f"between them, {straight[worst]:.3g}; {self._advice()}"
            )

    def _advice(self) -> str:
        best = TIME_FACTOR * self._mesh.mean_edge**2
        return f"t = {self._t:g} is too small or too large, take about {best:.3g}"


@dataclass(frozen=True, eq=False)
class GeodesicDistances:
    """``distances`` (n_nodes,) by ``method``; ``error`` (n_nodes,) bounds what most are off by."""

    distances: Floats
    error: Floats
    method: str


def geodesic_distances(
    surface_or_mesh: Surface | TriangleMesh | trimesh.Trimesh,
    sources: ArrayLike,
    t: float | None = None,
    *,
    method: str = "heat",
    radius: float | None = None,
) -> Floats:
    """Distance of every node of a mesh from the nearest source; `geodesic_report` adds the error.

    Parameters
    ----------
    surface_or_mesh, t
        See `HeatGeodesics`, for its accuracy too; ``t`` is for "heat" only.
    sources : int, (k,) integer array, or (k, 3) float array
        Integers are node indices, floats points on the surface.
    method : {"heat", "exact"}
        "heat" is quick and off by a tenth of an edge and more; "exact" is the length of the shortest
        path on the mesh, which differs from that on the surface by order h².
    radius : float, optional
        Nodes farther than this get infinity; "exact" leaves them out of its work.

    Returns
    -------
    (n_nodes,) array

    Raises
    ------
    MeshError
        If the mesh is open, in pieces, not a manifold, badly oriented or degenerate.
    TypeError, ValueError
        If an argument is of the wrong kind or out of range, a point is farther than an edge from the
        mesh, ``t`` is given with "exact", or "exact" lacks a radius below about half the period on a
        mesh that repeats in space.
    ConvergenceError
        If libigl fails on the mesh.

    Notes
    -----
    "heat" takes one solve a node: `HeatGeodesics.distances` does many in one, less accurately. A point
    s = Σ λ_i v_i of a triangle takes three, as d² = Σ λ_i (d_i² − |v_i − s|²), which is exact in the
    plane. The factorisations of the last few meshes are kept.

    "exact" (Mitchell, Mount and Papadimitriou 1987) puts a point into its triangle as a node, which is
    a quarter nearer to the truth than that formula. Distances are low by 0.11 k² h² d on a sphere of
    curvature k. One source takes 2 s at 10⁴ nodes and 50 s at 4·10⁴ (about n^2.3, so that 10⁵ take
    minutes); with a radius it takes the time of the patch, 0.08 s for 20 edges and 0.5 to 0.8 s for 40,
    at 10⁴ nodes as at 10⁵. The patch grows until no path out of it can be shorter. Several nodes share
    one run unless the mesh repeats in space; each point takes its own.

    Examples
    --------
    >>> from warpedfoam.surfaces import Torus
    >>> torus = Torus(major_radius=20.0, minor_radius=4.0)
    >>> top = np.linalg.norm(torus.mesh.nodes - [20.0, 0.0, 4.0], axis=1).argmin()
    >>> d = geodesic_distances(torus, [[24.0, 0.0, 0.0]])
    >>> bool(abs(d[top] - 2.0 * np.pi) < 0.15)
    True
    >>> d = geodesic_distances(torus, [[24.0, 0.0, 0.0]], method="exact", radius=7.0)
    >>> bool(abs(d[top] - 2.0 * np.pi) < 0.02)
    True
    """
    method, radius = as_choice(method, "method", METHODS), _radius(radius)
    if method == "heat":
        out = _heat_distances(surface_or_mesh, sources, t)
        return out if radius is None else np.where(out <= radius, out, np.inf)
    if t is not None:
        raise ValueError(f"t is for method='heat' only, got t = {t} with method='exact'")
    mesh = as_mesh(surface_or_mesh)
    mesh.require_surface()
    array = _as_array(sources)
    if array.dtype.kind != "f":
        return exact_distances(mesh, _source_nodes(array, mesh.n_nodes), radius)
    points = as_points(array, "sources")
    _nearest_nodes(mesh, points)
    return exact_distances(mesh, points, radius)


def geodesic_report(
    surface_or_mesh: Surface | TriangleMesh | trimesh.Trimesh,
    sources: ArrayLike,
    t: float | None = None,
    *,
    method: str = "heat",
    radius: float | None = None,
) -> GeodesicDistances:
    """Return `geodesic_distances` with an estimate of what each is off by on the smooth surface.

    Parameters
    ----------
    surface_or_mesh, sources, t, method, radius
        See `geodesic_distances`. The mesh's nodes are taken to lie on a smooth surface.

    Returns
    -------
    GeodesicDistances
        Its errors are above the true ones at 95 % of the nodes or more, but not all, and no more than
        10 times as large on average; infinite where the distances are.

    Raises
    ------
    MeshError, TypeError, ValueError, ConvergenceError
        As `geodesic_distances`.

    Notes
    -----
    The mesh's part is 1.5 ∫ |II(s, s) δ| + ½ (∂_s δ)² ds along each geodesic of direction s, where
    δ = ½ Σ λ_i λ_j II_ij is the height of the surface above a triangle and II_ij = (n_j − n_i) ·
    (x_j − x_i) comes from the nodes' normals: 0.22 k² h² d on a sphere of even triangles, where
    distances are 0.11 k² h² d short. On surfaces bent to both sides it counts what may cancel.

    "heat" adds min(0.3 d, 0.4 h) and thrice the change that another diffusion time makes, h² (4h² if
    t < 2h²), since seams shift distances by multiples of √t. That takes as long again.

    On spheres, tori, ellipsoids and Schwarz's P surface "exact" is bounded at 99 % of the nodes or more
    by 2.1 to 6 times its mean error; "heat" at 96 % or more by
    2 to 9 times.

    Examples
    --------
    >>> from warpedfoam.surfaces import Sphere
    >>> mesh = Sphere(radius=1.0).triangulate(642)
    >>> found = geodesic_report(mesh, [0], method="exact")
    >>> truth = np.arccos(np.clip(mesh.nodes @ mesh.nodes[0], -1.0, 1.0))
    >>> bool((np.abs(found.distances - truth) <= found.error + 1e-7).all())
    True
    """
    distances = geodesic_distances(surface_or_mesh, sources, t, method=method, radius=radius)
    mesh = as_mesh(surface_or_mesh)
    if method == "exact":
        return GeodesicDistances(distances, polyhedral_error(mesh, distances), method)
    every = _heat_distances(mesh, sources, t)
    unit = mesh.mean_edge**2
    other = TIME_FACTOR * unit if _time(mesh, t) < 2.0 * unit else unit
    change = np.abs(every - _heat_distances(mesh, sources, other))
    own = np.minimum(_HEAT_SHARE * every, _HEAT_EDGES * mesh.mean_edge)
    error = polyhedral_error(mesh, every) + own + _HEAT_CHANGE * change
    return GeodesicDistances(distances, np.where(np.isfinite(distances), error, np.inf), method)


def _heat_distances(
    surface_or_mesh: Surface | TriangleMesh | trimesh.Trimesh, sources: ArrayLike, t: float | None
) -> Floats:
    heat = factored(surface_or_mesh, t)
    array = _as_array(sources)
    best = np.full(heat.mesh.n_nodes, np.inf)
    if array.dtype.kind != "f":
        for node in _source_nodes(array, heat.mesh.n_nodes):
            np.minimum(best, heat.distances(node), out=best)
        return best
    points = as_points(array, "sources")
    _nearest_nodes(heat.mesh, points)
    triangles, shares = locate(heat.mesh, points)
    corners = heat.mesh.triangles[triangles]
    lifts = (nearest_image(heat.mesh.nodes[corners] - points[:, None], heat.mesh.period) ** 2).sum(axis=2)
    for nodes, share, lift in zip(corners, shares, lifts, strict=True):
        squares = np.stack([heat.distances(node) for node in nodes]) ** 2
        np.minimum(best, share @ (squares - lift[:, None]), out=best)
    out: Floats = np.sqrt(np.maximum(best, 0.0))
    return out


def as_mesh(surface_or_mesh: object) -> TriangleMesh:
    """The `TriangleMesh` of a surface, a mesh or a ``trimesh.Trimesh``; a ``TypeError`` else."""
    if isinstance(surface_or_mesh, TriangleMesh):
        return surface_or_mesh
    mesh = getattr(surface_or_mesh, "mesh", None)
    if isinstance(mesh, TriangleMesh):
        return mesh
    if hasattr(surface_or_mesh, "faces") and hasattr(surface_or_mesh, "vertices"):
        return TriangleMesh.from_trimesh(surface_or_mesh)  # type: ignore[arg-type]
    raise TypeError(
        "surface_or_mesh must be a Surface, a TriangleMesh or a trimesh.Trimesh, "
        f"got {type(surface_or_mesh).__name__}"
    )


_remembered: OrderedDict[tuple[bytes, float], HeatGeodesics] = OrderedDict()


def factored(
    surface_or_mesh: Surface | TriangleMesh | trimesh.Trimesh, t: float | None = None
) -> HeatGeodesics:
    """`HeatGeodesics`, taken from the last few made if one has equal nodes, triangles, periods and t."""
    mesh = as_mesh(surface_or_mesh)
    key = (_digest(mesh), _time(mesh, t))
    found = _remembered.pop(key, None)
    if found is None:
        found = HeatGeodesics(mesh, t)
    _remembered[key] = found
    while len(_remembered) > _KEPT:
        _remembered.popitem(last=False)
    return found


def _time(mesh: TriangleMesh, t: float | None) -> float:
    unit = mesh.mean_edge**2
    time = TIME_FACTOR * unit if t is None else as_number(t, "t", positive=True)
    least, greatest = _LEAST_FACTOR * unit, _GREATEST_FACTOR * mesh.area
    if not least <= time <= greatest:
        raise ValueError(
            f"t must be from {least:.3g} to {greatest:.3g} on this mesh, got {time:g}; "
            f"{TIME_FACTOR:g} squared mean edges, {TIME_FACTOR * unit:.3g}, suit most"
        )
    return time


def _digest(mesh: TriangleMesh) -> bytes:
    state = blake2b(mesh.nodes.tobytes(), digest_size=16)
    state.update(mesh.triangles.tobytes())
    if mesh.period is not None:
        state.update(mesh.period.tobytes())
    return state.digest()


def _factor(mesh: TriangleMesh, t: float) -> Any:
    """Factor with libigl; the mesh must have passed `require_surface`.

    The Laplacian is singular, and libigl relies on round-off to keep its last pivot from 0. A cube's
    or a regular tetrahedron's is exactly 0, so a second try moves the nodes by 1e-12 edges.
    """
    if mesh.period is not None:
        return IntrinsicHeat(mesh.corners, mesh.triangles, mesh.n_nodes, t)
    import igl

    nudge = 1e-12 * mesh.mean_edge * np.random.default_rng(0).uniform(-1.0, 1.0, mesh.nodes.shape)
    for nodes in (mesh.nodes, mesh.nodes + nudge):
        data = igl.HeatGeodesicsData()
        try:
            igl.heat_geodesics_precompute(nodes, mesh.triangles, t, data)
        except RuntimeError as fault:
            reason = fault
        else:
            return data
    raise MeshError(
        f"the heat equation of this mesh cannot be factored with t = {t:g} ({reason}); "
        "remesh it with more even triangles, or scale it to a size near 1"
    )


def _as_array(sources: ArrayLike) -> NDArray[Any]:
    try:
        return np.asarray(sources)
    except ValueError as fault:
        raise ValueError(f"sources must be one node, a list of nodes or (k, 3) points: {fault}") from None


def _source_nodes(sources: ArrayLike, n_nodes: int) -> Ints:
    array = np.atleast_1d(_as_array(sources))
    if not array.size:
        raise ValueError("sources is empty: name at least one node")
    nodes = as_indices(array, "sources", (None,), below=n_nodes)
    out: Ints = frozen(np.unique(nodes))
    return out


def _radius(radius: float | None) -> float | None:
    return None if radius is None else as_number(radius, "radius", positive=True)


def _nearest_nodes(mesh: TriangleMesh, points: Floats) -> Ints:
    """Node nearest to each point; a ``ValueError`` if it is farther than an edge."""
    offset, node = Places(mesh.nodes, mesh.period).nearest(points)
    if (far := offset > mesh.edge_lengths.max()).any():
        bad = int(np.flatnonzero(far)[0])
        raise ValueError(
            f"sources must be points on the surface, but point {bad} is {offset[bad]:g} from the nearest "
            "node; project them first"
        )
    return node
