"""Films as points in the windows of a map, cut where they leave one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints

#: Most pieces that one segment of a film is divided into where a map stretches it.
MOST_PIECES = 200


@dataclass(frozen=True, eq=False)
class Strands:
    """Points along the films, film after film, each in the plane coordinates of a window.

    A film that leaves a window has a point on its edge, followed by the point where it comes in again.

    Attributes
    ----------
    at : (n, 2) array
        Coordinates in the window, before they are drawn.
    window, film : (n,) integer arrays
    """

    at: Floats
    window: Ints
    film: Ints


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments of films from ``a`` to ``b`` (m, 2) or (m, 3), in order; ``last`` (m,) of its film."""

    a: Floats
    b: Floats
    film: Ints
    last: Bools

    def points(self, cut: Bools) -> tuple[Floats, Ints, Ints]:
        """Starts of all segments, and ends of those that are ``cut`` or their film's last.

        Returns points, the segment of each, and 0 for starts, 1 for ends.
        """
        ended = cut | self.last
        segment = np.repeat(np.arange(len(ended)), 1 + ended)
        end = np.zeros(len(segment), dtype=np.int64)
        end[np.cumsum(1 + ended)[ended] - 1] = 1
        return np.where(end[:, None] == 1, self.b[segment], self.a[segment]), segment, end


def divided(curves: Floats, pieces: Ints) -> Segments:
    """Segments of polylines (F, k, 3), each divided evenly into so many ``pieces`` (F, k − 1)."""
    count = np.clip(pieces, 1, MOST_PIECES).ravel()
    n_films, k = len(curves), curves.shape[1]
    a, b = curves[:, :-1].reshape(-1, 3), curves[:, 1:].reshape(-1, 3)
    which = np.repeat(np.arange(len(a)), count)
    step = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    ends = []
    for t in (step, step + 1):
        share = (t / count[which])[:, None]
        # exact at both ends: what two films share must stay the same
        ends.append(np.where(share == 1.0, b[which], a[which] + share * (b - a)[which]))
    last = np.zeros(len(which), dtype=bool)
    last[np.cumsum(count.reshape(n_films, k - 1).sum(axis=1)) - 1] = True
    return Segments(ends[0], ends[1], which // (k - 1), last)


def cut_at_seam(parts: Segments, cut: Bools, axis: int, low: float, high: float) -> tuple[Segments, Bools]:
    """Segments cut where they cross a seam at ``low`` ≡ ``high`` of one coordinate; none spans half of it.

    Each is first moved by whole periods until it starts in [low, high).
    """
    period = high - low
    a, b = parts.a.copy(), parts.b.copy()
    turns = period * np.floor((a[:, axis] - low) / period)
    a[:, axis] -= turns
    b[:, axis] -= turns
    up, down = b[:, axis] >= high, b[:, axis] < low
    crossed = up | down
    edge, other = np.where(up, high, low), np.where(up, low, high)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(crossed, (edge - a[:, axis]) / (b[:, axis] - a[:, axis]), 0.0)
    out = a + np.clip(t, 0.0, 1.0)[:, None] * (b - a)
    out[:, axis] = edge
    inward = out.copy()
    inward[:, axis] = other
    beyond = b.copy()
    beyond[:, axis] += other - edge
    which = np.repeat(np.arange(len(a)), 1 + crossed)
    second = np.zeros(len(which), dtype=bool)
    second[np.cumsum(1 + crossed)[crossed] - 1] = True
    first = crossed[which] & ~second
    starts = np.where(second[:, None], inward[which], a[which])
    ends = np.where(first[:, None], out[which], np.where(second[:, None], beyond[which], b[which]))
    last = parts.last[which] & ~first
    return Segments(starts, ends, parts.film[which], last), np.where(first, True, cut[which])
