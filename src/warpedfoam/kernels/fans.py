"""Integrals over the inside of closed loops of arcs on any smooth surface, by fans of quadrature points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.height_arcs import Foot, dots
from warpedfoam.kernels.loops import Loops
from warpedfoam.kernels.quadrature import LobattoRule, gauss

#: Half-films per pass.
CHUNK = 4096

#: From points (n, 3) near the surface, along axes: normals where they land, and the density to integrate.
Landing = Callable[[Floats, Floats], tuple[Floats, Floats]]


def fan_integrals(
    rule: LobattoRule,
    points: Floats,
    loops: Loops,
    shifts: Floats | None,
    foot: Foot,
    land: Landing,
    unit: Callable[[Floats], Floats],
    n_radial: int,
) -> Floats:
    """∫ w dA inside each loop, (n_loops,), from the nodes (K, F, 3) of its arcs.

    Rays run from a centre c to the arcs x(ξ) and down to the surface along the loop's own axis m, the
    direction of its vector area ½ ∮ x × dx: dA = r m · ((x − c) × x') / (n · m) dr dξ.
    ``shifts`` (m, 3) move the half-arcs of each loop together. Gauss points: ``n_radial`` on a ray, two
    more than the film's order along it, but no fewer than on a ray (three where rays have two).
    """
    xi, omega = gauss(max(rule.order + 2, n_radial) if n_radial > 2 else 3)
    values = rule.interpolation(xi)
    curve = np.tensordot(values, points, 1)
    slope = np.tensordot(omega[:, None] * (values @ rule.derivative), points, 1)
    film, owner = loops.halves >> 1, np.repeat(np.arange(len(loops.starts)), loops.sizes)
    sign = np.where(loops.halves & 1, -1.0, 1.0)[:, None]
    length = np.linalg.norm(slope, axis=2)
    span = length.sum(axis=0)[film]
    weight = np.add.reduceat(span, loops.starts)
    moment = (length[..., None] * curve).sum(axis=0)[film]
    if shifts is not None:
        moment += span[:, None] * shifts
    centre = np.add.reduceat(moment, loops.starts) / weight[:, None]
    twist = np.cross(curve, slope).sum(axis=0)
    run = slope.sum(axis=0)
    # vector area about the loop's own centre, not the origin: far away loops keep their digits
    origin = centre[owner] if shifts is None else centre[owner] - shifts
    turned = np.add.reduceat(sign * (twist[film] - np.cross(origin, run[film])), loops.starts)
    size = np.linalg.norm(turned, axis=1, keepdims=True)
    axis = turned / np.maximum(size, 1e-300)
    # a loop without area has no axis of its own
    none = np.flatnonzero(size[:, 0] <= 1e-12 * weight**2)
    axis[none] = unit(centre[none])
    centre = foot(centre, axis)
    normal, _ = land(centre, axis)
    tilt = normal / dots(normal, axis)[:, None]
    radii, shares = gauss(n_radial)
    out = np.empty(len(film))
    for lo in range(0, len(film), CHUNK):
        part = slice(lo, lo + CHUNK)
        own, arcs = owner[part], film[part]
        m, c = axis[own], centre[own]
        arm = curve[:, arcs] - (c if shifts is None else c - shifts[part])
        flux = dots(np.cross(arm, slope[:, arcs]), m) * sign[part, 0]
        # the parabola that starts in the centre's tangent plane and ends on the film is nearly there
        r = radii[:, None, None, None]
        rise = -dots(arm, tilt[own])[..., None] * m
        flat = (c + r * arm + r * (1.0 - r) * rise).reshape(-1, 3)
        down = np.broadcast_to(m, (len(radii), *arm.shape)).reshape(-1, 3)
        normal, density = land(flat, down)
        ratio = (density / dots(normal, down)).reshape(len(radii), *arm.shape[:2])
        out[part] = np.einsum("r,rqf,qf->f", shares * radii, ratio, flux)
    total: Floats = np.add.reduceat(out, loops.starts)
    return total
