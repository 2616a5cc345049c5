"""Clusters with motions that cost next to nothing: along cylinders, on ellipsoids, round their centre."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.relax.mixing import MEMORY, Mixing
from warpedfoam.relax.system import State, Step, rigid_modes

TUBE = wf.HeleShawCell(wf.Cylinder(radius=3.0, height=12.0), gap=0.2)
EGG = wf.HeleShawCell(wf.Ellipsoid(4.0, 3.0, 3.5), gap=0.2)


def modes_of(foam: wf.Foam) -> np.ndarray:
    state = State(foam.network, foam.vertex_points, foam.film_offsets, np.zeros(foam.n_bubbles))
    return rigid_modes(foam.cell, state)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_a_cluster_rests_anywhere_along_a_cylinder(n: int) -> None:
    """To the solver's precision in a few steps, where it was put, with the same energy; turned as well."""
    found = []
    for angle, z in ((0.0, 0.3), (2.0, -3.0)):
        at = [3.0 * np.cos(angle), 3.0 * np.sin(angle), z]
        relaxed = wf.relax(wf.cluster_foam(TUBE, n, volumes=0.2, centre=at, order=6))
        assert relaxed.converged, relaxed.message
        assert relaxed.iterations <= 25
        assert abs(relaxed.foam.bubble_centres[:n, 2].mean() - z) < 0.3
        found.append(relaxed.energy)
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_what_touches_no_rim_takes_no_notice_of_it() -> None:
    """Round the axis and along it; films that end on a rim hold a foam in its place."""
    free = wf.cluster_foam(TUBE, 3, volumes=0.2, centre=[3.0, 0.0, 0.3])
    assert len(modes_of(free)) == 2
    assert len(modes_of(wf.cluster_foam(TUBE, [3, 1], volumes=0.2, centre=[[3.0, 0, 1], [-3.0, 0, 1]]))) == 4
    full = wf.voronoi_foam(TUBE, 30, seed=1)
    assert len(full.network.rim_vertices)
    assert len(modes_of(full)) == 1
    # a gap that widens along the axis leaves the turn, one that widens round it the way along
    for wedge, kept in (
        (lambda x: 0.2 + 0.01 * x[:, 2], [0.0, 1.0, 0.0]),
        (lambda x: 0.2 + 0.01 * x[:, 0], [0.0, 0.0, 1.0]),
    ):
        cell = wf.HeleShawCell(wf.Cylinder(radius=3.0, height=12.0), gap=wedge)
        velocity = cell.free_motions(np.array([[3.0, 0.0, 0.0]]))[:, 0]
        assert len(velocity) == 1
        np.testing.assert_allclose(np.abs(velocity[0] / np.linalg.norm(velocity[0])), kept, atol=1e-9)


@pytest.mark.parametrize("n", [1, 3, 7])
def test_clusters_find_the_sharp_end_of_an_ellipsoid(n: int) -> None:
    """Derivatives there are right to the gap only; the cluster's turn is much softer than that."""
    found = wf.relax(wf.cluster_foam(EGG, n, volumes=0.2, centre=[1.0, 2.0, 2.5], order=6))
    assert found.converged, found.message
    assert found.iterations <= 120
    centre = found.foam.bubble_centres[:n].mean(axis=0)
    assert np.abs(centre[1:]).max() < 0.01
    assert centre[0] > 3.7
    # turned by half a turn it is the same foam
    flip = np.array([-1.0, -1.0, 1.0])
    other = wf.relax(wf.cluster_foam(EGG, n, volumes=0.2, centre=flip * [1.0, 2.0, 2.5], order=6))
    assert other.energy == pytest.approx(found.energy, rel=1e-8)


def test_mixing_solves_linear_problems_exactly() -> None:
    """Steps −A x with k soft directions vanish after k + 2 of them, where plain ones creep."""
    foam = wf.cluster_foam(TUBE, 1, volumes=0.2, centre=[3.0, 0.0, 0.3], order=4)
    rng = np.random.default_rng(3)
    shape = foam.film_offsets.shape
    goal, rates = rng.standard_normal(shape), np.ones(shape)
    rates[0, 0], rates[1, 1] = 1e-3, 0.02
    still = np.zeros((foam.network.n_vertices, 2))
    for mixes in (True, False):
        mixing, offsets = Mixing(), np.zeros(shape)
        for _ in range(MEMORY + 2):
            state = State(foam.network, foam.vertex_points, offsets, np.zeros(2))
            plain = Step(still, rates * (goal - offsets), np.zeros(2))
            step = mixing.mixed(TUBE, 1.0, state, plain, 1e-6) if mixes else plain
            offsets = offsets + step.offsets
        left = np.abs(offsets - goal).max()
        assert left < 1e-9 if mixes else left > 0.1


def test_mixing_forgets() -> None:
    """After a change of topology, far from rest, or when things get worse, the plain step is made."""
    foam = wf.cluster_foam(TUBE, 1, volumes=0.2, centre=[3.0, 0.0, 0.3], order=4)
    state = State(foam.network, foam.vertex_points, foam.film_offsets, np.zeros(2))
    rng = np.random.default_rng(0)

    def plain() -> Step:
        steps = 1e-3 * rng.standard_normal((foam.network.n_vertices, 2))
        return Step(steps, np.zeros_like(foam.film_offsets), np.zeros(2))

    other = replace(state, network=wf.add_markers(foam, [0]).network)
    for then, force in ((other, 1e-6), (state, 1e-3), (state, 1e-4)):
        mixing, first, second = Mixing(), plain(), plain()
        assert mixing.mixed(TUBE, 1.0, state, first, 1e-6) is first
        step = mixing.mixed(TUBE, 1.0, state, second, 1e-6)
        assert step is not second
        if then is state:
            last = plain()
            assert mixing.mixed(TUBE, 1.0, then, last, force) is last
