"""Kernels: quadrature to its degree, arcs against closed forms and 3D sums, exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from warpedfoam.kernels import revolution_arcs as tube
from warpedfoam.kernels import sphere_arcs as arcs
from warpedfoam.kernels.condense import clip_to_positive, condense
from warpedfoam.kernels.lattice import best_lattice
from warpedfoam.kernels.loops import loops_of
from warpedfoam.kernels.nodal import Density, nodal_gradient, nodal_hessian, shape_values
from warpedfoam.kernels.quadrature import gauss, lobatto

ORDERS = [1, 2, 3, 4, 5, 8, 12, 17, 24, 40]


def centred(step):
    """Fourth-order central differences: shifts and weights."""
    return step * np.array([-2.0, -1.0, 1.0, 2.0]), np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * step)


def derivative(function, at, step=2e-4):
    """Derivatives of ``function`` (array-valued) by each entry of ``at``, last axis."""
    shifts, weights = centred(step)
    eye = np.eye(len(at))
    return np.stack(
        [sum(w * function(at + s * e) for s, w in zip(shifts, weights, strict=True)) for e in eye], axis=-1
    )


# ---------------------------------------------------------------------------- quadrature


@pytest.mark.parametrize("p", ORDERS)
def test_lobatto_is_exact_to_degree_2p_minus_1_and_no_further(p):
    rule = lobatto(p)
    powers = np.arange(2 * p + 1)
    moments = rule.weights @ rule.nodes[:, None] ** powers
    np.testing.assert_allclose(moments[:-1], 1.0 / (powers[:-1] + 1.0), rtol=1e-13)
    if p <= 8:  # later the error of degree 2p drowns in round-off
        assert abs(moments[-1] * (2 * p + 1) - 1.0) > 1e-10


@pytest.mark.parametrize("p", ORDERS)
def test_lobatto_nodes_are_symmetric_and_hold_the_ends(p):
    rule = lobatto(p)
    assert rule.order == p
    assert (rule.nodes[0], rule.nodes[-1]) == (0.0, 1.0)
    assert (np.diff(rule.nodes) > 0).all()
    np.testing.assert_allclose(rule.nodes + rule.nodes[::-1], 1.0, atol=1e-15)
    np.testing.assert_allclose(rule.weights, rule.weights[::-1], rtol=1e-13)
    assert (rule.weights > 0).all()
    assert rule.weights.sum() == pytest.approx(1.0, abs=1e-15)


def test_small_lobatto_rules_are_the_known_ones():
    root = np.sqrt(3.0 / 7.0)
    np.testing.assert_allclose(lobatto(1).weights, [0.5, 0.5])
    third = 0.5 + 0.5 * np.array([-1, -(5**-0.5), 5**-0.5, 1])
    np.testing.assert_allclose(lobatto(3).nodes, third, atol=1e-15)
    np.testing.assert_allclose(lobatto(4).nodes, 0.5 + 0.5 * np.array([-1, -root, 0, root, 1]), atol=1e-15)
    np.testing.assert_allclose(lobatto(4).weights, np.array([9, 49, 64, 49, 9]) / 180.0, rtol=1e-14)


@pytest.mark.parametrize("p", ORDERS)
def test_polynomials_of_degree_p_are_differentiated_exactly(p):
    rule = lobatto(p)
    f = Polynomial(np.random.default_rng(p).standard_normal(min(p, 12) + 1))
    np.testing.assert_allclose(rule.derivative @ f(rule.nodes), f.deriv()(rule.nodes), atol=1e-11)
    np.testing.assert_array_equal(rule.interior, rule.derivative[:, 1:-1])


@pytest.mark.parametrize("p", ORDERS)
def test_polynomials_of_degree_p_are_interpolated_exactly(p):
    rule = lobatto(p)
    f = Polynomial(np.random.default_rng(p).standard_normal(min(p, 12) + 1))
    xi = np.concatenate([np.linspace(0.0, 1.0, 23), rule.nodes])
    matrix = rule.interpolation(xi)
    np.testing.assert_allclose(matrix @ f(rule.nodes), f(xi), atol=1e-13)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, atol=1e-13)
    np.testing.assert_array_equal(matrix[-(p + 1) :], np.eye(p + 1))


def test_products_are_weighted_squares_of_slopes():
    rule = lobatto(5)
    u = np.random.default_rng(0).standard_normal(4)
    energy = rule.weights @ (rule.interior @ u) ** 2
    assert u @ rule.products.sum(axis=0).reshape(4, 4) @ u == pytest.approx(energy, rel=1e-13)


@pytest.mark.parametrize("n", [1, 2, 3, 7, 20])
def test_gauss_is_exact_to_degree_2n_minus_1(n):
    nodes, weights = gauss(n)
    powers = np.arange(2 * n)
    np.testing.assert_allclose(weights @ nodes[:, None] ** powers, 1.0 / (powers + 1.0), rtol=1e-13)


def test_rules_are_kept_and_cannot_be_changed():
    assert lobatto(6) is lobatto(6)
    for array in (lobatto(6).nodes, lobatto(6).derivative, *gauss(3)):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 7.0


# ---------------------------------------------------------------------------- nodal sums


def density_of(x, v, w):
    """g = sin(x0 + 2 v) exp(x1 w / 2) + x0 x1 v w² with all its first and second derivatives."""
    s, c, e = np.sin(x[0] + 2 * v), np.cos(x[0] + 2 * v), np.exp(0.5 * x[1] * w)
    value = s * e + x[0] * x[1] * v * w**2
    gx = np.stack([c * e + x[1] * v * w**2, 0.5 * w * s * e + x[0] * v * w**2])
    gv = 2 * c * e + x[0] * x[1] * w**2
    gw = 0.5 * x[1] * s * e + 2 * x[0] * x[1] * v * w
    cross = 0.5 * w * c * e + v * w**2
    second = Density(
        xx=np.stack([np.stack([-s * e, cross]), np.stack([cross, 0.25 * w**2 * s * e])]),
        xv=np.stack([-2 * s * e + x[1] * w**2, w * c * e + x[0] * w**2]),
        xw=np.stack(
            [0.5 * x[1] * c * e + 2 * x[1] * v * w, (0.5 + 0.25 * x[1] * w) * s * e + 2 * x[0] * v * w]
        ),
        vv=-4 * s * e,
        vw=x[1] * c * e + 2 * x[0] * x[1] * w,
        ww=0.25 * x[1] ** 2 * s * e + 2 * x[0] * x[1] * v,
    )
    return value, (gx, gv, gw), second


@pytest.mark.parametrize("p", [1, 2, 4, 7])
def test_nodal_gradient_and_hessian_are_derivatives_of_the_nodal_sum(p):
    rule = lobatto(p)
    z0 = np.random.default_rng(p).normal(0.5, 0.3, p + 1)

    def parts(z):
        x = np.broadcast_to(z[:2, None, None], (2, p + 1, 1))
        return density_of(x, *shape_values(rule, z[2:, None]))

    def gradient(z):
        return nodal_gradient(rule, *parts(z)[1])[:, 0]

    by_value = derivative(lambda z: rule.weights @ parts(z)[0][:, 0], z0)
    np.testing.assert_allclose(gradient(z0), by_value, atol=1e-9)
    hessian = nodal_hessian(rule, parts(z0)[2])[..., 0]
    np.testing.assert_allclose(hessian, derivative(gradient, z0), atol=1e-8)
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-14)


def test_shapes_vanish_at_the_ends_and_take_the_offsets_between():
    rule = lobatto(4)
    u = np.array([[1.0], [-2.0], [0.5]])
    v, slope = shape_values(rule, u)
    np.testing.assert_array_equal(v[:, 0], [0.0, 1.0, -2.0, 0.5, 0.0])
    np.testing.assert_allclose(rule.weights @ slope, 0.0, atol=1e-14)  # ∫ v' = v(1) − v(0)


# ---------------------------------------------------------------------------- arcs on the sphere


@pytest.mark.parametrize("p", [1, 2, 4, 9])
def test_straight_arc_has_the_length_of_its_great_circle_and_no_lune(p):
    length = np.array([1e-8, 0.1, 1.0, 3.0])
    measured, lune = arcs.arc_length_and_lune(lobatto(p), length, np.zeros((p - 1, 4)))
    np.testing.assert_allclose(measured, length, rtol=1e-15)
    np.testing.assert_array_equal(lune, 0.0)


def cap_arc(theta, k, p):
    """Angle L and offsets of one of k equal arcs of the circle at colatitude θ, pole on the left."""
    half = np.pi / k
    length = 2 * np.arcsin(np.sin(theta) * np.sin(half))
    # at longitude λ from the chord's middle the circle of pole (sin δ, 0, cos δ) has latitude β:
    # cos θ = sin δ cos β cos λ + cos δ sin β, with the circle through β = 0 at λ = ± L/2
    lam = (lobatto(p).nodes[1:-1] - 0.5) * length
    sin_pole = np.cos(theta) / np.cos(0.5 * length)
    amplitude = np.hypot(sin_pole * np.cos(lam), np.sqrt(1 - sin_pole**2))
    phase = np.arctan2(np.sqrt(1 - sin_pole**2), sin_pole * np.cos(lam))
    beta = phase - np.arccos(np.clip(np.cos(theta) / amplitude, -1, 1))
    return length, -np.abs(beta) / length


@pytest.mark.parametrize(("theta", "k"), [(0.3, 4), (0.8, 4), (1.2, 6), (1.5, 5)])
def test_small_circle_arcs_converge_spectrally(theta, k):
    exact_length = 2 * np.pi * np.sin(theta) / k
    errors = []
    for p in (2, 4, 6, 8, 10, 12):
        length, offsets = cap_arc(theta, k, p)
        measured, lune = arcs.arc_length_and_lune(lobatto(p), np.array([length]), offsets[:, None])
        # cap = regular spherical polygon of k sides + k lunes on its outer side
        corner = 2 * np.arcsin(np.cos(np.pi / k) / np.cos(0.5 * length))
        polygon = k * corner - (k - 2) * np.pi
        cap = polygon - k * lune[0]
        exact_cap = 2 * np.pi * (1 - np.cos(theta))
        errors.append((abs(measured[0] / exact_length - 1), abs(cap / exact_cap - 1)))
    errors = np.array(errors)
    assert errors[-1].max() < 1e-9
    ratios = errors[1:] / np.maximum(errors[:-1], 1e-300)
    assert (ratios[errors[1:] > 1e-11] < 0.2).all()  # each two orders at least a factor 5


@pytest.mark.parametrize("p", [1, 2, 4, 7])
def test_arc_derivatives(p):
    rule = lobatto(p)
    z0 = np.concatenate([[0.7], 0.2 * np.random.default_rng(p).standard_normal(p - 1)])
    pressure = np.array([1.7])

    def value(z):
        return np.array(arcs.arc_length_and_lune(rule, z[:1], z[1:, None]))[:, 0]

    def gradients(z):
        total, grad, lune = arcs.arc_gradients(rule, z[:1], z[1:, None])
        assert total[0] == pytest.approx(value(z)[0], rel=1e-14)
        return np.stack([grad[:, 0], lune[:, 0]])

    np.testing.assert_allclose(gradients(z0), derivative(value, z0), atol=1e-9)
    hessian = arcs.arc_hessian(rule, z0[:1], z0[1:, None], 0.6, pressure)[..., 0]
    numeric = derivative(lambda z: 0.6 * gradients(z)[0] + 1.7 * gradients(z)[1], z0)
    np.testing.assert_allclose(hessian, numeric, atol=1e-8)


def test_geodesic_frames():
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((2, 50, 3))
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    length, left, ta, tb = arcs.geodesic_frame(a, b)
    np.testing.assert_allclose(np.cos(length[:, None]) * a + np.sin(length[:, None]) * ta, b, atol=1e-14)
    np.testing.assert_allclose(np.cos(length[:, None]) * tb + np.sin(length[:, None]) * b, ta, atol=1e-13)
    np.testing.assert_allclose(np.cross(a, ta), left, atol=1e-13)  # left of the motion, seen from outside
    tiny = arcs.geodesic_frame(np.array([[1.0, 0, 0]]), np.array([[1.0, 1e-9, 0]]))[0]
    assert tiny[0] == pytest.approx(1e-9, rel=1e-12)


# ---------------------------------------------------------------------------- arcs on a torus

RING, TUBE = 3.0, 1.2
CHART = np.array([0.4, 1.3, -0.6])  # φ_A, φ_B, Δθ


def nodes_of(z, p):
    return tube.tube_arcs(lobatto(p), RING, TUBE, z[:1], z[1:2], z[2:3], z[3:, None])


def strip_area(phi, theta, heights):
    """Area of the triangles of a ruled strip whose foot runs through angles (m,)."""
    rho = TUBE + heights[:, None]
    out = RING + rho * np.cos(phi)
    grid = np.stack([out * np.cos(theta), out * np.sin(theta), rho * np.sin(phi)], axis=-1)
    total = 0.0
    for a, b, c in (
        (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:]),
        (grid[:-1, :-1], grid[1:, 1:], grid[:-1, 1:]),
    ):
        total += 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=-1).sum()
    return total


@pytest.mark.parametrize("bend", [0.0, 0.25])
def test_ruled_film_area_is_the_area_of_the_strip_in_space(bend):
    """A strip between plates, triangulated in 3D at m and 2m pieces, extrapolated."""
    p, gap = 16, 0.5
    rule = lobatto(p)
    u = bend * np.sin(np.pi * rule.nodes[1:-1])
    z = np.concatenate([CHART, u])
    heights, shares = gauss(6)
    film = tube.film_density(nodes_of(z, p), RING, TUBE + gap * heights, gap * shares)
    area = float(rule.weights @ film[:, 0])
    a = RING + TUBE * np.cos(0.5 * (CHART[0] + CHART[1]))
    dphi, dtheta = CHART[1] - CHART[0], CHART[2]

    def brute(m):
        xi = np.linspace(0.0, 1.0, 8 * m + 1)
        v = rule.interpolation(xi)[:, 1:-1] @ u
        phi = CHART[0] + xi * dphi + v * a * dtheta / TUBE
        theta = xi * dtheta - v * TUBE * dphi / a
        return strip_area(phi, theta, np.linspace(0.0, gap, m + 1))

    coarse, fine = brute(12), brute(24)
    assert abs(fine / area - 1) < 1e-4
    assert (4 * fine - coarse) / 3 == pytest.approx(area, rel=1e-7)
    assert 3.7 < (coarse - area) / (fine - area) < 4.3  # second order


def test_offsets_are_to_the_left_seen_from_outside():
    """The middle moves by u chords along the chord turned left; θ to the right, φ up, seen from outside."""
    arc = nodes_of(np.concatenate([CHART, [0.0, 0.05, 0.0]]), 4)
    out = RING + TUBE * np.cos(0.85)
    assert arc.phi[2, 0] - 0.85 == pytest.approx(0.05 * out * CHART[2] / TUBE, rel=1e-12)
    turned = lobatto(4).derivative @ np.array([0.0, 0.0, 0.05, 0.0, 0.0])
    np.testing.assert_allclose(arc.dtheta[:, 0], CHART[2] - turned * TUBE * 0.9 / out, rtol=1e-12)


@pytest.mark.parametrize("p", [1, 2, 4, 7])
def test_tube_film_derivatives(p):
    z0 = np.concatenate([CHART, 0.2 * np.random.default_rng(p).standard_normal(p - 1)])
    radii, shares = TUBE + np.array([0.1, 0.4]), np.array([0.3, 0.2])

    def value(z):
        return lobatto(p).weights @ tube.film_density(nodes_of(z, p), RING, radii, shares)[:, 0]

    def gradient(z):
        arc = nodes_of(z, p)
        density, first = tube.film_density_first(arc, RING, radii, shares)
        np.testing.assert_allclose(density, tube.film_density(arc, RING, radii, shares), rtol=1e-14)
        return tube.pulled_gradient(arc, first, tube.chain(arc, TUBE)[0])[:, 0]

    np.testing.assert_allclose(gradient(z0), derivative(value, z0), atol=1e-9)
    arc = nodes_of(z0, p)
    jacobian, bends = tube.chain(arc, TUBE)
    first = tube.film_density_first(arc, RING, radii, shares)[1]
    second = tube.film_density_second(arc, RING, radii, shares)
    hessian = tube.pulled_hessian(arc, first, second, jacobian, bends)[..., 0]
    np.testing.assert_allclose(hessian, derivative(gradient, z0), atol=1e-8)
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-13)


def test_tube_arcs_know_only_the_difference_of_ring_angles_and_turn_backwards():
    """Walked from B to A with the offsets mirrored, an arc has the same points."""
    p = 5
    u = np.array([0.1, -0.2, 0.05, 0.15])
    there = nodes_of(np.concatenate([CHART, u]), p)
    back = nodes_of(np.concatenate([[CHART[1], CHART[0], -CHART[2]], -u[::-1]]), p)
    np.testing.assert_allclose(back.phi[::-1], there.phi, atol=1e-14)
    np.testing.assert_allclose(back.dtheta[::-1], -there.dtheta, atol=1e-13)


# ---------------------------------------------------------------------------- condensation


@given(st.integers(1, 5), st.integers(0, 6), st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_condensing_is_block_elimination(kept, gone, seed):
    rng = np.random.default_rng(seed)
    m, count = kept + gone, 3
    full = rng.standard_normal((m, m, count))
    full = full + full.transpose(1, 0, 2)
    full[np.arange(m), np.arange(m)] += 3.0 * m
    rhs = rng.standard_normal((m, count))
    out = condense(full.copy(), rhs.copy(), kept, None)
    for f in range(count):
        a, b, c = full[:kept, :kept, f], full[:kept, kept:, f], full[kept:, kept:, f]
        schur = a - b @ np.linalg.solve(c, b.T)
        np.testing.assert_allclose(out.matrix[..., f], schur, atol=1e-11)
        head = rhs[:kept, f] - b @ np.linalg.solve(c, rhs[kept:, f])
        np.testing.assert_allclose(out.rhs[:, f], head, atol=1e-11)
        solution = np.linalg.solve(full[..., f], rhs[:, f])
        found = out.recover(np.repeat(solution[:kept, None], count, axis=1))[:, f]
        np.testing.assert_allclose(found, solution[kept:], atol=1e-11)
    assert not out.negative.any()


def test_condensing_tells_and_mends_pivots_that_are_not_positive():
    matrix = np.zeros((3, 3, 2))
    matrix[0, 0], matrix[1, 1], matrix[2, 2] = 5.0, [4.0, -4.0], [3.0, 0.01]
    matrix[0, 2] = matrix[2, 0] = 1.0
    rhs = np.ones((3, 2))
    plain = condense(matrix.copy(), rhs.copy(), 1, None)
    assert plain.negative.tolist() == [False, True]
    np.testing.assert_allclose(plain.matrix[0, 0], [5.0 - 1 / 3.0, 5.0 - 100.0])
    mended = condense(matrix.copy(), rhs.copy(), 1, np.full((2, 1), 0.5))
    assert mended.negative.tolist() == [False, True]
    np.testing.assert_allclose(mended.pivots, [[4.0, 4.0], [3.0, 0.5]])
    np.testing.assert_allclose(mended.matrix[0, 0], [5.0 - 1 / 3.0, 5.0 - 2.0])


def test_clipping_keeps_what_is_positive_and_cuts_the_rest():
    rng = np.random.default_rng(0)
    blocks = rng.standard_normal((4, 4, 30))
    blocks = blocks + blocks.transpose(1, 0, 2)
    blocks[..., :10] = np.einsum("ikf,jkf->ijf", blocks, blocks)[..., :10]
    clipped = clip_to_positive(blocks)
    np.testing.assert_allclose(clipped[..., :10], blocks[..., :10], atol=1e-12)
    for f in range(30):
        values, vectors = np.linalg.eigh(blocks[..., f])
        nearest = (vectors * np.maximum(values, 0.0)) @ vectors.T
        np.testing.assert_allclose(clipped[..., f], nearest, atol=1e-12)
    positive = np.repeat(np.eye(4)[..., None], 3, axis=2)
    assert clip_to_positive(positive) is positive


# ---------------------------------------------------------------------------- loops and lattices


@given(st.integers(1, 60), st.integers(1, 6), st.integers(0, 10_000))
@settings(max_examples=80, deadline=None)
def test_loops_are_those_of_a_walk(n, owners, seed):
    rng = np.random.default_rng(seed)
    following = rng.permutation(n)
    owner = np.full(n, -1)
    for h in range(n):
        if owner[h] < 0:
            name = rng.integers(owners)
            while owner[h] < 0:
                owner[h] = name
                h = following[h]
    found = loops_of(following, owner)
    assert found.sizes.sum() == n
    assert sorted(found.halves.tolist()) == list(range(n))
    names = owner[found.halves[found.starts]]
    assert (np.diff(names) >= 0).all()
    for start, size in zip(found.starts, found.sizes, strict=True):
        ring = found.halves[start : start + size]
        np.testing.assert_array_equal(following[ring], np.roll(ring, -1))
        assert ring[0] == ring.min()


@pytest.mark.parametrize("n", [1, 2, 7, 12, 101, 256])
def test_a_loop_of_everything_in_order_or_backwards(n):
    for step in (1, n - 1):
        found = loops_of((np.arange(n) + step) % n, np.zeros(n, dtype=int))
        assert len(found.starts) == (1 if np.gcd(step, n) == 1 or n == 1 else np.gcd(step, n))


@pytest.mark.parametrize("count", [1, 2, 3, 7, 12, 50, 97])
@pytest.mark.parametrize(("width", "height"), [(1.0, 1.0), (5.0, 1.0), (0.3, 4.0), (125.7, 25.1)])
def test_no_lattice_is_more_even(count, width, height):
    """Nearest neighbours of every rank-1 lattice, by looking at all differences and their images."""

    def nearest(z):
        i = np.arange(count)
        x, y = i / count * width, (i * z % count) / count * height
        shifts = np.arange(-8, 9)
        dx = x[:, None, None] + shifts[:, None] * width
        dy = y[:, None, None] + shifts[None, :] * height
        distance = np.hypot(dx, dy)
        return distance[distance > 1e-12 * max(width, height)].min()

    x, y = best_lattice(count, width, height)
    np.testing.assert_allclose(np.sort(x), np.arange(count) / count, atol=1e-15)
    z = round(y[1] * count) if count > 1 else 1
    np.testing.assert_array_equal(y, np.arange(count) * z % count / count)
    assert nearest(z) == pytest.approx(max(nearest(k) for k in range(count)), rel=1e-12)
