"""Random clusters of unequal bubbles on a sphere and a torus: how many relax, in how many steps, with how
many T1s and contacts; and how many steps symmetric clusters take on their way round the torus.

PYTHONPATH=src python benchmarks/random_clusters.py [SEEDS]
"""

from __future__ import annotations

import sys
from time import perf_counter

import numpy as np

import warpedfoam as wf

CELLS = {
    "sphere": wf.HeleShawCell(wf.Sphere(10.0), gap=0.5),
    "torus": wf.HeleShawCell(wf.Torus(20.0, 4.0), gap=0.5),
}
#: Bubbles of a cluster, width of the log-normal volumes, steps at most.
SIZES, WIDTH, STEPS = (30, 60), 0.3, 600


def main(seeds: int = 5) -> None:
    for name, cell in CELLS.items():
        for n in SIZES:
            start, good, turns, events, steps = perf_counter(), 0, 0, 0, []
            for seed in range(seeds):
                rng = np.random.default_rng(seed)
                volumes = 0.5 * np.exp(WIDTH * rng.normal(size=n))
                foam = wf.cluster_foam(
                    cell,
                    n,
                    volumes=volumes,
                    layout="random",
                    seed=seed,
                    order=6,
                    centre=[24.0, 0.0, 0.0],
                )
                found = wf.relax(foam, max_iterations=STEPS)
                good += found.converged
                steps.append(found.iterations)
                turns += found.n_t1
                events += len(found.contacts)
                if not found.converged:
                    print(f"  {name} {n} seed {seed}: {found.message}", flush=True)
            spent = (perf_counter() - start) / seeds
            print(
                f"{name} {n}: {good} of {seeds} converged in {min(steps)} to {max(steps)} steps, "
                f"{turns} T1s, {events} contacts, {spent:.1f} s each",
                flush=True,
            )


def travels() -> None:
    """Steps from the top and from near the inner equator to the outer one."""
    cell = CELLS["torus"]
    for n in (1, 2, 7, 19, 37):
        for degrees in (90.0, 162.0):
            at = cell.surface.points(np.array([np.radians(degrees)]), np.array([0.3]))[0]
            found = wf.relax(wf.cluster_foam(cell, n, volumes=0.5, centre=at, order=6))
            print(f"{n} from {degrees:.0f}°: {found.iterations} steps, E = {found.energy:.10f}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
    travels()
