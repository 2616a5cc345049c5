"""What a whole Newton iteration costs, in units of the sparse factor-and-solve inside it.

    python benchmarks/newton_iteration.py --bubbles 1000 5000 --orders 4 8 --solvers superlu pardiso

Iterations of `warpedfoam.relax` itself, from one call of ``progress`` to the next: forces, volumes and
second derivatives of all films, elimination of the offsets, filling the matrix, factoring it, all solves and
the inertia, the step, limits and the search for T1s. The unit is the factorisation and its first solve.

"exact": Newton steps on the KKT system, which read the inertia, from a lattice start. "proximal": the first
steps from random seeds. No T1s, so that the sparsity pattern stands; iterations that build it or
factor twice are left out. Medians over at least 10 iterations; one core, processor time (what else
runs on the machine disturbs it less than wall time).
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import importlib
import sys
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from common import cell_of, one_core

import warpedfoam as wf
from warpedfoam.arrays import Floats

# `warpedfoam.relax` is the function, which hides the package of that name
driver: Any = importlib.import_module("warpedfoam.relax.driver")


@dataclass
class Iteration:
    """What happened between two calls of ``progress``; seconds of processor time."""

    start: float
    factors: list[float] = field(default_factory=list)
    solves: list[float] = field(default_factory=list)
    inertia: float = 0.0
    new_pattern: bool = False
    whole: float = float("nan")

    @property
    def kind(self) -> str:
        """Exact steps look at the inertia."""
        return "exact" if self.inertia > 0.0 else "proximal"

    @property
    def unit(self) -> float:
        """Factorisation and first solve."""
        return self.factors[0] + self.solves[0]


class TimedFactor:
    """A factor that books its solves."""

    def __init__(self, factor: Any, log: IterationLog) -> None:
        self._factor, self._log = factor, log

    @property
    def n_negative(self) -> int:
        """Number of negative eigenvalues."""
        start = time.process_time()
        count = int(self._factor.n_negative)
        self._log.now.inertia += time.process_time() - start
        return count

    def solve(self, rhs: Floats) -> Floats:
        """Solution for one right side."""
        start = time.process_time()
        out: Floats = self._factor.solve(rhs)
        self._log.now.solves.append(time.process_time() - start)
        return out


class IterationLog:
    """A factoriser round the real one, and the ``progress`` callback that ends iterations."""

    def __init__(self) -> None:
        self.done: list[Iteration] = []
        self.now = Iteration(time.process_time(), new_pattern=True)
        self._inner: Any = None
        self._pattern: object = None

    def wrap(self, inner: Any) -> IterationLog:
        """Take the place of ``inner``."""
        self._inner = inner
        return self

    def factor(self, matrix: Any, *hints: Any) -> TimedFactor:
        """Factor ``matrix``."""
        pattern = hints[0] if hints else None
        self.now.new_pattern = self.now.new_pattern or pattern is not self._pattern
        self._pattern = pattern
        start = time.process_time()
        factor = self._inner.factor(matrix, *hints)
        self.now.factors.append(time.process_time() - start)
        return TimedFactor(factor, self)

    def progress(self, *_: object) -> None:
        """End an iteration, start the next."""
        now = time.process_time()
        self.now.whole = now - self.now.start
        self.done.append(self.now)
        self.now = Iteration(now)


def iterations(foam: wf.Foam, solver: str, limit: int) -> list[Iteration]:
    """The plain iterations of one relaxation: one factorisation each, in a pattern known before."""
    log = IterationLog()
    original = driver.factoriser
    driver.factoriser = lambda *args: log.wrap(original(*args))
    try:
        wf.relax(foam, t1=False, solver=solver, max_iterations=limit, progress=log.progress)
    finally:
        driver.factoriser = original
    return [one for one in log.done if len(one.factors) == 1 and one.solves and not one.new_pattern]


def collected(foam: wf.Foam, solver: str, kind: str, repeats: int) -> list[Iteration]:
    """At least ``repeats`` iterations of a kind, from as many relaxations as that takes."""
    found: list[Iteration] = []
    for _ in range(repeats):
        limit = 60 if kind == "exact" else repeats + 2
        found += [one for one in iterations(foam, solver, limit) if one.kind == kind]
        if len(found) >= repeats:
            break
    return found


def main() -> int:
    """Measure all combinations; 1 if a ratio with the first solver at order 4 is above the limit."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    solvers = ["superlu", "pardiso"]
    parser.add_argument("--surface", choices=("torus", "sphere"), default="torus")
    parser.add_argument("--bubbles", type=int, nargs="+", default=[1000, 5000])
    parser.add_argument("--orders", type=int, nargs="+", default=[4, 8])
    parser.add_argument("--solvers", nargs="+", choices=solvers, default=solvers)
    parser.add_argument("--repeats", type=int, default=10, help="iterations of each kind, at least")
    parser.add_argument("--limit", type=float, default=6.0, help="largest ratio wanted at order 4")
    parser.add_argument("--core", type=int, help="core to run on; the last by default")
    args = parser.parse_args()
    one_core(args.core)

    print(
        "bubbles  p  solver   step     count  whole/ms  factor/ms  solve/ms  inertia/ms  fac+solve/ms  ratio"
    )
    good, refused = True, set()
    for bubbles in args.bubbles:
        starts = {
            "exact": wf.voronoi_foam(cell_of(args.surface), bubbles, seeds="lattice"),
            "proximal": wf.voronoi_foam(cell_of(args.surface), bubbles, seeds="random"),
        }
        for order in args.orders:
            for solver in args.solvers:
                for kind, start in starts.items():
                    if solver in refused:
                        continue
                    try:
                        found = collected(start.with_order(order), solver, kind, args.repeats)
                    except ValueError as fault:
                        print(f"# {fault}")
                        refused.add(solver)
                        continue
                    if not found:
                        print(f"# {bubbles} bubbles, order {order}, {solver}: no {kind} iterations")
                        good = False
                        continue
                    ms = 1e3 * np.median(
                        [(one.whole, one.factors[0], one.solves[0], one.inertia, one.unit) for one in found],
                        axis=0,
                    )
                    ratio = float(np.median([one.whole / one.unit for one in found]))
                    print(
                        f"{bubbles:7d} {order:2d}  {solver:8} {kind:8} {len(found):5d} {ms[0]:9.2f} "
                        f"{ms[1]:10.2f} {ms[2]:9.2f} {ms[3]:11.2f} {ms[4]:13.2f} {ratio:6.2f}",
                        flush=True,
                    )
                    if order == 4 and solver == args.solvers[0]:
                        good = good and ratio <= args.limit
    print(f"# order 4, {args.solvers[0]}: {'within' if good else 'NOT within'} {args.limit:g}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
