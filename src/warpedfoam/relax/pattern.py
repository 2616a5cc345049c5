"""The sparsity pattern of a foam's Newton matrix: built once per topology, refilled every step.

Unknowns: two tangent steps per vertex, then one pressure per bubble. They are ordered so that each
pressure follows a vertex of its own bubble at once; its pivot is then minus the square of that
volume's gradient in the inverse stiffness, never zero, and no pivoting is needed.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching
from scipy.sparse.linalg import splu

from warpedfoam.arrays import Floats, Ints
from warpedfoam.network import CellNetwork


class Pattern:
    """Places of film blocks (6, 6) in the ordered matrix, and of its diagonal."""

    def __init__(self, network: CellNetwork) -> None:
        n_vertices, n_bubbles = network.n_vertices, network.n_bubbles
        self.n_vertices, self.n_bubbles = n_vertices, n_bubbles
        self.size = 2 * n_vertices + n_bubbles
        self.position = _ordering(network)
        dofs = np.stack(
            [
                2 * network.tails,
                2 * network.tails + 1,
                2 * network.heads,
                2 * network.heads + 1,
                2 * n_vertices + network.left,
                2 * n_vertices + network.right,
            ]
        )
        self.dofs = dofs
        at = self.position[dofs]
        shape = (6, 6, network.n_films)
        rows = np.broadcast_to(at[:, None], shape).ravel()
        columns = np.broadcast_to(at[None], shape).ravel()
        diagonal = np.arange(self.size)
        keys = np.concatenate([columns * self.size + rows, diagonal * (self.size + 1)])
        unique, slots = np.unique(keys, return_inverse=True)
        self._slots = slots[: 36 * network.n_films]
        self.diagonal = slots[36 * network.n_films :][self.position]
        self._indices = (unique % self.size).astype(np.int32)
        self._indptr = np.searchsorted(unique, diagonal * self.size).astype(np.int32)
        self._indptr = np.append(self._indptr, np.int32(len(unique)))

    def matrix(self, blocks: Floats, shifts: Floats) -> csc_array:
        """The ordered matrix from film blocks (6, 6, F) plus ``shifts`` (size,) on its diagonal."""
        data: Floats = np.bincount(self._slots, blocks.ravel(), len(self._indices)).astype(
            np.float64, copy=False
        )
        data[self.diagonal] += shifts
        return csc_array((data, self._indices, self._indptr), shape=(self.size, self.size))

    def gather(self, parts: Floats) -> Floats:
        """Sum film vectors (6, F) into one vector (size,), in the order of the unknowns."""
        return np.bincount(self.dofs.ravel(), parts.ravel(), self.size).astype(np.float64, copy=False)

    def ordered(self, vector: Floats) -> Floats:
        """A vector in matrix order."""
        out = np.empty_like(vector)
        out[self.position] = vector
        return out

    def restored(self, vector: Floats) -> Floats:
        """A vector back in the order of the unknowns."""
        return vector[self.position]


def _ordering(network: CellNetwork) -> Ints:
    """Position of each unknown in the matrix: minimum degree on vertices fused with their bubbles."""
    n_vertices, n_bubbles = network.n_vertices, network.n_bubbles
    ones = np.ones(len(network.bubble))
    corners = csr_array((ones, (network.bubble, network.origin)), shape=(n_bubbles, n_vertices))
    mate = maximum_bipartite_matching(corners, perm_type="column").astype(np.int64)
    alone = mate < 0
    mate[alone] = n_vertices + np.flatnonzero(alone)
    group = np.stack([network.tails, network.heads, mate[network.left], mate[network.right]])
    shape = (4, 4, network.n_films)
    rows = np.broadcast_to(group[:, None], shape).ravel()
    columns = np.broadcast_to(group[None], shape).ravel()
    n = n_vertices + n_bubbles
    links = coo_array((np.full(len(rows), -1.0), (rows, columns)), shape=(n, n)).tocsc()
    links.setdiag(100.0 * np.ones(n))
    order = splu(
        links, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    ).perm_c.astype(np.int64)
    place = np.concatenate([np.repeat(order[:n_vertices], 2), order[mate]])
    rank = np.concatenate([np.zeros(2 * n_vertices), np.ones(n_bubbles)])
    position = np.empty(len(place), dtype=np.int64)
    position[np.lexsort((rank, place))] = np.arange(len(place))
    return position
