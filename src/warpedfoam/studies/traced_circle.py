"""Geodesic circles by tracing geodesics and the Jacobi equation along them.

From the centre q in the direction θ, with the shape operator W of the surface,

    x' = v,   v' = −(v·W v) n,   n' = W v,   m'' = −G m,   m(0) = 0, m'(0) = 1,   a' = m,

where m dθ is how far neighbouring geodesics have spread. Then C = ∫ m(ρ) dθ and A = ∫ a(ρ) dθ, and the
trapezoid rule in θ converges faster than any power, because m is smooth and periodic.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from warpedfoam.arrays import Bools, Floats
from warpedfoam.errors import ConvergenceError
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.studies.rims import OverRim, beyond, near_rim
from warpedfoam.surfaces.places import Places
from warpedfoam.surfaces.protocol import Surface

if TYPE_CHECKING:
    from scipy.integrate import DOP853

#: A run at so many times the tolerance tells how far off the finer one is at most.
COARSER = 100.0
#: Directions at most, and change of C and A, in tolerances, at which no more are added.
MOST_DIRECTIONS, ENOUGH = 1024, 0.1
#: Places on each step of the integration at which a geodesic may be found beyond the rim; directions and
#: tolerance when nothing else is asked.
RIM_PLACES, RIM_DIRECTIONS, RIM_TOLERANCE = 6, 64, 1e-6
#: Points of the circle in which crossings with itself are looked for.
CROSSING_POINTS = 1024


@dataclass(frozen=True, eq=False)
class TracedCircle:
    """Points (n, 3) in order; C and A with their error estimates."""

    points: Floats
    perimeter: float
    area: float
    perimeter_error: float
    area_error: float


def traced_circle(
    surface: Surface, centre: Floats, radius: float, n_directions: int, tolerance: float
) -> TracedCircle:
    """Trace from ``centre`` (3,), a point of the surface; directions are doubled until C and A stay.

    Raises
    ------
    ValueError
        If a geodesic meets a conjugate point or the rim before ``radius``, or the circle crosses itself.
    ConvergenceError
        If the integration fails.
    """
    frame = surface.vertex_frames(centre[None])[0]
    count = n_directions
    angles = 2.0 * np.pi * np.arange(count) / count
    ends = _trace(surface, centre, frame, angles, radius, tolerance)
    rough = _trace(surface, centre, frame, angles[:: max(1, count // 16)], radius, COARSER * tolerance)
    steps = np.abs(ends[:: max(1, count // 16), 9:12:2] - rough[:, 9:12:2]).max(axis=0)
    totals = ends[:, 9:12:2].mean(axis=0)
    change = np.abs(totals - ends[::2, 9:12:2].mean(axis=0))
    while (change > ENOUGH * tolerance * totals).any() and count < MOST_DIRECTIONS:
        between = _trace(surface, centre, frame, angles + np.pi / count, radius, tolerance)
        ends = np.stack([ends, between], axis=1).reshape(2 * count, -1)
        count *= 2
        angles = 2.0 * np.pi * np.arange(count) / count
        change = np.abs(ends[:, 9:12:2].mean(axis=0) - totals)
        totals = ends[:, 9:12:2].mean(axis=0)
    points = centre + radius * ends[:, :3]
    _require_simple(surface, points, radius)
    perimeter, area = 2.0 * np.pi * totals * [radius, radius**2]
    # what doubling changed, what tighter steps changed, and round-off
    errors = 2.0 * np.pi * (change + steps + 1e-15 * totals) * [radius, radius**2]
    settled = surface.project(points)
    return TracedCircle(settled, float(perimeter), float(area), float(errors[0]), float(errors[1]))


def _trace(
    surface: Surface, centre: Floats, frame: Floats, angles: Floats, radius: float, tolerance: float
) -> Floats:
    """States (directions, 12) at the radius: (x − q)/ρ, v, n, m/ρ, m', a/ρ²."""
    from scipy.integrate import DOP853

    n = len(angles)
    start = np.zeros((n, 12))
    start[:, 3:6] = np.cos(angles)[:, None] * frame[0] + np.sin(angles)[:, None] * frame[1]
    start[:, 6:9] = np.cross(frame[0], frame[1])
    start[:, 10] = 1.0

    def rate(_: float, flat: Floats) -> Floats:
        state = flat.reshape(n, 12)
        out = np.empty_like(state)
        shape = surface.shape_operators(centre + radius * state[:, :3], project=False)
        if not np.isfinite(shape).all():
            raise ConvergenceError(
                "the surface has no shape operator on a geodesic: it has left the surface; "
                "take a smaller radius"
            )
        along = state[:, 3:6]
        turn = radius * np.einsum("nxy,ny->nx", shape, along)
        gauss = 0.5 * (np.einsum("nxx->n", shape) ** 2 - np.einsum("nxy,nxy->n", shape, shape))
        out[:, 0:3] = along
        out[:, 3:6] = -np.einsum("nx,nx->n", turn, along)[:, None] * state[:, 6:9]
        out[:, 6:9] = turn
        out[:, 9] = state[:, 10]
        out[:, 10] = -(radius**2) * gauss * state[:, 9]
        out[:, 11] = state[:, 9]
        return out.ravel()

    rim_near = near_rim(surface, centre, radius)
    solver = DOP853(rate, 0.0, start.ravel(), 1.0, rtol=tolerance, atol=0.1 * tolerance)
    while solver.status == "running":
        message = solver.step()
        if message is not None:
            raise ConvergenceError(
                f"tracing geodesics failed at {solver.t * radius:g} of {radius:g}: {message}"
            )
        if rim_near:
            _require_inside_rim(surface, centre, radius, solver)
        spread = solver.y.reshape(n, 12)[:, 9]
        if (spread <= 0.0).any():
            worst = np.degrees(angles[int(spread.argmin())])
            raise ValueError(
                f"radius must be less than about {solver.t * radius:.4g}, where the geodesic in direction "
                f"{worst:.0f}° has a conjugate point (m reaches 0) and the circle folds, got {radius:g}"
            )
    out: Floats = solver.y.reshape(n, 12)
    return out


def require_off_rim(surface: Surface, centre: Floats, radius: float) -> None:
    """Refuse a disk whose radii cross the rim.

    Raises
    ------
    ValueError
        If one does, or the tracing comes to an end for another reason.
    """
    if near_rim(surface, centre, radius):
        angles = 2.0 * np.pi * np.arange(RIM_DIRECTIONS) / RIM_DIRECTIONS
        _trace(surface, centre, surface.vertex_frames(centre[None])[0], angles, radius, RIM_TOLERANCE)


def _require_inside_rim(surface: Surface, centre: Floats, radius: float, solver: DOP853[Any]) -> None:
    """Look at the last step of every geodesic."""
    way = solver.dense_output()
    for place in np.linspace(solver.t_old, solver.t, RIM_PLACES + 1)[1:]:
        at = centre + radius * way(place).reshape(-1, 12)[:, :3]
        if beyond(surface, at).any():
            x, y, z = at[int(beyond(surface, at).argmax())]
            # no geodesic is shorter than the straight way
            away = np.linalg.norm(surface.rim.nearest(centre[None])[0] - centre) if surface.rim else 0.0
            raise OverRim(
                f"radius must be at most about {away:.4g}, got {radius:g}: a geodesic from the centre leaves "
                f"the surface over its rim near ({x:.4g}, {y:.4g}, {z:.4g})"
            )


def _require_simple(surface: Surface, points: Floats, radius: float) -> None:
    """Refuse a circle that crosses itself: the radius exceeds the injectivity radius."""
    at = crossing(surface, _refined(points), surface.period)
    if at is not None:
        x, y, z = at
        raise ValueError(
            f"radius must be smaller, got {radius:g}: the circle crosses itself near "
            f"({x:.4g}, {y:.4g}, {z:.4g}), so that geodesics from the centre meet again within it "
            "(injectivity radius) and C would count twice"
        )


def _refined(points: Floats) -> Floats:
    """Trigonometric interpolation of a closed curve at more points."""
    n = len(points)
    many = max(CROSSING_POINTS, n)
    if many == n:
        return points
    modes = np.fft.rfft(points, axis=0)
    if n % 2 == 0:
        modes[-1] *= 0.5
    out: Floats = np.fft.irfft(modes, many, axis=0) * (many / n)
    return out


def crossing(surface: Surface, points: Floats, period: Floats | None) -> Floats | None:
    """A place where the closed polygon of ``points`` crosses itself on the surface, if there is one.

    Pairs of sides that come within a side's length, on the same sheet, are laid into their tangent plane.
    """
    n = len(points)
    ahead = nearest_image(np.roll(points, -1, axis=0) - points, period)
    middle = points + 0.5 * ahead
    longest = float(np.linalg.norm(ahead, axis=1).max())
    i, j = Places(middle, period).pairs(1.01 * longest).T
    apart = np.minimum(j - i, n - (j - i)) > 1
    i, j = i[apart], j[apart]
    if not len(i):
        return None
    between = nearest_image(points[j] - points[i], period)
    normal = surface.normals(middle)
    same: Bools = np.einsum("nx,nx->n", normal[i], normal[j]) > 0.0
    # two sheets close to each other: the way across is along the normal
    rise = np.abs(np.einsum("nx,nx->n", nearest_image(middle[j] - middle[i], period), normal[i]))
    same &= rise <= 0.3 * longest
    i, j, between = i[same], j[same], between[same]
    p, q, up = ahead[i], ahead[j], normal[i]

    def wedge(a: Floats, b: Floats) -> Floats:
        out: Floats = np.einsum("nx,nx->n", np.cross(a, b), up)
        return out

    across = wedge(p, q)
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = wedge(between, q) / across, wedge(between, p) / across
        hit = np.flatnonzero((s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0))
    if not hit.size:
        return None
    found: Floats = points[i[hit[0]]]
    return found
