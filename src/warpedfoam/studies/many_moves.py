"""Many moves in one step, far from each other, each judged by the energy of the region round it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.errors import ResolutionError, TopologyError
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.thinning import accepted
from warpedfoam.moves import t1
from warpedfoam.relax import Relaxation
from warpedfoam.studies.foam_moves import TWICE, candidates, films_round, relaxed_or_none, turnable
from warpedfoam.surfaces.places import Places

#: Least distance of two moves, in bubble sizes: each is alone in a patch of about thirty bubbles.
APART = 6.0
#: By how much, in γ d ℓ, a region may rise before its move is dropped, round by round.
SLACKS = (0.05, 0.01, 0.0, 0.0)
#: Change of a region's energy, in γ d ℓ, below which nothing has happened there.
NOTHING = 1e-6


@dataclass(frozen=True, eq=False)
class ManyMoves:
    """A step of many moves.

    Attributes
    ----------
    result : Relaxation or None
        The relaxed foam with the moves that were taken; None if none was.
    rise : float or None
        Energy of all moves together over the foam's; None if that foam did not converge.
    tried, taken : int
        Numbers of moves.
    allowance : float
        Σ −T ln u_s of the moves that were taken, in units of energy: what the rise is measured against.
    """

    result: Relaxation | None
    rise: float | None
    tried: int
    taken: int
    allowance: float


def many_moves(
    foam: Foam, move: str, rng: np.random.Generator, most: int, heat: float, unit: float, order: int
) -> ManyMoves:
    """Make up to ``most`` moves at once, then those again that did not raise their regions' energies.

    Films belong to the region of the move nearest to them, so the changes of the regions add up to the whole
    change. A move s is kept if its region's change is at most −T ln u_s, u_s uniform in (0, 1). But the
    elastic fields of bad moves reach into the regions of good ones. So moves are dropped in rounds,
    those first that raise their region's energy by far, and the foam with the others is relaxed anew. The
    lowest of these foams is the result; its energy is the true one.

    Parameters
    ----------
    foam : Foam
        Relaxed.
    move : {"t1", "pair", "glide", "wander"}
    rng : numpy.random.Generator
    most : int
    heat : float
        T, in units of ``unit``.
    unit : float
        Of energy.
    order : int
        p of the films.
    """
    plans, places = _planned(foam, move, rng, most)
    limits = -heat * unit * np.log(1.0 - rng.random(len(plans)))
    if not plans:
        return ManyMoves(None, None, 0, 0, 0.0)
    chosen: Ints = np.arange(len(plans))
    rise: float | None = None
    best: ManyMoves | None = None
    for slack in SLACKS:
        trial = relaxed_or_none(made(foam, [plans[i] for i in chosen]), order)
        if trial is None or not trial.converged:
            break
        change = region_changes(foam, trial.foam, places)[chosen]
        moved = np.abs(change) > NOTHING * unit
        if rise is None:
            rise = trial.energy - foam.energy
        if moved.any() and (best is None or best.result is None or trial.energy < best.result.energy):
            limit = float(limits[chosen[moved]].sum())
            best = ManyMoves(trial, rise, len(plans), int(moved.sum()), limit)
        good = moved & (change <= limits[chosen] + slack * unit)
        if not good.any() or (good | ~moved).all():
            break
        chosen = chosen[good]
    return best or ManyMoves(None, rise, len(plans), 0, 0.0)


def region_changes(before: Foam, after: Foam, places: Floats) -> Floats:
    """Change of γ Σ film areas in the region of each of ``places`` (k, 3), (k,).

    Films keep their numbers in T1s, so a film belongs to one region, by where it was before.
    """
    owner: Ints = Places(places, before.cell.surface.period).nearest(middles(before))[1]
    change = before.tension * (after.film_areas - before.film_areas)
    out: Floats = np.bincount(owner, weights=change, minlength=len(places)).astype(np.float64)
    return out


def middles(foam: Foam) -> Floats:
    """The middle of each film's chord, (n_films, 3)."""
    network = foam.network
    tails, heads = foam.vertex_points[network.tails], foam.vertex_points[network.heads]
    out: Floats = tails + 0.5 * nearest_image(heads - tails, foam.cell.surface.period)
    return out


def made(foam: Foam, plans: list[tuple[int, ...]]) -> Foam:
    """The foam after the T1s of each plan; not relaxed, its pressures kept as a start."""
    pressures = foam.pressures
    for plan in plans:
        for film in plan:
            foam = t1(foam, film)
    return replace(foam, pressures=pressures)


def _planned(
    foam: Foam, move: str, rng: np.random.Generator, most: int
) -> tuple[list[tuple[int, ...]], Floats]:
    """Films to turn, far from each other, and where they are."""
    choice = np.flatnonzero(candidates(foam.network, move))
    where = middles(foam)
    plans: list[tuple[int, ...]] = []
    places: list[int] = []
    for k in scattered(where[choice], foam.cell.surface.period, APART * foam.bubble_size, rng)[:most]:
        film = int(choice[k])
        plan: tuple[int, ...] = (film,)
        try:
            turned = t1(foam, film)
            if move in TWICE:
                near = films_round(foam.network, film)
                near = near[turnable(turned.network)[near]]
                if not near.size:
                    continue
                plan = (film, int(rng.choice(near)))
                t1(turned, plan[1])
        except (TopologyError, ResolutionError, ValueError):
            continue
        plans.append(plan)
        places.append(film)
    return plans, where[np.array(places, dtype=np.int64)]


def scattered(points: Floats, period: Floats | None, apart: float, rng: np.random.Generator) -> Ints:
    """Points in random order, each unless an earlier one that was taken is nearer than ``apart``."""
    order: Ints = rng.permutation(len(points))
    if len(points) < 2:
        return order
    reach = apart
    if period is not None:
        reach = min(apart, 0.499 * float(period[np.isfinite(period)].min()))
    pairs = Places(points[order], period).pairs(reach)
    taken: Bools = accepted(len(points), np.ascontiguousarray(pairs.T))
    out: Ints = order[taken]
    return out
