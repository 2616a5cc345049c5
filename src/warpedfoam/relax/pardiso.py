"""The optional accelerator: MKL's Pardiso through pypardiso, symmetric indefinite with inertia."""

from __future__ import annotations

import numpy as np
from pypardiso import PyPardisoSolver
from pypardiso.pardiso_wrapper import PyPardisoError
from scipy.sparse import csc_array, csr_matrix, tril

from warpedfoam.arrays import Floats
from warpedfoam.relax.linear import SingularMatrixError

#: Real symmetric indefinite matrices.
_SYMMETRIC = -2


class PardisoFactor:
    """A factorisation that lives until its solver factors the next matrix."""

    def __init__(self, solver: PyPardisoSolver, matrix: csr_matrix) -> None:
        self._solver, self._matrix = solver, matrix
        # a perturbed pivot has an arbitrary sign
        self.n_negative = -1 if solver.iparm[13] else int(solver.iparm[22])

    def solve(self, rhs: Floats) -> Floats:
        """Solution for one right side."""
        solver = self._solver
        solver.set_phase(33)
        out: Floats = solver._call_pardiso(self._matrix, np.asfortranarray(rhs))
        return out


class Pardiso:
    """Keeps the symbolic factorisation while the pattern stays the same."""

    def __init__(self) -> None:
        # made once: finding the library costs more than factoring a thousand bubbles
        self._solver = PyPardisoSolver(mtype=_SYMMETRIC)
        self._pattern: object = None
        # own settings; the order is given; no scaling or matching; Bunch–Kaufman pivots, weak ones
        # perturbed at 1e-13 and mended by two steps of refinement
        for place, value in ((1, 1), (5, 1), (8, 2), (10, 13), (11, 0), (13, 0), (21, 1)):
            self._solver.set_iparm(place, value)

    def factor(self, matrix: csc_array, pattern: object) -> PardisoFactor:
        """Factor ``matrix`` (both triangles stored); the factorisation before is overwritten."""
        # the lower triangle by columns is the upper one by rows, which is what Pardiso takes
        lower = tril(matrix, format="csc")
        upper = csr_matrix((lower.data, lower.indices, lower.indptr), shape=lower.shape)
        upper.sort_indices()
        solver = self._solver
        if self._pattern is pattern:
            solver.set_phase(22)
        else:
            self._release()
            # the matrix comes in a fill-reducing order: keep it
            solver.perm = np.arange(1, upper.shape[0] + 1, dtype=np.int32)
            solver.set_phase(12)
            self._pattern = pattern
        try:
            solver._call_pardiso(upper, np.zeros((upper.shape[0], 1)))
        except PyPardisoError as fault:
            raise SingularMatrixError(str(fault)) from None
        return PardisoFactor(solver, upper)

    def _release(self) -> None:
        if getattr(self, "_pattern", None) is not None:
            perm, self._solver.perm = self._solver.perm, np.zeros(0, dtype=np.int32)
            self._solver.free_memory(everything=True)
            self._solver.perm, self._pattern = perm, None

    def __del__(self) -> None:
        self._release()
