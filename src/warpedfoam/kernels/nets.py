"""Surface nets: the triangulated zero set of a function sampled on a grid."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints

#: Offsets of a cell's eight corners.
CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def surface_net(values: Floats, *, periodic: bool = False) -> tuple[Floats, Ints]:
    """Nodes, in grid units, and triangles of the surface where ``values`` (nx, ny, nz) change sign.

    One node in each cell whose corners differ in sign, at the mean of the crossings of its edges
    (Gibson 1998); one quadrilateral for each grid edge that crosses, cut along its shorter diagonal.
    Counter-clockwise seen from where the values are positive. A ``periodic`` grid goes on with its
    first points behind its last.
    """
    shape = values.shape if periodic else tuple(n - 1 for n in values.shape)
    every = np.pad(values, [(0, 1)] * 3, mode="wrap") if periodic else values
    inside: Bools = np.asarray(every < 0.0)
    total = np.zeros(shape, dtype=np.int64)
    for i, j, k in CORNERS:
        total += inside[i : i + shape[0], j : j + shape[1], k : k + shape[2]]
    cells = np.argwhere((total > 0) & (total < 8))
    number = np.full(shape, -1, dtype=np.int64)
    number[tuple(cells.T)] = np.arange(len(cells))
    sums, counts = np.zeros((len(cells), 3)), np.zeros(len(cells))
    quads = []
    for axis in range(3):
        ahead, one, two = np.roll(np.eye(3, dtype=np.int64), -axis, axis=0)
        low = every[tuple(slice(0, n - a) for n, a in zip(every.shape, ahead, strict=True))]
        high = every[tuple(slice(a, None) for a in ahead)]
        if periodic:
            # the padding holds every edge within it twice
            low, high = (part[: shape[0], : shape[1], : shape[2]] for part in (low, high))
        place = np.argwhere((low < 0.0) != (high < 0.0))
        start, end = low[tuple(place.T)], high[tuple(place.T)]
        # a crossing at a grid point would put the nodes of several cells there
        share = np.clip(start / (start - end), 0.02, 0.98)[:, None] * ahead
        round_ = np.stack([-one - two, -two, np.zeros(3, dtype=np.int64), -one])
        ring = place[:, None] + round_
        if periodic:
            owner = number[tuple(np.moveaxis(ring % np.array(shape), 2, 0))]
        else:
            within: Bools = np.all((ring >= 0) & (ring < np.array(shape)), axis=2)
            at = np.where(within[..., None], ring, 0)
            owner = np.where(within, number[tuple(np.moveaxis(at, 2, 0))], -1)
        known = owner >= 0
        np.add.at(sums, owner[known], (share[:, None] - round_)[known])
        np.add.at(counts, owner[known], 1.0)
        whole = known.all(axis=1)
        quad = owner[whole]
        quads.append(np.where((start < 0.0)[whole, None], quad, quad[:, ::-1]))
    away = sums / np.maximum(counts, 1.0)[:, None]
    a, b, c, d = np.concatenate(quads).T
    nodes = cells + away
    repeat = np.array(shape, dtype=np.float64)

    def square(i: Ints, j: Ints) -> Floats:
        gap = nodes[i] - nodes[j]
        if periodic:
            gap = gap - repeat * np.round(gap / repeat)
        out: Floats = (gap**2).sum(axis=1)
        return out

    first: Bools = np.less_equal(square(a, c), square(b, d))[:, None]
    upper = np.where(first, np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    lower = np.where(first, np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    return nodes, np.concatenate([upper, lower])
