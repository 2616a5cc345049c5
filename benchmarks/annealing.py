"""What lowers the energy of a large foam on a sphere most per processor second?

Every way starts from the same relaxed foam (Voronoi cells of points that repel each other as 1/r³) and is
given the same processor seconds. Columns: change of the length, in bubble sizes ℓ; 5-7 pairs; steps; moves
tried.

    one        anneal: one glide or pair of T1s a step
    many       anneal: as many as there is room for, each kept or undone by its region's energy
    shake      anneal: cycles of polydispersity of width 0.3
    points     anneal_points and a relaxation, which begin anew; the best in the time

    python benchmarks/annealing.py [SECONDS] [BUBBLES ...]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import warpedfoam as wf


class Found(NamedTuple):
    """The best foam, and what was done for it."""

    foam: wf.Foam
    steps: int
    tried: int


def cell() -> wf.HeleShawCell:
    return wf.HeleShawCell(wf.Sphere(1.0), gap=1e-6)


def walked(foam: wf.Foam, seconds: float, **options: object) -> Found:
    """The best foam after ``seconds`` of short walks, each from the best of the one before."""
    began, best, steps, tried, seed = time.process_time(), foam, 0, 0, 0
    while time.process_time() - began < seconds:
        seed += 1
        found = wf.anneal(best, steps=1, temperature=1e-3, cooling=1.0, seed=seed, **options)  # type: ignore[arg-type]
        best, steps, tried = found.foam, steps + 1, tried + int(found.history.tried.sum())
    return Found(best, steps, tried)


def pointed(n: int, seconds: float) -> Found:
    """The best relaxed foam of annealed points."""
    began, best, seed = time.process_time(), None, 0
    while best is None or time.process_time() - began < seconds:
        seed += 1
        points = wf.anneal_points(wf.Sphere(1.0), n, seed=seed).points
        foam = wf.relax(wf.voronoi_foam(cell(), seeds=points, order=3), solver="superlu").foam
        if best is None or foam.energy < best.energy:
            best = foam
    return Found(best, seed, 0)


def main(seconds: float = 30.0, sizes: tuple[int, ...] = (1000, 2000)) -> None:
    print("    n  way        seconds   change/ℓ  pairs  steps  tried")
    for n in sizes:
        points = wf.thomson_points(wf.Sphere(1.0), n, seed=1, tolerance=1e-3, max_iterations=300).points
        start = wf.relax(wf.voronoi_foam(cell(), seeds=points, order=3), solver="superlu").foam
        large = ("glide", "wander")
        ways: dict[str, Callable[[], Found]] = {
            "start": partial(Found, start, 0, 0),
            "one": partial(walked, start, seconds, moves=large),
            "many": partial(walked, start, seconds, moves=large, sites=n),
            "shake": partial(walked, start, seconds, moves=("shake",)),
            "points": partial(pointed, n, seconds),
        }
        for name, way in ways.items():
            began = time.process_time()
            foam, steps, tried = way()
            change = (foam.film_lengths.sum() - start.film_lengths.sum()) / start.bubble_size
            pairs = wf.defects(foam).summary["excess_pairs"]
            spent = time.process_time() - began
            print(
                f"{n:5d}  {name:9s} {spent:8.1f} {change:10.4f} {pairs:6d} {steps:6d} {tried:6d}", flush=True
            )


if __name__ == "__main__":
    given = sys.argv[1:]
    main(*map(float, given[:1]), *((tuple(map(int, given[1:])),) if given[1:] else ()))
