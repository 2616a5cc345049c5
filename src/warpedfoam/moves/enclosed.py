"""Which region of the exterior a join has cut off, by Gauss–Bonnet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.kernels.loops import Loops, loops_of
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.network import CellNetwork
from warpedfoam.surfaces.protocol import Layer, Surface

#: How far the curvature round and inside a loop may be from 2π for the loop to bound a disk; films cut a
#: moment ago bend sharply at their ends.
DISK = 1.5
#: Points along each film where it is told whether something lies inside a loop.
ROUND = 9


@dataclass(frozen=True, eq=False)
class Half:
    """Half-films after a join, not yet a network, and their geometry."""

    following: Ints
    origin: Ints
    points: Floats
    offsets: Floats


def enclosed_loop(
    surface: Surface, network: CellNetwork, exterior: int, after: Half, starts: Ints
) -> int | None:
    """A half-film of the loop that now bounds a disk of the exterior with nothing in it, or None.

    A loop has a disk on its left if and only if ∮ κ_g ds with its corners and ∫ G dA inside add up to
    2π. Of two disks the smaller is taken: something must be left for the exterior. ``starts`` are the
    half-films of the exterior that start at the joined markers.
    """
    count = len(after.following)
    outside = np.concatenate([network.bubble == exterior, np.zeros(count - len(network.bubble), np.bool_)])
    every = loops_of(after.following, np.where(outside, 0, 1))
    loop_of = np.repeat(np.arange(len(every.starts)), every.sizes)
    where = np.empty(count, dtype=np.int64)
    where[every.halves] = loop_of
    mine = np.unique(where[outside])
    if len(mine) < 2:
        return None
    fresh = np.unique(where[starts])
    best, least = None, np.inf
    # two loops at most
    for loop in fresh.tolist():
        halves = every.halves[loop_of == loop]
        area, turning = _turning(surface, after, halves)
        if not abs(turning - 2.0 * np.pi) < DISK or area >= least:
            continue
        others = every.halves[np.isin(loop_of, mine) & (loop_of != loop)]
        if _holds(surface, after, halves, others, area):
            continue
        best, least = int(halves[0]), area
    return best


def _turning(surface: Surface, after: Half, halves: Ints) -> tuple[float, float]:
    """Area left of a loop, and ∮ κ_g ds + corners + ∫ G dA; on genus 0 what is left of it is counted."""
    film, back = halves >> 1, (halves & 1).astype(np.bool_)
    tail, head = after.points[after.origin[2 * film]], after.points[after.origin[2 * film + 1]]
    rule = lobatto(after.offsets.shape[1] + 9)
    curve = surface.arc_points(tail, head, after.offsets[film], rule.nodes)
    first = np.einsum("kj,fjx->fkx", rule.derivative, curve)
    second = np.einsum("kj,fjx->fkx", rule.derivative, first)
    normal = surface.normals(curve.reshape(-1, 3)).reshape(curve.shape)
    speed = np.linalg.norm(first, axis=2)
    bend = np.einsum("fkx,fkx->fk", normal, np.cross(first, second)) / np.maximum(speed, 1e-300) ** 2
    turned = np.where(back, -1.0, 1.0) * (bend @ rule.weights)
    leave = np.where(back[:, None], -first[:, -1], first[:, 0])
    arrive = np.where(back[:, None], -first[:, 0], first[:, -1])
    here = np.where(back[:, None], normal[:, -1], normal[:, 0])
    before = np.roll(arrive, 1, axis=0)
    sine = np.einsum("fx,fx->f", here, np.cross(before, leave))
    corner = np.arctan2(sine, np.einsum("fx,fx->f", before, leave))
    # one loop, its films numbered anew
    k = len(halves)
    loop = Loops(2 * np.arange(k) + (halves & 1), np.zeros(1, dtype=np.int64))
    parts = [
        float(surface.loop_integrals(tail, head, after.offsets[film], loop, layer)[0])
        for layer in (Layer.surface(), Layer.curvature())
    ]
    area, curvature = parts
    if surface.euler_characteristic == 2 and surface.rim is None:
        # every loop has a disk on its left; a lone one may have been given the whole surface or nothing
        rounds = np.floor(area / surface.area)
        area, curvature = area - rounds * surface.area, curvature - rounds * 4.0 * np.pi
    if area <= 0.0:
        return np.inf, np.inf
    return area, float(turned.sum() + corner.sum()) + curvature


def _holds(surface: Surface, after: Half, halves: Ints, others: Ints, area: float) -> bool:
    """Whether the region left of a loop holds one of the exterior's other loops."""
    if not len(others):
        return False
    film = halves >> 1
    tail, head = after.points[after.origin[2 * film]], after.points[after.origin[2 * film + 1]]
    xi = np.linspace(0.0, 1.0, ROUND)[:-1]
    curve = surface.arc_points(tail, head, after.offsets[film], xi)
    against = surface.arc_points(tail, head, after.offsets[film], 1.0 - xi)
    curve = np.where((halves & 1).astype(np.bool_)[:, None, None], against, curve)
    ring = curve.reshape(-1, 3)
    if surface.period is not None:
        ring = ring[0] + np.cumsum(
            nearest_image(np.diff(ring, axis=0, prepend=ring[:1]), surface.period), axis=0
        )
    at = after.points[after.origin[others]]
    middle = surface.project(ring.mean(axis=0)[None])
    away = nearest_image(at - middle, surface.period)
    reach = float(np.linalg.norm(ring - middle, axis=1).max())
    near = np.linalg.norm(away, axis=1) < reach
    small = area < 0.5 * surface.area
    if not near.any():
        return not small
    first, second = surface.vertex_frames(middle)[0]
    plane = np.stack([(ring - middle) @ first, (ring - middle) @ second], axis=1)
    spots = np.stack([away[near] @ first, away[near] @ second], axis=1)
    arm = plane[None] - spots[:, None]
    onward = np.roll(arm, -1, axis=1)
    cross = arm[..., 0] * onward[..., 1] - arm[..., 1] * onward[..., 0]
    angle = np.arctan2(cross, (arm * onward).sum(axis=2)).sum(axis=1)
    inside = bool((np.abs(angle) > np.pi).any())
    return inside if small else not inside
