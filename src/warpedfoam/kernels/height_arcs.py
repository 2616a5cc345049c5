"""Arcs on any smooth surface, as heights over a plane of their own: film area, volume, derivatives.

An arc from A to B stands over the plane across N = (n_A + n_B)/|n_A + n_B|: its nodes are
x_k = y_k + s_k N on the surface, y_k = (1 − ξ_k) A + ξ_k B + u_k N × (B − A). It needs the surface's
normal n and shape operator W at its nodes only, no third derivatives:

- dx = Q (dy + s dN), Q = I − N nᵀ/(n·N), exact; n · d²x = −dx·W dx, exact too;
- the tangent part of d²x does no work at equilibrium, along the arc because it slides nothing off the
  surface and across it because forces balance there, and is left out of Hessians.

So gradients are exact, and Newton's method on these Hessians converges quadratically in a thin gap and
at a rate of the order of d ∇W otherwise. Arrays: nodes first, arcs second, components last.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.quadrature import LobattoRule, gauss

#: Moves points (n, 3) along axes (n, 3) to the surface.
Foot = Callable[[Floats, Floats], Floats]


@dataclass(frozen=True, eq=False)
class HeightArcs:
    """Nodes of arcs, and the plane of each.

    ``axis``, ``chord``, ``left`` (F, 3): N, B − A and N × (B − A); ``lean`` (F,): |n_A + n_B|;
    ``offsets`` and ``heights`` (K, F): u and s; ``points`` (K, F, 3).
    """

    rule: LobattoRule
    axis: Floats
    chord: Floats
    left: Floats
    lean: Floats
    offsets: Floats
    heights: Floats
    points: Floats


def dots(a: Floats, b: Floats) -> Floats:
    """Inner products over the last axis."""
    out: Floats = np.einsum("...x,...x->...", a, b)
    return out


def place(
    rule: LobattoRule, tail: Floats, head: Floats, normals: tuple[Floats, Floats], offsets: Floats, foot: Foot
) -> HeightArcs:
    """Place the nodes of arcs from ``tail`` to ``head`` (F, 3), ``offsets`` (F, p − 1)."""
    total = normals[0] + normals[1]
    lean = np.linalg.norm(total, axis=1)
    axis = total / np.maximum(lean, 1e-300)[:, None]
    chord = head - tail
    left = np.cross(axis, chord)
    u = np.zeros((rule.order + 1, len(tail)))
    u[1:-1] = offsets.T
    xi = rule.nodes[:, None, None]
    base = tail + xi * chord + u[..., None] * left
    points = base.copy()
    inner = base[1:-1]
    points[1:-1] = foot(inner.reshape(-1, 3), np.broadcast_to(axis, inner.shape).reshape(-1, 3)).reshape(
        inner.shape
    )
    points[0], points[-1] = tail, head
    return HeightArcs(rule, axis, chord, left, lean, u, dots(points - base, axis), points)


def jacobians(arcs: HeightArcs, normals: Floats, shapes: Floats, frames: tuple[Floats, Floats]) -> Floats:
    """dx_k by (A₁, A₂, B₁, B₂, u_k), (K, F, 5, 3); ``frames`` (F, 2, 3) at both ends."""
    u, s = arcs.offsets[..., None, None], arcs.heights[..., None, None]
    xi = arcs.rule.nodes[:, None, None, None]
    axis, chord = arcs.axis[:, None], arcs.chord[:, None]
    move = np.empty((*arcs.points.shape[:2], 5, 3))
    for end, share, turn, frame in ((0, 1.0 - xi, -1.0, frames[0]), (-1, xi, 1.0, frames[1])):
        tilt = np.einsum("fxy,fiy->fix", shapes[end], frame)
        tilt -= dots(tilt, axis)[..., None] * axis
        tilt /= arcs.lean[:, None, None]
        across = turn * np.cross(axis, frame) + np.cross(tilt, chord)
        rows = slice(0, 2) if end == 0 else slice(2, 4)
        move[:, :, rows] = share * frame + u * across + s * tilt
    move[:, :, 4] = arcs.left
    slant = np.einsum("kfmx,kfx->kfm", move, normals) / dots(normals, arcs.axis)[..., None]
    move -= slant[..., None] * arcs.axis[:, None]
    return move


def film_measure(
    rule: LobattoRule, points: Floats, normals: Floats, heights: Floats, shares: Floats
) -> Floats:
    """Σ_t shares_t · length of the arcs lifted to the heights t, (F,)."""
    total = np.zeros(points.shape[1])
    for t, share in zip(heights, shares, strict=True):
        slope = np.tensordot(rule.derivative, points + t * normals, 1)
        total += share * (rule.weights @ np.linalg.norm(slope, axis=2))
    return total


def film_terms(
    arcs: HeightArcs,
    normals: Floats,
    shapes: Floats,
    moves: Floats,
    heights: Floats,
    shares: Floats,
    *,
    second: bool,
) -> tuple[Floats, Floats, Floats | None]:
    """Measure (F,), its gradient (p + 3, F) and Hessian (p + 3, p + 3, F) if ``second``."""
    rule, (n_nodes, count) = arcs.rule, arcs.points.shape[:2]
    inner = rule.order - 1
    value, pull = np.zeros(count), np.zeros((n_nodes, count, 5))
    bend = np.zeros(shapes.shape)
    rows = np.empty((count, len(heights), 2, n_nodes, 4 + inner))
    for i, (t, share) in enumerate(zip(heights, shares, strict=True)):
        weight = share * rule.weights[:, None]
        lifted = moves + t * np.matmul(moves, shapes)
        slope = np.tensordot(rule.derivative, arcs.points + t * normals, 1)
        speed = np.linalg.norm(slope, axis=2)
        tangent = slope / speed[..., None]
        value += (weight * speed).sum(axis=0)
        force = np.tensordot(rule.derivative.T, weight[..., None] * tangent, 1)
        pull += np.einsum("kfmx,kfx->kfm", lifted, force)
        if not second:
            continue
        up = normals - dots(normals, tangent)[..., None] * tangent
        up /= np.linalg.norm(up, axis=2, keepdims=True)
        scale = np.sqrt(weight / speed)[..., None]
        pair = (scale * up, scale * np.cross(tangent, up))
        changes = np.tensordot(rule.derivative, lifted[:, :, :4], 1)
        for j, across in enumerate(pair):
            rows[:, i, j, :, :4] = np.einsum("kfmx,kfx->fkm", changes, across)
            own = np.einsum("kfx,jfx->fkj", across, lifted[1:-1, :, 4])
            rows[:, i, j, :, 4:] = own * rule.interior
        bend -= dots(force, normals)[..., None, None] * (shapes + t * np.matmul(shapes, shapes))
    gradient = collected(pull)
    if not second:
        return value, gradient, None
    flat = rows.reshape(count, -1, 4 + inner)
    hessian = np.matmul(flat.transpose(0, 2, 1), flat).transpose(1, 2, 0)
    nodal = np.matmul(np.matmul(moves, bend), moves.transpose(0, 1, 3, 2))
    hessian = np.ascontiguousarray(hessian)
    add_nodal(hessian, nodal)
    return value, gradient, hessian


def swept_terms(
    arcs: HeightArcs, normals: Floats, density: Floats, moves: Floats, *, second: bool
) -> tuple[Floats, Floats | None]:
    """Derivatives of ∫ w dA over the region left of the arcs: (p + 3, F) and (p + 3, p + 3, F).

    The first is ∫ w n · (dx × x') dξ; ``density`` (K, F) is w at the nodes. Both are right when summed
    round closed loops.
    """
    rule, count = arcs.rule, arcs.points.shape[1]
    xi, omega = gauss(rule.order + 3)
    values = rule.interpolation(xi)
    slopes = values @ rule.derivative
    normal = np.tensordot(values, density[..., None] * normals, 1)
    slope = np.tensordot(slopes, arcs.points, 1)
    force = np.tensordot((omega[:, None] * values).T, np.cross(slope, normal), 1)
    gradient = collected(np.einsum("kfmx,kfx->kfm", moves, force))
    if not second:
        return gradient, None
    size = np.linalg.norm(normal, axis=2)
    unit = normal / size[..., None]
    along = slope - dots(slope, unit)[..., None] * unit
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    axes = (along, np.cross(unit, along))
    inner = rule.order - 1
    parts = np.empty((2, 2, count, len(xi), 4 + inner))
    for i, matrix in enumerate((values, slopes)):
        changes = np.tensordot(matrix, moves[:, :, :4], 1)
        for j, axis in enumerate(axes):
            parts[i, j, :, :, :4] = np.einsum("kfmx,kfx->fkm", changes, axis)
            own = np.einsum("kfx,jfx->fkj", axis, moves[1:-1, :, 4])
            parts[i, j, :, :, 4:] = own * matrix[:, 1:-1]
    weight = (omega[:, None] * size).T[..., None]
    half = np.matmul((weight * parts[0, 0]).transpose(0, 2, 1), parts[1, 1])
    half -= np.matmul((weight * parts[0, 1]).transpose(0, 2, 1), parts[1, 0])
    out = np.ascontiguousarray((0.5 * (half + half.transpose(0, 2, 1))).transpose(1, 2, 0))
    return gradient, out


def collected(nodal: Floats) -> Floats:
    """Derivatives (p + 3, F) from those by (A, B, u_k) of each node (K, F, 5)."""
    ends = nodal[:, :, :4].sum(axis=0).T
    return np.concatenate([ends, nodal[1:-1, :, 4]])


def add_nodal(hessian: Floats, nodal: Floats) -> None:
    """Add second derivatives node by node (K, F, 5, 5)."""
    hessian[:4, :4] += nodal[:, :, :4, :4].sum(axis=0).transpose(1, 2, 0)
    mixed = nodal[1:-1, :, :4, 4].transpose(2, 0, 1)
    hessian[:4, 4:] += mixed
    hessian[4:, :4] += mixed.transpose(1, 0, 2)
    n = len(hessian) - 4
    place_ = np.arange(4, 4 + n)
    hessian[place_, place_] += nodal[1:-1, :, 4, 4]
