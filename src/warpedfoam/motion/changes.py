"""Changes of topology on the way: what may turn after a step, tried one by one.

`CHANGES` lists all kinds. Each looks at the states before and after a step and offers candidates, best first;
the driver brings one to its volumes and keeps it if the energy falls.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.cell import HeleShawCell
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.motion.meeting import meet_outlines
from warpedfoam.motion.scene import Candidate, Scene, TopologyChange
from warpedfoam.moves.t1 import allowed, lay_films, outward_tangents, pulls, rewire, t1_sites
from warpedfoam.relax.sweep import NEW_LENGTH, PREFERENCE
from warpedfoam.relax.system import State
from warpedfoam.relax.wall_sweep import WallLimits, plan_walls, turned_walls

#: Shares of the old film's length tried for the new one.
SHARES = (1.0, 0.5)


def chords(cell: HeleShawCell, state: State) -> Floats:
    """Distance between the ends of each film, (F,)."""
    network = state.network
    away = state.points[network.heads] - state.points[network.tails]
    out: Floats = np.linalg.norm(nearest_image(away, cell.surface.period), axis=1)
    return out


def cutoffs(scene: Scene, state: State) -> Floats:
    """Length below which each film may turn, (F,): less beside small bubbles."""
    network, shares = state.network, scene.shares
    beside = np.minimum(shares[network.left], shares[network.right])
    out: Floats = scene.cutoff * scene.length * np.minimum(1.0, np.sqrt(beside))
    return out


def failing_films(scene: Scene, before: State, state: State) -> Ints:
    """Films that are short and have become shorter."""
    now = chords(scene.cell, state)
    return np.flatnonzero((now < cutoffs(scene, state)) & (now < chords(scene.cell, before)))


def turn_films(scene: Scene, before: State, state: State) -> Iterator[Candidate]:
    """T1s on films that are about to vanish, where the neighbours pull harder on the turned film."""
    films, network, surface = failing_films(scene, before, state), state.network, scene.cell.surface
    if not films.size:
        return
    films = films[allowed(network, t1_sites(network, films))]
    if not films.size:
        return
    sites = t1_sites(network, films)
    tangents = outward_tangents(surface, network, state.points, state.offsets, sites.outer)
    current, turned = pulls(tangents)
    gain = np.linalg.norm(turned, axis=1) - np.linalg.norm(current, axis=1)
    lengths = chords(scene.cell, state)
    for k in np.argsort(-gain, kind="stable").tolist():
        if gain[k] <= PREFERENCE[0]:
            return
        film = films[[k]]
        site = t1_sites(network, film)
        ends = state.points[network.tails[film]] - state.points[network.heads[film]]
        middle = state.points[network.heads[film]] + 0.5 * nearest_image(ends, surface.period)
        at = surface.project(middle)[0].tolist()
        ids = scene.bubble_ids[site.bubbles[0]].tolist()
        for share in SHARES:
            span = share * lengths[film]
            points, _ = lay_films(surface, network, state.points, state.offsets, site, turned[[k]], span)
            # the neighbours keep their shape: their ends have hardly moved
            offsets = state.offsets.copy()
            offsets[film] = 0.0
            yield Candidate(
                "t1",
                State(rewire(network, film), points, offsets, state.pressures),
                (ids[0], ids[1]),
                (ids[2], ids[3]),
                (at[0], at[1], at[2]),
            )


def turn_at_walls(scene: Scene, before: State, state: State) -> Iterator[Candidate]:
    """Films lost to a wall that they have come to, and walls about to vanish given up."""
    surface, network = scene.cell.surface, state.network
    if surface.rim is None or not len(network.walls):
        return
    limits = WallLimits(scene.cutoff, PREFERENCE, NEW_LENGTH[0])
    turns = np.zeros(network.n_films, dtype=np.int64)
    sweep = plan_walls(
        scene.cell,
        before,
        state.points,
        failing_films(scene, before, state),
        scene.length,
        turns,
        scene.shares,
        np.zeros(0, dtype=np.int64),
        limits,
        t1=True,
    )
    if sweep is None or not len(sweep.sites.film):
        return
    after, _, events = turned_walls(
        scene.cell, state, sweep, scene.length, turns, 0, scene.tension, scene.bubble_ids, limits
    )
    first = events[0]
    losers = tuple(i for event in events for i in event.losers)
    gainers = tuple(i for event in events for i in event.gainers)
    yield Candidate("wall t1", replace(after), losers, gainers, first.position)


#: Every kind of change that is tried between steps, in this order; others can be added here.
CHANGES: tuple[TopologyChange, ...] = (meet_outlines, turn_films, turn_at_walls)
