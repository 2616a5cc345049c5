"""What is wrong with a triangle mesh, and what can be mended without guessing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from warpedfoam.arrays import Bools, Floats, Ints, as_instance, as_integer, as_number
from warpedfoam.errors import MeshError
from warpedfoam.surfaces.holes import MOST_EDGES, closed_holes
from warpedfoam.surfaces.mesh import TriangleMesh, flat_triangles
from warpedfoam.surfaces.mesh_surface import MeshSurface, placement_fault
from warpedfoam.surfaces.protocol import SIZES

#: Nodes nearer than this share of the mesh's size coincide; angles below it are slivers (degrees);
#: neighbouring triangles that turn by more are a crease (degrees); edges a bubble should span.
COINCIDENT, SLIVER, CREASE, EDGES = 1e-9, 5.0, 60.0, 3.0
#: Shares of a hollow's radius from which on a gap is wide, and edges are too long to know the radius well.
HOLLOW = 0.3
#: A rim shorter than so many widths of a bubble is small.
AROUND = 3.0
#: What the command line's repair takes care of.
MENDED = "(--repair does)"
FILLED = "(--repair does those of 3 or 4 edges, with --close-holes 20 those of up to 20)"
#: Holes that are always closed, for there is next to nothing to guess.
SAFE_EDGES = 4


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
        Of the flat triangles; the angle in degrees. NaN if the mesh is out of scale.
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
    (True, 1, 'open edges')
    """
    _as_file_mesh(mesh)
    d = None if gap is None else as_number(gap, "gap", positive=True, maximum=SIZES["maximum"])
    count = None if n_bubbles is None else as_integer(n_bubbles, "n_bubbles", minimum=1)
    found: list[MeshFinding] = []

    def add(fault: str, bad: Bools | Ints, kind: str, advice: str, *, fatal: bool = True) -> None:
        places = np.flatnonzero(bad) if bad.dtype == bool else bad
        if len(places):
            first = int(places[0])
            point = mesh.nodes[mesh.triangles[first] if kind == "triangle" else [first]].mean(axis=0)
            where = f"{kind} {first} at ({', '.join(f'{x:.4g}' for x in point)})"
            found.append(MeshFinding(fault, len(places), where, advice, fatal))

    tri, n = mesh.triangles, mesh.n_nodes
    misplaced = placement_fault(mesh)
    if misplaced is not None:
        found.append(MeshFinding("out of scale or place", 1, "everywhere", misplaced, True))
    used = np.zeros(n, dtype=np.bool_)
    used[tri] = True
    add("nodes without triangles", ~used, "node", f"remove them {MENDED}")
    twice = (tri == np.roll(tri, 1, axis=1)).any(axis=1)
    add("triangles that use a node twice", twice, "triangle", f"remove them {MENDED}")
    edges = _Edges(mesh)
    angle = np.array([np.nan])
    if misplaced is None:
        shared = _coincident(mesh)
        advice = f"merge them where they belong together {MENDED}" if len(edges.rim) else "harmless"
        add("nodes at the same place", shared, "node", advice, fatal=False)
        angle = _least_angles(mesh)
        flat = flat_triangles(mesh)
        add("triangles without area", ~twice & flat, "triangle", "collapse their shortest edges or remesh")
        thin = ~twice & ~flat & (angle < SLIVER)
        add(f"slivers (an angle below {SLIVER:g} degrees)", thin, "triangle", "remesh evenly", fatal=False)
    _, first, tally = np.unique(np.sort(tri, axis=1), axis=0, return_index=True, return_counts=True)
    add("triangles that occur twice", first[tally > 1], "triangle", f"keep one of each {MENDED}")
    add("edges with more than two triangles", edges.crowded, "edge at node", "remove the extra sheets")
    add("triangles turned against a neighbour", edges.flipped, "edge at node", f"turn them round {MENDED}")
    advice = f"films end on such a rim at 90 degrees; if it is damage, close it {FILLED}"
    add("open edges", edges.open_, "edge at node", advice, fatal=False)
    pieces, piece = connected_components(edges.graph, directed=False)
    pieces -= int((~used).sum())
    if pieces > 1:
        sizes = np.bincount(piece)
        where = f"sizes up to {sizes.max()} nodes"
        found.append(MeshFinding("separate components", pieces, where, f"keep one {MENDED}", True))
    if not any(finding.fatal for finding in found):
        found += _pinched(mesh)
    rims = _rim_count(edges.rim, n)
    curvatures = None
    if not any(finding.fatal for finding in found):
        found += _closed_findings(mesh)
        try:
            curvatures = MeshSurface(mesh.nodes, mesh.triangles).curvature_range()
        except MeshError as fault:
            found.append(MeshFinding("no smooth surface", 1, "the nodes named", str(fault), True))
        else:
            found += _size_findings(mesh, curvatures, d, count)
    return MeshReport(
        tuple(found),
        n,
        mesh.n_triangles,
        int(pieces),
        rims,
        mesh.euler_characteristic,
        mesh.area if misplaced is None else np.nan,
        mesh.mean_edge if misplaced is None else np.nan,
        float(angle.min()),
        curvatures,
    )


def repaired(mesh: TriangleMesh, *, hole_edges: int = SAFE_EDGES) -> tuple[TriangleMesh, tuple[str, ...]]:
    """The mesh after safe repairs, and what was done; no node is moved.

    Merges nodes at the same place (on rims, or joined by an edge), drops doubled triangles, those that
    use a node twice and unused nodes, keeps the largest component, turns triangles the same way round
    and outwards, and closes holes of three or four edges. What needs judgement is left alone.

    Parameters
    ----------
    mesh : TriangleMesh
    hole_edges : int, optional
        Close holes of up to so many edges, 4 … 64, flat between their nodes: for holes that are damage.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range.
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

    _as_file_mesh(mesh)
    most = as_integer(hole_edges, "hole_edges", minimum=SAFE_EDGES, maximum=MOST_EDGES)
    if placement_fault(mesh) is not None:
        return mesh, ()
    done: list[str] = []

    def note(text: str, count: int) -> None:
        if count:
            done.append(f"{text.format(count)}{'' if count == 1 else 's'}")

    # not trimesh's merging and dropping: their tolerances are lengths, whatever the size of the mesh
    place, merged = _merging(mesh)
    note("merged {} node", merged)
    tri = place[mesh.triangles]
    proper = ~(tri == np.roll(tri, 1, axis=1)).any(axis=1)
    tri = tri[proper]
    if not len(tri):
        raise MeshError("nothing is left of the mesh: all its triangles are flat")
    tri = tri[np.sort(np.unique(np.sort(tri, axis=1), axis=0, return_index=True)[1])]
    note("dropped {} triangle", mesh.n_triangles - len(tri))
    unused = mesh.n_nodes - merged - len(np.unique(tri))
    # of unit size for trimesh, whose tolerances are lengths; no node is moved, so the places stay ours
    shrunk = mesh.nodes / np.abs(mesh.nodes).max()
    work = trimesh.Trimesh(shrunk, tri, process=False)
    parts = trimesh.graph.connected_components(work.face_adjacency, nodes=np.arange(len(work.faces)))
    if len(parts) > 1:
        keep = np.zeros(len(work.faces), dtype=np.bool_)
        keep[max(parts, key=len)] = True
        work.update_faces(keep)
        note("dropped {} component", len(parts) - 1)
        done[-1] += f" ({100.0 * (1.0 - keep.mean()):.3g} % of the triangles)"
    note("dropped {} unused node", unused)
    old = np.array(work.faces)
    trimesh.repair.fix_winding(work)  # type: ignore[no-untyped-call]
    turned = _turned(old, np.asarray(work.faces))
    if 2 * turned > len(old):  # it follows the first triangle, we the most
        work.faces = np.asarray(work.faces)[:, ::-1]
        turned = _turned(old, np.asarray(work.faces))
    note("turned {} triangle", turned)
    holes = _rim_count(_Edges(TriangleMesh.from_trimesh(work)).rim, len(work.vertices))
    if holes:
        work.fill_holes()
        left = _rim_count(_Edges(TriangleMesh.from_trimesh(work)).rim, len(work.vertices))
    kept, tri = np.unique(np.asarray(work.faces), return_inverse=True)
    out = TriangleMesh(mesh.nodes[kept], tri.reshape(-1, 3))
    if holes:
        larger = 0
        if left and most > SAFE_EDGES and _is_surface(out):
            out, larger = closed_holes(out, most)
        note("closed {} hole", holes - left + larger)
    if not len(_Edges(out).rim) and _signed_volume(out) < 0.0:
        out = TriangleMesh(out.nodes, out.triangles[:, ::-1])
        done.append("turned the mesh outwards")
    return out, tuple(done)


def _as_file_mesh(mesh: TriangleMesh) -> None:
    if as_instance(mesh, "mesh", TriangleMesh).period is not None:
        raise MeshError("mesh repeats in space; meshes of files and their surfaces do not")


def _coincident(mesh: TriangleMesh) -> Bools:
    """Nodes that share their place with another."""
    reach = COINCIDENT * float(np.ptp(mesh.nodes, axis=0).max())
    apart = np.asarray(cKDTree(mesh.nodes).query(mesh.nodes, k=2, distance_upper_bound=2.0 * reach)[0])
    out: Bools = apart[:, 1] <= reach
    return out


def _merging(mesh: TriangleMesh) -> tuple[Ints, int]:
    """The node that takes each node's place, and how many give theirs up.

    Only nodes on rims merge, and those joined by an edge: sheets that touch are left apart.
    """
    n = mesh.n_nodes
    edges = _Edges(mesh)
    reach = COINCIDENT * float(np.ptp(mesh.nodes, axis=0).max())
    short = mesh.edges[mesh.edge_lengths <= reach]
    rim = np.unique(edges.rim)
    # exactly equal ones first, lest thousands in one place make millions of pairs
    _, which, place = np.unique(mesh.nodes[rim], axis=0, return_index=True, return_inverse=True)
    equal = np.stack([rim, rim[which[place.reshape(-1)]]], axis=1)
    close = rim[which[cKDTree(mesh.nodes[rim[which]]).query_pairs(reach, output_type="ndarray")]]
    a, b = np.concatenate([short, equal, close]).T
    pieces, piece = connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(n, n)), directed=False)
    first = np.full(pieces, n)
    np.minimum.at(first, piece, np.arange(n))
    return first[piece], n - int(pieces)


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
        mesh.require_surface()
    except MeshError as fault:
        return [MeshFinding("not a manifold", 1, "a node", str(fault), True)]
    return []


def _is_surface(mesh: TriangleMesh) -> bool:
    return not _pinched(mesh)


def _signed_volume(mesh: TriangleMesh) -> float:
    """Volume inside a closed mesh, below 0 if it is inside out."""
    a, b, c = (mesh.nodes[mesh.triangles[:, i]] - mesh.nodes.mean(axis=0) for i in range(3))
    return float(np.einsum("nx,nx->", a, np.cross(b, c))) / 6.0


def _size_findings(
    mesh: TriangleMesh, curvatures: tuple[float, float], gap: float | None, count: int | None
) -> list[MeshFinding]:
    """Whether the plates fold, and whether the mesh is fine enough for the gap and the bubbles."""
    out = []
    hollow = -curvatures[0]
    vague = hollow * mesh.mean_edge > HOLLOW
    # the rule of HeleShawCell, which will be asked next
    if gap is not None and 1.0 - gap * hollow <= 1e-12:
        advice = f"take a gap below {1.0 / hollow:.3g}, or smooth the mesh"
        advice += "; it is coarse there, a finer one may allow more" if vague else ""
        out.append(MeshFinding(f"plates fold at gap {gap:g}", 1, "the tightest hollow", advice, True))
    elif gap is not None and gap * hollow > HOLLOW and vague:
        advice = (
            f"the least radius of curvature, {1.0 / hollow:.3g}, is known from few nodes: only a finer mesh "
            "tells whether the plates fold"
        )
        out.append(MeshFinding(f"coarse for gap {gap:g}", 1, "the tightest hollow", advice, False))
    size = np.inf if count is None else np.sqrt(mesh.area / count)
    small = [] if count is None else small_rims(mesh, count)
    if small:
        node, around = small[0]
        advice = (
            f"it is {around:.3g} round and a bubble {size:.3g} wide: films ending there hardly rest; "
            f"close it {FILLED}"
        )
        where = f"rim at node {node}"
        out.append(MeshFinding(f"small rim for {count} bubbles", len(small), where, advice, False))
    if count is not None and size < EDGES * mesh.mean_edge:
        enough = int(np.ceil(EDGES**2 / 0.86 * count))
        advice = (
            f"from about {enough} nodes on, each bubble sees the shape of the surface; a coarser mesh is "
            "smoothed between its nodes, which may be good enough"
        )
        out.append(MeshFinding(f"coarse for {count} bubbles", 1, "everywhere", advice, False))
    return out


def small_rims(mesh: TriangleMesh, n_bubbles: int) -> list[tuple[int, float]]:
    """First node and length of each rim that has no room for three bubbles of so many; damage, most often."""
    out = []
    for loop in mesh.rim_loops:
        x = mesh.nodes[loop]
        around = float(np.linalg.norm(x - np.roll(x, 1, axis=0), axis=1).sum())
        if around < AROUND * np.sqrt(mesh.area / n_bubbles):
            out.append((int(loop[0]), around))
    return out


def _closed_findings(mesh: TriangleMesh) -> list[MeshFinding]:
    """What may be wrong with a proper mesh: inside out if it is closed, or creased."""
    out = []
    if not len(mesh.rim_edges) and _signed_volume(mesh) < 0.0:
        advice = f"the gap lies inside; if it should lie outside, turn all triangles round {MENDED}"
        out.append(MeshFinding("inside out", 1, "everywhere", advice, False))
    a, b, c = (mesh.nodes[mesh.triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    n = mesh.n_nodes
    start, end = mesh.triangles.ravel(), np.roll(mesh.triangles, -1, axis=1).ravel()
    order = np.argsort(start * n + end)
    place = np.searchsorted((start * n + end)[order], end * n + start)
    twin = order[np.minimum(place, len(order) - 1)]
    # edges of the rim have no twin, and no crease
    paired = (end[twin] == start) & (start[twin] == end)
    twin = np.where(paired, twin, np.arange(len(twin)))
    owner = np.repeat(np.arange(mesh.n_triangles), 3)
    cosine = np.einsum("nx,nx->n", normal[owner], normal[owner[twin]])
    sharp = np.flatnonzero((cosine < np.cos(np.radians(CREASE))) & (start < end))
    if len(sharp):
        advice = (
            "up to 75 degrees or so they are rounded off, with ripples for three edges; use a smoother mesh"
        )
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
