"""Open clusters: which bubbles belong together, and charges with a rule for their outlines."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from warpedfoam.arrays import Ints, as_instance, frozen
from warpedfoam.foam import Foam


def cluster_labels(foam: Foam) -> Ints:
    """Number of the cluster that each bubble belongs to, (n_bubbles,): 0, 1, … by first bubble.

    Bubbles that share a film belong together. The exterior has −1. A foam without one is one cluster.

    Raises
    ------
    TypeError
        If ``foam`` is not a Foam.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Torus, cluster_foam
    >>> cluster_labels(cluster_foam(HeleShawCell(Torus(20.0, 4.0), gap=0.5), [2, 3], volumes=0.5))
    array([ 0,  0,  1,  1,  1, -1])
    """
    as_instance(foam, "foam", Foam)
    network, exterior = foam.network, -1 if foam.exterior is None else foam.exterior
    inner = (network.left != exterior) & (network.right != exterior)
    ends = network.left[inner], network.right[inner]
    links = coo_array((np.ones(int(inner.sum())), ends), shape=(foam.n_bubbles,) * 2)
    label = np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)
    if exterior >= 0:
        label[exterior] = -1
    # by first bubble, whatever order the graph was walked in
    held = np.flatnonzero(label >= 0)
    first, where = np.unique(label[held], return_index=True, return_inverse=True)[1:]
    out = np.full(foam.n_bubbles, -1)
    out[held] = np.argsort(np.argsort(first))[where]
    return frozen(out)


def cluster_charges(foam: Foam) -> Ints:
    """Charges q = 6 − (sides to bubbles) − 2 (sides to the exterior), (n_bubbles,); 0 for the exterior.

    A side to the exterior counts twice, as a wall does: at an outline a bubble of three films to others
    and one outer arc is at home. With threefold vertices, V − F + n = χ gives Σ q = 6 χ over every
    cluster: 6 for a disk, 0 for a ring round a torus. A bubble whose whole outline faces the exterior has
    no corners, and 6. Sides count corner to corner, whatever markers lie between.

    Without an exterior these are the charges of `CellNetwork`.

    Raises
    ------
    TypeError
        If ``foam`` is not a Foam.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Torus, cluster_foam
    >>> cluster_charges(cluster_foam(HeleShawCell(Torus(20.0, 4.0), gap=0.5), 7, volumes=0.5))
    array([0, 1, 1, 1, 1, 1, 1, 0])
    """
    as_instance(foam, "foam", Foam)
    network, exterior = foam.network, foam.exterior
    if exterior is None:
        return network.charges
    halves = np.arange(len(network.next))
    corner = network.vertex_degrees[network.origin] == 3
    outer = corner & (network.bubble[halves ^ 1] == exterior)
    charges = network.charges - np.bincount(network.bubble[outer], minlength=network.n_bubbles)
    charges[exterior] = 0
    return frozen(charges)
