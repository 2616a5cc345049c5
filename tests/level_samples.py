"""Members of the family of `LevelSurface`, with what is known of each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from warpedfoam import (
    Catenoid,
    Cylinder,
    Ellipsoid,
    FlatTorus,
    Foam,
    Graph,
    HeleShawCell,
    Implicit,
    MeshSurface,
    Revolution,
    SchwarzP,
    Sphere,
    Torus,
    relax,
    voronoi_foam,
)

RING, TUBE = 3.0, 1.0


def ring_level(x):
    """A torus of radii 3 and 1."""
    return (np.hypot(x[:, 0], x[:, 1]) - RING) ** 2 + x[:, 2] ** 2 - TUBE**2


def ring_gradient(x):
    q = np.hypot(x[:, 0], x[:, 1])
    share = 2.0 * (q - RING) / q
    return np.stack([share * x[:, 0], share * x[:, 1], 2.0 * x[:, 2]], axis=1)


def hill_height(x):
    """A landscape of periods 8 and 6."""
    u, v = 2 * np.pi * x.T / [[8.0], [6.0]]
    return 0.5 * np.cos(u) + 0.4 * np.sin(v) + 0.2 * np.cos(u - v)


def hill_slope(x):
    a, b = 2 * np.pi / 8.0, 2 * np.pi / 6.0
    u, v = a * x[:, 0], b * x[:, 1]
    by_u = -0.5 * np.sin(u) - 0.2 * np.sin(u - v)
    by_v = 0.4 * np.cos(v) + 0.2 * np.sin(u - v)
    return np.stack([a * by_u, b * by_v], axis=1)


def vase_square(z):
    """Squared radius of a body with a waist."""
    return (1 - z**2 / 9) * (1 + z**2 / 3)


def vase_slope(z):
    return -2 * z / 9 * (1 + z**2 / 3) + (1 - z**2 / 9) * 2 * z / 3


RING_BOX = [[-4.6, -4.6, -1.6], [4.6, 4.6, 1.6]]


def jittered(surface, n_nodes, share=0.2, seed=0):
    """Nodes of a triangulation pushed about by a share of an edge, back on the surface; triangles."""
    mesh = surface.triangulate(n_nodes)
    push = np.random.default_rng(seed).uniform(-1.0, 1.0, mesh.nodes.shape)
    return surface.project(mesh.nodes + share * mesh.mean_edge * push), mesh.triangles


@dataclass(frozen=True)
class Member:
    """A surface; its formula twin, if any; χ, symmetries, relative error of its reconstruction."""

    surface: object
    twin: object
    euler: int
    symmetries: int
    error: float

    @property
    def rim_turning(self):
        """∮ κ_g ds along all rims, corners included."""
        rim = self.surface.rim
        if rim is None:
            return 0.0
        loops = np.arange(rim.n_loops)
        return float(rim.turning(loops, np.zeros(len(loops)), rim.lengths).sum())


def frustum():
    """A bowl of a mesh: the lower part of a spheroid, its rim's nodes shaken along the rim."""
    bowl = Revolution(lambda z: 4.0 * (1.0 - z**2 / 9.0), lambda z: -8.0 * z / 9.0, -3.0, 1.0)
    mesh = bowl.triangulate(2500)
    rng = np.random.default_rng(0)
    nodes = mesh.nodes + 0.2 * mesh.mean_edge * rng.uniform(-1.0, 1.0, mesh.nodes.shape)
    at = np.unique(mesh.rim_edges)
    nodes = bowl.project(nodes)
    nodes[at] = bowl.rim.slide(mesh.nodes[at], 0.2 * mesh.mean_edge * rng.uniform(-1.0, 1.0, len(at)))
    return MeshSurface(nodes, mesh.triangles), bowl


SHELL, BOWL = frustum()
FAMILY = {
    "ball": Member(Ellipsoid(1.0, 1.0, 1.0), Sphere(1.0), 2, 3, 1e-12),
    "egg": Member(Ellipsoid(1.0, 1.2, 1.5), None, 2, 0, 1e-12),
    "disk": Member(Ellipsoid(3.0, 3.0, 2.0), None, 2, 1, 1e-12),
    "ring": Member(Implicit(ring_level, ring_gradient, RING_BOX), Torus(RING, TUBE), 0, 1, 1e-8),
    "vase": Member(Revolution(vase_square, vase_slope, -3.0, 3.0), None, 2, 1, 1e-9),
    "sheet": Member(FlatTorus(10.0, 8.0), None, 0, 2, 1e-12),
    "tube": Member(Cylinder(1.5, 8.0, periodic=True), None, 0, 2, 1e-12),
    "hills": Member(Graph(hill_height, hill_slope, 8.0, 6.0, periodic=True), None, 0, 0, 1e-8),
    "crystal": Member(SchwarzP(6.0), None, -4, 0, 1e-12),
    "mesh": Member(MeshSurface(*jittered(Torus(RING, TUBE), 3000)), Torus(RING, TUBE), 0, 1, 2e-3),
    "pipe": Member(Cylinder(1.5, 4.0), None, 0, 1, 1e-12),
    "waist": Member(Catenoid(1.0, 2.0), None, 0, 1, 1e-9),
    "bowl": Member(BOWL, None, 1, 1, 1e-9),
    "funnel": Member(Revolution(vase_square, vase_slope, -2.0, 2.5), None, 0, 1, 1e-9),
    "patch": Member(Graph(hill_height, hill_slope, 5.0, 4.0), None, 1, 0, 1e-8),
    "plate": Member(Graph(hill_height, hill_slope, 5.0, 5.0, disk=True), None, 1, 0, 1e-8),
    "shell": Member(SHELL, BOWL, 1, 1, 2e-3),
}

#: Bubbles that resolve the narrow ones.
COUNTS = {
    "vase": 200,
    "ring": 240,
    "mesh": 160,
    "crystal": 200,
    "tube": 240,
    "hills": 240,
    "patch": 140,
    "plate": 60,
    "waist": 240,
    "bowl": 240,
    "funnel": 240,
}

each_member = pytest.mark.parametrize("member", FAMILY.values(), ids=FAMILY)
formulas = pytest.mark.parametrize(
    "member",
    [m for m in FAMILY.values() if m.error < 1e-6],
    ids=[k for k, m in FAMILY.items() if m.error < 1e-6],
)
twins = pytest.mark.parametrize(
    "member", [m for m in FAMILY.values() if m.twin is not None], ids=[k for k, m in FAMILY.items() if m.twin]
)


@cache
def relaxed_on(name, order=4, gap=0.05):
    """A relaxed foam on a member of the family; others than the plainest start from that one."""
    cell = HeleShawCell(FAMILY[name].surface, gap=gap)
    if (order, gap) == (4, 0.05):
        n_bubbles = COUNTS.get(name, 80)
        return relax(voronoi_foam(cell, n_bubbles, seeds="blue", seed=2, order=order))
    plain = relaxed_on(name).foam.with_order(order)
    targets = plain.target_volumes * (cell.volume / plain.cell.volume)
    return relax(Foam(cell, plain.network, plain.vertex_points, plain.film_offsets, targets))
