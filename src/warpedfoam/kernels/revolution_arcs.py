"""Arcs on a surface of revolution in its angles (φ, θ): film area, swept volume, derivatives.

The surface has the metric ρ² dφ² + g(φ)² dθ² at every height (ρ constant along a meridian of constant
curvature: a torus's tube, with g = R + ρ cos φ). An arc runs from (φ_A, θ_A) to (φ_B, θ_B); its nodes
lie on the straight chart segment plus v times the chart vector that is the segment turned left by 90°
in the metric of the segment's middle, (a Δθ / r, −r Δφ / a) with a = g at the middle. Only
(φ_A, φ_B, Δθ, v) enter: invariance under rotation about the axis is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.nodal import Density, nodal_gradient, nodal_hessian, shape_values
from warpedfoam.kernels.quadrature import LobattoRule

#: Places of the six second derivatives of a density e(φ, φ', θ').
PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


@dataclass(frozen=True, eq=False)
class TubeArcs:
    """Nodes of arcs on a torus: angles and slopes (K, F), with the turned vector's derivatives."""

    rule: LobattoRule
    phi: Floats
    dphi: Floats
    dtheta: Floats
    v: Floats
    w: Floats
    turned: tuple[Floats, ...]


def tube_arcs(
    rule: LobattoRule,
    ring: float,
    tube: float,
    phi_a: Floats,
    phi_b: Floats,
    dtheta: Floats,
    offsets: Floats,
) -> TubeArcs:
    """Place the nodes; ``ring`` = R, ``tube`` = r, angles (F,), ``offsets`` (p − 1, F)."""
    v, w = shape_values(rule, offsets)
    middle = 0.5 * (phi_a + phi_b)
    a = ring + tube * np.cos(middle)
    a1 = -0.5 * tube * np.sin(middle)
    a2 = -0.25 * tube * np.cos(middle)
    dphi = phi_b - phi_a
    up, along = a * dtheta / tube, -tube * dphi / a
    phi = phi_a + rule.nodes[:, None] * dphi + v * up
    return TubeArcs(rule, phi, dphi + w * up, dtheta + w * along, v, w, (a, a1, a2, dphi, dtheta))


def film_density(arcs: TubeArcs, ring: float, radii: Floats, shares: Floats) -> Floats:
    """Σ_t shares_t · sqrt(ρ_t² φ'² + g_t² θ'²) at the nodes, (K, F); ρ_t = ``radii``."""
    cos = np.cos(arcs.phi)
    total = np.zeros_like(cos)
    for rho, share in zip(radii, shares, strict=True):
        total += share * np.sqrt((rho * arcs.dphi) ** 2 + ((ring + rho * cos) * arcs.dtheta) ** 2)
    return total


def film_density_first(arcs: TubeArcs, ring: float, radii: Floats, shares: Floats) -> tuple[Floats, Floats]:
    """The film density (K, F) and its derivatives by (φ, φ', θ'), (3, K, F)."""
    cos, sin = np.cos(arcs.phi), np.sin(arcs.phi)
    x, y = arcs.dphi, arcs.dtheta
    value = np.zeros_like(cos)
    first = np.zeros((3, *cos.shape))
    for rho, share in zip(radii, shares, strict=True):
        g = ring + rho * cos
        e = np.sqrt((rho * x) ** 2 + (g * y) ** 2)
        value += share * e
        scale = share / e
        first[0] -= scale * g * rho * sin * y * y
        first[1] += scale * rho * rho * x
        first[2] += scale * g * g * y
    return value, first


def film_density_second(arcs: TubeArcs, ring: float, radii: Floats, shares: Floats) -> Floats:
    """Second derivatives of the film density by (φ, φ', θ') at ``PAIRS``, (6, K, F)."""
    cos, sin = np.cos(arcs.phi), np.sin(arcs.phi)
    x, y = arcs.dphi, arcs.dtheta
    second = np.zeros((6, *cos.shape))
    for rho, share in zip(radii, shares, strict=True):
        g = ring + rho * cos
        gp = -rho * sin
        e = np.sqrt((rho * x) ** 2 + (g * y) ** 2)
        scale = share / e
        e0, e1, e2 = g * gp * y * y / e, rho * rho * x / e, g * g * y / e
        second[0] += scale * ((gp * gp - g * rho * cos) * y * y - e0 * e0)
        second[1] -= scale * e0 * e1
        second[2] += scale * (2.0 * g * gp * y - e0 * e2)
        second[3] += scale * (rho * rho - e1 * e1)
        second[4] -= scale * e1 * e2
        second[5] += scale * (g * g - e2 * e2)
    return second


def chain(arcs: TubeArcs, tube: float) -> tuple[Floats, Floats]:
    """First and second derivatives of (φ, φ', θ') at the nodes by y = (φ_A, φ_B, Δθ, v, v').

    Returns (3, 5, K, F) and (3, 5, 5, K, F).
    """
    a, a1, a2, dphi, dtheta = arcs.turned
    shape = arcs.phi.shape
    v, w, xi = arcs.v, arcs.w, arcs.rule.nodes[:, None]
    b, b1 = 1.0 / a, -a1 / a**2
    b2 = 2.0 * a1 * a1 / a**3 - a2 / a**2
    up, up_phi, up_theta = a * dtheta / tube, a1 * dtheta / tube, a / tube
    up_pp, up_pt = a2 * dtheta / tube, a1 / tube
    along = -tube * dphi * b
    along_1 = (-tube * (dphi * b1 - b), -tube * (dphi * b1 + b))
    first = np.zeros((3, 5, *shape))
    second = np.zeros((3, 5, 5, *shape))
    for row, factor, base, channel in ((0, v, (1.0 - xi, xi), 3), (1, w, (-1.0, 1.0), 4)):
        first[row, 0] = base[0] + factor * up_phi
        first[row, 1] = base[1] + factor * up_phi
        first[row, 2] = factor * up_theta
        first[row, channel] = up
        for i in (0, 1):
            second[row, i, :2] = factor * up_pp
            second[row, i, 2] = second[row, 2, i] = factor * up_pt
            second[row, i, channel] = second[row, channel, i] = up_phi
        second[row, 2, channel] = second[row, channel, 2] = up_theta
    first[2, 2] = 1.0
    first[2, 4] = along
    signs = (-1.0, 1.0)
    for i in (0, 1):
        first[2, i] = w * along_1[i]
        second[2, i, 4] = second[2, 4, i] = along_1[i]
        for j in (0, 1):
            second[2, i, j] = -tube * w * ((signs[i] + signs[j]) * b1 + dphi * b2)
    return first, second


def pulled_gradient(arcs: TubeArcs, first: Floats, jacobian: Floats) -> Floats:
    """Gradient (p + 2, F) by (φ_A, φ_B, Δθ, u) of Σ w_k e_k, from e's first derivatives (3, K, F)."""
    by_y = np.einsum("akf,aykf->ykf", first, jacobian)
    return nodal_gradient(arcs.rule, by_y[:3], by_y[3], by_y[4])


def pulled_hessian(arcs: TubeArcs, first: Floats, second: Floats, jacobian: Floats, bends: Floats) -> Floats:
    """Hessian (p + 2, p + 2, F) by (φ_A, φ_B, Δθ, u), from e's derivatives (3, …) and (6, …)."""
    full = np.einsum("akf,ayzkf->yzkf", first, bends)
    for (i, j), term in zip(PAIRS, second, strict=True):
        outer = (term * jacobian[i])[:, None] * jacobian[j][None]
        full += outer
        if i != j:
            full += outer.transpose(1, 0, 2, 3)
    density = Density(
        xx=full[:3, :3],
        xv=full[:3, 3],
        xw=full[:3, 4],
        vv=full[3, 3],
        vw=full[3, 4],
        ww=full[4, 4],
    )
    return nodal_hessian(arcs.rule, density)
