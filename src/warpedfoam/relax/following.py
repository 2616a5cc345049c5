"""Markers that follow their bubble: their slide along the outline as a function of all other steps.

Where a marker lies along its film is a matter of choice. Held where it is, it is left behind by a bubble
that moves far; let loose, it has no stiffness of its own. So its step is ν n + t s: across its film, n, it
moves as forces want, and along it, s, as its neighbours do, so that the chords beside it stretch least. That
is linear in the other steps, and the Newton matrix is that of those alone: a bubble that moves as a whole
takes its markers along, with the exact second derivatives of the energy.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.linalg import splu

from warpedfoam.arrays import Floats
from warpedfoam.network import CellNetwork
from warpedfoam.relax.held import GRIP, LINK, Held
from warpedfoam.relax.pattern import Pattern


class Following:
    """All steps (2 n_vertices,) as a sparse linear function of those that are free.

    The free ones are the steps of all vertices but markers in their frames, and for each marker the step
    across its film, in place of its first; its second is none and stays 0. The slides s minimise
    LINK Σ (stretch of a chord)² + GRIP Σ s².
    """

    def __init__(self, held: Held, network: CellNetwork) -> None:
        markers = network.markers
        # rim vertices are held too, behind the markers
        along = held.directions[: len(markers)]
        count = 2 * network.n_vertices
        self.idle = 2 * markers + 1
        kept = np.ones(count)
        kept[2 * markers] = kept[self.idle] = 0.0
        diagonal = np.arange(count)
        columns = np.repeat(2 * markers, 2)
        rows = np.stack([2 * markers, 2 * markers + 1], axis=1).ravel()
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        shape = (count, count)
        values = np.concatenate([kept, across.ravel()])
        places = np.concatenate([diagonal, rows]), np.concatenate([diagonal, columns])
        base = coo_array((values, places), shape=shape).tocsr()
        slide = coo_array(
            (along.ravel(), (rows, np.repeat(np.arange(len(markers)), 2))), shape=(count, len(markers))
        ).tocsr()
        film = held.linked
        ends = np.stack(
            [
                2 * network.tails[film],
                2 * network.tails[film] + 1,
                2 * network.heads[film],
                2 * network.heads[film] + 1,
            ]
        )
        stretch = coo_array(
            (held.links.ravel(), (np.broadcast_to(np.arange(len(film)), ends.shape).ravel(), ends.ravel())),
            shape=(len(film), count),
        ).tocsr()
        pull = stretch @ slide
        normal = LINK * (pull.T @ pull) + GRIP * coo_array(np.eye(len(markers)))
        rest = -LINK * (pull.T @ (stretch @ base)).tocsc()
        used = np.flatnonzero(np.diff(rest.indptr))
        slides = np.zeros((len(markers), count))
        slides[:, used] = splu(csc_array(normal)).solve(rest[:, used].toarray())
        #: (2 n_vertices, 2 n_vertices): all steps from the free ones
        self.steps: csr_array = (base + slide @ csr_array(slides)).tocsr()
        self.free = base

    def matrix(self, whole: csc_array, pattern: Pattern) -> csc_array:
        """Newton's matrix of the free steps and the pressures, in the pattern's order."""
        steps = self._ordered(self.steps, pattern)
        out = (steps.T @ whole @ steps).tocsc()
        idle = pattern.position[self.idle]
        return csc_array(out + coo_array((np.ones(len(idle)), (idle, idle)), shape=out.shape))

    def _ordered(self, steps: csr_array, pattern: Pattern) -> csc_array:
        flat = steps.tocoo()
        rest = np.arange(steps.shape[0], pattern.size)
        rows = pattern.position[np.concatenate([flat.coords[0], rest])]
        columns = pattern.position[np.concatenate([flat.coords[1], rest])]
        values = np.concatenate([flat.data, np.ones(len(rest))])
        return coo_array((values, (rows, columns)), shape=(pattern.size, pattern.size)).tocsc()

    def forces(self, vertices: Floats) -> Floats:
        """Forces on the free steps: along their films markers feel none."""
        return np.asarray(self.free.T @ vertices, dtype=np.float64)

    def expanded(self, free: Floats) -> Floats:
        """All vertex steps from the free ones."""
        return np.asarray(self.steps @ free, dtype=np.float64)
