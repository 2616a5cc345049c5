"""Closed loops of half-films (or half-arcs), listed loop after loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Ints, frozen


@dataclass(frozen=True, eq=False)
class Loops:
    """``halves`` lists the half-arcs loop after loop, ``starts`` (n,) tells where each loop begins.

    Half-arc 2f runs along arc f, 2f + 1 against it; the loop's region is on the left.
    """

    halves: Ints
    starts: Ints

    @property
    def sizes(self) -> Ints:
        """Number of half-arcs of each loop."""
        return np.diff(np.append(self.starts, len(self.halves)))

    @property
    def following(self) -> Ints:
        """Place in ``halves`` of the half-arc that comes after each, round its loop."""
        after = np.arange(1, len(self.halves) + 1)
        after[self.starts + self.sizes - 1] = self.starts
        return after


def loops_of(following: Ints, owner: Ints) -> Loops:
    """Loops of the permutation ``following``, sorted by ``owner`` (constant along a loop).

    Walks all loops at once, one array operation per step of the longest.

    Examples
    --------
    >>> import numpy as np
    >>> loops_of(np.array([2, 3, 0, 1]), np.array([1, 0, 1, 0])).halves
    array([1, 3, 0, 2])
    """
    n = len(following)
    # the least half-arc of each loop represents it: pointer doubling spreads the minimum
    least, jump = np.minimum(np.arange(n), following), following
    span = 1
    while span < n:
        spread = np.minimum(least, least[jump])
        if span > 1 and np.array_equal(spread, least):
            break
        least, jump, span = spread, jump[jump], 2 * span
    heads = np.flatnonzero(least == np.arange(n))
    rank = np.zeros(n, dtype=np.int64)
    alive, here, step = heads, heads, 0
    while alive.size:
        rank[here] = step
        here = following[here]
        going = here != alive
        alive, here, step = alive[going], here[going], step + 1
    order = np.lexsort((rank, least, owner))
    starts = np.flatnonzero(rank[order] == 0)
    return Loops(frozen(order), frozen(starts))
