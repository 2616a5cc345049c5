"""The loops of `warpedfoam.kernels.jets` for numba, 5 to 10 times faster; numpy's are the model.

Plain functions here, compiled by `compiled` when a large mesh first needs them, so that importing this file
needs no numba and costs nothing. They call no helpers: numba keeps what it compiled from one run to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from warpedfoam.arrays import Floats, Ints

#: Columns of a node's record: point, reach, spacing, frame, coefficients.
RECORD = 29


@cache
def compiled() -> tuple[Callable[..., Any], Callable[..., Any]] | None:
    """`fit` and `blend` compiled, or None without numba or where it may not compile."""
    try:
        import numba
    except ImportError:
        return None
    config: Any = numba.config
    if config.DISABLE_JIT:
        return None
    try:
        make = numba.njit(cache=True, error_model="numpy")
        return make(fit), make(blend)
    except RuntimeError:
        # nowhere to keep compiled code
        make = numba.njit(error_model="numpy")
        return make(fit), make(blend)


def fit(
    points: Floats,
    normals: Floats,
    spacing: Floats,
    neighbours: Ints,
    width: float,
    rounds: int,
    stiffness: float,
    frames: Floats,
    coefficients: Floats,
) -> int:
    """Fill ``frames`` (n, 3, 3) and ``coefficients`` (n, 15); returns a node whose fit failed, or −1."""
    count, most = neighbours.shape
    rows = np.empty((most, 15))
    weight = np.empty(most)
    left = np.empty((15, 15))
    right = np.empty(15)
    for i in range(count):
        h = spacing[i]
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        many = 0
        while many < most and neighbours[i, many] >= 0:
            j = neighbours[i, many]
            dx, dy, dz = points[j, 0] - px, points[j, 1] - py, points[j, 2] - pz
            weight[many] = np.exp(-(dx * dx + dy * dy + dz * dz) / (2.0 * width * width * h * h))
            many += 1
        for _ in range(rounds):
            sign = 1.0 if nz >= 0.0 else -1.0
            a = -1.0 / (sign + nz)
            b = nx * ny * a
            e1x, e1y, e1z = 1.0 + sign * nx * nx * a, sign * b, -sign * nx
            e2x, e2y, e2z = b, sign + ny * ny * a, -ny
            for p in range(15):
                right[p] = 0.0
                for q in range(15):
                    left[p, q] = 0.0
            for k in range(many):
                j = neighbours[i, k]
                dx, dy, dz = (points[j, 0] - px) / h, (points[j, 1] - py) / h, (points[j, 2] - pz) / h
                u = e1x * dx + e1y * dy + e1z * dz
                v = e2x * dx + e2y * dy + e2z * dz
                z = nx * dx + ny * dy + nz * dz
                row = rows[k]
                row[0] = 1.0
                row[1], row[2] = u, v
                row[3], row[4], row[5] = u * u, u * v, v * v
                row[6], row[7], row[8], row[9] = u * row[3], u * row[4], u * row[5], v * row[5]
                row[10], row[11], row[12] = u * row[6], u * row[7], u * row[8]
                row[13], row[14] = u * row[9], v * row[9]
                w = weight[k]
                for p in range(15):
                    wp = w * row[p]
                    right[p] += wp * z
                    for q in range(p + 1):
                        left[p, q] += wp * row[q]
            size = 0.0
            for p in range(15):
                size += left[p, p]
            for p in range(1, 15):
                left[p, p] += stiffness * size
            # Cholesky's factor, in place
            for p in range(15):
                for q in range(p + 1):
                    total = left[p, q]
                    for r in range(q):
                        total -= left[p, r] * left[q, r]
                    if p == q:
                        if not total > 0.0:
                            return i
                        left[p, p] = np.sqrt(total)
                    else:
                        left[p, q] = total / left[q, q]
            for p in range(15):
                total = right[p]
                for r in range(p):
                    total -= left[p, r] * right[r]
                right[p] = total / left[p, p]
            for p in range(14, -1, -1):
                total = right[p]
                for r in range(p + 1, 15):
                    total -= left[r, p] * right[r]
                right[p] = total / left[p, p]
            frames[i, 0, 0], frames[i, 0, 1], frames[i, 0, 2] = e1x, e1y, e1z
            frames[i, 1, 0], frames[i, 1, 1], frames[i, 1, 2] = e2x, e2y, e2z
            frames[i, 2, 0], frames[i, 2, 1], frames[i, 2, 2] = nx, ny, nz
            tx = nx - right[1] * e1x - right[2] * e2x
            ty = ny - right[1] * e1y - right[2] * e2y
            tz = nz - right[1] * e1z - right[2] * e2z
            length = np.sqrt(tx * tx + ty * ty + tz * tz)
            nx, ny, nz = tx / length, ty / length, tz / length
        for p in range(15):
            coefficients[i, p] = right[p]
    return -1


def blend(
    balls: Floats,
    records: Floats,
    points: Floats,
    nearest: Ints,
    candidates: Ints,
    second: bool,
    value: Floats,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Fill ``value`` (m,), ``gradient`` (m, 3) and, if ``second``, ``hessian`` (m, 3, 3).

    ``nearest`` (m,) are nodes close by: steps to nearer candidates lead from there to the nearest.
    """
    most = candidates.shape[1]
    near = np.empty(most, dtype=np.int64)
    square = np.empty(most)
    kept = np.empty((most, 6))
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        home = nearest[i]
        many = 0
        while True:
            many = 0
            ax, ay, az = x - balls[home, 0], y - balls[home, 1], z - balls[home, 2]
            least, step = ax * ax + ay * ay + az * az, home
            for k in range(most):
                j = candidates[home, k]
                if j < 0:
                    break
                rx, ry, rz = x - balls[j, 0], y - balls[j, 1], z - balls[j, 2]
                d = rx * rx + ry * ry + rz * rz
                if d < least:
                    least, step = d, j
                if d < balls[j, 3] * balls[j, 3]:
                    near[many], square[many] = j, d
                    many += 1
            if step == home:
                break
            home = step
        if many == 0:
            # no ball reaches: the nearest node's tangent plane
            fx, fy, fz = records[home, 11], records[home, 12], records[home, 13]
            value[i] = fx * (x - records[home, 0]) + fy * (y - records[home, 1]) + fz * (z - records[home, 2])
            gradient[i, 0], gradient[i, 1], gradient[i, 2] = fx, fy, fz
            if second:
                hessian[i] = 0.0
            continue
        total = upper = 0.0
        tx = ty = tz = sx = sy = sz = 0.0
        h00 = h01 = h02 = h11 = h12 = h22 = 0.0
        for k in range(many):
            c = records[near[k]]
            rx, ry, rz = x - c[0], y - c[1], z - c[2]
            rho2, unit = c[3] * c[3], c[4]
            u = (c[5] * rx + c[6] * ry + c[7] * rz) / unit
            v = (c[8] * rx + c[9] * ry + c[10] * rz) / unit
            # coefficients by rising powers of u, each a polynomial in v
            p0 = c[14] + v * (c[16] + v * (c[19] + v * (c[23] + v * c[28])))
            p1 = c[15] + v * (c[18] + v * (c[22] + v * c[27]))
            p2 = c[17] + v * (c[21] + v * c[26])
            p3 = c[20] + v * c[25]
            p4 = c[24]
            d0 = c[16] + v * (2.0 * c[19] + v * (3.0 * c[23] + v * 4.0 * c[28]))
            d1 = c[18] + v * (2.0 * c[22] + v * 3.0 * c[27])
            d2 = c[21] + v * 2.0 * c[26]
            d3 = c[25]
            q = p0 + u * (p1 + u * (p2 + u * (p3 + u * p4)))
            qu = p1 + u * (2.0 * p2 + u * (3.0 * p3 + u * 4.0 * p4))
            qv = d0 + u * (d1 + u * (d2 + u * d3))
            g = c[11] * rx + c[12] * ry + c[13] * rz - unit * q
            gx = c[11] - qu * c[5] - qv * c[8]
            gy = c[12] - qu * c[6] - qv * c[9]
            gz = c[13] - qu * c[7] - qv * c[10]
            a = max(1.0 - square[k] / rho2, 0.0)
            a4 = a * a * a * a
            phi = a4 * a
            slope = -10.0 * a4 / rho2
            total += phi
            upper += phi * g
            tx += slope * rx
            ty += slope * ry
            tz += slope * rz
            sx += slope * rx * g + phi * gx
            sy += slope * ry * g + phi * gy
            sz += slope * rz * g + phi * gz
            if second:
                quu = 2.0 * p2 + u * (6.0 * p3 + u * 12.0 * p4)
                quv = d1 + u * (2.0 * d2 + u * 3.0 * d3)
                e0 = 2.0 * c[19] + v * (6.0 * c[23] + v * 12.0 * c[28])
                e1 = 2.0 * c[22] + v * 6.0 * c[27]
                qvv = e0 + u * (e1 + u * 2.0 * c[26])
                uu, uv, vv = -phi * quu / unit, -phi * quv / unit, -phi * qvv / unit
                mx, my, mz = uu * c[5] + uv * c[8], uu * c[6] + uv * c[9], uu * c[7] + uv * c[10]
                ox, oy, oz = uv * c[5] + vv * c[8], uv * c[6] + vv * c[9], uv * c[7] + vv * c[10]
                h00 += mx * c[5] + ox * c[8] + 2.0 * slope * rx * gx
                h01 += mx * c[6] + ox * c[9] + slope * (rx * gy + ry * gx)
                h02 += mx * c[7] + ox * c[10] + slope * (rx * gz + rz * gx)
                h11 += my * c[6] + oy * c[9] + 2.0 * slope * ry * gy
                h12 += my * c[7] + oy * c[10] + slope * (ry * gz + rz * gy)
                h22 += mz * c[7] + oz * c[10] + 2.0 * slope * rz * gz
                kept[k, 0], kept[k, 1], kept[k, 2] = rx, ry, rz
                kept[k, 3], kept[k, 4], kept[k, 5] = g, 80.0 * a * a * a / (rho2 * rho2), slope
        f = upper / total
        sx, sy, sz = (sx - f * tx) / total, (sy - f * ty) / total, (sz - f * tz) / total
        value[i] = f
        gradient[i, 0], gradient[i, 1], gradient[i, 2] = sx, sy, sz
        if second:
            for k in range(many):
                rx, ry, rz = kept[k, 0], kept[k, 1], kept[k, 2]
                over = kept[k, 3] - f
                twice, flat = kept[k, 4] * over, kept[k, 5] * over
                h00 += twice * rx * rx + flat
                h01 += twice * rx * ry
                h02 += twice * rx * rz
                h11 += twice * ry * ry + flat
                h12 += twice * ry * rz
                h22 += twice * rz * rz + flat
            hessian[i, 0, 0] = (h00 - 2.0 * sx * tx) / total
            hessian[i, 1, 1] = (h11 - 2.0 * sy * ty) / total
            hessian[i, 2, 2] = (h22 - 2.0 * sz * tz) / total
            hessian[i, 0, 1] = hessian[i, 1, 0] = (h01 - sx * ty - sy * tx) / total
            hessian[i, 0, 2] = hessian[i, 2, 0] = (h02 - sx * tz - sz * tx) / total
            hessian[i, 1, 2] = hessian[i, 2, 1] = (h12 - sy * tz - sz * ty) / total
