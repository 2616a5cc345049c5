"""Build a `CellNetwork` from bubbles given as loops of vertices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpedfoam.arrays import as_indices
from warpedfoam.errors import TopologyError
from warpedfoam.network.cell_network import CellNetwork


def network_from_loops(loops: Sequence[Sequence[int]], *, rims: bool = False) -> CellNetwork:
    """Network whose bubble i has the vertices ``loops[i]``, counter-clockwise seen from outside.

    Each directed pair of neighbouring vertices must occur once, and its reverse once, in all loops
    together; use marker vertices where two bubbles share several films between the same vertices.

    Parameters
    ----------
    loops : sequence of sequences of int
    rims : bool, optional
        Whether a pair may lack its reverse: it is then a wall, on the rim.

    Raises
    ------
    TopologyError
        If a pair occurs twice, or lacks its reverse and there are no rims, or the result is not a
        network.

    Examples
    --------
    The tetrahedron:

    >>> net = network_from_loops([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])
    >>> net.n_films, net.charges.tolist()
    (6, [3, 3, 3, 3])
    """
    if len(loops) == 0:
        raise TopologyError("loops is empty: a network needs bubbles")
    rings = [as_indices(np.asarray(ring), f"loops[{i}]", (None,)) for i, ring in enumerate(loops)]
    if any(len(ring) < 2 for ring in rings):
        bad = next(i for i, ring in enumerate(rings) if len(ring) < 2)
        raise TopologyError(f"loops[{bad}] needs at least 2 vertices, got {len(rings[bad])}")
    sizes = np.array([len(ring) for ring in rings])
    start = as_indices(np.concatenate(rings), "loops", (None,), below=int(sizes.sum()))
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    position = np.arange(len(start))
    last = position == np.repeat(first + sizes - 1, sizes)
    after = np.where(last, np.repeat(first, sizes), position + 1)
    end = start[after]
    n = int(start.max()) + 1
    keys, reverse = start * n + end, end * n + start
    order = np.argsort(keys)
    if (np.diff(keys[order]) == 0).any():
        bad = int(keys[order][np.flatnonzero(np.diff(keys[order]) == 0)[0]])
        raise TopologyError(
            f"two loops run from vertex {bad // n} to {bad % n}; orient all counter-clockwise and "
            "put markers on films that join the same two vertices"
        )
    place = np.minimum(np.searchsorted(keys[order], reverse), len(keys) - 1)
    twin = order[place]
    wall = keys[twin] != reverse
    if wall.any() and not rims:
        bad = int(keys[np.flatnonzero(wall)[0]])
        raise TopologyError(
            f"the film from vertex {bad // n} to {bad % n} has a bubble on one side only; "
            "the loops must close the surface"
        )
    if wall.all():
        raise TopologyError("loops has no films, only walls")
    if (wall & wall[after]).any():
        bad = int(end[np.flatnonzero(wall & wall[after])[0]])
        raise TopologyError(f"no film ends at vertex {bad} on the rim; leave it out")
    lead = (position < twin) & ~wall
    half = np.empty(len(start), dtype=np.int64)
    half[lead] = 2 * np.arange(int(lead.sum()))
    half[twin[lead]] = half[lead] + 1
    film = ~wall
    onward = np.where(wall[after], after[after], after)
    following, origin, bubble = (np.empty(int(film.sum()), dtype=np.int64) for _ in range(3))
    following[half[film]] = half[onward[film]]
    origin[half[film]] = start[film]
    bubble[half[film]] = np.repeat(np.arange(len(rings)), sizes)[film]
    return CellNetwork(following, origin, bubble)
