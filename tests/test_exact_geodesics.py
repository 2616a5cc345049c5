"""Exact distances on meshes and patches, their error estimates, and input that would end the interpreter."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import trimesh

from warpedfoam.errors import ConvergenceError, MeshError
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces import Ellipsoid, FlatTorus, SchwarzP, Sphere, Torus, TriangleMesh
from warpedfoam.tessellate import exact_geodesics
from warpedfoam.tessellate.exact_geodesics import SNAP, exact_distances, locate, polyhedral_error
from warpedfoam.tessellate.geodesics import geodesic_distances, geodesic_report

from .test_geodesics import BAD_MESHES, angles

SPHERE = Sphere(radius=1.0)
MESH = SPHERE.triangulate(642)
SHEET = FlatTorus(10.0, 8.0)
FLAT = SHEET.triangulate(1200)


def exact(mesh, sources, radius=None):
    return geodesic_distances(mesh, sources, method="exact", radius=radius)


def finer(surface, mesh):
    nodes, triangles = trimesh.remesh.subdivide(mesh.nodes, mesh.triangles)
    return TriangleMesh(surface.project(nodes), triangles)


def shaken(mesh, amount):
    rng = np.random.default_rng(1)
    moved = mesh.nodes + amount * mesh.mean_edge * rng.uniform(-1, 1, mesh.nodes.shape)
    return TriangleMesh(SPHERE.project(moved), mesh.triangles)


def true_flat(mesh, point):
    return np.linalg.norm(nearest_image(mesh.nodes - point, mesh.period), axis=1)


# ---------------------------------------------------------------------------- distances


def test_a_box_unfolds():
    box = trimesh.creation.box().subdivide()
    mesh = TriangleMesh(box.vertices, box.faces)
    source = int(np.flatnonzero((mesh.nodes == -0.5).all(axis=1))[0])
    target = int(np.flatnonzero((mesh.nodes == 0.5).all(axis=1))[0])
    found = exact(mesh, source)
    assert found[target] == pytest.approx(np.sqrt(5.0), abs=1e-12)
    face = mesh.nodes[:, 2] == -0.5
    straight = np.linalg.norm(mesh.nodes - mesh.nodes[source], axis=1)
    np.testing.assert_allclose(found[face], straight[face], atol=1e-12)


def test_distances_on_spheres_fall_short_by_order_h_squared():
    short = []
    for n_nodes in (162, 642, 2562):
        mesh = SPHERE.triangulate(n_nodes)
        gap = angles(mesh.nodes, mesh.nodes[3]) - exact(mesh, 3)
        assert gap.min() > -1e-9
        short.append(gap.mean())
    np.testing.assert_allclose(np.log2(np.divide(short[:-1], short[1:])), 2.0, atol=0.1)
    assert short[-1] == pytest.approx(0.11 * 0.5 * np.pi * mesh.mean_edge**2, rel=0.15)


def test_distances_on_a_flat_torus_are_straight():
    for source in (17, [[-4.93, 3.91, 0.0]]):
        point = FLAT.nodes[17] if source == 17 else np.array(source[0])
        found, straight = exact(FLAT, source, 3.0), true_flat(FLAT, point)
        inside = straight <= 3.0
        np.testing.assert_array_equal(np.isfinite(found), inside)
        np.testing.assert_allclose(found[inside], straight[inside], atol=1e-12)


def test_several_sources_on_a_mesh_that_repeats():
    found = exact(FLAT, [0, 700], 2.0)
    straight = np.minimum(true_flat(FLAT, FLAT.nodes[0]), true_flat(FLAT, FLAT.nodes[700]))
    inside = straight <= 2.0
    np.testing.assert_allclose(found[inside], straight[inside], atol=1e-12)
    assert np.isinf(found[~inside]).all()


@pytest.mark.parametrize("sources", [7, [7, 300, 640], SPHERE.random_points(2, 3)])
@pytest.mark.parametrize("radius", [1e-3, 0.1, 0.7, 2.0, 9.0])
def test_patches_give_what_the_whole_mesh_gives(sources, radius):
    mesh = shaken(MESH, 0.3)
    whole, part = exact(mesh, sources), exact(mesh, sources, radius)
    np.testing.assert_array_equal(np.isfinite(part), whole <= radius)
    np.testing.assert_allclose(part[whole <= radius], whole[whole <= radius], atol=1e-12)


def test_a_patch_too_small_at_first_grows(monkeypatch):
    tall = TriangleMesh(MESH.nodes * [1.0, 1.0, 6.0], MESH.triangles)
    whole = exact(tall, 0)
    sizes = []
    cut = exact_geodesics._cut
    monkeypatch.setattr(exact_geodesics, "_cut", lambda *a: sizes.append(len((p := cut(*a)).triangles)) or p)
    monkeypatch.setattr(exact_geodesics, "_DETOUR", 0.3)
    part = exact(tall, 0, 4.0)
    np.testing.assert_allclose(part[whole <= 4.0], whole[whole <= 4.0], atol=1e-12)
    assert len(sizes) > 1
    assert sizes == sorted(sizes)


def test_patches_that_meet_in_a_node_are_cut_there():
    """Two stars of nodes two rings apart share a node but no triangle: a fan for each."""
    mesh = Torus(3.0, 1.0).triangulate(400)
    graph = trimesh.Trimesh(mesh.nodes, mesh.triangles, process=False).vertex_neighbors
    near, ring = set(graph[0]), set()
    for k in graph[0]:
        ring |= set(graph[k])
    starts = np.array([0, next(k for k in ring - near - {0} if len(set(graph[k]) & near) == 1)])
    chosen = np.isin(np.arange(mesh.n_nodes), starts)
    patch = exact_geodesics._cut(mesh, chosen, starts, mesh.nodes[0])
    assert len(np.unique(patch.origin)) < len(patch.origin)
    found = exact_geodesics._measure(mesh, patch, starts, None, None)
    assert (found[~np.isin(patch.origin, starts)] > 0.0).all()


def test_pieces_without_a_source_are_left_out():
    far = int(MESH.nodes[:, 2].argmin())
    start = int(MESH.nodes[:, 2].argmax())
    near = np.isin(np.arange(MESH.n_nodes), [start, far])
    patch = exact_geodesics._cut(MESH, near, np.array([start]), MESH.nodes[start])
    assert start in patch.origin
    assert far not in patch.origin


def test_points_on_edges_make_no_flat_triangles():
    share = np.array([0.4, 0.6, 0.0])
    nodes, triangles, _ = exact_geodesics._with_node(MESH.nodes, MESH.triangles, 100, share)
    split = TriangleMesh(nodes, triangles)
    split.require_surface(closed=True)
    assert split.n_triangles == MESH.n_triangles + 2


def test_points_are_put_into_their_triangles():
    for share in (
        [0.2, 0.3, 0.5],
        [0.4, 0.6 - 1e-6, 1e-6],
        [0.4, 0.6, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 0.5, 0.5],
    ):
        point = np.array(share) @ MESH.nodes[MESH.triangles[100]]
        found = exact(MESH, [point])
        corners = np.linalg.norm(MESH.nodes[MESH.triangles[100]] - point, axis=1)
        np.testing.assert_allclose(found[MESH.triangles[100]], corners, atol=1e-9)
        assert (found <= exact(MESH, MESH.triangles[100, 0]) + corners[0] + 1e-9).all()


def test_points_are_nearer_to_the_truth_than_by_the_affine_formula():
    for point in SPHERE.random_points(3, 3):
        truth = angles(MESH.nodes, point)
        triangle, share = locate(MESH, point[None])
        nodes = MESH.triangles[triangle[0]]
        squares = np.stack([exact(MESH, int(k)) for k in nodes]) ** 2
        lift = ((MESH.nodes[nodes] - point) ** 2).sum(axis=1)
        affine = np.sqrt(np.maximum(share[0] @ (squares - lift[:, None]), 0.0))
        assert np.abs(exact(MESH, [point]) - truth).mean() < np.abs(affine - truth).mean()


def test_places_are_the_nearest_of_all_triangles():
    mesh = shaken(MESH, 0.3)
    points = 1.02 * SPHERE.random_points(30, 5)
    triangle, share = locate(mesh, points)
    place = np.einsum("ki,kix->kx", share, mesh.corners[triangle])
    solid = trimesh.Trimesh(mesh.nodes, mesh.triangles, process=False)
    nearest = np.stack(
        [trimesh.triangles.closest_point(solid.triangles, np.tile(p, (len(solid.faces), 1))) for p in points]
    )
    gap = np.linalg.norm(nearest - points[:, None], axis=2).min(axis=1)
    np.testing.assert_allclose(np.linalg.norm(place - points, axis=1), gap, atol=1e-9)


@pytest.mark.parametrize("scale", [1e-60, 1e-20, 1e20, 1e60])
def test_any_unit_of_length(scale):
    found = exact(TriangleMesh(scale * MESH.nodes + scale, MESH.triangles), 5, 2.0 * scale)
    np.testing.assert_allclose(found / scale, exact(MESH, 5, 2.0), atol=1e-9)


def test_heat_within_a_radius():
    whole, part = geodesic_distances(MESH, 5), geodesic_distances(MESH, 5, radius=1.0)
    np.testing.assert_array_equal(part, np.where(whole <= 1.0, whole, np.inf))


def test_heat_behind_the_seams_of_a_torus_is_too_long_by_edges():
    mesh = Torus(20.0, 4.0).triangulate(2000)
    truth = exact(mesh, 0)
    over = [(geodesic_distances(mesh, 0, f * mesh.mean_edge**2) - truth).mean() for f in (1.0, 4.0)]
    assert 0.2 < over[0] / mesh.mean_edge < 0.7 * over[1] / mesh.mean_edge < 2.0


# ---------------------------------------------------------------------------- errors


def bounds(found, truth):
    """Share of nodes whose error is below its estimate, and mean estimate over mean error."""
    known = np.isfinite(found.distances) & (found.distances > 0)
    gap, error = np.abs(found.distances - truth)[known], found.error[known]
    return (error >= gap).mean(), error.mean() / gap.mean()


def check(found, truth, share=0.95, most=10.0):
    bounded, ratio = bounds(found, truth)
    assert bounded >= share
    assert 1.0 < ratio < most


@pytest.mark.parametrize("method", ["heat", "exact"])
@pytest.mark.parametrize("amount", [0.0, 0.3])
@pytest.mark.parametrize("n_nodes", [642, 2562])
def test_errors_on_spheres(method, amount, n_nodes):
    mesh = shaken(SPHERE.triangulate(n_nodes), amount)
    most = 3.0 if method == "exact" else 10.0
    check(geodesic_report(mesh, 7, method=method), angles(mesh.nodes, mesh.nodes[7]), most=most)
    (point,) = SPHERE.random_points(1, 3)
    check(geodesic_report(mesh, [point], method=method), angles(mesh.nodes, point), most=most)
    near = geodesic_report(mesh, 7, method=method, radius=0.7)
    check(near, angles(mesh.nodes, mesh.nodes[7]), most=most)
    np.testing.assert_array_equal(np.isinf(near.error), np.isinf(near.distances))


SURFACES = [Torus(20.0, 4.0), Torus(3.0, 1.0), Ellipsoid(1.0, 1.5, 3.0)]


@pytest.mark.parametrize("surface", SURFACES, ids=str)
@pytest.mark.parametrize("third", [False, True])
def test_errors_on_curved_surfaces(surface, third):
    """Truth: exact distances of a mesh twice as fine, extrapolated in h²."""
    mesh = surface.triangulate(800)
    source = mesh.n_nodes // 3 if third else 0
    here = exact(mesh, source)
    truth = here + 4.0 / 3.0 * (exact(finer(surface, mesh), source)[: mesh.n_nodes] - here)
    check(geodesic_report(mesh, source, method="exact"), truth)
    check(geodesic_report(mesh, source), truth)


def test_errors_along_meridians_and_the_outer_equator():
    torus = Torus(20.0, 4.0)
    mesh = torus.triangulate(4000)
    source = int((np.abs(mesh.nodes - [24.0, 0.0, 0.0])).sum(axis=1).argmin())
    found = geodesic_report(mesh, source, method="exact", radius=13.0)
    x, y, z = mesh.nodes.T
    ring = np.arctan2(y, x) - np.arctan2(y[source], x[source])
    tube = np.arctan2(z, np.hypot(x, y) - 20.0)
    start = tube[source]
    meridian = (np.abs(ring) < 1e-9) & np.isfinite(found.distances)
    gap = np.abs(found.distances - 4.0 * np.abs(tube - start))[meridian]
    assert meridian.sum() > 10
    assert (gap <= found.error[meridian] + 1e-12).all()
    assert gap.max() > 0.2 * found.error[meridian].max()
    equator = (np.abs(tube) < 1e-9) & (found.distances < 9.0)  # nearer than the conjugate point
    gap = np.abs(found.distances - 24.0 * np.abs(ring))[equator]
    assert abs(start) < 1e-9
    assert equator.sum() > 4
    assert (gap <= found.error[equator] + 1e-12).all()


@pytest.mark.parametrize("radius", [None, 2.0])
def test_errors_on_a_flat_torus(radius):
    truth = true_flat(FLAT, FLAT.nodes[0])
    check(geodesic_report(FLAT, 0, radius=radius), truth)
    report = geodesic_report(FLAT, 0, method="exact", radius=3.0)
    assert report.error[np.isfinite(report.distances)].max() < 1e-20


def test_error_estimates_fall_as_h_squared():
    size = []
    for n_nodes in (162, 642, 2562):
        size.append(geodesic_report(SPHERE.triangulate(n_nodes), 3, method="exact").error.mean())
    np.testing.assert_allclose(np.log2(np.divide(size[:-1], size[1:])), 2.0, atol=0.15)


def test_errors_on_schwarz_p():
    """Its paths are too long, not short: bent to both sides. Truth by a mesh twice as fine."""
    surface = SchwarzP(1.0)
    mesh = surface.triangulate(1500)
    a, b = mesh.edges.T
    middle = mesh.nodes[a] + 0.5 * nearest_image(mesh.nodes[b] - mesh.nodes[a], mesh.period)
    number = {tuple(edge): k + mesh.n_nodes for k, edge in enumerate(mesh.edges.tolist())}
    triangles = []
    for i, j, k in mesh.triangles.tolist():
        p, q, r = (number[tuple(sorted(edge))] for edge in ((i, j), (j, k), (k, i)))
        triangles += [[i, p, r], [p, j, q], [r, q, k], [p, q, r]]
    fine = TriangleMesh(np.concatenate([mesh.nodes, surface.project(middle)]), triangles, mesh.period)
    found = geodesic_report(mesh, 0, method="exact", radius=0.35)
    better = exact(fine, 0, 0.4)[: mesh.n_nodes]
    here = np.isfinite(found.distances)
    truth = np.full(mesh.n_nodes, np.nan)
    truth[here] = found.distances[here] + 4.0 / 3.0 * (better - np.where(here, found.distances, 0.0))[here]
    check(found, truth)


def test_an_estimate_of_nothing_known():
    far = np.full(MESH.n_nodes, np.inf)
    far[4] = 0.0
    error = polyhedral_error(MESH, far)
    assert error[4] == 0.0
    assert np.isinf(np.delete(error, 4)).all()


# ---------------------------------------------------------------------------- bad input


BAD_CALLS = [
    ({"method": "best"}, ValueError, "method must be one of 'heat', 'exact', got 'best'"),
    ({"method": None}, TypeError, "method must be one of"),
    ({"radius": 0.0}, ValueError, "radius must be greater than 0"),
    ({"radius": -1.0}, ValueError, "radius must be greater than 0"),
    ({"radius": np.nan}, ValueError, "radius must be finite"),
    ({"radius": np.inf}, ValueError, "radius must be finite"),
    ({"radius": "1"}, TypeError, "radius must be a number"),
    ({"radius": True}, TypeError, "radius must be a number"),
    ({"t": 1.0, "method": "exact"}, ValueError, "t is for method='heat' only"),
]


@pytest.mark.parametrize("use", [geodesic_distances, geodesic_report])
@pytest.mark.parametrize("method", ["heat", "exact"])
@pytest.mark.parametrize(("options", "fault", "message"), BAD_CALLS)
def test_bad_options(use, method, options, fault, message):
    with pytest.raises(fault, match=message):
        use(MESH, 0, **{"method": method, **options})


@pytest.mark.parametrize("radius", [None, 1.0])
@pytest.mark.parametrize("name", [name for name in BAD_MESHES if name != "huge"])
def test_bad_meshes(name, radius):
    make, fault, message = BAD_MESHES[name]
    with pytest.raises(fault, match=message):
        exact(make(), 0, radius)


BAD_SOURCES = [
    *(-1, MESH.n_nodes, 2**40, 2**70, [], [[1, 2, 3]], 1.0, True, "0", None, [[1], [2, 3]], 1j),
    *(np.zeros((0, 3)), [0.0, 0.0, 1.0], [[0.0, 0.0, np.nan]], [[0.0, 0.0, 2.0]]),
]


@pytest.mark.parametrize("radius", [None, 0.5])
@pytest.mark.parametrize("sources", BAD_SOURCES, ids=repr)
def test_bad_sources(sources, radius):
    with pytest.raises((ValueError, TypeError), match="sources"):
        exact(MESH, sources, radius)


@pytest.mark.parametrize(
    ("radius", "message"),
    [(None, "below half the period, 4, .* got None"), (4.0, "below half the period"), (3.99, "be smaller")],
)
def test_meshes_that_repeat_need_a_small_radius(radius, message):
    with pytest.raises(ValueError, match=f"^radius must.*{message}"):
        exact(FLAT, 0, radius)


@pytest.mark.parametrize("value", [np.nan, -1.0, 0.0])
def test_libigl_leaving_nodes_out_is_noticed(monkeypatch, value):
    import igl

    true_call = igl.exact_geodesic

    def spoilt(**given):
        out = true_call(**given)
        out[5] = value
        return out

    monkeypatch.setattr(igl, "exact_geodesic", spoilt)
    with pytest.raises(ConvergenceError, match="left nodes out"):
        exact(MESH, 0)


def test_the_interpreter_survives():
    """Slivers, points at nodes and edges, tiny patches, jagged meshes: each in a process of its own."""
    code = (
        "import numpy as np\n"
        "from warpedfoam.surfaces import Sphere, TriangleMesh\n"
        "from warpedfoam.tessellate.geodesics import geodesic_distances as d\n"
        "m = Sphere(1.0).triangulate(42)\n"
        "rng = np.random.default_rng(0)\n"
        "c = m.nodes[m.triangles[3]]\n"
        f"for e in (0.0, {SNAP / 2}, {SNAP * 2}, 1e-6, 1e-3):\n"
        "    for s in ([1 - e, e, 0], [0.5 - e, 0.5, e], [1 - 2 * e, e, e]):\n"
        "        for r in (None, 1e-9, 0.3):\n"
        "            assert d(m, [np.array(s) @ c], method='exact', radius=r).min() < 0.6 or r\n"
        "for k in range(30):\n"
        "    n = TriangleMesh(m.nodes + rng.normal(0, 0.5, m.nodes.shape), m.triangles)\n"
        "    for r in (None, 0.1, 1.0):\n"
        "        d(n, k, method='exact', radius=r)\n"
        "flat = TriangleMesh(m.nodes * [1, 1, 1e-6], m.triangles)\n"
        "d(flat, 0, method='exact')\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert (run.returncode, run.stderr) == (0, "")


def test_exact_distances_check_the_mesh_themselves():
    turned = np.vstack([MESH.triangles[:1, ::-1], MESH.triangles[1:]])
    with pytest.raises(MeshError, match="oriented against each other"):
        exact_distances(TriangleMesh(MESH.nodes, turned), np.array([0]))


def test_distances_on_a_mesh_with_a_rim():
    """A hemisphere's distances from its pole are the sphere's, by both methods."""
    ball = Sphere(1.0).triangulate(3000)
    kept = ball.triangles[(ball.nodes[ball.triangles][:, :, 2] > -0.05).all(axis=1)]
    used, triangles = np.unique(kept, return_inverse=True)
    dome = TriangleMesh(ball.nodes[used], triangles.reshape(-1, 3))
    assert len(dome.rim_loops) == 1
    pole = int(dome.nodes[:, 2].argmax())
    true = np.arccos(np.clip(dome.nodes @ dome.nodes[pole], -1.0, 1.0))
    exact = exact_distances(dome, np.array([pole]))
    np.testing.assert_allclose(np.asarray(exact).ravel(), true, atol=3e-3)
