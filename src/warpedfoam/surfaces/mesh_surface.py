"""`MeshSurface`: a smooth surface reconstructed from a triangle mesh."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from os import PathLike, fspath
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.spatial import cKDTree

from warpedfoam.arrays import Bools, Floats, Ints, as_integer, frozen
from warpedfoam.errors import MeshError
from warpedfoam.kernels.height_arcs import dots
from warpedfoam.kernels.jets import Jets, blended, fit_jets
from warpedfoam.surfaces.files import read_mesh
from warpedfoam.surfaces.level import LevelSurface, Look
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import SIZES

if TYPE_CHECKING:
    import trimesh

#: Radius of a node's ball in its spacings and in its longest edge; rings of the fit; neighbours kept.
REACH, COVER, RINGS, MOST = 1.5, 0.75, 3, 48
#: Quadrature points to an edge from a bubble's centre to its rim, and two more: fewer miss the ripples of
#: the curvatures from node to node. Nodes per pass of the search for neighbours.
RAYS, PASS = 1.6, 32_768
#: Sheets whose normals differ by more than this cosine do not blend.
SAME_SHEET = 0.2
#: Farthest from the origin, in extents of the mesh: beyond it round-off shows in the forces. Largest
#: error of the total curvature, in units of 2π: with more the patches do not make up one surface.
FARTHEST, TOTAL_CURVATURE = 1e3, 0.1
#: Cosine of the angle by which a rim's edges turn in a corner.
CORNER = np.cos(np.radians(45.0))
SMOOTHER = "the mesh is too rough, too coarse or crosses itself there: smooth, refine or remesh it"


@dataclass(frozen=True, eq=False, repr=False)
class MeshSurface(LevelSurface):
    """Smooth surface through a triangle mesh, the gap on the side to which its triangles face.

    At each node a quartic jet is fitted to the nodes of three rings, and the jets are blended into one
    implicit function (`warpedfoam.kernels.jets`), four times differentiable, so that Newton's method
    converges as on formulas. The nodes are samples of the surface, not fixed points of it: noise of
    size ε shows as 0.5 ε. Where the mesh ends, so does the surface: its rim is a spline through the
    nodes there, with corners where they turn by more than 45°.

    Parameters
    ----------
    nodes : (n, 3) array
    triangles : (m, 3) integer array

    Raises
    ------
    TypeError, ValueError, MeshError
        If the arrays are no connected, consistently oriented manifold of proper triangles, or too rough
        or coarse to pass a smooth surface through.

    Notes
    -----
    Measured orders in the edge length h, on jittered tori and spheres: positions h⁵·⁴ to h⁵·⁹, normals h⁴·⁷
    to h⁵, curvatures h⁴, area h⁶.

    Examples
    --------
    >>> from warpedfoam import Sphere
    >>> mesh = Sphere(2.0).triangulate(2500)
    >>> ball = MeshSurface(mesh.nodes, mesh.triangles)
    >>> bool(abs(ball.area / (16.0 * np.pi) - 1.0) < 1e-6)
    True
    """

    nodes: Floats
    triangles: Ints

    symmetry = 1e-7

    def __init__(self, nodes: ArrayLike, triangles: ArrayLike) -> None:
        mesh = TriangleMesh(nodes, triangles)
        fault = placement_fault(mesh)
        if fault:
            raise MeshError(fault)
        mesh.require_surface()
        object.__setattr__(self, "nodes", mesh.nodes)
        object.__setattr__(self, "triangles", mesh.triangles)
        self.__dict__["source"] = mesh
        self._require_smooth()

    @cached_property
    def source(self) -> TriangleMesh:
        """The mesh as given."""
        return TriangleMesh(self.nodes, self.triangles)

    def __repr__(self) -> str:
        return f"MeshSurface({self.source.n_nodes} nodes, {self.source.n_triangles} triangles)"

    def _require_smooth(self) -> None:
        """Look at the surface where integrals will; nothing is done twice, the results are kept.

        Raises
        ------
        MeshError
            If the surface has gaps, or its total curvature is not 2πχ.
        """
        with np.errstate(all="ignore"):
            try:
                rule = self._patches.quadrature()
                total = self._moments[2]
                if self.rim is not None:
                    start = np.zeros(self.rim.n_loops)
                    total += self.rim.turning(np.arange(len(start)), start, self.rim.lengths).sum()
                total /= 2.0 * np.pi
            except np.linalg.LinAlgError:
                raise MeshError(f"no smooth surface passes through the mesh; {SMOOTHER}") from None
        torn = ~(np.isfinite(rule.points).all(axis=1) & np.isfinite(rule.weights))
        if torn.any():
            fine = self.triangulate(self.integral_nodes)
            first = int(np.flatnonzero(torn)[0]) * fine.n_triangles // len(rule.weights)
            raise MeshError(self._torn(fine.nodes[fine.triangles[first, 0]]))
        if not abs(total - self.euler_characteristic) < TOTAL_CURVATURE:
            raise MeshError(
                "no smooth surface passes through the mesh: the total curvature would be "
                f"{total:.4g} x 2 pi, not {self.euler_characteristic} x 2 pi; {SMOOTHER}"
            )

    def _torn(self, start: Floats) -> str:
        """Where the surface is missing, given a point from which it was not found."""
        node = int(cKDTree(self.source.nodes).query(start)[1])
        x, y, z = self.source.nodes[node]
        return f"no smooth surface passes near node {node} at ({x:.4g}, {y:.4g}, {z:.4g}); {SMOOTHER}"

    @classmethod
    def from_trimesh(cls, mesh: trimesh.Trimesh) -> MeshSurface:
        """Surface of a ``trimesh.Trimesh``, its nodes and faces as they are."""
        given = TriangleMesh.from_trimesh(mesh)
        return cls(given.nodes, given.triangles)

    @classmethod
    def from_file(cls, path: str | PathLike[str]) -> MeshSurface:
        """Surface of a mesh file that trimesh reads: PLY, OBJ, STL, OFF or GLB.

        Raises
        ------
        FileNotFoundError, MeshError
            See `read_mesh`; also if the mesh is one that `MeshSurface` refuses. ``warpedfoam check FILE``
            tells all that is wrong with it and mends some of it.
        """
        mesh = read_mesh(path)
        try:
            return cls(mesh.nodes, mesh.triangles)
        except MeshError as fault:
            name = fspath(path)
            advice = f"see all of it, and mend it, with: warpedfoam check {name} --repair mended.ply"
            raise MeshError(f"{name}: {fault}; {advice}") from fault

    def rim_loops(self) -> Sequence[Sequence[Floats]]:
        """The mesh's rim on the smooth surface, cut into sides at its corners."""
        nodes = self._refined(0).nodes
        return [_sides(nodes[loop], self._unit(nodes[loop])) for loop in self.source.rim_loops]

    def beyond(self, points: Floats) -> Bools:
        """Next to a node of the rim, and on the far side of the rim."""
        far = np.zeros(len(points), dtype=np.bool_)
        if self.rim is not None:
            at_rim = np.zeros(self.source.n_nodes, dtype=np.bool_)
            at_rim[self.source.rim_edges] = True
            near = np.flatnonzero(at_rim[self._jets[2].query(points)[1]])
            far[near] = self.rim.beyond(points[near])
        return far

    @property
    def size(self) -> float:
        """Distance of the farthest node from the origin, and a little more."""
        return 1.01 * float(np.linalg.norm(self.source.nodes, axis=1).max())

    @property
    def euler_characteristic(self) -> int:
        """χ of the mesh."""
        return self.source.euler_characteristic

    @cached_property
    def _jets(self) -> tuple[Jets, Ints, cKDTree]:
        mesh = self.source
        longest, spacing = _edge_sizes(mesh)
        reach = np.maximum(REACH * spacing, COVER * longest)
        rings = _rings(mesh, RINGS)
        near = _padded(mesh.nodes, rings, MOST)
        jets = fit_jets(mesh.nodes, max_normals(mesh), spacing, reach, near)
        return jets, _candidates(jets, rings, longest), cKDTree(mesh.nodes)

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """The blended jets."""
        jets, candidates, tree = self._jets
        finite = np.nan_to_num(points, nan=0.0, posinf=0.0, neginf=0.0)
        nearest = np.asarray(tree.query(finite)[1], dtype=np.int64)
        return blended(jets, points, nearest, candidates, second=second)

    def near(self, points: Floats) -> Look:
        """The blended jets, the nearest nodes found once: half a spacing from one its candidates will do."""
        jets, candidates, tree = self._jets
        start = np.nan_to_num(points, nan=0.0, posinf=0.0, neginf=0.0)
        nearest = np.asarray(tree.query(start)[1], dtype=np.int64)

        def look(places: Floats, which: Ints | slice, second: bool) -> tuple[Floats, Floats, Floats | None]:
            node = nearest[which]
            away = places - start[which]
            far = np.flatnonzero(~(dots(away, away) <= (0.5 * jets.spacing[node]) ** 2))
            if far.size:
                node = node.copy()
                node[far] = tree.query(np.nan_to_num(places[far], nan=0.0, posinf=0.0, neginf=0.0))[1]
            return blended(jets, places, node, candidates, second=second)

        return look

    def least_rays(self, n_loops: int) -> int:
        """In proportion to the edges between a bubble's centre and its rim."""
        radius = float(np.sqrt(self.area / (np.pi * max(n_loops, 1))))
        return int(np.ceil(RAYS * radius / self.source.mean_edge)) + 2

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """The given mesh, its nodes moved to the smooth surface; halved edges until there are enough."""
        count = as_integer(n_nodes, "n_nodes", minimum=4)
        halvings = max(0, int(np.ceil(np.log(count / (1.5 * self.source.n_nodes)) / np.log(4.0))))
        return self._refined(halvings)

    def _refined(self, halvings: int) -> TriangleMesh:
        known: dict[int, TriangleMesh] = self.__dict__.setdefault("_meshes", {})
        if halvings not in known:
            if halvings == 0:
                start = self.source.nodes.copy()
                nodes = self.foot(start, max_normals(self.source))
                triangles = self.source.triangles
            else:
                coarse = self._refined(halvings - 1)
                points, triangles = _halved(coarse)
                if self.rim is not None:
                    # the rim between two of its nodes is curved
                    edge, ends = _rim_places(coarse), coarse.nodes[coarse.rim_edges]
                    loop, first, last = self.rim.spans(ends[:, 0], ends[:, 1])
                    points[coarse.n_nodes + edge] = self.rim.at(loop, 0.5 * (first + last))
                new = start = points[coarse.n_nodes :]
                nodes = np.concatenate([coarse.nodes, self.foot(new, self._unit(new))])
            lost = np.flatnonzero(~np.isfinite(nodes[-len(start) :]).all(axis=1))
            if lost.size:
                raise MeshError(self._torn(start[lost[0]]))
            known[halvings] = TriangleMesh(frozen(nodes), triangles)
        return known[halvings]


def placement_fault(mesh: TriangleMesh) -> str | None:
    """What is wrong with the size or the place of a mesh, if anything: numbers that lose their digits."""
    extent = float(np.ptp(mesh.nodes / 2.0, axis=0).max()) * 2.0
    farthest = float(np.abs(mesh.nodes).max())
    # the maximum in two ways: an extent may overflow
    if not SIZES["minimum"] <= extent <= SIZES["maximum"]:
        return (
            f"the mesh is {extent:.3g} across, which is outside {SIZES['minimum']:g} … {SIZES['maximum']:g}; "
            "take other units of length, or mend the nodes that stray"
        )
    if farthest > FARTHEST * extent:
        return (
            f"the mesh is {farthest:.3g} from the origin but only {extent:.3g} across, which costs digits; "
            "move it to the origin"
        )
    return None


def max_normals(mesh: TriangleMesh) -> Floats:
    """Node normals by Max's weights, Σ a × b / (|a|² |b|²) over the corners: exact on spheres."""
    total = np.zeros_like(mesh.nodes)
    corners = mesh.nodes[mesh.triangles]
    for i in range(3):
        a = corners[:, (i + 1) % 3] - corners[:, i]
        b = corners[:, (i + 2) % 3] - corners[:, i]
        weight = np.einsum("nx,nx->n", a, a) * np.einsum("nx,nx->n", b, b)
        np.add.at(total, mesh.triangles[:, i], np.cross(a, b) / weight[:, None])
    out: Floats = total / np.linalg.norm(total, axis=1, keepdims=True)
    return out


def _edge_sizes(mesh: TriangleMesh) -> tuple[Floats, Floats]:
    """Longest and mean length of the edges at each node."""
    ends, length = mesh.edges.T.ravel(), np.tile(mesh.edge_lengths, 2)
    longest = np.zeros(mesh.n_nodes)
    np.maximum.at(longest, ends, length)
    return longest, np.bincount(ends, length, mesh.n_nodes) / np.bincount(ends, minlength=mesh.n_nodes)


def _rings(mesh: TriangleMesh, rings: int) -> csr_array:
    """Nodes within so many edges of each node, itself included."""
    a, b = mesh.edges.T
    n = mesh.n_nodes
    ones = np.ones(len(a), dtype=np.int8)
    step = coo_array((ones, (a, b)), shape=(n, n)).tocsr()
    step = csr_array((step + step.T + eye_array(n, dtype=np.int8)).astype(bool))
    out = step
    for _ in range(rings - 1):
        out = csr_array((out @ step).astype(bool))
    return out


def _passes(graph: csr_array) -> Iterator[tuple[Ints, Ints, Ints]]:
    """Nodes of each pass, and row and column of their entries of the graph."""
    for lo in range(0, graph.shape[0], PASS):
        nodes = np.arange(lo, min(lo + PASS, graph.shape[0]))
        row = np.repeat(nodes, np.diff(graph.indptr[lo : lo + len(nodes) + 1]))
        column = graph.indices[graph.indptr[lo] : graph.indptr[lo + len(nodes)]]
        yield nodes, row, np.asarray(column, dtype=np.int64)


def _table(parts: list[tuple[Ints, Ints]], count: int) -> Ints:
    """Columns of each row as (count, k), padded with −1, from entries sorted by row."""
    sizes = np.concatenate([np.bincount(row - row[0]) for row, _ in parts])
    out = np.full((count, int(sizes.max())), -1, dtype=np.int64)
    for row, column in parts:
        first = np.searchsorted(row, row)
        out[row, np.arange(len(row)) - first] = column
    return out


def _padded(points: Floats, graph: csr_array, most: int) -> Ints:
    """Each row's columns as (n, k), padded with −1; the nearest ``most`` of longer rows."""
    parts = []
    for nodes, row, column in _passes(graph):
        size = np.bincount(row - nodes[0])
        long = size[row - nodes[0]] > most
        if long.any():
            r, c = row[long], column[long]
            order = np.lexsort((((points[c] - points[r]) ** 2).sum(axis=1), r))
            kept = np.arange(len(r)) - np.searchsorted(r, r) < most
            r, c = r[order][kept], c[order][kept]
            row, column = np.concatenate([row[~long], r]), np.concatenate([column[~long], c])
            order = np.argsort(row, kind="stable")
            row, column = row[order], column[order]
        parts.append((row, column))
    return _table(parts, len(points))


def _candidates(jets: Jets, rings: csr_array, longest: Floats) -> Ints:
    """Nodes whose balls may reach points next to each node, on the same sheet."""
    normals, parts = np.ascontiguousarray(jets.frames[:, 2]), []
    for _, row, column in _passes(rings):
        apart = jets.points[column] - jets.points[row]
        near = dots(apart, apart) < (jets.reach[column] + COVER * longest[row]) ** 2
        keep = (near & (dots(normals[row], normals[column]) > SAME_SHEET)) | (row == column)
        parts.append((row[keep], column[keep]))
    return _table(parts, len(longest))


def _halved(mesh: TriangleMesh) -> tuple[Floats, Ints]:
    """Nodes and triangles with every edge halved: each triangle becomes four."""
    a, b = mesh.edges.T
    keys = a * mesh.n_nodes + b
    tri = mesh.triangles
    after = np.roll(tri, -1, axis=1)
    key = np.minimum(tri, after) * mesh.n_nodes + np.maximum(tri, after)
    middle = mesh.n_nodes + np.searchsorted(keys, key)
    x, y, z = tri.T
    p, q, r = middle.T
    quarters = [(x, p, r), (p, y, q), (r, q, z), (p, q, r)]
    triangles = np.concatenate([np.stack(quarter, axis=1) for quarter in quarters])
    return np.concatenate([mesh.nodes, 0.5 * (mesh.nodes[a] + mesh.nodes[b])]), triangles


def _sides(points: Floats, normals: Floats) -> list[Floats]:
    """A loop of points (n, 3) cut where its edges turn sharply in the surface."""
    edge = np.roll(points, -1, axis=0) - points
    edge -= np.einsum("nx,nx->n", edge, normals)[:, None] * normals
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    cosine = np.einsum("nx,nx->n", edge, np.roll(edge, 1, axis=0))
    corners = np.flatnonzero(cosine < CORNER)
    if not corners.size:
        return [points]
    turned = np.roll(points, -corners[0], axis=0)
    turned = np.concatenate([turned, turned[:1]])
    cuts = np.append(corners - corners[0], len(points))
    return [turned[a : b + 1] for a, b in pairwise(cuts)]


def _rim_places(mesh: TriangleMesh) -> Ints:
    """Place of each of the rim's edges in ``mesh.edges``."""
    keys = mesh.edges[:, 0] * mesh.n_nodes + mesh.edges[:, 1]
    out: Ints = np.searchsorted(keys, mesh.rim_edges.min(axis=1) * mesh.n_nodes + mesh.rim_edges.max(axis=1))
    return out
