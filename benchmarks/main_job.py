"""The speed of the main job, build and relax from random seeds on a torus: one process, one core.

    python benchmarks/main_job.py --bubbles 1000 2000 4000 5000 8000 --seeds 0-4
    python benchmarks/main_job.py --solver superlu          # what the default dependencies give

Medians over the seeds, how the time splits, and the exponent of its growth (least squares of log t over
log N, medians from 1000 to 8000 bubbles). Imports are not counted (see import_time.py): a small foam is
built and relaxed first. Meshes are never taken from a cache. Wall time, but "cpu" is the processor's time for
the whole job: where it is clearly less than "total" other programs were using the core.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import functools
import importlib
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
from common import ExclusiveTimers, cell_of, exponent, one_core, whole_numbers

import warpedfoam as wf

#: What is timed under which name while a foam is built; missing ones fall under "layout, rest".
PIECES = (
    ("warpedfoam:Torus.triangulate", "mesh"),
    ("warpedfoam:Sphere.triangulate", "mesh"),
    ("warpedfoam:HeatGeodesics.__init__", "heat factor"),
    ("warpedfoam:HeatGeodesics.distances", "heat solves"),
    ("warpedfoam.tessellate.build:seed_fields", "seeds, colours"),
    ("warpedfoam.tessellate.build:tidy_labels", "network"),
    ("warpedfoam.tessellate.build:region_network", "network"),
)
BUILD = ("mesh", "heat factor", "heat solves", "seeds, colours", "network", "layout, rest")
RELAX = ("assemble", "solve", "pattern", "t1", "other")


@contextmanager
def timed(place: str, name: str, timers: ExclusiveTimers) -> Iterator[None]:
    """Time every call of a function, given as "module:name" or "module:Class.name", inside the block."""
    module, _, path = place.partition(":")
    *outer, last = path.split(".")
    try:
        owner: Any = functools.reduce(getattr, outer, importlib.import_module(module))
        original: Callable[..., Any] = getattr(owner, last)
    except (ImportError, AttributeError):
        yield
        return

    @functools.wraps(original)
    def wrapper(*args: Any, **options: Any) -> Any:
        with timers.under(name):
            return original(*args, **options)

    setattr(owner, last, wrapper)
    try:
        yield
    finally:
        setattr(owner, last, original)


def measure(surface: str, bubbles: int, seed: int, solver: str, nudge: int) -> dict[str, float]:
    """Seconds of one main job, split; and its counts."""
    timers = ExclusiveTimers()
    cell = cell_of(surface, nudge)
    start, cpu = time.perf_counter(), time.process_time()
    with ExitStack() as stack:
        for place, name in PIECES:
            stack.enter_context(timed(place, name, timers))
        stack.enter_context(timers.under("layout, rest"))
        foam = wf.voronoi_foam(cell, bubbles, seeds="random", seed=seed)
    middle = time.perf_counter()
    result = wf.relax(foam, solver=solver)
    end = time.perf_counter()
    cpu = time.process_time() - cpu
    if not result.converged:
        print(f"# {bubbles} bubbles, seed {seed}: {result.message}", flush=True)
    row = {name: timers.seconds.get(name, 0.0) for name in BUILD}
    row |= {name: result.timings.get(name, 0.0) for name in RELAX}
    row["build"], row["relax"], row["total"] = middle - start, end - middle, end - start
    row["cpu"] = cpu
    row["other"] = row["relax"] - sum(row[name] for name in RELAX[:-1])
    row["steps"], row["T1s"] = result.iterations, result.n_t1
    row["solves"] = timers.calls.get("heat solves", 0)
    row["converged"] = result.converged
    return row


def print_table(title: str, names: tuple[str, ...], medians: dict[int, dict[str, float]]) -> None:
    """Medians, one line per number of bubbles."""
    print(f"\n{title:>8}" + "".join(f"{name:>16}" for name in names))
    for bubbles, row in medians.items():
        print(f"{bubbles:8d}" + "".join(f"{row[name]:16.3f}" for name in names))


def main() -> int:
    """Run all, print the tables; 1 if any run did not converge."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--surface", choices=("torus", "sphere"), default="torus")
    parser.add_argument("--bubbles", type=int, nargs="+", default=[1000, 2000, 4000, 5000, 8000])
    parser.add_argument("--seeds", type=whole_numbers, default=[0, 1, 2], metavar="0-2")
    parser.add_argument("--solver", choices=("auto", "superlu", "pardiso"), default="auto")
    parser.add_argument("--core", type=int, help="core to run on; the last by default")
    args = parser.parse_args()
    one_core(args.core)
    wf.relax(wf.voronoi_foam(cell_of(args.surface), 200, seeds="blue"), solver=args.solver)

    medians: dict[int, dict[str, float]] = {}
    good, nudge = True, 0
    print(f"# {args.surface}, random seeds {args.seeds}, solver {args.solver}, one core; seconds")
    for bubbles in args.bubbles:
        rows = []
        for seed in args.seeds:
            nudge += 1
            row = measure(args.surface, bubbles, seed, args.solver, nudge)
            print(
                f"# {bubbles:6d} seed {seed}: build {row['build']:.2f}, relax {row['relax']:.2f}, "
                f"{row['steps']:.0f} steps, {row['T1s']:.0f} T1s",
                flush=True,
            )
            rows.append(row)
        good = good and all(row["converged"] for row in rows)
        medians[bubbles] = {name: float(np.median([row[name] for row in rows])) for name in rows[0]}

    print_table("bubbles", ("total", "build", "relax", "cpu", "steps", "T1s", "solves"), medians)
    print_table("build", BUILD, medians)
    print_table("relax", RELAX, medians)
    sizes = [n for n in medians if 1000 <= n <= 8000]
    if len(sizes) < 2:
        sizes = list(medians)
    if len(sizes) > 1:
        print(f"\nexponents, {min(sizes)} to {max(sizes)} bubbles (wanted: total at most 1.3)")
        for name in ("total", "cpu", "build", "relax", *BUILD, *RELAX):
            seconds = [medians[n][name] for n in sizes]
            if min(seconds) > 0.0:
                print(f"{name:>16} {exponent(sizes, seconds):6.2f}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
