"""Circuits round bubbles, pairs and transport: theorems of the parts that `defects` is made of."""

from __future__ import annotations

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.analysis.circuits import BASIS, circuits
from warpedfoam.analysis.defects import _filled
from warpedfoam.analysis.frames import transported
from warpedfoam.analysis.pairing import pair_charges
from warpedfoam.moves.t1 import rewire

from .nets import spherical_voronoi_foam
from .planted import SIZE, honeycomb, laid_out, slip


def test_rims_are_walked_by_gauss_bonnet() -> None:
    """Left turns less right turns round a disk are 6 − Q; any region of 6-sided bubbles closes."""
    foam = honeycomb(SIZE, SIZE)
    rng = np.random.default_rng(4)
    network = rewire(foam.network, [60])
    for _ in range(30):
        labels = np.full(foam.n_bubbles, -1)
        labels[rng.integers(foam.n_bubbles)] = 0
        for _ in range(rng.integers(1, 40)):
            rim = np.flatnonzero((labels[network.left] >= 0) != (labels[network.right] >= 0))
            film = rng.choice(rim)
            labels[[network.left[film], network.right[film]]] = 0
        walk = circuits(network, labels, 1)
        charge = int(network.charges[labels == 0].sum())
        assert walk.charge.tolist() == [charge]
        assert walk.turning.tolist() == [6 * int(walk.euler[0]) - charge]
        if walk.disk[0] and not network.charges[labels == 0].any():
            assert walk.advance.tolist() == [[0, 0]]
            assert walk.hexagons.tolist() == [int((labels == 0).sum())]


def test_translation_does_not_depend_on_the_walk() -> None:
    """Any disk that holds one dislocation and no other charge advances by the same length."""
    foam = slip(6)
    network = foam.network
    found = wf.defects(foam)
    rng = np.random.default_rng(5)
    start = found.cluster_of == 0
    checked = 0
    for _ in range(40):
        labels = np.where(start, 0, -1)
        for _ in range(rng.integers(1, 12)):
            rim = np.flatnonzero((labels[network.left] >= 0) != (labels[network.right] >= 0))
            film = rng.choice(rim)
            pair = np.array([network.left[film], network.right[film]])
            if not network.charges[pair[labels[pair] < 0]].any():
                labels[pair] = 0
        walk = circuits(network, labels, 1)
        if walk.closed[0]:
            length = abs(walk.advance[0] @ BASIS) / np.sqrt(3.0)
            assert length == pytest.approx(1.0, abs=1e-12)
            checked += 1
    assert checked > 20


def test_holes_without_charge_are_filled() -> None:
    """Against the definition spelt out with graphs, on honeycombs with random T1s."""
    import networkx as nx

    foam = honeycomb(SIZE, SIZE)
    rng = np.random.default_rng(1)
    filled = 0
    for _ in range(12):
        network = foam.network
        for film in rng.integers(network.n_films, size=25):
            if network.sides[[network.left[film], network.right[film]]].min() > 4:
                network = rewire(network, [int(film)])
        charges = network.charges
        found = wf.defects(laid_out(foam.cell, network, foam.bubble_centres))
        cluster, count = found.cluster_of, len(found.clusters.size)
        region = _filled(network, cluster, count, charges)
        plain = nx.Graph(zip(network.left.tolist(), network.right.tolist(), strict=True))
        calm = plain.subgraph(np.flatnonzero(charges == 0).tolist())
        sea = max(nx.connected_components(calm), key=len)
        expected = cluster.copy()
        for grain in nx.connected_components(calm):
            beside = {int(cluster[j]) for i in grain for j in plain[i]} - {-1}
            labels = np.full(foam.n_bubbles, -1)
            labels[list(grain)] = 0
            if len(grain) < len(sea) and len(beside) == 1 and circuits(network, labels, 1).disk[0]:
                expected[list(grain)] = beside.pop()
                filled += 1
        np.testing.assert_array_equal(region, expected)
    assert filled > 5


def test_direction_of_burgers_vectors_by_hand() -> None:
    """Each film of the rim turned to the tangent plane by scipy's rotations, on a sphere of few bubbles."""
    from scipy.spatial.transform import Rotation

    foam = spherical_voronoi_foam(wf.HeleShawCell(wf.Sphere(1.0), 0.01), wf.Sphere(1.0).random_points(60, 3))
    network = foam.network
    pairs = wf.defects(foam).dislocations
    rows = np.flatnonzero(pairs.transported & (pairs.multiplicity == 1))
    assert len(rows) >= 3
    for row in rows:
        labels = np.full(foam.n_bubbles, -1)
        labels[[pairs.positive[row], pairs.negative[row]]] = 0
        walk = circuits(network, labels, 1)
        top = pairs.position[row]
        e1 = np.cross(top, [0.3, 0.5, 0.8])
        e1 /= np.linalg.norm(e1)
        e2 = np.cross(top, e1)
        overlap = 0.0
        for half, turns in zip(walk.halves, walk.direction, strict=True):
            start, end = foam.vertex_points[[network.origin[half], network.origin[half ^ 1]]]
            middle = (start + end) / np.linalg.norm(start + end)
            axis = np.cross(middle, top)
            angle = np.arctan2(np.linalg.norm(axis), middle @ top)
            turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
            film = turn.apply(end - start)
            overlap += complex(film @ e1, film @ e2) * np.exp(-1j * np.pi / 3 * turns)
        b = -(walk.advance[0] @ BASIS) / np.sqrt(3.0) * overlap / abs(overlap)
        np.testing.assert_allclose(b.real * e1 + b.imag * e2, pairs.burgers[row], atol=1e-9)


def test_matching_is_maximal() -> None:
    """As many pairs as networkx finds, for unit and for larger charges."""
    import networkx as nx

    cell = wf.HeleShawCell(wf.Sphere(1.0), gap=0.01)
    for seed in range(3):
        foam = wf.voronoi_foam(cell, 120, seed=seed)
        q = foam.network.charges
        _, counts = pair_charges(foam.network, q, foam.film_lengths)
        flow = nx.DiGraph()
        for i, charge in enumerate(q.tolist()):
            if charge > 0:
                flow.add_edge("s", i, capacity=charge)
            if charge < 0:
                flow.add_edge(i, "t", capacity=-charge)
        for a, b in zip(foam.network.left.tolist(), foam.network.right.tolist(), strict=True):
            for x, y in ((a, b), (b, a)):
                if q[x] > 0 > q[y]:
                    flow.add_edge(x, y)
        assert int(counts.sum()) == nx.maximum_flow_value(flow, "s", "t")


def test_transport_along_great_circles_is_exact() -> None:
    """Round a spherical triangle a vector turns by its area."""
    rng = np.random.default_rng(0)
    a, b, c = rng.standard_normal((3, 50, 3))
    a, b, c = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (a, b, c))
    vector = np.cross(a, rng.standard_normal((50, 3)))
    vector /= np.linalg.norm(vector, axis=1, keepdims=True)
    moved = transported(transported(transported(vector, a, b), b, c), c, a)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 1.0, rtol=1e-12)
    angle = np.arctan2(
        np.einsum("nx,nx->n", a, np.cross(vector, moved)), np.einsum("nx,nx->n", vector, moved)
    )
    triple = np.einsum("nx,nx->n", a, np.cross(b, c))
    sums = 1 + np.einsum("nx,nx->n", a, b) + np.einsum("nx,nx->n", b, c) + np.einsum("nx,nx->n", c, a)
    area = 2.0 * np.arctan2(triple, sums)
    np.testing.assert_allclose(np.exp(1j * angle), np.exp(1j * area), atol=1e-9)
