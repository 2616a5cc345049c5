"""Random moves from one relaxed foam to another: T1s, gliding defects, cycles of polydispersity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpedfoam.arrays import Bools, Ints
from warpedfoam.errors import ResolutionError, TopologyError, WarpedFoamError
from warpedfoam.foam import Foam
from warpedfoam.moves import t1
from warpedfoam.moves.t1 import allowed, t1_sites
from warpedfoam.network import CellNetwork
from warpedfoam.relax import Relaxation, relax

MOVES = ("t1", "pair", "glide", "wander", "shake")
#: Moves of two T1s.
TWICE = ("pair", "wander")
#: Tolerance where only the way to the next state is relaxed, and most steps of any relaxation.
ROUGH, STEPS = 1e-4, 300


def moved(foam: Foam, move: str, rng: np.random.Generator, width: float, order: int) -> Relaxation | None:
    """The foam after one move and relaxation, or None if the move could not be made.

    Parameters
    ----------
    foam : Foam
        Relaxed.
    move : {"t1", "pair", "glide", "wander", "shake"}
        One T1 on a film drawn at random; two, the second beside the first; one on a film where Σ q² would
        not rise; two, the first on a film round a charged bubble; or a cycle of polydispersity: relax
        with volumes times log-normal factors of this ``width`` (standard deviation of ln V), then
        with the old volumes.
    rng : numpy.random.Generator
    width : float
    order : int
        p of the films.
    """
    if move == "shake":
        return _shaken(foam, rng, width, order)
    turned = _turned(foam, rng, move)
    return None if turned is None else relaxed_or_none(turned, order)


def relaxed_or_none(foam: Foam, order: int, tolerance: float = 1e-10) -> Relaxation | None:
    """The relaxed foam, or None if the way there broke down."""
    try:
        return relax(foam, order=order, tolerance=tolerance, max_iterations=STEPS, solver="superlu")
    except (WarpedFoamError, ValueError, FloatingPointError):
        return None  # a move that tangles the foam is a move that failed


def _shaken(foam: Foam, rng: np.random.Generator, width: float, order: int) -> Relaxation | None:
    volumes = foam.target_volumes * np.exp(width * rng.standard_normal(foam.n_bubbles))
    volumes *= foam.target_volumes.sum() / volumes.sum()
    there = relaxed_or_none(replace(foam, target_volumes=volumes, pressures=None), order, ROUGH)
    if there is None or not np.isfinite(there.residual):
        return None
    return relaxed_or_none(replace(there.foam, target_volumes=foam.target_volumes, pressures=None), order)


def _turned(foam: Foam, rng: np.random.Generator, move: str) -> Foam | None:
    """The foam after a T1 on a random film, and in a pair a second on one of the films round it."""
    choice = np.flatnonzero(candidates(foam.network, move))
    try:
        for _ in range(2 if move in TWICE else 1):
            if not choice.size:
                return None
            film = int(rng.choice(choice))
            near = films_round(foam.network, film)
            foam = t1(foam, film)
            choice = near[turnable(foam.network)[near]]
    except (TopologyError, ResolutionError, ValueError):
        return None
    return foam


def candidates(network: CellNetwork, move: str) -> Bools:
    """Whether a move of this kind may begin at each film, (n_films,)."""
    fine = turnable(network)
    if move == "glide":
        fine &= charge_rise(network) <= 0
    elif move == "wander":
        four = t1_sites(network, np.arange(network.n_films)).bubbles
        fine &= (network.charges[four] != 0).any(axis=1)
    return fine


def turnable(network: CellNetwork) -> Bools:
    """Whether each film may make a T1, (n_films,)."""
    out = np.zeros(network.n_films, dtype=bool)
    ends = network.vertex_degrees[network.origin].reshape(-1, 2)
    inner = np.flatnonzero((ends == 3).all(axis=1))
    out[inner] = allowed(network, t1_sites(network, inner))
    return out


def charge_rise(network: CellNetwork) -> Ints:
    """By how much a T1 on each film would raise Σ q², (n_films,).

    The charges of the two bubbles beside it rise by 1, those of the two at its ends fall by 1. 0 where a
    dislocation glides, −4 where two of them annihilate.
    """
    q = network.charges[t1_sites(network, np.arange(network.n_films)).bubbles]
    out: Ints = 4 + 2 * (q[:, 0] + q[:, 1] - q[:, 2] - q[:, 3])
    return out


def films_round(network: CellNetwork, film: int) -> Ints:
    """The films of the four bubbles that a T1 on ``film`` concerns, without itself."""
    four = t1_sites(network, np.array([film])).bubbles[0]
    member = np.zeros(network.n_bubbles, dtype=bool)
    member[four] = True
    touches = member[network.left] | member[network.right]
    touches[film] = False
    return np.flatnonzero(touches)
