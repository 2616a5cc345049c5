"""Newton's method for one bubble whose place is held: volume and centroid are constraints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.lateral_film import (
    FilmGrid,
    film_area,
    film_hessian,
    region_moments,
    region_points,
)
from warpedfoam.studies.chart import Chart, Coordinates, Nodes, OutOfChart

#: Newton steps, and the largest change of a radius in one of them, in mean radii.
MOST_STEPS, LONGEST = 40, 0.25
#: Least share of a step that is tried where the whole of it leads off the surface.
LEAST_SHARE = 0.05
#: Force in units of γ d and relative errors of the constraints at which the method stops.
TIGHT = 1e-12
#: A run that stops improving counts if it came as far as this, or to this many times the round-off of places
#: through a thin gap: ε size ρ / d².
TOLERANCE, ROUNDING = 1e-9, 4.0


@dataclass(frozen=True, eq=False)
class HeldBubble:
    """What is solved: a chart, a grid, a volume, and coordinates whose means stay zero."""

    chart: Chart
    grid: FilmGrid
    volume: float
    coordinates: Coordinates

    @property
    def radius(self) -> float:
        """sqrt(V / (π d))."""
        return float(np.sqrt(self.volume / (np.pi * self.grid.heights[-1])))

    @property
    def tolerance(self) -> float:
        """Residual and fault of a bubble at rest."""
        gap, size = float(self.grid.heights[-1]), self.chart.surface.size
        return max(TOLERANCE, ROUNDING * float(np.finfo(float).eps) * size * self.radius / gap**2)

    def state(self, radii: Floats) -> State:
        """Energy, constraints and their derivatives at the radii (n_free, m)."""
        grid = self.grid
        nodes = self.chart.nodes(grid, radii[grid.owner])
        film = nodes.points[-1]
        energy, force = film_area(grid, film)
        at = region_points(grid, nodes.points)
        values, slopes = self.coordinates(at.reshape(-1, 3))
        shape = at.shape[:-1]
        densities = np.concatenate([np.ones((1, *shape)), values.reshape(2, *shape)])
        gradients = np.concatenate([np.zeros((1, *shape, 3)), slopes.reshape(2, *shape, 3)])
        moments, nodal = region_moments(grid, nodes.points, densities, gradients)
        scaled = grid.scales[:, None, None, None] * nodes.moves
        return State(
            radii,
            nodes,
            energy,
            self._freed(np.einsum("kjx,kjx->kj", nodes.moves[-1], force)),
            moments,
            np.stack([self._freed(g) for g in np.einsum("ikjx,cikjx->ckj", scaled, nodal)]),
            densities[:, -1],
            gradients[:, -1],
        )

    def _freed(self, by_layer: Floats) -> Floats:
        """Sum of the layers that move together, flat."""
        out = np.zeros((self.grid.n_free, by_layer.shape[1]))
        np.add.at(out, self.grid.owner, by_layer)
        return out.ravel()

    def hessian(self, state: State, multipliers: Floats) -> Floats:
        """Second derivatives of E − Σ multipliers · moments by the free radii."""
        nodes, grid = state.nodes, self.grid
        whole = film_hessian(
            grid,
            nodes.points[-1],
            nodes.moves[-1],
            nodes.normals,
            nodes.bends,
            np.tensordot(multipliers, state.densities, 1),
            np.tensordot(multipliers, state.slopes, 1),
        )
        count = len(grid.angles)
        blocks = whole.reshape(len(grid.owner), count, len(grid.owner), count)
        out = np.zeros((grid.n_free, count, grid.n_free, count))
        for a, to_a in enumerate(grid.owner):
            for b, to_b in enumerate(grid.owner):
                out[to_a, :, to_b] += blocks[a, :, b]
        n = grid.n_free * count
        return out.reshape(n, n)


@dataclass(frozen=True, eq=False)
class State:
    """A bubble on the way: ``gradient`` (n,) of the energy, ``moments`` (3,) and their ``slants`` (3, n).

    Moments are the volume and the integrals of the two coordinates; ``densities`` (3, G, m) and
    ``slopes`` (3, G, m, 3) are what they integrate, at the film.
    """

    radii: Floats
    nodes: Nodes
    energy: float
    gradient: Floats
    moments: Floats
    slants: Floats
    densities: Floats
    slopes: Floats


@dataclass(frozen=True, eq=False)
class Solved:
    """Where Newton's method ended.

    ``multipliers`` of volume and coordinates; ``residual`` in units of γ d; ``fault``, the largest relative
    error of a constraint.
    """

    state: State
    multipliers: Floats
    residual: float
    fault: float
    iterations: int

    @property
    def worst(self) -> float:
        """The larger of residual and fault."""
        return max(self.residual, self.fault)


def solve(held: HeldBubble, radii: Floats, multipliers: Floats) -> Solved:
    """Newton steps from the given radii and multipliers until nothing improves."""
    size = held.radius
    # what makes each constraint's error relative
    scale = held.volume * np.array([1.0, size, size])
    target = np.array([held.volume, 0.0, 0.0])
    best: Solved | None = None
    stale = 0
    state, _ = _within(held, 0.5 * radii, 0.5 * radii)
    for iteration in range(MOST_STEPS):
        pull = state.gradient - multipliers @ state.slants
        missing = target - state.moments
        reached = Solved(
            state,
            multipliers,
            float(np.abs(pull).max()) / held.grid.heights[-1],
            float(np.abs(missing / scale).max()),
            iteration,
        )
        stale = 0 if best is None or reached.worst < 0.5 * best.worst else stale + 1
        if best is None or reached.worst < best.worst:
            best = reached
        if best.worst <= TIGHT or (stale >= 2 and best.worst <= held.tolerance):
            break
        hessian = held.hessian(state, multipliers)
        n = len(pull)
        matrix = np.zeros((n + 3, n + 3))
        matrix[:n, :n] = hessian
        matrix[:n, n:] = -state.slants.T
        matrix[n:, :n] = -state.slants
        step = np.linalg.solve(matrix, np.concatenate([-pull, -missing]))
        longest = float(np.abs(step[:n]).max())
        share = min(1.0, LONGEST * size / longest) if longest > 0.0 else 1.0
        state, kept = _within(held, state.radii, share * step[:n].reshape(radii.shape))
        multipliers = multipliers + kept * share * step[n:]
    assert best is not None
    return best


def _within(held: HeldBubble, radii: Floats, change: Floats) -> tuple[State, float]:
    """The state after a change, or after the first half, quarter … of it that has a place on the surface."""
    share = 1.0
    while True:
        try:
            return held.state(radii + share * change), share
        except OutOfChart:
            share *= 0.5
            if share < LEAST_SHARE:
                raise


def stiffness(held: HeldBubble, solved: Solved) -> float:
    """Least eigenvalue of the Hessian on changes that keep the constraints."""
    slants = solved.state.slants
    basis = np.linalg.qr(slants.T, mode="complete")[0][:, len(slants) :]
    return float(np.linalg.eigvalsh(basis.T @ held.hessian(solved.state, solved.multipliers) @ basis)[0])
