"""Surface nets: the triangulated zero set of a function sampled on a grid."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints

#: Offsets of a cell's eight corners.
CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def surface_net(values: Floats) -> tuple[Floats, Ints]:
    """Nodes, in grid units, and triangles of the surface where ``values`` (nx, ny, nz) change sign.

    One node in each cell whose corners differ in sign, at the mean of the crossings of its edges
    (Gibson 1998); one quadrilateral for each grid edge that crosses, cut along its shorter diagonal.
    Counter-clockwise seen from where the values are positive.
    """
    inside: Bools = np.asarray(values < 0.0)
    shape = tuple(n - 1 for n in values.shape)
    total = np.zeros(shape, dtype=np.int64)
    for i, j, k in CORNERS:
        total += inside[i : i + shape[0], j : j + shape[1], k : k + shape[2]]
    mixed = (total > 0) & (total < 8)
    number = np.full(shape, -1, dtype=np.int64)
    number[mixed] = np.arange(int(mixed.sum()))
    sums, counts = np.zeros((int(mixed.sum()), 3)), np.zeros(int(mixed.sum()))
    quads = []
    for axis in range(3):
        ahead = np.eye(3, dtype=np.int64)[axis]
        low = values[tuple(slice(0, n - a) for n, a in zip(values.shape, ahead, strict=True))]
        high = values[tuple(slice(a, None) for a in ahead)]
        place = np.argwhere((low < 0.0) != (high < 0.0))
        start, end = low[tuple(place.T)], high[tuple(place.T)]
        crossing = place + (start / (start - end))[:, None] * ahead
        one, two = np.eye(3, dtype=np.int64)[[(axis + 1) % 3, (axis + 2) % 3]]
        ring = np.stack([place - one - two, place - two, place, place - one], axis=1)
        within: Bools = np.all((ring >= 0) & (ring < np.array(shape)), axis=2)
        owner = np.where(within, number[tuple(np.moveaxis(np.where(within[..., None], ring, 0), 2, 0))], -1)
        known = owner >= 0
        np.add.at(sums, owner[known], np.repeat(crossing[:, None], 4, axis=1)[known])
        np.add.at(counts, owner[known], 1.0)
        whole = known.all(axis=1)
        quad = owner[whole]
        quads.append(np.where((start < 0.0)[whole, None], quad, quad[:, ::-1]))
    nodes = sums / np.maximum(counts, 1.0)[:, None]
    a, b, c, d = np.concatenate(quads).T
    lengths = [((nodes[i] - nodes[j]) ** 2).sum(axis=1) for i, j in ((a, c), (b, d))]
    first: Bools = np.less_equal(*lengths)
    one = np.where(first[:, None], np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    two = np.where(first[:, None], np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    return nodes, np.concatenate([one, two])
