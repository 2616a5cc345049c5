"""What a whole Newton iteration costs, in units of the sparse factor-and-solve inside it.

    python benchmarks/newton_iteration.py --bubbles 1000 5000 --orders 4 8 --solvers superlu pardiso

A whole iteration: forces, volumes and second derivatives of all films, elimination of the offsets,
filling and ordering the matrix, factoring, two solves (one to refine), inertia, step, new state. The unit is
its factorisation and first solve. Medians over 10 iterations from a lattice start, one thread; the pattern is
built before. "relax" is a whole `warpedfoam.relax` from the same start (all of its seconds over those
of its sparse solver), with everything between the steps.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import sys
import time
from typing import Any

import numpy as np
from common import cell_of, one_core
from scipy.sparse import csc_array

import warpedfoam as wf
from warpedfoam.arrays import Floats
from warpedfoam.relax.linear import Factor, Factoriser, factoriser
from warpedfoam.relax.system import Linearised, State, Step, System, one_ring


class TimedFactor:
    """A factor that notes how long its solves take."""

    def __init__(self, factor: Factor, clock: TimedFactoriser) -> None:
        self._factor, self._clock = factor, clock

    @property
    def n_negative(self) -> int:
        """Number of negative eigenvalues."""
        return self._factor.n_negative

    def solve(self, rhs: Floats) -> Floats:
        """Solution for one right side."""
        start = time.perf_counter()
        out = self._factor.solve(rhs)
        self._clock.solves.append(time.perf_counter() - start)
        return out


class TimedFactoriser:
    """A factoriser that notes how long it takes."""

    def __init__(self, inner: Factoriser) -> None:
        self._inner = inner
        self.factors: list[float] = []
        self.solves: list[float] = []

    def factor(self, matrix: csc_array, *hints: Any) -> TimedFactor:
        """Factor ``matrix``."""
        start = time.perf_counter()
        factor = self._inner.factor(matrix, *hints)
        self.factors.append(time.perf_counter() - start)
        return TimedFactor(factor, self)


def exact_step(lin: Linearised) -> Step:
    """Newton's step on the KKT system, as the driver makes it close to equilibrium; reads the inertia."""
    network = lin.state.network
    # the least shift keeps the rigid motions positive, which the driver pins
    shift = np.full(2 * network.n_vertices, float(np.clip(0.05 * lin.residuals.force, 1e-6, 0.03)))
    pressure = np.zeros(network.n_bubbles)
    pressure[0] = 1.0
    condensed = lin.condensed(positive=False)
    step, factor = lin.solve(condensed, shift.reshape(-1, 2), pressure, lin.residuals.volume)
    if factor.n_negative != network.n_bubbles:
        print(f"# inertia {factor.n_negative}, wanted {network.n_bubbles}", flush=True)
    return step


def proximal_step(lin: Linearised) -> Step:
    """A proximal step, as the driver makes it far from equilibrium."""
    network = lin.state.network
    residual = one_ring(network, lin.residuals.vertex)
    shift = np.maximum(1e-5, residual / 0.15 * np.minimum(1.0, residual / 0.5))
    condensed = lin.condensed(positive=True)
    softness = np.full(network.n_bubbles, 0.02)
    fault = np.clip(lin.residuals.volume, -0.15, 0.15)
    return lin.solve(condensed, np.repeat(shift[:, None], 2, axis=1), softness, fault)[0]


def measure(foam: wf.Foam, solver: str, kind: str, repeats: int) -> dict[str, float]:
    """Median seconds of the parts of one iteration."""
    clock = TimedFactoriser(factoriser(solver))
    system = System(foam.cell, foam.target_volumes, foam.order, clock, foam.n_bubbles)
    state = State(foam.network, foam.vertex_points, foam.film_offsets, np.zeros(foam.n_bubbles))
    make = exact_step if kind == "exact" else proximal_step
    whole, unit, linear = [], [], []
    for turn in range(repeats + 2):
        clock.factors.clear()
        clock.solves.clear()
        start = time.perf_counter()
        lin = system.linearise(state)
        middle = time.perf_counter()
        step = make(lin)
        size = max(float(np.abs(step.vertices).max()), float(np.abs(step.offsets).max(initial=0.0)))
        share = min(1.0, 0.2 / max(size, 1e-300))
        state = State(
            state.network,
            foam.cell.surface.retract(state.points, share * system.length * step.vertices),
            state.offsets + share * step.offsets,
            state.pressures + share * step.pressures,
        )
        end = time.perf_counter()
        if turn < 2:  # the pattern and the solver's analysis are made here, and the caches filled
            continue
        whole.append(end - start)
        linear.append(middle - start)
        unit.append(clock.factors[0] + clock.solves[0])
    return {
        "whole": float(np.median(whole)),
        "linearise": float(np.median(linear)),
        "unit": float(np.median(unit)),
        "ratio": float(np.median(np.array(whole) / np.array(unit))),
    }


def main() -> int:
    """Measure all combinations; 1 if a ratio with the first solver is above the limit."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--surface", choices=("torus", "sphere"), default="torus")
    parser.add_argument("--bubbles", type=int, nargs="+", default=[1000, 5000])
    parser.add_argument("--orders", type=int, nargs="+", default=[4, 8])
    solvers = ["superlu", "pardiso"]
    parser.add_argument("--solvers", nargs="+", choices=solvers, default=solvers)
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--limit", type=float, default=6.0, help="largest ratio wanted at order 4")
    parser.add_argument("--core", type=int, help="core to run on; the last by default")
    args = parser.parse_args()
    one_core(args.core)

    print("bubbles  p  solver   step       whole/ms  linearise/ms  factor+solve/ms   ratio   relax")
    good = True
    for bubbles in args.bubbles:
        lattice = wf.voronoi_foam(cell_of(args.surface), bubbles, seeds="lattice")
        for order in args.orders:
            foam = lattice.with_order(order)
            for solver in args.solvers:
                try:
                    factoriser(solver)
                except ValueError as fault:
                    print(f"# {fault}")
                    continue
                result = wf.relax(foam, solver=solver)
                overall = result.timings["total"] / result.timings["solve"]
                for kind in ("exact", "proximal"):
                    row = measure(foam, solver, kind, args.repeats)
                    print(
                        f"{bubbles:7d} {order:2d}  {solver:8} {kind:8} {1e3 * row['whole']:11.2f} "
                        f"{1e3 * row['linearise']:13.2f} {1e3 * row['unit']:16.2f} {row['ratio']:7.2f} "
                        f"{overall:7.2f}",
                        flush=True,
                    )
                    if order == 4 and solver == args.solvers[0]:
                        good = good and row["ratio"] <= args.limit
    print(f"# order 4, {args.solvers[0]}: {'within' if good else 'NOT within'} {args.limit:g}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
