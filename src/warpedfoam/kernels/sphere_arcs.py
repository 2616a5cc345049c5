"""Arcs on the unit sphere: length, swept area and their derivatives.

An arc runs from A to B. In the frame where the great circle AB is the equator, of length L, the arc's
node k has longitude ξ_k L and latitude β_k = L v_k, positive to the left. Its length is
∫ sqrt(β'² + cos²β L²) dξ and the lune between it and the great circle has the area ∫ sin β L dξ, so
both depend on L and the offsets alone: invariance under rotation is exact.
"""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.nodal import Density, nodal_gradient, nodal_hessian, shape_values
from warpedfoam.kernels.quadrature import LobattoRule


def arc_length_and_lune(rule: LobattoRule, length: Floats, offsets: Floats) -> tuple[Floats, Floats]:
    """Length of each arc and signed area of its lune; ``length`` (F,) is L, ``offsets`` (p − 1, F)."""
    v, w = shape_values(rule, offsets)
    beta = length * v
    speed = np.sqrt(w * w + np.cos(beta) ** 2)
    return length * (rule.weights @ speed), length * (rule.weights @ np.sin(beta))


def arc_gradients(rule: LobattoRule, length: Floats, offsets: Floats) -> tuple[Floats, Floats, Floats]:
    """Arc length (F,) and the gradients (p, F) of arc length and lune area by (L, u)."""
    v, w = shape_values(rule, offsets)
    beta = length * v
    sin, cos = np.sin(beta), np.cos(beta)
    h = np.sqrt(w * w + cos * cos)
    bend = -sin * cos / h
    total = length * (rule.weights @ h)
    grad = nodal_gradient(rule, (h + beta * bend)[None], length * length * bend, length * w / h)
    lune = nodal_gradient(rule, (sin + beta * cos)[None], length * length * cos, np.zeros_like(w))
    return total, grad, lune


def arc_hessian(
    rule: LobattoRule, length: Floats, offsets: Floats, tension: float, pressure: Floats
) -> Floats:
    """Hessian (p, p, F) of tension · arc length + pressure · lune area by (L, u)."""
    v, w = shape_values(rule, offsets)
    beta = length * v
    sin, cos = np.sin(beta), np.cos(beta)
    h2 = w * w + cos * cos
    h = np.sqrt(h2)
    # q = w² + cos²(Lv); h = sqrt q; the density is T·L·h + P·L·sin(Lv)
    b = -sin * cos / h  # dh/dβ
    bb = (sin * sin - cos * cos) / h - b * b / h  # d²h/dβ²
    hw = w / h
    hww = cos * cos / (h2 * h)
    bw = -b * hw / h  # d²h/dβ dv'
    t = tension
    s1 = t * b + pressure * cos  # first and second β-derivative of T h + P sin
    s2 = t * bb - pressure * sin
    density = Density(
        xx=(2.0 * v * s1 + length * v * v * s2)[None, None],
        xv=(2.0 * length * s1 + length * beta * s2)[None],
        xw=(t * (hw + beta * bw))[None],
        vv=length**3 * s2,
        vw=t * length * length * bw,
        ww=t * length * hww,
    )
    return nodal_hessian(rule, density)


def geodesic_frame(tail: Floats, head: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Angle L (F,), left normal (F, 3) and unit tangents (F, 3) at both ends of great-circle arcs."""
    cross = np.cross(tail, head)
    sine = np.linalg.norm(cross, axis=1)
    cosine = np.einsum("fi,fi->f", tail, head)
    length = np.arctan2(sine, cosine)
    left = cross / np.maximum(sine, 1e-300)[:, None]
    return length, left, np.cross(left, tail), np.cross(left, head)


def vertex_hessian(
    length: Floats,
    bases: tuple[Floats, Floats, Floats, Floats],
    slope: Floats,
    curvature: Floats,
    pressure: Floats,
) -> Floats:
    """Hessian (4, 4, F) by the two ends of f(L) + pressure · (area swept by the great circle AB).

    ``bases`` holds the components (2, F) of tangent and left normal at A, then at B, in the vertex
    frames; ``slope`` and ``curvature`` are f' and f''. With α, β the displacements of A and B along
    the left normal, L'' = cot L (α² + β²) − 2αβ / sin L. Moving the ends by α, β sweeps the area
    tan(L/2)(α + β); its covariant derivative is used symmetrised, since the antisymmetric parts of
    the films before and after a vertex cancel around each bubble.
    """
    ta, na, tb, nb = bases
    tau = np.concatenate([-ta, tb])
    cot, csc = 1.0 / np.tan(length), 1.0 / np.sin(length)
    half = np.tan(0.5 * length)
    out: Floats = (curvature * tau)[:, None, :] * tau[None, :, :]
    out[:2, :2] += (slope * cot * na)[:, None] * na[None]
    out[2:, 2:] += (slope * cot * nb)[:, None] * nb[None]
    mixed = (-slope * csc * na)[:, None] * nb[None]
    turn = 0.5 * pressure * half * half
    twist_a = (turn * ta)[:, None] * na[None]
    twist_b = (turn * tb)[:, None] * nb[None]
    out[:2, :2] -= twist_a + twist_a.transpose(1, 0, 2)
    out[2:, 2:] += twist_b + twist_b.transpose(1, 0, 2)
    sweep = pressure / (1.0 + np.cos(length))
    mixed += (sweep * na)[:, None] * tb[None] - (sweep * ta)[:, None] * nb[None]
    out[:2, 2:] += mixed
    out[2:, :2] += mixed.transpose(1, 0, 2)
    return out
