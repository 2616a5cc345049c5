"""The optional accelerator: MKL's Pardiso through pypardiso, symmetric indefinite with inertia."""

from __future__ import annotations

import numpy as np
from pypardiso import PyPardisoSolver
from scipy.sparse import csc_array, csr_matrix, tril

from warpedfoam.arrays import Floats

#: Real symmetric indefinite matrices.
_SYMMETRIC = -2


class PardisoFactor:
    """A factorisation that lives until its solver factors the next matrix."""

    def __init__(self, solver: PyPardisoSolver, matrix: csr_matrix) -> None:
        self._solver, self._matrix = solver, matrix
        self.n_negative = int(solver.iparm[22])

    def solve(self, rhs: Floats) -> Floats:
        """Solution for one right side."""
        solver = self._solver
        solver.set_phase(33)
        out: Floats = solver._call_pardiso(self._matrix, np.asfortranarray(rhs))
        return out


class Pardiso:
    """Keeps the symbolic factorisation while the pattern stays the same."""

    def __init__(self) -> None:
        self._solver: PyPardisoSolver | None = None
        self._indices: object = None

    def factor(self, matrix: csc_array) -> PardisoFactor:
        """Factor ``matrix`` (both triangles stored); frees the one before."""
        # the lower triangle by columns is the upper one by rows, which is what Pardiso takes
        lower = tril(matrix, format="csc")
        upper = csr_matrix((lower.data, lower.indices, lower.indptr), shape=lower.shape)
        upper.sort_indices()
        solver = self._solver
        if solver is None or self._indices is not matrix.indices:
            self.close()
            solver = self._solver = PyPardisoSolver(mtype=_SYMMETRIC)
            solver.set_iparm(1, 1)
            solver.set_iparm(2, 2)  # nested dissection
            solver.set_iparm(10, 13)  # perturb pivots below 1e-13
            solver.set_iparm(11, 0)
            solver.set_iparm(13, 0)
            solver.set_iparm(8, 2)
            solver.set_iparm(21, 1)  # Bunch–Kaufman pivots
            self._indices = matrix.indices
            solver.set_phase(12)
        else:
            solver.set_phase(22)
        solver._call_pardiso(upper, np.zeros((upper.shape[0], 1)))
        return PardisoFactor(solver, upper)

    def close(self) -> None:
        """Free the solver's memory."""
        if self._solver is not None:
            self._solver.free_memory(everything=True)
            self._solver = None

    def __del__(self) -> None:
        self.close()
