"""Power cells: weights that give each seed the volume it is to have."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import splu

from warpedfoam.arrays import Floats, Ints
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.tessellate.fields import SeedFields

#: Rounds of Newton's method at most; a round that gains less than this share ends it.
ROUNDS, GAIN = 30, 0.01
#: Length of interface for each mesh edge that crosses it, in edges: a line at random over even triangles.
PER_CROSSING = 0.4535
#: A cell keeps at least this share of what it has, in one round.
KEPT = 0.5


def power_weights(field: SeedFields, seeds: Floats, shares: Floats, volumes: Floats) -> Floats:
    """Weights w with which the cells d² − w hold the volumes asked for, to the mesh's resolution.

    Newton's method on semi-discrete optimal transport: a cell's volume grows at the rate
    Σ_j L_ij ρ / (2 |s_i − s_j|) with its own weight and loses L_ij ρ / (2 |s_i − s_j|) to each
    neighbour's, L_ij the length of their interface and ρ the volume per area. Steps are shortened
    until no cell loses more than half of its volume.

    Parameters
    ----------
    field : SeedFields
    seeds : (n, 3) array
    shares : (n_nodes,) array
        Volume that each mesh node stands for.
    volumes : (n,) array
        Volumes asked for; scaled to the total of ``shares``.

    Returns
    -------
    (n,) array
        With mean 0; those of the round that came nearest.
    """
    count = len(seeds)
    wanted = volumes * (shares.sum() / volumes.sum())
    weights = np.zeros(count)
    best, least = weights, np.inf
    density = float(shares.sum() / field.mesh.node_areas.sum())
    for _ in range(ROUNDS):
        labels = field.weighted(weights).labels()
        held = np.bincount(labels, shares, minlength=count)
        off = wanted - held
        fault = float(np.abs(off / wanted).mean())
        if fault > (1.0 - GAIN) * least:
            break
        best, least = weights, fault
        rates = _rates(field, labels, seeds, density)
        # the mean weight does nothing: a hair of stiffness settles it
        stiff = diags_array(np.full(count, 1e-9 * float(abs(rates).max())))
        step = splu(csc_array(rates + stiff)).solve(off)
        step -= step.mean()
        share = 1.0
        while share > 1e-3:
            tried = field.weighted(weights + share * step).labels()
            if (np.bincount(tried, shares, minlength=count) >= KEPT * np.minimum(held, wanted)).all():
                break
            share *= 0.5
        weights = weights + share * step
    return best


def _rates(field: SeedFields, labels: Ints, seeds: Floats, density: float) -> csc_array:
    """Change of the cells' volumes with the weights, (n, n)."""
    mesh, count = field.mesh, len(seeds)
    a, b = labels[mesh.edges].T
    apart = a != b
    i, j, length = a[apart], b[apart], mesh.edge_lengths[apart]
    gap = np.linalg.norm(nearest_image(seeds[j] - seeds[i], mesh.period), axis=1)
    rate = density * PER_CROSSING * length / (2.0 * np.maximum(gap, 1e-3 * gap.mean()))
    rows, columns = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
    values = np.concatenate([rate, rate, -rate, -rate])
    return csc_array(coo_array((values, (rows, columns)), shape=(count, count)))
