"""From the labels of a mesh to a network: regions, their films, islands and corners."""

from __future__ import annotations

import numpy as np
import pytest

from warpedfoam import Foam, HeleShawCell, ResolutionError, Sphere, network_from_loops
from warpedfoam.tessellate.regions import corner_weights, region_network, tidy_labels
from warpedfoam.tessellate.seeds import lattice_seeds

SPHERE = Sphere(1.0)


def test_labels_of_a_mesh_become_a_network():
    mesh = SPHERE.triangulate(642)
    corners = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]) / 3**0.5
    labels = np.argmax(mesh.nodes @ corners.T, axis=1)
    found = region_network(mesh, labels, 4)
    expected = network_from_loops([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])
    assert found.network.sides.tolist() == expected.sides.tolist()
    assert found.network.n_films == 6
    assert len(found.corners) == found.network.n_vertices == 4
    for vertex, triangle in enumerate(found.corners):
        at = np.flatnonzero(found.network.origin == vertex)
        assert set(found.network.bubble[at].tolist()) == set(labels[mesh.triangles[triangle]].tolist())
    a, b = labels[found.crossings].T
    assert (a != b).all()
    beside = np.sort(np.stack([found.network.left, found.network.right], axis=1), axis=1)[found.film]
    np.testing.assert_array_equal(beside, np.sort(np.stack([a, b], axis=1), axis=1))


def test_vertices_lie_to_the_left_of_nothing_but_their_bubbles():
    """Orientation: the region's nodes are on the left of its half-films."""
    mesh = SPHERE.triangulate(2562)
    seeds = lattice_seeds(SPHERE, 20)
    labels = np.argmax(mesh.nodes @ seeds.T, axis=1)
    found = region_network(mesh, labels, 20)
    points = SPHERE.project(mesh.nodes[mesh.triangles[found.corners]].mean(axis=1))
    foam = Foam(HeleShawCell(SPHERE, 0.01), found.network, points)
    rough = np.bincount(labels, mesh.node_areas, minlength=20)
    np.testing.assert_allclose(foam.bubble_areas, rough, rtol=0.1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("empty", "1 of 5 bubbles own no mesh node"),
        ("island", "would not be disks"),
        ("ring", "would not be disks"),
    ],
)
def test_labels_that_are_no_disks(change, message):
    mesh = SPHERE.triangulate(642)
    corners = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]) / 3**0.5
    labels = np.argmax(mesh.nodes @ corners.T, axis=1)
    count = 4
    if change == "empty":
        count = 5
    elif change == "island":
        labels[np.argmax(mesh.nodes @ corners[0])] = 1
    else:
        labels = np.digitize(mesh.nodes[:, 2], [-0.5, 0.0, 0.5])
    with pytest.raises(ResolutionError, match=message):
        region_network(mesh, labels, count)


def test_islands_go_to_their_neighbours_and_lost_regions_come_home():
    mesh = SPHERE.triangulate(642)
    seeds = lattice_seeds(SPHERE, 12)
    clean = np.argmax(mesh.nodes @ seeds.T, axis=1)
    homes = np.argmax(seeds @ mesh.nodes.T, axis=1)
    np.testing.assert_array_equal(tidy_labels(mesh, clean, homes), clean)
    dirty = clean.copy()
    inside = [v for v in homes if v != homes[3]]
    dirty[inside[:4]] = 3  # four islands of region 3 in the middle of others
    np.testing.assert_array_equal(tidy_labels(mesh, dirty, homes), clean)
    lost = clean.copy()
    lost[clean == 5] = clean[
        mesh.edges[(clean[mesh.edges[:, 0]] == 5) & (clean[mesh.edges[:, 1]] != 5)][0, 1]
    ]
    found = tidy_labels(mesh, lost, homes)
    assert np.flatnonzero(found == 5).tolist() == [homes[5]]


def test_corners_of_linear_fields_are_found_exactly():
    """Three fields d² that are linear over a triangle meet where the weights say."""
    rng = np.random.default_rng(0)
    inner = rng.dirichlet([4.0, 4.0, 4.0], 50)
    inner = inner[inner.min(axis=1) > 0.06]
    squares = rng.uniform(1.0, 2.0, (len(inner), 3, 3))  # at node i, to region j
    here = np.einsum("mi,mij->mj", inner, squares)
    squares += (here.mean(axis=1, keepdims=True) - here)[:, None, :]  # equal at ``inner``
    found = corner_weights(squares, np.ones(len(inner), dtype=bool))
    np.testing.assert_allclose(found, inner, atol=1e-9)
    unknown = corner_weights(squares, np.zeros(len(inner), dtype=bool))
    np.testing.assert_allclose(unknown, 1 / 3)
    outside = corner_weights(rng.uniform(1, 2, (200, 3, 3)), np.ones(200, dtype=bool))
    assert (outside > 0).all()
    np.testing.assert_allclose(outside.sum(axis=1), 1.0)
