"""What is wrong with a triangle mesh, and what can be mended without guessing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from warpedfoam.arrays import Bools, Floats, Ints, as_instance, as_integer, as_number
from warpedfoam.errors import MeshError
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.mesh_surface import MeshSurface

#: Nodes nearer than this share of the mesh's size coincide; angles below it are slivers (degrees);
#: neighbouring triangles that turn by more are a crease (degrees); edges a bubble should span.
COINCIDENT, SLIVER, CREASE, EDGES = 1e-9, 5.0, 60.0, 3.0


@dataclass(frozen=True)
class MeshFinding:
    """One thing found: ``fault`` in a few words, how often, the first place, what to do about it.

    ``fatal`` findings keep the mesh from carrying a foam; the others cost accuracy.
    """

    fault: str
    count: int
    where: str
    advice: str
    fatal: bool


@dataclass(frozen=True)
class MeshReport:
    """Findings on a mesh and the facts about it.

    Attributes
    ----------
    findings : tuple of MeshFinding
    n_nodes, n_triangles, components, rims, euler_characteristic : int
    area, mean_edge, least_angle : float
        Of the flat triangles; the angle in degrees.
    curvature_range : tuple of two float or None
        Of the smooth surface, if the mesh makes one.
    """

    findings: tuple[MeshFinding, ...]
    n_nodes: int
    n_triangles: int
    components: int
    rims: int
    euler_characteristic: int
    area: float
    mean_edge: float
    least_angle: float
    curvature_range: tuple[float, float] | None

    @property
    def sound(self) -> bool:
        """Whether the mesh can carry a foam."""
        return not any(finding.fatal for finding in self.findings)


def mesh_report(mesh: TriangleMesh, *, gap: float | None = None, n_bubbles: int | None = None) -> MeshReport:
    """Look for everything that keeps a mesh from carrying a foam, or makes it a poor one.

    Parameters
    ----------
    mesh : TriangleMesh
    gap : float, optional
        Also tell whether plates this far apart would fold.
    n_bubbles : int, optional
        Also tell whether the mesh is fine enough for so many bubbles.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range.

    Examples
    --------
    >>> from warpedfoam import Sphere
    >>> ball = Sphere(1.0).triangulate(500)
    >>> report = mesh_report(TriangleMesh(ball.nodes, ball.triangles[1:]))
    >>> report.sound, report.rims, report.findings[0].fault
    (False, 1, 'open edges')
    """
    as_instance(mesh, "mesh", TriangleMesh)
    d = None if gap is None else as_number(gap, "gap", positive=True)
    count = None if n_bubbles is None else as_integer(n_bubbles, "n_bubbles", minimum=1)
    found: list[MeshFinding] = []

    def add(fault: str, bad: Bools | Ints, kind: str, advice: str, *, fatal: bool = True) -> None:
        places = np.flatnonzero(bad) if bad.dtype == bool else bad
        if len(places):
            found.append(MeshFinding(fault, len(places), f"{kind} {int(places[0])}", advice, fatal))

    tri, n = mesh.triangles, mesh.n_nodes
    used = np.zeros(n, dtype=np.bool_)
    used[tri] = True
    add("nodes without triangles", ~used, "node", "remove them")
    twice = (tri == np.roll(tri, 1, axis=1)).any(axis=1)
    add("triangles that use a node twice", twice, "triangle", "remove them")
    size = float(np.ptp(mesh.nodes, axis=0).max())
    pairs = cKDTree(mesh.nodes).query_pairs(COINCIDENT * size, output_type="ndarray")
    add("nodes at the same place", np.unique(pairs[:, 1]), "node", "merge them", fatal=False)
    _, first, tally = np.unique(np.sort(tri, axis=1), axis=0, return_index=True, return_counts=True)
    add("triangles that occur twice", first[tally > 1], "triangle", "keep one of each")
    angle = _least_angles(mesh)
    add("triangles without area", ~twice & ~(angle > 1e-6), "triangle", "collapse them")
    thin = (angle > 1e-6) & (angle < SLIVER)
    add(f"slivers (an angle below {SLIVER:g} degrees)", thin, "triangle", "remesh more evenly", fatal=False)
    edges = _Edges(mesh)
    add("edges with more than two triangles", edges.crowded, "edge at node", "split or remove extra sheets")
    add("triangles turned against a neighbour", edges.flipped, "edge at node", "turn them round")
    add("open edges", edges.open_, "edge at node", "close the holes: rims are not supported yet")
    pieces, piece = connected_components(edges.graph, directed=False)
    pieces -= int((~used).sum())
    if pieces > 1:
        sizes = np.bincount(piece)
        found.append(
            MeshFinding("separate components", pieces, f"largest of {sizes.max()} nodes", "keep one", True)
        )
    if not any(finding.fatal for finding in found):
        found += _pinched(mesh)
    rims = _rim_count(edges.rim, n)
    curvatures = None
    if not any(finding.fatal for finding in found):
        found += _closed_findings(mesh)
        curvatures = MeshSurface(mesh.nodes, mesh.triangles).curvature_range()
        if d is not None and 1.0 + d * curvatures[0] <= 0.0:
            advice = f"take a gap below {-1.0 / curvatures[0]:.3g}, or smooth the mesh"
            found.append(MeshFinding(f"plates fold at gap {d:g}", 1, "the tightest hollow", advice, True))
        if count is not None and np.sqrt(mesh.area / count) < EDGES * mesh.mean_edge:
            enough = int(np.ceil(EDGES**2 / 0.86 * count))
            advice = f"about {enough} nodes show the shape between bubbles (refined by itself)"
            found.append(MeshFinding(f"coarse for {count} bubbles", 1, "everywhere", advice, False))
    return MeshReport(
        tuple(found),
        n,
        mesh.n_triangles,
        int(pieces),
        rims,
        mesh.euler_characteristic,
        mesh.area,
        mesh.mean_edge,
        float(angle.min()),
        curvatures,
    )


def repaired(mesh: TriangleMesh) -> tuple[TriangleMesh, tuple[str, ...]]:
    """The mesh after safe repairs by trimesh, and what was done; shape is not changed.

    Merges nodes at the same place, drops doubled and flat triangles and unused nodes, keeps the
    largest component, turns triangles the same way round and outwards, and closes holes of three or
    four edges.

    Raises
    ------
    MeshError
        If nothing is left.

    Examples
    --------
    >>> from warpedfoam import Sphere
    >>> ball = Sphere(1.0).triangulate(500)
    >>> mended, done = repaired(TriangleMesh(ball.nodes, ball.triangles[1:]))
    >>> mesh_report(mended).sound, done
    (True, ('closed 1 hole',))
    """
    import trimesh

    as_instance(mesh, "mesh", TriangleMesh)
    work, done = mesh.to_trimesh(), []

    def note(text: str, count: int) -> None:
        if count:
            done.append(f"{text.format(count)}{'' if count == 1 else 's'}")

    before = len(work.vertices)
    work.merge_vertices()
    note("merged {} node", before - len(work.vertices))
    before = len(work.faces)
    work.update_faces(work.nondegenerate_faces())
    work.update_faces(work.unique_faces())
    note("dropped {} triangle", before - len(work.faces))
    if not len(work.faces):
        raise MeshError("nothing is left of the mesh: all its triangles are flat")
    parts = trimesh.graph.connected_components(work.face_adjacency, nodes=np.arange(len(work.faces)))
    if len(parts) > 1:
        keep = np.zeros(len(work.faces), dtype=np.bool_)
        keep[max(parts, key=len)] = True
        work.update_faces(keep)
        note("dropped {} component", len(parts) - 1)
    before = len(work.vertices)
    work.remove_unreferenced_vertices()
    note("dropped {} unused node", before - len(work.vertices))
    old = np.array(work.faces)
    trimesh.repair.fix_winding(work)  # type: ignore[no-untyped-call]
    note("turned {} triangle", _turned(old, np.asarray(work.faces)))
    holes = _rim_count(_Edges(TriangleMesh.from_trimesh(work)).rim, len(work.vertices))
    if holes:
        work.fill_holes()
        left = _rim_count(_Edges(TriangleMesh.from_trimesh(work)).rim, len(work.vertices))
        note("closed {} hole", holes - left)
    if work.is_watertight and work.volume < 0.0:
        work.invert()
        done.append("turned the mesh outwards")
    return TriangleMesh.from_trimesh(work), tuple(done)


class _Edges:
    """Edges of a mesh by their fault: nodes where they start."""

    def __init__(self, mesh: TriangleMesh) -> None:
        n = mesh.n_nodes
        start, end = mesh.triangles.ravel(), np.roll(mesh.triangles, -1, axis=1).ravel()
        proper = start != end
        start, end = start[proper], end[proper]
        directed, times = np.unique(start * n + end, return_counts=True)
        both, uses = np.unique(np.minimum(start, end) * n + np.maximum(start, end), return_counts=True)
        self.crowded: Ints = both[uses > 2] // n
        doubled = directed[times > 1]
        crowded = both[uses > 2]
        low, high = np.minimum(doubled // n, doubled % n), np.maximum(doubled // n, doubled % n)
        self.flipped: Ints = (doubled // n)[~np.isin(low * n + high, crowded)]
        self.open_: Ints = both[uses == 1] // n
        self.rim: Ints = np.stack([both[uses == 1] // n, both[uses == 1] % n], axis=1)
        self.graph = coo_array((np.ones(len(start)), (start, end)), shape=(n, n))


def _least_angles(mesh: TriangleMesh) -> Floats:
    """Least angle of each triangle, degrees."""
    corners = mesh.nodes[mesh.triangles]
    least = np.full(len(corners), 180.0)
    for i in range(3):
        a, b = corners[:, (i + 1) % 3] - corners[:, i], corners[:, (i + 2) % 3] - corners[:, i]
        sine = np.linalg.norm(np.cross(a, b), axis=1)
        least = np.minimum(least, np.degrees(np.arctan2(sine, np.einsum("nx,nx->n", a, b))))
    return least


def _pinched(mesh: TriangleMesh) -> list[MeshFinding]:
    try:
        mesh.require_closed_surface()
    except MeshError as fault:
        return [MeshFinding("not a manifold", 1, "a node", str(fault), True)]
    return []


def _closed_findings(mesh: TriangleMesh) -> list[MeshFinding]:
    """What may be wrong with a proper closed mesh: inside out, or creased."""
    out = []
    a, b, c = (mesh.nodes[mesh.triangles[:, i]] for i in range(3))
    if np.einsum("nx,nx->", a, np.cross(b, c)) < 0.0:
        advice = "the gap lies inside; turn all triangles round if it should lie outside"
        out.append(MeshFinding("inside out", 1, "everywhere", advice, False))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    n = mesh.n_nodes
    start, end = mesh.triangles.ravel(), np.roll(mesh.triangles, -1, axis=1).ravel()
    order = np.argsort(start * n + end)
    twin = order[np.searchsorted((start * n + end)[order], end * n + start)]
    owner = np.repeat(np.arange(mesh.n_triangles), 3)
    cosine = np.einsum("nx,nx->n", normal[owner], normal[owner[twin]])
    sharp = np.flatnonzero((cosine < np.cos(np.radians(CREASE))) & (start < end))
    if len(sharp):
        advice = "it will be rounded off over an edge or two; use a finer or smoother mesh"
        out.append(
            MeshFinding(
                f"creases (over {CREASE:g} degrees)",
                len(sharp),
                f"edge at node {int(start[sharp[0]])}",
                advice,
                False,
            )
        )
    return out


def _rim_count(rim: Ints, n: int) -> int:
    """Number of connected chains of open edges."""
    if not len(rim):
        return 0
    graph = coo_array((np.ones(len(rim)), (rim[:, 0], rim[:, 1])), shape=(n, n))
    _, piece = connected_components(graph, directed=False)
    return len(np.unique(piece[rim[:, 0]]))


def _turned(old: Ints, new: Ints) -> int:
    """How many triangles run the other way round than before."""
    least = np.argmin(old, axis=1)
    rows = np.arange(len(old))
    after_old = old[rows, (least + 1) % 3]
    least = np.argmin(new, axis=1)
    return int((after_old != np.asarray(new)[rows, (least + 1) % 3]).sum())
