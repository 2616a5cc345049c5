"""Outlines of clusters: how near they come to each other, and how far a step may go before they meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.cell import HeleShawCell
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.network import CellNetwork

#: Distance of points along outlines, in bubble sizes, and how many there are on a film.
SPACING, FEWEST, MOST = 0.06, 9, 65
#: Two outlines face each other if the cosine of their normals is below the first; along one outline they
#: must be farther apart than the second (in bubble sizes) and than the third times their distance.
FACING, ALONG, ROUND = -0.5, 0.75, 5.0
#: Where a step that would make outlines cross ends, and how far it looks, in bubble sizes.
MEET, REACH = -0.004, 0.6
#: Nearer than this to the end of a film between the same two bubbles nothing meets anew.
NECK = 0.2


@dataclass(frozen=True, eq=False)
class Outlines:
    """Points along the films that face the exterior, film after film; arrays (k, m) or (k, m, 3).

    ``films`` (k,) are those films, ``bubbles`` (k,) what lies behind them, ``normals`` point into the
    exterior; ``loop`` (k,) and ``place`` are where along the exterior's outlines a point lies, ``around``
    (k,) that outline's length.
    """

    films: Ints
    bubbles: Ints
    points: Floats
    normals: Floats
    loop: Ints
    place: Floats
    around: Floats


@dataclass(frozen=True, eq=False)
class Facing:
    """Pairs of points that face each other across the exterior: rows of flattened `Outlines`; (n,) arrays.

    ``gap`` is the distance of the outlines there, negative where they have crossed, ``scale`` the size of
    the smaller bubble in bubble sizes, at most 1.
    """

    one: Ints
    other: Ints
    gap: Floats
    scale: Floats
    across: Floats


def outlines(
    cell: HeleShawCell,
    network: CellNetwork,
    points: Floats,
    offsets: Floats,
    exterior: int,
    length: float,
    count: int = 0,
) -> Outlines:
    """Points along all films that face the exterior on one side only, ``count`` a film or enough of them."""
    surface = cell.surface
    films = np.flatnonzero((network.left == exterior) != (network.right == exterior))
    left = network.left[films] == exterior
    bubbles = np.asarray(np.where(left, network.right[films], network.left[films]))
    tail, head = points[network.tails[films]], points[network.heads[films]]
    chord = np.linalg.norm(nearest_image(head - tail, surface.period), axis=1)
    needed = int(np.clip(np.ceil(1.3 * chord.max(initial=0.0) / (SPACING * length)) + 1, FEWEST, MOST))
    count = count or needed
    curve = surface.arc_points(tail, head, offsets[films], np.linspace(0.0, 1.0, count))
    steps = np.linalg.norm(np.diff(curve, axis=1), axis=2)
    gone = np.concatenate([np.zeros((len(films), 1)), np.cumsum(steps, axis=1)], axis=1)
    tangent = np.gradient(curve, axis=1)
    normal = surface.normals(curve.reshape(-1, 3)).reshape(curve.shape)
    out = np.cross(normal, tangent) * np.where(left, 1.0, -1.0)[:, None, None]
    out /= np.maximum(np.linalg.norm(out, axis=2, keepdims=True), 1e-300)
    # along the exterior's half-films, loop after loop
    loops = network.loops
    outer = network.bubble[loops.halves] == exterior
    loop_of = np.repeat(np.arange(len(loops.starts)), loops.sizes)
    span = np.zeros(network.n_films)
    span[films] = gone[:, -1]
    size = np.where(outer, span[loops.halves >> 1], 0.0)
    before = np.cumsum(size) - size
    before -= np.repeat(before[loops.starts], loops.sizes)
    start, which = np.zeros(network.n_films), np.zeros(network.n_films, dtype=np.int64)
    start[loops.halves[outer] >> 1] = before[outer]
    which[loops.halves[outer] >> 1] = loop_of[outer]
    total = np.bincount(loop_of, size, len(loops.starts))
    place: Floats = start[films][:, None] + np.where(left[:, None], gone, gone[:, -1:] - gone)
    return Outlines(
        films, bubbles, curve, out, which[films], place, np.asarray(total[which[films]], dtype=np.float64)
    )


def facing(
    cell: HeleShawCell, lines: Outlines, shares: Floats, length: float, reach: float, aside: float
) -> Facing:
    """Pairs within ``reach`` and, along the outlines, within ``aside`` of each other, in bubble sizes."""
    period = cell.surface.period
    count = lines.points.shape[1] if len(lines.films) else 1
    x, normal = lines.points.reshape(-1, 3), lines.normals.reshape(-1, 3)
    pairs = _near(x, length * float(np.hypot(reach, aside)), period)
    film = pairs // count
    a, b = pairs.T
    d = nearest_image(x[b] - x[a], period)
    axis = normal[a] - normal[b]
    size = np.linalg.norm(axis, axis=1)
    axis = axis / np.maximum(size, 1e-300)[:, None]
    gap = np.einsum("nx,nx->n", d, axis)
    off = np.linalg.norm(d - gap[:, None] * axis, axis=1)
    place = lines.place.ravel()
    way = np.abs(place[a] - place[b])
    way = np.minimum(way, lines.around[film[:, 0]] - way)
    way = np.where(lines.loop[film[:, 0]] == lines.loop[film[:, 1]], way, np.inf)
    share = np.minimum(shares[lines.bubbles[film]].min(axis=1), 1.0) if len(a) else np.zeros(0)
    scale = np.sqrt(share)
    fine = np.einsum("nx,nx->n", normal[a], normal[b]) < FACING
    fine &= (way > ALONG * length * scale) & (way > ROUND * np.linalg.norm(d, axis=1))
    fine &= (off < aside * length) & (np.abs(gap) < reach * length)
    return Facing(a[fine], b[fine], gap[fine] / length, scale[fine], axis[fine])


def met(
    cell: HeleShawCell,
    network: CellNetwork,
    points: Floats,
    lines: Outlines,
    pairs: Facing,
    length: float,
    window: tuple[float, float],
) -> Bools:
    """Which pairs have come within the ``window`` of gaps, in sizes of the smaller bubble.

    Beside the end of a film the outlines of its two bubbles are close, and so they are at both ends of a
    short film: that is no new contact.
    """
    low, high = window
    here = (pairs.gap < high * pairs.scale) & (pairs.gap > low * pairs.scale)
    if not here.any():
        return here
    count = lines.points.shape[1]
    same = lines.bubbles[pairs.one // count] == lines.bubbles[pairs.other // count]
    here &= ~same | (pairs.gap > -high * pairs.scale)
    found = np.flatnonzero(here)
    chosen = Facing(*(getattr(pairs, name)[found] for name in ("one", "other", "gap", "scale", "across")))
    here[found] = ~beside_films(cell, network, points, lines, chosen, length)
    return here


def beside_films(
    cell: HeleShawCell, network: CellNetwork, points: Floats, lines: Outlines, pairs: Facing, length: float
) -> Bools:
    """Whether each pair lies beside the end of a film between its own two bubbles."""
    count = lines.points.shape[1]
    between = np.sort(np.stack([network.left, network.right]), axis=0)
    inner = np.ones(network.n_films, dtype=np.bool_)
    inner[lines.films] = False
    ends = np.concatenate([network.tails[inner], network.heads[inner]])
    code = np.tile((between[0] * network.n_bubbles + between[1])[inner], 2)
    rows = np.stack([pairs.one, pairs.other])
    bubbles = np.sort(lines.bubbles[rows // count], axis=0)
    x = lines.points.reshape(-1, 3)[rows]
    middle = x[0] + 0.5 * nearest_image(x[1] - x[0], cell.surface.period)
    away = np.linalg.norm(nearest_image(middle[:, None] - points[ends][None], cell.surface.period), axis=2)
    theirs = (bubbles[0] * network.n_bubbles + bubbles[1])[:, None] == code
    out: Bools = (theirs & (away < NECK * length * pairs.scale[:, None])).any(axis=1)
    return out


def safe_share(
    cell: HeleShawCell,
    network: CellNetwork,
    points: Floats,
    lines: Outlines,
    moved: Outlines,
    shares: Floats,
    length: float,
) -> float:
    """Share of a step, to first order, at which the first outlines to cross have just met."""
    pairs = facing(cell, lines, shares, length, REACH, 2.0 * SPACING)
    pairs_gap, first = pairs.gap, pairs.gap > MEET * pairs.scale
    if not first.any():
        return 1.0
    x, y = lines.points.reshape(-1, 3), moved.points.reshape(-1, 3)
    step = nearest_image(y - x, cell.surface.period)
    change = np.einsum("nx,nx->n", step[pairs.other] - step[pairs.one], pairs.across) / length
    goal = MEET * pairs.scale
    over = first & (pairs_gap + change < goal)
    if over.any():
        chosen = Facing(*(getattr(pairs, name)[over] for name in ("one", "other", "gap", "scale", "across")))
        over[over] = ~beside_films(cell, network, points, lines, chosen, length)
    if not over.any():
        return 1.0
    return float(np.clip(((pairs_gap - goal)[over] / -change[over]).min(), 0.0, 1.0))


def _near(x: Floats, radius: float, period: Floats | None) -> Ints:
    """Pairs (n, 2) of points nearer than ``radius``."""
    box = None
    if period is not None:
        finite = np.isfinite(period)
        box = np.where(finite, period, 0.0)
        unit = np.where(finite, period, 1.0)
        x = np.where(finite, np.mod(x, unit), x)
        x = np.where(finite & (x >= unit), 0.0, x)
    if not len(x):
        return np.zeros((0, 2), dtype=np.int64)
    found = cKDTree(x, boxsize=box).query_pairs(radius, output_type="ndarray")
    return np.asarray(found, dtype=np.int64).reshape(-1, 2)
