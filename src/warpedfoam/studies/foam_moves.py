"""Random moves from one relaxed foam to another: T1s, pairs of T1s, cycles of polydispersity."""

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

MOVES = ("t1", "pair", "shake")
#: Tolerance where only the way to the next state is relaxed, and most steps of any relaxation.
ROUGH, STEPS = 1e-4, 300


def moved(foam: Foam, move: str, rng: np.random.Generator, width: float, order: int) -> Relaxation | None:
    """The foam after one move and relaxation, or None if the move could not be made.

    Parameters
    ----------
    foam : Foam
        Relaxed.
    move : {"t1", "pair", "shake"}
        One T1 on a film drawn at random; two, the second beside the first; or a cycle of polydispersity:
        relax with volumes times log-normal factors of this ``width`` (standard deviation of ln V), then
        with the old volumes.
    rng : numpy.random.Generator
    width : float
    order : int
        p of the films.
    """
    if move == "shake":
        return _shaken(foam, rng, width, order)
    turned = _turned(foam, rng, 2 if move == "pair" else 1)
    return None if turned is None else _relaxed(turned, order)


def _relaxed(foam: Foam, order: int, tolerance: float = 1e-10) -> Relaxation | None:
    try:
        return relax(foam, order=order, tolerance=tolerance, max_iterations=STEPS, solver="superlu")
    except (WarpedFoamError, ValueError, FloatingPointError):
        return None  # a move that tangles the foam is a move that failed


def _shaken(foam: Foam, rng: np.random.Generator, width: float, order: int) -> Relaxation | None:
    volumes = foam.target_volumes * np.exp(width * rng.standard_normal(foam.n_bubbles))
    volumes *= foam.target_volumes.sum() / volumes.sum()
    there = _relaxed(replace(foam, target_volumes=volumes, pressures=None), order, ROUGH)
    if there is None or not np.isfinite(there.residual):
        return None
    return _relaxed(replace(there.foam, target_volumes=foam.target_volumes, pressures=None), order)


def _turned(foam: Foam, rng: np.random.Generator, count: int) -> Foam | None:
    """The foam after T1s on random films, each but the first among the films round the one before."""
    network = foam.network
    choice = np.flatnonzero(turnable(network))
    try:
        for _ in range(count):
            if not choice.size:
                return None
            film = int(rng.choice(choice))
            near = films_round(foam.network, film)
            foam = t1(foam, film)
            choice = near[turnable(foam.network)[near]]
    except (TopologyError, ResolutionError, ValueError):
        return None
    return foam


def turnable(network: CellNetwork) -> Bools:
    """Whether each film may make a T1, (n_films,)."""
    out = np.zeros(network.n_films, dtype=bool)
    ends = network.vertex_degrees[network.origin].reshape(-1, 2)
    inner = np.flatnonzero((ends == 3).all(axis=1))
    out[inner] = allowed(network, t1_sites(network, inner))
    return out


def films_round(network: CellNetwork, film: int) -> Ints:
    """The films of the four bubbles that a T1 on ``film`` concerns, without itself."""
    four = t1_sites(network, np.array([film])).bubbles[0]
    touches: Bools = np.asarray(np.isin(network.bubble, four)).reshape(-1, 2).any(axis=1)
    touches[film] = False
    return np.flatnonzero(touches)
