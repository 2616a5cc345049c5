"""How far a cluster may go in one exact step, and the shift that makes a step as long.

Along a soft motion, such as a drift round a torus, Newton's step is far too long. Scaled down as a whole it
would leave the shape wrong; a greater shift shortens the soft motion alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.cell import HeleShawCell
from warpedfoam.relax.system import State, Step, parts_of, unfolded

#: Least and greatest reach, in ℓ; residuals below and above which it grows and shrinks.
NEAR, FAR, CALM, ROUGH = 0.2, 0.8, 0.005, 0.02
#: By how much a step may be too long, how many shifts are tried, and the least of them.
MUCH, LOOKS, LEAST = 1.3, 4, 1e-6
#: A step whose cosine with a mode is below this does not tell which of its two ways leads down.
UNDECIDED = 0.1
#: A linear field without any symmetry: constant and turning part.
FIELD = np.sqrt(np.array([[2.0, 3.0, 5.0], [7.0, 11.0, 13.0]]))


def which_way(cell: HeleShawCell, state: State, mode: Floats) -> float:
    """+1 or −1: which way to follow a mode (n_vertices, 2) that goes down both ways."""
    steps = np.einsum("vix,vi->vx", cell.surface.vertex_frames(state.points), mode)
    field = FIELD[0] + np.cross(FIELD[1], state.points / cell.surface.size)
    return 1.0 if float((field * steps).sum()) >= 0.0 else -1.0


def next_reach(reach: float, force: float) -> float:
    """The reach after a step to a state with the residual ``force``."""
    if force < CALM:
        return min(1.5 * reach, FAR)
    return max(0.5 * reach, NEAR) if force > ROUGH else reach


def stiffer(seen: list[tuple[float, float]], most: float) -> float:
    """The next shift to try, from pairs (shift, 1/size): 1/size is linear in it where one motion is soft."""
    shift, inverse = seen[-1]
    if len(seen) > 1:
        before, other = seen[-2]
        slope = (inverse - other) / (shift - before)
        if slope > 0.0:
            return min(max(shift + (1.0 / most - inverse) / slope, 1.1 * shift), 1.0)
    return min(max(shift / (inverse * most), LEAST), 1.0)


def turned_parts(cell: HeleShawCell, state: State, step: Step, length: float) -> Step:
    """The step with the turn that is in it made a turn: straight steps round a centre would inflate.

    A turn by ω takes an arm r to r cos ω + J r sin ω, not to r + ω J r. Parts that no film joins turn on
    their own, those that go round the surface not at all.
    """
    part = parts_of(state.network)
    points, round_ = unfolded(cell, state, part)
    count = np.bincount(part)
    centre = np.stack([np.bincount(part, points[:, i]) / count for i in range(3)], axis=1)
    away = (points - centre[part]) / length
    frames, normals = cell.surface.vertex_frames(state.points), cell.surface.normals(state.points)
    arm = np.einsum("vix,vx->vi", frames, away)
    across = np.einsum("vix,vx->vi", frames, np.cross(normals, away))
    work = np.bincount(part, np.einsum("vi,vi->v", across, step.vertices))
    angle = work / np.maximum(np.bincount(part, (across**2).sum(axis=1)), 1e-300)
    turn = np.where(round_, 0.0, np.clip(angle, -1.0, 1.0))[part][:, None]
    return replace(step, vertices=step.vertices - (1.0 - np.cos(turn)) * arm - (turn - np.sin(turn)) * across)
