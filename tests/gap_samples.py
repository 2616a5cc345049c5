"""Plates, gaps that vary over them, and relaxed foams in between, for the tests of gaps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

import warpedfoam as wf

RING = wf.Torus(3.0, 1.0)
BALL = wf.Sphere(1.0)


def flat_plate(side=20.0):
    """A square of the plane."""
    return wf.Graph(lambda x: np.zeros(len(x)), lambda x: np.zeros((len(x), 2)), side, side)


PLATE = flat_plate()


def shaken_ball():
    mesh = BALL.triangulate(800)
    push = np.random.default_rng(0).uniform(-1.0, 1.0, mesh.nodes.shape)
    return wf.MeshSurface(BALL.project(mesh.nodes + 0.1 * mesh.mean_edge * push), mesh.triangles)


@dataclass(frozen=True)
class Case:
    """A plate, the gap's shape of mean about 1 as a plain function, and a number of bubbles."""

    surface: object
    shape: object
    n_bubbles: int

    def cell(self, gap=0.05, n_heights=2):
        return wf.HeleShawCell(self.surface, lambda x: gap * self.shape(x), n_heights)


def waves(x):
    return 1.0 + 0.1 * x[:, 0] + 0.1 * np.sin(x[:, 1] + 0.5 * x[:, 2])


CASES = {
    "sphere": Case(BALL, lambda x: 1.0 + 0.3 * x[:, 0] + 0.1 * np.sin(2.0 * x[:, 2]), 40),
    "torus": Case(RING, waves, 160),
    "plane": Case(PLATE, lambda x: 1.0 + 0.03 * x[:, 0] + 0.05 * np.cos(0.3 * x[:, 1]), 30),
    "egg": Case(wf.Ellipsoid(1.0, 1.2, 1.5), waves, 40),
    "sheet": Case(
        wf.FlatTorus(10.0, 8.0),
        lambda x: 1.0 + 0.2 * np.sin(0.2 * np.pi * x[:, 0]) + 0.1 * np.cos(0.25 * np.pi * x[:, 1]),
        40,
    ),
}
each_case = pytest.mark.parametrize("name", CASES)


@cache
def cell_of(name, gap=0.05):
    return CASES[name].cell(gap)


@cache
def relaxed_in(name, order=4, gap=0.05):
    """A relaxed foam of a case."""
    start = wf.voronoi_foam(cell_of(name, gap), CASES[name].n_bubbles, seeds="blue", seed=3, order=order)
    return wf.relax(start)


@cache
def mesh_cell(gap=0.05):
    return wf.HeleShawCell(shaken_ball(), lambda x: gap * CASES["sphere"].shape(x))
