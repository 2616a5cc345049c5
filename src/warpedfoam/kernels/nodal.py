"""Sums over the nodes of an arc, with exact first and second derivatives.

An arc's shape is the polynomial v(ξ) of degree p with v = 0 at both ends and v(ξ_j) = u_j at the
interior nodes. Every integral along it is a sum Σ_k w_k g(x, v_k, v'_k), where x holds a few numbers
of the arc as a whole (its length, its end angles). The functions here turn the derivatives of the
density g at the nodes into derivatives with respect to (x, u). Arrays have the arcs as last axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.quadrature import LobattoRule


@dataclass(frozen=True, eq=False)
class Density:
    """Derivatives of a density g(x, v, v') at the nodes: K nodes, F arcs, m numbers x.

    ``x``: (m, K, F); ``v``, ``w`` (for v'): (K, F); ``xx``: (m, m, K, F); ``xv``, ``xw``: (m, K, F);
    ``vv``, ``vw``, ``ww``: (K, F).
    """

    x: Floats
    v: Floats
    w: Floats
    xx: Floats
    xv: Floats
    xw: Floats
    vv: Floats
    vw: Floats
    ww: Floats


def shape_values(rule: LobattoRule, offsets: Floats) -> tuple[Floats, Floats]:
    """Values v and slopes v' at the p + 1 nodes, (K, F) each, from interior offsets (p − 1, F)."""
    values = np.zeros((rule.order + 1, offsets.shape[1]))
    values[1:-1] = offsets
    return values, rule.interior @ offsets


def nodal_gradient(rule: LobattoRule, x: Floats, v: Floats, w: Floats) -> Floats:
    """Gradient of Σ w_k g_k with respect to (x, u): (m + p − 1, F)."""
    m = len(x)
    out = np.empty((m + rule.order - 1, v.shape[1]))
    out[:m] = np.einsum("k,mkf->mf", rule.weights, x)
    weighted = rule.weights[:, None] * w
    out[m:] = rule.interior.T @ weighted
    out[m:] += rule.weights[1:-1, None] * v[1:-1]
    return out


def nodal_hessian(rule: LobattoRule, g: Density) -> Floats:
    """Hessian of Σ w_k g_k with respect to (x, u): (m + p − 1, m + p − 1, F)."""
    m, n, count = len(g.x), rule.order - 1, g.v.shape[1]
    out = np.empty((m + n, m + n, count))
    weights, inner = rule.weights, rule.weights[1:-1]
    out[:m, :m] = np.einsum("k,ijkf->ijf", weights, g.xx)
    for i in range(m):
        mixed = rule.interior.T @ (weights[:, None] * g.xw[i])
        mixed += inner[:, None] * g.xv[i, 1:-1]
        out[i, m:] = mixed
        out[m:, i] = mixed
    block = (rule.products.T @ g.ww).reshape(n, n, count)
    slope = rule.interior[1:-1]
    cross = (inner[:, None] * g.vw[1:-1])[:, None, :] * slope[:, :, None]
    block += cross
    block += cross.transpose(1, 0, 2)
    diagonal = np.arange(n)
    block[diagonal, diagonal] += inner[:, None] * g.vv[1:-1]
    out[m:, m:] = block
    return out
