"""Distances domain by domain: those of the whole mesh, on closed, periodic and open meshes, in pieces too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from warpedfoam import FlatTorus, HeleShawCell, MeshError, SchwarzP, Sphere, Torus, voronoi_foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces import TriangleMesh
from warpedfoam.tessellate import build, domains, fields, intrinsic_heat
from warpedfoam.tessellate.domains import DividedHeat, divided
from warpedfoam.tessellate.fields import heat_solver, seed_fields
from warpedfoam.tessellate.geodesics import HeatGeodesics
from warpedfoam.tessellate.intrinsic_heat import IntrinsicHeat
from warpedfoam.tessellate.seeds import random_seeds

SURFACES = {
    "torus": Torus(20.0, 4.0),
    "sphere": Sphere(1.0),
    "flat torus": FlatTorus(10.0, 8.0),
    "P": SchwarzP(1.0),
}


def strip(n, m, spacing=1.0):
    """A flat open mesh of n by m nodes, jittered."""
    y, x = np.divmod(np.arange(n * m), n)
    push = np.random.default_rng(0).uniform(-0.2, 0.2, (2, n * m))
    push[0, (x == 0) | (x == n - 1)] = push[1, (y == 0) | (y == m - 1)] = 0.0
    nodes = spacing * np.stack([x + push[0], y + push[1], np.zeros(n * m)], axis=1)
    a = (y * n + x)[(x < n - 1) & (y < m - 1)]
    return TriangleMesh(
        nodes, np.concatenate([np.stack(t, 1) for t in ((a, a + 1, a + n), (a + 1, a + n + 1, a + n))])
    )


def bisectors(mesh, seeds, found, labels, other):
    """How far two fields' bisectors are apart where ``labels`` change, in mean edges; seeds not too close."""
    x, y = mesh.edges.T
    use = labels[x] != labels[y]
    x, y = x[use], y[use]
    apart = np.linalg.norm(nearest_image(seeds[labels[x]] - seeds[labels[y]], mesh.period), axis=1)
    ends = np.stack([labels[x], labels[y]], axis=1)
    one, known = found(x, ends)
    two, also = other(x, ends)
    good = known.all(axis=1) & also.all(axis=1) & (apart > 0.3 * np.sqrt(mesh.area / len(seeds)))
    change = (one - two) @ np.array([-1.0, 1.0])
    return np.abs(change / (2.0 * apart))[good] / mesh.mean_edge


def of(field):
    return lambda nodes, ends: field.square_to(np.stack([nodes, nodes], axis=1), ends)


def disagreement(field, labels):
    """How much farther, in edges, nodes are from the seed ``labels`` gives them than from their own."""
    own = field.labels()
    bad = np.flatnonzero(own != labels)
    there, known = field.square_to(bad, labels[bad])
    here, _ = field.square_to(bad, own[bad])
    assert known.all()
    gap = np.sqrt(np.maximum(there, 0.0)) - np.sqrt(np.maximum(here, 0.0))
    return len(bad) / len(own), gap.max(initial=0.0) / field.mesh.mean_edge


# ------------------------------------------------------------------------ against the undivided mesh


@pytest.mark.parametrize("name", SURFACES)
def test_domains_give_the_fields_of_the_whole_mesh(name, monkeypatch):
    surface = SURFACES[name]
    if surface.period is None:
        monkeypatch.setattr(intrinsic_heat, "SEAM", 0.0)  # as libigl has it
    mesh, seeds = surface.triangulate(16_000), random_seeds(surface, 500, 0)
    t, spacing = mesh.mean_edge**2, float(np.sqrt(surface.area / 500))
    whole = seed_fields(HeatGeodesics(mesh, t), seeds, spacing)
    parts = seed_fields(DividedHeat(mesh, t, core=2000), seeds, spacing)
    share, gap = disagreement(whole, parts.labels())
    assert share < 0.01  # found: 0.001 to 0.004
    assert gap < 0.2
    change = bisectors(mesh, seeds, of(whole), whole.labels(), of(parts))
    assert change.mean() < 0.02  # the method's own error
    assert np.quantile(change, 0.99) < 0.15


def test_a_wider_rim_of_the_domains_changes_less(monkeypatch):
    surface = SURFACES["flat torus"]
    mesh, seeds = surface.triangulate(16_000), random_seeds(surface, 500, 0)
    t, spacing = mesh.mean_edge**2, float(np.sqrt(surface.area / 500))
    whole = seed_fields(HeatGeodesics(mesh, t), seeds, spacing)
    means = []
    for margin in (0.0, 6.0, 25.0):
        monkeypatch.setattr(domains, "MARGIN", margin)
        parts = seed_fields(DividedHeat(mesh, t, core=2000), seeds, spacing)
        means.append(bisectors(mesh, seeds, of(whole), whole.labels(), of(parts)).mean())
    assert means[2] < 0.6 * means[1] < 0.6 * means[0]


@pytest.mark.parametrize("n_nodes", [8000, 24_000])
def test_bisectors_on_a_flat_torus_are_straight(n_nodes):
    surface, count = SURFACES["flat torus"], 300
    mesh, seeds = surface.triangulate(n_nodes), random_seeds(surface, count, 1)
    exact = (nearest_image(mesh.nodes[:, None] - seeds, mesh.period) ** 2).sum(axis=2)

    def truth(nodes, ends):
        return exact[nodes[:, None], ends], np.ones(ends.shape, dtype=bool)

    found = seed_fields(DividedHeat(mesh, mesh.mean_edge**2, 3000), seeds, float(np.sqrt(80.0 / count)))
    error = bisectors(mesh, seeds, of(found), exact.argmin(axis=1), truth)
    assert error.mean() < 0.03  # found: 0.02; 0.028 with X of full length at seams
    assert error.max() < 0.6
    assert (found.labels() != exact.argmin(axis=1)).mean() < 0.015


def test_a_real_rim_is_no_hindrance():
    """On a flat open rectangle geodesics are straight lines, along its rim too."""
    mesh = strip(110, 90)
    rng = np.random.default_rng(3)
    seeds = rng.uniform(0.0, 1.0, (200, 3)) * [109.0, 89.0, 0.0]
    exact = ((mesh.nodes[:, None] - seeds) ** 2).sum(axis=2)
    found = seed_fields(DividedHeat(mesh, mesh.mean_edge**2, 1500), seeds, float(np.sqrt(109 * 89 / 200)))
    assert (found.labels() != exact.argmin(axis=1)).mean() < 0.03

    def truth(nodes, ends):
        return exact[nodes[:, None], ends], np.ones(ends.shape, dtype=bool)

    error = bisectors(mesh, seeds, of(found), exact.argmin(axis=1), truth)
    assert error.mean() < 0.1  # found: 0.076, of the whole mesh too: 0.15 at the rim, 0.065 far from it


def test_the_same_twice_and_at_any_scale():
    surface = SURFACES["sphere"]
    mesh, seeds = surface.triangulate(6000), random_seeds(surface, 150, 0)
    spacing = float(np.sqrt(surface.area / 150))
    first = seed_fields(DividedHeat(mesh, mesh.mean_edge**2, 1500), seeds, spacing)
    again = seed_fields(DividedHeat(mesh, mesh.mean_edge**2, 1500), seeds, spacing)
    np.testing.assert_array_equal(first.squares, again.squares)
    for scale in (2.0**-30, 2.0**40):
        large = TriangleMesh(scale * mesh.nodes, mesh.triangles)
        field = seed_fields(DividedHeat(large, large.mean_edge**2, 1500), scale * seeds, scale * spacing)
        assert (field.labels() != first.labels()).mean() < 1e-3
        np.testing.assert_allclose(field.squares / scale**2, first.squares, atol=1e-9)


def test_sheets_that_nearly_touch_do_not_mix():
    """Two parallel sheets in one mesh, joined far away only: each node belongs to a seed of its own sheet."""
    one = strip(60, 60)
    nodes = np.concatenate([one.nodes, one.nodes + np.array([0.0, 0.0, 0.5])])
    mesh = TriangleMesh(nodes, np.concatenate([one.triangles, one.triangles + one.n_nodes]))
    rng = np.random.default_rng(5)
    seeds = rng.uniform(0.0, 59.0, (120, 3)) * [1.0, 1.0, 0.0]
    sheet = np.arange(120) % 2
    seeds[:, 2] = 0.5 * sheet
    heat = DividedHeat(mesh, mesh.mean_edge**2, 1800)
    field = seed_fields(heat, seeds, float(np.sqrt(2 * 59.0**2 / 120)))
    upper = np.arange(mesh.n_nodes) >= one.n_nodes
    assert (sheet[field.labels()] == upper).all()


# ------------------------------------------------------------------------ parts


@pytest.mark.parametrize("most", [700, 5000])
def test_cores_share_the_nodes_out(most):
    mesh = SURFACES["torus"].triangulate(6000)
    cores = divided(mesh, most)
    np.testing.assert_array_equal(np.sort(np.concatenate(cores)), np.arange(mesh.n_nodes))
    assert max(map(len, cores)) <= most
    assert min(map(len, cores)) >= most // 2 - 1


def test_pieces_without_a_source_get_nothing():
    one = strip(12, 12)
    corners = np.concatenate([one.corners, one.corners])
    triangles = np.concatenate([one.triangles, one.triangles + one.n_nodes])
    heat = IntrinsicHeat(corners, triangles, 2 * one.n_nodes, 4.0)
    assert len(np.unique(heat.piece)) == 2
    both = heat.solve_many([np.array([5]), np.array([5 + one.n_nodes]), np.array([5, 9 + one.n_nodes])])
    alone = IntrinsicHeat(one.corners, one.triangles, one.n_nodes, 4.0).solve(np.array([5]))
    lower, upper = both[: one.n_nodes], both[one.n_nodes :]
    np.testing.assert_allclose(lower[:, 0] - lower[5, 0], alone, atol=1e-10)
    np.testing.assert_allclose(upper[:, 1] - upper[5, 1], alone, atol=1e-10)
    np.testing.assert_allclose(lower[:, 2] - lower[5, 2], alone, atol=1e-10)
    assert not np.ptp(upper[:, 0])
    assert not np.ptp(lower[:, 1])


def test_many_solves_are_single_solves(monkeypatch):
    mesh = SURFACES["sphere"].triangulate(1000)
    heat = IntrinsicHeat(mesh.corners, mesh.triangles, mesh.n_nodes, 4.0 * mesh.mean_edge**2)
    sets = [np.array([k, 900 - k]) for k in range(20)]
    many = heat.solve_many(sets)
    monkeypatch.setattr(intrinsic_heat, "BLOCK", 3)
    np.testing.assert_allclose(heat.solve_many(sets), many, atol=1e-12)
    for k in (0, 15, 19):
        single = heat.solve(sets[k])
        np.testing.assert_allclose(many[:, k] - many[sets[k], k].mean(), single, atol=1e-12)


def test_distances_hold_where_heat_is_faint():
    """400 edges away u is 1e-160, and its squares are 0 in floating point."""
    mesh = strip(420, 5)
    heat = IntrinsicHeat(mesh.corners, mesh.triangles, mesh.n_nodes, mesh.mean_edge**2)
    found = heat.solve(np.array([2 * 420]))
    exact = np.linalg.norm(mesh.nodes - mesh.nodes[2 * 420], axis=1)
    late = exact > 350.0
    assert np.abs(found - exact)[late].max() < 10.0
    assert found[late].min() > 0.97 * 350.0


# ------------------------------------------------------------------------ foams


@pytest.mark.parametrize("name", ["torus", "flat torus"])
def test_foams_come_out_the_same(name, monkeypatch):
    cell = HeleShawCell(SURFACES[name], 0.05)
    whole = voronoi_foam(cell, 250, seed=4, n_nodes=12_000, lloyd=1)
    monkeypatch.setattr(fields, "WHOLE", 1000)
    solver = fields.heat_solver
    monkeypatch.setattr(build, "heat_solver", lambda mesh, t: replace(solver(mesh, t), core=3000))
    calls = []
    parts = voronoi_foam(
        cell, 250, seed=4, n_nodes=12_000, lloyd=1, progress=lambda name, share: calls.append(share)
    )
    assert calls == sorted(calls)
    assert calls[-1] == 1.0
    assert parts.network.charges.sum() == whole.network.charges.sum()
    assert (parts.network.charges != whole.network.charges).mean() < 0.1
    assert parts.energy == pytest.approx(whole.energy, rel=2e-3)
    assert np.abs(parts.bubble_areas / whole.bubble_areas - 1.0).mean() < 0.01


def test_small_meshes_stay_whole_and_bad_ones_are_refused(monkeypatch):
    mesh = SURFACES["sphere"].triangulate(1000)
    assert isinstance(heat_solver(mesh, mesh.mean_edge**2), HeatGeodesics)
    monkeypatch.setattr(fields, "WHOLE", 100)
    assert isinstance(heat_solver(mesh, mesh.mean_edge**2), DividedHeat)
    torn = TriangleMesh(mesh.nodes, np.concatenate([mesh.triangles, mesh.triangles[:1]]))
    with pytest.raises(MeshError):
        heat_solver(torn, mesh.mean_edge**2)
