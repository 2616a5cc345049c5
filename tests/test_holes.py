"""Holes closed between their nodes: whatever was cut out, a surface is back, and a flat one exactly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpedfoam import Sphere
from warpedfoam.errors import MeshError
from warpedfoam.surfaces import TriangleMesh, mesh_report, repaired
from warpedfoam.surfaces.holes import MOST_EDGES, closed_holes


def without(mesh, gone):
    """The mesh without some triangles and the nodes that only they have."""
    kept, triangles = np.unique(mesh.triangles[~gone], return_inverse=True)
    return TriangleMesh(mesh.nodes[kept], triangles.reshape(-1, 3))


def plate(n=12):
    """A flat grid of 2 n² triangles on the square (0, 1)²."""
    x = np.linspace(0.0, 1.0, n + 1)
    nodes = np.stack([*np.meshgrid(x, x, indexing="ij"), np.zeros((n + 1, n + 1))], axis=-1).reshape(-1, 3)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    b, c, d = a + n + 1, a + n + 2, a + 1
    return TriangleMesh(nodes, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


SHAPES = {
    "square": lambda x, y: (abs(x - 0.5) < 0.2) & (abs(y - 0.5) < 0.2),
    "L": lambda x, y: ((x - 0.2) * (x - 0.8) < 0) & ((y - 0.2) * (y - 0.8) < 0) & ((x < 0.45) | (y < 0.45)),
    "U": lambda x, y: (
        ((x - 0.2) * (x - 0.8) < 0) & ((y - 0.2) * (y - 0.8) < 0) & ~((abs(x - 0.5) < 0.1) & (y > 0.4))
    ),
    "round": lambda x, y: np.hypot(x - 0.5, y - 0.5) < 0.3,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_flat_holes_are_filled_without_a_fold(shape):
    """The area comes back exactly, also where the hole is not convex: every triangle faces the same way."""
    mesh = plate()
    # by whole squares
    x, y, _ = (np.floor(12.0 * mesh.nodes[mesh.triangles].mean(axis=1).T) + 0.5) / 12.0
    cut = without(mesh, SHAPES[shape](x, y))
    cut.require_surface()
    assert len(cut.rim_loops) == 2
    closed, count = closed_holes(cut, 44)
    assert count == 1
    closed.require_surface()
    assert closed.area == pytest.approx(1.0, abs=1e-12)
    assert closed.n_nodes == cut.n_nodes
    assert len(closed.rim_loops) == 1


@pytest.mark.parametrize("width", [0.03, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3])
def test_holes_of_a_ball(width):
    """χ is 2 again, and the loss of area goes as the fourth power of the hole's width."""
    ball = Sphere(1.0).triangulate(2000)
    start = ball.nodes[ball.triangles[77]].mean(axis=0)
    there = ball.nodes[ball.triangles].mean(axis=1)
    cut = without(ball, np.linalg.norm(there - start, axis=1) < width)
    cut.require_surface()
    assert len(cut.rim_loops) == 1
    n = len(cut.rim_loops[0])
    closed, count = closed_holes(cut, n)
    assert count == 1
    closed.require_surface(closed=True)
    assert closed.euler_characteristic == 2
    assert closed.n_triangles == cut.n_triangles + n - 2
    assert -1e-12 < ball.area - closed.area < np.pi / 4 * width**4 + 1e-3 * width
    assert closed_holes(cut, n - 1) == (cut, 0)


def test_neither_place_size_nor_names_matter():
    ball = Sphere(1.0).triangulate(500)
    cut = without(ball, (ball.triangles == 40).any(axis=1))
    rng = np.random.default_rng(3)
    order = rng.permutation(cut.n_nodes)
    turn = Rotation.random(rng=rng).as_matrix()
    moved = TriangleMesh(1e6 * (cut.nodes @ turn.T + 3.0)[order], np.argsort(order)[cut.triangles])
    there = order[closed_holes(moved, 9)[0].triangles[cut.n_triangles :]]
    here = closed_holes(cut, 9)[0].triangles[cut.n_triangles :]
    assert {frozenset(t) for t in there.tolist()} == {frozenset(t) for t in here.tolist()}


def test_no_edge_gets_a_third_triangle():
    """Two triangles share the shorter chord of the loop round them: the hole below takes the other."""
    nodes = [[-2.0, 0.0, 0.0], [0.0, -0.3, 0.1], [2.0, 0.0, 0.0], [0.0, 0.3, 0.1]]
    mesh = TriangleMesh(nodes, [[0, 1, 3], [3, 1, 2]])
    closed, count = closed_holes(mesh, 4)
    assert count == 1
    closed.require_surface(closed=True)


def test_only_as_many_edges_as_asked_for():
    ball = Sphere(1.0).triangulate(500)
    cut = without(ball, (ball.triangles == 40).any(axis=1))
    assert mesh_report(repaired(cut)[0]).rims == 1
    mended, done = repaired(cut, hole_edges=MOST_EDGES)
    assert done == ("closed 1 hole",)
    assert mesh_report(mended).sound
    for wrong in (3, MOST_EDGES + 1, 5.5, True, None):
        with pytest.raises((TypeError, ValueError), match="hole_edges"):
            repaired(cut, hole_edges=wrong)
    with pytest.raises(MeshError, match="nothing is left"):
        repaired(TriangleMesh(ball.nodes, [[0, 0, 1]]), hole_edges=9)
