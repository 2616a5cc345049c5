"""The most even rank-1 lattice on a rectangle with both pairs of sides glued."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats


def best_lattice(count: int, width: float, height: float) -> tuple[Floats, Floats]:
    """Points (i/n, frac(i z/n)), z chosen so that nearest neighbours are as far apart as they can.

    The shortest vector of each candidate lattice, spanned by (width/n, height z/n) and (0, height),
    comes from Lagrange's reduction, run on all z at once.

    Examples
    --------
    >>> x, y = best_lattice(4, 1.0, 1.0)
    >>> (y * 4).tolist()
    [0.0, 2.0, 0.0, 2.0]
    """
    z = np.arange(1, max(count // 2, 1) + 1)
    a = np.stack([np.full(len(z), width / count), height * z / count])
    b = np.stack([np.zeros(len(z)), np.full(len(z), height)])
    for _ in range(64):
        swap = (a * a).sum(0) > (b * b).sum(0)
        a, b = np.where(swap, b, a), np.where(swap, a, b)
        step = np.round((a * b).sum(0) / (a * a).sum(0))
        if not step.any():
            break
        b = b - step * a
    shortest = np.minimum((a * a).sum(0), (b * b).sum(0))
    best = z[np.argmax(shortest)]
    i = np.arange(count)
    return i / count, (i * best % count) / count
