"""One small door to sparse direct solvers: factor a symmetric indefinite matrix, solve, read its inertia.

The matrix comes already permuted so that every pivot may be taken from the diagonal in order (see
`warpedfoam.relax.pattern`); the signs of the pivots then count the eigenvalues of each sign.
"""

from __future__ import annotations

import importlib.util
from typing import Protocol

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from warpedfoam.arrays import Floats, as_choice

SOLVERS = ("auto", "superlu", "pardiso")
#: Bubbles from which loading Pardiso pays for itself.
PARDISO_FROM = 2000


class SingularMatrixError(ArithmeticError):
    """A Newton matrix could not be factored."""


class Factor(Protocol):
    """A factored symmetric matrix."""

    @property
    def n_negative(self) -> int:
        """Number of negative eigenvalues."""
        ...

    def solve(self, rhs: Floats) -> Floats:
        """Solution for one right side."""
        ...


class Factoriser(Protocol):
    """Factors matrices; may reuse what it knows of a ``pattern`` object seen before."""

    def factor(self, matrix: csc_array, pattern: object) -> Factor:
        """Factor ``matrix`` (both triangles stored)."""
        ...


class SuperLUFactor:
    """SciPy's SuperLU with diagonal pivots; the signs of U's diagonal give the inertia."""

    def __init__(self, matrix: csc_array) -> None:
        try:
            self._lu = splu(
                matrix,
                permc_spec="NATURAL",
                diag_pivot_thresh=0.0,
                relax=1,
                panel_size=8,
                options={"SymmetricMode": True, "Equil": False},
            )
        except RuntimeError as fault:
            raise SingularMatrixError(str(fault)) from None

    @property
    def n_negative(self) -> int:
        """Negative pivots; −1 if an off-diagonal pivot was taken, which hides the inertia."""
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            return -1
        return int((self._lu.U.diagonal() < 0.0).sum())

    def solve(self, rhs: Floats) -> Floats:
        """Solution for one right side."""
        out: Floats = self._lu.solve(rhs)
        return out


class SuperLU:
    """The default: SciPy's SuperLU."""

    def factor(self, matrix: csc_array, pattern: object) -> Factor:
        """Factor ``matrix``; SuperLU keeps nothing of the pattern."""
        del pattern
        return SuperLUFactor(matrix)


def factoriser(solver: str, n_bubbles: int) -> Factoriser:
    """The solver by name; ``"auto"`` takes pardiso for large foams where pypardiso is installed.

    Raises
    ------
    ValueError
        If ``solver`` is unknown, or asks for a package that is not installed.
    """
    as_choice(solver, "solver", SOLVERS)
    present = importlib.util.find_spec("pypardiso") is not None
    if solver == "pardiso" and not present:
        raise ValueError("solver 'pardiso' needs the package pypardiso: pip install 'warpedfoam[fast]'")
    if solver == "pardiso" or (solver == "auto" and present and n_bubbles >= PARDISO_FROM):
        from warpedfoam.relax.pardiso import Pardiso

        try:
            return Pardiso()
        except (ImportError, OSError) as fault:
            if solver == "pardiso":
                raise ValueError(f"solver 'pardiso' cannot load its library: {fault}") from None
    return SuperLU()
