"""Surfaces given by level sets, their own formulas and meshes: geometry, arcs, loops, whole foams."""

from __future__ import annotations

import numpy as np
import pytest

from warpedfoam import (
    Ellipsoid,
    Foam,
    HeleShawCell,
    Implicit,
    Revolution,
    Sphere,
    equilibrium_report,
    relax,
)
from warpedfoam.energy import film_terms
from warpedfoam.foam import bubble_integrals
from warpedfoam.kernels.nets import surface_net
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.relax.held import held_vertices, hold, moved_points
from warpedfoam.surfaces import Layer, TriangleMesh
from warpedfoam.surfaces.patches import RULES, triangle_rule

from .level_samples import (
    FAMILY,
    RING_BOX,
    each_member,
    formulas,
    relaxed_on,
    ring_gradient,
    ring_level,
    twins,
    vase_slope,
    vase_square,
)


def along_rims(foam, steps):
    """Vertex steps without what leads rim vertices off the rim."""
    held = held_vertices(foam.cell.surface, foam.network, foam.vertex_points, foam.film_offsets)
    if held is not None:
        across = np.einsum("mi,mi->m", steps[held.vertices], held.directions)
        steps[held.vertices] -= across[:, None] * held.directions
    return steps


# ---------------------------------------------------------------------------- points and curvatures


@each_member
def test_levels_are_differentiated_right(member):
    surface = member.surface
    rng = np.random.default_rng(0)
    x = surface.random_points(80, 1)
    x = x + 2e-3 * surface.size * rng.standard_normal(x.shape)
    _, gradient, second = surface.level(x, second=True)
    h = 1e-5 * surface.size
    axes = np.eye(3)
    slope = [
        (surface.level(x + h * e, second=False)[0] - surface.level(x - h * e, second=False)[0]) for e in axes
    ]
    bend = [
        (surface.level(x + h * e, second=False)[1] - surface.level(x - h * e, second=False)[1]) for e in axes
    ]
    np.testing.assert_allclose(
        np.stack(slope, axis=1) / (2 * h), gradient, atol=1e-7 * np.abs(gradient).max()
    )
    atol = 1e-5 * np.abs(second).max() + 1e-12
    np.testing.assert_allclose(np.stack(bend, axis=1) / (2 * h), second, atol=atol)


@each_member
def test_projection_is_idempotent_and_along_the_normal(member):
    surface = member.surface
    x = surface.random_points(200, 3)
    tiny = 1e-12 * surface.size
    np.testing.assert_allclose(surface.project(x), x, atol=tiny)
    low, high = surface.curvature_range()
    rise = 0.2 / max(-low, high, 1.0)
    for t in (-rise, rise):
        if member.error < 1e-6 or abs(t) < 0.1:
            back = surface.project(x + t * surface.normals(x))
            np.testing.assert_allclose(back, x, atol=1e-8 * surface.size)


def test_points_far_from_a_surface_are_refused():
    with pytest.raises(ValueError, match="no clear nearest point"):
        FAMILY["egg"].surface.project([[0.0, 0.0, 0.0]])


@twins
def test_curvatures_normals_and_places_are_the_formulas(member):
    surface, twin = member.surface, member.twin
    x = twin.random_points(500, 4)
    loose = member.error
    np.testing.assert_allclose(surface.project(x), x, atol=10 * loose * 0.1 + 1e-12)
    np.testing.assert_allclose(surface.normals(x), twin.normals(x), atol=5 * loose + 1e-12)
    mine = np.sort(surface.principal_curvatures(x), axis=1)
    np.testing.assert_allclose(mine, np.sort(twin.principal_curvatures(x), axis=1), atol=30 * loose + 1e-12)
    np.testing.assert_allclose(
        surface.gaussian_curvature(x), twin.gaussian_curvature(x), atol=30 * loose + 1e-12
    )
    assert surface.area == pytest.approx(twin.area, rel=0.1 * loose + 1e-8)
    layer = Layer.between_plates(0.2)
    assert surface.integral(layer) == pytest.approx(twin.integral(layer), rel=0.1 * loose + 1e-8)


@each_member
def test_gauss_bonnet(member):
    total = member.surface.integral(Layer.curvature()) + member.rim_turning
    assert total == pytest.approx(2 * np.pi * member.euler, abs=2e-6 + member.error)
    assert member.surface.euler_characteristic == member.euler


def test_area_of_an_oblate_spheroid_is_a_closed_form():
    a, c = 3.0, 2.0
    e = np.sqrt(1 - (c / a) ** 2)
    exact = 2 * np.pi * a**2 * (1 + (1 - e**2) / e * np.arctanh(e))
    assert Ellipsoid(a, a, c).area == pytest.approx(exact, rel=1e-10)
    assert Ellipsoid(a, a, c).gaussian_curvature([[0.0, 0.0, c]])[0] == pytest.approx(c**2 / a**4, rel=1e-12)


def test_spheroids_are_surfaces_of_revolution():
    egg = Revolution(lambda z: 4.0 * (1.0 - z**2 / 9.0), lambda z: -8.0 * z / 9.0, -3.0, 3.0)
    same = Ellipsoid(2.0, 2.0, 3.0)
    assert egg.area == pytest.approx(same.area, rel=1e-9)
    x = same.random_points(100, 0)
    np.testing.assert_allclose(egg.project(x), x, atol=1e-12)
    np.testing.assert_allclose(egg.principal_curvatures(x), same.principal_curvatures(x), atol=1e-8)


@each_member
def test_symmetries_are_found_and_tangent(member):
    surface = member.surface
    x = surface.random_points(100, 5)
    motions = surface.rigid_motions(x)
    assert len(motions) == member.symmetries
    across = np.einsum("knx,nx->kn", motions, surface.normals(x))
    assert np.abs(across).max(initial=0.0) < max(1e-6, 5 * member.error) * np.abs(motions).max(initial=1.0)


@each_member
def test_frames_and_retraction(member):
    surface = member.surface
    x = surface.random_points(50, 6)
    frames = surface.vertex_frames(x)
    np.testing.assert_allclose(np.cross(frames[:, 0], frames[:, 1]), surface.normals(x), atol=1e-12)
    np.testing.assert_allclose(surface.retract(x, np.zeros((50, 2))), x, atol=1e-13 * surface.size)
    step = np.random.default_rng(1).standard_normal((50, 2))
    h = 1e-4
    ahead, behind = surface.retract(x, h * step), surface.retract(x, -h * step)
    np.testing.assert_allclose((ahead - behind) / (2 * h), np.einsum("ni,nix->nx", step, frames), atol=1e-5)
    bend = np.einsum("nx,nx->n", (ahead - 2 * x + behind) / h**2, surface.normals(x))
    low, high = surface.curvature_range()
    square = (step**2).sum(axis=1)
    assert (bend <= -low * square + 1e-4).all()
    assert (bend >= -high * square - 1e-4).all()


# ---------------------------------------------------------------------------- meshes and points


@each_member
@pytest.mark.parametrize("n_nodes", [1000, 6000])
def test_triangulations_end_on_the_rims_only_and_lie_on_the_surface(member, n_nodes):
    surface = member.surface
    mesh = surface.triangulate(n_nodes)
    mesh.require_surface(closed=surface.rim is None)
    assert len(mesh.rim_loops) == (0 if surface.rim is None else surface.rim.n_loops)
    at = mesh.nodes[np.unique(mesh.rim_edges)]
    if surface.rim is not None:
        np.testing.assert_allclose(surface.rim.nearest(at), at, atol=1e-9 * surface.size)
    assert mesh.euler_characteristic == member.euler
    np.testing.assert_allclose(surface.project(mesh.nodes), mesh.nodes, atol=1e-9 * surface.size)
    assert surface.area == pytest.approx(mesh.area, rel=0.03)
    corners = mesh.corners
    out = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("tx,tx->t", out, surface.normals(mesh.nodes[mesh.triangles[:, 0]])) > 0).all()


@each_member
def test_random_points_are_uniform_by_area(member):
    """Counts in Voronoi cells of a few points against quadrature, by χ² to 4.5 σ."""
    surface = member.surface
    points = surface.random_points(20_000, 7)
    again = surface.random_points(20_000, 7)
    np.testing.assert_array_equal(points, again)
    rule = surface._patches.quadrature()
    nodes, weights = rule.points, rule.weights
    centres = surface.random_points(25, 8)
    period = surface.period
    nearest = [
        np.linalg.norm(nearest_image(x[:, None] - centres, period), axis=2).argmin(axis=1)
        for x in (points, nodes)
    ]
    counts = np.bincount(nearest[0], minlength=25)
    share = np.bincount(nearest[1], weights, minlength=25) / weights.sum()
    expected = 20_000 * share
    statistic = ((counts - expected) ** 2 / expected).sum()
    assert abs(statistic - 24) < 4.5 * np.sqrt(48)


@each_member
def test_lattice_points_are_even(member):
    points = member.surface.lattice_points(150)
    gaps = np.linalg.norm(nearest_image(points[:, None] - points, member.surface.period), axis=2)
    np.fill_diagonal(gaps, np.inf)
    spacing = np.sqrt(member.surface.area / 150)
    assert gaps.min() > 0.5 * spacing
    assert gaps.min(axis=1).max() < 1.3 * spacing


@pytest.mark.parametrize("which", range(len(RULES)))
def test_triangle_rules_are_exact_to_their_degree(which):
    points, weights = triangle_rule(which)
    degree = (6, 4, 2)[which]
    from math import factorial

    for i in range(degree + 2):
        for j in range(degree + 2 - i):
            exact = 2.0 * factorial(i) * factorial(j) / factorial(i + j + 2)
            found = weights @ (points[:, 0] ** i * points[:, 1] ** j)
            if i + j <= degree:
                assert found == pytest.approx(exact, abs=1e-13)


def test_surface_nets_close_round_a_sphere():
    grid = np.stack(np.meshgrid(*[np.linspace(-1.3, 1.3, 40)] * 3, indexing="ij"), axis=-1)
    nodes, triangles = surface_net(np.linalg.norm(grid, axis=-1) - 1.0)
    mesh = TriangleMesh(nodes * 2.6 / 39 - 1.3, triangles)
    mesh.require_surface(closed=True)
    assert mesh.euler_characteristic == 2
    np.testing.assert_allclose(np.linalg.norm(mesh.nodes, axis=1), 1.0, atol=3e-3)
    a, b, c = (mesh.nodes[mesh.triangles[:, i]] for i in range(3))
    assert np.einsum("nx,nx->", a, np.cross(b, c)) / 6 == pytest.approx(4 * np.pi / 3, rel=0.01)


# ---------------------------------------------------------------------------- arcs and loops


@formulas
@pytest.mark.parametrize("gap", [1e-6, 0.2])
def test_film_gradients_are_derivatives(member, gap):
    surface = member.surface
    foam = relaxed_on(next(k for k, m in FAMILY.items() if m is member)).foam
    rng = np.random.default_rng(2)
    tail, head = (ends[:30] for ends in foam.film_ends)
    u = foam.film_offsets[:30] + 0.05 * rng.standard_normal((30, 3))
    layer = Layer.between_plates(gap)
    terms = surface.arc_terms(tail, head, u, layer, tension=1.0, jump=None)
    np.testing.assert_allclose(terms.measure, surface.arc_measure(tail, head, u, layer), rtol=1e-12)
    assert terms.hessian is None
    h = 1e-4
    for k in range(7):
        step = np.zeros((30, 7))
        step[:, k] = h

        def measure(share, step=step):
            s = share * step
            return surface.arc_measure(
                surface.retract(tail, s[:, :2]), surface.retract(head, s[:, 2:4]), u + s[:, 4:], layer
            )

        slope = (8 * (measure(1) - measure(-1)) - (measure(2) - measure(-2))) / (12 * h)
        np.testing.assert_allclose(terms.gradient[k], slope, atol=1e-8 * max(1.0, 1e-2 / h * 1e-4) * gap)


@formulas
def test_volume_gradients_are_derivatives_of_the_fans(member):
    """By films against differences of whole bubbles, to the error of the quadrature."""
    name = next(k for k, m in FAMILY.items() if m is member)
    foam = relaxed_on(name, order=8).foam
    surface, network, cell = member.surface, foam.network, foam.cell
    terms = film_terms(cell, network, foam.vertex_points, foam.film_offsets, tension=1.0, pressures=None)
    rng = np.random.default_rng(3)
    vertices = along_rims(foam, foam.bubble_size * rng.standard_normal((network.n_vertices, 2)))
    offsets = 0.1 * rng.standard_normal(foam.film_offsets.shape)

    def volumes(s):
        points = moved_points(surface, network, foam.vertex_points, s * vertices)
        return bubble_integrals(cell, network, points, foam.film_offsets + s * offsets, cell.layer)

    h = 1e-3
    slope = (8 * (volumes(h) - volumes(-h)) - (volumes(2 * h) - volumes(-2 * h))) / (12 * h)
    step = np.concatenate([vertices[network.tails].T, vertices[network.heads].T, offsets.T])
    flow = (step * terms.volume).sum(axis=0)
    given = np.bincount(network.left, flow, foam.n_bubbles) - np.bincount(network.right, flow, foam.n_bubbles)
    np.testing.assert_allclose(given, slope, atol=2e-5 * np.abs(slope).max())


@formulas
def test_hessians_are_right_at_equilibrium_in_a_thin_gap(member):
    """Second differences of the Lagrangian along random steps at a relaxed foam."""
    name = next(k for k, m in FAMILY.items() if m is member)
    foam = relaxed_on(name, order=8, gap=1e-6).foam
    surface, network, cell = member.surface, foam.network, foam.cell
    terms = film_terms(
        cell, network, foam.vertex_points, foam.film_offsets, tension=1.0, pressures=foam.pressures
    )
    np.testing.assert_allclose(terms.hessian, terms.hessian.transpose(1, 0, 2), atol=1e-20)
    hessian = terms.hessian.copy()
    held = held_vertices(surface, network, foam.vertex_points, foam.film_offsets)
    if held is not None:
        jump = foam.pressures[network.left] - foam.pressures[network.right]
        hold(held, network, 1.0, (terms.gradient - jump * terms.volume, terms.volume.copy(), hessian))
    rng = np.random.default_rng(4)
    for trial in range(3):
        vertices = along_rims(foam, 0.2 * foam.bubble_size * rng.standard_normal((network.n_vertices, 2)))
        offsets = 0.1 * rng.standard_normal(foam.film_offsets.shape)
        if trial == 1:
            vertices[:] = 0.0
        step = np.concatenate([vertices[network.tails].T, vertices[network.heads].T, offsets.T])

        def lagrangian(s, vertices=vertices, offsets=offsets):
            points = moved_points(surface, network, foam.vertex_points, s * vertices)
            u = foam.film_offsets + s * offsets
            tail, head = points[network.tails], points[network.heads]
            area = surface.arc_measure(tail, head, u, cell.layer).sum()
            volume = bubble_integrals(cell, network, points, u, cell.layer)
            return area - foam.pressures @ (volume - foam.bubble_volumes)

        h = 0.02
        f = [lagrangian(k * h) for k in range(-3, 4)]
        bend = np.dot(f, [2, -27, 270, -490, 270, -27, 2]) / (180 * h**2)
        second = np.einsum("if,ijf,jf->", step, hessian, step)
        assert second == pytest.approx(bend, rel=1e-4)


@each_member
def test_bubbles_fill_the_surface(member):
    foam = relaxed_on(next(k for k, m in FAMILY.items() if m is member)).foam
    assert foam.bubble_volumes.sum() == pytest.approx(foam.cell.volume, rel=1e-5)
    assert foam.bubble_areas.sum() == pytest.approx(member.surface.area, rel=1e-5)
    np.testing.assert_allclose(
        foam.bubble_curvatures.sum() + foam.wall_turning.sum(),
        2 * np.pi * member.euler,
        atol=2e-4 + member.error,
    )
    assert foam.wall_turning.sum() == pytest.approx(member.rim_turning, abs=1e-6)


# ---------------------------------------------------------------------------- foams


@each_member
def test_foams_relax_to_true_minima(member):
    result = relaxed_on(next(k for k, m in FAMILY.items() if m is member))
    assert result.converged
    assert result.is_minimum
    assert result.residual <= 1e-10
    assert result.volume_error <= 1e-12
    assert result.foam.network.charges.sum() == 6 * member.euler


@each_member
def test_pressure_identity_holds(member):
    """Σ (p_i − p_j) ℓ_ij = (π/3) q_i − ∫ G dA − ∫ κ_g ds along walls, thin gap, order 8."""
    name = next(k for k, m in FAMILY.items() if m is member)
    result = relaxed_on(name, order=8, gap=1e-6)
    report = equilibrium_report(result.foam)
    assert result.converged
    assert report.identity_error < 1e-5 + 10 * member.error
    assert report.angle_error < 1e-5 + member.error
    assert report.wall_error < 1e-5 + member.error


@pytest.mark.parametrize(("name", "tolerance"), [("ball", 1e-11), ("ring", 1e-9), ("mesh", 2e-5)])
def test_energies_are_those_of_the_closed_forms(name, tolerance):
    """The same bubbles relaxed on the formula surface, whose films and volumes are other code."""
    member = FAMILY[name]
    order = 8 if tolerance < 1e-8 else 4
    mine = relaxed_on(name, order=order)
    cell = HeleShawCell(member.twin, mine.foam.cell.gap)
    start = Foam(
        cell,
        mine.foam.network,
        member.twin.project(mine.foam.vertex_points),
        np.zeros_like(mine.foam.film_offsets),
        mine.foam.target_volumes * cell.volume / mine.foam.cell.volume,
    )
    twin = relax(start, order=order, t1=False)
    assert twin.converged
    assert mine.energy == pytest.approx(twin.energy, rel=tolerance)


def test_rotations_change_nothing():
    """An ellipsoid with its axes exchanged carries the exchanged foam at the same energy."""
    first = relaxed_on("egg")
    turned = Ellipsoid(1.2, 1.5, 1.0)
    points = first.foam.vertex_points[:, [1, 2, 0]]
    foam = Foam(
        HeleShawCell(turned, 0.05),
        first.foam.network,
        points,
        first.foam.film_offsets,
        first.foam.target_volumes * HeleShawCell(turned, 0.05).volume / first.foam.cell.volume,
    )
    np.testing.assert_allclose(foam.film_areas, first.foam.film_areas, rtol=1e-12)
    assert relax(foam).energy == pytest.approx(first.energy, rel=1e-9)


# ---------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Ellipsoid(1.0, 0.0, 1.0), "b must be greater than 0"),
        (lambda: Ellipsoid(1.0, "x", 1.0), "b must be a number"),
        (lambda: Revolution(1, vase_slope, -3, 3), "square must be callable"),
        (lambda: Revolution(vase_square, vase_slope, 3, -3), "top must lie above bottom"),
        (lambda: Revolution(vase_square, vase_slope, -4, 4), "square must be above 0 between"),
        (lambda: Revolution(vase_square, vase_square, -3, 3), "slope is not the derivative"),
        (
            lambda: Revolution(lambda z: (9 - z**2) ** 2, lambda z: -4 * z * (9 - z**2), -3, 3),
            "must be round",
        ),
        (lambda: Implicit(1, ring_gradient, RING_BOX), "function must be callable"),
        (lambda: Implicit(ring_level, None, RING_BOX), "gradient must be callable"),
        (lambda: Implicit(ring_level, ring_gradient, RING_BOX[::-1]), "lower one first"),
        (lambda: Implicit(ring_level, ring_gradient, [[-1, -1, -1], [1, 1, 1]]), "does not change sign"),
        (lambda: Implicit(ring_level, ring_gradient, [[-3, -3, -2], [3, 3, 2]]), "reaches the walls"),
        (lambda: Implicit(ring_level, lambda x: x, RING_BOX), "gradient is not that of function"),
        (lambda: Implicit(lambda x: x, ring_gradient, RING_BOX), "function's values"),
        (
            lambda: Implicit(lambda x: x[:, 0] * np.nan, ring_gradient, RING_BOX),
            "function's values must be finite",
        ),
    ],
)
def test_bad_formulas(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()


def test_plates_that_fold_are_refused_on_a_level_surface():
    with pytest.raises(ValueError, match="folds the outer plate"):
        HeleShawCell(FAMILY["ring"].surface, gap=2.1)
    assert Sphere(1.0).precision < FAMILY["ball"].surface.precision
