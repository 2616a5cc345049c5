"""A smooth surface through a triangle mesh: quartic jets at its nodes, blended into one implicit function.

Round node i, with local spacing h_i, heights over the plane of n_i are fitted by z = h q_i(u/h, v/h), q_i of
degree 4. With g_i(x) = n_i · (x − p_i) − z and φ_i = (1 − |x − p_i|²/ρ_i²)₊⁵, the surface is the zero set of
f = Σ φ_i g_i / Σ φ_i, four times differentiable.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.kernels.jets_compiled import RECORD, compiled

#: Exponents of u and v in the jets.
POWERS = tuple((i, total - i) for total in range(5) for i in range(total, -1, -1))
#: Width of the fit's weights in spacings, rounds of fit and tilt, and a hair of stiffness for scarce nodes.
WIDTH, ROUNDS, STIFFNESS = 2.0, 3, 1e-11
#: Nodes per pass of the fit, points per pass of the level function.
FIT_CHUNK, CHUNK = 8192, 1024
#: Nodes from which on loading compiled code, or compiling it once in two seconds, pays, if numba is there.
MANY = 1000


@dataclass(frozen=True, eq=False)
class Jets:
    """The jets of all nodes.

    ``points`` (n, 3), ``frames`` (n, 3, 3): rows e1, e2, n; ``spacing``, ``reach`` (n,): h and ρ;
    ``coefficients`` (n, 15) of q by `POWERS`.
    """

    points: Floats
    frames: Floats
    spacing: Floats
    reach: Floats
    coefficients: Floats

    @cached_property
    def balls(self) -> Floats:
        """Points and reaches side by side, (n, 4)."""
        return np.ascontiguousarray(self.records[:, :4])

    @cached_property
    def columns(self) -> Floats:
        """By number: p, ρ², 1/ρ², e1/h, e2/h, n, coefficients of h q, (29, n + 1); the last ball is empty."""
        h, square = self.spacing[:, None], self.reach[:, None] ** 2
        e1, e2, n = (self.frames[:, k] for k in range(3))
        rows = np.hstack([self.points, square, 1.0 / square, e1 / h, e2 / h, n, h * self.coefficients])
        out = np.zeros((rows.shape[1], len(rows) + 1))
        out[:, :-1] = rows.T
        out[3, -1] = -1.0
        return out

    @cached_property
    def records(self) -> Floats:
        """All of a node's numbers side by side, (n, 29), for `warpedfoam.kernels.jets_compiled`."""
        columns = [self.points, self.reach[:, None], self.spacing[:, None]]
        columns += [self.frames.reshape(-1, 9), self.coefficients]
        out = np.hstack(columns)
        assert out.shape[1] == RECORD
        return out


def frames_of(normals: Floats) -> Floats:
    """Orthonormal e1, e2, n as rows, (n, 3, 3), by the branchless rule of Duff et al. (2017)."""
    x, y, z = normals.T
    sign = np.where(z >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    second = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.stack([first, second, normals], axis=1)


def fit_jets(points: Floats, normals: Floats, spacing: Floats, reach: Floats, neighbours: Ints) -> Jets:
    """Fit each node's jet to its ``neighbours`` (n, k), padded with −1, itself among them.

    Weighted least squares, weights exp(−r²/(2 (2h)²)); the normal is then tilted to the fit's, twice.
    """
    coefficients = np.empty((len(points), len(POWERS)))
    frames = np.empty((len(points), 3, 3))
    fast = compiled() if len(points) >= MANY else None
    if fast is not None:
        lost = fast[0](points, normals, spacing, neighbours, WIDTH, ROUNDS, STIFFNESS, frames, coefficients)
        if lost >= 0:
            raise np.linalg.LinAlgError(f"no jet fits round node {lost}")
        return Jets(points, frames, spacing, reach, coefficients)
    stiffness = STIFFNESS * np.diag([0.0] + [1.0] * (len(POWERS) - 1))
    for lo in range(0, len(points), FIT_CHUNK):
        part = slice(lo, lo + FIT_CHUNK)
        near = neighbours[part]
        h = spacing[part, None]
        away = points[near] - points[part, None]
        distance = np.einsum("nkx,nkx->nk", away, away) / h**2
        weight = np.where(near >= 0, np.exp(-distance / (2.0 * WIDTH**2)), 0.0)
        normal = normals[part]
        for _ in range(ROUNDS):
            frame = frames_of(normal)
            u, v, z = np.moveaxis(np.einsum("nix,nkx->nki", frame, away) / h[..., None], 2, 0)
            monomials = [np.ones_like(u)]
            for i, j in POWERS[1:]:
                # one more factor on a monomial that is there already
                monomials.append(monomials[POWERS.index((i - 1, j) if i else (i, j - 1))] * (u if i else v))
            rows = np.stack(monomials, axis=1)
            weighted = rows * weight[:, None]
            left = np.matmul(weighted, rows.transpose(0, 2, 1))
            right = np.einsum("nik,nk->ni", weighted, z)
            size = np.einsum("nii->n", left)
            fit = np.linalg.solve(left + size[:, None, None] * stiffness, right[..., None])[..., 0]
            tilted = normal - fit[:, 1:2] * frame[:, 0] - fit[:, 2:3] * frame[:, 1]
            normal = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
        coefficients[part], frames[part] = fit, frame
    return Jets(points, frames, spacing, reach, coefficients)


def blended(
    jets: Jets, points: Floats, nearest: Ints, candidates: Ints, *, second: bool
) -> tuple[Floats, Floats, Floats | None]:
    """f (m,), ∇f (m, 3) and, if asked for, ∇²f (m, 3, 3).

    ``nearest`` (m,) is a node next to each point, ``candidates`` (n, k) the nodes that may reach points
    next to a node, padded with −1. Where no ball reaches, the nearest node's tangent plane takes over.
    """
    blend = compiled_blend(jets)
    if blend is not None:
        return blended_fast(blend, jets, points, nearest, candidates, second)
    value, gradient = np.empty(len(points)), np.empty((len(points), 3))
    hessian = np.empty((len(points), 3, 3)) if second else None
    for lo in range(0, len(points), CHUNK):
        part = slice(lo, lo + CHUNK)
        f, g, h = _blended(jets, points[part], nearest[part], candidates, second)
        value[part], gradient[part] = f, g
        if hessian is not None and h is not None:
            hessian[part] = h
    return value, gradient, hessian


def compiled_blend(jets: Jets) -> Callable[..., None] | None:
    """What `blended_fast` needs, or None for few nodes or without numba."""
    fast = compiled() if len(jets.points) >= MANY else None
    return None if fast is None else fast[1]


def blended_fast(
    blend: Callable[..., None], jets: Jets, points: Floats, nearest: Ints, candidates: Ints, second: bool
) -> tuple[Floats, Floats, Floats | None]:
    """`blended`, compiled; ``nearest`` need only be near."""
    count = len(points)
    value, gradient = np.empty(count), np.empty((count, 3))
    hessian = np.empty((count if second else 0, 3, 3))
    blend(jets.balls, jets.records, points, nearest, candidates, second, value, gradient, hessian)
    return value, gradient, hessian if second else None


def _blended(
    jets: Jets, points: Floats, nearest: Ints, candidates: Ints, second: bool
) -> tuple[Floats, Floats, Floats | None]:
    """`blended` of few points, by columns: a long array for each number of the pairs of point and ball."""
    near = candidates[nearest]
    away = [points[:, k, None] - jets.columns[k][near] for k in range(3)]
    with np.errstate(over="ignore"):
        square = away[0] * away[0] + away[1] * away[1] + away[2] * away[2]
    inside = square < jets.columns[3][near]
    lost = np.flatnonzero(~inside.any(axis=1))
    # a point that no ball reaches is given weight 1 at a node, so that nothing is 0/0, and its plane below
    inside[lost, 0] = True
    count = np.count_nonzero(inside, axis=1)
    first = np.cumsum(count) - count
    pair = np.flatnonzero(inside)
    node = near.ravel()[pair]
    r = np.stack([a.ravel()[pair] for a in away])
    r[:, first[lost]] = 0.0
    x, y, z = r
    _, _, _, _, thin, ax, ay, az, bx, by, bz, nx, ny, nz, *c = np.take(jets.columns, node, axis=1)
    u, v = ax * x + ay * y + az * z, bx * x + by * y + bz * z
    # h q by rising powers of u, each a polynomial in v
    p0 = c[0] + v * (c[2] + v * (c[5] + v * (c[9] + v * c[14])))
    p1 = c[1] + v * (c[4] + v * (c[8] + v * c[13]))
    p2 = c[3] + v * (c[7] + v * c[12])
    p3 = c[6] + v * c[11]
    p4 = c[10]
    d0 = c[2] + v * (2.0 * c[5] + v * (3.0 * c[9] + v * (4.0 * c[14])))
    d1 = c[4] + v * (2.0 * c[8] + v * (3.0 * c[13]))
    d2 = c[7] + v * (2.0 * c[12])
    d3 = c[11]
    g = nx * x + ny * y + nz * z - (p0 + u * (p1 + u * (p2 + u * (p3 + u * p4))))
    by_u = p1 + u * (2.0 * p2 + u * (3.0 * p3 + u * (4.0 * p4)))
    by_v = d0 + u * (d1 + u * (d2 + u * d3))
    gx, gy, gz = nx - by_u * ax - by_v * bx, ny - by_u * ay - by_v * by, nz - by_u * az - by_v * bz
    a = np.maximum(1.0 - square.ravel()[pair] * thin, 0.0)
    a[first[lost]] = 1.0
    cube = a * a * a
    phi = cube * a * a
    slope = -10.0 * thin * (cube * a)
    sx, sy, sz = slope * x, slope * y, slope * z
    sums = np.empty((8, len(a)))
    sums[0], sums[1], sums[2], sums[3], sums[4] = phi, phi * g, sx, sy, sz
    sums[5], sums[6], sums[7] = sx * g + phi * gx, sy * g + phi * gy, sz * g + phi * gz
    total, value, *rest = np.add.reduceat(sums, first, axis=1)
    value /= total
    dtotal, rise = np.array(rest[:3]), np.array(rest[3:])
    gradient = np.ascontiguousarray(((rise - value * dtotal) / total).T)
    home = nearest[lost]
    plane = jets.frames[home, 2]
    value[lost] = np.einsum("lx,lx->l", plane, points[lost] - jets.points[home])
    gradient[lost] = plane
    if not second:
        return value, gradient, None
    uu = phi * (2.0 * p2 + u * (6.0 * p3 + u * (12.0 * p4)))
    uv = phi * (d1 + u * (2.0 * d2 + u * (3.0 * d3)))
    e0, e1 = 2.0 * c[5] + v * (6.0 * c[9] + v * (12.0 * c[14])), 2.0 * c[8] + v * (6.0 * c[13])
    vv = phi * (e0 + u * (e1 + u * (2.0 * c[12])))
    mx, my, mz = uu * ax + uv * bx, uu * ay + uv * by, uu * az + uv * bz
    ox, oy, oz = uv * ax + vv * bx, uv * ay + vv * by, uv * az + vv * bz
    # φ'' (g − f): the − f S'' of the quotient taken in at once
    left = g - np.repeat(value, count)
    twice, flat = 80.0 * cube * thin * thin * left, slope * left
    tx, ty, tz = twice * x, twice * y, twice * z
    terms = np.empty((6, len(a)))
    terms[0] = tx * x + flat + 2.0 * sx * gx - mx * ax - ox * bx
    terms[1] = tx * y + sx * gy + sy * gx - mx * ay - ox * by
    terms[2] = tx * z + sx * gz + sz * gx - mx * az - ox * bz
    terms[3] = ty * y + flat + 2.0 * sy * gy - my * ay - oy * by
    terms[4] = ty * z + sy * gz + sz * gy - my * az - oy * bz
    terms[5] = tz * z + flat + 2.0 * sz * gz - mz * az - oz * bz
    hessian = np.add.reduceat(terms, first, axis=1)[[0, 1, 2, 1, 3, 4, 2, 4, 5]].T.reshape(-1, 3, 3)
    mixed = gradient[:, :, None] * dtotal.T[:, None, :]
    hessian = (hessian - mixed - mixed.transpose(0, 2, 1)) / total[:, None, None]
    hessian[lost] = 0.0
    return value, gradient, hessian
