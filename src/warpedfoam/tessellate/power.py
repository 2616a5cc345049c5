"""Weights of a power diagram that give each cell a wanted share of the area."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from warpedfoam.arrays import Floats
from warpedfoam.tessellate.fields import SeedFields

#: Newton steps, and the largest change of a weight in one, in squared spacings.
STEPS, CAP = 8, 0.25


def balanced_weights(field: SeedFields, volumes: Floats, spacing: float) -> Floats:
    """Weights w whose cells {d² − w least} hold areas in proportion to ``volumes``.

    Damped Newton steps of semi-discrete transport: the area of cell i changes with w_i − w_j at the
    rate (length of their common film) / (2 × distance of their seeds), both estimated on the mesh.
    The areas are known only to a mesh node's share, so the steps stop there.
    """
    mesh, count = field.mesh, len(volumes)
    wanted = volumes / volumes.sum() * mesh.area
    weights = np.zeros(count)
    best, least = weights, np.inf
    for _ in range(STEPS):
        labels = field.labels(weights)
        areas = np.bincount(labels, mesh.node_areas, minlength=count)
        fault = wanted - areas
        error = float(np.abs(fault).mean())
        if error < least:
            best, least = weights, error
        if error < 0.5 * mesh.area / mesh.n_nodes:
            break
        step = _rates(field, labels, count, spacing).solve(fault)
        weights = weights + np.clip(step, -CAP * spacing**2, CAP * spacing**2)
        weights -= weights.mean()
    return best


def _rates(field: SeedFields, labels: np.ndarray, count: int, spacing: float):  # type: ignore[no-untyped-def]
    mesh = field.mesh
    a, b = mesh.edges.T
    across = labels[a] != labels[b]
    left, right = labels[a[across]], labels[b[across]]
    # a film of length l crosses about l · 2/(√3 h) · ... mesh edges; each stands for its share
    share = mesh.mean_edge / np.sqrt(3.0)
    rate = np.full(len(left), share / (2.0 * spacing))
    rows, columns = np.concatenate([left, right]), np.concatenate([right, left])
    off = coo_array((np.concatenate([rate, rate]), (rows, columns)), shape=(count, count)).tocsc()
    diagonal = np.asarray(off.sum(axis=0)).ravel() + 1e-6 + 0.05 * share / spacing
    matrix = csc_array(-off)
    matrix.setdiag(diagonal)
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
