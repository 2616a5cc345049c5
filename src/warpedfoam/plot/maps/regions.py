"""Bubbles as closed outlines in the windows of a map: where a film leaves, the window's edge goes on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints, frozen
from warpedfoam.kernels.loops import loops_of
from warpedfoam.network import CellNetwork
from warpedfoam.plot.maps.strands import Strands

if TYPE_CHECKING:
    from warpedfoam.plot.maps.charts import Chart


@dataclass(frozen=True, eq=False)
class Regions:
    """Outlines as they are drawn, sorted by bubble; a hole in a bubble runs clockwise.

    Attributes
    ----------
    points : (n, 2) array
    starts : (m,) array of int
        Where each outline begins in ``points``.
    bubble, window : (m,) arrays of int
        Of each outline.
    """

    points: Floats
    starts: Ints
    bubble: Ints
    window: Ints

    @property
    def outlines(self) -> list[Floats]:
        """The points of each outline."""
        return np.split(self.points, self.starts[1:])

    @property
    def areas(self) -> Floats:
        """Signed area of each outline, (m,): counter-clockwise ones above 0."""
        if not len(self.starts):
            return np.zeros(0)
        after = np.arange(1, len(self.points) + 1)
        after[np.append(self.starts[1:], len(self.points)) - 1] = self.starts
        # about a point of the outline, not the origin: far away ones keep their digits
        size = np.diff(np.append(self.starts, len(self.points)))
        p = self.points - np.repeat(self.points[self.starts], size, axis=0)
        q = p[after]
        out: Floats = 0.5 * np.add.reduceat(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0], self.starts)
        return out

    def bubble_areas(self, n_bubbles: int) -> Floats:
        """Area of each bubble on the map, (n_bubbles,)."""
        return np.bincount(self.bubble, self.areas, n_bubbles).astype(np.float64, copy=False)


def regions(network: CellNetwork, strands: Strands, chart: Chart) -> Regions:
    """Outlines of all bubbles.

    Going round a bubble, films that leave a window are followed counter-clockwise along its edge to
    where the bubble comes in next; so are walls, since rims are edges of a window. A bubble whose loops
    in a window are holes only fills the rest of the window.
    """
    point, bubble, broken, following = _boundary(network, strands, chart)
    at, window = strands.at[point], strands.window[point]
    edge_points, edge_places = chart.edge()
    out = np.flatnonzero(broken)
    into = following[out]
    place = np.zeros(len(point))
    both = np.concatenate([out, into])
    place[both] = chart.edge_places(at[both])
    n_windows = chart.n_windows
    group = bubble * n_windows + window
    onward = following.copy()
    onward[out] = _linked(out, into, place, group)

    loops = loops_of(onward, group)
    order = loops.halves
    # points of the edge between a way out and the next way in
    is_out = np.zeros(len(point), dtype=bool)
    is_out[out] = True
    here, there = place[order], place[onward[order]]
    n_edge = len(edge_places)
    first = np.searchsorted(edge_places, here, "right")
    beyond = np.searchsorted(edge_places, there, "left") + np.where(there < here, n_edge, 0)
    extra = np.where(is_out[order], np.maximum(beyond - first, 0), 0)
    slot = np.repeat(np.arange(len(order)), 1 + extra)
    rank = np.arange(len(slot)) - np.repeat(np.cumsum(1 + extra) - 1 - extra, 1 + extra)
    on_edge = rank > 0
    flat = at[order][slot]
    flat[on_edge] = edge_points[(first[slot] + rank - 1)[on_edge] % n_edge]
    starts = (np.cumsum(1 + extra) - 1 - extra)[loops.starts]
    drawn = chart.drawn(flat, window[order][slot])
    owner = group[order[loops.starts]]
    found = Regions(drawn, starts, owner // n_windows, owner % n_windows)
    return _sorted(_filled(found, np.unique(group[out]), chart, strands))


def _boundary(network: CellNetwork, strands: Strands, chart: Chart) -> tuple[Ints, Ints, Bools, Ints]:
    """Points round every loop: place in the strands, bubble, whether a window is left after it, the next."""
    loops = network.loops
    count = np.bincount(strands.film, minlength=network.n_films)
    begin = np.cumsum(count) - count
    film, back = loops.halves >> 1, (loops.halves & 1).astype(bool)
    half = np.repeat(np.arange(len(film)), count[film])
    run = np.cumsum(count[film])
    rank = np.arange(len(half)) - np.repeat(run - count[film], count[film])
    point = begin[film][half] + np.where(back[half], count[film][half] - 1 - rank, rank)
    following = np.arange(1, len(point) + 1)
    loop_ends = run[np.append(loops.starts[1:], len(film)) - 1] - 1
    loop_begins = (run - count[film])[loops.starts]
    following[loop_ends] = loop_begins
    broken = chart.jumps(
        strands.at[point],
        strands.window[point],
        strands.at[point[following]],
        strands.window[point[following]],
    )
    walled = np.zeros(2 * network.n_films, dtype=bool)
    walled[network.walls] = True
    broken[run[walled[loops.halves]] - 1] = True
    return point, network.bubble[loops.halves][half], broken, following


def _linked(out: Ints, into: Ints, place: Floats, group: Ints) -> Ints:
    """For each way out the next way in along the edge of the same window, of the same bubble."""
    events = np.concatenate([out, into])
    entering = np.repeat([0, 1], [len(out), len(into)])
    order = np.lexsort((entering, place[events], group[events]))
    sorted_group = group[events][order]
    first = np.flatnonzero(np.diff(sorted_group, prepend=-1))
    after = np.arange(1, len(order) + 1)
    if len(order):
        after[np.append(first[1:], len(order)) - 1] = first
    next_event = np.empty(len(events), dtype=np.int64)
    next_event[order] = order[after] if len(order) else order
    onward = next_event[: len(out)]
    if (entering[onward] == 1).all():
        return events[onward]
    # ways in and out that fall together: pair what is left in order
    for start, stop in zip(first, np.append(first[1:], len(order)), strict=True):
        member = order[start:stop]
        ways_in = [e for e in member if entering[e]]
        ways_out = [e for e in member if not entering[e]]
        shift = sum(place[events[e]] < place[events[ways_out[0]]] for e in ways_in)
        for k, e in enumerate(ways_out):
            onward[e] = ways_in[(k + shift) % len(ways_in)]
    return events[onward]


def _filled(found: Regions, linked: Ints, chart: Chart, strands: Strands) -> Regions:
    """With the whole edge added for bubbles that have only holes in a window, or a window to themselves."""
    n_windows = chart.n_windows
    group = found.bubble * n_windows + found.window
    keys, which = np.unique(group, return_inverse=True)
    area = np.bincount(which, found.areas, len(keys))
    whole = keys[(area < 0.0) & ~np.isin(keys, linked)]
    empty = np.setdiff1d(np.arange(n_windows), strands.window)
    # no film in a window: it belongs to the bubble that surrounds those of the other one
    whole = np.concatenate([whole, *(whole // n_windows * n_windows + w for w in empty)]).astype(np.int64)
    if not whole.size:
        return found
    edge, _ = chart.edge()
    added = [chart.drawn(edge, np.full(len(edge), w)) for w in whole % n_windows]
    starts = len(found.points) + len(edge) * np.arange(len(whole))
    return Regions(
        np.concatenate([found.points, *added]),
        np.concatenate([found.starts, starts]),
        np.concatenate([found.bubble, whole // n_windows]),
        np.concatenate([found.window, whole % n_windows]),
    )


def _sorted(found: Regions) -> Regions:
    order = np.argsort(found.bubble, kind="stable")
    parts = found.outlines
    size = np.diff(np.append(found.starts, len(found.points)))[order]
    points = np.concatenate([parts[k] for k in order]) if len(parts) else found.points
    return Regions(
        frozen(points),
        frozen(np.cumsum(size) - size),
        frozen(found.bubble[order]),
        frozen(found.window[order]),
    )


def window_area(chart: Chart) -> float:
    """Area of all windows together, as drawn."""
    edge, _ = chart.edge()
    one = np.zeros(1, dtype=np.int64)
    drawn = [chart.drawn(edge, np.full(len(edge), w)) for w in range(chart.n_windows)]
    return float(sum(Regions(outline, one, one, one).areas[0] for outline in drawn))
