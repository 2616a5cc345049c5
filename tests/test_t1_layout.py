"""T1s laid out in a foam: the new film lies across the old one, volumes and ids stay."""

from __future__ import annotations

import numpy as np
import pytest

from warpedfoam import Foam, HeleShawCell, Sphere, TopologyError, Torus, t1
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.moves.t1 import lay_films, local_energy, outward_tangents, pulls, rewire, t1_sites

from .io_foams import sphere_foam, torus_foam, with_pressures
from .turning import may_turn, same

FOAMS = {
    "sphere": with_pressures(sphere_foam(60, even=True)),
    "torus": with_pressures(torus_foam(6, 10)),
    "thin torus": torus_foam(6, 24, major_radius=6.0),
}
each_foam = pytest.mark.parametrize("name", FOAMS)


def direction(foam, film):
    points = foam.vertex_points
    chord = points[foam.network.heads[film]] - points[foam.network.tails[film]]
    return chord / np.linalg.norm(chord)


def middle(foam, film):
    ends = foam.vertex_points[[foam.network.tails[film], foam.network.heads[film]]]
    return foam.cell.surface.project(ends.mean(axis=0)[None])[0]


@each_foam
def test_the_new_film_lies_across_the_old_one(name):
    foam = FOAMS[name]
    surface, size = foam.cell.surface, foam.bubble_size
    for film in may_turn(foam.network)[::5]:
        turned = t1(foam, int(film))
        assert same(turned.network, rewire(foam.network, [film]))
        assert abs(direction(turned, film) @ direction(foam, film)) < 0.5  # nearer to 90° than 60°
        np.testing.assert_allclose(middle(turned, film), middle(foam, film), atol=0.01 * size)
        assert turned.film_lengths[film] == pytest.approx(0.1 * size, rel=0.012)
        np.testing.assert_allclose(surface.project(turned.vertex_points), turned.vertex_points, atol=1e-13)
        five = [film, *(t1_sites(foam.network, np.array([film])).outer[0] >> 1)]
        np.testing.assert_array_equal(turned.film_offsets[five], 0.0)
        others = np.setdiff1d(np.arange(foam.network.n_films), five)
        np.testing.assert_array_equal(turned.film_offsets[others], foam.film_offsets[others])
        np.testing.assert_array_equal(turned.film_areas[others], foam.film_areas[others])
        ends = [foam.network.tails[film], foam.network.heads[film]]
        still = np.setdiff1d(np.arange(foam.network.n_vertices), ends)
        np.testing.assert_array_equal(turned.vertex_points[still], foam.vertex_points[still])


@each_foam
def test_the_tail_goes_to_the_side_of_the_films_that_now_start_there(name):
    """Neighbours grow shorter or stay, they never cross: the new film points tail → its two neighbours."""
    foam = FOAMS[name]
    for film in may_turn(foam.network)[::5]:
        turned = t1(foam, int(film), length=0.02 * foam.bubble_size)
        sites = t1_sites(turned.network, np.array([film]))
        tangents = outward_tangents(
            turned.cell.surface, turned.network, turned.vertex_points, turned.film_offsets, sites.outer
        )
        pull = pulls(tangents)[0][0]
        assert -direction(turned, film) @ pull / np.linalg.norm(pull) > 0.9
        # films round both ends keep their order round the vertex
        out = turned.network.outgoing
        rows = np.isin(turned.network.origin[out[:, 0]], turned.network.origin[[2 * film, 2 * film + 1]])
        halves = out[rows]
        tangent = outward_tangents(
            turned.cell.surface, turned.network, turned.vertex_points, turned.film_offsets, halves
        )
        normal = turned.cell.surface.normals(turned.vertex_points[turned.network.origin[halves[:, 0]]])
        for k in range(3):
            turn = np.cross(tangent[:, k], tangent[:, (k + 1) % 3])
            assert (np.einsum("va,va->v", turn, normal) > 0).all()


@each_foam
def test_t1s_hold_volumes_ids_and_the_surface(name):
    foam = FOAMS[name]
    for film in may_turn(foam.network)[::11]:
        turned = t1(foam, int(film))
        assert turned.bubble_areas.sum() == pytest.approx(foam.cell.surface.area, rel=1e-13)
        assert turned.bubble_volumes.sum() == pytest.approx(foam.cell.volume, rel=1e-13)
        assert (turned.bubble_areas > 0).all()
        np.testing.assert_array_equal(turned.target_volumes, foam.target_volumes)
        np.testing.assert_array_equal(turned.bubble_ids, foam.bubble_ids)
        assert turned.pressures is None
        assert (turned.tension, turned.seed, turned.cell) == (foam.tension, foam.seed, foam.cell)
        four = t1_sites(foam.network, np.array([film])).bubbles[0]
        others = np.setdiff1d(np.arange(foam.n_bubbles), four)
        around = np.unique(foam.network.bubble[t1_sites(foam.network, np.array([film])).outer[0]])
        untouched = np.setdiff1d(others, around)
        np.testing.assert_allclose(turned.bubble_areas[untouched], foam.bubble_areas[untouched], rtol=1e-12)


@pytest.mark.parametrize("length", [0.01, 0.05, 0.3])
@each_foam
def test_the_length_is_what_was_asked_for(name, length):
    foam = FOAMS[name]
    film = int(may_turn(foam.network)[0])
    turned = t1(foam, film, length=length * foam.bubble_size)
    assert turned.film_lengths[film] == pytest.approx(length * foam.bubble_size, rel=0.012)


def test_a_t1_and_back_has_the_old_energy_once_the_film_is_laid_as_it_was():
    foam = FOAMS["thin torus"]
    film = int(may_turn(foam.network)[3])
    sites = t1_sites(foam.network, np.array([film]))
    tail, head = foam.network.tails[film], foam.network.heads[film]
    along = (foam.vertex_points[tail] - foam.vertex_points[head])[None]
    points, offsets = lay_films(
        foam.cell.surface,
        foam.network,
        foam.vertex_points,
        foam.film_offsets,
        sites,
        along,
        np.linalg.norm(along, axis=1),
    )
    # laid along its own chord a film comes back to where it was, up to the chord's height squared
    assert np.abs(points - foam.vertex_points).max() < 0.1 * foam.bubble_size
    assert np.array_equal(offsets, foam.film_offsets)
    assert local_energy(foam, np.array([film]))[0] > 0


@each_foam
def test_local_energy_is_the_energy_of_five_films(name):
    foam = FOAMS[name]
    films = may_turn(foam.network)[::9]
    for film, energy in zip(films, local_energy(foam, films), strict=True):
        touching = np.flatnonzero(
            np.isin(foam.network.tails, [foam.network.tails[film], foam.network.heads[film]])
            | np.isin(foam.network.heads, [foam.network.tails[film], foam.network.heads[film]])
        )
        assert len(touching) == 5
        assert energy == pytest.approx(foam.tension * foam.film_areas[touching].sum(), rel=1e-13)


@each_foam
def test_tangents_point_along_the_films_away_from_their_start(name):
    foam = FOAMS[name]
    net = foam.network
    halves = np.arange(2 * net.n_films)
    tangents = outward_tangents(foam.cell.surface, net, foam.vertex_points, foam.film_offsets, halves)
    np.testing.assert_allclose(np.linalg.norm(tangents, axis=1), 1.0, atol=1e-13)
    curves = foam.film_curves_at(np.array([0.0, 1e-6, 1.0 - 1e-6, 1.0]))
    ahead = np.empty_like(tangents)
    ahead[0::2], ahead[1::2] = curves[:, 1] - curves[:, 0], curves[:, 2] - curves[:, 3]
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    assert np.abs(ahead - tangents).max() < 0.01  # the polynomial through p + 1 points of the curve
    assert lobatto(foam.order).order == 4


def test_the_larger_pull_wins():
    """Four films in the plane at the corners of a rectangle: the long way of the rectangle pulls."""
    for a, b in ((2.0, 1.0), (1.0, 2.0)):
        # outgoing at the tail (left): twin(a0), b1; at the head (right): a1, twin(b0)
        corners = np.array([[-a, b, 0], [-a, -b, 0], [a, b, 0], [a, -b, 0]])
        corners /= np.linalg.norm(corners, axis=1, keepdims=True)
        now, turned = (np.linalg.norm(v[0]) for v in pulls(corners[None]))
        assert (now > turned) == (a > b)


def test_dissociating_a_fourfold_vertex_the_right_way_lowers_the_energy():
    """A short film: after its T1 the five films are shorter by half the gain in pull."""
    thick = FOAMS["sphere"]  # where straight films are geodesics, as the pull takes them to be
    cell = HeleShawCell(thick.cell.surface, 1e-4)
    foam = Foam(cell, thick.network, thick.vertex_points, np.zeros_like(thick.film_offsets))
    surface, net = cell.surface, foam.network
    short = 4e-4 * foam.bubble_size
    films = may_turn(net)[::3]
    agreed = 0
    for film in films:
        sites = t1_sites(net, np.array([film]))
        points, offsets = foam.vertex_points, foam.film_offsets
        for _ in range(2):  # once to shrink the film, once more along the pull on the short one
            tangents = outward_tangents(surface, net, points, offsets, sites.outer)
            now, after = pulls(tangents)
            points, offsets = lay_films(surface, net, points, offsets, sites, now, np.array([short]))
        before = Foam(foam.cell, net, points, offsets)
        points, offsets = lay_films(surface, net, points, offsets, sites, after, np.array([short]))
        turned = Foam(foam.cell, rewire(net, [film]), points, offsets)
        gain = np.linalg.norm(after) - np.linalg.norm(now)
        if abs(gain) > 0.1:
            agreed += 1
            change = turned.film_areas.sum() - before.film_areas.sum()
            # dE/dlength = 1 − |pull| / 2 for each
            assert change == pytest.approx(-0.5 * gain * short * foam.cell.gap, rel=0.05)
    assert agreed > 5


@pytest.mark.parametrize(
    ("film", "fault", "message"),
    [
        (-1, ValueError, "film must be at least 0"),
        (10**6, ValueError, "film must be at least 0 and below"),
        (1.0, TypeError, "film must hold integers"),
        (True, TypeError, "film must hold integers"),
        ("0", TypeError, "film must hold integers"),
        (None, TypeError, "film must hold integers"),
    ],
)
def test_no_such_film(film, fault, message):
    with pytest.raises(fault, match=message):
        t1(FOAMS["sphere"], film)


def test_films_that_may_not_turn():
    cell = HeleShawCell(Sphere(1.0), 0.1)
    points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    tetrahedron = Foam.from_loops(cell, points, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    with pytest.raises(TopologyError, match="at least four sides"):
        t1(tetrahedron, 0)


@pytest.mark.parametrize("length", [0.0, -1.0, float("nan"), "1", [1.0]])
def test_bad_lengths(length):
    with pytest.raises((ValueError, TypeError), match="length must be"):
        t1(FOAMS["sphere"], int(may_turn(FOAMS["sphere"].network)[0]), length=length)


def test_no_foam():
    with pytest.raises(TypeError, match="foam must be a Foam"):
        t1(Torus(3.0, 1.0), 0)
