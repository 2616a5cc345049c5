"""Triangulate a stack of rings that may hold different numbers of evenly spaced nodes."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats, Ints


def stitched_rings(counts: Ints, *, closed: bool) -> tuple[Ints, Floats, Ints]:
    """Nodes and triangles of rings, neighbours joined by the zipper of their merged angles.

    Ring i holds ``counts[i]`` nodes evenly round, every second ring turned by half a step. Between
    two rings each node contributes one triangle, whose base is the arc from it to the next of its
    ring and whose apex is the node of the other ring last passed.

    Parameters
    ----------
    counts : (n_rings,) integer array
    closed : bool
        Join the last ring to the first as well.

    Returns
    -------
    ring : (n_nodes,) integer array
    angle : (n_nodes,) array
        Angle of each node, in [0, 2π).
    triangles : (m, 3) integer array
        Counter-clockwise if the rings rise to the left of the direction in which they run.
    """
    first = np.concatenate([[0], np.cumsum(counts)])
    ring = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(first[-1]) - first[ring]
    angle = 2.0 * np.pi * (within + 0.5 * (ring % 2)) / counts[ring]
    pairs = [(i, i + 1) for i in range(len(counts) - 1)]
    if closed:
        pairs.append((len(counts) - 1, 0))
    strips = [
        _strip(angle[first[a] : first[a + 1]], angle[first[b] : first[b + 1]], int(first[a]), int(first[b]))
        for a, b in pairs
    ]
    return ring, angle, np.concatenate(strips)


def _strip(lower: Floats, upper: Floats, lower_first: int, upper_first: int) -> Ints:
    """Triangles between two rings: walk round both at once, always stepping to the nearer middle."""
    n, m = len(lower), len(upper)
    # a step along a ring happens at the middle of its arc; merge the middles of both rings
    middles = np.concatenate([lower + np.pi / n, upper + np.pi / m])
    below = np.arange(n + m) < n
    order = np.lexsort((below, middles))
    below = below[order]
    low = np.remainder(np.cumsum(below) - below, n)
    up = np.remainder(np.cumsum(~below) - ~below, m)
    a, b = lower_first + low, upper_first + up
    third = np.where(below, lower_first + (low + 1) % n, upper_first + (up + 1) % m)
    return np.stack([a, third, b], axis=1)
