"""Points at one place are one point: what a polygon file repeats, made whole."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from warpedfoam.arrays import Floats, Ints
from warpedfoam.errors import TopologyError
from warpedfoam.surfaces.places import Places

#: Points to be welded to each, in the mean, beyond which a file is no network.
MOST_PAIRS = 64


def welded(points: Floats, distance: float, period: Floats | None) -> Ints:
    """The first point at the place of each point."""
    # points at the very same place first: their pairs would be the square of their number
    _, kept, which = np.unique(points, axis=0, return_index=True, return_inverse=True)
    places, n = Places(points[kept], period), len(kept)
    if places.count(distance) > MOST_PAIRS * n:
        raise TopologyError(
            f"the {len(points)} points crowd: over {MOST_PAIRS} lie within {distance:.3g} of each, in the "
            "mean; the file is damaged, or weld is too large"
        )
    pairs = places.pairs(distance)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    label = label[which.reshape(-1)]
    first = np.full(int(label.max()) + 1, len(points))
    np.minimum.at(first, label, np.arange(len(points)))
    out: Ints = first[label]
    return out


def without_repeats(corners: Ints, sizes: Ints) -> tuple[Ints, Ints]:
    """Polygons without corners that repeat the one before."""
    starts = np.cumsum(sizes) - sizes
    before = np.arange(len(corners)) - 1
    before[starts] = starts + sizes - 1
    keep = corners != corners[before]
    loop = np.repeat(np.arange(len(sizes)), sizes)
    return corners[keep], np.bincount(loop[keep], minlength=len(sizes))
