"""The steps of `relax`: proximal far from equilibrium, exact near it; T1s and contacts after each."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from warpedfoam.errors import TopologyError
from warpedfoam.foam import Foam
from warpedfoam.kernels.condense import Condensed
from warpedfoam.moves.join import ContactEvent
from warpedfoam.moves.markers import Layout
from warpedfoam.moves.t1 import T1Event
from warpedfoam.relax.contacts import MOST, make_contacts, restrained, waiting
from warpedfoam.relax.held import moved_points
from warpedfoam.relax.kkt import KKT
from warpedfoam.relax.marking import with_markers
from warpedfoam.relax.mixing import Mixing
from warpedfoam.relax.reach import LOOKS, MUCH, UNDECIDED, next_reach, stiffer, turned_parts, which_way
from warpedfoam.relax.rims import short_of_rim
from warpedfoam.relax.sweep import LIMITS, plan_sweep, realigned, turned
from warpedfoam.relax.system import Linearised, State, Step, Stopwatch, System, one_ring, pinned_unknowns
from warpedfoam.relax.wall_sweep import stood_up, turned_walls

#: Compressibility of the proximal steps, in ℓ³ w² / γ, and the largest share of a volume they correct.
SOFTNESS, VOLUME_STEP = 0.02, 0.15
#: Largest changes in one proximal step: of a vertex (in ℓ), of an offset.
VERTEX_CAP, OFFSET_CAP = 0.3, 0.2
#: Exact Newton starts below the first residual, is left above the second, steps no farther than the third.
EXACT_BELOW, EXACT_ABOVE, EXACT_STEP = 0.02, 0.1, 0.2
#: Shifts of the exact steps, in γ d / ℓ.
LEAST_SHIFT, MOST_SHIFT = 1e-10, 0.03
#: Residual below which a wrong inertia means a saddle, and how far to step down from it, in ℓ.
SADDLE, KICK = 1e-6, 0.05
#: Least share of exact steps that go to and fro, and how often in a row before they are shortened.
LEAST_DAMPING, PATIENCE = 1.0 / 16.0, 2


@dataclass
class Run:
    """The moving parts of one relaxation."""

    system: System
    state: State
    foam: Foam
    t1: bool
    turns: np.ndarray
    pins: np.ndarray
    meet: bool
    iteration: int = 0
    events: list[T1Event] = field(default_factory=list)
    rows: list[tuple[int, float, float, float, int, bool]] = field(default_factory=list)
    contacts: list[ContactEvent] = field(default_factory=list)
    is_minimum: bool = False
    fault: str = ""
    refused: str = ""
    share: float = 1.0
    past: float = np.inf
    last: np.ndarray = field(default_factory=lambda: np.zeros(0))
    damping: float = 1.0
    backs: int = 0
    reach: float = EXACT_STEP
    hint: float = 0.0
    mixing: Mixing = field(default_factory=Mixing)

    def snapshot(self) -> tuple[object, ...]:
        """What `restore` brings back."""
        kept = self.system, self.state, self.foam, self.turns.copy(), self.pins
        return *kept, len(self.events), len(self.contacts)

    def restore(self, kept: tuple[Any, ...]) -> None:
        """Go back to a snapshot; the iterations stay counted."""
        self.system, self.state, self.foam, self.turns, self.pins, n_events, n_contacts = kept
        del self.events[n_events:]
        del self.contacts[n_contacts:]


def proximal_step(run: Run, lin: Linearised) -> None:
    """One proximal step with local shifts, and the T1s that it calls for."""
    network = run.state.network
    residual = one_ring(network, lin.residuals.vertex)
    shift = np.maximum(1e-5, residual / 0.15 * np.minimum(1.0, residual / 0.5))
    # a bubble's compressibility goes with its size cubed: small ones must be held as firmly
    shares = run.system.shares
    most = VOLUME_STEP * np.maximum(shares, lin.volumes)
    fault = np.clip(lin.residuals.volume, -most, most)
    softness = SOFTNESS * shares**1.5
    condensed = lin.condensed(positive=True)
    step = KKT(lin, condensed, np.repeat(shift, 2), softness).step(fault)
    size = np.linalg.norm(step.vertices, axis=1, keepdims=True)
    vertices = step.vertices * np.minimum(1.0, VERTEX_CAP / np.maximum(size, 1e-300))
    bend = np.abs(step.offsets).max(axis=1, initial=0.0, keepdims=True)
    offsets = step.offsets * np.minimum(1.0, OFFSET_CAP / np.maximum(bend, 1e-300))
    # now and then half a step: it lands in the middle of a two-cycle, and breaks it
    share = run.share * (0.5 if run.iteration % 7 == 6 else 1.0)
    _advance(run, Step(share * vertices, share * offsets, share * step.pressures))


def _advance(run: Run, step: Step) -> None:
    """Apply a step film by film limited, then turn and realign films."""
    clock = Stopwatch(run.system.timings)
    cell, length = run.system.cell, run.system.length
    exterior = run.system.exterior
    if exterior is not None:
        names, state = run.foam.bubble_ids, run.state
        step = short_of_rim(cell, state, step, lambda one: _moved(run, one), exterior, length, names)
    if run.meet:
        step = _restrained(run, step)
    sweep = plan_sweep(cell, run.state, step, length, run.turns, run.system.shares, t1=run.t1)
    limited = Step(step.vertices * sweep.limit[:, None], step.offsets, step.pressures)
    state = _moved(run, limited)
    if sweep.failing.size:
        state = realigned(cell, state, sweep, length)
    if sweep.turning.size:
        state, events = turned(
            cell, state, sweep, length, run.iteration, run.foam.tension, run.foam.bubble_ids
        )
        run.events.extend(events)
        run.turns[sweep.turning] += 1
    if sweep.walls is not None:
        state = stood_up(cell, state, sweep.walls, length)
    if sweep.walls is not None and len(sweep.walls.sites.film):
        state, run.turns, events = turned_walls(
            cell,
            state,
            sweep.walls,
            length,
            run.turns,
            run.iteration,
            run.foam.tension,
            run.foam.bubble_ids,
            LIMITS,
        )
        run.events.extend(events)
    run.state = state
    if run.meet:
        _mend(run)
    clock.lap("t1")


def _restrained(run: Run, step: Step) -> Step:
    """The step, shortened to where outlines meet."""
    state, system = run.state, run.system
    assert system.exterior is not None
    moved = _moved(run, step)
    layout = Layout(state.network, state.points, state.offsets, run.turns)
    after = moved.points, moved.offsets
    share = restrained(run.foam.cell, layout, after, system.exterior, system.length, system.shares)
    return Step(share * step.vertices, share * step.offsets, step.pressures)


def _mend(run: Run) -> None:
    """Contacts made and lost, and markers where outlines need them; the system anew where they were."""
    state, system, foam = run.state, run.system, run.foam
    cell, exterior, length = foam.cell, system.exterior, system.length
    assert exterior is not None
    network, points, offsets = state.network, state.points, state.offsets
    source, pressures, run.refused = np.arange(network.n_films), state.pressures, ""
    if waiting(cell, network, points, offsets, exterior, length, system.shares):
        if len(run.contacts) > MOST * foam.network.n_films:
            raise TopologyError("contacts are made and lost again without end")
        now = replace(foam, network=network, vertex_points=points, film_offsets=offsets, pressures=None)
        found = make_contacts(now, run.iteration)
        run.foam, source, run.refused = found.foam, found.source, found.refused
        run.contacts.extend(found.events)
        network, points, offsets = run.foam.network, run.foam.vertex_points, run.foam.film_offsets
        if run.foam.n_bubbles > foam.n_bubbles:
            run.system = System(
                cell, run.foam.target_volumes, foam.order, system.factoriser, run.foam.n_bubbles, exterior
            )
            run.system.timings, run.system.follows = system.timings, system.follows
            units = run.system.mean_volume / system.mean_volume * system.film_unit / run.system.film_unit
            pressures = units * np.append(pressures, np.zeros(run.foam.n_bubbles - foam.n_bubbles))
    layout = Layout(network, points, offsets, source)
    layout = with_markers(cell, layout, exterior, run.system.length, run.system.shares)
    if layout.network is state.network:
        return
    run.state = State(layout.network, layout.points, layout.offsets, pressures)
    run.turns = np.where(layout.source >= 0, run.turns[np.maximum(layout.source, 0)], 0)
    run.pins = pinned_unknowns(cell, run.state)


def exact_step(run: Run, lin: Linearised) -> None:
    """One step on the KKT system, shifted until its inertia is right and scaled to a safe length."""
    now = lin.residuals
    if run.system.exterior is not None:
        # how a lone bubble may move depends on its shape: a disk cannot turn
        run.pins = pinned_unknowns(run.system.cell, run.state)
    shift = max(float(np.clip(0.05 * now.force, LEAST_SHIFT, MOST_SHIFT)), run.hint)
    condensed = lin.condensed(positive=False)
    kkt = newton_matrix(run, lin, condensed, shift)
    first = kkt
    while not (right := is_minimum(lin, kkt, condensed)) and shift < 1.0:
        shift = max(10.0 * shift, 1e-6)
        kkt = newton_matrix(run, lin, condensed, shift)
    step = kkt.step(now.volume) if right else None
    size = _size(step)
    if step is None or not np.isfinite(size):
        proximal_step(run, lin)
        return
    most = EXACT_STEP
    if run.system.exterior is not None:
        most = run.reach = next_reach(run.reach, now.force)
        seen = [(shift, 1.0 / max(size, 1e-300))]
        while size > MUCH * most and len(seen) <= LOOKS:
            shift = stiffer(seen, most)
            kkt = newton_matrix(run, lin, condensed, shift)
            step = kkt.step(now.volume)
            size = _size(step)
            seen.append((shift, 1.0 / max(size, 1e-300)))
        run.hint = shift * min(size / most, 1.0) if size > 0.5 * most else 0.0
        if size <= most and kkt is first:
            step = run.mixing.mixed(run.system.cell, run.system.length, run.state, step, now.force)
            size = _size(step)
        else:
            run.mixing.forget()
    if kkt is not first and now.force < SADDLE:
        # next to a saddle the force gives no way out: take the mode that goes down
        mode = kkt.softest_mode(step.vertices)
        side = np.sign(_cosine(mode, step.vertices))
        if run.system.exterior is not None and abs(_cosine(mode, step.vertices)) < UNDECIDED:
            side = which_way(run.system.cell, run.state, mode)
        step = Step(step.vertices + side * KICK * mode, step.offsets, step.pressures)
        size = max(size, KICK)
    share = run.share * min(1.0, most / max(size, 1e-300))
    # on level sets the matrix is not quite exact: where that throws soft modes to and fro, shorter steps
    # land between
    back = run.last.shape == step.vertices.shape and now.force > 0.3 * run.past
    back = back and _cosine(step.vertices, run.last) < -0.5
    run.backs = run.backs + 1 if back else 0
    halve = run.backs >= PATIENCE
    run.damping = max(0.5 * run.damping, LEAST_DAMPING) if halve else min(2.0 * run.damping, 1.0)
    share *= run.damping
    run.past, run.last = now.force, step.vertices
    step = Step(share * step.vertices, share * step.offsets, share * step.pressures)
    if run.system.exterior is not None:
        step = turned_parts(run.system.cell, run.state, step, run.system.length)
    _advance(run, step)


def _size(step: Step | None) -> float:
    """Largest step of a vertex, in ℓ, or change of an offset."""
    if step is None:
        return 0.0
    return max(float(np.abs(step.vertices).max()), float(np.abs(step.offsets).max(initial=0.0)))


def _cosine(one: np.ndarray, other: np.ndarray) -> float:
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float((one * other).sum()) / max(size, 1e-300)


def newton_matrix(run: Run, lin: Linearised, condensed: Condensed, shift: float) -> KKT:
    """Newton matrix with shift σ on the vertices, rigid motions and the redundant constraint pinned."""
    network = run.state.network
    vertex = np.full(2 * network.n_vertices, shift)
    vertex[run.pins] += 1.0
    pressure = np.zeros(network.n_bubbles)
    # the volumes add up to the cell's: one constraint is redundant, the exterior's if there is one
    pressure[run.system.exterior or 0] = 1.0
    return KKT(lin, condensed, vertex, pressure)


def is_minimum(lin: Linearised, kkt: KKT, condensed: Condensed) -> bool:
    """Whether the whole matrix has the inertia of a minimum: one negative eigenvalue for each volume.

    By Haynsworth's formula the eliminated offsets' pivots count too.
    """
    if kkt.n_negative < 0:
        return False
    return kkt.n_negative + int(condensed.negative.sum()) == lin.state.network.n_bubbles


def _moved(run: Run, step: Step) -> State:
    state = run.state
    surface, length = run.system.cell.surface, run.system.length
    return State(
        state.network,
        moved_points(surface, state.network, state.points, length * step.vertices),
        state.offsets + step.offsets,
        state.pressures + step.pressures,
    )
