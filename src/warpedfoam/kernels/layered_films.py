"""Films that bulge: several curves of nodes across the gap, each an arc of its own on the surface.

Curve k of film f is an arc of `warpedfoam.kernels.height_arcs` with its own ends and offsets; its nodes x_jk
are lifted to X_jk = x_jk + t_k n. Between nodes X is a polynomial in ξ and t, and the film's area is
Σ_j Σ_g w_j w_g |X_ξ × X_t| over the arcs' Gauss–Lobatto nodes and Gauss heights. Gradients are exact;
Hessians leave out what `height_arcs` leaves out. Arrays: nodes first, then curves, films, components.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.height_arcs import dots
from warpedfoam.kernels.quadrature import LobattoRule, gauss, lobatto


@dataclass(frozen=True, eq=False)
class Heights:
    """Heights t_k of the curves, and matrices from them to the G Gauss heights.

    ``weights`` (K,) are Lobatto weights of ∫ dt at the curves; ``rise`` and ``climb`` (G, K) give values and
    t-derivatives at the Gauss heights, whose weights are ``shares`` (G,); ``slopes`` (K, K) is d/dt at the
    curves.
    """

    heights: Floats
    weights: Floats
    rise: Floats
    climb: Floats
    shares: Floats
    slopes: Floats

    @classmethod
    def across(cls, gap: float, layers: int) -> Heights:
        """``layers`` + 1 curves."""
        rule = lobatto(layers)
        at, shares = gauss(layers + 2)
        rise = rule.interpolation(at)
        slopes = rule.derivative / gap
        return cls(gap * rule.nodes, gap * rule.weights, rise, rise @ slopes, gap * shares, slopes)


def bulging_terms(
    rule: LobattoRule,
    across: Heights,
    points: Floats,
    normals: Floats,
    shapes: Floats,
    moves: Floats,
    *,
    second: bool,
) -> tuple[Floats, Floats, Floats | None]:
    """Areas (F,), gradients (K, q, F) by (A₁, A₂, B₁, B₂, u) of each curve, Hessians (F, K q, K q).

    ``points``, ``normals`` (J, K, F, 3) and ``shapes`` (J, K, F, 3, 3) are those of the surface, ``moves``
    (J, K, F, 5, 3) as from `height_arcs.jacobians`; q = p + 3.
    """
    heights = across.heights[:, None, None]
    lifted = moves + heights[..., None] * np.matmul(moves, shapes)
    x = points + heights * normals
    along = np.einsum("gk,ij,jkfx->igfx", across.rise, rule.derivative, x, optimize=True)
    up = np.einsum("gk,jkfx->jgfx", across.climb, x)
    normal = np.cross(along, up)
    size = np.linalg.norm(normal, axis=3)
    unit = normal / size[..., None]
    weight = rule.weights[:, None, None] * across.shares[:, None]
    value = (weight * size).sum(axis=(0, 1))
    push = weight[..., None] * unit
    force = np.einsum("gk,ij,igfx->jkfx", across.rise, rule.derivative, np.cross(up, push), optimize=True)
    force += np.einsum("gk,jgfx->jkfx", across.climb, np.cross(push, along))
    pull = np.einsum("jkfax,jkfx->jkfa", lifted, force)
    gradient = np.concatenate(
        [pull[..., :4].sum(axis=0).transpose(0, 2, 1), pull[1:-1, ..., 4].transpose(1, 0, 2)], axis=1
    )
    if not second:
        return value, gradient, None

    n_nodes, n_curves, count = points.shape[:3]
    inner, q = n_nodes - 2, n_nodes + 2
    # changes of nodes by the curve's own unknowns, (J, K, F, q, 3)
    own = np.zeros((n_nodes, n_curves, count, q, 3))
    own[..., :4, :] = lifted[..., :4, :]
    for i in range(inner):
        own[i + 1, :, :, 4 + i] = lifted[i + 1, :, :, 4]
    m = n_curves * q
    slope = np.einsum("ij,jkfax->ikfax", rule.derivative, own, optimize=True)
    points_here = n_nodes * len(across.shares)
    a = np.einsum("gk,ikfax->figxka", across.rise, slope).reshape(count, points_here, 3, m)
    u = np.einsum("gk,jkfax->fjgxka", across.climb, own).reshape(count, points_here, 3, m)

    def flat(field: Floats) -> Floats:
        return np.moveaxis(field, 2, 0).reshape(count, points_here, -1)

    e, w, s = flat(unit), flat((weight + 0.0 * size)[..., None]), flat(size[..., None])
    change = _cross(a, flat(up)) - _cross(u, flat(along))
    change -= e[..., None] * np.einsum("fpx,fpxm->fpm", e, change)[:, :, None]
    rows = (np.sqrt(w / s)[..., None] * change).reshape(count, -1, m)
    hessian = np.matmul(rows.transpose(0, 2, 1), rows)
    bent = (w[..., None] * _cross(u, e)).reshape(count, -1, m)
    half = np.matmul(a.reshape(count, -1, m).transpose(0, 2, 1), bent)
    hessian += half + half.transpose(0, 2, 1)
    stiff = -dots(force, normals)[..., None, None] * (shapes + heights[..., None] * np.matmul(shapes, shapes))
    nodal = np.matmul(np.matmul(moves, stiff), moves.swapaxes(-1, -2))
    blocks = hessian.reshape(count, n_curves, q, n_curves, q)
    for k in range(n_curves):
        own_block = blocks[:, k, :, k]
        own_block[:, :4, :4] += nodal[:, k, :, :4, :4].sum(axis=0)
        for i in range(inner):
            own_block[:, :4, 4 + i] += nodal[i + 1, k, :, :4, 4]
            own_block[:, 4 + i, :4] += nodal[i + 1, k, :, :4, 4]
            own_block[:, 4 + i, 4 + i] += nodal[i + 1, k, :, 4, 4]
    return value, gradient, hessian


def contact_slips(rule: LobattoRule, across: Heights, points: Floats, normals: Floats) -> Floats:
    """Sines of the films' deviation from 90° at the nodes on both plates, (2, J, F)."""
    x = points + across.heights[:, None, None] * normals
    along = np.einsum("ij,jkfx->ikfx", rule.derivative, x)[:, [0, -1]]
    up = np.einsum("lk,jkfx->jlfx", across.slopes[[0, -1]], x)
    film = np.cross(along, up)
    film /= np.linalg.norm(film, axis=3, keepdims=True)
    out: Floats = dots(film, normals[:, [0, -1]]).transpose(1, 0, 2)
    return out


def _cross(columns: Floats, vectors: Floats) -> Floats:
    """Columns (F, P, 3, m) × vectors (F, P, 3)."""
    x, y, z = (columns[:, :, i] for i in range(3))
    a, b, c = (vectors[:, :, i, None] for i in range(3))
    return np.stack([y * c - z * b, z * a - x * c, x * b - y * a], axis=2)
