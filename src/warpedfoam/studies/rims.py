"""Whether bubbles and circles stay on a surface that ends in a rim."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Bools, Floats
from warpedfoam.surfaces import LevelSurface, Surface

#: Directions in which a disk's edge is looked for.
DIRECTIONS = 32


class OverRim(ValueError):
    """A bubble or a circle would reach over the rim of its surface."""


def beyond(surface: Surface, points: Floats) -> Bools:
    """Which points (n, 3) of the surface, or of its continuation, lie beyond its rim, (n,)."""
    if surface.rim is None or not isinstance(surface, LevelSurface):
        return np.zeros(len(points), dtype=np.bool_)
    return surface.beyond(points)


def near_rim(surface: Surface, point: Floats, radius: float) -> bool:
    """Whether the rim comes nearer to a point (3,) than ``radius``, measured straight through space."""
    if surface.rim is None:
        return False
    away = surface.rim.nearest(point[None])[0] - point
    return bool(np.linalg.norm(away) < radius)


def require_on_surface(surface: Surface, point: Floats, name: str) -> None:
    """Refuse a place (3,) beyond the rim.

    Raises
    ------
    OverRim
    """
    if beyond(surface, point[None])[0]:
        raise OverRim(f"{name} must lie on the surface, but {point.round(6).tolist()} is beyond its rim")


def disks_over_rim(surface: Surface, points: Floats, radius: float) -> Bools:
    """Which disks of a radius about points (n, 3) of the surface reach over its rim, (n,)."""
    out = beyond(surface, points)
    if surface.rim is None:
        return out
    away = np.linalg.norm(surface.rim.nearest(points) - points, axis=1)
    near = np.flatnonzero(~out & (away < radius))
    turn = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    for share in (0.5, 1.0):
        steps = share * radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        edge = surface.retract(np.repeat(points[near], DIRECTIONS, axis=0), np.tile(steps, (len(near), 1)))
        out[near] |= beyond(surface, edge).reshape(-1, DIRECTIONS).any(axis=1)
    return out
