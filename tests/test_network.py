"""Cell networks: every rule broken once, polyhedra, Euler's formula, the dual and the film graph."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import FrozenInstanceError

import networkx as nx
import numpy as np
import pytest

from warpedfoam import CellNetwork, TopologyError, network_from_loops

from .io_foams import bubble_on_torus, sphere_foam, torus_foam


def prism(n):
    """Counter-clockwise faces of the n-sided prism seen from outside: bottom, top, sides."""
    low, high = list(range(n)), list(range(n, 2 * n))
    sides = [[i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n)]
    return [low[::-1], high, *sides]


def dodecahedron():
    """Faces of the dodecahedron as the duals of the icosahedron's corners."""
    from scipy.spatial import ConvexHull

    g = (1 + 5**0.5) / 2
    corners = np.array([np.roll([0, a, b * g], k) for k in range(3) for a in (-1, 1) for b in (-1, 1)])
    hull = ConvexHull(corners)
    faces = []
    for k, corner in enumerate(corners):
        around = np.flatnonzero((hull.simplices == k).any(axis=1))
        middles = corners[hull.simplices[around]].mean(axis=1)
        right = np.cross(corner, middles[0])
        angle = np.arctan2((middles - corner) @ right, (middles - corner) @ np.cross(right, corner))
        faces.append(around[np.argsort(angle)].tolist())
    return faces


TETRAHEDRON = [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]
POLYHEDRA = {
    "tetrahedron": (TETRAHEDRON, [3] * 4),
    "cube": (prism(4), [4] * 6),
    "dodecahedron": (dodecahedron(), [5] * 12),
    **{f"prism {n}": (prism(n), [n, n] + [4] * n) for n in (3, 5, 6, 7, 30)},
}
LENS = {"next": [2, 3, 0, 1], "origin": [0, 1, 1, 0], "bubble": [0, 1, 0, 1]}
THREE_LUNES = [(0, 2, 1, 3), (0, 3, 1, 4), (0, 4, 1, 2)]  # meridians, each with a marker


@pytest.fixture(params=POLYHEDRA)
def polyhedron(request):
    loops, sides = POLYHEDRA[request.param]
    return network_from_loops(loops), loops, sides


# ---------------------------------------------------------------------------- from loops


def test_polyhedra_have_their_sides_and_euler_number_two(polyhedron):
    net, loops, sides = polyhedron
    assert net.n_bubbles == len(loops)
    assert net.sides.tolist() == sides
    assert net.charges.tolist() == [6 - n for n in sides]
    assert net.charges.sum() == 12
    assert net.euler_characteristic == 2
    assert net.n_vertices == 2 * (net.n_bubbles - 2)
    assert net.n_films == 3 * (net.n_bubbles - 2)
    assert net.vertex_degrees.tolist() == [3] * net.n_vertices
    assert net.markers.size == 0


def test_loops_come_back_as_they_were_given(polyhedron):
    net, loops, _ = polyhedron
    found = net.loops
    assert net.bubble[found.halves[found.starts]].tolist() == list(range(len(loops)))
    for start, size, ring in zip(found.starts, found.sizes, loops, strict=True):
        walked = net.origin[found.halves[start : start + size]].tolist()
        k = list(ring).index(walked[0])
        assert walked == list(ring[k:]) + list(ring[:k])


def test_two_halves_of_a_film_run_against_each_other(polyhedron):
    net, _, _ = polyhedron
    half = np.arange(2 * net.n_films)
    np.testing.assert_array_equal(net.origin[half ^ 1], net.origin[net.next[half]])
    np.testing.assert_array_equal(net.tails, net.origin[0::2])
    np.testing.assert_array_equal(net.heads, net.origin[net.next[0::2]])
    np.testing.assert_array_equal(net.left, net.bubble[0::2])
    np.testing.assert_array_equal(net.right, net.bubble[1::2])
    assert (net.left != net.right).all()


def test_three_lunes_and_two_hemispheres_have_markers():
    lunes = network_from_loops(THREE_LUNES)
    assert (lunes.n_vertices, lunes.n_films, lunes.n_bubbles) == (5, 6, 3)
    assert lunes.markers.tolist() == [2, 3, 4]
    assert lunes.sides.tolist() == [2, 2, 2]  # markers are no corners
    assert lunes.charges.sum() == 12
    halves = network_from_loops([(0, 1, 2), (2, 1, 0)])
    assert halves.sides.tolist() == [0, 0]
    assert halves.markers.tolist() == [0, 1, 2]
    for net in (lunes, halves):
        assert net.euler_characteristic == 2


@pytest.mark.parametrize("foam", [sphere_foam(60), sphere_foam(200, seed=3), torus_foam(), torus_foam(8, 10)])
def test_foams_have_the_euler_number_of_their_surface(foam):
    net, chi = foam.network, foam.cell.surface.euler_characteristic
    assert net.euler_characteristic == chi
    assert net.charges.sum() == 6 * chi
    assert net.n_vertices == 2 * (net.n_bubbles - chi)
    assert net.n_films == 3 * (net.n_bubbles - chi)
    assert net.sides.sum() == 2 * net.n_films


def test_an_exterior_that_is_no_disk_counts_with_its_own_number():
    net = bubble_on_torus().network
    assert net.bubble_euler.tolist() == [1, -1]
    assert net.euler_characteristic == 0


@pytest.mark.parametrize(
    ("loops", "message"),
    [
        ([], "loops is empty"),
        ([(0, 1, 2)], "from vertex . to . has a bubble on one side only"),
        (TETRAHEDRON[:3], "one side only"),
        ([TETRAHEDRON[0][::-1], *TETRAHEDRON[1:]], "two loops run from vertex . to .; orient all"),
        ([*TETRAHEDRON, TETRAHEDRON[0]], "two loops run from"),
        ([(0, 1), (1, 0), (0,)], r"loops\[2\] needs at least 2 vertices, got 1"),
        ([(0, 1), (1, 0), ()], r"loops\[2\]"),
        ([(0, 2, 4), (4, 2, 0)], "vertex 1 has 0 films"),  # numbers left out
    ],
)
def test_loops_that_close_no_surface(loops, message):
    with pytest.raises((TopologyError, TypeError), match=message):
        network_from_loops(loops)


@pytest.mark.parametrize(
    ("loops", "fault", "message"),
    [
        ([(0, 1, -1), (-1, 1, 0)], ValueError, r"loops\[0\] must be at least 0"),
        ([(0, 1.5, 2)], TypeError, r"loops\[0\] must hold integers"),
        (["abc"], TypeError, r"loops\[0\] must hold integers"),
        ([[[0, 1, 2]]], ValueError, r"loops\[0\] must have shape"),
    ],
)
def test_loops_that_are_none(loops, fault, message):
    with pytest.raises(fault, match=message):
        network_from_loops(loops)


# ---------------------------------------------------------------------------- every rule broken once


def broken(name, changes, loops=TETRAHEDRON):
    net = network_from_loops(loops)
    arrays = {k: np.array(getattr(net, k)) for k in ("next", "origin", "bubble")}
    for place, value in changes.items():
        arrays[name][place] = value
    return arrays


def swapped_next(net, i, j):
    following = np.array(net.next)
    following[[i, j]] = following[[j, i]]
    return following


def test_half_films_come_in_pairs():
    with pytest.raises(TopologyError, match="even number of half-films above 0, got 3"):
        CellNetwork([0, 1, 2], [0, 0, 0], [0, 0, 0])
    with pytest.raises(TopologyError, match="above 0, got 0"):
        CellNetwork(*(np.zeros(0, dtype=int) for _ in range(3)))


@pytest.mark.parametrize("value", [5, 11, 12, 999])
def test_next_is_a_permutation(value):
    arrays = broken("next", {0: value})
    if arrays["next"].tolist() == network_from_loops(TETRAHEDRON).next.tolist():
        arrays["next"][0] = 0
    with pytest.raises(TopologyError, match="next must be a permutation of the half-films"):
        CellNetwork(**arrays)


def test_next_stays_on_its_bubble():
    net = network_from_loops(TETRAHEDRON)
    # two half-films of different bubbles that end in the same vertex swap what follows
    ends = net.origin[np.arange(12) ^ 1]
    i = 0
    j = next(h for h in range(1, 12) if ends[h] == ends[i] and net.bubble[h] != net.bubble[i])
    with pytest.raises(TopologyError, match=r"half-film \d+ and its next lie on different bubbles"):
        CellNetwork(swapped_next(net, i, j), net.origin, net.bubble)
    renamed = np.array(net.bubble)
    renamed[3] = (renamed[3] + 1) % 4
    with pytest.raises(TopologyError, match="different bubbles"):
        CellNetwork(net.next, net.origin, renamed)


def test_next_starts_where_its_half_film_ends():
    net = network_from_loops(TETRAHEDRON)
    origin = np.array(net.origin)
    origin[4] = (origin[4] + 1) % 4
    with pytest.raises(TopologyError, match=r"half-film \d+ does not end where its next begins"):
        CellNetwork(net.next, origin, net.bubble)


def test_two_or_three_films_meet():
    # four lunes: two vertices where four films meet
    lunes = [(0, 2, 1, 3), (0, 3, 1, 4), (0, 4, 1, 5), (0, 5, 1, 2)]
    with pytest.raises(TopologyError, match="vertex 0 has 4 films; three must meet, two at a marker"):
        network_from_loops(lunes)
    net = network_from_loops(TETRAHEDRON)
    with pytest.raises(TopologyError, match="vertex 3 has 0 films"):  # a number that is left out
        CellNetwork(net.next, np.where(net.origin == 3, 4, net.origin), net.bubble)
    with pytest.raises(TopologyError, match="comes back to vertex"):  # both its ends loose
        CellNetwork([1, 0], [0, 1], [0, 0])


def test_films_at_a_vertex_form_one_fan():
    # two films with loose ends, numbered as if they met there
    with pytest.raises(TopologyError, match="the films at vertex 0 do not form one fan"):
        CellNetwork([1, 0, 3, 2], [0, 1, 0, 1], [0, 0, 1, 1])


def test_bubbles_have_films_and_numbers_without_gaps():
    net = network_from_loops(TETRAHEDRON)
    with pytest.raises(TopologyError, match="bubble 3 has no films"):
        CellNetwork(net.next, net.origin, np.where(net.bubble == 3, 4, net.bubble))
    with pytest.raises(TopologyError, match="bubble 4 has no films"):
        CellNetwork(net.next, net.origin, net.bubble, [1, 1, 1, 1, 1])
    with pytest.raises(TopologyError, match="bubble names bubble 3, but there are 3"):
        CellNetwork(net.next, net.origin, net.bubble, [1, 1, 1])


def test_a_disk_has_one_boundary():
    net = network_from_loops(TETRAHEDRON)
    both = np.concatenate([net.next, net.next + 12]), np.concatenate([net.origin, net.origin + 4])
    # two tetrahedra far apart: one bubble of each is the same annulus
    bubble = np.concatenate([net.bubble, np.where(net.bubble == 0, 0, net.bubble + 3)])
    with pytest.raises(TopologyError, match="bubble 0 is said to be a disk but has 2 boundary loops"):
        CellNetwork(*both, bubble)
    annulus = CellNetwork(*both, bubble, [0, 1, 1, 1, 1, 1, 1])
    assert annulus.euler_characteristic == 2


@pytest.mark.parametrize(
    ("change", "fault", "message"),
    [
        ({"next": [2, 3, 0]}, ValueError, "origin must have shape"),
        ({"origin": [0, 1]}, ValueError, r"origin must have shape \(4,\), got \(2,\)"),
        ({"bubble": [[0, 1], [0, 1]]}, ValueError, "bubble must have shape"),
        ({"next": [2.0, 3.0, 0.0, 1.0]}, TypeError, "next must hold integers"),
        ({"origin": [0, 1, 1, -1]}, ValueError, "origin must be at least 0"),
        ({"bubble": [0, -1, 0, -1]}, ValueError, "bubble must be at least 0"),
        ({"next": "abcd"}, TypeError, "next must hold integers"),
        ({"next": [[2, 3], [0]]}, ValueError, "next must be a rectangular"),
        ({"next": None}, TypeError, "next must hold integers"),
        ({"bubble_euler": [1.0, 1.0]}, TypeError, "bubble_euler must be"),
        ({"bubble_euler": 1}, TypeError, "bubble_euler must be"),
    ],
)
def test_arrays_that_are_none(change, fault, message):
    with pytest.raises(fault, match=message):
        CellNetwork(**{**LENS, **change})


HUGE = """
import resource
resource.setrlimit(resource.RLIMIT_AS, (4 * 2**30, 4 * 2**30))
from warpedfoam import CellNetwork, TopologyError, network_from_loops
try:
    {call}
except (TopologyError, ValueError) as fault:
    print(fault)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits the memory of a process")
@pytest.mark.parametrize(
    "call",
    [
        "CellNetwork([10**11, 0], [0, 1], [0, 1])",
        "CellNetwork([2, 3, 0, 1], [0, 10**11, 10**11, 0], [0, 1, 0, 1])",
        "CellNetwork([2, 3, 0, 1], [0, 1, 1, 0], [0, 10**11, 0, 10**11])",
        "network_from_loops([(0, 1, 10**11), (10**11, 1, 0)])",
    ],
)
def test_huge_numbers_are_refused_before_memory_is_asked_for(call):
    done = subprocess.run([sys.executable, "-c", HUGE.format(call=call)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-300:]
    assert done.stdout


# ---------------------------------------------------------------------------- values that stay


def test_networks_cannot_be_changed(polyhedron):
    net, _, _ = polyhedron
    for name in (
        "next",
        "origin",
        "bubble",
        "bubble_euler",
        "sides",
        "charges",
        "vertex_degrees",
        "outgoing",
    ):
        with pytest.raises(ValueError, match="read-only"):
            getattr(net, name)[0] = 0
    for array in (net.tails, net.left, net.loops.halves, net.loops.starts):
        assert not array.flags.writeable
    with pytest.raises(FrozenInstanceError):
        net.next = net.next


def test_networks_keep_their_own_arrays():
    arrays = {k: np.array(v) for k, v in LENS.items()}
    net = CellNetwork(**arrays)
    for array in arrays.values():
        array[:] = 0
    assert net.next.tolist() == LENS["next"]
    assert net.origin.tolist() == LENS["origin"]
    assert net.bubble.tolist() == LENS["bubble"]


def test_networks_do_not_share_memory_with_writable_arrays():
    owned = np.array(LENS["origin"])
    view = owned.view()
    view.flags.writeable = False
    net = CellNetwork(LENS["next"], view, LENS["bubble"])
    owned[:] = 0
    assert net.origin.tolist() == LENS["origin"]


# ---------------------------------------------------------------------------- round a vertex


@pytest.mark.parametrize("foam", [sphere_foam(80), torus_foam()])
def test_outgoing_half_films_are_counter_clockwise(foam):
    net, surface = foam.network, foam.cell.surface
    out = net.outgoing
    assert out.shape == (net.n_vertices, 3)
    assert sorted(out.ravel().tolist()) == list(range(2 * net.n_films))
    here = net.origin[out]
    assert (here == here[:, :1]).all()
    # the bubble left of one is right of the next
    np.testing.assert_array_equal(net.bubble[out], net.bubble[np.roll(out, -1, axis=1) ^ 1])
    x = foam.vertex_points
    n = surface.normals(x[here[:, 0]])
    e1 = surface.vertex_frames(x[here[:, 0]])[:, 0]
    along = x[net.origin[out ^ 1]] - x[here]
    angle = np.arctan2(np.einsum("vka,va->vk", along, np.cross(n, e1)), np.einsum("vka,va->vk", along, e1))
    turns = np.mod(np.roll(angle, -1, axis=1) - angle, 2 * np.pi)
    np.testing.assert_allclose(turns.sum(axis=1), 2 * np.pi, atol=1e-9)  # once round, not twice


def test_outgoing_leaves_markers_out():
    out = network_from_loops(THREE_LUNES).outgoing
    assert out.shape == (2, 3)
    assert CellNetwork(**LENS).outgoing.shape == (0, 3)


# ---------------------------------------------------------------------------- graphs


def test_the_dual_of_a_polyhedron_is_its_graph_of_neighbours(polyhedron):
    net, loops, sides = polyhedron
    graph = net.to_networkx()
    assert isinstance(graph, nx.MultiGraph)
    assert [n for _, n in sorted(graph.degree())] == sides
    assert [graph.nodes[i]["sides"] for i in range(len(loops))] == sides
    assert [graph.nodes[i]["charge"] for i in range(len(loops))] == [6 - n for n in sides]
    assert {frozenset((a, b)) for a, b in graph.edges()} == {
        frozenset((i, j))
        for i, one in enumerate(loops)
        for j, two in enumerate(loops)
        if i < j and len(set(one) & set(two)) == 2
    }
    assert {(f, data["film"]) for *_, f, data in graph.edges(keys=True, data=True)} == {
        (f, f) for f in range(net.n_films)
    }
    assert all(type(v) is int for _, data in graph.nodes(data=True) for v in data.values())


def test_the_dual_of_a_dodecahedron_is_an_icosahedron():
    graph = nx.Graph(network_from_loops(dodecahedron()).to_networkx())
    assert nx.is_isomorphic(graph, nx.icosahedral_graph())
    films = nx.Graph(network_from_loops(dodecahedron()).film_graph())
    assert nx.is_isomorphic(films, nx.dodecahedral_graph())


def test_two_bubbles_may_share_two_films():
    """A 2-sided bubble in the middle of a film: its neighbours meet on both sides of it."""
    loops = [(0, 1), (1, 0, 2, 3), (0, 1, 3, 2)]
    # films 0–1 twice would be ambiguous: put a marker on one of them
    loops = [(0, 1, 4), (1, 0, 2, 5, 3), (0, 4, 1, 3, 6, 2), (3, 5, 2, 6)]
    net = network_from_loops(loops)
    graph = net.to_networkx()
    assert net.sides[0] == 2
    assert graph.number_of_edges(1, 2) == 2
    keys = list(graph[1][2])
    assert [{int(net.left[k]), int(net.right[k])} for k in keys] == [{1, 2}, {1, 2}]
    assert net.charges.sum() == 12


def test_markers_split_a_film_in_two_edges_of_the_dual():
    net = CellNetwork(**LENS)
    assert net.to_networkx().number_of_edges(0, 1) == 2
    assert net.film_graph().number_of_edges(0, 1) == 2


def test_the_film_graph_has_vertices_films_and_the_bubbles_beside_them(polyhedron):
    net, _, _ = polyhedron
    graph = net.film_graph()
    assert graph.number_of_nodes() == net.n_vertices
    assert graph.number_of_edges() == net.n_films
    assert {d for _, d in graph.degree()} == {3}
    assert all(data["degree"] == 3 for _, data in graph.nodes(data=True))
    for a, b, f, data in graph.edges(keys=True, data=True):
        assert data == {"film": f, "left": net.left[f], "right": net.right[f]}
        assert {a, b} == {net.tails[f], net.heads[f]}


def test_graphs_of_foams_are_planar_on_the_sphere_and_not_on_the_torus():
    assert nx.check_planarity(nx.Graph(sphere_foam(60).network.film_graph()))[0]
    assert not nx.check_planarity(nx.Graph(torus_foam().network.film_graph()))[0]


def test_graphs_can_be_written_as_graphml(tmp_path):
    net = network_from_loops(TETRAHEDRON)
    for graph in (net.to_networkx(), net.film_graph(), sphere_foam(20).to_networkx()):
        nx.write_graphml(graph, tmp_path / "net.graphml")
        again = nx.read_graphml(tmp_path / "net.graphml", node_type=int, force_multigraph=True)
        assert again.number_of_edges() == graph.number_of_edges()
