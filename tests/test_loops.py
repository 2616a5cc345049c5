"""Integrals round loops on every surface: additive, independent of names, closed forms on caps."""

from __future__ import annotations

import numpy as np
import pytest

from warpedfoam import CellNetwork, Foam, HeleShawCell, Sphere
from warpedfoam.kernels.loops import loops_of

from .io_foams import lone_bubble
from .surface_samples import each_layer, each_surface, foam_on


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
