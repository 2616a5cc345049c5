"""Steps in time: implicit Euler as a minimisation, and its extrapolation to second order.

An Euler step of length h minimises E(x) + D(x), D the friction potential of the way from the start (see
`warpedfoam.motion.drag`), under the volume constraints: a *minimising movement*. Since D ≥ 0 and D = 0 at the
start, E cannot rise. Two steps of h/2 and one of h, extrapolated, are of second order and damp stiff
modes; their difference is an estimate of the error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.foam import Foam, bubble_integrals
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.motion.drag import Across, Drag, FrictionLaw, motion_of
from warpedfoam.relax.held import moved_points
from warpedfoam.relax.kkt import KKT
from warpedfoam.relax.linear import SingularMatrixError, SuperLU
from warpedfoam.relax.system import Linearised, State, Step, System

#: Largest force left on a vertex or node after a step, in γ d, and largest relative error of a volume.
FORCE, VOLUME = 1e-10, 3e-12
#: Round-off of positions, relative to the surface's size: in very short steps friction makes it a force.
ROUND_OFF = 1e-14
#: Newton steps of an Euler step, and with yield friction; the largest in bubble sizes, and the largest
#: change of a chord in chords.
NEWTON, STICKING, REACH, TURN = 14, 60, 0.3, 0.5
#: Kinks at markers, after clusters have met, make Newton's method linear: more steps as long as a share of
#: the force goes in each.
PATIENT, FALLING = 45, 0.7
#: With yield friction a step goes to where this share of the force along it is left, found in so many looks.
SLACK, SEARCHES = 0.3, 12
#: Steps that bring a foam to its volumes.
CORRECTIONS = 30
#: Rounding of kinks in turn, when there is yield friction.
BLUNT = (1e3, 1e2, 1e1, 1.0)
#: Rises of the energy below this share are round-off; on surfaces without exact volumes, quadrature.
ROUND, ROUGH = 1e-13, 1e-9


class StepFailed(ArithmeticError):
    """A step in time found no minimum that it may use; a shorter one will."""


@dataclass(frozen=True, eq=False)
class Advance:
    """A step that was made: the new state, the change per half step and the estimated error, in ℓ.

    ``extrapolated`` tells whether the state is of second order; ``speed`` is the root mean square over
    the films, in length per time.
    """

    state: State
    error: float
    extrapolated: bool
    dissipation: float


class Stepper:
    """Moves the states of one foam in time.

    Parameters
    ----------
    foam : Foam
        Its cell, targets, order, tension and exterior.
    law : FrictionLaw
    hold_volumes : bool
        Otherwise all pressures are 0.
    method : {"extrapolated", "euler"}
    """

    def __init__(self, foam: Foam, law: FrictionLaw, *, hold_volumes: bool, method: str) -> None:
        self.foam, self.law = foam, law
        self.hold_volumes, self.method = hold_volumes, method
        # the same bits on every machine, whatever is installed
        self.system = System(
            foam.cell, foam.target_volumes, foam.order, SuperLU(), foam.n_bubbles, foam.exterior
        )
        self.unit = foam.tension * self.system.film_unit
        self.scale = self.unit / self.system.mean_volume
        self.rounding = ROUND if self.system.invariant else ROUGH

    def of(self, foam: Foam) -> Stepper:
        """A stepper by the same law for a foam of other bubbles."""
        return Stepper(foam, self.law, hold_volumes=self.hold_volumes, method=self.method)

    @property
    def length(self) -> float:
        """ℓ, the bubble size."""
        return self.system.length

    @property
    def time_scale(self) -> float:
        """λ ℓ²/γ."""
        return self.law.friction * self.length**2 / self.foam.tension

    def state_of(self, foam: Foam) -> State:
        """The state of a foam in this cell; pressures in the system's unit."""
        pressures = np.zeros(foam.n_bubbles)
        if foam.pressures is not None and self.hold_volumes:
            pressures = foam.pressures / self.scale
        return State(foam.network, foam.vertex_points, foam.film_offsets, pressures)

    def foam_of(self, state: State) -> Foam:
        """The foam of a state, its pressures with mean zero, or against the exterior."""
        zero = 0.0
        if self.hold_volumes:
            exterior = self.foam.exterior
            zero = float(state.pressures.mean() if exterior is None else state.pressures[exterior])
        return replace(
            self.foam,
            network=state.network,
            vertex_points=state.points,
            film_offsets=state.offsets,
            pressures=(state.pressures - zero) * self.scale,
        )

    def energy(self, state: State) -> float:
        """γ Σ film areas."""
        network = state.network
        tail, head = state.points[network.tails], state.points[network.heads]
        areas = self.foam.cell.surface.arc_measure(tail, head, state.offsets, self.foam.cell.layer)
        return self.foam.tension * float(areas.sum())

    def _across(self, state: State) -> Across:
        return Across(self.foam.cell, state, self.length)

    def _drag(self, start: Across, base: Across, time: float) -> Drag:
        return Drag(start, base, self.law, time, self.unit)

    # --- one step ---------------------------------------------------------------------------------

    def advance(self, start: State, time: float) -> Advance:
        """The state a ``time`` later, the energy not above that of ``start``.

        Raises
        ------
        StepFailed
            If the time is too long for Newton's method.
        """
        energy = self.energy_at_volumes(start)
        here = self._across(start)
        guess = self._euler(self._drag(here, here, time), start)
        there = self._across(guess)
        drag = self._drag(here, there, time)
        whole = self._euler(drag, guess)
        if self.method == "euler":
            self._require_lower(whole, energy)
            return Advance(whole, 0.0, False, self._dissipation(drag, whole))
        half = self._across(self._between(start, whole, 0.5))
        drag = self._drag(here, half, 0.5 * time)
        middle = self._euler(drag, half.state)
        spent = 0.5 * self._dissipation(drag, middle)
        drag = self._drag(self._across(middle), there, 0.5 * time)
        halves = self._euler(drag, whole)
        surface, network = self.foam.cell.surface, start.network
        error = float(motion_of(surface, network, halves, whole).max()) / self.length
        spent += 0.5 * self._dissipation(drag, halves)
        beyond = self._between(halves, whole, -1.0)
        try:
            beyond = self._on_volumes(beyond, drag)
            self._require_lower(beyond, energy)
        except StepFailed:
            self._require_lower(halves, energy)
            return Advance(halves, error, False, spent)
        return Advance(beyond, error, True, spent)

    def _dissipation(self, drag: Drag, state: State) -> float:
        return self.law.friction * drag.squared_speed(state)

    def on_volumes(self, start: State) -> State:
        """The state brought to its volumes the shortest way.

        Raises
        ------
        StepFailed
            If Newton's method does not get there.
        """
        here = self._across(start)
        return self._on_volumes(start, self._drag(here, here, 1e-2 * self.time_scale))

    def volumes(self, state: State) -> Floats:
        """Volumes of all bubbles, the exterior's what is left, (n_bubbles,)."""
        system = self.system
        out = bubble_integrals(system.cell, state.network, state.points, state.offsets, system.cell.layer)
        if system.exterior is not None:
            out[system.exterior] = 0.0
            out[system.exterior] = system.targets.sum() - out.sum()
        return out

    def volume_error(self, state: State) -> float:
        """Largest relative error of a volume; without exact ones their common part is left out."""
        volumes, system = self.volumes(state), self.system
        if system.exterior is None:
            volumes *= system.targets.sum() / volumes.sum()
        else:
            volumes[system.exterior] = system.targets[system.exterior]
        return float(np.abs(volumes / system.targets - 1.0).max())

    def energy_at_volumes(self, state: State) -> float:
        """The energy less Σ p (V − V*): that of exact volumes, which at rest is all that changes."""
        energy = self.energy(state)
        if not self.hold_volumes:
            return energy
        exterior, volumes, targets = self.foam.exterior, self.volumes(state), self.system.targets
        if exterior is None:
            volumes *= targets.sum() / volumes.sum()
        zero = state.pressures.mean() if exterior is None else state.pressures[exterior]
        return energy - self.scale * float((state.pressures - zero) @ (volumes - targets))

    def _require_lower(self, state: State, energy: float) -> None:
        if not self.energy_at_volumes(state) <= energy * (1.0 + self.rounding):
            raise StepFailed("the energy would rise")

    def _euler(self, drag: Drag, guess: State) -> State:
        """Minimise E + D, beginning at ``guess``."""
        state = guess
        if not self.hold_volumes:
            state = replace(guess, pressures=np.zeros(guess.network.n_bubbles))
        for drag.blunt in BLUNT if self.law.yielding else (1.0,):
            state = self._newton(state, drag)
        return state

    def _newton(self, state: State, drag: Drag) -> State:
        convex, last = True, np.inf
        stiff = self.time_scale / drag.time * self.foam.cell.surface.size / self.system.length
        enough = max(FORCE, ROUND_OFF * stiff)
        for k in range(STICKING if self.law.yielding else PATIENT):
            lin = self._linearised(state, drag)
            now = lin.residuals
            if k >= NEWTON and not self.law.yielding and now.force > FALLING * last:
                break
            last = now.force
            if not np.isfinite(now.force):
                raise StepFailed("a film has degenerated")
            if lin.slip > self.foam.cell.surface.precision:
                raise StepFailed("the volumes do not add up")
            if now.force <= enough and now.volume_error <= VOLUME:
                # on the way there the matrix may be anything
                if not convex:
                    raise StepFailed("the step's problem is not convex")
                return state
            step, convex = self._step(lin, now.volume)
            state = self._searched(lin, step, drag) if self.law.yielding else self._moved(state, step)
        raise StepFailed("Newton's method did not converge")

    def _searched(self, lin: Linearised, step: Step, drag: Drag) -> State:
        """The state where the force along a step has nearly gone: past a kink whole steps go too far."""
        state, network = lin.state, lin.state.network
        unknowns = np.concatenate(
            [step.vertices[network.tails].T, step.vertices[network.heads].T, step.offsets.T]
        )

        def slope(share: float) -> tuple[State, float]:
            at = self._moved(state, Step(share * step.vertices, share * step.offsets, share * step.pressures))
            return at, float((self._linearised(at, drag).force * unknowns).sum())

        first = float((lin.force * unknowns).sum())
        moved, last = slope(1.0)
        if not first < 0.0 or last <= -SLACK * first:
            return moved
        low, high, below, above = 0.0, 1.0, first, last
        for _ in range(SEARCHES):
            # regula falsi by the Illinois rule
            share = (low * above - high * below) / (above - below)
            moved, last = slope(share)
            if abs(last) <= -SLACK * first:
                break
            if last < 0.0:
                low, below, above = share, last, 0.5 * above
            else:
                high, above, below = share, last, 0.5 * below
        return moved

    def _on_volumes(self, state: State, drag: Drag) -> State:
        if not self.hold_volumes:
            return state
        drag.blunt = 1.0
        kept = state.pressures
        for _ in range(CORRECTIONS):
            if self.volume_error(state) <= VOLUME:
                return replace(state, pressures=kept)
            lin = self._linearised(state, drag)
            if not np.isfinite(lin.residuals.force) or lin.slip > self.foam.cell.surface.precision:
                raise StepFailed("a film has degenerated")
            # whatever the energy's curvature, the matrix measures a distance here
            still = lin.loaded(np.zeros_like(lin.force))
            step, _ = self._step(still, lin.residuals.volume, positive=True)
            state = replace(self._moved(state, step), pressures=kept)
        raise StepFailed("the volumes could not be reached")

    def _linearised(self, state: State, drag: Drag) -> Linearised:
        self.system.loads = drag
        lin = self.system.linearise(state)
        if not self.hold_volumes:
            # no pressure, no constraint
            lin.volume = np.zeros_like(lin.volume)
            lin.volume_fault = np.zeros_like(lin.volume_fault)
            lin.residuals = replace(lin.residuals, volume=lin.volume_fault, volume_error=0.0)
        return lin

    def _step(self, lin: Linearised, fault: Floats, *, positive: bool = False) -> tuple[Step, bool]:
        """A Newton step, scaled so that nothing turns over, and whether the matrix is that of a minimum."""
        network = lin.state.network
        pressure = np.zeros(network.n_bubbles)
        if self.hold_volumes:
            # the volumes add up to the cell's: one constraint is redundant, the exterior's if there is one
            pressure[self.system.exterior or 0] = 1.0
        else:
            pressure[:] = 1.0
        condensed = lin.condensed(positive=positive)
        try:
            kkt = KKT(lin, condensed, np.zeros(2 * network.n_vertices), pressure)
        except SingularMatrixError:
            raise StepFailed("the matrix is singular") from None
        negative = kkt.n_negative
        convex = negative >= 0 and negative + int(condensed.negative.sum()) == network.n_bubbles
        step = kkt.step(fault)
        size = max(float(np.abs(step.vertices).max()), float(np.abs(step.offsets).max(initial=0.0)))
        if not np.isfinite(size):
            raise StepFailed("a step is not finite")
        share = min(1.0, REACH / max(size, 1e-300), self._reach(lin.state, step))
        return Step(share * step.vertices, share * step.offsets, share * step.pressures), convex

    def _reach(self, state: State, step: Step) -> float:
        """Share of a step at which a chord changes by half of itself."""
        network = state.network
        chord = nearest_image(
            state.points[network.heads] - state.points[network.tails], self.foam.cell.surface.period
        )
        frames = self.foam.cell.surface.vertex_frames(state.points)
        moves = self.length * np.einsum("vi,vix->vx", step.vertices, frames)
        change = np.linalg.norm(moves[network.heads] - moves[network.tails], axis=1)
        ratio = float((change / np.linalg.norm(chord, axis=1)).max())
        return TURN / max(ratio, 1e-300)

    def _moved(self, state: State, step: Step) -> State:
        return State(
            state.network,
            moved_points(self.foam.cell.surface, state.network, state.points, self.length * step.vertices),
            state.offsets + step.offsets,
            state.pressures + step.pressures,
        )

    def _between(self, one: State, other: State, share: float) -> State:
        """one + share (other − one); beyond either for shares outside [0, 1]."""
        surface, network = self.foam.cell.surface, one.network
        away = nearest_image(other.points - one.points, surface.period)
        steps = np.einsum("vix,vx->vi", surface.vertex_frames(one.points), away)
        return State(
            network,
            moved_points(surface, network, one.points, share * steps),
            one.offsets + share * (other.offsets - one.offsets),
            one.pressures + share * (other.pressures - one.pressures),
        )
