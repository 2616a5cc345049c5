"""The least film length that a flat foam of given areas could have."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import as_floats

#: Film length per bubble of unit area in the honeycomb: half the perimeter of a regular hexagon.
HONEYCOMB = 12.0**0.25


def honeycomb_bound(areas: ArrayLike) -> float:
    """Lower bound of the total film length of bubbles of these areas on a flat closed surface.

    Hales' honeycomb theorem: for every a > 0 the length is at least ``12**0.25`` Σ min(A_i, a)/√a.
    The largest of these is attained at one of the areas. For N equal areas that fill A it is
    ``12**0.25 * sqrt(A * N)``, which the honeycomb reaches. (``12**0.25`` Σ √A_i is larger if areas
    differ, but no bound: some mixtures of two sizes lie below it.)

    Where the surface curves it is a measure to compare with, not a bound: on a sphere the
    dodecahedral foam of 12 bubbles has 0.958 of it.

    Parameters
    ----------
    areas : (n,) array
        Above 0.

    Raises
    ------
    TypeError, ValueError
        If ``areas`` is no array of numbers above 0.

    References
    ----------
    T. C. Hales, "The honeycomb conjecture", Discrete Comput. Geom. 25, 1-22 (2001), theorem 3.

    Examples
    --------
    >>> round(honeycomb_bound([1.0, 1.0, 1.0]), 6), round(honeycomb_bound([0.5, 1.0, 1.5]), 6)
    (5.583629, 4.653024)
    """
    sizes = np.sort(as_floats(areas, "areas", (None,)))
    if not sizes.size or sizes[0] <= 0.0:
        raise ValueError(f"areas must hold numbers above 0, got {'none' if not sizes.size else sizes[0]}")
    above = np.arange(len(sizes) - 1, -1, -1)
    return HONEYCOMB * float(((np.cumsum(sizes) + above * sizes) / np.sqrt(sizes)).max())
