"""Steps that creep are extrapolated: Anderson's mixing of Newton steps.

On level sets second derivatives are right but for terms of the order of the gap. Motions that are softer than
these, such as the turn of a cluster, then go on by tiny, almost equal steps for ever. From the last few steps
f and the ways x that were made it is seen how f changes along them, and the point where it would vanish is
found by least squares, as for the secant method in one dimension.

D. G. Anderson, J. ACM 12, 547 (1965).
"""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.cell import HeleShawCell
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.relax.system import State, Step

#: Steps remembered; residuals below which steps are mixed; what is left of the residual by a good step.
MEMORY, BELOW, GOOD = 4, 1e-4, 0.1
#: After a residual so many times the last one what was seen is forgotten.
WORSE = 10.0
#: Singular values below this share of the largest say nothing.
RANK = 1e-6


class Mixing:
    """The last steps of one relaxation, and the states that they were made from."""

    def __init__(self) -> None:
        self._states: list[State] = []
        self._steps: list[Floats] = []
        self._force = np.inf

    def forget(self) -> None:
        """Begin anew: what was seen holds no longer."""
        self._states, self._steps, self._force = [], [], np.inf

    def mixed(self, cell: HeleShawCell, length: float, state: State, step: Step, force: float) -> Step:
        """The step to where steps would vanish, or the one given while these do well.

        Parameters
        ----------
        cell : HeleShawCell
        length : float
            ℓ.
        state : State
            Where the step begins.
        step : Step
            Newton's.
        force : float
            Residual at the state.
        """
        changed = bool(self._states) and self._states[-1].network is not state.network
        if changed or force > BELOW or force > WORSE * self._force:
            self.forget()
        good = force < GOOD * self._force
        self._force = force
        if force > BELOW:
            return step
        frames = cell.surface.vertex_frames(state.points)
        self._states.append(state)
        self._steps.append(
            _flat(np.einsum("vi,vix->vx", step.vertices, frames), step.offsets, step.pressures)
        )
        del self._states[: -MEMORY - 1], self._steps[: -MEMORY - 1]
        if good or len(self._steps) < 2:
            return step
        ways = np.stack(
            [_way(cell, length, *pair) for pair in zip(self._states, self._states[1:], strict=False)]
        )
        changes = np.diff(np.stack(self._steps), axis=0)
        # pressures follow from the rest
        n = changes.shape[1] - len(step.pressures)
        shares = np.linalg.lstsq(changes[:, :n].T, self._steps[-1][:n], rcond=RANK)[0]
        best = self._steps[-1] - shares @ (ways + changes)
        vertices = best[: state.points.size].reshape(-1, 3)
        return Step(
            np.einsum("vx,vix->vi", vertices, frames),
            best[state.points.size : n].reshape(step.offsets.shape),
            best[n:],
        )


def _flat(vertices: Floats, offsets: Floats, pressures: Floats) -> Floats:
    return np.concatenate([vertices.ravel(), offsets.ravel(), pressures])


def _way(cell: HeleShawCell, length: float, one: State, other: State) -> Floats:
    """The way from one state to another as steps are, in ℓ."""
    away = nearest_image(other.points - one.points, cell.surface.period) / length
    return _flat(away, other.offsets - one.offsets, other.pressures - one.pressures)
