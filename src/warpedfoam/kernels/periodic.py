"""Points of surfaces that repeat in space: nearest images, and loops without jumps."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.loops import Loops


def nearest_image(difference: Floats, period: Floats | None) -> Floats:
    """Differences (…, 3) less the whole periods in them; infinite periods do not repeat.

    Examples
    --------
    >>> import numpy as np
    >>> nearest_image(np.array([0.9, 0.9, 7.0]), np.array([1.0, 2.0, np.inf])).round(12)
    array([-0.1,  0.9,  7. ])
    """
    if period is None:
        return difference
    finite = np.isfinite(period)
    unit = np.where(finite, period, 1.0)
    out: Floats = difference - np.where(finite, unit * np.round(difference / unit), 0.0)
    return out


def loop_shifts(start: Floats, end: Floats, loops: Loops, period: Floats | None) -> Floats | None:
    """Whole periods (m, 3) to add to each half-arc so that it begins where the one before it ends.

    ``start``, ``end`` (m, 3) are the half-arcs' ends in the order of ``loops``; None if nothing repeats.
    """
    if period is None:
        return None
    before = np.arange(len(start)) - 1
    gap = end[before] - start
    jump = gap - nearest_image(gap, period)
    jump[loops.starts] = 0.0
    total = np.cumsum(jump, axis=0)
    total -= np.repeat(total[loops.starts], loops.sizes, axis=0)
    finite = np.where(np.isfinite(period), period, 1.0)
    return np.round(total / finite) * np.where(np.isfinite(period), period, 0.0)
