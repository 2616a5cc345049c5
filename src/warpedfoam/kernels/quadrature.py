"""Gauss–Lobatto and Gauss–Legendre rules on [0, 1], with differentiation and interpolation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from warpedfoam.arrays import Floats, frozen

#: So many places or fewer are remembered with their interpolation.
FEW = 64


@dataclass(frozen=True, eq=False)
class LobattoRule:
    """Gauss–Lobatto rule of order p on [0, 1]: p + 1 nodes, exact to degree 2p − 1.

    Attributes
    ----------
    order : int
        p, the degree of the interpolating polynomial.
    nodes, weights : (p + 1,) arrays
        Nodes ξ_k (0 and 1 among them) and weights, which sum to 1.
    derivative : (p + 1, p + 1) array
        D with (D f)_k = f'(ξ_k) for the interpolating polynomial of nodal values f.
    interior : (p + 1, p − 1) array
        The columns of D that belong to the interior nodes.
    products : (p + 1, (p − 1)²) array
        Row k holds w_k D_ki D_kj over the interior nodes i, j.
    """

    order: int
    nodes: Floats
    weights: Floats
    derivative: Floats
    interior: Floats
    products: Floats

    def interpolation(self, xi: Floats) -> Floats:
        """Matrix (m, p + 1) from nodal values to values at the points ``xi`` in [0, 1]; read-only."""
        at = np.asarray(xi, dtype=np.float64)
        return _interpolation(self.order, at.tobytes()) if at.size <= FEW else self._interpolated(at)

    @cached_property
    def _barycentric(self) -> Floats:
        gaps = self.nodes[:, None] - self.nodes[None, :]
        np.fill_diagonal(gaps, 1.0)
        return frozen(1.0 / gaps.prod(axis=1))

    def _interpolated(self, xi: Floats) -> Floats:
        diff = xi[:, None] - self.nodes[None, :]
        hit = np.abs(diff) < 1e-14
        rows = np.any(hit, axis=1, keepdims=True)
        parts = np.where(rows, hit, self._barycentric / np.where(hit, 1.0, diff))
        return frozen(parts / parts.sum(axis=1, keepdims=True))


@lru_cache(maxsize=256)
def _interpolation(order: int, places: bytes) -> Floats:
    """The same few places are asked for again and again: those of a rule."""
    return lobatto(order)._interpolated(np.frombuffer(places))


@lru_cache(maxsize=64)
def lobatto(order: int) -> LobattoRule:
    """Gauss–Lobatto rule of order p ≥ 1 on [0, 1].

    The interior nodes are the roots of P_p', polished by Newton's method.

    Examples
    --------
    >>> rule = lobatto(2)
    >>> rule.weights * 6
    array([1., 4., 1.])
    """
    legendre = np.polynomial.legendre.Legendre.basis(order)
    slope = legendre.deriv()
    inner = np.sort(slope.roots().real) if order > 1 else np.zeros(0)
    bend = slope.deriv()
    for _ in range(3):
        inner = inner - slope(inner) / bend(inner) if inner.size else inner
    x = np.concatenate([[-1.0], inner, [1.0]])
    x = 0.5 * (x - x[::-1])
    weights = 2.0 / (order * (order + 1) * legendre(x) ** 2)
    gaps = x[:, None] - x[None, :]
    np.fill_diagonal(gaps, 1.0)
    bary = 1.0 / gaps.prod(axis=1)
    diff = (bary[None, :] / bary[:, None]) / gaps
    np.fill_diagonal(diff, 0.0)
    np.fill_diagonal(diff, -diff.sum(axis=1))
    derivative = 2.0 * diff
    weights = weights / weights.sum()
    interior = derivative[:, 1:-1]
    products = np.einsum("k,ki,kj->kij", weights, interior, interior).reshape(order + 1, -1)
    return LobattoRule(
        order,
        frozen(0.5 * (x + 1.0)),
        frozen(weights),
        frozen(derivative),
        frozen(interior),
        frozen(products),
    )


@lru_cache(maxsize=64)
def gauss(n_points: int) -> tuple[Floats, Floats]:
    """Gauss–Legendre nodes and weights on [0, 1], exact to degree 2n − 1.

    Examples
    --------
    >>> nodes, weights = gauss(2)
    >>> bool(abs((weights * nodes**3).sum() - 1 / 4) < 1e-15)
    True
    """
    x, w = np.polynomial.legendre.leggauss(n_points)
    return frozen(0.5 * (x + 1.0)), frozen(0.5 * w)
