"""Film energy and bubble volumes with their derivatives, film by film."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.cell import HeleShawCell
from warpedfoam.foam import bubble_integrals
from warpedfoam.network import CellNetwork
from warpedfoam.surfaces.protocol import ArcTerms

#: Films per pass; keeps the work arrays of one pass in the processor's cache.
CHUNK = 1024


def film_terms(
    cell: HeleShawCell,
    network: CellNetwork,
    points: Floats,
    offsets: Floats,
    *,
    tension: float,
    pressures: Floats | None,
) -> ArcTerms:
    """Areas of all films, derivatives of areas and left volumes, and Hessians.

    With ``pressures`` (n_bubbles,) the Hessian of each film's share of the Lagrangian
    γ A − (p_left − p_right) V_left is computed too; the unknowns of a film are its ends' tangent
    steps and its offsets, (A₁, A₂, B₁, B₂, u_1 … u_{p−1}).
    """
    tail, head = points[network.tails], points[network.heads]
    jump = None if pressures is None else pressures[network.left] - pressures[network.right]
    parts = [
        cell.surface.arc_terms(
            tail[lo : lo + CHUNK],
            head[lo : lo + CHUNK],
            offsets[lo : lo + CHUNK],
            cell.layer,
            tension=tension,
            jump=None if jump is None else jump[lo : lo + CHUNK],
        )
        for lo in range(0, network.n_films, CHUNK)
    ]
    if len(parts) == 1:
        return parts[0]
    hessians = [part.hessian for part in parts if part.hessian is not None]
    return ArcTerms(
        np.concatenate([part.measure for part in parts]),
        np.concatenate([part.gradient for part in parts], axis=-1),
        np.concatenate([part.volume for part in parts], axis=-1),
        np.concatenate(hessians, axis=-1) if hessians else None,
    )


def bubble_volumes(cell: HeleShawCell, network: CellNetwork, points: Floats, offsets: Floats) -> Floats:
    """Steiner volumes of all bubbles, (n_bubbles,): the function whose derivative `film_terms` gives."""
    return bubble_integrals(cell, network, points, offsets, cell.layer)
