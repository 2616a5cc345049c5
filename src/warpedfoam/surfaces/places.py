"""Search trees over points of surfaces that may repeat in space."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from warpedfoam.arrays import Floats, Ints
from warpedfoam.kernels.thinning import accepted


class Places:
    """A k-d tree whose straight distances are those to nearest images."""

    def __init__(self, points: Floats, period: Floats | None) -> None:
        self._period = period
        box = None if period is None else np.where(np.isfinite(period), period, 0.0)
        self._tree = cKDTree(self._inside(points), boxsize=box)

    def _inside(self, points: Floats) -> Floats:
        """Points moved into the box from 0 to the period."""
        if self._period is None:
            return points
        finite = np.isfinite(self._period)
        unit = np.where(finite, self._period, 1.0)
        share = points / unit
        share = np.where(finite, share - np.floor(share), share)
        # a hair below 0 is rounded up to 1, which is outside
        return np.where(finite & (share >= 1.0), 0.0, share) * unit

    def nearest(self, points: Floats, count: int = 1) -> tuple[Floats, Ints]:
        """Distances and indices of the ``count`` nearest, (n, count); one dimension less if it is 1."""
        found = self._tree.query(self._inside(points), k=count, workers=-1)
        return np.asarray(found[0]), np.asarray(found[1], dtype=np.int64)

    def count(self, radius: float) -> int:
        """Number of pairs within ``radius``, found without making them."""
        return (int(self._tree.count_neighbors(self._tree, radius)) - self._tree.n) // 2

    def pairs(self, radius: float) -> Ints:
        """Pairs i < j within ``radius``, (m, 2)."""
        pairs = self._tree.query_pairs(radius, output_type="ndarray")
        out: Ints = np.sort(pairs, axis=1).astype(np.int64)
        return out


def spread_out(points: Floats, count: int, spacing: float, period: Floats | None) -> Ints:
    """The first ``count`` of points thinned to the widest gaps that leave so many."""
    places = Places(points, period)
    for share in (0.8, 0.75, 0.7, 0.65, 0.6, 0.5):
        chosen = np.flatnonzero(accepted(len(points), places.pairs(share * spacing).T))
        if len(chosen) >= count:
            return chosen[:count]
    return np.arange(count)
