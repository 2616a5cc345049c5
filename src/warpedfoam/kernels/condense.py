"""Eliminate the interior unknowns of many small symmetric systems at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Condensed:
    """Schur complements on the kept unknowns, and what is needed to recover the others.

    ``matrix`` (k, k, F) and ``rhs`` (k, F) belong to the kept unknowns. ``rows`` (n, k + n, F),
    ``pivots`` (n, F) and ``heads`` (n, F) hold the eliminated equations, in their original order.
    ``negative`` (F,) counts the pivots at or below zero, before they were mended.
    """

    matrix: Floats
    rhs: Floats
    rows: Floats
    pivots: Floats
    heads: Floats
    negative: Ints

    def recover(self, kept: Floats) -> Floats:
        """The eliminated unknowns (n, F) from the kept ones (k, F)."""
        k, n = len(kept), len(self.pivots)
        full = np.empty((k + n, kept.shape[1]))
        full[:k] = kept
        for i in range(n):
            above = np.einsum("if,if->f", self.rows[i, : k + i], full[: k + i])
            full[k + i] = (self.heads[i] - above) / self.pivots[i]
        return full[k:]


def condense(matrix: Floats, rhs: Floats, n_kept: int, floor: Floats | None) -> Condensed:
    """Eliminate all but the first ``n_kept`` unknowns, last one first (overwrites its arguments).

    Parameters
    ----------
    matrix : (m, m, F) array
        Symmetric in its first two axes.
    rhs : (m, F) array
    n_kept : int
    floor : (m − n_kept, F) array or None
        If given, a pivot becomes max(|pivot|, floor): the eliminated block is made positive.

    Examples
    --------
    >>> import numpy as np
    >>> a = np.array([[2.0, 1.0], [1.0, 4.0]])[..., None]
    >>> out = condense(a.copy(), np.array([[1.0], [2.0]]), 1, None)
    >>> float(out.matrix[0, 0, 0]), out.recover(np.array([[1.0]])).tolist()
    (1.75, [[0.25]])
    """
    m, count = rhs.shape
    n = m - n_kept
    rows = np.empty((n, m, count))
    pivots, heads = np.empty((n, count)), np.empty((n, count))
    negative = np.zeros(count, dtype=np.int64)
    for i in range(n - 1, -1, -1):
        j = n_kept + i
        row = matrix[j, :j]
        pivot = matrix[j, j]
        negative += pivot <= 0.0
        if floor is not None:
            pivot = np.maximum(np.abs(pivot), floor[i])
        rows[i, :j], pivots[i], heads[i] = row, pivot, rhs[j]
        scaled = row / pivot
        matrix[:j, :j] -= scaled[:, None] * rows[i, None, :j]
        rhs[:j] -= scaled * heads[i]
    return Condensed(matrix[:n_kept, :n_kept], rhs[:n_kept], rows, pivots, heads, negative)


def clip_to_positive(blocks: Floats) -> Floats:
    """Nearest positive semidefinite matrices of symmetric blocks (k, k, F)."""
    stacked = np.ascontiguousarray(blocks.transpose(2, 0, 1))
    values, vectors = np.linalg.eigh(stacked)
    bad = values[:, 0] < 0.0
    if not bad.any():
        return blocks
    cut = np.minimum(values[bad], 0.0)
    stacked[bad] -= (vectors[bad] * cut[:, None, :]) @ vectors[bad].transpose(0, 2, 1)
    return stacked.transpose(1, 2, 0)
