"""Contract of every surface: geometry against finite differences and quadrature, arcs and loops exact."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import warpedfoam.surfaces
from warpedfoam import CellNetwork, Foam, HeleShawCell, Sphere, Surface, Torus, voronoi_foam
from warpedfoam.energy import bubble_volumes, film_terms
from warpedfoam.kernels.loops import loops_of
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.surfaces import Layer

from .io_foams import lone_bubble

#: Every surface class of the package and the ones of its kind that are put to the test.
EXAMPLES = {
    Sphere: [Sphere(1.0), Sphere(7.5)],
    Torus: [Torus(20.0, 4.0), Torus(3.0, 1.2), Torus(1.3, 1.0), Torus(0.03, 0.01)],
}
SURFACES = [surface for kind in EXAMPLES.values() for surface in kind]
LAYERS = {
    "surface": Layer.surface(),
    "curvature": Layer.curvature(),
    "gap": Layer.between_plates(0.3),
    "gap, 5 heights": Layer.between_plates(0.7, 5),
}

each_surface = pytest.mark.parametrize("surface", SURFACES, ids=repr)
each_layer = pytest.mark.parametrize("layer", LAYERS.values(), ids=LAYERS)


def surface_classes():
    found = set()
    for module in pkgutil.walk_packages(warpedfoam.surfaces.__path__, "warpedfoam.surfaces."):
        for _, kind in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            if kind.__module__.startswith("warpedfoam.surfaces") and hasattr(kind, "arc_terms"):
                found.add(kind)
    return found - {Surface}


def test_every_surface_class_is_tested_and_is_a_surface():
    assert surface_classes() == set(EXAMPLES)
    for surface in SURFACES:
        assert isinstance(surface, Surface)


def scale_of(surface):
    """A length over which the surface curves."""
    return 1.0 / max(abs(k) for k in surface.curvature_range())


def samples(surface, count=60, seed=0):
    return surface.random_points(count, seed)


@cache
def foam_on(surface, order=5, n_heights=2):
    """About a hundred bubbles on the surface, films bent at random, a gap of 0.3 curvature radii."""
    cell = HeleShawCell(surface, gap=0.3 * scale_of(surface), n_heights=n_heights)
    foam = voronoi_foam(cell, 90, seeds="blue", seed=1, order=order)
    rng = np.random.default_rng(2)
    return Foam(cell, foam.network, foam.vertex_points, rng.uniform(-0.03, 0.03, foam.film_offsets.shape))


# ---------------------------------------------------------------------------- points


@each_surface
def test_projection_is_idempotent_and_undoes_moves_along_the_normal(surface):
    x = samples(surface)
    tiny = 1e-14 * surface.size
    np.testing.assert_allclose(surface.project(x), x, atol=4 * tiny)
    np.testing.assert_array_equal(surface.project(np.zeros((0, 3))).shape, (0, 3))
    for share in (-0.6, -0.1, 0.1, 0.6):
        moved = x + share * scale_of(surface) * surface.normals(x)
        np.testing.assert_allclose(surface.project(moved), x, atol=10 * tiny)
        np.testing.assert_allclose(surface.normals(moved), surface.normals(x), atol=1e-13)


@each_surface
def test_no_point_of_the_surface_is_nearer_than_the_projection(surface):
    rng = np.random.default_rng(3)
    points = rng.uniform(-1.2, 1.2, (40, 3)) * surface.size
    distance = np.linalg.norm(surface.project(points) - points, axis=1)
    others = surface.random_points(20_000, 4)
    least = np.linalg.norm(points[:, None] - others[None], axis=2).min(axis=1)
    assert (distance <= least).all()
    assert (least - distance < 0.1 * surface.size).all()


@each_surface
def test_surface_lies_in_the_ball_of_its_size(surface):
    reach = np.linalg.norm(samples(surface, 5000), axis=1).max()
    assert 0.9 * surface.size < reach <= surface.size * (1 + 1e-14)


@each_surface
def test_normals_are_unit_and_the_gradient_of_the_distance(surface):
    x = samples(surface)
    n = surface.normals(x)
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-14)
    h = 1e-5 * scale_of(surface)

    def height(y):
        return np.einsum("ni,ni->n", y - surface.project(y), n)

    gradient = np.stack([(height(x + h * e) - height(x - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    np.testing.assert_allclose(gradient, n, atol=1e-8)


@each_surface
def test_principal_curvatures_are_eigenvalues_of_the_normals_derivative(surface):
    x = samples(surface)
    frames = surface.vertex_frames(x)
    h = 1e-4 * scale_of(surface)
    turn = np.stack(
        [
            (surface.normals(x + h * frames[:, k]) - surface.normals(x - h * frames[:, k])) / (2 * h)
            for k in (0, 1)
        ],
        axis=1,
    )
    shape = np.einsum("nia,nja->nij", frames, turn)
    np.testing.assert_allclose(shape, shape.transpose(0, 2, 1), atol=1e-7 / scale_of(surface))
    found = np.linalg.eigvalsh(0.5 * (shape + shape.transpose(0, 2, 1)))
    curvatures = surface.principal_curvatures(x)
    np.testing.assert_allclose(np.sort(curvatures, axis=1), found, atol=1e-7 / scale_of(surface))
    np.testing.assert_allclose(surface.gaussian_curvature(x), curvatures.prod(axis=1), rtol=1e-13)
    low, high = surface.curvature_range()
    assert (curvatures >= low - 1e-12 * abs(low)).all()
    assert (curvatures <= high * (1 + 1e-12)).all()
    many = surface.principal_curvatures(samples(surface, 20_000))  # the range is attained
    assert many.min() - low < 0.05 * (high - low) + 1e-12
    assert high - many.max() < 0.05 * (high - low) + 1e-12


def test_sign_of_the_curvatures():
    """A sphere of radius r with outward normals has W = +I/r; a torus's hole is a saddle."""
    np.testing.assert_allclose(Sphere(4.0).principal_curvatures([[0.0, 0.0, 1.0]]), [[0.25, 0.25]])
    torus = Torus(20.0, 4.0)
    points = [[24.0, 0, 0], [16.0, 0, 0], [20.0, 0, 4.0]]
    np.testing.assert_allclose(
        torus.principal_curvatures(points), [[0.25, 1 / 24], [0.25, -1 / 16], [0.25, 0.0]], atol=1e-16
    )
    np.testing.assert_allclose(torus.normals(points), [[1, 0, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-15)


# ---------------------------------------------------------------------------- meshes and integrals


@each_surface
def test_gauss_bonnet_areas_and_volumes_by_quadrature_over_meshes(surface):
    """Errors of ∫G dA − 2πχ, of the area and of a layer's integral fall as the number of nodes."""
    layer = Layer.between_plates(0.3 * scale_of(surface))
    c0, c1, c2 = layer.steiner
    errors = []
    for n_nodes in (1000, 4000, 16000):
        mesh = surface.triangulate(n_nodes)
        k1, k2 = surface.principal_curvatures(mesh.nodes).T
        gauss_bonnet = mesh.node_areas @ surface.gaussian_curvature(mesh.nodes)
        volume = mesh.node_areas @ (c0 + c1 * 0.5 * (k1 + k2) + c2 * k1 * k2)
        errors.append(
            [
                abs(gauss_bonnet - 2 * np.pi * surface.euler_characteristic) / (2 * np.pi),
                abs(mesh.area / surface.area - 1),
                abs(volume / surface.integral(layer) - 1),
            ]
        )
    first, second, third = np.array(errors)
    assert (third < 0.01).all()
    assert (second < first / 2.8 + 1e-6).all()
    assert (third < second / 2.8 + 1e-6).all()
    assert surface.integral(Layer.surface()) == pytest.approx(surface.area, rel=1e-14)
    total = surface.integral(Layer.curvature())
    assert total == pytest.approx(2 * np.pi * surface.euler_characteristic, abs=1e-12)


def test_closed_forms():
    assert Sphere(3.0).area == pytest.approx(36 * np.pi, rel=1e-15)
    assert Torus(20.0, 4.0).area == pytest.approx(4 * np.pi**2 * 80, rel=1e-15)
    assert (Sphere(3.0).euler_characteristic, Torus(20.0, 4.0).euler_characteristic) == (2, 0)
    # between plates: the difference of two balls, of two solid tori (Pappus)
    assert HeleShawCell(Sphere(3.0), 0.5).volume == pytest.approx(4 / 3 * np.pi * (3.5**3 - 27), rel=1e-14)
    solid = 2 * np.pi**2 * 20 * (4.5**2 - 16)
    assert HeleShawCell(Torus(20.0, 4.0), 0.5).volume == pytest.approx(solid, rel=1e-14)


def outer_half(torus):
    """∫ G dA over |φ| ≤ π/2."""
    mesh = torus.triangulate(40_000)
    curvature = torus.gaussian_curvature(mesh.nodes)
    return float(mesh.node_areas @ np.maximum(curvature, 0.0))


def test_outer_half_of_any_torus_holds_4_pi():
    for torus in (Torus(20.0, 4.0), Torus(1.3, 1.0)):
        assert outer_half(torus) == pytest.approx(4 * np.pi, rel=2e-3)


def corner_angles(mesh):
    corners = mesh.nodes[mesh.triangles]
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cosine = np.einsum("tki,tki->tk", a, b) / np.linalg.norm(a, axis=2) / np.linalg.norm(b, axis=2)
    return np.degrees(np.arccos(cosine))


@pytest.mark.parametrize("surface", [*SURFACES, Torus(1.05, 1.0), Torus(100.0, 1.0)], ids=repr)
@pytest.mark.parametrize("n_nodes", [150, 1000, 5000, 20_000])
def test_triangulations(surface, n_nodes):
    mesh = surface.triangulate(n_nodes)
    mesh.require_closed_surface()
    assert mesh.euler_characteristic == surface.euler_characteristic
    np.testing.assert_allclose(surface.project(mesh.nodes), mesh.nodes, atol=1e-13 * surface.size)
    corners = mesh.nodes[mesh.triangles]
    direction = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    assert (np.einsum("ti,ti->t", direction, surface.normals(corners.mean(axis=1))) > 0.85).all()
    # where the nodes resolve the surface they are as many as asked for, and triangles are even
    if surface.area / n_nodes < (0.7 * scale_of(surface)) ** 2 and n_nodes >= 1000:
        assert abs(mesh.n_nodes / n_nodes - 1) < 0.1
        assert corner_angles(mesh).min() > 35.0
        assert mesh.edge_lengths.max() < 1.8 * mesh.edge_lengths.min()
    assert surface.triangulate(n_nodes) is mesh  # kept


@pytest.mark.parametrize("n_nodes", [42, 400, 5000])
def test_spheres_are_triangulated_evenly(n_nodes):
    """The icosahedron's faces divided evenly in angle: edges within 1.2 of each other."""
    mesh = Sphere(1.0).triangulate(n_nodes)
    assert mesh.edge_lengths.max() < 1.2 * mesh.edge_lengths.min()
    assert corner_angles(mesh).min() > 53.5
    assert mesh.node_areas.max() < 1.5 * mesh.node_areas.min()  # five triangles at twelve nodes


@each_surface
def test_default_mesh_has_about_ten_thousand_nodes(surface):
    assert abs(surface.mesh.n_nodes / 10_000 - 1) < 0.05


@each_surface
def test_random_points_are_uniform_by_area(surface):
    """Means of a few functions over 20 000 points are their integrals over the mesh, to 4 σ."""
    n = 20_000
    points = surface.random_points(n, 7)
    assert points.shape == (n, 3)
    np.testing.assert_allclose(surface.project(points[:100]), points[:100], atol=1e-13 * surface.size)
    mesh = surface.triangulate(40_000)

    def values(x):
        x = x / surface.size
        rho = np.hypot(x[:, 0], x[:, 1])
        return np.stack([*x.T, *(x**2).T, x[:, 0] * x[:, 1], rho, np.sign(x[:, 2]) * rho, np.abs(x[:, 0])])

    drawn, there = values(points), values(mesh.nodes)
    exact = there @ mesh.node_areas / mesh.area
    sigma = np.sqrt(((there - exact[:, None]) ** 2) @ mesh.node_areas / mesh.area / n)
    assert (np.abs(drawn.mean(axis=1) - exact) < 4 * sigma + 1e-3).all()
    np.testing.assert_array_equal(points, surface.random_points(n, np.random.default_rng(7)))


@pytest.mark.parametrize("torus", EXAMPLES[Torus], ids=repr)
def test_tube_angles_of_random_points_pass_chi_square(torus):
    k = torus.minor_radius / torus.major_radius
    phi, theta = torus.angles(torus.random_points(20_000, 11))
    for share in ((phi + k * np.sin(phi)) / (2 * np.pi) + 0.5, theta / (2 * np.pi) + 0.5):
        counts = np.histogram(share, bins=40, range=(0.0, 1.0))[0]
        assert counts.sum() == 20_000
        assert ((counts - 500.0) ** 2 / 500.0).sum() < chi2.ppf(0.9999, 39)


@each_surface
@pytest.mark.parametrize("n", [1, 2, 13, 400])
def test_lattice_points_are_even(surface, n):
    points = surface.lattice_points(n)
    assert points.shape == (n, 3)
    np.testing.assert_allclose(surface.project(points), points, atol=1e-13 * surface.size)
    if n == 400:
        apart = np.linalg.norm(points[:, None] - points[None], axis=2) + surface.size * np.eye(n)
        assert apart.min() > 0.35 * np.sqrt(surface.area / n)
        mesh = surface.triangulate(20_000)
        exact = (mesh.node_areas @ mesh.nodes**2) / mesh.area
        np.testing.assert_allclose((points**2).mean(axis=0), exact, atol=0.01 * surface.size**2)
        np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=0.01 * surface.size)


@pytest.mark.parametrize(("n", "message"), [(0, "at least 1"), (2.0, "integer"), (True, "integer")])
@each_surface
def test_bad_counts(surface, n, message):
    with pytest.raises((ValueError, TypeError), match=message):
        surface.lattice_points(n)
    with pytest.raises((ValueError, TypeError), match="n_nodes must be"):
        surface.triangulate(n)


# ---------------------------------------------------------------------------- frames and moves


@each_surface
def test_frames_are_orthonormal_tangent_and_turn_with_the_normal(surface):
    x = samples(surface, 300)
    frames, n = surface.vertex_frames(x), surface.normals(x)
    gram = np.einsum("nia,nja->nij", frames, frames)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(2), gram.shape), atol=1e-14)
    np.testing.assert_allclose(np.cross(frames[:, 0], frames[:, 1]), n, atol=1e-13)


@each_surface
def test_retraction_starts_where_it_should_and_stays_on_the_surface(surface):
    x = samples(surface)
    np.testing.assert_allclose(surface.retract(x, np.zeros((60, 2))), x, atol=1e-14 * surface.size)
    rng = np.random.default_rng(1)
    step = rng.standard_normal((60, 2)) * scale_of(surface)
    far = surface.retract(x, 0.5 * step)
    np.testing.assert_allclose(surface.project(far), far, atol=1e-13 * surface.size)
    h = 1e-4
    ahead, behind = surface.retract(x, h * step), surface.retract(x, -h * step)
    velocity = (ahead - behind) / (2 * h)
    tangent = np.einsum("ni,nia->na", step, surface.vertex_frames(x))
    np.testing.assert_allclose(velocity, tangent, atol=1e-6 * scale_of(surface))
    # its acceleration along the normal is the surface's: −W(step, step)
    bend = np.einsum("na,na->n", (ahead - 2 * x + behind) / h**2, surface.normals(x))
    low, high = surface.curvature_range()
    square = (step**2).sum(axis=1)
    slack = 1e-6 * scale_of(surface)
    assert (bend <= -low * square + slack).all()
    assert (bend >= -high * square - slack).all()


def test_retraction_on_the_sphere_is_geodesic_to_second_order():
    sphere = Sphere(2.0)
    x = samples(sphere)
    step = np.random.default_rng(1).standard_normal((60, 2))
    h = 1e-3
    bend = (sphere.retract(x, h * step) - 2 * x + sphere.retract(x, -h * step)) / h**2
    np.testing.assert_allclose(np.einsum("na,nia->ni", bend, sphere.vertex_frames(x)), 0.0, atol=1e-8)


@each_surface
def test_rigid_motions_are_tangent_and_change_no_film_and_no_volume(surface):
    foam = foam_on(surface)
    x = foam.vertex_points
    for field in surface.rigid_motions(x):
        # a rigid motion is v = shift + ω × x: fit both
        cross = np.stack([np.cross(axis, x) for axis in np.eye(3)], axis=-1)
        design = np.concatenate([cross, np.broadcast_to(np.eye(3), (len(x), 3, 3))], axis=2).reshape(-1, 6)
        fit, *_ = np.linalg.lstsq(design, field.ravel(), rcond=None)
        np.testing.assert_allclose(design @ fit, field.ravel(), atol=1e-12 * surface.size)
        np.testing.assert_allclose(fit[3:], 0.0, atol=1e-12 * surface.size)
        assert np.linalg.norm(fit[:3]) > 0.1
        assert np.abs(np.einsum("na,na->n", field, surface.normals(x))).max() < 1e-13 * surface.size
        turned = Rotation.from_rotvec(0.7 * fit[:3]).apply(x.copy())
        moved = Foam(foam.cell, foam.network, surface.project(turned), foam.film_offsets)
        film = 1e-13 * surface.size * foam.cell.gap
        np.testing.assert_allclose(moved.film_areas, foam.film_areas, atol=film)
        volume = 1e-13 * surface.size**2 * foam.cell.gap
        np.testing.assert_allclose(moved.bubble_volumes, foam.bubble_volumes, atol=volume)


def test_number_of_rigid_motions():
    assert len(Sphere(1.0).rigid_motions(np.eye(3))) == 3
    assert len(Torus(3.0, 1.0).rigid_motions(np.array([[4.0, 0.0, 0.0]]))) == 1


# ---------------------------------------------------------------------------- arcs


@each_surface
def test_arcs_run_on_the_surface_from_tail_to_head(surface):
    foam = foam_on(surface)
    curves = foam.film_curves(9)
    tail, head = foam.film_ends
    np.testing.assert_allclose(curves[:, 0], tail, atol=1e-13 * surface.size)
    np.testing.assert_allclose(curves[:, -1], head, atol=1e-13 * surface.size)
    flat = curves.reshape(-1, 3)
    np.testing.assert_allclose(surface.project(flat), flat, atol=1e-13 * surface.size)


@each_surface
def test_arc_lengths_are_those_of_their_points(surface):
    """Chord sums at 200 and 400 pieces, extrapolated, of films of order 16."""
    foam = foam_on(surface).with_order(16)
    sums = []
    for pieces in (200, 400):
        steps = np.diff(foam.film_curves(pieces + 1), axis=1)
        sums.append(np.linalg.norm(steps, axis=2).sum(axis=1))
    exact = (4 * sums[1] - sums[0]) / 3
    np.testing.assert_allclose(foam.film_lengths, exact, rtol=2e-6)


@each_surface
def test_film_areas_are_those_of_strips_ruled_by_normals(surface):
    """Each film triangulated between the plates in space, twice, extrapolated."""
    foam = foam_on(surface, n_heights=4).with_order(12)
    some = np.arange(0, foam.network.n_films, 20)

    def brute(m):
        foot = foam.film_curves(8 * m + 1)[some]
        normal = surface.normals(foot.reshape(-1, 3)).reshape(foot.shape)
        rise = np.linspace(0.0, foam.cell.gap, m + 1)[:, None, None, None]
        grid = foot + rise * normal
        a, b, c, d = grid[:-1, :, :-1], grid[:-1, :, 1:], grid[1:, :, 1:], grid[1:, :, :-1]
        total = np.linalg.norm(np.cross(b - a, c - a), axis=-1) + np.linalg.norm(
            np.cross(c - a, d - a), axis=-1
        )
        return 0.5 * total.sum(axis=(0, 2))

    coarse, fine = brute(8), brute(16)
    np.testing.assert_allclose(foam.film_areas[some], (4 * fine - coarse) / 3, rtol=1e-5)


@each_surface
def test_two_heights_are_enough_for_thin_gaps(surface):
    """The error of two Gauss points through the gap is of order (d k)⁴/4000."""
    coarse, fine = foam_on(surface), foam_on(surface, n_heights=6)
    np.testing.assert_allclose(coarse.film_areas, fine.film_areas, rtol=0.3**4 / 1000)


@each_surface
def test_volumes_are_those_of_closed_bodies_in_space(surface):
    """Bubbles as polyhedra (fans on both plates, ruled walls) at two refinements, extrapolated."""
    foam = foam_on(surface).with_order(12)
    gap = foam.cell.gap

    def body(bubble, m):
        loops = foam.network.loops
        ring = loops.halves[loops.starts[bubble] : loops.starts[bubble] + loops.sizes[bubble]]
        curves = foam.film_curves(m + 1)[ring >> 1]
        curves[ring % 2 == 1] = curves[ring % 2 == 1][:, ::-1]
        rim = curves[:, :-1].reshape(-1, 3)
        share = np.linspace(0.0, 1.0, m + 1)[:, None, None]
        centre = foam.bubble_centres[bubble]
        plate = surface.project((centre + share * (rim - centre)).reshape(-1, 3)).reshape(m + 1, -1, 3)
        plate[-1] = rim
        top = plate + gap * surface.normals(plate.reshape(-1, 3)).reshape(plate.shape)

        def cone(rows):  # six times the volume under a sheet whose columns run counter-clockwise
            a, d = rows[:-1], rows[1:]
            b, c = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
            one = (a * (np.cross(d, c) + np.cross(c, b))).sum()  # cut along a, c
            other = (b * (np.cross(a, d) + np.cross(d, c))).sum()  # cut along b, d
            return 0.5 * (one + other)

        return (cone(top) - cone(plate) + cone(np.stack([top[-1], plate[-1]]))) / 6.0

    for bubble in range(0, foam.n_bubbles, 15):
        coarse, fine = body(bubble, 8), body(bubble, 16)
        volume = foam.bubble_volumes[bubble]
        assert (4 * fine - coarse) / 3 == pytest.approx(volume, rel=2e-5)
        assert abs(fine / volume - 1) < 0.02


@each_surface
@each_layer
def test_arc_gradients_are_derivatives(surface, layer):
    foam = foam_on(surface)
    some = slice(0, 40)
    tail, head = (ends[some] for ends in foam.film_ends)
    u = foam.film_offsets[some]
    if layer is not LAYERS["surface"]:
        layer = Layer(scale_of(surface) * layer.heights, layer.shares, layer.steiner)
    terms = surface.arc_terms(tail, head, u, layer, tension=1.0, jump=None)
    np.testing.assert_allclose(
        terms.measure, surface.arc_measure(tail, head, u, layer), rtol=1e-13, atol=1e-300
    )
    assert terms.hessian is None
    n, size = 4 + u.shape[1], foam.bubble_size

    def measure(k, s):
        step = np.zeros((len(u), n))
        step[:, k] = s
        a, b = surface.retract(tail, size * step[:, :2]), surface.retract(head, size * step[:, 2:4])
        return surface.arc_measure(a, b, u + step[:, 4:], layer)

    h = 1e-3
    for k in range(n):
        slope = (8 * (measure(k, h) - measure(k, -h)) - (measure(k, 2 * h) - measure(k, -2 * h))) / (12 * h)
        expected = terms.gradient[k] * (size if k < 4 else 1.0)
        np.testing.assert_allclose(expected, slope, atol=1e-7 * terms.measure.max())


@each_surface
def test_derivatives_of_energy_and_volumes_round_closed_foams(surface):
    """Σ γ A − Σ p V along retraction curves: first and second derivatives at random pressures."""
    foam = foam_on(surface)
    network, cell, size = foam.network, foam.cell, foam.bubble_size
    rng = np.random.default_rng(5)
    pressures = rng.standard_normal(foam.n_bubbles) / size
    gamma = 0.7
    terms = film_terms(
        cell, network, foam.vertex_points, foam.film_offsets, tension=gamma, pressures=pressures
    )
    jump = pressures[network.left] - pressures[network.right]

    def lagrangian(vertices, offsets, s):
        points = surface.retract(foam.vertex_points, s * vertices)
        u = foam.film_offsets + s * offsets
        tail, head = points[network.tails], points[network.heads]
        area = surface.arc_measure(tail, head, u, cell.layer).sum()
        volumes = bubble_volumes(cell, network, points, u)
        return gamma * area - pressures @ (volumes - foam.bubble_volumes)

    n_v = network.n_vertices
    some = foam.network.tails[3]
    chords = np.repeat(np.linalg.norm(np.diff(foam.film_ends, axis=0)[0], axis=1), 2)
    room = np.full(n_v, np.inf)
    np.minimum.at(room, network.origin, chords)
    for trial in range(8):
        vertices = 0.3 * room[:, None] * rng.standard_normal((n_v, 2))
        offsets = 0.2 * rng.standard_normal(foam.film_offsets.shape)
        if trial == 1:
            offsets[:] = 0.0
        elif trial == 2:
            vertices[:] = 0.0
        elif trial > 2:  # one vertex alone, with and without its films
            vertices[np.arange(n_v) != some] = 0.0
            offsets[:] = 0.0 if trial > 4 else offsets
        step = np.concatenate([vertices[network.tails].T, vertices[network.heads].T, offsets.T])
        first = (step * (gamma * terms.gradient - jump * terms.volume)).sum()
        second = np.einsum("if,ijf,jf->", step, terms.hessian, step)
        h = 5e-3
        f = [lagrangian(vertices, offsets, k * h) for k in range(-3, 4)]
        slope = np.dot(f, [-1, 9, -45, 0, 45, -9, 1]) / (60 * h)
        bend = np.dot(f, [2, -27, 270, -490, 270, -27, 2]) / (180 * h**2)
        weight = np.abs(np.einsum("if,ijf,jf->f", step, terms.hessian, step)).sum()
        assert first == pytest.approx(slope, abs=1e-6 * weight)
        assert second == pytest.approx(bend, abs=3e-6 * weight)


@each_surface
def test_film_hessians_are_symmetric(surface):
    foam = foam_on(surface)
    pressures = np.random.default_rng(0).standard_normal(foam.n_bubbles)
    terms = film_terms(
        foam.cell, foam.network, foam.vertex_points, foam.film_offsets, tension=1.0, pressures=pressures
    )
    flipped = terms.hessian.transpose(1, 0, 2)
    np.testing.assert_allclose(terms.hessian, flipped, atol=1e-12 * np.abs(terms.hessian).max())


@pytest.mark.parametrize("chunk", [1, 7, 90, 10_000])
@pytest.mark.parametrize("pressed", [False, True])
def test_films_taken_in_parts_are_the_same_films(chunk, pressed, monkeypatch):
    foam = foam_on(Torus(3.0, 1.2))
    pressures = np.arange(foam.n_bubbles) / 7.0 if pressed else None
    args = (foam.cell, foam.network, foam.vertex_points, foam.film_offsets)
    whole = film_terms(*args, tension=0.7, pressures=pressures)
    monkeypatch.setattr("warpedfoam.energy.film_area.CHUNK", chunk)
    parts = film_terms(*args, tension=0.7, pressures=pressures)
    for name in ("measure", "gradient", "volume", "hessian"):
        one, other = getattr(whole, name), getattr(parts, name)
        assert (one is None) == (other is None) == (name == "hessian" and not pressed)
        if one is not None:
            np.testing.assert_allclose(other, one, rtol=1e-12, atol=1e-13 * np.abs(one).max())


@each_surface
def test_volume_derivatives_cancel_round_the_surface(surface):
    """Every bubble's volume may change, their sum not: Σ over the two sides of each film is nothing."""
    foam = foam_on(surface)
    network = foam.network
    terms = film_terms(foam.cell, network, foam.vertex_points, foam.film_offsets, tension=1.0, pressures=None)
    change = np.zeros((foam.n_bubbles, network.n_vertices, 2))
    for end, rows in ((network.tails, terms.volume[:2]), (network.heads, terms.volume[2:4])):
        for bubble, sign in ((network.left, 1.0), (network.right, -1.0)):
            np.add.at(change, (bubble, end), sign * rows.T)
    # only the three bubbles at a vertex feel it
    beside = np.zeros((foam.n_bubbles, network.n_vertices), dtype=bool)
    beside[network.bubble, network.origin] = True
    assert np.abs(change[~beside]).max() < 1e-12 * np.abs(change).max()
    np.testing.assert_allclose(change.sum(axis=0), 0.0, atol=1e-12 * np.abs(change).max())


@each_surface
def test_arc_fit_finds_the_bump_that_points_lie_on(surface):
    foam = foam_on(surface)
    tail, head = foam.film_ends
    nodes = lobatto(6).nodes[1:-1]
    heights = np.linspace(-0.2, 0.2, len(tail))
    bump = heights[:, None] * (4 * nodes * (1 - nodes))
    xi = np.linspace(0.0, 1.0, 400)
    points = surface.arc_points(tail, head, bump, xi)
    arc = np.repeat(np.arange(len(tail)), len(xi))
    fitted = surface.arc_fit(tail, head, arc, points.reshape(-1, 3), 6)
    np.testing.assert_allclose(fitted, bump, atol=2e-3)


# ---------------------------------------------------------------------------- loops


def integrals(foam, layer, loops=None):
    tail, head = foam.film_ends
    chosen = foam.network.loops if loops is None else loops
    return foam.cell.surface.loop_integrals(tail, head, foam.film_offsets, chosen, layer)


@each_surface
@each_layer
def test_bubbles_fill_the_surface_exactly(surface, layer):
    foam = foam_on(surface)
    parts = integrals(foam, layer)
    whole = surface.integral(layer)
    assert parts.sum() == pytest.approx(whole, rel=1e-13, abs=1e-13 * np.abs(parts).sum())
    assert foam.bubble_volumes.sum() == pytest.approx(foam.cell.volume, rel=1e-13)
    assert (foam.bubble_areas > 0).all()


@each_surface
@each_layer
def test_a_union_has_the_sum_of_its_parts(surface, layer):
    """Remove the film between two bubbles: the loop round both holds what both held."""
    foam = foam_on(surface)
    net = foam.network
    parts = integrals(foam, layer)
    before = np.empty_like(net.next)
    before[net.next] = np.arange(len(net.next))
    pairs = np.sort(np.stack([net.left, net.right], axis=1), axis=1)
    _, first, tally = np.unique(pairs, axis=0, return_index=True, return_counts=True)
    for film in first[tally == 1][::9]:
        a, c = 2 * film, 2 * film + 1
        following, owner = net.next.copy(), net.bubble.copy()
        following[before[a]], following[before[c]] = net.next[c], net.next[a]
        following[a], following[c] = a, c
        i, j = int(net.bubble[a]), int(net.bubble[c])
        owner[owner == j] = i
        owner[[a, c]] = foam.n_bubbles
        loops = loops_of(following, owner)
        names = owner[loops.halves[loops.starts]]
        union = integrals(foam, layer, loops)[names == i]
        assert union.shape == (1,)
        assert union[0] == pytest.approx(parts[i] + parts[j], abs=1e-12 * np.abs(parts).sum())


@each_surface
@each_layer
def test_names_and_directions_do_not_matter(surface, layer):
    """Films renumbered, half of them turned round (offsets mirrored), bubbles and vertices renamed."""
    foam = foam_on(surface)
    net, rng = foam.network, np.random.default_rng(8)
    film, turn = rng.permutation(net.n_films), rng.random(net.n_films) < 0.5
    vertex, bubble = rng.permutation(net.n_vertices), rng.permutation(net.n_bubbles)
    half = np.arange(2 * net.n_films)
    new = 2 * film[half >> 1] + ((half & 1) ^ turn[half >> 1])
    following, origin, owner = np.empty((3, len(half)), dtype=int)
    following[new], origin[new], owner[new] = new[net.next], vertex[net.origin], bubble[net.bubble]
    points = np.empty_like(foam.vertex_points)
    points[vertex] = foam.vertex_points
    offsets = np.empty_like(foam.film_offsets)
    offsets[film] = np.where(turn[:, None], -foam.film_offsets[:, ::-1], foam.film_offsets)
    other = Foam(foam.cell, CellNetwork(following, origin, owner), points, offsets)
    mine, its = integrals(foam, layer), integrals(other, layer)
    np.testing.assert_allclose(its[bubble], mine, atol=1e-13 * np.abs(mine).sum())
    np.testing.assert_allclose(other.film_areas[film], foam.film_areas, rtol=1e-11)


@pytest.mark.parametrize("height", [-0.9, -0.2, 0.0, 0.5, 0.99])
def test_caps(height):
    """A disk of three arcs round the pole and the rest of the sphere, at order 24."""
    foam = lone_bubble(height).with_order(24)
    z = foam.vertex_points[0, 2]
    if height == 0.0:
        np.testing.assert_allclose(foam.bubble_areas, 2 * np.pi, rtol=1e-14)
        return
    # straight arcs: a spherical triangle, by l'Huilier's theorem
    a, b, c = foam.vertex_points
    half = np.arctan2(a @ np.cross(b, c), 1 + a @ b + b @ c + c @ a)
    solid = 2 * half if height > 0 else 4 * np.pi + 2 * half
    assert foam.bubble_areas[0] == pytest.approx(solid, rel=1e-13)
    assert foam.bubble_areas.sum() == pytest.approx(4 * np.pi, rel=1e-14)
    assert np.sign(z) == np.sign(height)


@pytest.mark.parametrize("radius", [1.0, 7.5])
@pytest.mark.parametrize("gap", [1e-6, 0.1, 0.5, 3.0])
def test_films_and_volumes_between_spheres_are_closed_forms(radius, gap):
    """Film area L (d + d²/2r) and volume Ω ((r + d)³ − r³)/3, to 1e-12."""
    base = foam_on(Sphere(radius))
    foam = Foam(HeleShawCell(Sphere(radius), gap), base.network, base.vertex_points, base.film_offsets)
    lift = gap + gap**2 / (2 * radius)
    np.testing.assert_allclose(foam.film_areas, foam.film_lengths * lift, rtol=1e-12)
    shell = ((radius + gap) ** 3 - radius**3) / 3 if gap > 1e-3 else gap * radius**2 + gap**2 * radius
    np.testing.assert_allclose(foam.bubble_volumes, foam.bubble_areas / radius**2 * shell, rtol=1e-12)


@each_surface
def test_units_scale(surface):
    """Twice the size: lengths double, areas quadruple, ∫G stays."""
    kind = type(surface)
    fields = {name: 2.0 * getattr(surface, name) for name in surface.__dataclass_fields__}
    foam = foam_on(surface)
    big = Foam(
        HeleShawCell(kind(**fields), 2.0 * foam.cell.gap),
        foam.network,
        2.0 * foam.vertex_points,
        foam.film_offsets,
    )
    np.testing.assert_allclose(big.film_lengths, 2.0 * foam.film_lengths, rtol=1e-12)
    np.testing.assert_allclose(big.film_areas, 4.0 * foam.film_areas, rtol=1e-12)
    np.testing.assert_allclose(big.bubble_areas, 4.0 * foam.bubble_areas, rtol=1e-11)
    np.testing.assert_allclose(big.bubble_volumes, 8.0 * foam.bubble_volumes, rtol=1e-11)
    np.testing.assert_allclose(big.bubble_curvatures, foam.bubble_curvatures, atol=1e-12)


# ---------------------------------------------------------------------------- cells


@pytest.mark.parametrize(("ring", "tube"), [(20.0, 4.0), (3.0, 1.2), (1.3, 1.0), (100.0, 1.0)])
def test_plates_fold_at_the_hole(ring, tube):
    limit = ring - tube
    assert HeleShawCell(Torus(ring, tube), limit * (1 - 1e-9)).gap == limit * (1 - 1e-9)
    for gap in (limit * (1 + 1e-9), 2 * limit, 1e9):
        with pytest.raises(ValueError, match=rf"gap .* folds the outer plate.*less than {limit:g}"):
            HeleShawCell(Torus(ring, tube), gap)


def test_plates_that_just_touch_are_refused():
    for limit in range(1, 200):
        with pytest.raises(ValueError, match="folds"):
            HeleShawCell(Torus(limit + 1.0, 1.0), float(limit))


def test_plates_about_a_sphere_never_fold():
    assert HeleShawCell(Sphere(1.0), 1e6).volume == pytest.approx(4 / 3 * np.pi * 1e18, rel=1e-5)


# ---------------------------------------------------------------------------- points without a nearest


@pytest.mark.parametrize(
    ("surface", "point", "message"),
    [
        (Sphere(2.0), [0.0, 0.0, 0.0], "centre"),
        (Torus(3.0, 1.0), [0.0, 0.0, 0.5], "axis"),
        (Torus(3.0, 1.0), [0.0, 3.0, 0.0], "centre circle"),
    ],
)
@pytest.mark.parametrize("method", ["project", "normals"])
def test_points_without_a_nearest_are_refused(surface, point, message, method):
    with pytest.raises(ValueError, match=message):
        getattr(surface, method)([point])


@each_surface
@pytest.mark.parametrize("method", ["project", "normals", "principal_curvatures", "gaussian_curvature"])
@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[np.nan, 1.0, 1.0]], "points must be finite"),
        ([[np.inf, 1.0, 1.0]], "points must be finite"),
        ([1.0, 1.0, 1.0], "points must have shape"),
        ([[1.0, 1.0]], "points must have shape"),
        ([["a", "b", "c"]], "points must hold real numbers"),
        ([[1j, 1.0, 1.0]], "points must hold real numbers"),
        (None, "points must hold real numbers"),
    ],
)
def test_points_that_are_none_are_refused(surface, method, points, message):
    with pytest.raises((ValueError, TypeError), match=message):
        getattr(surface, method)(points)
