"""Clusters that go far: markers follow, Newton's method stays quadratic, soft steps have a reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.energy import film_terms
from warpedfoam.foam import bubble_integrals
from warpedfoam.relax.following import Following
from warpedfoam.relax.held import held_vertices, moved_points
from warpedfoam.relax.reach import FAR, NEAR, next_reach, stiffer, turned_parts, which_way
from warpedfoam.relax.system import State, Step

SHEET = wf.HeleShawCell(wf.FlatTorus(20.0, 20.0), gap=1.0)
TORUS = wf.HeleShawCell(wf.Torus(20.0, 4.0), gap=0.5)


def state_of(foam: wf.Foam) -> State:
    return State(foam.network, foam.vertex_points, foam.film_offsets, np.zeros(foam.n_bubbles))


def following_of(foam: wf.Foam) -> Following:
    held = held_vertices(foam.cell.surface, foam.network, foam.vertex_points, foam.film_offsets)
    assert held is not None
    return Following(held, foam.network)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_markers_go_with_a_bubble_that_moves_as_a_whole(n: int) -> None:
    foam = wf.relax(wf.cluster_foam(SHEET, n, volumes=0.5, centre=[0.0, 0.0, 0.0], order=6)).foam
    follow = following_of(foam)
    frames = SHEET.surface.vertex_frames(foam.vertex_points)
    for way in ([1.0, 0.0, 0.0], [0.6, -0.8, 0.0]):
        steps = np.einsum("vix,x->vi", frames, way).ravel()
        # what forces would do: markers across their film only
        again = follow.expanded(follow.forces(steps))
        assert np.abs(again - steps).max() < 3e-3
    # without following they are left behind
    assert np.abs(follow.free @ follow.forces(steps) - steps).max() > 0.3


@pytest.mark.parametrize("n", [1, 3])
def test_the_matrix_is_the_second_derivative_along_steps_that_follow(n: int) -> None:
    """Differences of E − Σ p V along random free steps, markers sliding as they do."""
    at = TORUS.surface.points(np.array([0.0]), np.zeros(1))[0]
    foam = wf.relax(wf.cluster_foam(TORUS, n, volumes=0.5, centre=at, order=8)).foam
    network, surface = foam.network, TORUS.surface
    terms = film_terms(
        TORUS, network, foam.vertex_points, foam.film_offsets, tension=1.0, pressures=foam.pressures
    )
    follow, rng = following_of(foam), np.random.default_rng(5)
    for _ in range(3):
        free = rng.standard_normal(2 * network.n_vertices)
        free[follow.idle] = 0.0
        vertices = 0.1 * follow.expanded(free).reshape(-1, 2)
        offsets = 0.1 * rng.standard_normal(foam.film_offsets.shape)
        step = np.concatenate([vertices[network.tails].T, vertices[network.heads].T, offsets.T])

        def lagrangian(s: float, vertices=vertices, offsets=offsets) -> float:
            points = moved_points(surface, network, foam.vertex_points, s * vertices)
            u = foam.film_offsets + s * offsets
            area = surface.arc_measure(points[network.tails], points[network.heads], u, TORUS.layer).sum()
            return float(area - foam.pressures @ bubble_integrals(TORUS, network, points, u, TORUS.layer))

        h = 0.008
        f = [lagrangian(k * h) for k in range(-3, 4)]
        bend = np.dot(f, [2, -27, 270, -490, 270, -27, 2]) / (180 * h**2)
        assert np.einsum("if,ijf,jf->", step, terms.hessian, step) == pytest.approx(bend, rel=1e-5)


def far_from_home(n: int, order: int = 6) -> wf.Foam:
    """Near the inner equator; home is the outer one."""
    at = TORUS.surface.points(np.array([0.9 * np.pi]), np.array([0.3]))[0]
    return wf.cluster_foam(TORUS, n, volumes=0.5, centre=at, order=order)


@pytest.mark.parametrize(("n", "most"), [(1, 40), (7, 60), (19, 60)])
def test_newtons_method_is_quadratic_on_a_torus(n: int, most: int) -> None:
    """Half way round the tube in few steps, and the last of them square what is left."""
    found = wf.relax(far_from_home(n))
    assert found.converged, found.message
    assert found.iterations <= most
    near = found.history.residual[-3:]
    assert near[-1] < 1e-10
    # a linear rate would need many steps below a millionth
    assert (found.history.residual[found.history.residual < 1e-6].size) <= 6
    centre = found.foam.bubble_centres[:n].mean(axis=0)
    assert abs(TORUS.surface.angles(centre[None])[0][0]) < 1e-3


def test_where_a_cluster_comes_from_makes_no_difference() -> None:
    """Markers end where they may, the energy does not tell."""
    near = TORUS.surface.points(np.array([0.3]), np.array([2.0]))[0]
    one = wf.relax(far_from_home(7, order=10))
    other = wf.relax(wf.cluster_foam(TORUS, 7, volumes=0.5, centre=near, order=10))
    assert one.converged
    assert other.converged
    assert one.energy == pytest.approx(other.energy, rel=1e-11)
    chords = one.foam.film_lengths / one.foam.bubble_size
    assert chords.min() > 0.5


def test_a_turn_is_a_turn() -> None:
    """On a sheet steps ω J r, however long, only turn a cluster; another far away stays."""
    foam = wf.relax(
        wf.cluster_foam(SHEET, [7, 2], volumes=0.5, centre=[[9.0, 9.0, 0.0], [0.0, 0.0, 0.0]], order=6)
    ).foam
    state, length = state_of(foam), foam.bubble_size
    mine = np.zeros(foam.network.n_vertices, dtype=bool)
    films = (foam.network.left < 7) | (foam.network.right < 7)
    mine[foam.network.tails[films]] = mine[foam.network.heads[films]] = True
    centre = foam.vertex_points[mine].mean(axis=0)
    arm = np.where(mine[:, None], foam.vertex_points - centre, 0.0)
    for angle in (0.1, 0.7):
        tangent = np.cross([0.0, 0.0, angle], arm) / length
        frames = SHEET.surface.vertex_frames(foam.vertex_points)
        step = Step(np.einsum("vix,vx->vi", frames, tangent), np.zeros_like(foam.film_offsets), np.zeros(10))
        turned = turned_parts(SHEET, state, step, length)
        points = moved_points(SHEET.surface, foam.network, foam.vertex_points, length * turned.vertices)
        after = replace(foam, vertex_points=points)
        assert after.energy == pytest.approx(foam.energy, rel=1e-12)
        np.testing.assert_allclose(after.bubble_volumes[:9], foam.bubble_volumes[:9], rtol=1e-11)
        went = np.linalg.norm(points - foam.vertex_points, axis=1)
        assert went[~mine].max() < 1e-13
        assert went[mine] == pytest.approx(2.0 * np.sin(0.5 * angle) * np.linalg.norm(arm[mine], axis=1))


def test_shifts_that_make_a_step_as_long() -> None:
    """With one soft motion, |step| = g/(k + σ), the second shift is right."""
    for stiffness in (0.0, 1e-6, 1e-4, 1e-2):

        def size(shift: float, k: float = stiffness) -> float:
            return 0.01 / (k + shift)

        seen = [(1e-7, 1.0 / size(1e-7))]
        for _ in range(2):
            shift = stiffer(seen, 0.2)
            seen.append((shift, 1.0 / size(shift)))
        # never less than a tenth stiffer than before
        assert 0.2 / 1.1 - 1e-6 < size(shift) < 0.2 + 1e-6


def test_the_reach_grows_in_calm_and_shrinks_in_rough() -> None:
    reach = NEAR
    for _ in range(10):
        reach = next_reach(reach, 1e-4)
    assert reach == FAR
    assert next_reach(reach, 0.01) == reach
    for _ in range(10):
        reach = next_reach(reach, 0.1)
    assert reach == NEAR


def test_which_way_down_does_not_hang_on_names() -> None:
    foam = wf.cluster_foam(TORUS, 3, volumes=0.5, centre=[30.0, 0.0, 0.0])
    rng = np.random.default_rng(2)
    mode, order = rng.standard_normal((foam.network.n_vertices, 2)), rng.permutation(foam.network.n_vertices)
    way = which_way(TORUS, state_of(foam), mode)
    assert which_way(TORUS, state_of(foam), -mode) == -way
    other = State(foam.network, foam.vertex_points[order], foam.film_offsets, np.zeros(4))
    assert which_way(TORUS, other, mode[order]) == way


@pytest.mark.parametrize("seed", range(4))
def test_random_clusters_need_few_steps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    volumes = 0.5 * np.exp(0.3 * rng.normal(size=20))
    foam = wf.cluster_foam(
        TORUS, 20, volumes=volumes, layout="random", seed=seed, order=6, centre=[24.0, 0.0, 0.0]
    )
    found = wf.relax(foam)
    assert found.converged, found.message
    assert found.iterations <= 60
