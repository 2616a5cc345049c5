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
FIT_CHUNK, CHUNK = 8192, 1536
#: Nodes from which on compiling is worth its second or two, if numba is there.
MANY = 20_000


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
    near = candidates[nearest]
    away = points[:, None] - jets.points[near]
    square = np.einsum("mkx,mkx->mk", away, away)
    inside = (square < jets.reach[near] ** 2) & (near >= 0)
    lost = ~inside.any(axis=1)
    # points that no ball reaches are given their nearest node, and mended below
    inside[lost, 0] = True
    row, _ = np.nonzero(inside)
    first = np.flatnonzero(np.diff(row, prepend=-1))
    node = near[inside]
    node[first[lost]] = nearest[lost]
    r = points[row] - jets.points[node]
    unit, rho = jets.spacing[node], jets.reach[node]
    frame = jets.frames[node]
    local = np.einsum("lix,lx->li", frame, r)
    q, slopes, bends = _quartic(jets.coefficients[node], local[:, 0] / unit, local[:, 1] / unit, second)
    g = local[:, 2] - unit * q
    dg = frame[:, 2] - slopes[:, :1] * frame[:, 0] - slopes[:, 1:] * frame[:, 1]
    a = np.maximum(1.0 - np.einsum("lx,lx->l", r, r) / rho**2, 0.0)
    a[first[lost]] = 1.0
    phi = a**5
    dphi = (-10.0 * a**4 / rho**2)[:, None] * r
    total = np.add.reduceat(phi, first)
    value = np.add.reduceat(phi * g, first) / total
    dtotal = np.add.reduceat(dphi, first)
    gradient = np.add.reduceat(dphi * g[:, None] + phi[:, None] * dg, first)
    gradient = (gradient - value[:, None] * dtotal) / total[:, None]
    # the tangent plane for the lost
    plane = jets.frames[nearest[lost], 2]
    value[lost] = np.einsum("lx,lx->l", plane, points[lost] - jets.points[nearest[lost]])
    gradient[lost] = plane
    if not second or bends is None:
        return value, gradient, None
    e1, e2 = frame[:, 0], frame[:, 1]
    uu, uv, vv = (-phi * b / unit for b in bends)
    across = uu[:, None] * e1 + uv[:, None] * e2
    down = uv[:, None] * e1 + vv[:, None] * e2
    terms = across[:, :, None] * e1[:, None, :] + down[:, :, None] * e2[:, None, :]
    pair = dphi[:, :, None] * dg[:, None, :]
    terms += pair + pair.transpose(0, 2, 1)
    # φ'' (g − f): the − f S'' of the quotient taken in at once
    left = g - value[row]
    terms += (80.0 * a**3 / rho**4 * left)[:, None, None] * (r[:, :, None] * r[:, None, :])
    terms += (-10.0 * a**4 / rho**2 * left)[:, None, None] * np.eye(3)
    hessian = np.add.reduceat(terms, first)
    mixed = gradient[:, :, None] * dtotal[:, None, :]
    hessian = (hessian - mixed - mixed.transpose(0, 2, 1)) / total[:, None, None]
    hessian[lost] = 0.0
    return value, gradient, hessian


def _quartic(c: Floats, u: Floats, v: Floats, second: bool) -> tuple[Floats, Floats, list[Floats] | None]:
    """q and its derivatives from coefficients (l, 15): in u, Horner's rule with polynomials in v."""
    table = {power: c[:, k] for k, power in enumerate(POWERS)}
    # rows[i]: coefficient of u^i as a polynomial in v, and its first two derivatives
    rows, first, bend = [], [], []
    for i in range(5):
        column = [table[i, j] for j in range(5 - i)]
        rows.append(_horner(column, v))
        first.append(_horner([j * column[j] for j in range(1, len(column))], v))
        bend.append(_horner([j * (j - 1) * column[j] for j in range(2, len(column))], v))
    q = _horner(rows, u)
    by_u = _horner([i * rows[i] for i in range(1, 5)], u)
    by_v = _horner(first, u)
    slopes = np.stack([by_u, by_v], axis=1)
    if not second:
        return q, slopes, None
    uu = _horner([i * (i - 1) * rows[i] for i in range(2, 5)], u)
    uv = _horner([i * first[i] for i in range(1, 5)], u)
    return q, slopes, [uu, uv, _horner(bend, u)]


def _horner(coefficients: list[Floats], x: Floats) -> Floats:
    """Σ c_k x^k; nothing gives 0."""
    total = np.zeros_like(x)
    for c in reversed(coefficients):
        total = total * x + c
    return total
