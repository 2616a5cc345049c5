"""Pair charges of opposite sign that share a film: as many pairs as possible."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.network import CellNetwork


def pair_charges(network: CellNetwork, charges: Ints, film_lengths: Floats) -> tuple[Ints, Ints]:
    """Match unit charges +1 with neighbouring −1, and return the films across which they pair.

    A maximum matching of the charges (a bubble of charge q counts |q| times); among all those the one
    across the longest films, because short films come and go.

    Parameters
    ----------
    network : CellNetwork
    charges : (n_bubbles,) integer array
        Those to pair; 0 leaves a bubble out.
    film_lengths : (n_films,) array

    Returns
    -------
    films, counts : (k,) integer arrays
        The longest film of each pair of bubbles, ascending, and the number of unit charges that they share.

    Notes
    -----
    Shortest augmenting paths on a sparse graph (`scipy.sparse.csgraph.min_weight_full_bipartite_matching`),
    with a costly dummy partner for everybody who may stay alone.

    Examples
    --------
    >>> from warpedfoam import network_from_loops
    >>> net = network_from_loops([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])
    >>> films, counts = pair_charges(net, np.array([1, -2, 0, 1]), np.arange(1.0, 7.0))
    >>> sorted({int(net.left[f]), int(net.right[f])} == {0, 1} for f in films), counts.tolist()
    ([False, True], [1, 1])
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    left, right = network.left, network.right
    films = np.flatnonzero(charges[left] * charges[right] < 0)
    none = np.zeros(0, dtype=np.int64)
    if not films.size:
        return none, none
    swap = charges[left[films]] < 0
    plus = np.where(swap, right[films], left[films])
    minus = np.where(swap, left[films], right[films])
    # of several films between two bubbles the longest stands for all
    order = np.lexsort((-film_lengths[films], minus, plus))
    films, plus, minus = films[order], plus[order], minus[order]
    first = np.ones(len(films), dtype=bool)
    first[1:] = (np.diff(plus) != 0) | (np.diff(minus) != 0)
    films, plus, minus = films[first], plus[first], minus[first]

    size = np.abs(charges)
    repeats = size[plus] * size[minus]
    edge = np.repeat(np.arange(len(films)), repeats)
    turn = np.arange(len(edge)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
    rows, columns = np.maximum(charges, 0), np.maximum(-charges, 0)
    row = (np.cumsum(rows) - rows)[plus[edge]] + turn // size[minus[edge]]
    column = (np.cumsum(columns) - columns)[minus[edge]] + turn % size[minus[edge]]
    n_rows, n_columns = int(rows.sum()), int(columns.sum())
    cost = 2.0 - film_lengths[films] / film_lengths[films].max()
    alone = np.arange(n_rows)
    costs = np.concatenate([cost[edge], np.full(n_rows, 4.0 * (n_rows + 1))])
    where = (np.concatenate([row, alone]), np.concatenate([column, n_columns + alone]))
    graph = coo_array((costs, where), shape=(n_rows, n_columns + n_rows)).tocsr()
    matched_row, matched_column = min_weight_full_bipartite_matching(graph)
    real = matched_column < n_columns
    owner_plus = np.repeat(np.arange(len(charges)), rows)[matched_row[real]]
    owner_minus = np.repeat(np.arange(len(charges)), columns)[matched_column[real]]
    keys = plus * len(charges) + minus  # ascending by construction
    hit = np.searchsorted(keys, owner_plus * len(charges) + owner_minus)
    counts = np.bincount(hit, minlength=len(films))
    chosen = np.flatnonzero(counts)
    ascending = np.argsort(films[chosen])
    return films[chosen][ascending], counts[chosen][ascending].astype(np.int64)
