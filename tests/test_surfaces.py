"""Every surface: points, curvatures, meshes, frames and gaps against differences and quadrature."""

from __future__ import annotations

import importlib
import inspect
import pkgutil

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import warpedfoam.surfaces
from warpedfoam import Foam, HeleShawCell, MeshError, Sphere, Surface, Torus, TriangleMesh
from warpedfoam.surfaces import Layer, LevelSurface
from warpedfoam.surfaces.level_twins import LevelTwin
from warpedfoam.surfaces.netted import NettedSurface

from .level_samples import FAMILY
from .surface_samples import EXAMPLES, SURFACES, each_surface, foam_on, samples, scale_of


def surface_classes():
    found = set()
    for module in pkgutil.walk_packages(warpedfoam.surfaces.__path__, "warpedfoam.surfaces."):
        for _, kind in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            if kind.__module__.startswith("warpedfoam.surfaces") and hasattr(kind, "arc_terms"):
                found.add(kind)
    public = {kind for kind in found if not kind.__name__.startswith("_")}
    return public - {Surface, LevelSurface, NettedSurface}


def test_every_surface_class_is_tested_and_is_a_surface():
    # twins, which cells make for gaps that vary, are held to their originals in test_gaps
    seen = {kind for kind in surface_classes() if not issubclass(kind, LevelTwin)}
    assert seen == set(EXAMPLES) | {type(member.surface) for member in FAMILY.values()}
    for surface in [*SURFACES, *(member.surface for member in FAMILY.values())]:
        assert isinstance(surface, Surface)


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
    mesh.require_surface(closed=True)
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


# ---------------------------------------------------------------------------- cells


@pytest.mark.parametrize(("ring", "tube"), [(20.0, 4.0), (3.0, 1.2), (1.3, 1.0), (100.0, 1.0)])
def test_plates_fold_at_the_hole(ring, tube):
    limit = ring - tube
    assert HeleShawCell(Torus(ring, tube), limit * (1 - 1e-9)).gap == limit * (1 - 1e-9)
    for gap in (limit * (1 + 1e-9), 2 * limit, 1e9):
        with pytest.raises(ValueError, match=rf"gap .* folds the outer plate.*less than {limit:g}"):
            HeleShawCell(Torus(ring, tube), gap)


def test_rims_that_touch_at_a_node_cannot_be_followed():
    nodes = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0.0]])
    with pytest.raises(MeshError, match="touch each other"):
        _ = TriangleMesh(nodes, [[0, 1, 2], [0, 3, 4]]).rim_loops


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
