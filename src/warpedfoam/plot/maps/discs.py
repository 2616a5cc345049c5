"""The stereographic map: two discs, the halves of a globe seen from outside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.plot.maps.sheets import Axis
from warpedfoam.plot.maps.strands import Segments, Strands, divided

#: Points round a disc; longest chord of a film that is drawn as one segment.
ROUND, CHORD = 720, 0.05
#: Distance of the discs, in radii of one.
APART = 2.12


@dataclass(frozen=True)
class Discs:
    """The halves z > 0 and z < 0 of a globe, projected from its opposite poles on discs of its radius.

    Attributes
    ----------
    radius : float
    round_one : bool
        Whether the surface is a sphere; of others the directions from the origin are mapped.
    """

    radius: float
    round_one: bool

    name = "stereographic"
    n_windows = 2
    scale = None

    @property
    def note(self) -> str:
        """What is true."""
        if not self.round_one:
            return "stereographic, of directions from the origin: nothing to scale"
        return "stereographic: angles true; lengths at the poles half those at the equator"

    def strands(self, curves: Floats) -> Strands:
        """Curves on the surface, cut at the equator."""
        unit = curves / np.linalg.norm(curves, axis=2, keepdims=True)
        far = np.linalg.norm(np.diff(unit, axis=1), axis=2)
        parts = divided(unit, np.ceil(far / CHORD).astype(np.int64))
        a, b = parts.a, parts.b
        north, crossed = a[:, 2] >= 0.0, (a[:, 2] >= 0.0) != (b[:, 2] >= 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(crossed, a[:, 2] / (a[:, 2] - b[:, 2]), 0.0)
        middle = a + t[:, None] * (b - a)
        middle[:, 2] = 0.0
        which = np.repeat(np.arange(len(a)), 1 + crossed)
        second = np.zeros(len(which), dtype=bool)
        second[np.cumsum(1 + crossed)[crossed] - 1] = True
        first = crossed[which] & ~second
        starts = np.where(second[:, None], middle[which], a[which])
        ends = np.where(first[:, None], middle[which], b[which])
        cut = Segments(starts, ends, parts.film[which], parts.last[which] & ~first)
        points, segment, _ = cut.points(first)
        side = np.where(north[which] ^ second, 0, 1)[segment]
        return Strands(self._flat(points, side), side, cut.film[segment])

    def _flat(self, points: Floats, window: Ints) -> Floats:
        """Places in the unit disc; the southern one is seen from below."""
        unit = points / np.linalg.norm(points, axis=1, keepdims=True)
        down = window == 1
        depth = 1.0 + np.where(down, -unit[:, 2], unit[:, 2])
        return np.stack([unit[:, 0] / depth, np.where(down, -unit[:, 1], unit[:, 1]) / depth], axis=1)

    def where(self, points: Floats) -> Floats:
        """Points of the surface as they are drawn."""
        window = (points[:, 2] < 0.0).astype(np.int64)
        return self.drawn(self._flat(points, window), window)

    def jumps(self, at: Floats, window: Ints, then: Floats, then_window: Ints) -> Bools:  # noqa: ARG002
        """Steps from one disc to the other."""
        out: Bools = window != then_window
        return out

    def edge(self) -> tuple[Floats, Floats]:
        """Points round the disc, from the right."""
        places = np.arange(ROUND) / ROUND
        angle = 2.0 * np.pi * places
        return np.stack([np.cos(angle), np.sin(angle)], axis=1), places

    def edge_places(self, at: Floats) -> Floats:
        """By angle."""
        out: Floats = (np.arctan2(at[:, 1], at[:, 0]) / (2.0 * np.pi)) % 1.0
        return out

    def drawn(self, at: Floats, window: Ints) -> Floats:
        """North on the left, south on the right."""
        out: Floats = self.radius * (at + np.stack([APART * window, np.zeros(len(at))], axis=1))
        return out

    def graticule(self) -> list[Floats]:
        """Parallels and meridians every 30°."""
        angle = np.linspace(0.0, 2.0 * np.pi, 181)
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        lines = [np.tan(0.25 * np.pi - 0.5 * v) * ring for v in np.radians([30.0, 60.0])]
        lines += [ring[[k, k + 90]] for k in range(0, 90, 15)]
        return [self.drawn(line, np.full(len(line), window)) for window in (0, 1) for line in lines]

    def axes(self) -> tuple[Axis, Axis] | None:
        """None: a disc has no axes."""
        return None
