"""The Newton matrix against dense linear algebra: inertia, steps, the reduced Hessian at a minimum."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

import warpedfoam as wf
from warpedfoam.energy import film_terms
from warpedfoam.relax.kkt import KKT
from warpedfoam.relax.linear import SuperLU
from warpedfoam.relax.system import State, System, pinned_unknowns

CELLS = {
    "sphere": wf.HeleShawCell(wf.Sphere(1.0), gap=0.05),
    "torus": wf.HeleShawCell(wf.Torus(20.0, 4.0), gap=0.5),
}


def lagrangian(foam: wf.Foam, pressures: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Dense gradient and Hessian of E − Σ p V, and volume gradients B, by all vertices and offsets."""
    net, n_inner = foam.network, foam.order - 1
    terms = film_terms(
        foam.cell, net, foam.vertex_points, foam.film_offsets, tension=foam.tension, pressures=pressures
    )
    assert terms.hessian is not None
    size = 2 * net.n_vertices + n_inner * net.n_films
    places = np.concatenate(
        [
            np.stack([2 * net.tails, 2 * net.tails + 1, 2 * net.heads, 2 * net.heads + 1]),
            2 * net.n_vertices + np.arange(n_inner)[:, None] + n_inner * np.arange(net.n_films),
        ]
    )
    hessian, gradient = np.zeros((size, size)), np.zeros(size)
    volumes = np.zeros((size, net.n_bubbles))
    jump = pressures[net.left] - pressures[net.right]
    np.add.at(hessian, (places[:, None], places[None]), terms.hessian)
    np.add.at(gradient, places, foam.tension * terms.gradient - jump * terms.volume)
    np.add.at(volumes, (places, np.broadcast_to(net.left, places.shape)), terms.volume)
    np.add.at(volumes, (places, np.broadcast_to(net.right, places.shape)), -terms.volume)
    return gradient, hessian, volumes


@pytest.mark.parametrize(("name", "n_rigid"), [("sphere", 3), ("torus", 1)])
def test_reduced_hessian_at_a_minimum(name: str, n_rigid: int) -> None:
    """On displacements that keep all volumes the Hessian is positive, but for the rigid motions."""
    result = wf.relax(wf.voronoi_foam(CELLS[name], 90, seeds="blue", seed=1))
    assert result.converged
    foam = result.foam
    gradient, hessian, volumes = lagrangian(foam, result.pressures)
    unit = foam.tension * foam.cell.gap
    assert np.abs(gradient).max() / unit < 1e-10 * foam.bubble_size + 1e-10
    assert np.abs(hessian - hessian.T).max() < 1e-10 * np.abs(hessian).max()
    # one volume depends on the others: the gradients have rank N − 1
    free = scipy.linalg.null_space(volumes.T, rcond=1e-10)
    assert free.shape[1] == len(hessian) - (foam.n_bubbles - 1)
    values = np.linalg.eigvalsh(free.T @ hessian @ free) / unit * foam.bubble_size
    assert np.abs(values[:n_rigid]).max() < 1e-7
    assert values[n_rigid] > 1e-5


@pytest.mark.parametrize("name", sorted(CELLS))
def test_inertia_and_step_against_dense(name: str) -> None:
    """Signs of SuperLU's pivots count the eigenvalues; the condensed step solves the whole system."""
    foam = wf.voronoi_foam(CELLS[name], 60, seed=2)
    rng = np.random.default_rng(0)
    bubbles = foam.n_bubbles
    system = System(foam.cell, foam.target_volumes, 4, SuperLU(), bubbles)
    seen = set()
    for wiggle, shift in ((0.0, 0.0), (0.0, 0.3), (0.3, 1e-3), (0.6, 1e-2), (0.0, -2.0)):
        offsets = foam.film_offsets + wiggle * rng.standard_normal(foam.film_offsets.shape)
        pressures = rng.standard_normal(bubbles)
        state = State(foam.network, foam.vertex_points, offsets, pressures)
        lin = system.linearise(state)
        vertex = np.full(2 * foam.network.n_vertices, shift)
        vertex[pinned_unknowns(foam.cell, state)] += 1.0
        pressure = np.full(bubbles, 1e-3)
        kkt = KKT(lin, lin.condensed(positive=False), vertex, pressure)
        dense = kkt._matrix.toarray()
        assert np.abs(dense - dense.T).max() < 1e-12 * np.abs(dense).max()
        assert kkt.n_negative == (np.linalg.eigvalsh(dense) < 0.0).sum()
        seen.add(kkt.n_negative)

        moved = wf.Foam(foam.cell, foam.network, foam.vertex_points, offsets, foam.target_volumes)
        physical = pressures * foam.tension * system.film_unit / system.mean_volume
        gradient, hessian, volumes = lagrangian(moved, physical)
        scale = np.ones(len(gradient))
        scale[: len(vertex)] = system.length
        hessian = hessian * scale[:, None] * scale / system.film_unit
        hessian[np.arange(len(vertex)), np.arange(len(vertex))] += vertex
        matrix = np.block(
            [
                [hessian, -volumes * scale[:, None] / system.mean_volume],
                [-volumes.T * scale / system.mean_volume, -np.diag(pressure)],
            ]
        )
        fault = rng.standard_normal(bubbles)
        whole = np.linalg.solve(matrix, np.concatenate([-gradient * scale / system.film_unit, fault]))
        step = kkt.step(fault)
        parts = np.concatenate([step.vertices.ravel(), step.offsets.ravel(), step.pressures])
        assert np.abs(parts - whole).max() < 1e-7 * np.abs(whole).max()
    assert len(seen) > 1, "the cases must differ in inertia"


def test_symmetric_start_leaves_its_saddle() -> None:
    """A lattice of 40 bubbles on the torus relaxes first to a symmetric saddle, then off it."""
    foam = wf.voronoi_foam(CELLS["torus"], 40, seeds="lattice")
    result = wf.relax(foam)
    assert result.converged, result.message
    again = wf.relax(
        wf.Foam(foam.cell, result.foam.network, result.foam.vertex_points, result.foam.film_offsets)
    )
    assert again.energy == pytest.approx(result.energy, rel=1e-12)


def test_slipped_film_is_reported() -> None:
    """Too few bubbles: a film grows half way round the tube, the volumes stop adding up, the run says so."""
    result = wf.relax(wf.voronoi_foam(CELLS["torus"], 60, seed=1), max_iterations=300)
    assert not result.converged
    assert "use more bubbles" in result.message
