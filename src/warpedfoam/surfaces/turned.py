"""Triangulations and rims of surfaces of revolution about the z axis that end in circles or poles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from warpedfoam.arrays import Floats, Ints, frozen
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.rings import stitched_rings

#: Points of a profile from which arc lengths are summed, points of a rim.
LOOKS, RIM_POINTS = 4000, 256

#: Radii at heights (n,).
Profile = Callable[[Floats], Floats]


def circle(radius: float, height: float, *, turned: bool) -> Floats:
    """Points round a circle, (n, 3): counter-clockwise seen from above, clockwise if ``turned``."""
    angle = 2.0 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS * (-1.0 if turned else 1.0)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(RIM_POINTS, height)], axis=1)


def turned_rims(profile: Profile, bottom: float, top: float, poles: tuple[bool, bool]) -> list[list[Floats]]:
    """The circles where a profile ends, each a loop of one side with the surface on the left."""
    low, high = profile(np.array([bottom, top])).tolist()
    ends = ((low, bottom, False), (high, top, True))
    return [
        [circle(radius, height, turned=turned)]
        for (radius, height, turned), pole in zip(ends, poles, strict=True)
        if not pole
    ]


def turned_mesh(
    profile: Profile,
    bottom: float,
    top: float,
    n_nodes: int,
    poles: tuple[bool, bool] = (False, False),
    *,
    flat: bool = False,
) -> TriangleMesh:
    """Rings of nodes at even distances along the profile, as even round it; ``poles`` close it.

    A ``flat`` one has no height: seen from above.
    """
    # heights crowd at the ends, where a profile that reaches the axis is steep
    z = 0.5 * (bottom + top) - 0.5 * (top - bottom) * np.cos(np.linspace(0.0, np.pi, LOOKS))
    r = profile(z)
    way = np.concatenate([[0.0], np.cumsum(np.hypot((not flat) * np.diff(z), np.diff(r)))])
    area = 2.0 * np.pi * float(np.trapezoid(r, way))
    edge = float(np.sqrt(2.0 * area / (np.sqrt(3.0) * n_nodes)))
    rows = max(3, round(way[-1] / (0.5 * np.sqrt(3.0) * edge)))
    at = np.linspace(0.0, way[-1], rows + 1)
    at = at[int(poles[0]) : len(at) - int(poles[1])]
    heights = np.interp(at, way, z)
    if not poles[0]:
        heights[0] = bottom
    if not poles[1]:
        heights[-1] = top
    radii = profile(heights)
    counts = np.maximum(np.round(2.0 * np.pi * radii / edge), 5).astype(np.int64)
    ring, angle, triangles = stitched_rings(counts, closed=False)
    nodes = np.stack([radii[ring] * np.cos(angle), radii[ring] * np.sin(angle), heights[ring]], axis=1)
    first = np.cumsum(counts) - counts
    for pole, height, which, up in ((poles[0], bottom, 0, False), (poles[1], top, -1, True)):
        if pole:
            around = first[which] + np.arange(counts[which])
            after = np.roll(around, -1)
            tip = np.full(len(around), len(nodes))
            fan = (around, after, tip) if up else (after, around, tip)
            triangles = np.concatenate([triangles, np.stack(fan, axis=1)])
            nodes = np.concatenate([nodes, [[0.0, 0.0, height]]])
    return TriangleMesh(frozen(nodes), triangles)


def strip_mesh(width: float, height: float, n_nodes: int) -> tuple[Floats, Ints]:
    """A rectangle about the origin in rows of nearly equilateral triangles: nodes (n, 2) and triangles."""
    edge = float(np.sqrt(2.0 * width * height / (np.sqrt(3.0) * n_nodes)))
    columns = max(3, round(width / edge))
    rows = max(3, round(height / (0.5 * np.sqrt(3.0) * edge)))
    even = np.arange(columns + 1) / columns
    odd = np.concatenate([[0.0], (np.arange(columns) + 0.5) / columns, [1.0]])
    places = [odd if j % 2 else even for j in range(rows + 1)]
    sizes = np.array([len(p) for p in places])
    first = np.cumsum(sizes) - sizes
    y = np.repeat(np.arange(rows + 1) / rows, sizes)
    nodes = np.stack([np.concatenate(places), y], axis=1)
    strips = [_strip(places[j], places[j + 1], int(first[j]), int(first[j + 1])) for j in range(rows)]
    return (nodes - 0.5) * [width, height], np.concatenate(strips)


def _strip(lower: Floats, upper: Floats, lower_first: int, upper_first: int) -> Ints:
    """Triangles between two rows: along both at once, always stepping to the nearer middle."""
    middles = np.concatenate([0.5 * (lower[1:] + lower[:-1]), 0.5 * (upper[1:] + upper[:-1])])
    below = np.arange(len(middles)) < len(lower) - 1
    below = below[np.lexsort((below, middles))]
    a = lower_first + np.cumsum(below) - below
    b = upper_first + np.cumsum(~below) - ~below
    third = np.where(below, a + 1, b + 1)
    return np.stack([a, third, b], axis=1)
