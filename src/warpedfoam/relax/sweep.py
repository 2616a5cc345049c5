"""T1s between Newton steps: which films turn, how far vertices may move, and the state afterwards."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.cell import HeleShawCell
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.t1 import (
    T1Event,
    allowed,
    independent,
    lay_films,
    outward_tangents,
    pulls,
    rewire,
    t1_sites,
)
from warpedfoam.relax.held import moved_points
from warpedfoam.relax.system import State, Step
from warpedfoam.relax.wall_sweep import WallLimits, WallSweep, plan_walls

#: A film turns if it would become shorter than this, in bubble sizes (0.1 makes T1s cycle).
SHORT = 0.02
#: A new film is this long at least, and a turned long film this long at most.
NEW_LENGTH = (0.03, 0.1)
#: The pull on the new film must exceed the pull on the old one by this, and by this per earlier T1.
PREFERENCE = (1e-3, 0.02)
LIMITS = WallLimits(SHORT, PREFERENCE, NEW_LENGTH[0])


@dataclass(frozen=True, eq=False)
class Sweep:
    """Films about to vanish, those among them that turn, and the limit on each vertex's step.

    ``collapsing`` tells which of ``failing`` would lose more than half of their chord; ``walls`` what
    turns at the rim.
    """

    failing: Ints
    collapsing: Bools
    turning: Ints
    along: Floats
    current: Floats
    limit: Floats
    scale: Floats
    walls: WallSweep | None


def plan_sweep(
    cell: HeleShawCell,
    state: State,
    step: Step,
    length: float,
    turns: Ints,
    shares: Floats,
    *,
    t1: bool,
) -> Sweep:
    """Find films that the step would make vanish, and decide which of them turn.

    A film fails if its chord would shrink below ``SHORT`` bubble sizes (less beside small bubbles, whose
    ``shares`` of the mean volume are below 1) or reverse. It turns if the pull of its neighbours on the
    turned film is greater than on it, ``turns`` counting its earlier T1s. All other films keep half of
    their chord.
    """
    network = state.network
    scale = np.minimum(1.0, np.sqrt(np.minimum(shares[network.left], shares[network.right])))
    moved = moved_points(cell.surface, network, state.points, length * step.vertices)
    period = cell.surface.period
    old = nearest_image(state.points[network.heads] - state.points[network.tails], period)
    new = nearest_image(moved[network.heads] - moved[network.tails], period)
    was = np.linalg.norm(old, axis=1) / length
    now = np.linalg.norm(new, axis=1) / length
    reversed_ = np.einsum("fi,fi->f", old, new) < 0.0
    fails = ((now < SHORT * scale) & (now < was)) | reversed_
    shrink = np.where(reversed_, was + now, was - now)
    share = np.where(shrink > 0.5 * was, 0.5 * was / np.maximum(shrink, 1e-300), 1.0)
    failing = vanishing = np.flatnonzero(fails)
    empty = np.zeros((0, 3))
    sites = t1_sites(network, failing)
    fine = allowed(network, sites)
    threefold = (network.vertex_degrees[network.origin[np.stack([sites.a, sites.c])]] == 3).all(axis=0)
    failing, fine = failing[threefold], fine[threefold]
    turning, along, current = failing[:0], empty, empty
    if failing.size:
        sites = t1_sites(network, failing)
        tangents = outward_tangents(cell.surface, network, state.points, state.offsets, sites.outer)
        current, turned = pulls(tangents)
        gain = np.linalg.norm(turned, axis=1) - np.linalg.norm(current, axis=1)
        wins = t1 & fine & (gain > PREFERENCE[0] + PREFERENCE[1] * turns[failing])
        if wins.any():
            chosen = np.flatnonzero(wins)
            apart = independent(sites.bubbles[chosen], gain[chosen])
            turning, along = failing[chosen[apart]], turned[chosen[apart]]
    collapsing = share[failing] < 1.0
    share[turning] = 1.0
    busy = t1_sites(network, turning).bubbles
    walls = plan_walls(cell, state, moved, vanishing, length, turns, shares, busy, LIMITS, t1=t1)
    limit = np.ones(network.n_vertices)
    if walls is not None:
        share[walls.sites.film[walls.sites.film >= 0] >> 1] = 1.0
    np.minimum.at(limit, network.tails, share)
    np.minimum.at(limit, network.heads, share)
    if walls is not None:
        limit = walls.apart(limit)
    return Sweep(failing, collapsing, turning, along, current, limit, scale, walls)


def realigned(cell: HeleShawCell, state: State, sweep: Sweep, length: float) -> State:
    """Lay films that fail but do not turn along the pull on them, if they point against it or collapse."""
    staying = ~np.isin(sweep.failing, sweep.turning) & sweep.collapsing
    films, pull = sweep.failing[staying], sweep.current[staying]
    network = state.network
    chord = state.points[network.tails[films]] - state.points[network.heads[films]]
    chord = nearest_image(chord, cell.surface.period)
    span = np.linalg.norm(chord, axis=1)
    least = 0.5 * SHORT * length * sweep.scale[films]
    lost = (np.einsum("ki,ki->k", chord, pull) < 0.0) | (span < least)
    films, pull, span = films[lost], pull[lost], np.maximum(span, least)[lost]
    if not films.size:
        return state
    sites = t1_sites(network, films)
    points, _ = lay_films(cell.surface, network, state.points, state.offsets, sites, pull, span)
    offsets = state.offsets.copy()
    offsets[films] = 0.0
    return replace(state, points=points, offsets=offsets)


def turned(
    cell: HeleShawCell,
    state: State,
    sweep: Sweep,
    length: float,
    iteration: int,
    tension: float,
    bubble_ids: Ints,
) -> tuple[State, list[T1Event]]:
    """The state after the sweep's T1s, and their events."""
    network = state.network
    films = sweep.turning
    sites = t1_sites(network, films)
    five = np.concatenate([films[:, None], sites.outer >> 1], axis=1)
    before = _energies(cell, state, five)
    ends = state.points[network.tails[films]] - state.points[network.heads[films]]
    chord = np.linalg.norm(nearest_image(ends, cell.surface.period), axis=1)
    unit = length * sweep.scale[films]
    span = np.maximum(NEW_LENGTH[0] * unit, np.minimum(chord, NEW_LENGTH[1] * unit))
    points, offsets = lay_films(cell.surface, network, state.points, state.offsets, sites, sweep.along, span)
    after_state = State(rewire(network, films), points, offsets, state.pressures)
    after = _energies(cell, after_state, five)
    start, end = points[network.origin[sites.a]], points[network.origin[sites.c]]
    middle = cell.surface.project(start + 0.5 * nearest_image(end - start, cell.surface.period))
    ids = bubble_ids[sites.bubbles].tolist()
    columns = zip(
        films.tolist(),
        ids,
        middle.tolist(),
        (tension * before).tolist(),
        (tension * after).tolist(),
        strict=True,
    )
    events = [
        T1Event(iteration, film, (four[0], four[1]), (four[2], four[3]), (at[0], at[1], at[2]), e0, e1)
        for film, four, at, e0, e1 in columns
    ]
    return after_state, events


def _energies(cell: HeleShawCell, state: State, films: Ints) -> Floats:
    flat, network = films.ravel(), state.network
    tail, head = state.points[network.tails[flat]], state.points[network.heads[flat]]
    areas = cell.surface.arc_measure(tail, head, state.offsets[flat], cell.layer)
    out: Floats = areas.reshape(films.shape).sum(axis=1)
    return out
