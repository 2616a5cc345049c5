"""Clusters that meet or part on the way: `relax`'s contacts between steps in time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.errors import TopologyError
from warpedfoam.motion.scene import Candidate, Scene
from warpedfoam.moves.markers import Layout
from warpedfoam.relax.contacts import make_contacts, restrained, shares_of, waiting
from warpedfoam.relax.marking import with_markers
from warpedfoam.relax.rims import CLOSE, TOUCH, met_rim, rim_gap
from warpedfoam.relax.system import State


def layout_of(state: State) -> Layout:
    """The state's network and geometry, each film its own source."""
    return Layout(state.network, state.points, state.offsets, np.arange(state.network.n_films))


def crosses(scene: Scene, before: State, after: State) -> bool:
    """Whether outlines meet before the end of a step."""
    exterior = scene.foam.exterior
    if exterior is None:
        return False
    end = after.points, after.offsets
    share = restrained(scene.cell, layout_of(before), end, exterior, scene.length, scene.shares)
    return share < 1.0


def at_rim(scene: Scene, before: State, after: State) -> bool:
    """Whether a step leads outlines to the rim, and has to be shorter.

    Raises
    ------
    RimMet
        If they are there.
    """
    exterior, surface = scene.foam.exterior, scene.cell.surface
    if exterior is None or surface.rim is None:
        return False

    def look(state: State) -> tuple[float, int, Floats]:
        return rim_gap(scene.cell, state.network, state.points, state.offsets, exterior, scene.length)

    ahead = look(after)[0]
    if ahead >= TOUCH:
        return False
    now, bubble, at = look(before)
    if now < CLOSE and not ahead > now:
        raise met_rim(scene.bubble_ids, bubble, at)
    return not ahead > now


def marked(scene: Scene, state: State) -> State:
    """The state with markers taken off films that want to vanish and put on films that bend far."""
    exterior = scene.foam.exterior
    if exterior is None:
        return state
    here = layout_of(state)
    fresh = with_markers(scene.cell, here, exterior, scene.length, scene.shares)
    if fresh is here:
        return state
    return State(fresh.network, fresh.points, fresh.offsets, state.pressures)


def meet_outlines(scene: Scene, _before: State, state: State) -> Iterator[Candidate]:
    """Outlines that have met are joined, films that have let go are parted; all of them in one candidate.

    Raises
    ------
    TopologyError
        If they cannot be joined.
    """
    foam, exterior = scene.foam, scene.foam.exterior
    if exterior is None:
        return
    arrays = state.network, state.points, state.offsets
    if not waiting(scene.cell, *arrays, exterior, scene.length, scene.shares):
        return
    now = replace(
        foam,
        network=state.network,
        vertex_points=state.points,
        film_offsets=state.offsets,
        pressures=None,
    )
    found = make_contacts(now)
    if found.refused:
        raise TopologyError(found.refused)
    if not found.events:
        return
    after = found.foam
    # a region that is enclosed is a bubble of its own, the last
    grown = after.n_bubbles - foam.n_bubbles
    pressures = np.append(state.pressures, np.zeros(grown))
    fresh = State(after.network, after.vertex_points, after.film_offsets, pressures)
    if grown:
        scene = replace(scene, foam=after, shares=shares_of(after))
    joins = [event for event in found.events if event.kind == "join"]
    parts = [event for event in found.events if event.kind == "part"]
    yield Candidate(
        "join" if joins else "part",
        marked(scene, fresh),
        tuple(i for event in parts for i in event.bubbles),
        tuple(i for event in joins for i in event.bubbles),
        found.events[0].position,
        after if grown else None,
    )
