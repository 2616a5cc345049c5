"""The factored Newton matrix [H + σ, −B; −Bᵀ, −ε] of a linearised foam."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.condense import Condensed
from warpedfoam.relax.system import Linearised, Step, Stopwatch

#: Rows of the film blocks (A₁, A₂, B₁, B₂, pressure jump) as they enter (vertices, left, right), and signs.
_ROWS = np.array([0, 1, 2, 3, 4, 4])
_SIGN = np.array([1.0, 1.0, 1.0, 1.0, 1.0, -1.0])
#: Inverse iterations for the softest mode.
_INVERSE_STEPS = 4


class KKT:
    """Newton matrix of one linearised state, factored once for steps and modes.

    Parameters
    ----------
    lin : Linearised
    condensed : Condensed
        Its film blocks without the offsets.
    vertex_shift : (2 n_vertices,) array
        σ, added to the vertex unknowns' diagonal.
    pressure_shift : (n_bubbles,) array
        ε, taken from the pressures' diagonal.
    """

    def __init__(
        self, lin: Linearised, condensed: Condensed, vertex_shift: Floats, pressure_shift: Floats
    ) -> None:
        self._lin, self._condensed = lin, condensed
        self._timings = lin.system.timings
        self._pattern = lin.system.pattern(lin.state.network)
        clock = Stopwatch(self._timings)
        blocks = condensed.matrix[np.ix_(_ROWS, _ROWS)]
        blocks *= (_SIGN[:, None] * _SIGN)[..., None]
        self._matrix = self._pattern.matrix(blocks, np.concatenate([vertex_shift, -pressure_shift]))
        pattern: object = self._pattern
        if lin.following is not None:
            self._matrix = lin.following.matrix(self._matrix, self._pattern)
            # its entries change places
            pattern = self._matrix
        clock.lap("assemble")
        self._factor = lin.system.factoriser.factor(self._matrix, pattern)
        clock.lap("solve")

    @property
    def n_negative(self) -> int:
        """Number of negative eigenvalues, or −1 if the solver could not tell."""
        return self._factor.n_negative

    def _solve(self, rhs: Floats) -> Floats:
        clock = Stopwatch(self._timings)
        following, split = self._lin.following, 2 * self._lin.state.network.n_vertices
        if following is not None:
            rhs = np.concatenate([following.forces(rhs[:split]), rhs[split:]])
        ordered = self._pattern.ordered(rhs)
        x = self._factor.solve(ordered)
        x += self._factor.solve(ordered - self._matrix @ x)
        out = self._pattern.restored(x)
        if following is not None:
            out = np.concatenate([following.expanded(out[:split]), out[split:]])
        clock.lap("solve")
        return out

    def step(self, volume_fault: Floats) -> Step:
        """Solve for (−r, V − V*) and recover the offsets."""
        rhs = self._pattern.gather(self._condensed.rhs[_ROWS] * _SIGN[:, None])
        split = 2 * self._lin.state.network.n_vertices
        rhs[:split] = self._lin.without_rigid(self._lin.across(rhs[:split]))
        rhs[split:] += volume_fault
        return self._recovered(rhs, self._condensed)

    def response(self, condensed: Condensed, vertices: Floats | None = None) -> Step:
        """Solve for the forces eliminated in ``condensed`` and those on ``vertices`` (2 n_vertices,)."""
        rhs = self._pattern.gather(condensed.rhs[_ROWS] * _SIGN[:, None])
        if vertices is not None:
            rhs[: vertices.size] += vertices
        return self._recovered(rhs, condensed)

    def _recovered(self, rhs: Floats, condensed: Condensed) -> Step:
        network = self._lin.state.network
        split = 2 * network.n_vertices
        solution = self._solve(rhs)
        clock = Stopwatch(self._timings)
        dv, dp = solution[:split].reshape(-1, 2), solution[split:]
        jump = dp[network.left] - dp[network.right]
        offsets = condensed.recover(np.concatenate([dv[network.tails].T, dv[network.heads].T, jump[None]])).T
        clock.lap("assemble")
        return Step(dv, np.ascontiguousarray(offsets), dp)

    def softest_mode(self, start: Floats) -> Floats:
        """Vertex displacement (n_vertices, 2) of the weakest mode near ``start``, largest entry 1."""
        mode = start.ravel()
        zero = np.zeros(self._pattern.n_bubbles)
        for _ in range(_INVERSE_STEPS):
            mode = self._solve(np.concatenate([mode / np.abs(mode).max(), zero]))[: mode.size]
        out: Floats = (mode / np.abs(mode).max()).reshape(-1, 2)
        return out
