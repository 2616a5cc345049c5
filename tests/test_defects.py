"""Defects: foams with planted ones are classified exactly, whatever their pose, names and handedness."""

from __future__ import annotations

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.analysis import KINDS
from warpedfoam.analysis.defects import bubbles_round, rim_bubbles
from warpedfoam.kernels.periodic import nearest_image

from .io_foams import bubble_on_torus, lone_bubble, torus_foam
from .nets import NETS, hemispheres, lunes
from .planted import (
    SIZE,
    bond,
    flat_cell,
    foam_of,
    glide,
    honeycomb,
    icosahedron,
    laid_out,
    lattice,
    node,
    relabelled,
    slip,
    subdivided,
    turned,
    with_markers,
    without,
)


def kinds(foam: wf.Foam) -> dict[str, int]:
    return {name: count for name, count in wf.defects(foam).kinds.items() if count}


def vacancy(fan: str) -> wf.Foam:
    return foam_of(flat_cell(SIZE, SIZE), *without(*lattice(SIZE, SIZE), 50, fan))


def interstitial() -> wf.Foam:
    nodes, triangles = lattice(SIZE, SIZE)
    a, b, c = triangles[40].tolist()
    new = len(nodes)
    middle = nodes[a] + np.array([0.5, np.sqrt(0.75) / 3.0, 0.0])
    split = np.array([[a, b, new], [b, c, new], [c, a, new]])
    return foam_of(
        flat_cell(SIZE, SIZE),
        np.vstack([nodes, middle]),
        np.concatenate([np.delete(triangles, 40, 0), split]),
    )


def wall() -> wf.Foam:
    """Two dislocations above each other at either end: pleats of two pairs."""
    foam = honeycomb(SIZE, SIZE)
    network = foam.network
    for one, two in (((3, 4), (2, 5)), ((2, 6), (1, 7))):
        half = bond(foam.network, node(*one), node(*two))
        network = glide(wf.Foam(foam.cell, network, foam.vertex_points), half, 5).network
    return laid_out(foam.cell, network, foam.bubble_centres)


def scarred(foam: wf.Foam, charge: int) -> wf.Foam:
    """A dislocation glided up to a lone charge, its partner three steps away from it."""
    network = foam.network
    for five in np.flatnonzero(network.charges == charge):
        first = network.bubble[np.flatnonzero(network.bubble == five) ^ 1]
        second = network.bubble[np.flatnonzero(np.isin(network.bubble, first)) ^ 1]
        for half in np.flatnonzero(np.isin(network.bubble, second)):
            try:
                candidate = glide(foam, int(half), 3)
            except wf.TopologyError:
                continue
            q = candidate.network.charges
            near = np.unique(candidate.network.bubble[np.flatnonzero(candidate.network.bubble == five) ^ 1])
            # the lone charge stays, and just one charge of the other sign has come beside it
            if q[five] == charge and (q[near] == -charge).sum() == 1 and (q[near] == charge).sum() == 0:
                return candidate
    raise AssertionError("no place for a scar")


def with_sevens() -> wf.Foam:
    """Sphere foam whose lone charges have both signs."""
    for seed in range(50):
        foam = subdivided(np.random.default_rng(seed).standard_normal((14, 3)), 6)
        q = foam.network.charges
        if (q == -1).any() and np.abs(q).max() <= 2:
            return foam
    raise AssertionError("no such hull")


PLANTED = {
    "honeycomb": (lambda: honeycomb(SIZE, SIZE), {}),
    "one T1": (lambda: slip(1), {"neutral": 1}),
    "two dislocations": (lambda: slip(2), {"dislocation": 2}),
    "far dislocations": (lambda: slip(5), {"dislocation": 2}),
    "walls": (wall, {"pleat": 2}),
    "vacancy by a fan": (lambda: vacancy("fan"), {"vacancy": 1}),
    "vacancy by a zigzag": (lambda: vacancy("zigzag"), {"vacancy": 1}),
    "vacancy by a triangle": (lambda: vacancy("triangle"), {"vacancy": 1}),
    "interstitial": (interstitial, {"interstitial": 1}),
    "icosahedron": (lambda: subdivided(icosahedron(), 5), {"disclination": 12}),
    "octahedron": (
        lambda: subdivided(np.concatenate([np.eye(3), -np.eye(3)]), 4),
        {"disclination": 6},
    ),
    "tetrahedron": (
        lambda: subdivided(np.array([[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]), 5),
        {"disclination": 4},
    ),
    "scar": (
        lambda: scarred(subdivided(icosahedron(), 7), 1),
        {"disclination": 11, "scar": 1, "dislocation": 1},
    ),
    "cube": (lambda: NETS[2].foam(0.01, 4), {"network": 1}),
    "dodecahedron": (lambda: NETS[7].foam(0.01, 4), {"network": 1}),
}


@pytest.fixture(scope="module")
def planted() -> dict[str, wf.Foam]:
    return {name: build() for name, (build, _) in PLANTED.items()}


@pytest.mark.parametrize("name", PLANTED)
def test_planted_defects_are_found(planted: dict[str, wf.Foam], name: str) -> None:
    foam = planted[name]
    found = wf.defects(foam)
    assert kinds(foam) == PLANTED[name][1]
    assert found.total_charge == 6 * foam.network.euler_characteristic
    assert int(found.clusters.charge.sum()) == found.total_charge
    np.testing.assert_array_equal(found.disclinations.bubble, np.flatnonzero(foam.network.charges))
    assert set(found.kinds) == set(KINDS)


@pytest.mark.parametrize("name", PLANTED)
def test_names_do_not_matter(planted: dict[str, wf.Foam], name: str) -> None:
    foam = planted[name]
    other, number = relabelled(foam, 3)
    one, two = wf.defects(foam), wf.defects(other)
    assert one.kinds == two.kinds
    assert one.summary == two.summary
    # rows belong to the same bubbles
    place = np.full(foam.n_bubbles, -1)
    place[two.disclinations.bubble] = two.disclinations.cluster
    match = place[number[one.disclinations.bubble]]
    for column in ("kind", "size", "charge", "pairs", "missing", "burgers_squared", "has_burgers"):
        np.testing.assert_array_equal(
            getattr(one.clusters, column)[one.disclinations.cluster], getattr(two.clusters, column)[match]
        )
    np.testing.assert_allclose(
        one.clusters.burgers[one.disclinations.cluster], two.clusters.burgers[match], atol=1e-9
    )


def rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    k = np.cross(np.eye(3), axis / np.linalg.norm(axis))
    return np.eye(3) + np.sin(angle) * k.T + (1 - np.cos(angle)) * (k @ k)


def test_burgers_vectors_turn_with_the_foam(planted: dict[str, wf.Foam]) -> None:
    foam = planted["scar"]
    turn = rotation(np.array([1.0, 2.0, -0.5]), 1.1)
    one, two = wf.defects(foam), wf.defects(turned(foam, turn))
    assert one.kinds == two.kinds
    np.testing.assert_allclose(one.clusters.burgers @ turn.T, two.clusters.burgers, atol=1e-9)
    np.testing.assert_allclose(one.dislocations.burgers @ turn.T, two.dislocations.burgers, atol=1e-9)
    assert np.abs(one.clusters.burgers).max() > 0.3


@pytest.mark.parametrize("name", ["scar", "far dislocations", "walls", "vacancy by a zigzag", "interstitial"])
def test_reflections_reverse_burgers_vectors(planted: dict[str, wf.Foam], name: str) -> None:
    """The walk round a cluster runs the other way in the mirror: b becomes −M b."""
    foam = planted[name]
    mirror = np.diag([-1.0, 1.0, 1.0])
    other = turned(foam, mirror)
    one, two = wf.defects(foam), wf.defects(other)
    assert one.kinds == two.kinds
    for column in ("charge", "pairs", "missing", "burgers_squared"):
        np.testing.assert_array_equal(getattr(one.clusters, column), getattr(two.clusters, column))
    np.testing.assert_allclose(-one.clusters.burgers @ mirror.T, two.clusters.burgers, atol=1e-9)


def test_burgers_vectors_of_a_slipped_row() -> None:
    """One lattice spacing along the slip, opposite at the two ends, perpendicular to the step 5 → 7."""
    foam = wf.relax(slip(6), t1=False).foam
    found = wf.defects(foam)
    b = found.clusters.burgers
    assert found.clusters.burgers_squared.tolist() == [1, 1]
    np.testing.assert_allclose(np.linalg.norm(b, axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(b[0], -b[1], atol=1e-6)
    np.testing.assert_allclose(np.abs(b[:, 0]), 1.0, atol=2e-3)
    pairs = found.dislocations
    step = foam.bubble_centres[pairs.negative] - foam.bubble_centres[pairs.positive]
    step /= np.linalg.norm(step, axis=1, keepdims=True)
    np.testing.assert_allclose(pairs.burgers, np.cross([0.0, 0.0, 1.0], step), atol=0.05)
    assert pairs.transported.all()
    assert found.clusters.frame_fit.min() > 0.95


@pytest.mark.parametrize("turns", range(6))
def test_burgers_vectors_of_every_direction(turns: int) -> None:
    """Slip along each of the three rows, either way: b lies along the row."""
    foam = honeycomb(SIZE, SIZE)
    network = foam.network
    start = np.flatnonzero(network.bubble == node(5, 6))
    half = int(start[0])
    for _ in range(turns):
        half = int(network.next[half])
    slipped = glide(foam, half, 3)
    found = wf.defects(slipped)
    assert kinds(slipped) == {"dislocation": 2}
    # the glide runs from bubble to bubble along the row two places clockwise of the turned film
    before = np.empty_like(network.next)
    before[network.next] = np.arange(len(before))
    ahead = int(before[before[half]])
    centres = foam.bubble_centres
    row = centres[network.bubble[ahead ^ 1]] - centres[network.bubble[ahead]]
    row = nearest_image(row, foam.cell.surface.period)
    along = found.clusters.burgers @ (row / np.linalg.norm(row))
    np.testing.assert_allclose(np.abs(along), 1.0, atol=0.02)
    assert along.sum() == pytest.approx(0.0, abs=1e-9)


def test_walls_have_the_sum_of_their_dislocations(planted: dict[str, wf.Foam]) -> None:
    found = wf.defects(planted["walls"])
    assert found.clusters.burgers_squared.tolist() == [4, 4]
    assert found.clusters.pairs.tolist() == [2, 2]
    assert found.dislocations.multiplicity.sum() == 4


def test_vacancies_miss_one_bubble(planted: dict[str, wf.Foam]) -> None:
    for name, foam in planted.items():
        clusters = wf.defects(foam).clusters
        if "vacancy" in name:
            assert clusters.missing.tolist() == [1]
        elif name == "interstitial":
            assert clusters.missing.tolist() == [-1]
        else:
            assert not clusters.missing.any()


def test_positive_and_negative_scars() -> None:
    foam = with_sevens()
    q = foam.network.charges
    lone = {"disclination": int(np.count_nonzero(q))}
    assert kinds(foam) == lone
    for charge in (1, -1):
        found = wf.defects(scarred(foam, charge))
        rows = np.flatnonzero(found.clusters.kind == "scar")
        assert found.clusters.charge[rows].tolist() == [charge]
        assert found.clusters.size[rows].tolist() == [3]
        assert found.clusters.pairs[rows].tolist() == [1]
        assert not found.clusters.has_burgers[rows].any()
        assert found.kinds["dislocation"] == 1


@pytest.mark.parametrize(
    "foam",
    [
        hemispheres(0.01, 4, 4, 0.1),
        lunes(0.01, 4, 0.05),
        lone_bubble(),
        bubble_on_torus(),
        torus_foam(2, 3),
        *(net.foam(0.01, 4) for net in NETS),
    ],
)
def test_small_foams(foam: wf.Foam) -> None:
    """Two bubbles, markers, films shared twice, bubbles that border themselves: no error, right totals."""
    found = wf.defects(foam)
    disks = foam.network.bubble_euler == 1
    assert found.total_charge == int(foam.network.charges[disks].sum())
    for table in ("disclinations", "clusters", "dislocations"):
        for values in found.columns(table).values():
            assert values.dtype.kind in "Ub" or np.isfinite(values).all()
    assert found.graph.number_of_nodes() == len(found.disclinations.bubble)


@pytest.mark.parametrize(
    "surface",
    [
        wf.Sphere(3.0),
        wf.Torus(4.0, 1.5),
        wf.FlatTorus(6.0, 5.0),
        wf.Ellipsoid(2.0, 1.5, 1.0),
        wf.Cylinder(1.0, 6.0, periodic=True),
        wf.SchwarzP(4.0),
    ],
    ids=lambda surface: type(surface).__name__,
)
@pytest.mark.parametrize("seed", [0, 1])
def test_random_foams_keep_their_total_charge(surface: wf.Surface, seed: int) -> None:
    foam = wf.voronoi_foam(wf.HeleShawCell(surface, gap=0.01), 150, seed=seed)
    found = wf.defects(foam)
    assert found.total_charge == 6 * surface.euler_characteristic
    assert int(found.clusters.charge.sum()) == found.total_charge
    assert int(found.clusters.size.sum()) == len(found.disclinations.bubble)
    # exact squares of Burgers vectors agree with the vectors
    np.testing.assert_allclose(
        (found.clusters.burgers**2).sum(axis=1), found.clusters.burgers_squared, atol=1e-9
    )
    # they are tangent
    normals = surface.normals(found.clusters.position)
    np.testing.assert_allclose(np.einsum("kx,kx->k", normals, found.clusters.burgers), 0.0, atol=1e-9)
    # no bubble pairs more often than it has charge
    q = foam.network.charges
    used = np.zeros(len(q))
    np.add.at(used, found.dislocations.positive, found.dislocations.multiplicity)
    np.add.at(used, found.dislocations.negative, found.dislocations.multiplicity)
    assert (used <= np.abs(q)).all()
    assert (q[found.dislocations.positive] > 0).all()
    assert (q[found.dislocations.negative] < 0).all()


@pytest.mark.parametrize("name", ["far dislocations", "walls", "vacancy by a fan", "interstitial", "scar"])
def test_markers_are_no_corners(planted: dict[str, wf.Foam], name: str) -> None:
    """Films in two pieces, on the rims of clusters too, change nothing but the round-off."""
    foam = planted[name]
    films = np.flatnonzero(foam.network.charges[foam.network.left])
    marked = with_markers(foam, films)
    assert len(marked.network.markers) == len(films)
    one, two = wf.defects(foam), wf.defects(marked, tiny=0.0)
    assert one.kinds == two.kinds
    for column in ("size", "charge", "pairs", "missing", "burgers_squared"):
        np.testing.assert_array_equal(getattr(one.clusters, column), getattr(two.clusters, column))
    np.testing.assert_allclose(one.clusters.burgers, two.clusters.burgers, atol=2e-3)


def test_clusters_across_the_edge_of_the_unit(planted: dict[str, wf.Foam]) -> None:
    """Where the unit is cut does not matter, also to a cluster that lies across two cuts."""
    foam = planted["vacancy by a triangle"]
    period = foam.cell.surface.period
    place = wf.defects(foam).clusters.position[0]
    edge = np.array([0.5 * period[0], 0.5 * period[1], 0.0]) - place
    other = wf.Foam(
        foam.cell, foam.network, nearest_image(foam.vertex_points + edge, period), foam.film_offsets
    )
    one, two = wf.defects(foam).clusters, wf.defects(other).clusters
    np.testing.assert_allclose(one.gyration, two.gyration, rtol=1e-9)
    gap = nearest_image(two.position - one.position - edge, period)
    np.testing.assert_allclose(gap, 0.0, atol=1e-9)


def test_dislocation_rules_agree() -> None:
    """Transport round a pair, and the step from five to seven turned left, differ by a small angle."""
    cell = wf.HeleShawCell(wf.Torus(4.0, 1.5), gap=0.01)
    foam = wf.relax(wf.voronoi_foam(cell, 150, seed=1, lloyd=10)).foam
    found = wf.defects(foam).dislocations
    normals = cell.surface.normals(found.position)
    centres = foam.bubble_centres
    step = centres[found.negative] - centres[found.positive]
    left = np.cross(normals, step)
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    one = found.transported & (found.multiplicity == 1)
    cosine = np.einsum("kx,kx->k", left[one], found.burgers[one])
    assert one.sum() > 10
    assert cosine.min() > 0.8
    assert np.median(cosine) > 0.98
    many = ~one
    cosine = np.einsum("kx,kx->k", left[many], found.burgers[many]) / found.multiplicity[many]
    assert cosine.min() > 0.8


def test_tiny_films_make_charges_ambiguous() -> None:
    foam = slip(1)
    film = int(wf.defects(foam).dislocations.film[0])
    relaxed = wf.t1(honeycomb(SIZE, SIZE), film, length=0.02)
    found = wf.defects(relaxed)
    assert found.tiny_films.tolist() == [film]
    four = bubbles_round(relaxed.network, np.array([film]))
    assert len(four) == 4
    np.testing.assert_array_equal(found.disclinations.bubble[found.disclinations.ambiguous], four)
    assert wf.defects(relaxed, tiny=0.01).tiny_films.size == 0
    assert found.clusters.ambiguous.all()


def test_exteriors_are_no_defects() -> None:
    foam = bubble_on_torus()
    found = wf.defects(foam)
    assert rim_bubbles(foam.network).tolist() == [True, False]
    assert found.disclinations.bubble.tolist() == [0]
    assert found.clusters.kind.tolist() == ["rim"]
    assert found.summary["rim_charges"] == 1


def test_graph_and_tables() -> None:
    found = wf.defects(slip(5))
    graph = found.graph
    assert sorted(d["charge"] for _, d in graph.nodes(data=True)) == [-1, -1, 1, 1]
    assert [d["paired"] for *_, d in graph.edges(data=True)] == [1, 1]
    columns = found.columns("clusters")
    assert list(columns)[:3] == ["cluster", "kind", "size"]
    assert {"x", "y", "z", "burgers_x"} <= set(columns)
    with pytest.raises(ValueError, match="table must be"):
        found.columns("bubbles")
    assert not found.clusters.burgers.flags.writeable


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        (("foam", {}), TypeError, "foam must be a Foam"),
        ((None, {"tiny": "small"}), TypeError, "tiny must be a number"),
        ((None, {"tiny": -1.0}), ValueError, "tiny must be at least 0"),
    ],
)
def test_bad_input(arguments: tuple, error: type[Exception], match: str) -> None:
    foam, options = arguments
    with pytest.raises(error, match=match):
        wf.defects(lone_bubble() if foam is None else foam, **options)


# ------------------------------------------------------------------------------------- rims


def strip(lost: int | None = None) -> wf.Foam:
    """A honeycomb on a cylinder, rows of bubbles along both walls; one bubble may be missing."""
    around, rows = 14, 9
    row, place = np.divmod(np.arange(around * rows), around)
    step = 1.0
    radius = around * step / (2.0 * np.pi)
    surface = wf.Cylinder(radius, rows * step * np.sqrt(0.75))
    angle = (place + 0.5 * (row % 2)) * step / radius
    z = (row + 0.5) * step * np.sqrt(0.75)
    bottom, top = sorted(surface.mesh.nodes[:, 2][[0, -1]].tolist())
    z = z * (top - bottom) / (rows * step * np.sqrt(0.75)) + bottom
    seeds = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
    if lost is not None:
        seeds = np.delete(seeds, lost, axis=0)
    return wf.voronoi_foam(wf.HeleShawCell(surface, gap=0.01), seeds=seeds, order=3)


def test_a_honeycomb_that_ends_at_walls_has_no_defects() -> None:
    """q = 6 − films − 2 a wall: a bubble with four films and a wall belongs to the crystal."""
    foam = strip()
    assert foam.network.wall_counts.sum() == 28
    assert not foam.network.charges.any()
    assert wf.defects(foam).clusters.kind.size == 0


@pytest.mark.parametrize("lost", [3, 14 * 8 + 6])
def test_a_vacancy_at_a_wall_is_one_of_the_rim(lost: int) -> None:
    """A bubble missing from the row at the wall: charges that touch the wall and add up to 0."""
    found = wf.defects(strip(lost))
    assert found.total_charge == 0
    assert found.clusters.kind.tolist() == ["rim"]
    assert found.summary["rim_charges"] >= 1
    # no walk closes at a wall, so there is no Burgers vector and nothing to count in it
    assert np.isnan(found.clusters.burgers).all() or not found.clusters.burgers.any()
    assert found.disclinations.rim.any()
    assert found.clusters.charge.tolist() == [0]


def test_the_same_vacancy_inside_is_not() -> None:
    foam = strip(14 * 4 + 6)
    found = wf.defects(foam)
    assert found.clusters.kind.tolist() == ["vacancy"]
    assert found.clusters.missing.tolist() == [1]
    assert not found.disclinations.rim.any()
    # at the wall two rows away it stays one: only touching counts
    near = wf.defects(strip(14 * 2 + 6))
    assert near.clusters.kind.tolist() == ["vacancy"]


def test_a_dislocation_that_reaches_a_wall() -> None:
    """A T1 at the wall leaves charges there; they turn with the foam and keep their kind under new names."""
    foam = strip()
    network = foam.network
    on_wall = network.wall_counts > 0
    films = np.flatnonzero(on_wall[network.left] ^ on_wall[network.right])
    turned_one = wf.t1(foam, int(films[5]))
    found = wf.defects(turned_one)
    assert found.total_charge == 0
    assert found.clusters.kind.tolist() == ["rim"]
    names, _ = relabelled(turned_one, 3)
    again = wf.defects(names)
    assert again.summary == found.summary
