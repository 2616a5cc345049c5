"""Surfaces that repeat in space: nearest images, the honeycomb, T1s on it, Schwarz's P surface, files."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from warpedfoam import (
    Cylinder,
    FlatTorus,
    Foam,
    Graph,
    HeleShawCell,
    SchwarzP,
    Sphere,
    equilibrium_report,
    geodesic_distances,
    load,
    relax,
    save,
    save_picture,
    t1,
    voronoi_foam,
    write_ply,
)
from warpedfoam.io.patches import bubble_patches, film_points, loop_points
from warpedfoam.kernels.nets import surface_net
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces import TriangleMesh
from warpedfoam.surfaces.places import Places
from warpedfoam.tessellate import HeatGeodesics, intrinsic_heat
from warpedfoam.tessellate.intrinsic_heat import IntrinsicHeat

from .level_samples import hill_height, hill_slope, relaxed_on

COLUMNS, ROWS = 6, 8


def honeycomb():
    """Unit hexagons in 8 rows of 6, on the flat torus that they fill."""
    step = np.sqrt(2.0 / np.sqrt(3.0))
    sheet = FlatTorus(COLUMNS * step, ROWS * step * np.sqrt(3.0) / 2.0)
    i, j = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS), indexing="ij")
    x, y = (i + 0.5 * (j % 2) + 0.3) * step, (j + 0.2) * step * np.sqrt(3.0) / 2.0
    seeds = np.column_stack([x.ravel(), y.ravel(), np.zeros(i.size)])
    return voronoi_foam(HeleShawCell(sheet, gap=0.25), seeds=seeds)


# ---------------------------------------------------------------------------- images


def test_nearest_images_are_shortest():
    period = np.array([2.0, 3.0, np.inf])
    rng = np.random.default_rng(0)
    d = rng.uniform(-9.0, 9.0, (200, 3))
    found = nearest_image(d, period)
    shifts = np.array([(i, j, 0.0) for i in range(-7, 8) for j in range(-7, 8)]) * [2.0, 3.0, 0.0]
    least = np.linalg.norm(d[:, None] + shifts, axis=2).min(axis=1)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), least, atol=1e-12)
    assert nearest_image(d, None) is d


@pytest.mark.parametrize("period", [None, np.array([2.0, 3.0, np.inf]), np.array([2.0, 3.0, 1.5])])
def test_places_find_what_brute_force_finds(period):
    rng = np.random.default_rng(1)
    points, asked = rng.uniform(-4.0, 4.0, (60, 3)), rng.uniform(-4.0, 4.0, (40, 3))
    places = Places(points, period)
    gaps = np.linalg.norm(nearest_image(asked[:, None] - points, period), axis=2)
    distance, index = places.nearest(asked)
    np.testing.assert_allclose(distance, gaps.min(axis=1), atol=1e-12)
    np.testing.assert_array_equal(index, gaps.argmin(axis=1))
    among = np.linalg.norm(nearest_image(points[:, None] - points, period), axis=2)
    wanted = np.argwhere(np.triu(among < 0.7, k=1))
    np.testing.assert_array_equal(np.unique(places.pairs(0.7), axis=0), wanted)


def test_points_a_hair_below_the_unit_are_inside():
    places = Places(np.array([[-1e-17, 0.5, 0.0]]), np.array([1.0, 1.0, np.inf]))
    assert places.nearest(np.array([[0.0, 0.5, 0.0]]))[0] == pytest.approx(0.0, abs=1e-15)


# ---------------------------------------------------------------------------- geodesics


def test_own_heat_method_is_that_of_libigl_but_at_seams(monkeypatch):
    monkeypatch.setattr(intrinsic_heat, "SEAM", 0.0)
    mesh = Sphere(1.0).triangulate(4000)
    t = 4.0 * mesh.mean_edge**2
    own = IntrinsicHeat(mesh.corners, mesh.triangles, mesh.n_nodes, t)
    for sources in ([7], [7, 2000, 3100]):
        found = own.solve(np.array(sources))
        np.testing.assert_allclose(
            found, HeatGeodesics(mesh, t).distances(sources), atol=0.03 * mesh.mean_edge
        )


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_distances_are_not_long_behind_seams(factor, monkeypatch):
    """Full-length X makes them up to 1 h and 2 h too long, more on finer meshes: see `IntrinsicHeat`."""
    sheet = FlatTorus(10.0, 8.0)
    mesh = sheet.triangulate(12_000)
    h, t = mesh.mean_edge, factor * mesh.mean_edge**2
    exact = np.linalg.norm(nearest_image(mesh.nodes - mesh.nodes[5], sheet.period), axis=1)
    far = exact > 4.0 * h

    def error():
        return (HeatGeodesics(mesh, t).distances(5) - exact)[far] / h

    mended = error()
    monkeypatch.setattr(intrinsic_heat, "SEAM", 0.0)
    plain = error()
    assert mended.max() < 0.5 * np.sqrt(factor) < 0.7 * plain.max()
    assert mended.std() < 0.7 * plain.std()
    assert mended.min() > plain.min() - 0.3
    # away from seams nothing changes
    early = exact[far] < 2.0
    assert np.abs(mended - plain)[early].max() < 0.15


def test_distances_cross_the_edges_of_the_unit():
    sheet = FlatTorus(10.0, 8.0)
    mesh = sheet.triangulate(6000)
    source = [-4.9, 3.9, 0.0]
    exact = np.linalg.norm(nearest_image(mesh.nodes - source, sheet.period), axis=1)
    assert exact.max() < 6.5
    found = geodesic_distances(mesh, [source])
    far = exact > 3 * mesh.mean_edge
    assert np.abs(found - exact)[far & (exact < 3.0)].max() < mesh.mean_edge


def test_nets_of_grids_that_repeat_are_closed():
    n = 24
    grid = np.stack(np.meshgrid(*[np.arange(n) / n * 2 * np.pi] * 3, indexing="ij"), axis=-1)
    nodes, triangles = surface_net(np.cos(grid).sum(axis=-1), periodic=True)
    mesh = TriangleMesh(nodes, triangles, np.full(3, float(n)))
    mesh.require_surface(closed=True)
    assert mesh.euler_characteristic == -4


@pytest.mark.parametrize("n_nodes", [12, 100, 3001])
def test_flat_triangulations(n_nodes):
    sheet = FlatTorus(10.0, 8.0)
    mesh = sheet.triangulate(n_nodes)
    mesh.require_surface(closed=True)
    assert mesh.euler_characteristic == 0
    assert mesh.area == pytest.approx(80.0, rel=1e-12)
    assert sheet.triangulate(n_nodes) is mesh


# ---------------------------------------------------------------------------- honeycomb


def test_the_honeycomb_has_its_energy():
    """12^¼ per unit bubble, to 1e-10; all pressures equal, all angles 120°."""
    foam = honeycomb()
    result = relax(foam)
    assert result.converged
    assert result.n_t1 == 0
    assert (result.foam.network.sides == 6).all()
    assert result.foam.film_lengths.sum() == pytest.approx(48 * 12**0.25, rel=1e-10)
    assert result.energy == pytest.approx(48 * 12**0.25 * 0.25, rel=1e-10)
    np.testing.assert_allclose(result.pressures, 0.0, atol=1e-9)
    assert equilibrium_report(result.foam).angle_error < 1e-8


def test_every_t1_on_the_honeycomb_raises_its_energy():
    """Relaxed without further T1s; a turned film is longer by a tenth of an edge per bubble at least."""
    start = relax(honeycomb()).foam
    raised = []
    for film in range(start.network.n_films):
        after = relax(t1(start, film), t1=False)
        assert after.converged, film
        sides = after.foam.network.sides
        assert sorted(sides[sides != 6].tolist()) == [5, 5, 7, 7]
        raised.append(after.energy - start.energy)
    # all films of the honeycomb are alike, but for the box: three directions
    assert min(raised) > 0.02 * 0.25
    assert len(np.unique(np.round(raised, 8))) <= 3


def test_energies_do_not_depend_on_the_unit():
    """The same foam moved by a part of a period and by whole periods."""
    foam = relaxed_on("sheet").foam
    shift = np.array([3.3, -50.0, 0.0])
    moved = Foam(foam.cell, foam.network, foam.vertex_points + shift, foam.film_offsets, foam.target_volumes)
    assert moved.energy == pytest.approx(foam.energy, rel=1e-13)
    np.testing.assert_allclose(moved.bubble_volumes, foam.bubble_volumes, rtol=1e-10)
    away = nearest_image(moved.bubble_centres - foam.bubble_centres - shift, foam.cell.surface.period)
    np.testing.assert_allclose(away, 0.0, atol=1e-8)


def test_a_cylinder_is_a_rolled_up_sheet():
    """Leading order: the relaxed foam has the flat foam's energy to 1e-9, and its pressures."""
    gap, radius, height = 1e-7, 1.5, 8.0
    tube, sheet = Cylinder(radius, height, periodic=True), FlatTorus(2 * np.pi * radius, height)
    flat = relax(voronoi_foam(HeleShawCell(sheet, gap), 100, seed=4), order=8)
    cell = HeleShawCell(tube, gap)
    start = Foam(
        cell,
        flat.foam.network,
        tube.rolled(flat.foam.vertex_points),
        np.zeros_like(flat.foam.film_offsets),
        flat.foam.target_volumes * cell.volume / flat.foam.cell.volume,
    )
    rolled = relax(start, order=8, t1=False)
    assert flat.converged
    assert rolled.converged
    assert rolled.energy == pytest.approx(flat.energy, rel=1e-9 + gap / radius)
    np.testing.assert_allclose(rolled.pressures, flat.pressures, atol=1e-6 * np.ptp(flat.pressures))


# ---------------------------------------------------------------------------- Schwarz's P surface


def test_a_foam_on_schwarz_p():
    """Σ q = −24 per unit, 200 bubbles, Gauss–Bonnet for each."""
    result = relax(voronoi_foam(HeleShawCell(SchwarzP(6.0), gap=1e-6), 200, seed=0), order=8)
    assert result.converged
    assert result.is_minimum
    assert result.foam.network.charges.sum() == -24
    assert result.foam.bubble_curvatures.sum() == pytest.approx(-8 * np.pi, abs=1e-5)
    assert equilibrium_report(result.foam).identity_error < 1e-5


def test_schwarz_p_is_nearly_minimal():
    """Area 2.3526 a² of the nodal surface; the minimal one has 2.3451 a² (Schoen 1970)."""
    surface = SchwarzP(1.0)
    assert surface.area == pytest.approx(2.35257, abs=1e-5)
    points = surface.random_points(300, 0)
    mean = surface.principal_curvatures(points).sum(axis=1)
    assert np.sqrt((mean**2).mean()) < 0.2 * np.abs(surface.curvature_range()).max()
    assert (surface.gaussian_curvature(points) < 1e-6).all()


# ---------------------------------------------------------------------------- files and pictures


@pytest.mark.parametrize("name", ["sheet", "crystal"])
def test_bubbles_are_drawn_whole(name, tmp_path):
    foam = relaxed_on(name).foam
    along = film_points(foam, 5)
    step = np.linalg.norm(np.diff(along.points[along.chains], axis=1), axis=2)
    assert step.max() < foam.bubble_size
    points, places, sizes, _ = loop_points(foam, along)
    ends = np.cumsum(sizes)
    for start, end in zip(ends - sizes, ends, strict=True):
        ring = points[places[start:end]]
        assert np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).max() < foam.bubble_size
    patches = bubble_patches(foam)
    assert not patches.sunk.size
    a, b, c = (patches.points[patches.triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(foam.cell.surface.area, rel=0.02)
    ply, _ = write_ply(tmp_path / "foam.ply", foam)
    back = trimesh.load(ply, process=False)
    assert back.area == pytest.approx(foam.cell.surface.area, rel=0.05)
    assert save_picture(tmp_path / "foam.png", foam).stat().st_size > 10_000
    again = load(save(tmp_path / "foam.npz", foam))
    assert again.energy == foam.energy
    np.testing.assert_array_equal(again.bubble_volumes, foam.bubble_volumes)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FlatTorus(0.0, 1.0), "width must be greater than 0"),
        (lambda: FlatTorus(1.0, np.inf), "height must be finite"),
        (lambda: Cylinder(1.0, 0.0, periodic=True), "height must be greater than 0"),
        (lambda: Cylinder(1.0, 1.0, periodic=1), "periodic must be True or False"),
        (lambda: Graph(hill_height, hill_slope, 7.0, 6.0, periodic=True), "does not repeat"),
        (lambda: Graph(hill_height, hill_height, 8.0, 6.0, periodic=True), "gradient's values"),
        (lambda: Graph(hill_height, lambda x: x, 8.0, 6.0, periodic=True), "gradient is not that"),
        (lambda: Graph("h", hill_slope, 8.0, 6.0, periodic=True), "function must be callable"),
        (lambda: SchwarzP(-1.0), "cell_length must be greater than 0"),
        (lambda: SchwarzP("a"), "cell_length must be a number"),
    ],
)
def test_bad_sizes(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()
