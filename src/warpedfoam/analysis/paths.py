"""Shortest paths from bubble to bubble: distances, and how frames turn along them."""

from __future__ import annotations

import numpy as np

from warpedfoam.analysis.frames import links
from warpedfoam.arrays import Floats, Ints
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image


class BubblePaths:
    """Graph of bubbles joined to their neighbours and to these neighbours' neighbours.

    An edge is as long as the circular arc between the two centres whose ends are bent as the surface is:
    c · (α/2) / sin(α/2), c the chord and α the turn of the normal along it. On a sphere that is the
    geodesic. A path has six directions from neighbours and six between them, so it is at most
    1/cos 15° = 1.035 times the geodesic in a honeycomb. Frames turn along an edge by the least rotation
    between its normals.

    Parameters
    ----------
    foam : Foam
    normals : (n_bubbles, 3) array
    frames : (n_bubbles, 2, 3) array
    """

    def __init__(self, foam: Foam, normals: Floats, frames: Floats) -> None:
        from scipy.sparse import coo_array

        network, n = foam.network, foam.n_bubbles
        one, two = network.left, network.right
        inside = network.bubble_euler == 1
        film = inside[one] & inside[two] & (one != two)
        ends = (np.concatenate([one[film], two[film]]), np.concatenate([two[film], one[film]]))
        near = coo_array((np.ones(len(ends[0])), ends), shape=(n, n)).tocsr()
        both = (near + near @ near).tocoo()
        distinct = both.row < both.col
        tail, head = both.row[distinct].astype(np.int64), both.col[distinct].astype(np.int64)
        centres = foam.bubble_centres
        chord = nearest_image(centres[head] - centres[tail], foam.cell.surface.period)
        length = np.linalg.norm(chord, axis=1)
        bend = np.abs(np.einsum("ex,ex->e", normals[head] - normals[tail], chord))
        half = np.minimum(0.5 * bend / np.maximum(length, 1e-300), 1.0)  # sin(α/2)
        length = length * np.where(half > 1e-6, np.arcsin(half) / np.maximum(half, 1e-300), 1.0)
        pair = (np.concatenate([tail, head]), np.concatenate([head, tail]))
        # csgraph drops edges of length 0
        length = np.maximum(length, 1e-12 * foam.bubble_size)
        self.lengths = coo_array((np.tile(length, 2), pair), shape=(n, n)).tocsr()
        self._normals, self._frames = normals, frames

    def distances(self, sources: Ints, limit: float = np.inf) -> tuple[Floats, Floats]:
        """Distances (k, n) from ``sources`` (k,), infinite beyond ``limit``, and angles (k, n).

        A vector with components z in a source's frame has z e^{iA} in the other's after transport along
        the path.
        """
        from scipy.sparse.csgraph import dijkstra

        distance, before = dijkstra(self.lengths, indices=sources, return_predecessors=True, limit=limit)
        n = distance.shape[1]
        here = np.arange(n)
        back = np.where(before < 0, here, before).astype(np.int64)
        angle = links(self._normals, self._frames, back.ravel(), np.tile(here, len(sources))).reshape(
            back.shape
        )
        angle[before < 0] = 0.0
        # pointer doubling down every path at once
        for _ in range(int(np.ceil(np.log2(max(n, 2)))) + 1):
            angle = angle + np.take_along_axis(angle, back, axis=1)
            further = np.take_along_axis(back, back, axis=1)
            if np.array_equal(further, back):
                break
            back = further
        return distance, angle
