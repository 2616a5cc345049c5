"""T1s at walls between Newton steps: which films are lost to a wall, which walls are given up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.cell import HeleShawCell
from warpedfoam.moves.t1 import T1Event, independent
from warpedfoam.moves.wall_t1 import (
    WallSites,
    carried,
    film_sites,
    inward_pull,
    lay_walls,
    rewire_walls,
    wall_allowed,
    wall_sites,
)
from warpedfoam.relax.system import State

#: Rounds in which steps are lessened where walls shrink too fast.
ROUNDS = 8


@dataclass(frozen=True, eq=False)
class WallLimits:
    """When things at walls turn.

    Shorter than ``short`` bubble sizes, preferred by ``preference`` and by its second entry per earlier
    T1, new ones ``fresh`` bubble sizes long.
    """

    short: float
    preference: tuple[float, float]
    fresh: float


@dataclass(frozen=True, eq=False)
class WallSweep:
    """T1s at walls that are to be made.

    ``kept`` are half-films to the rim that fail but are pulled away from it, and ``least`` (k,) how short
    they may be, in bubble sizes. ``ends`` (n_walls, 2) are the rim vertices of all walls, ``was`` (n_walls,)
    their lengths and ``onward`` (n_vertices,) how far the step moves each vertex along the rim.
    """

    sites: WallSites
    scale: Floats
    kept: Ints
    least: Floats
    ends: Ints
    was: Floats
    onward: Floats

    def apart(self, limit: Floats) -> Floats:
        """Shares (n_vertices,) of the step, lessened so that every wall keeps half of its length.

        Ends that passed each other would have the rest of the rim between them.
        """
        out = limit.copy()
        tails, heads = self.ends.T
        for rest in (*([0.5] * ROUNDS), 0.0):
            shrink = self.onward[tails] * out[tails] - self.onward[heads] * out[heads]
            close = shrink > 0.51 * self.was
            if not close.any():
                break
            share = np.where(close, rest * self.was / np.maximum(shrink, 1e-300), 1.0)
            np.minimum.at(out, tails, share * out[tails])
            np.minimum.at(out, heads, share * out[heads])
        return out


def plan_walls(
    cell: HeleShawCell,
    state: State,
    moved: Floats,
    failing: Ints,
    length: float,
    turns: Ints,
    shares: Floats,
    busy: Ints,
    limits: WallLimits,
    *,
    t1: bool,
) -> WallSweep | None:
    """What a step to ``moved`` would make vanish at the rim, and which of it turns.

    A ``failing`` film that ends on the rim is lost if its neighbours pull it there, Σ pulls · ν < 1; a
    wall about to vanish is given up if the films beside it pull away from it. Bubbles in ``busy`` have
    other things to do.
    """
    surface, network = cell.surface, state.network
    rim = surface.rim
    if rim is None or not len(network.walls):
        return None
    walls = network.walls
    tails, heads = network.origin[walls ^ 1], network.origin[network.next[walls]]
    _, first, last = rim.spans(state.points[tails], state.points[heads])
    on = network.rim_vertices
    place = np.zeros(network.n_vertices)
    (where, before), after = rim.locate(state.points[on]), rim.locate(moved[on])[1]
    turn = rim.lengths[where]
    place[on] = np.mod(after - before + 0.5 * turn, turn) - 0.5 * turn
    was = (last - first) / length
    now = was + (place[heads] - place[tails]) / length
    small = shares[network.bubble[walls]]
    scale = np.minimum(1.0, np.sqrt(small))
    fails = (now < limits.short * scale) & (now < was)
    degrees = network.vertex_degrees
    ends = np.stack([degrees[network.tails[failing]], degrees[network.heads[failing]]])
    to_rim = np.sort(ends, axis=0).T.tolist()
    chosen = failing[[pair == [1, 3] for pair in to_rim]] if failing.size else failing
    halves = 2 * chosen + (degrees[network.tails[chosen]] == 1)
    sites = _joined(film_sites(network, halves), wall_sites(network, walls[fails]))
    fine = wall_allowed(network, sites) & ~np.isin(sites.bubbles, busy).any(axis=1)
    sites = _only(sites, fine)
    kept = halves[:0]
    if len(sites.film):
        pull, _ = inward_pull(surface, network, state.points, state.offsets, sites)
        gain = np.where(sites.film >= 0, 1.0 - pull, pull - 1.0)
        earlier = np.maximum(turns[sites.before >> 1], turns[sites.after >> 1])
        wins = gain > limits.preference[0] + limits.preference[1] * earlier
        wins &= t1
        kept = sites.film[~wins & (sites.film >= 0)]
        sites, gain = _only(sites, wins), gain[wins]
        if len(gain):
            sites = _only(sites, independent(sites.bubbles, gain))
    sizes = np.minimum(1.0, np.sqrt(shares[sites.bubbles].min(axis=1, initial=1.0)))
    beside = np.minimum(shares[network.bubble[kept]], shares[network.bubble[kept ^ 1]])
    least = 0.5 * limits.short * np.minimum(1.0, np.sqrt(beside))
    ends = np.stack([tails, heads], axis=1)
    return WallSweep(sites, sizes, kept, least, ends, was, place / length)


def stood_up(cell: HeleShawCell, state: State, sweep: WallSweep, length: float) -> State:
    """Films that are pulled away from the rim but have collapsed or crossed it stand up on it again."""
    surface, network, halves = cell.surface, state.network, sweep.kept
    rim = surface.rim
    if rim is None or not len(halves):
        return state
    foot, inner = network.origin[halves ^ 1], network.origin[halves]
    base = state.points[foot]
    inward = rim.frame(*rim.locate(base))[1]
    chord = state.points[inner] - base
    span, least = np.linalg.norm(chord, axis=1), length * sweep.least
    lost = (np.einsum("kx,kx->k", chord, inward) < 0.0) | (span < least)
    points, offsets = state.points.copy(), state.offsets.copy()
    points[inner[lost]] = surface.project(base + np.maximum(span, least)[:, None] * inward)[lost]
    offsets[halves[lost] >> 1] = 0.0
    return State(network, points, offsets, state.pressures)


def turned_walls(
    cell: HeleShawCell,
    state: State,
    sweep: WallSweep,
    length: float,
    turns: Ints,
    iteration: int,
    tension: float,
    bubble_ids: Ints,
    limits: WallLimits,
) -> tuple[State, Ints, list[T1Event]]:
    """The state after the T1s at walls, how often each film has turned, and the events."""
    network, sites = state.network, sweep.sites
    span = limits.fresh * length * sweep.scale
    lost = sites.film >= 0
    before = _energies(cell, state, sites, sites.film >> 1)
    after, source = rewire_walls(network, sites)
    points, offsets = lay_walls(cell.surface, network, state.points, state.offsets, sites, span)
    out = State(after, points, carried(offsets, source), state.pressures)
    counts = turns.copy()
    counts[sites.before >> 1] += 1
    counts[sites.after >> 1] += 1
    place = np.full(network.n_films, -1)
    place[source[source >= 0]] = np.flatnonzero(source >= 0)
    film = np.full(len(lost), -1)
    film[~lost] = np.flatnonzero(source < 0)
    settled = WallSites(film, 2 * place[sites.before >> 1], 2 * place[sites.after >> 1], sites.bubbles)
    later = _energies(cell, out, settled, film)
    where = points[network.origin[sites.before]]
    events = []
    ids = bubble_ids[sites.bubbles].tolist()
    columns = zip(lost.tolist(), (sites.film >> 1).tolist(), film.tolist(), ids, where.tolist(), strict=True)
    for (gone, old, new, (one, other, third), at), e0, e1 in zip(
        columns, (tension * before).tolist(), (tension * later).tolist(), strict=True
    ):
        beside, opposite = (one, other), (third,)
        losers, gainers = (beside, opposite) if gone else (opposite, beside)
        position = (at[0], at[1], at[2])
        events.append(T1Event(iteration, old if gone else new, losers, gainers, position, e0, e1))
    return out, np.where(source >= 0, counts[np.maximum(source, 0)], 1), events


def _energies(cell: HeleShawCell, state: State, sites: WallSites, film: Ints) -> Floats:
    """Areas of both neighbours, and of the film where there is one."""
    network = state.network
    films = np.stack([sites.before >> 1, sites.after >> 1, np.maximum(film, 0)])
    tail, head = state.points[network.tails[films.ravel()]], state.points[network.heads[films.ravel()]]
    areas = cell.surface.arc_measure(tail, head, state.offsets[films.ravel()], cell.layer)
    one, other, third = areas.reshape(films.shape)
    out: Floats = one + other + np.where(film >= 0, third, 0.0)
    return out


def _joined(one: WallSites, other: WallSites) -> WallSites:
    pairs = zip(
        (one.film, one.before, one.after, one.bubbles),
        (other.film, other.before, other.after, other.bubbles),
        strict=True,
    )
    return WallSites(*(np.concatenate(pair) for pair in pairs))


def _only(sites: WallSites, keep: np.ndarray) -> WallSites:
    return WallSites(sites.film[keep], sites.before[keep], sites.after[keep], sites.bubbles[keep])
