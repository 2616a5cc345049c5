"""The rim of a surface: closed loops on which films may end, each made of smooth sides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from warpedfoam.arrays import Bools, Floats, Ints, frozen
from warpedfoam.kernels.loops import Loops
from warpedfoam.kernels.quadrature import LobattoRule, gauss

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

#: Samples between two knots for the first guess of a nearest point, and Newton steps from there.
SAMPLES, NEAREST_STEPS = 2, 8
#: A piece of wall turns by less than this, and there are at most so many pieces on a loop.
PIECE_TURN, MOST_PIECES = 0.25, 4000

#: Moves points (n, 3) near the surface to it; unit normals at points.
Land = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class _Side:
    """A smooth piece of a loop: a spline x(u) for u in [first, last], closed on itself or not."""

    loop: int
    first: float
    last: float
    closed: bool
    curve: BSpline
    slope: BSpline
    bend: BSpline


class Rim:
    """Closed loops of a surface's boundary, the surface on the left of each.

    A side is a quintic spline through its points, four times differentiable, by chord length u; where
    two sides meet in a corner u goes on. The rim proper is the spline brought down to the surface.

    Parameters
    ----------
    loops : sequence of sequences of (n, 3) arrays
        Points of each side of each loop, in order. A loop of one side is closed: its first point is not
        repeated. Sides of other loops hold both their corners.
    land : callable
        Moves points near the surface to it.
    unit : callable
        Unit normals at points of the surface.
    """

    def __init__(self, loops: Sequence[Sequence[Floats]], land: Land, unit: Land) -> None:
        self._land, self._unit = land, unit
        self._sides: list[_Side] = []
        lengths = []
        for number, sides in enumerate(loops):
            start = 0.0
            for points in sides:
                side = _fitted(number, points, start, closed=len(sides) == 1)
                self._sides.append(side)
                start = side.last
            lengths.append(start)
        self.lengths = frozen(np.array(lengths))
        self._loop = np.array([side.loop for side in self._sides])
        self._last = np.array([side.last for side in self._sides])
        corners: list[list[float]] = [[] for _ in loops]
        for side in self._sides:
            if not side.closed:
                corners[side.loop].append(side.first)
        self.corners = [np.array(found) for found in corners]
        self._sampled()

    def _sampled(self) -> None:
        samples, places, owner = [], [], []
        self._step = np.empty(self.n_loops)
        sharpest = np.zeros(self.n_loops)
        for k, side in enumerate(self._sides):
            count = SAMPLES * len(side.curve.t)
            u = np.linspace(side.first, side.last, count, endpoint=not side.closed)
            slope, bend = side.slope(u), side.bend(u)
            speed = np.linalg.norm(slope, axis=1)
            sharpest[side.loop] = max(
                sharpest[side.loop], float((np.linalg.norm(np.cross(slope, bend), axis=1) / speed**3).max())
            )
            samples.append(side.curve(u))
            places.append(u)
            owner.append(np.full(count, k))
        self._samples, self._places = np.concatenate(samples), np.concatenate(places)
        self._owner = np.concatenate(owner)
        self._tree = cKDTree(self._samples)
        least, most = self.lengths / MOST_PIECES, self.lengths / 8.0
        self._step = np.clip(PIECE_TURN / np.maximum(sharpest, 1e-300), least, most)

    @property
    def n_loops(self) -> int:
        """Number of loops."""
        return len(self.lengths)

    def _side_of(self, loop: Ints, u: Floats) -> tuple[Ints, Floats]:
        """Side of each place, and the place within one turn of its loop."""
        length = self.lengths[loop]
        inside = u - length * np.floor(u / length)
        side = np.zeros(len(u), dtype=np.int64)
        for k in range(len(self._sides)):
            # the last side that begins before the place
            side[(self._loop[k] == loop) & (inside >= self._sides[k].first)] = k
        return side, inside

    def _derivative(self, which: str, loop: Ints, u: Floats) -> Floats:
        side, inside = self._side_of(loop, u)
        out = np.empty((len(u), 3))
        for k in np.unique(side):
            here = side == k
            out[here] = getattr(self._sides[k], which)(inside[here])
        return out

    def at(self, loop: Ints, u: Floats) -> Floats:
        """Points of the rim at places ``u`` (n,) of ``loop`` (n,), (n, 3); a turn later is the same place."""
        return self._land(self._derivative("curve", loop, u))

    def locate(self, points: Floats) -> tuple[Ints, Floats]:
        """Loop (n,) and place (n,) of the rim's points nearest to ``points`` (n, 3)."""
        index = np.asarray(self._tree.query(points)[1], dtype=np.int64)
        side, u = self._owner[index], self._places[index]
        for k in np.unique(side):
            here, piece = np.flatnonzero(side == k), self._sides[k]
            x, v = points[here], u[here]
            span = piece.last - piece.first
            for _ in range(NEAREST_STEPS):
                away, slope, bend = x - piece.curve(v), piece.slope(v), piece.bend(v)
                down = np.einsum("ni,ni->n", away, slope)
                stiff = np.einsum("ni,ni->n", slope, slope) - np.einsum("ni,ni->n", away, bend)
                move = np.clip(down / np.where(stiff > 0.0, stiff, 1.0), -0.1 * span, 0.1 * span)
                v = v + move
                v = np.mod(v - piece.first, span) + piece.first if piece.closed else v
                if not piece.closed:
                    v = np.clip(v, piece.first, piece.last)
                if not (np.abs(move) > 1e-15 * span).any():
                    break
            u[here] = v
        loop = self._loop[side]
        # a spline that is not quite on the surface: the place whose landing is nearest, or points would creep
        for _ in range(2):
            there = self.at(loop, u)
            away = points - there
            tangent, _, speed = self._frame(loop, u, there)
            u = u + np.einsum("ni,ni->n", away, tangent) / speed
        return loop, u

    def frame(self, loop: Ints, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Unit tangents T (n, 3), unit conormals n × T into the surface (n, 3), and speeds |x'| (n,)."""
        return self._frame(loop, u, self.at(loop, u))

    def _frame(self, loop: Ints, u: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
        slope = self._derivative("slope", loop, u)
        normal = self._unit(points)
        slope -= np.einsum("ni,ni->n", slope, normal)[:, None] * normal
        speed = np.linalg.norm(slope, axis=1)
        tangent = slope / speed[:, None]
        return tangent, np.cross(normal, tangent), speed

    def curvatures(self, loop: Ints, u: Floats) -> Floats:
        """Geodesic curvature n · (x' × x'')/|x'|³, above 0 where the rim turns into the surface, (n,)."""
        slope, bend = self._derivative("slope", loop, u), self._derivative("bend", loop, u)
        normal = self._unit(self.at(loop, u))
        speed = np.linalg.norm(slope, axis=1)
        out: Floats = np.einsum("ni,ni->n", normal, np.cross(slope, bend)) / speed**3
        return out

    def slide(self, points: Floats, steps: Floats) -> Floats:
        """Points of the rim moved along it by ``steps`` (n,)."""
        loop, u = self.locate(points)
        return self.at(loop, u + steps / self.frame(loop, u)[2])

    def nearest(self, points: Floats) -> Floats:
        """Nearest points of the rim, (n, 3)."""
        return self.at(*self.locate(points))

    def beyond(self, points: Floats) -> Bools:
        """Whether points lie on the far side of the rim's curtain of normals at its nearest point."""
        loop, u = self.locate(points)
        there = self.at(loop, u)
        out: Bools = np.einsum("ni,ni->n", points - there, self._frame(loop, u, there)[1]) < 0.0
        return out

    def spans(self, start: Floats, end: Floats) -> tuple[Ints, Floats, Floats]:
        """Loop, first and last place of the walls that run from ``start`` to ``end`` (n, 3).

        The surface lies on the left on the way, so there is one way only; the last place is above the
        first, by less than a turn.

        Raises
        ------
        ValueError
            If a wall's ends lie on different loops.
        """
        loop, first = self.locate(start)
        other, last = self.locate(end)
        if (loop != other).any():
            bad = int(np.flatnonzero(loop != other)[0])
            raise ValueError(f"wall {bad} joins two different loops of the rim")
        length = self.lengths[loop]
        turn = np.mod(last - first, length)
        return loop, first, first + np.where(turn > 0.0, turn, length)

    def pieces(self, loop: Ints, first: Floats, last: Floats) -> tuple[Ints, Floats, Floats]:
        """Walls cut into short smooth pieces: wall of each (m,), first and last place (m,), in order."""
        cuts = [first, last]
        for k in range(self.n_loops):
            here = loop == k
            for corner in self.corners[k]:
                for turn in (0.0, 1.0, 2.0):
                    place = corner + turn * self.lengths[k]
                    inside = here & (place > first) & (place < last)
                    if inside.any():
                        cuts.append(np.where(inside, place, last))
        places = np.sort(np.stack(cuts, axis=1), axis=1)
        wall, _ = np.nonzero(places[:, 1:] > places[:, :-1])
        keep = places[:, 1:] > places[:, :-1]
        low, high = places[:, :-1][keep], places[:, 1:][keep]
        count = np.maximum(np.ceil((high - low) / self._step[loop[wall]] - 1e-9), 1.0).astype(np.int64)
        index = np.repeat(np.arange(len(count)), count)
        within = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count)
        size = ((high - low) / count)[index]
        return wall[index], low[index] + within * size, low[index] + (within + 1) * size

    def nodes(self, rule: LobattoRule, loop: Ints, first: Floats, last: Floats) -> Floats:
        """Lobatto nodes of pieces, (K, m, 3)."""
        u = first + rule.nodes[:, None] * (last - first)
        loops = np.broadcast_to(loop, u.shape)
        return self.at(loops.ravel(), u.ravel()).reshape(*u.shape, 3)

    def turning(self, loop: Ints, first: Floats, last: Floats) -> Floats:
        """∫ κ_g ds along walls, and the angles by which corners turn into the surface, (n,)."""
        wall, low, high = self.pieces(loop, first, last)
        xi, omega = gauss(6)
        u = low + xi[:, None] * (high - low)
        loops = np.broadcast_to(loop[wall], u.shape).ravel()
        speed = self.frame(loops, u.ravel())[2]
        share = (self.curvatures(loops, u.ravel()) * speed).reshape(u.shape)
        total = np.bincount(wall, (omega @ share) * (high - low), minlength=len(loop))
        for k in range(self.n_loops):
            here = loop == k
            for corner, angle in zip(self.corners[k], self._corner_angles(k), strict=True):
                for turn in (0.0, 1.0, 2.0):
                    place = corner + turn * self.lengths[k]
                    total += angle * (here & (place > first) & (place <= last))
        return total.astype(np.float64, copy=False)

    def _corner_angles(self, loop: int) -> Floats:
        """Angle from the side before each corner of a loop to the side after it, positive to the left."""
        corners = self.corners[loop]
        which = np.full(len(corners), loop)
        hair = 1e-9 * self.lengths[loop]
        before, after = self.frame(which, corners - hair)[0], self.frame(which, corners + hair)[0]
        normal = self._unit(self.at(which, corners))
        sine = np.einsum("ni,ni->n", normal, np.cross(before, after))
        out: Floats = np.arctan2(sine, np.einsum("ni,ni->n", before, after))
        return out

    def samples(self) -> tuple[Floats, Floats, Floats]:
        """Points along the whole rim (n, 3), conormals there (n, 3) and the lengths they stand for (n,)."""
        loop = self._loop[self._owner]
        u = self._places
        points = self.at(loop, u)
        _, across, speed = self._frame(loop, u, points)
        share = np.zeros(len(u))
        for k, side in enumerate(self._sides):
            here = self._owner == k
            share[here] = (side.last - side.first) / here.sum()
        return points, across, share * speed


def _fitted(loop: int, points: Floats, start: float, *, closed: bool) -> _Side:
    # slow to import, and closed surfaces have no use for it
    from scipy.interpolate import BSpline, make_interp_spline

    if closed:
        points = np.concatenate([points, points[:1]])
    chord = np.linalg.norm(np.diff(points, axis=0), axis=1)
    u = start + np.concatenate([[0.0], np.cumsum(chord)])
    degree = 5 if len(points) > 8 else 3
    if closed:
        curve = make_interp_spline(u, points, k=degree, bc_type="periodic")
    else:
        curve = make_interp_spline(u, points, k=min(degree, len(points) - 1))
    slope = curve.derivative(1)
    # two points make a straight side
    bend = slope.derivative(1) if curve.k > 1 else BSpline(slope.t, 0.0 * slope.c, slope.k)
    return _Side(loop, float(u[0]), float(u[-1]), closed, curve, slope, bend)


def with_walls(
    rim: Rim, rule: LobattoRule, points: Floats, loops: Loops, start: Floats, end: Floats
) -> tuple[Floats, Loops]:
    """Arcs and loops with the walls that close them.

    A loop's half-arc that does not end where the next starts has come to the rim: the way along the rim
    from there to there is put in, in pieces.

    Parameters
    ----------
    rim : Rim
    rule : LobattoRule
    points : (K, F, 3) array
        Nodes of the arcs.
    loops : Loops
    start, end : (m, 3) arrays
        Where the half-arcs of ``loops`` start and end.
    """
    following = loops.following
    gap = np.flatnonzero((start[following] != end).any(axis=1))
    if not gap.size:
        return points, loops
    loop, first, last = rim.spans(end[gap], start[following[gap]])
    wall, low, high = rim.pieces(loop, first, last)
    nodes = rim.nodes(rule, loop[wall], low, high)
    # the ends of walls are those of films, to the last digit
    opening = np.flatnonzero(np.diff(wall, prepend=-1))
    closing = np.flatnonzero(np.diff(wall, append=len(gap)))
    nodes[0, opening], nodes[-1, closing] = end[gap], start[following[gap]]
    count = np.ones(len(loops.halves), dtype=np.int64)
    count[gap] += np.bincount(wall, minlength=len(gap))
    place = np.cumsum(count) - count
    halves = np.empty(int(count.sum()), dtype=np.int64)
    added = np.ones(len(halves), dtype=np.bool_)
    added[place] = False
    halves[place] = loops.halves
    halves[added] = 2 * (points.shape[1] + np.arange(len(wall)))
    return np.concatenate([points, nodes], axis=1), Loops(frozen(halves), frozen(place[loops.starts]))
