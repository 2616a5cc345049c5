"""Films whose height varies from node to node: area and swept volume with their derivatives.

As in `warpedfoam.kernels.height_arcs`, but the film over node k ends at the height p_k d, with p = p(x) the
gap over its mean d. With Gauss heights t and shares w of the mean gap, the area is

    Σ_t Σ_k w_t ω_k p_k |s_tk|,    s_tk = (D x)_k + t p_k (D n)_k,

and a change δp_k = ∇p · δx_k of the height joins that of the curve. Tangent parts of second derivatives of x
are left out of Hessians as in `height_arcs`, since they meet no force at equilibrium; dW is not: a gap that
varies a little leaves the motions of a round plate almost as soft as parallel plates do, and a Hessian off
by d dW would take their minima for saddles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.height_arcs import HeightArcs, add_nodal, collected, dots
from warpedfoam.kernels.quadrature import LobattoRule, gauss


@dataclass(frozen=True, eq=False)
class Thickness:
    """p (K, F) at the nodes of arcs, ∇p (K, F, 3), and ∇²p (K, F, 3, 3) if second derivatives are wanted."""

    value: Floats
    gradient: Floats
    hessian: Floats | None


def varied_measure(
    rule: LobattoRule, points: Floats, normals: Floats, thickness: Floats, heights: Floats, shares: Floats
) -> Floats:
    """Σ_t Σ_k w_t ω_k p_k |s_tk| of each arc, (F,), from nodes and normals (K, F, 3) and p (K, F)."""
    along, turn = (np.tensordot(rule.derivative, field, 1) for field in (points, normals))
    total = np.zeros(points.shape[1])
    for t, share in zip(heights, shares, strict=True):
        slope = along + (t * thickness)[..., None] * turn
        total += share * (rule.weights @ (thickness * np.linalg.norm(slope, axis=2)))
    return total


def varied_terms(
    arcs: HeightArcs,
    normals: Floats,
    shapes: Floats,
    moves: Floats,
    thickness: Thickness,
    heights: Floats,
    shares: Floats,
    slopes: Floats | None,
) -> tuple[Floats, Floats, Floats | None]:
    """Measure (F,), its gradient (p + 3, F) and Hessian (p + 3, p + 3, F).

    ``slopes`` (K, F, 3, 3, 3) are the derivatives ∂_a W of the shape operators along the surface, the first
    axis after the nodes' and arcs'; no Hessian without them.
    """
    rule, (n_nodes, count) = arcs.rule, arcs.points.shape[:2]
    p, size = thickness.value, 3 + rule.order
    along, turn = (np.tensordot(rule.derivative, field, 1) for field in (arcs.points, normals))
    turned = np.matmul(moves, shapes)
    value, by_p, by_pp = np.zeros(count), np.zeros(p.shape), np.zeros(p.shape)
    pull, lift = np.zeros(along.shape), np.zeros(along.shape)
    rows = np.empty((count, len(heights), 2, n_nodes, size))
    rise = _spread(dots(moves, thickness.gradient[:, :, None]), size)
    second = slopes is not None
    if second:
        across_base, across_turn = (np.tensordot(rule.derivative, m[:, :, :4], 1) for m in (moves, turned))
    for i, (t, share) in enumerate(zip(heights, shares, strict=True)):
        weight = share * rule.weights[:, None]
        slope = along + (t * p)[..., None] * turn
        speed = np.linalg.norm(slope, axis=2)
        tangent = slope / speed[..., None]
        stretch = t * dots(tangent, turn)
        value += (weight * p * speed).sum(axis=0)
        by_p += weight * (speed + p * stretch)
        by_pp += weight * stretch
        pull += weight[..., None] * tangent
        lift += (t * weight * p)[..., None] * tangent
        if not second:
            continue
        up = normals - dots(normals, tangent)[..., None] * tangent
        up /= np.linalg.norm(up, axis=2, keepdims=True)
        scale = np.sqrt(weight * p / speed)[..., None]
        changes = across_base + (t * p)[..., None, None] * across_turn
        for j, axis in enumerate((scale * up, scale * np.cross(tangent, up))):
            part = rows[:, i, j]
            part[:, :, :4] = np.einsum("kfmx,kfx->fkm", changes, axis)
            own = np.einsum("kfx,jfx->fkj", axis, moves[1:-1, :, 4])
            own += np.einsum("kfx,jfx->fkj", (t * p)[..., None] * axis, turned[1:-1, :, 4])
            part[:, :, 4:] = own * rule.interior
            part += (t * dots(axis, turn)).T[..., None] * rise
    force, twist = (np.tensordot(rule.derivative.T, p[..., None] * f, 1) for f in (pull, lift))
    nodal = np.einsum("kfmx,kfx->kfm", moves, force) + np.einsum("kfmx,kfx->kfm", turned, twist)
    nodal += by_p[..., None] * dots(moves, thickness.gradient[:, :, None])
    gradient = collected(nodal)
    if slopes is None or thickness.hessian is None:
        return value, gradient, None
    flat = rows.reshape(count, -1, size)
    hessian = np.matmul(flat.transpose(0, 2, 1), flat)
    # δ²(p |s|) holds 2 δp τ · (δ(Dx) + 2 t p δ(Dn) + t δp Dn)
    mixed = by_pp.T[..., None] * rise
    mixed[:, :, :4] += np.einsum("kfmx,kfx->fkm", across_base, pull)
    mixed[:, :, :4] += np.einsum("kfmx,kfx->fkm", across_turn, 2.0 * lift)
    own = np.einsum("kfx,jfx->fkj", pull, moves[1:-1, :, 4])
    own += np.einsum("kfx,jfx->fkj", 2.0 * lift, turned[1:-1, :, 4])
    mixed[:, :, 4:] += own * rule.interior
    cross = np.matmul(rise.transpose(0, 2, 1), mixed)
    hessian += cross + cross.transpose(0, 2, 1)
    out = np.ascontiguousarray(hessian.transpose(1, 2, 0))
    outward = dots(force, normals) + by_p * dots(thickness.gradient, normals)
    bend = by_p[..., None, None] * thickness.hessian - outward[..., None, None] * shapes
    bend -= dots(twist, normals)[..., None, None] * np.matmul(shapes, shapes)
    level = twist - dots(twist, normals)[..., None] * normals
    turn_of = np.einsum("kfx,kfaxb->kfab", level, slopes)
    bend += 0.5 * (turn_of + turn_of.transpose(0, 1, 3, 2))
    add_nodal(out, np.matmul(np.matmul(moves, bend), moves.transpose(0, 1, 3, 2)))
    return value, gradient, out


def swept_change(arcs: HeightArcs, normals: Floats, density_slope: Floats, moves: Floats) -> Floats:
    """What a density w that varies along the surface adds to second derivatives of ∫ w dA, (p + 3, p + 3, F).

    Symmetrised ∫ δw n · (δx × x') dξ with δw = ∇w · δx, ∇w = ``density_slope`` (K, F, 3) at the nodes; right
    when summed round closed loops.
    """
    rule = arcs.rule
    size = 3 + rule.order
    xi, omega = gauss(rule.order + 3)
    values = rule.interpolation(xi)
    slope = np.tensordot(values @ rule.derivative, arcs.points, 1)
    force = np.cross(slope, np.tensordot(values, normals, 1))
    rise = _spread(dots(moves, density_slope[:, :, None]), size)
    change = np.einsum("qk,fkm->fqm", omega[:, None] * values, rise)
    work = np.empty((arcs.points.shape[1], len(xi), size))
    work[:, :, :4] = np.einsum("qfmx,qfx->fqm", np.tensordot(values, moves[:, :, :4], 1), force)
    own = np.einsum("qfx,jfx->fqj", force, moves[1:-1, :, 4])
    work[:, :, 4:] = own * values[:, 1:-1]
    half = np.matmul(change.transpose(0, 2, 1), work)
    return np.ascontiguousarray((0.5 * (half + half.transpose(0, 2, 1))).transpose(1, 2, 0))


def _spread(nodal: Floats, size: int) -> Floats:
    """Changes at each node (K, F, 5) by (A, B, own u) as rows (F, K, p + 3) over all unknowns of an arc."""
    n_nodes, count = nodal.shape[:2]
    out = np.zeros((count, n_nodes, size))
    out[:, :, :4] = nodal[:, :, :4].transpose(1, 0, 2)
    inner = np.arange(1, n_nodes - 1)
    out[:, inner, 3 + inner] = nodal[1:-1, :, 4].T
    return out
