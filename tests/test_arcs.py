"""Arcs of every surface: lengths, areas, volumes and derivatives against brute force and differences."""

from __future__ import annotations

import numpy as np
import pytest

from warpedfoam import Torus
from warpedfoam.energy import bubble_volumes, film_terms
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.surfaces import Layer

from .surface_samples import LAYERS, each_layer, each_surface, foam_on, scale_of


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
