"""Voronoi foams: SciPy's exact diagram on the sphere, charges, volumes, refinement and clear refusals."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial import SphericalVoronoi, cKDTree
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

from warpedfoam import HeleShawCell, ResolutionError, Sphere, Torus, voronoi_foam
from warpedfoam.moves.t1 import outward_tangents
from warpedfoam.tessellate import build
from warpedfoam.tessellate.fields import seed_fields
from warpedfoam.tessellate.geodesics import HeatGeodesics
from warpedfoam.tessellate.regions import tidy_labels
from warpedfoam.tessellate.seeds import blue_noise_seeds, lattice_seeds, random_seeds

SPHERE, TORUS = Sphere(1.0), Torus(20.0, 4.0)
CELLS = {"sphere": HeleShawCell(SPHERE, 0.01), "torus": HeleShawCell(TORUS, 0.5)}
SEEDS = {
    "blue": lambda surface, n: blue_noise_seeds(surface, n, 0),
    "lattice": lattice_seeds,
    "random": lambda surface, n: random_seeds(surface, n, 0),
}


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))


def exact_diagram(seeds):
    """Film lengths by pair of neighbours, vertices by triple, areas: SciPy's Voronoi cells."""
    diagram = SphericalVoronoi(seeds)
    diagram.sort_vertices_of_regions()
    beside: dict[frozenset[int], list[int]] = {}
    round_vertex: dict[int, set[int]] = {}
    for i, ring in enumerate(diagram.regions):
        for a, b in zip(ring, np.roll(ring, -1), strict=True):
            beside.setdefault(frozenset((int(a), int(b))), []).append(i)
            round_vertex.setdefault(int(a), set()).add(i)
    x = diagram.vertices
    films = {frozenset(pair): float(angle(*x[list(ends)])) for ends, pair in beside.items()}
    vertices = {frozenset(three): x[v] for v, three in round_vertex.items()}
    return films, vertices, diagram.calculate_areas()


def films_of(foam):
    pairs = zip(foam.network.left.tolist(), foam.network.right.tolist(), strict=True)
    return {frozenset(pair): float(length) for pair, length in zip(pairs, foam.film_lengths, strict=True)}


def vertices_of(foam):
    out = foam.network.outgoing
    return {
        frozenset(three.tolist()): foam.vertex_points[v]
        for three, v in zip(foam.network.bubble[out], foam.network.origin[out[:, 0]], strict=True)
    }


# ---------------------------------------------------------------------------- against the exact diagram


@pytest.mark.parametrize("kind", ["blue", "lattice"])
@pytest.mark.parametrize(("n", "n_nodes"), [(50, 4000), (50, 16_000), (200, 4000), (200, 16_000)])
def test_the_network_is_the_exact_one_but_for_films_shorter_than_an_edge(kind, n, n_nodes):
    seeds = SEEDS[kind](SPHERE, n)
    h = SPHERE.triangulate(n_nodes).mean_edge
    foam = voronoi_foam(CELLS["sphere"], seeds=seeds, n_nodes=n_nodes)
    exact, vertices, areas = exact_diagram(seeds)
    found = films_of(foam)
    assert {pair for pair, length in exact.items() if length > h} <= found.keys()
    assert {pair for pair, length in found.items() if length > h} <= exact.keys()
    shared = vertices_of(foam).keys() & vertices.keys()
    assert len(shared) > 0.85 * foam.network.n_vertices
    error = np.array([np.linalg.norm(vertices_of(foam)[k] - vertices[k]) for k in shared]) / h
    assert error.mean() < 0.15  # found: 0.07 to 0.10 mesh edges, at most 0.5
    assert error.max() < 0.8
    perimeter = 3.8 * np.sqrt(areas)
    assert (np.abs(foam.bubble_areas - areas) < 0.2 * h * perimeter).all()


def test_films_lie_on_the_bisectors():
    """Points of a film are as far from one seed as from the other, to a fraction of a mesh edge."""
    seeds = SEEDS["blue"](SPHERE, 60)
    for n_nodes in (4000, 16_000):
        h = SPHERE.triangulate(n_nodes).mean_edge
        foam = voronoi_foam(CELLS["sphere"], seeds=seeds, n_nodes=n_nodes)
        across = seeds[foam.network.left] - seeds[foam.network.right]
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        long = foam.film_lengths > 3 * h
        off = np.abs(np.einsum("fkx,fx->fk", foam.film_curves(9), across))[long, 2:-2] / h
        assert off.mean() < 0.06
        assert off.max() < 0.3


def test_vertices_converge_with_the_mesh():
    """Halving the edge halves the error, which stays a tenth of an edge."""
    seeds = SEEDS["blue"](SPHERE, 60)
    _, exact, _ = exact_diagram(seeds)
    errors, edges = [], []
    for n_nodes in (2000, 8000, 32_000):
        found = vertices_of(voronoi_foam(CELLS["sphere"], seeds=seeds, n_nodes=n_nodes))
        errors.append(np.mean([np.linalg.norm(found[k] - exact[k]) for k in found.keys() & exact.keys()]))
        edges.append(SPHERE.triangulate(n_nodes).mean_edge)
    rates = np.diff(np.log(errors)) / np.diff(np.log(edges))
    assert (rates > 0.6).all()
    assert errors[-1] < 0.15 * edges[-1]


@pytest.mark.parametrize(("n", "n_nodes"), [(200, 4000), (200, 16_000), (1000, 40_000)])
@pytest.mark.parametrize("name", CELLS)
def test_every_node_goes_to_a_seed_that_is_nearest_to_a_quarter_edge(name, n, n_nodes):
    """However close random seeds come to each other (a film may then be far off its place)."""
    surface = CELLS[name].surface
    seeds = SEEDS["random"](surface, n)
    mesh = surface.triangulate(n_nodes)
    heat = HeatGeodesics(mesh, t=mesh.mean_edge**2)
    fields = seed_fields(heat, seeds, float(np.sqrt(surface.area / n)))
    homes = cKDTree(mesh.nodes).query(seeds)[1]
    labels = tidy_labels(mesh, fields.labels(), homes)
    # straight distances fall short of geodesic ones by about D³k²/24
    chord = np.linalg.norm(mesh.nodes[:, None] - seeds[fields.seeds], axis=2)
    best = chord.min(axis=1)
    given = np.linalg.norm(mesh.nodes - seeds[labels], axis=1)
    bend = best**3 * max(abs(k) for k in surface.curvature_range()) ** 2 / 12
    excess = (given - best - bend) / mesh.mean_edge
    assert (excess > 0.35).mean() < 2e-4  # tidying moves a few nodes at the tips of slivers
    assert excess.max() < 1.5
    assert (labels != fields.seeds[np.arange(len(best)), chord.argmin(axis=1)]).mean() < 0.1


@pytest.mark.parametrize("kind", ["blue", "lattice"])
def test_turning_the_seeds_turns_the_foam(kind):
    seeds = SEEDS[kind](SPHERE, 60)
    h = SPHERE.triangulate(16_000).mean_edge
    first = films_of(voronoi_foam(CELLS["sphere"], seeds=seeds, n_nodes=16_000))
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7])
    second = films_of(voronoi_foam(CELLS["sphere"], seeds=turn.apply(seeds), n_nodes=16_000))
    both = first.keys() & second.keys()
    assert all(first[p] < h for p in first.keys() - both)
    assert all(second[p] < h for p in second.keys() - both)
    change = np.array([first[p] - second[p] for p in both])
    assert np.abs(change).mean() < 0.2 * h


def test_turning_the_seeds_round_a_torus_turns_the_foam():
    seeds = SEEDS["blue"](TORUS, 150)
    h = TORUS.triangulate(24_000).mean_edge
    first = films_of(voronoi_foam(CELLS["torus"], seeds=seeds, n_nodes=24_000))
    turned = TORUS.project(Rotation.from_rotvec([0.0, 0.0, 0.777]).apply(seeds))
    second = films_of(voronoi_foam(CELLS["torus"], seeds=turned, n_nodes=24_000))
    both = first.keys() & second.keys()
    assert len(both) > 0.95 * len(first)
    assert all(first[p] < 1.2 * h for p in first.keys() - both)
    assert np.abs([first[p] - second[p] for p in both]).mean() < 0.2 * h


@pytest.mark.parametrize("n_nodes", [500, 4000])
def test_platonic_seeds_give_platonic_foams(n_nodes):
    g = (1 + 5**0.5) / 2
    icosahedron = np.array([np.roll([0, a, b * g], k) for k in range(3) for a in (-1, 1) for b in (-1, 1)])
    tetrahedron = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])
    for corners, sides in ((icosahedron, 5), (tetrahedron, 3), (np.concatenate([np.eye(3), -np.eye(3)]), 4)):
        seeds = SPHERE.project(Rotation.from_rotvec([0.2, 0.5, 0.1]).apply(corners.astype(float)))
        foam = voronoi_foam(CELLS["sphere"], seeds=seeds, n_nodes=n_nodes)
        assert foam.network.sides.tolist() == [sides] * len(corners)
        mesh = SPHERE.triangulate(n_nodes)
        np.testing.assert_allclose(foam.bubble_areas, 4 * np.pi / len(corners), rtol=0.5 * mesh.mean_edge)


# ---------------------------------------------------------------------------- every kind of seeds


@cache
def foam_of(name, kind, n, seed, lloyd=0):
    return voronoi_foam(CELLS[name], n, seeds=kind, seed=seed, lloyd=lloyd)


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("kind", ["random", "blue", "lattice"])
@pytest.mark.parametrize(("n", "seed"), [(60, 0), (60, 1), (200, 2), (500, 3)])
def test_foams_are_sound(name, kind, n, seed):
    foam = foam_of(name, kind, n, seed)
    cell, net = CELLS[name], foam.network
    assert foam.n_bubbles == n
    assert net.charges.sum() == 6 * cell.surface.euler_characteristic
    assert net.euler_characteristic == cell.surface.euler_characteristic
    assert net.markers.size == 0
    assert (foam.bubble_areas > 0).all()
    assert foam.bubble_areas.sum() == pytest.approx(cell.surface.area, rel=1e-12)
    np.testing.assert_allclose(foam.target_volumes, cell.volume / n, rtol=1e-12)
    assert (foam.order, foam.tension, foam.pressures) == (4, 1.0, None)
    assert np.abs(foam.film_offsets).max() < 0.5
    assert np.linalg.norm(np.diff(foam.film_ends, axis=0), axis=2).min() > 0


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("kind", ["blue", "lattice"])
def test_films_leave_their_vertices_in_the_order_of_the_network(name, kind):
    """The network and the places agree: no bubble is inside out, at no vertex."""
    foam = foam_of(name, kind, 200, 2)
    halves = foam.network.outgoing
    tangent = outward_tangents(foam.cell.surface, foam.network, foam.vertex_points, foam.film_offsets, halves)
    normal = foam.cell.surface.normals(foam.vertex_points[foam.network.origin[halves[:, 0]]])
    e1 = tangent[:, 0]
    e2 = np.cross(normal, e1)
    angles = np.arctan2(np.einsum("vka,va->vk", tangent, e2), np.einsum("vka,va->vk", tangent, e1))
    turns = np.mod(np.roll(angles, -1, axis=1) - angles, 2 * np.pi)
    once = np.isclose(turns.sum(axis=1), 2 * np.pi)
    assert once.mean() > 0.97  # films shorter than an edge may be turned


@pytest.mark.parametrize("name", CELLS)
def test_bubbles_are_numbered_as_their_seeds(name):
    seeds = SEEDS["blue"](CELLS[name].surface, 150)
    foam = voronoi_foam(CELLS[name], seeds=seeds)
    nearest = cKDTree(seeds).query(foam.bubble_centres)[1]
    np.testing.assert_array_equal(nearest, np.arange(150))
    np.testing.assert_array_equal(foam.bubble_ids, np.arange(150))
    again = voronoi_foam(CELLS[name], 150, seeds=seeds)
    np.testing.assert_array_equal(again.vertex_points, foam.vertex_points)


@pytest.mark.parametrize("name", CELLS)
def test_the_seed_decides_everything(name):
    first = foam_of(name, "random", 60, 0)
    again = voronoi_foam(CELLS[name], 60, seed=np.random.default_rng(0))
    for key in ("vertex_points", "film_offsets", "target_volumes"):
        np.testing.assert_array_equal(getattr(first, key), getattr(again, key))
    np.testing.assert_array_equal(first.network.next, again.network.next)
    assert not np.array_equal(first.vertex_points[:50], foam_of(name, "random", 60, 1).vertex_points[:50])
    assert first.seed == 0
    words, place = np.random.get_state()[1:3]  # noqa: NPY002 - the global state must not move
    voronoi_foam(CELLS[name], 60, volumes=0.2)
    np.testing.assert_array_equal(np.random.get_state()[1], words)  # noqa: NPY002
    assert np.random.get_state()[2] == place  # noqa: NPY002


def test_an_integer_of_numpy_is_kept_as_the_seed():
    assert voronoi_foam(CELLS["sphere"], 20, seed=np.int64(7)).seed == 7


def test_lattices_need_no_seed():
    one, two = foam_of("torus", "lattice", 60, 0), foam_of("torus", "lattice", 60, 1)
    np.testing.assert_array_equal(one.vertex_points, two.vertex_points)


@pytest.mark.parametrize("name", CELLS)
def test_lloyd_makes_bubbles_even(name):
    """Spread of areas and of distances to the hexagon's six sides, sweep after sweep."""
    spread = [
        float(np.std(foam_of(name, "random", 150, 0, lloyd).bubble_areas)) / (CELLS[name].surface.area / 150)
        for lloyd in (0, 1, 4, 12)
    ]
    assert 0.35 < spread[0] < 0.75  # 0.53 for random seeds in the plane
    assert (np.diff(spread) < 0).all()
    assert spread[-1] < 0.2


@pytest.mark.parametrize("order", [2, 3, 7, 24])
def test_order_of_the_films(order):
    foam = voronoi_foam(CELLS["sphere"], 30, seeds="lattice", order=order)
    assert foam.film_offsets.shape == (foam.network.n_films, order - 1)


def test_progress_is_told():
    told = []
    voronoi_foam(CELLS["sphere"], 50, lloyd=2, progress=lambda stage, share: told.append((stage, share)))
    stages, shares = zip(*told, strict=True)
    assert set(stages) == {"build"}
    assert (np.diff(shares) > 0).all()
    assert shares[0] > 0
    assert shares[-1] == pytest.approx(1.0)


# ---------------------------------------------------------------------------- volumes


@pytest.mark.parametrize("width", [0.1, 0.5, 1.0])
def test_a_width_draws_log_normal_volumes(width):
    cell = CELLS["torus"]
    foam = voronoi_foam(cell, 600, seeds="lattice", volumes=width, seed=3)
    volumes = foam.target_volumes
    assert volumes.sum() == pytest.approx(cell.volume, rel=1e-12)
    logs = np.log(volumes)
    assert logs.std() == pytest.approx(width, rel=4 / np.sqrt(2 * 600))
    assert kstest((logs - logs.mean()) / logs.std(), "norm").pvalue > 1e-3
    other = voronoi_foam(cell, 600, seeds="lattice", volumes=width, seed=4)
    assert not np.array_equal(other.target_volumes, volumes)


def test_no_width_is_equal_volumes():
    for none in (0, 0.0, np.float64(0.0)):
        foam = voronoi_foam(CELLS["sphere"], 30, seeds="lattice", volumes=none)
        np.testing.assert_allclose(foam.target_volumes, CELLS["sphere"].volume / 30, rtol=1e-13)


def test_volumes_of_your_own():
    cell = CELLS["sphere"]
    wanted = np.linspace(1.0, 3.0, 30)
    wanted *= cell.volume / wanted.sum()
    foam = voronoi_foam(cell, 30, seeds="blue", volumes=wanted)
    np.testing.assert_allclose(foam.target_volumes, wanted, rtol=1e-14)
    assert foam.target_volumes.sum() == pytest.approx(cell.volume, rel=1e-14)


# ---------------------------------------------------------------------------- too few, too coarse


@pytest.fixture
def attempts(monkeypatch):
    """Numbers of mesh nodes that were tried."""
    tried = []
    true_built = build._built

    def built(cell, points, targets, n_nodes, *rest):
        tried.append(n_nodes)
        return true_built(cell, points, targets, n_nodes, *rest)

    monkeypatch.setattr(build, "_built", built)
    return tried


def test_meshes_are_as_fine_as_the_bubbles_ask(attempts):
    voronoi_foam(CELLS["sphere"], 20, seeds="lattice")
    voronoi_foam(CELLS["torus"], 250, seeds="lattice")
    voronoi_foam(CELLS["torus"], 50, seeds="lattice", n_nodes=2500)
    assert attempts == [build.LEAST_NODES, max(build.LEAST_NODES, 250 * build.NODES_PER_BUBBLE), 2500]


@pytest.mark.parametrize("failures", [1, 2, 3])
def test_meshes_are_refined_until_they_carry_the_bubbles(attempts, monkeypatch, failures):
    """Twice the nodes after each failure, three attempts in all; then advice."""
    true_network = build.region_network

    def fails_at_first(mesh, labels, count):
        if len(attempts) <= failures:
            raise ResolutionError("too coarse")
        return true_network(mesh, labels, count)

    monkeypatch.setattr(build, "region_network", fails_at_first)
    first = build.LEAST_NODES
    if failures < 3:
        assert voronoi_foam(CELLS["sphere"], 30).network.charges.sum() == 12
        assert attempts == [first, 2 * first, 4 * first][: failures + 1]
    else:
        with pytest.raises(ResolutionError, match=rf"too coarse.*n_nodes = {16 * first} or more \(tried"):
            voronoi_foam(CELLS["sphere"], 30)
        assert attempts == [first, 2 * first, 4 * first]
    attempts.clear()
    with pytest.raises(ResolutionError, match=r"too coarse.*n_nodes = 4000 or more"):
        voronoi_foam(CELLS["sphere"], 30, n_nodes=1000)  # of your choice: not refined
    assert attempts == [1000]


def test_hopelessly_coarse_meshes_are_not_tried(attempts):
    with pytest.raises(
        ResolutionError, match="n_nodes = 600 is too coarse for 120 bubbles; use at least 720"
    ):
        voronoi_foam(CELLS["torus"], 120, n_nodes=600)
    assert attempts == []


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("kind", ["random", "blue", "lattice"])
def test_too_few_bubbles_for_a_sphere(n, kind):
    with pytest.raises(ResolutionError, match=f"n_bubbles must be at least 4 .*got {n}.*Foam.from_loops"):
        voronoi_foam(CELLS["sphere"], n, seeds=kind)
    with pytest.raises(ResolutionError, match="at least 4"):
        voronoi_foam(CELLS["sphere"], seeds=SPHERE.lattice_points(n))


@pytest.mark.parametrize("n", range(1, 11))
def test_few_bubbles_on_a_torus_are_refused_with_the_number_needed(n):
    with pytest.raises(
        ResolutionError, match=rf"would not be disks.*Use about \d+ bubbles or more \(now {n}\)"
    ):
        voronoi_foam(CELLS["torus"], n, n_nodes=3000)


@pytest.mark.parametrize("n", [4, 5, 6, 7, 8])
@pytest.mark.parametrize("seed", range(4))
def test_few_bubbles_on_a_sphere_are_sound_or_refused(n, seed):
    try:
        foam = voronoi_foam(CELLS["sphere"], n, seed=seed)
    except ResolutionError as fault:
        assert "Use" in str(fault)  # noqa: PT017
    else:
        assert foam.network.charges.sum() == 12
        assert (foam.bubble_areas > 0).all()
        assert foam.bubble_areas.sum() == pytest.approx(4 * np.pi)


@pytest.mark.parametrize("n", [8, 14, 24])
@pytest.mark.parametrize("seed", range(3))
def test_bubbles_on_a_fat_torus_are_sound_or_refused(n, seed):
    cell = HeleShawCell(Torus(3.0, 1.2), 0.1)
    try:
        foam = voronoi_foam(cell, n, seed=seed, seeds="blue")
    except ResolutionError as fault:
        assert "Use" in str(fault)  # noqa: PT017
    else:
        assert foam.network.charges.sum() == 0
        assert foam.bubble_areas.sum() == pytest.approx(cell.surface.area)
        assert (foam.bubble_areas > 0).all()


@pytest.mark.parametrize(("n", "kind", "seed"), [(12, "blue", 2), (14, "random", 2), (30, "random", 2)])
def test_films_of_more_than_half_a_turn_are_refused(n, kind, seed):
    cell = HeleShawCell(Torus(3.0, 1.2), 0.1)
    with pytest.raises(ResolutionError, match="half a turn"):
        voronoi_foam(cell, n, seed=seed, seeds=kind)


def test_a_narrow_hole_asks_for_more_bubbles():
    """A hole 0.05 across needs bubbles of about a third of its girth; more mesh nodes do not help."""
    with pytest.raises(ResolutionError, match=r"Use about \d+ bubbles or more"):
        voronoi_foam(HeleShawCell(Torus(1.05, 1.0), 0.01), 60, seeds="blue", n_nodes=4000)


def test_a_thin_ring_asks_for_more_bubbles():
    with pytest.raises(ResolutionError, match=r"Use about \d+ bubbles or more"):
        voronoi_foam(HeleShawCell(Torus(1000.0, 1.0), 0.1), 200)
