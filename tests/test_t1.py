"""T1s of networks: four are none, charges stay, films that may not turn are refused."""

from __future__ import annotations

import numpy as np
import pytest

from warpedfoam import CellNetwork, TopologyError, network_from_loops
from warpedfoam.moves.t1 import allowed, independent, rewire, t1_sites

from .io_foams import sphere_foam, torus_foam
from .turning import every_site, may_turn, same

NETWORKS = {
    "sphere of 60": sphere_foam(60).network,
    "sphere of 200": sphere_foam(200, seed=5).network,
    "torus of 60": torus_foam(6, 10).network,
    "torus of 160": torus_foam(8, 20).network,
}
EULER = {"sphere": 2, "torus": 0}

each_network = pytest.mark.parametrize("name", NETWORKS)


def prism(n):
    low, high = list(range(n)), list(range(n, 2 * n))
    return [low[::-1], high, *([i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n))]


# ---------------------------------------------------------------------------- the rewiring


@each_network
def test_sites_are_what_they_are_called(name):
    net = NETWORKS[name]
    s = every_site(net)
    np.testing.assert_array_equal(s.c, s.a ^ 1)
    np.testing.assert_array_equal(net.next[s.a0], s.a)
    np.testing.assert_array_equal(net.next[s.a], s.a1)
    np.testing.assert_array_equal(net.next[s.b0], s.c)
    np.testing.assert_array_equal(net.next[s.c], s.b1)
    beside = np.stack([net.left, net.right, net.bubble[s.a1 ^ 1], net.bubble[s.b1 ^ 1]], axis=1)
    np.testing.assert_array_equal(s.bubbles, beside)
    tail, head = net.origin[s.a], net.origin[s.c]
    np.testing.assert_array_equal(net.origin[s.outer], np.stack([tail, tail, head, head], axis=1))
    # with the film itself these are the three films of each end
    at_tail = np.sort(np.stack([s.a, s.outer[:, 0], s.outer[:, 1]], axis=1), axis=1)
    rows = np.searchsorted(np.unique(net.origin), tail)
    np.testing.assert_array_equal(at_tail, np.sort(net.outgoing[rows], axis=1))


@each_network
def test_losers_lose_a_side_and_gainers_gain_one(name):
    net = NETWORKS[name]
    for film in may_turn(net)[::7]:
        turned = rewire(net, [film])
        expected = np.zeros(net.n_bubbles, dtype=int)
        expected[[net.left[film], net.right[film]]] = -1
        expected[every_site(net).bubbles[film, 2:]] = 1
        np.testing.assert_array_equal(turned.sides - net.sides, expected)
        assert sorted(every_site(turned).bubbles[film].tolist()) == sorted(
            every_site(net).bubbles[film].tolist()
        )
        np.testing.assert_array_equal(
            np.sort([turned.left[film], turned.right[film]]), np.sort(every_site(net).bubbles[film, 2:])
        )


@each_network
def test_four_t1s_are_none(name):
    net = NETWORKS[name]
    tried = 0
    for film in may_turn(net)[:: 1 + net.n_bubbles // 60]:
        now, seen = net, []
        for _ in range(4):
            if not allowed(now, t1_sites(now, np.array([film])))[0]:
                break
            now = rewire(now, [film])
            seen.append(now)
        else:
            tried += 1
            assert same(now, net)
            # two T1s turn the film round: the same network with its halves and ends exchanged
            half = np.arange(2 * net.n_films)
            half[[2 * film, 2 * film + 1]] = half[[2 * film + 1, 2 * film]]
            twice = seen[1]
            np.testing.assert_array_equal(half[twice.next[half]], net.next)
            np.testing.assert_array_equal(twice.bubble[half], net.bubble)
            vertex = np.arange(net.n_vertices)
            ends = [net.tails[film], net.heads[film]]
            vertex[ends] = ends[::-1]
            np.testing.assert_array_equal(vertex[twice.origin[half]], net.origin)
            assert not same(seen[0], net)
            assert not same(seen[1], net)
    assert tried > 20


@each_network
def test_four_sweeps_of_many_t1s_are_none(name):
    net = NETWORKS[name]
    sites = every_site(net)
    fine = allowed(net, sites) & (net.sides[sites.bubbles].min(axis=1) >= 5)
    films = np.flatnonzero(fine)
    chosen = films[independent(t1_sites(net, films).bubbles, np.random.default_rng(0).random(len(films)))]
    assert len(chosen) >= 3
    now = net
    for _ in range(4):
        now = rewire(now, chosen)
    assert same(now, net)


@each_network
def test_charges_add_up_after_each_of_thousands_of_t1s(name):
    """One film after the other: 1000 random T1s on each of four networks, validated each time."""
    net = NETWORKS[name]
    total = int(net.charges.sum())
    assert total == 6 * EULER[name.split()[0]]
    rng = np.random.default_rng(1)
    before = net.sides
    done = 0
    while done < 1000:
        film = rng.integers(net.n_films)
        sites = t1_sites(net, np.array([film]))
        if not allowed(net, sites)[0]:
            with pytest.raises(TopologyError, match="cannot turn"):
                rewire(net, [film])
            continue
        net = rewire(net, [film])  # CellNetwork checks all its rules
        done += 1
        change = net.sides - before
        assert sorted(change[change != 0].tolist()) == [-1, -1, 1, 1]
        before = net.sides
        assert int(net.charges.sum()) == total
        assert net.sides.min() >= 3
    assert net.euler_characteristic == EULER[name.split()[0]]
    assert (net.n_vertices, net.n_films) == (NETWORKS[name].n_vertices, NETWORKS[name].n_films)


@each_network
def test_charges_add_up_after_sweeps_of_many_t1s_at_once(name):
    net = NETWORKS[name]
    total, made = int(net.charges.sum()), 0
    rng = np.random.default_rng(2)
    for _ in range(150):
        films = may_turn(net)
        sites = t1_sites(net, films)
        chosen = films[independent(sites.bubbles, rng.random(len(films)))]
        before = net.sides
        one_by_one = net
        net = rewire(net, chosen)
        made += len(chosen)
        assert int(net.charges.sum()) == total
        four = t1_sites(one_by_one, chosen).bubbles
        np.testing.assert_array_equal((net.sides - before)[four], np.tile([-1, -1, 1, 1], (len(chosen), 1)))
        if made < 200:
            for film in rng.permutation(chosen):  # in any order, one by one, it is the same
                one_by_one = rewire(one_by_one, [film])
            assert same(one_by_one, net)
    assert made > 400


def test_networks_are_not_changed_by_their_t1s():
    net = NETWORKS["sphere of 60"]
    before = [np.array(a) for a in (net.next, net.origin, net.bubble)]
    rewire(net, may_turn(net)[:1])
    for was, now in zip(before, (net.next, net.origin, net.bubble), strict=True):
        np.testing.assert_array_equal(was, now)


# ---------------------------------------------------------------------------- choosing


@each_network
def test_chosen_sites_share_no_bubble_and_one_is_always_chosen(name):
    net = NETWORKS[name]
    rng = np.random.default_rng(3)
    for count in (1, 2, 5, 40, net.n_films):
        films = rng.choice(net.n_films, count, replace=False)
        sites = t1_sites(net, films)
        for priority in (rng.random(count), np.zeros(count), rng.integers(0, 3, count) * 1.0):
            chosen = independent(sites.bubbles, priority)
            assert chosen.shape == (count,)
            assert chosen.any()
            assert chosen[np.argmax(priority)] or (priority == priority.max()).sum() > 1
            distinct = [set(four.tolist()) for four in sites.bubbles[chosen]]
            assert sum(map(len, distinct)) == len(set().union(*distinct))


def test_nothing_to_choose_from():
    net = NETWORKS["torus of 60"]
    assert independent(t1_sites(net, np.zeros(0, dtype=int)).bubbles, np.zeros(0)).shape == (0,)


def test_no_site_left_out_is_better_than_all_its_rivals():
    net = NETWORKS["torus of 160"]
    rng = np.random.default_rng(4)
    films = rng.choice(net.n_films, 100, replace=False)
    sites, priority = t1_sites(net, films), rng.random(100)
    chosen = independent(sites.bubbles, priority)
    for i in np.flatnonzero(~chosen):
        rivals = np.isin(sites.bubbles, sites.bubbles[i]).any(axis=1)
        assert priority[rivals].max() > priority[i]


# ---------------------------------------------------------------------------- refusals


def test_three_sided_bubbles_lose_nothing():
    tetrahedron = network_from_loops([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])
    assert may_turn(tetrahedron).size == 0
    for film in range(6):
        with pytest.raises(TopologyError, match=f"film {film} cannot turn.*at least four sides"):
            rewire(tetrahedron, [film])
    prism3 = network_from_loops(prism(3))
    # only films between two of the 4-sided bubbles may turn, and their ends lie on the triangles
    assert (prism3.sides[np.stack([prism3.left, prism3.right])[:, may_turn(prism3)]] == 4).all()
    assert len(may_turn(prism3)) == 3


def test_a_cube_turns_into_two_triangles_and_two_pentagons_and_so_on():
    cube = network_from_loops(prism(4))
    assert len(may_turn(cube)) == 12
    for film in range(12):
        assert sorted(rewire(cube, [film]).sides.tolist()) == [3, 3, 4, 4, 5, 5]


def test_markers_do_not_turn():
    lens = CellNetwork([2, 3, 0, 1], [0, 1, 1, 0], [0, 1, 0, 1])
    for film in (0, 1):
        with pytest.raises(TopologyError, match=rf"film {film} cannot turn.*threefold"):
            rewire(lens, [film])
    # a cube with a marker on one film: its two parts may not turn, the rest may
    loops = [
        [
            v
            for i, v in enumerate(ring)
            for v in ([v, 8] if (v, ring[(i + 1) % len(ring)]) in ((0, 1), (1, 0)) else [v])
        ]
        for ring in prism(4)
    ]
    net = network_from_loops(loops)
    assert net.markers.tolist() == [8]
    at_marker = np.flatnonzero((net.tails == 8) | (net.heads == 8))
    assert len(at_marker) == 2
    assert sorted(set(range(13)) - set(may_turn(net).tolist())) == at_marker.tolist()
    for film in at_marker:
        with pytest.raises(TopologyError, match="cannot turn"):
            rewire(net, [film])


def bricks(rows, columns):
    """Loops of bricks on a torus, as in `io_foams.torus_foam`, without coordinates."""
    corner = lambda i, j: (i % rows) * 2 * columns + j % (2 * columns)  # noqa: E731
    loops = []
    for i in range(rows):
        for k in range(columns):
            j = 2 * k + i % 2
            above = [corner(i + 1, j + s) for s in (0, 1, 2)]
            loops.append([corner(i, j + s) for s in (0, 1, 2)] + above[::-1])
    return loops


def test_a_film_whose_ends_meet_the_same_bubble_does_not_turn():
    """Two rows of bricks round a tube: a brick above is the brick below as well."""
    net = network_from_loops(bricks(2, 5))
    assert net.sides.tolist() == [6] * 10
    assert net.euler_characteristic == 0
    four = every_site(net).bubbles
    twice = four[:, 2] == four[:, 3]
    assert twice.sum() == 10  # the uprights
    for film in np.flatnonzero(twice):
        with pytest.raises(TopologyError, match="four bubbles must differ"):
            rewire(net, [film])
    assert not twice[may_turn(net)].any()


def test_a_lens_and_the_film_beside_it():
    """Of a foam of two lenses and two bubbles only the films that join the lenses may turn."""
    net = network_from_loops([(1, 0, 4), (2, 3, 5), (0, 1, 3, 2), (1, 4, 0, 2, 5, 3)])
    assert net.sides.tolist() == [2, 2, 4, 4]
    films = may_turn(net)
    assert {frozenset((int(net.left[f]), int(net.right[f]))) for f in films} == {frozenset((2, 3))}
    for film in films:
        assert rewire(net, [film]).sides.tolist() == [3, 3, 3, 3]


def test_bubbles_that_are_no_disks_take_part():
    """An exterior may gain or lose a film whatever its Euler number and its sides."""
    net = NETWORKS["torus of 60"]
    euler = np.array(net.bubble_euler)
    # declare two bubbles something else; the sum, and with it the surface, does not matter here
    euler[0] = -1
    other = CellNetwork(net.next, net.origin, net.bubble, euler)
    assert np.array_equal(may_turn(net), may_turn(other))
    films = may_turn(other)
    near = films[(every_site(net).bubbles[films] == 0).any(axis=1)]
    assert near.size > 0
    for film in near:
        after = rewire(other, [film])
        assert after.euler_characteristic == other.euler_characteristic
        assert after.bubble_euler.tolist() == euler.tolist()
        assert np.bincount(after.bubble[after.loops.halves[after.loops.starts]])[0] == 1


def test_t1s_that_share_a_bubble_are_made_one_after_the_other():
    net = NETWORKS["torus of 60"]
    films = may_turn(net)
    first = films[0]
    four = t1_sites(net, films).bubbles
    near = films[np.isin(four, four[0]).any(axis=1)]
    for other in (*near[1:4], first):
        with pytest.raises(TopologyError, match="share a bubble; make them one after the other"):
            rewire(net, [first, other])


@pytest.mark.parametrize(
    ("films", "fault", "message"),
    [
        ([-1], ValueError, "films must be at least 0 and below 180"),
        ([180], ValueError, "films must be at least 0 and below 180"),
        ([1.0], TypeError, "films must hold integers"),
        ([True], TypeError, "films must hold integers"),
        (3, ValueError, "films must have shape"),
        ([[3]], ValueError, "films must have shape"),
        (None, TypeError, "films must hold integers"),
    ],
)
def test_films_that_are_none(films, fault, message):
    with pytest.raises(fault, match=message):
        rewire(NETWORKS["torus of 60"], films)


def test_no_t1s_at_all():
    net = NETWORKS["torus of 60"]
    assert same(rewire(net, np.zeros(0, dtype=int)), net)
