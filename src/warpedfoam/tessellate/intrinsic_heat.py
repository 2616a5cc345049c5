"""The heat method from triangles' corners alone: for meshes that repeat in space, and for parts of meshes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from warpedfoam.arrays import Floats, Ints

#: Right-hand sides solved at once.
BLOCK = 16
#: Where heat falls slower than this share of the rate away from its sources, fronts meet: X is shortened.
SEAM = 0.85


class IntrinsicHeat:
    """Heat and Poisson equations on triangles that may hang together in several pieces; factored once.

    (M + t L) u = δ, X = −∇u/|∇u|, L φ = −∇·X, with the cotangent matrix L and lumped areas M (Crane,
    Weischedel and Wardetzky 2013). Within √t of a seam, where paths from two sides meet, that X is too long:
    it turns from one direction to the other at full length, while the distance's gradient along the seam is
    shorter, and distances grow too fast along seams and behind them, by √t times a logarithm. Since u is a
    sum of exp(−d/√t) there, −√t ∇u/u is the mean of both gradients; so where |∇u| < c u/√t, that is what X
    is, but for the factor c = 0.85 (and h²/4 added to t for an edge of length h, as heat falls on a mesh),
    which keeps X at full length elsewhere. Nothing flows through a rim: there the distances' isolines end at
    right angles, within about √t.

    Parameters
    ----------
    corners : (m, 3, 3) array
        Corners of each triangle; only their differences matter.
    triangles : (m, 3) integer array
        Every node from 0 to ``n_nodes`` − 1 belongs to one at least.
    n_nodes : int
    t : float

    Attributes
    ----------
    piece : (n_nodes,) integer array
        Which piece of the mesh a node belongs to.
    """

    def __init__(self, corners: Floats, triangles: Ints, n_nodes: int, t: float) -> None:
        n = n_nodes
        # side i of a triangle lies across from its corner i
        sides = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
        double = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        cotangent = -np.einsum("mix,mix->mi", np.roll(sides, -1, axis=1), np.roll(sides, -2, axis=1))
        half = 0.5 * cotangent / double[:, None]
        a, b = np.roll(triangles, -1, axis=1).ravel(), np.roll(triangles, -2, axis=1).ravel()
        rows, columns = np.concatenate([a, b, a, b]), np.concatenate([b, a, a, b])
        values = np.concatenate([-half.ravel(), -half.ravel(), half.ravel(), half.ravel()])
        stiffness = csc_array(coo_array((values, (rows, columns)), shape=(n, n)))
        longest = np.einsum("mix,mix->mi", sides, sides).max(axis=1)
        self._rate = SEAM / 3.0 / np.sqrt(t + 0.25 * longest)
        mass = np.bincount(triangles.ravel(), np.repeat(double / 6.0, 3), n)
        self._half, self._area, self._n = half, 0.5 * double, n
        self._triangles = np.ascontiguousarray(triangles.T)
        corner = np.arange(triangles.size)
        self._gather = csr_array((np.ones(triangles.size), (triangles.T.ravel(), corner)), (n, len(corner)))
        self._heat = _factored(csc_array(diags_array(mass) + t * stiffness))
        count, self.piece = connected_components(stiffness, directed=False)
        # a constant is free in each piece: its first node is held
        self._free = np.ones(n, dtype=bool)
        self._free[np.unique(self.piece, return_index=True)[1][:count]] = False
        self._poisson = _factored(stiffness[self._free][:, self._free])

    def solve(self, sources: Ints) -> Floats:
        """Distances from the nearest source, their mean over the sources 0."""
        out: Floats = self.solve_many([sources])[:, 0]
        return out - float(out[sources].mean())

    def solve_many(self, sources: Sequence[Ints]) -> Floats:
        """Distances (n_nodes, k) from k sets of sources, each up to a constant in each piece.

        A piece without a source gets zeros.
        """
        out = np.zeros((self._n, len(sources)))
        for lo in range(0, len(sources), BLOCK):
            block = sources[lo : lo + BLOCK]
            start = np.zeros((self._n, len(block)))
            for k, nodes in enumerate(block):
                start[nodes, k] = 1.0
            out[self._free, lo : lo + BLOCK] = self._poisson.solve(
                self._divergence(self._heat.solve(start))[self._free]
            )
        return out

    def _divergence(self, heat: Floats) -> Floats:
        """Flow of −∇u/|∇u| out of each node, (n, k).

        In a triangle of area A with half cotangents w_i and differences d_i of u along its sides,
        A |∇u|² = Σ w_i d_i², and a node gains the difference of the w_i d_i on its two sides.
        """
        x, y, z = heat[self._triangles]
        along = [y - z, z - x, x - y]
        flux = [w[:, None] * d for w, d in zip(self._half.T, along, strict=True)]
        square = sum(f * d for f, d in zip(flux, along, strict=True))
        total = x + y + z
        faint = np.flatnonzero(total.min(axis=1) < 1e-130)
        if faint.size:
            # far from the sources squares leave floating point: u is brought to about 1 there
            top = np.abs(x[faint]) + np.abs(y[faint]) + np.abs(z[faint])
            top[top == 0.0] = 1.0
            for part in (*flux, *along):
                part[faint] /= top
            square[faint] = sum(f[faint] * d[faint] for f, d in zip(flux, along, strict=True))
            total[faint] /= top
        slope = np.sqrt(np.maximum(square, 1e-300) / self._area[:, None])
        scale = 1.0 / np.maximum(slope, self._rate[:, None] * total)
        for f in flux:
            f *= scale
        parts = np.concatenate([flux[1] - flux[2], flux[2] - flux[0], flux[0] - flux[1]])
        out: Floats = self._gather @ parts
        return out


def _factored(matrix: csc_array) -> Any:
    return splu(
        csc_array(matrix),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
