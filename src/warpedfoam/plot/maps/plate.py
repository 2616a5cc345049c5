"""A landscape over a disk, seen from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.plot.maps.sheets import Axis, axis_of_lengths
from warpedfoam.plot.maps.strands import Strands

#: Points round the rim.
ROUND = 1440


@dataclass(frozen=True)
class Plate:
    """The coordinates x and y within a circle about the origin, whose edge is the rim.

    Attributes
    ----------
    radius : float
    """

    radius: float

    name = "plane"
    note = "seen from above: slopes are foreshortened"
    n_windows = 1
    scale = None

    def strands(self, curves: Floats) -> Strands:
        """Curves (F, k, 3) on the surface, which leave the disk nowhere."""
        n_films, k, _ = curves.shape
        at = curves[:, :, :2].reshape(-1, 2).copy()
        return Strands(at, np.zeros(len(at), dtype=np.int64), np.repeat(np.arange(n_films), k))

    def where(self, points: Floats) -> Floats:
        """Points of the surface as they are drawn."""
        return points[:, :2].copy()

    def jumps(self, at: Floats, window: Ints, then: Floats, then_window: Ints) -> Bools:  # noqa: ARG002
        """Nowhere."""
        return np.zeros(len(at), dtype=bool)

    def edge(self) -> tuple[Floats, Floats]:
        """Points round the disk, from the right."""
        places = np.arange(ROUND) / ROUND
        angle = 2.0 * np.pi * places
        return self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1), places

    def edge_places(self, at: Floats) -> Floats:
        """By angle."""
        out: Floats = (np.arctan2(at[:, 1], at[:, 0]) / (2.0 * np.pi)) % 1.0
        return out

    def drawn(self, at: Floats, window: Ints) -> Floats:  # noqa: ARG002
        """As they are."""
        return at

    def graticule(self) -> list[Floats]:
        """None: the axes are marked."""
        return []

    def axes(self) -> tuple[Axis, Axis]:
        """Lengths along x and y."""
        return axis_of_lengths("x", 2.0 * self.radius), axis_of_lengths("y", 2.0 * self.radius)
