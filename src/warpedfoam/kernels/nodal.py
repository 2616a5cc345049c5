"""Sums over the nodes of an arc, with exact first and second derivatives.

An arc's shape is the polynomial v(ξ) of degree p with v = 0 at both ends and v(ξ_j) = u_j at the
interior nodes. Every integral along it is a sum Σ_k w_k g(x, v_k, v'_k), where x holds a few numbers
of the arc as a whole (its length, its end angles). The functions here turn the derivatives of the
density g at the nodes into derivatives with respect to (x, u). Arrays have the arcs as last axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.kernels.quadrature import LobattoRule, lobatto


@dataclass(frozen=True, eq=False)
class Density:
    """Second derivatives of a density g(x, v, v') at the nodes: K nodes, F arcs, m numbers x.

    ``xx``: (m, m, K, F); ``xv``, ``xw`` (w for v'): (m, K, F); ``vv``, ``vw``, ``ww``: (K, F).
    """

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
    m, n, count = len(g.xx), rule.order - 1, g.vv.shape[1]
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


def bump_offsets(arc: Ints, xi: Floats, lift: Floats, n_arcs: int, order: int) -> Floats:
    """Offsets (n_arcs, p − 1) of s · 4ξ(1 − ξ), s fitted to points (ξ, lift) of arcs and kept in ±0.5."""
    bump = 4.0 * xi * (1.0 - xi)
    bump = np.where((xi > 0.0) & (xi < 1.0), bump, 0.0)
    above = np.bincount(arc, bump * lift, minlength=n_arcs)
    below = np.bincount(arc, bump * bump, minlength=n_arcs)
    height = np.clip(above / (below + 0.1), -0.5, 0.5)
    nodes = lobatto(order).nodes[1:-1]
    return height[:, None] * (4.0 * nodes * (1.0 - nodes))
