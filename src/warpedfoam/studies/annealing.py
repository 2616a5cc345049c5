"""`anneal`: lower the energy of a foam by thermal T1s and shaking."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import (
    Bools,
    Floats,
    Ints,
    as_choice,
    as_instance,
    as_integer,
    as_number,
    frozen,
)
from warpedfoam.errors import ConvergenceError
from warpedfoam.foam import MAX_ORDER, Foam
from warpedfoam.io.atomic import PathLike
from warpedfoam.relax import Relaxation, relax
from warpedfoam.studies.checkpoint import fingerprint, kept
from warpedfoam.studies.foam_moves import MOVES, moved
from warpedfoam.studies.many_moves import many_moves

#: Energies that differ by less than this share are the same minimum.
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class AnnealingHistory:
    """One row per step; arrays (n_steps,).

    Attributes
    ----------
    move : (n_steps,) array of str
        ``"t1"``, ``"pair"``, ``"glide"``, ``"wander"`` or ``"shake"``.
    temperature : (n_steps,) array
        In units of γ d ℓ.
    proposed : (n_steps,) array
        Energy of the relaxed proposal, all its moves made; NaN where the move failed (it could not be
        made, or the foam did not converge).
    accepted : (n_steps,) array of bool
        Whether it was taken, back to the same minimum included.
    n_t1 : (n_steps,) array
        T1s of the final relaxation, besides those of the move itself.
    energy, best : (n_steps,) array
        Of the present foam and of the best one after the step.
    tried, taken : (n_steps,) array of int
        Moves that were made at once, and those of them that the present foam has kept.
    """

    move: NDArray[np.str_]
    temperature: Floats
    proposed: Floats
    accepted: Bools
    n_t1: Ints
    energy: Floats
    best: Floats
    tried: Ints
    taken: Ints


@dataclass(frozen=True, eq=False)
class Annealing:
    """What `anneal` found.

    Attributes
    ----------
    foam : Foam
        The best foam met, relaxed.
    energy : float
        Its energy.
    start_energy : float
        Energy of the relaxed start.
    last : Foam
        Where the walk ended.
    history : AnnealingHistory
    seed : int
    """

    foam: Foam
    energy: float
    start_energy: float
    last: Foam
    history: AnnealingHistory
    seed: int

    @property
    def n_accepted(self) -> int:
        """Number of steps taken."""
        return int(self.history.accepted.sum())


def anneal(
    foam: Foam,
    *,
    steps: int = 100,
    moves: Sequence[str] = ("t1", "pair", "glide", "shake"),
    sites: int = 1,
    temperature: float = 0.05,
    cooling: float = 0.01,
    width: float = 0.3,
    order: int | None = None,
    seed: int = 0,
    folder: PathLike | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Annealing:
    """Search for foams of lower energy: a Metropolis walk from one relaxed foam to the next.

    Each step draws a move, relaxes, and takes the new foam with the probability min(1, exp(−ΔE/T_k)),
    T_k = temperature · cooling^(k/(steps − 1)) · γ d ℓ with ℓ = sqrt(area/N) and d the measure of a film of
    unit length. The volumes at the end of every step are the foam's own. The best foam met is kept. This
    searches; it does not sample Boltzmann's distribution of minima, since forward and backward moves
    need not be equally likely.

    Parameters
    ----------
    foam : Foam
        Relaxed or not.
    steps : int, optional
    moves : sequence of {"t1", "pair", "glide", "wander", "shake"}, optional
        Drawn with equal chances: a T1 on a random film; two T1s beside each other (moving, making or
        removing dislocations); a T1 on a film drawn from those where Σ q² would not rise (dislocations
        glide or annihilate); two T1s of which the first is on a film round a charged bubble; a cycle of
        polydispersity, which shakes the whole foam. Large foams need ``"glide"`` and ``"wander"``.
    sites : int, optional
        Moves per step, at least six bubble sizes apart: as many as there is room for, up to this number.
        They are relaxed together; those are kept whose regions' energies pass the test, each with a random
        number of its own, and the foam with these is relaxed once more and compared with the one before.
        A shake is one move whatever this is.
    temperature : float, optional
        Of the first step, in units of γ d ℓ; 0 takes no step uphill.
    cooling : float, optional
        Last temperature over the first, above 0 and up to 1.
    width : float, optional
        Standard deviation of ln V in the first shake; it falls as the square root of the temperature.
    order : int, optional
        p of the films; the foam's own by default.
    seed : int, optional
        Step k draws from the generator of (seed, k).
    folder : str or path, optional
        Keep the state here after every step, and go on from the state found here. A killed run loses the
        step that it was in and ends with the same numbers as one that was not killed.
    progress : callable, optional
        Called as ``progress("anneal", fraction)`` after each step.

    Returns
    -------
    Annealing

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range, or ``folder`` holds another run.
    OSError
        If the folder cannot be written, or another run is writing there.
    ConvergenceError
        If the start does not relax.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=20, seed=1)
    >>> found = anneal(foam, steps=10, seed=4)
    >>> found.energy <= found.start_energy, len(found.history.best)
    (True, 10)
    """
    as_instance(foam, "foam", Foam)
    count = as_integer(steps, "steps", minimum=0, maximum=10_000_000)
    kinds = _moves(moves)
    heat = as_number(temperature, "temperature", minimum=0.0, maximum=1e6)
    at_once = as_integer(sites, "sites", minimum=1, maximum=1_000_000)
    ratio = as_number(cooling, "cooling", positive=True, maximum=1.0)
    spread = as_number(width, "width", positive=True, maximum=1.0)
    p = as_integer(foam.order if order is None else order, "order", minimum=2, maximum=MAX_ORDER)
    start_seed = as_integer(seed, "seed", minimum=0)
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    key = {
        "start": "" if folder is None else fingerprint(foam),
        "steps": count,
        "moves": list(kinds),
        "sites": at_once,
        "temperature": heat,
        "cooling": ratio,
        "width": spread,
        "order": p,
        "seed": start_seed,
    }
    unit = energy_unit(foam)
    with kept(folder, "anneal", key) as checkpoint:
        found = None if checkpoint is None else checkpoint.read()
        if found is None:
            walk = _started(foam, p)
            if checkpoint is not None:
                checkpoint.write(walk.state(), walk.foams())
        else:
            walk = _Walk(found[1]["now"], found[1]["best"], found[0]["start_energy"], found[0]["rows"])
        for k in range(len(walk.rows), count):
            cooled = ratio ** (k / max(count - 1, 1))
            rng = np.random.default_rng([start_seed, k])
            move = kinds[int(rng.integers(len(kinds)))]
            walk.step(move, rng, heat * cooled, unit, spread * float(np.sqrt(cooled)), p, at_once)
            if checkpoint is not None:
                checkpoint.write(walk.state(), walk.foams())
            if progress is not None:
                progress("anneal", (k + 1) / count)
    return Annealing(
        walk.best, walk.best.energy, walk.start_energy, walk.now, _history(walk.rows), start_seed
    )


def energy_unit(foam: Foam) -> float:
    """γ times the area of a film as long as a bubble is wide, ℓ, in units of energy."""
    return foam.tension * float(foam.cell.layer.shares.sum()) * foam.bubble_size


@dataclass
class _Walk:
    """Where the walk is, the best it met, and a row (as plain values) per step."""

    now: Foam
    best: Foam
    start_energy: float
    rows: list[list[Any]]

    def step(
        self,
        move: str,
        rng: np.random.Generator,
        heat: float,
        unit: float,
        width: float,
        order: int,
        sites: int,
    ) -> None:
        """Propose, relax, and take or leave it."""
        energy = self.now.energy
        result: Relaxation | None
        if sites == 1 or move == "shake":
            chance = float(rng.random())
            result = moved(self.now, move, rng, width, order)
            if result is not None and not result.converged:
                result = None
            proposed = None if result is None else result.energy
            allowance = -heat * unit * float(np.log(max(chance, 1e-300)))
            tried = taken = 1
        else:
            many = many_moves(self.now, move, rng, sites, heat, unit, order)
            result, allowance, tried, taken = many.result, many.allowance, many.tried, many.taken
            proposed = None if many.rise is None else energy + many.rise
        accepted = result is not None and result.energy - energy <= allowance
        if result is not None and accepted and abs(result.energy - energy) > SAME * energy:
            self.now = result.foam
            if result.energy < self.best.energy:
                self.best = result.foam
        row = [move, heat, proposed, accepted, 0 if result is None else result.n_t1, self.now.energy]
        self.rows.append([*row, self.best.energy, tried, taken if accepted else 0])

    def state(self) -> Mapping[str, Any]:
        return {"start_energy": self.start_energy, "rows": self.rows}

    def foams(self) -> Mapping[str, Foam]:
        return {"now": self.now, "best": self.best}


def _started(foam: Foam, order: int) -> _Walk:
    first = relax(foam, order=order, solver="superlu")
    if not first.converged:
        raise ConvergenceError(f"the start does not relax: {first.message}")
    return _Walk(first.foam, first.foam, first.energy, [])


def _moves(moves: object) -> tuple[str, ...]:
    if isinstance(moves, str) or not isinstance(moves, Sequence):
        raise TypeError(f"moves must be a sequence of {', '.join(map(repr, MOVES))}, got {moves!r}")
    if not moves:
        raise ValueError(f"moves must name one move at least, of {', '.join(map(repr, MOVES))}")
    return tuple(as_choice(move, "moves", MOVES) for move in moves)


def _history(rows: list[list[Any]]) -> AnnealingHistory:
    columns = list(zip(*rows, strict=True)) if rows else [()] * 9
    proposed = [np.nan if e is None else e for e in columns[2]]
    return AnnealingHistory(
        frozen(np.array(columns[0], dtype=np.str_)),
        frozen(np.array(columns[1], dtype=np.float64)),
        frozen(np.array(proposed, dtype=np.float64)),
        frozen(np.array(columns[3], dtype=np.bool_)),
        frozen(np.array(columns[4], dtype=np.int64)),
        frozen(np.array(columns[5], dtype=np.float64)),
        frozen(np.array(columns[6], dtype=np.float64)),
        frozen(np.array(columns[7], dtype=np.int64)),
        frozen(np.array(columns[8], dtype=np.int64)),
    )
