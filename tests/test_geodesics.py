"""Heat geodesics against arccos on the sphere, and every input that would end the interpreter."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import trimesh

from warpedfoam.errors import ConvergenceError, MeshError
from warpedfoam.surfaces import Sphere, Torus, TriangleMesh
from warpedfoam.tessellate import geodesics
from warpedfoam.tessellate.colouring import colour_seeds
from warpedfoam.tessellate.geodesics import COLOUR_TIME_FACTOR, HeatGeodesics, geodesic_distances
from warpedfoam.tessellate.seeds import blue_noise_seeds

SPHERE = Sphere(radius=1.0)
MESH = SPHERE.triangulate(1002)
SMALL = SPHERE.triangulate(42)


@pytest.fixture(scope="module")
def heat():
    return HeatGeodesics(MESH)


def angles(nodes, point):
    return np.arctan2(np.linalg.norm(np.cross(nodes, point), axis=1), nodes @ point)


def jittered(mesh, amount):
    rng = np.random.default_rng(1)
    return TriangleMesh(
        SPHERE.project(mesh.nodes + amount * mesh.mean_edge * rng.uniform(-1, 1, mesh.nodes.shape)),
        mesh.triangles,
    )


@pytest.mark.parametrize("jitter", [0.0, 0.15])
@pytest.mark.parametrize("n_nodes", [1002, 4002, 16002])
def test_distances_are_low_by_a_tenth_to_a_fifth_of_an_edge(n_nodes, jitter):
    mesh = jittered(SPHERE.triangulate(n_nodes), jitter)
    source = 7
    exact = angles(mesh.nodes, mesh.nodes[source])
    error = (HeatGeodesics(mesh).distances(source) - exact) / mesh.mean_edge
    assert error[source] == 0.0
    assert (np.abs(error) < 0.35).all()  # the antipode, where paths from all sides meet, included
    far = (exact > 4 * mesh.mean_edge) & (exact < np.pi - 0.5)
    assert -0.17 < error[far].mean() < -0.08
    near = (exact > 0) & (exact < 3 * mesh.mean_edge)
    relative = error[near] * mesh.mean_edge / exact[near]
    assert -0.25 < relative.min() < -0.12  # at every refinement
    assert relative.max() < 0.0


def test_far_distances_converge_with_the_edge_length():
    errors = []
    for n_nodes in (1002, 4002, 16002):
        mesh = SPHERE.triangulate(n_nodes)
        exact = angles(mesh.nodes, mesh.nodes[0])
        far = (exact > 0.6) & (exact < np.pi - 0.5)
        errors.append(np.abs(HeatGeodesics(mesh).distances(0) - exact)[far].mean())
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (rates > 0.7).all()


def crossings(mesh, first, second):
    """Points where d1² − d2², linear along edges, vanishes."""
    i, j = mesh.edges.T
    change = first**2 - second**2
    cut = change[i] * change[j] < 0
    i, j = i[cut], j[cut]
    share = (change[i] / (change[i] - change[j]))[:, None]
    return (1 - share) * mesh.nodes[i] + share * mesh.nodes[j]


@pytest.mark.parametrize("n_nodes", [1002, 16002])
def test_bisector_of_two_seeds_is_the_great_circle_to_a_tenth_of_an_edge(n_nodes):
    mesh = SPHERE.triangulate(n_nodes)
    heat = HeatGeodesics(mesh)
    a, b = 3, int(np.argmin(np.abs(angles(mesh.nodes, mesh.nodes[3]) - 0.5)))
    points = crossings(mesh, heat.distances(a), heat.distances(b))
    normal = mesh.nodes[a] - mesh.nodes[b]
    off = np.abs(points @ normal) / np.linalg.norm(normal) / mesh.mean_edge
    assert len(points) > 30
    assert off.max() < 0.1
    close = angles(points, mesh.nodes[a]) < 1.0
    assert off[close].mean() < 0.02


def test_bisectors_of_coloured_solves():
    mesh = SPHERE.triangulate(8000)
    seeds = blue_noise_seeds(SPHERE, 200, rng=0)
    source = np.array([int(np.argmax(mesh.nodes @ seed)) for seed in seeds])
    seeds = mesh.nodes[source]
    spacing = np.sqrt(SPHERE.area / len(seeds))
    colours = colour_seeds(seeds, 5 * spacing)
    mean = {}
    for factor in (COLOUR_TIME_FACTOR, 9.0):
        heat = HeatGeodesics(mesh, factor * mesh.mean_edge**2)
        fields = np.stack([heat.distances(source[colours == k]) for k in range(colours.max() + 1)])
        distance = fields[colours] - fields[colours, source][:, None]
        distance[np.arccos(np.clip(seeds @ mesh.nodes.T, -1, 1)) > 1.7 * spacing] = np.inf
        owner = distance.argmin(axis=0)
        i, j = mesh.edges.T
        cut = owner[i] != owner[j]
        i, j = i[cut], j[cut]
        a, b = owner[i], owner[j]
        at_i = distance[a, i] ** 2 - distance[b, i] ** 2
        at_j = distance[a, j] ** 2 - distance[b, j] ** 2
        share = (at_i / (at_i - at_j))[:, None]
        points = (1 - share) * mesh.nodes[i] + share * mesh.nodes[j]
        normal = seeds[a] - seeds[b]
        off = np.abs((points * normal).sum(1)) / np.linalg.norm(normal, axis=1) / mesh.mean_edge
        mean[factor] = off.mean()
        if factor == COLOUR_TIME_FACTOR:
            assert off.max() < 0.25
    assert mean[COLOUR_TIME_FACTOR] < 0.03
    assert mean[9.0] > 1.5 * mean[COLOUR_TIME_FACTOR]  # why the time factor is 1 here, not more


def test_a_torus_tube_is_half_as_long_round_as_it_should_be():
    torus = Torus(major_radius=20.0, minor_radius=4.0)
    mesh = torus.triangulate(10_000)
    distance = geodesic_distances(torus, [[24.0, 0.0, 0.0]])
    top = int(np.argmin(np.linalg.norm(mesh.nodes - [20.0, 0.0, 4.0], axis=1)))
    inner = int(np.argmin(np.linalg.norm(mesh.nodes - [16.0, 0.0, 0.0], axis=1)))
    assert distance[top] == pytest.approx(2 * np.pi, abs=0.3 * mesh.mean_edge)
    assert distance[inner] == pytest.approx(4 * np.pi, abs=1.1 * mesh.mean_edge)


def test_rotating_and_scaling_the_mesh_rotates_and_scales_the_distances(heat):
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    moved = HeatGeodesics(TriangleMesh(1e6 * MESH.nodes @ turn.T, MESH.triangles))
    np.testing.assert_allclose(moved.distances(11), 1e6 * heat.distances(11), atol=1e-3)
    assert moved.t == pytest.approx(1e12 * heat.t)


def test_distance_there_is_distance_back(heat):
    nodes = [0, 50, 333, 800]
    table = np.stack([heat.distances(i)[nodes] for i in nodes])
    assert np.abs(table - table.T).max() < 0.15 * MESH.mean_edge


def test_several_sources_give_the_minimum(heat):
    sources = [5, 400, 900]
    least = np.stack([heat.distances(i) for i in sources]).min(axis=0)
    np.testing.assert_array_equal(geodesic_distances(MESH, sources), least)
    np.testing.assert_array_equal(geodesic_distances(MESH, [900, 5, 400, 5]), least)


@pytest.mark.parametrize(("factor", "most"), [(1.0, 1.5), (4.0, 3.0)])
def test_one_solve_for_several_sources_is_off_by_edges_at_the_seams(factor, most):
    heat = HeatGeodesics(MESH, factor * MESH.mean_edge**2)
    sources = [5, 400, 900]
    together = heat.distances(sources)
    np.testing.assert_array_equal(heat.distances([900, 5, 400, 5]), together)
    assert together[sources].mean() == pytest.approx(0.0, abs=1e-12)
    assert np.abs(together[sources]).max() < 0.5 * MESH.mean_edge
    least = np.stack([heat.distances(i) for i in sources]).min(axis=0)
    assert 0.3 * most < np.abs(together - least).max() / MESH.mean_edge < most


def test_points_between_nodes_are_as_good_as_nodes(heat):
    node = geodesic_distances(MESH, MESH.nodes[[12]])
    np.testing.assert_allclose(node, heat.distances(12), atol=1e-9)
    for point in SPHERE.random_points(5, 3):
        exact = angles(MESH.nodes, point)
        error = (geodesic_distances(MESH, point[None]) - exact) / MESH.mean_edge
        far = exact > 4 * MESH.mean_edge
        assert -0.16 < error[far].mean() < -0.08
        assert error[far].std() < 0.04
        assert np.abs(error).max() < 0.5


def test_squares_interpolate_exactly_where_distances_are_straight(monkeypatch):
    straight = lambda heat, node: np.linalg.norm(heat.mesh.nodes - heat.mesh.nodes[node], axis=1)  # noqa: E731
    geodesics.factored(SMALL)
    monkeypatch.setattr(HeatGeodesics, "distances", straight)
    point = np.array([0.5, 0.3, 0.2]) @ SMALL.nodes[SMALL.triangles[10]]
    exact = np.linalg.norm(SMALL.nodes - point, axis=1)
    np.testing.assert_allclose(geodesic_distances(SMALL, [point]), exact, atol=1e-12)


def test_several_points_give_the_minimum():
    points = SPHERE.random_points(4, 0)
    each = np.stack([geodesic_distances(MESH, point[None]) for point in points])
    np.testing.assert_allclose(geodesic_distances(MESH, points), each.min(axis=0), atol=1e-12)


@pytest.fixture
def factorisations(monkeypatch):
    calls = []
    true_factor = geodesics._factor
    monkeypatch.setattr(geodesics, "_factor", lambda mesh, t: calls.append(t) or true_factor(mesh, t))
    geodesics._remembered.clear()
    return calls


def test_factored_once_for_equal_meshes(factorisations):
    first = geodesic_distances(SMALL, 0)
    outside = trimesh.Trimesh(SMALL.nodes, SMALL.triangles, process=False)
    np.testing.assert_array_equal(geodesic_distances(outside, 0), first)
    geodesic_distances(TriangleMesh(SMALL.nodes, SMALL.triangles), [1, 2])
    assert len(factorisations) == 1
    outside.vertices = 2.0 * outside.vertices  # a trimesh may be changed in place: seen
    np.testing.assert_allclose(geodesic_distances(outside, 0), 2.0 * first, atol=1e-9)
    assert len(factorisations) == 2


def test_factored_again_for_another_time_node_or_edge(factorisations):
    geodesic_distances(SMALL, 0, t=1.0)
    geodesic_distances(SMALL, 0, t=2.0)
    geodesic_distances(TriangleMesh(1.1 * SMALL.nodes, SMALL.triangles), 0, t=2.0)
    a, b, c = SMALL.triangles[0]
    across = next(k for k in range(1, SMALL.n_triangles) if {a, b} <= set(SMALL.triangles[k]))
    (d,) = set(SMALL.triangles[across]) - {a, b}
    triangles = SMALL.triangles.copy()
    triangles[[0, across]] = [[a, d, c], [d, b, c]]
    geodesic_distances(TriangleMesh(1.1 * SMALL.nodes, triangles), 0, t=2.0)
    assert factorisations == [1.0, 2.0, 2.0, 2.0]
    assert len(geodesics._remembered) == 2


def test_accepts_surfaces_and_exposes_what_it_factored():
    heat = HeatGeodesics(SPHERE)
    assert heat.mesh is SPHERE.mesh
    assert heat.t == pytest.approx(4.0 * SPHERE.mesh.mean_edge**2)


@pytest.mark.parametrize("shape", [trimesh.creation.box(), trimesh.creation.box().subdivide()])
def test_meshes_whose_last_pivot_is_exactly_zero(shape):
    distance = HeatGeodesics(shape).distances(0)
    corner = np.linalg.norm(shape.vertices - shape.vertices[0], axis=1)
    assert distance[corner.argmax()] == distance.max()
    assert (distance >= 0.7 * corner - 1e-12).all()


def sphere_with(nodes=None, triangles=None):
    return TriangleMesh(
        SMALL.nodes if nodes is None else nodes, SMALL.triangles if triangles is None else triangles
    )


def set_triangle(k, corners):
    triangles = SMALL.triangles.copy()
    triangles[k] = corners
    return triangles


def two_spheres():
    return TriangleMesh(
        np.concatenate([SMALL.nodes, SMALL.nodes + 5.0]),
        np.concatenate([SMALL.triangles, SMALL.triangles + SMALL.n_nodes]),
    )


def pinched():
    """Two octahedra that share one node and no edge."""
    nodes = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    other = np.array([6, 0, 7, 8, 9, 10])  # its node 1 is the first one's node 0
    return TriangleMesh(
        np.concatenate([nodes, np.delete(nodes, 1, axis=0) + np.array([2.0, 0.0, 0.0])]),
        np.concatenate([faces, other[faces]]),
    )


def doubled_edge():
    a, b, c = SMALL.triangles[0]
    nodes = np.concatenate([SMALL.nodes, [2.0 * SMALL.nodes[c]]])
    return TriangleMesh(nodes, np.concatenate([SMALL.triangles, [[a, b, len(SMALL.nodes)]]]))


def collapsed():
    nodes = SMALL.nodes.copy()
    a, b = SMALL.triangles[0, :2]
    nodes[a] = nodes[b]
    return sphere_with(nodes)


NAN_NODES = np.where(np.arange(SMALL.n_nodes)[:, None] == 3, np.nan, SMALL.nodes)

BAD_MESHES = {
    "empty": (lambda: TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int)), ValueError, "nodes"),
    "no triangles": (
        lambda: sphere_with(triangles=np.zeros((0, 3), dtype=int)),
        MeshError,
        "at least one triangle",
    ),
    "index too high": (lambda: sphere_with(triangles=set_triangle(4, (0, 1, 42))), ValueError, "below 42"),
    "index negative": (lambda: sphere_with(triangles=set_triangle(4, (0, 1, -1))), ValueError, "at least 0"),
    "nan": (lambda: sphere_with(NAN_NODES), ValueError, "finite"),
    "infinite": (lambda: sphere_with(np.where(np.isnan(NAN_NODES), np.inf, NAN_NODES)), ValueError, "finite"),
    "node twice": (
        lambda: sphere_with(triangles=set_triangle(0, SMALL.triangles[0, [0, 1, 1]])),
        MeshError,
        "twice",
    ),
    "coinciding nodes": (collapsed, MeshError, "no area"),
    "two components": (two_spheres, MeshError, "2 separate"),
    "three triangles on an edge": (doubled_edge, MeshError, "more than two"),
    "flipped": (
        lambda: sphere_with(triangles=set_triangle(0, SMALL.triangles[0, ::-1])),
        MeshError,
        "oriented",
    ),
    "pinched": (pinched, MeshError, "node"),
    "unused node": (
        lambda: sphere_with(np.concatenate([SMALL.nodes, [[3.0, 0, 0]]])),
        MeshError,
        "no triangle",
    ),
    "a polygon": (lambda: [[0, 0, 0]], TypeError, "surface_or_mesh"),
    "nothing": (lambda: None, TypeError, "surface_or_mesh"),
    "a class": (lambda: Sphere, TypeError, "surface_or_mesh"),
    "huge": (lambda: sphere_with(1e60 * SMALL.nodes), None, None),
}


@pytest.mark.parametrize("name", BAD_MESHES)
def test_bad_meshes(name):
    make, fault, message = BAD_MESHES[name]
    if fault is None:
        distance = geodesic_distances(make(), 0) / 1e60
        np.testing.assert_allclose(distance, geodesic_distances(SMALL, 0), atol=1e-9)
        return
    for use in (HeatGeodesics, lambda mesh: geodesic_distances(mesh, 0)):
        with pytest.raises(fault, match=message):
            use(make())


@pytest.mark.parametrize(
    ("sources", "fault"),
    [
        (-1, ValueError),
        (MESH.n_nodes, ValueError),
        (2**40, ValueError),
        (2**70, TypeError),
        ([0, -1], ValueError),
        ([], ValueError),
        (np.zeros(0, dtype=int), ValueError),
        ([[1, 2, 3]], ValueError),
        (1.0, TypeError),
        ([0.5], TypeError),
        (True, TypeError),
        ([True, False], TypeError),
        ("0", TypeError),
        (None, TypeError),
        ([[1], [2, 3]], ValueError),
        (1j, TypeError),
    ],
)
def test_bad_sources(heat, sources, fault):
    with pytest.raises(fault, match="sources"):
        heat.distances(sources)
    with pytest.raises((ValueError, TypeError), match="sources"):
        geodesic_distances(MESH, sources)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((0, 3)), "at least 1 point"),
        ([0.0, 0.0, 1.0], "shape"),
        ([[0.0, 0.0, np.nan]], "finite"),
        ([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]], "point 1 is 1 from the nearest node; project"),
    ],
)
def test_bad_source_points(points, message):
    with pytest.raises(ValueError, match=message):
        geodesic_distances(MESH, points)


@pytest.mark.parametrize(
    ("t", "fault", "message"),
    [
        (0.0, ValueError, "greater than 0"),
        (-1.0, ValueError, "greater than 0"),
        (np.nan, ValueError, "finite"),
        (np.inf, ValueError, "finite"),
        (1e-9, ValueError, "squared mean edges"),
        (1e30, ValueError, "squared mean edges"),
        ("1", TypeError, "number"),
        (True, TypeError, "number"),
        ([1.0, 2.0], TypeError, "number"),
    ],
)
def test_bad_times(t, fault, message):
    with pytest.raises(fault, match=f"^t must.*{message}"):
        HeatGeodesics(MESH, t)


def test_heat_that_dies_out_on_its_way_is_noticed(monkeypatch):
    monkeypatch.setattr(geodesics, "_LEAST_FACTOR", 0.0)
    with pytest.raises(ConvergenceError, match="too small"):
        HeatGeodesics(MESH, 1e-30)


def test_libigl_giving_nan_is_noticed(heat, monkeypatch):
    import igl

    monkeypatch.setattr(igl, "heat_geodesics_solve", lambda data, sources: np.full(MESH.n_nodes, np.nan))
    with pytest.raises(ConvergenceError, match="not finite"):
        heat.distances(0)


def test_importing_the_package_does_not_load_libigl():
    code = "import sys, warpedfoam, warpedfoam.tessellate.geodesics; sys.exit('igl' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
