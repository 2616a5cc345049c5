"""Outlines of clusters that come to a rim: seen, and refused in a sentence.

A bubble that touches a wall would have to be joined to it, which is not done; beyond the rim there is no
surface, and what is computed there means nothing.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import TopologyError
from warpedfoam.network import CellNetwork
from warpedfoam.relax.outlines import outlines
from warpedfoam.relax.system import State, Step

#: Gaps to the rim, in bubble sizes: steps end at the first, and from below the second none leads nearer.
TOUCH, CLOSE = 0.006, 0.02
#: Tries of a step that has to be shortened.
LOOKS = 8


class RimMet(TopologyError):
    """A bubble of an open cluster has come to the rim."""


def rim_gap(
    cell: HeleShawCell, network: CellNetwork, points: Floats, offsets: Floats, exterior: int, length: float
) -> tuple[float, int, Floats]:
    """Least distance of an outline from the rim, in ℓ, below 0 beyond it; whose bubble's, and where.

    Infinite on surfaces without a rim. Films that end on the rim are left out.
    """
    rim = cell.surface.rim
    if rim is None:
        return np.inf, -1, np.zeros(3)
    lines = outlines(cell, network, points, offsets, exterior, length)
    inside = np.isin(network.tails[lines.films], network.rim_vertices)
    inside = ~(inside | np.isin(network.heads[lines.films], network.rim_vertices))
    x = lines.points[inside].reshape(-1, 3)
    if not len(x):
        return np.inf, -1, np.zeros(3)
    places = rim.locate(x)
    away = x - rim.at(*places)
    inward = rim.frame(*places)[1]
    gap = np.copysign(np.linalg.norm(away, axis=1), np.einsum("nx,nx->n", away, inward)) / length
    k = int(gap.argmin())
    bubble = int(lines.bubbles[inside][k // lines.points.shape[1]])
    return float(gap[k]), bubble, x[k]


def met_rim(bubble_ids: Ints, bubble: int, at: Floats) -> RimMet:
    """What is said of a bubble at the rim."""
    place = ", ".join(f"{x:.4g}" for x in at.tolist())
    return RimMet(
        f"bubble {int(bubble_ids[bubble])} has come to the rim near ({place}), and clusters are not joined "
        "to walls; put the cluster farther in, or hold it (cluster_potential)"
    )


def short_of_rim(
    cell: HeleShawCell,
    state: State,
    step: Step,
    move: Callable[[Step], State],
    exterior: int,
    length: float,
    bubble_ids: Ints,
) -> Step:
    """The step, shortened so that no outline goes over the rim; ``move`` makes a step.

    Raises
    ------
    RimMet
        If an outline is at the rim and the step would lead farther.
    """
    if cell.surface.rim is None:
        return step

    def look(one: State) -> tuple[float, int, Floats]:
        return rim_gap(cell, one.network, one.points, one.offsets, exterior, length)

    ahead = look(move(step))[0]
    if ahead >= TOUCH:
        return step
    now, bubble, at = look(state)
    if now < CLOSE and not ahead > now:
        raise met_rim(bubble_ids, bubble, at)
    low, high = 0.0, 1.0
    for _ in range(LOOKS):
        share = 0.5 * (low + high)
        gap = look(move(scaled(step, share)))[0]
        if gap >= TOUCH:
            low = share
            if gap < CLOSE:
                break
        else:
            high = share
    return scaled(step, low)


def scaled(step: Step, share: float) -> Step:
    """A share of a step."""
    return Step(share * step.vertices, share * step.offsets, share * step.pressures)
