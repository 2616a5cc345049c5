"""Markers where outlines need them: taken off films that want to vanish, put on films that bend far."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.cell import HeleShawCell
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.markers import Layout, divide, marker_chains, merge, removable, steepness
from warpedfoam.moves.t1 import independent
from warpedfoam.network import CellNetwork

#: A film steeper than the first (against its segment, in radians) is divided; two shorter than ``SHORT``
#: bubble sizes become one if that is flatter than the second, below ``LEAST`` if it is flatter than the
#: third. A film is a graph over its segment: at π/2 it is none.
STEEP, FLAT, UPRIGHT = np.radians(66.0), np.radians(48.0), np.radians(80.0)
SHORT, LEAST = 0.12, 0.025
#: Rounds of dividing: a full turn takes two.
ROUNDS = 3


def with_markers(cell: HeleShawCell, layout: Layout, exterior: int, length: float, shares: Floats) -> Layout:
    """Merge short films at markers, then divide steep ones between a bubble and the exterior.

    The layout itself where nothing is to be done.
    """
    surface = cell.surface
    markers, limit = _short(cell, layout.network, layout.points, length, shares)
    if markers.size:
        trial, films = merge(surface, layout, markers)
        fine = steepness(trial.offsets[films]) < limit
        if fine.all():
            layout = trial
        elif fine.any():
            layout = merge(surface, layout, markers[fine])[0]
    for _ in range(ROUNDS):
        steep = _steep(layout.network, layout.offsets, exterior)
        if not steep.size:
            break
        layout = divide(surface, layout, steep, np.full(len(steep), 0.5))
    return layout


def _steep(network: CellNetwork, offsets: Floats, exterior: int) -> Ints:
    outer = (network.left == exterior) != (network.right == exterior)
    return np.flatnonzero(outer & (steepness(offsets) > STEEP))


def _short(
    cell: HeleShawCell, network: CellNetwork, points: Floats, length: float, shares: Floats
) -> tuple[Ints, Floats]:
    """Markers beside short films, no two on one film, and how steep what is left may be."""
    none = np.zeros(0, dtype=np.int64), np.zeros(0)
    markers = network.markers
    if not len(markers):
        return none
    first, second = marker_chains(network, markers)
    both = np.stack([first >> 1, second >> 1], axis=1)
    tail, head = points[network.tails[both]], points[network.heads[both]]
    size = np.linalg.norm(nearest_image(head - tail, cell.surface.period), axis=2).min(axis=1) / length
    beside = np.minimum(shares[network.left[both[:, 0]]], shares[network.right[both[:, 0]]])
    size = size / np.sqrt(np.minimum(1.0, beside))
    wanted = np.flatnonzero((size < SHORT) & removable(network, markers))
    if not wanted.size:
        return none
    apart = independent(both[wanted], -size[wanted])
    wanted = wanted[apart]
    return markers[wanted], np.asarray(np.where(size[wanted] < LEAST, UPRIGHT, FLAT))
