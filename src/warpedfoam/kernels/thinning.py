"""Greedy independent sets, all at once."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Bools, Ints


def accepted(n: int, pairs: Ints) -> Bools:
    """The independent set that takes nodes in order, each unless a taken one is its partner."""
    taken = np.zeros(n, dtype=np.bool_)
    open_ = np.ones(n, dtype=np.bool_)
    first, second = pairs
    while open_.any():
        free = open_.copy()
        free[second] = False  # an earlier partner is still open
        taken |= free
        open_ &= ~free
        open_[second[free[first]]] = False
        left = open_[first] & open_[second]
        first, second = first[left], second[left]
    return taken
