"""`minimal_partition`: the shortest films that divide a surface into equal areas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from warpedfoam.arrays import as_instance, as_integer, as_number
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import ConvergenceError, ResolutionError, WarpedFoamError
from warpedfoam.foam import MAX_ORDER, Foam
from warpedfoam.io.atomic import PathLike
from warpedfoam.relax import Relaxation, relax
from warpedfoam.studies.annealing import SAME, energy_unit
from warpedfoam.studies.checkpoint import kept, surface_mark
from warpedfoam.studies.foam_moves import STEPS, moved
from warpedfoam.studies.partition_starts import start_foam, start_kind
from warpedfoam.surfaces.protocol import Surface

#: Gap of the cell that stands for the bare surface, in sizes of the surface.
THIN = 1e-6
#: Order of the films while searching: enough to tell minima apart where films are short, and where not.
SEARCH_ORDER, LONG_ORDER, FEW = 4, 6, 16
#: Hops are mostly pairs of T1s.
HOPS = ("pair", "pair", "t1")


@dataclass(frozen=True)
class PartitionTry:
    """One start of the search and where it led.

    Attributes
    ----------
    start : int
        Its number.
    kind : str
        ``"circle"``, ``"meridians"``, ``"thomson"``, ``"random"`` or ``"blue"``.
    first_length : float or None
        Length after the first relaxation; None if that failed.
    length : float or None
        Length in the end, for equal areas, films at the full order; None if the start failed.
    n_hops : int
        Hops taken of those tried.
    message : str
        Why it failed, or the last relaxation's message.
    """

    start: int
    kind: str
    first_length: float | None
    length: float | None
    n_hops: int
    message: str


@dataclass(frozen=True, eq=False)
class MinimalPartition:
    """The shortest partition found.

    Attributes
    ----------
    length : float
        Σ film lengths on the surface, for bubbles of equal area, each film counted once.
    foam : Foam
        The partition, in a cell with a gap of 1e-6 of the surface's size.
    length_correction : float
        What was added to the foam's own length to make up for its areas, which are not quite equal where
        the mean curvature varies (see `minimal_partition`).
    residual : float
        Largest force on a vertex or film node, in units of γ d.
    tries : tuple of PartitionTry
        Every start in order.
    seed : int
    """

    length: float
    foam: Foam
    length_correction: float
    residual: float
    tries: tuple[PartitionTry, ...]
    seed: int

    @property
    def n_reached(self) -> int:
        """How many starts ended at this length, to 1e-8 of it: how much to trust it."""
        return sum(
            t.length is not None and abs(t.length - self.length) <= 1e-8 * self.length for t in self.tries
        )


def minimal_partition(
    surface: Surface,
    n: int,
    *,
    seed: int = 0,
    starts: int = 30,
    hops: int = 20,
    temperature: float = 0.01,
    order: int = 10,
    folder: PathLike | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> MinimalPartition:
    """Search for the shortest films that divide a surface into ``n`` disks of equal area.

    Basin hopping from many starts: Voronoi cells of repelling points, of random points and of blue noise
    in turn (two and three bubbles on a closed surface without handles: a circle, three meridians). Each is
    relaxed with all its T1s, then hops: T1s, mostly in pairs, relaxed and taken with the probability
    min(1, exp(−ΔL/(temperature ℓ))), ℓ = sqrt(area/n). The best foam of each start is relaxed once more at
    the full order.

    The foam lives in a cell whose gap d is 1e-6 of the surface's size. There the volumes ∫ d + H d² + … are
    equal, not the areas A_i, and areas differ by a share of the order of d times the variation of H.
    Since films at equilibrium lengthen by dL = Σ (p_i/γd) dA_i, the length for equal areas is
    L − Σ (p_i/γd)(A_i − A/n), up to the order of (d H)² ≈ 1e-12. On spheres and planes there is
    nothing to correct.

    Parameters
    ----------
    surface : Surface
    n : int
        Number of bubbles, at least 2. The surface must have room for that many disks.
    seed : int, optional
        Start k draws from the generator of (seed, k), whatever ``starts`` is.
    starts : int, optional
    hops : int, optional
        Moves tried from each start.
    temperature : float, optional
        0 takes hops downhill only.
    order : int, optional
        p of the films in the end; 10 holds lengths to about 1e-10 if n is 4 or more.
    folder : str or path, optional
        Keep the state here after every start, and go on from the state found here; ``starts`` may then
        be raised. A killed run loses the start that it was in, and ends with the same numbers.
    progress : callable, optional
        Called as ``progress("partition", fraction)`` after each start.

    Returns
    -------
    MinimalPartition
        The best that was met. No proof that there is no shorter one: look at ``n_reached``.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range, or ``folder`` holds another search.
    OSError
        If the folder cannot be written, or another run is writing there.
    ResolutionError
        If no start could be built: there are too few bubbles for the surface.
    ConvergenceError
        If no start converged.

    Notes
    -----
    Bubbles that are no disks, or in several pieces, are not searched. Proved least on the sphere are the
    partitions for n = 2, 3, 4 and 12.

    References
    ----------
    T. C. Hales, *The honeycomb problem on the sphere*, arXiv:math/0211234 (2002), n = 12; M. Engelstein,
    Discrete Comput. Geom. 44, 645 (2010), n = 4; S. J. Cox and E. Flikkema, Electron. J. Combin. 17, R45
    (2010), for candidates in a plane disk found by similar moves.

    Examples
    --------
    >>> from warpedfoam import Sphere
    >>> found = minimal_partition(Sphere(1.0), 4, starts=2, hops=0)
    >>> round(found.length, 8), found.n_reached  # 6 arccos(−1/3), a regular tetrahedron
    (11.46379942, 2)
    """
    as_instance(surface, "surface", Surface)  # type: ignore[type-abstract]
    count = as_integer(n, "n", minimum=2, maximum=100_000)
    number = as_integer(seed, "seed", minimum=0)
    tried = as_integer(starts, "starts", minimum=1, maximum=10_000_000)
    each = as_integer(hops, "hops", minimum=0, maximum=10_000_000)
    heat = as_number(temperature, "temperature", minimum=0.0, maximum=1e6)
    p = as_integer(order, "order", minimum=2, maximum=MAX_ORDER)
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    cell = HeleShawCell(surface, THIN * surface.size)
    key = {
        "surface": "" if folder is None else surface_mark(surface),
        "n": count,
        "seed": number,
        "hops": each,
        "temperature": heat,
        "order": p,
    }
    tries: list[PartitionTry] = []
    best: Foam | None = None
    with kept(folder, "partition", key) as checkpoint:
        before = None if checkpoint is None else checkpoint.read()
        if before is not None:
            tries = [PartitionTry(**row) for row in before[0]["tries"]]
            best = before[1].get("best")
        for k in range(len(tries), tried):
            made, foam = _tried(cell, count, k, np.random.default_rng([number, k]), each, heat, p)
            lengths = [t.length for t in tries if t.length is not None]
            # a tie goes to the earlier start
            if made.length is not None and made.length < min(lengths, default=np.inf) * (1.0 - 1e-11):
                best = foam
            tries.append(made)
            if checkpoint is not None:
                state = {"tries": [asdict(t) for t in tries]}
                checkpoint.write(state, {} if best is None else {"best": best})
            if progress is not None:
                progress("partition", (k + 1) / tried)
    if best is None:
        kind = ResolutionError if all(t.first_length is None for t in tries) else ConvergenceError
        raise kind(f"none of the {len(tries)} starts led to a foam; the last one: {tries[-1].message}")
    # the pressures come with the foam, so this measures and does not move
    checked = relax(best, order=p, t1=False, solver="superlu", max_iterations=0)
    length, correction = equal_area_length(best)
    return MinimalPartition(length, best, correction, checked.residual, tuple(tries), number)


def equal_area_length(foam: Foam) -> tuple[float, float]:
    """L − Σ (p_i/γd)(A_i − A/n) of a relaxed foam in a thin gap, and the second term.

    Raises
    ------
    ValueError
        If the foam has no pressures.
    """
    if foam.pressures is None:
        raise ValueError("foam must have pressures; relax it first")
    surface = foam.cell.surface
    uneven = foam.bubble_areas - foam.bubble_areas.sum() / foam.n_bubbles
    # a film's area over its length, and a bubble's volume over its area
    thickness = float(foam.cell.layer.shares.sum())
    per_length = foam.pressures * (foam.cell.volume / surface.area) / (foam.tension * thickness)
    correction = -float(per_length @ uneven)
    return float(foam.film_lengths.sum()) + correction, correction


def _tried(
    cell: HeleShawCell,
    n: int,
    index: int,
    rng: np.random.Generator,
    hops: int,
    heat: float,
    order: int,
) -> tuple[PartitionTry, Foam | None]:
    """One start: build, relax, hop, relax at the full order."""
    kind = start_kind(cell.surface, n, index)
    search = min(order, SEARCH_ORDER if n > FEW else LONG_ORDER)
    try:
        first = _relaxed(start_foam(cell, n, index, rng, search), search)
    except WarpedFoamError as fault:
        return PartitionTry(index, kind, None, None, 0, str(fault)), None
    if not first.converged:
        return PartitionTry(index, kind, None, None, 0, first.message), None
    now = best = first.foam
    taken, unit = 0, energy_unit(first.foam)
    for _ in range(hops):
        move, chance = HOPS[int(rng.integers(len(HOPS)))], float(rng.random())
        trial = moved(now, move, rng, 0.0, search)
        if trial is None or not trial.converged:
            continue
        rise = trial.energy - now.energy
        if abs(rise) <= SAME * now.energy:
            continue  # back where it was
        if rise < 0.0 or (heat > 0.0 and chance < float(np.exp(-rise / (heat * unit)))):
            now, taken = trial.foam, taken + 1
            if now.energy < best.energy:
                best = now
    last = _relaxed(best, order)
    length = equal_area_length(last.foam)[0] if last.converged else None
    first_length = float(first.foam.film_lengths.sum())
    return PartitionTry(index, kind, first_length, length, taken, last.message), last.foam


def _relaxed(foam: Foam, order: int) -> Relaxation:
    return relax(foam, order=order, solver="superlu", max_iterations=STEPS)
