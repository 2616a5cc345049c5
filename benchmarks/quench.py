"""Random starts relaxed with all their T1s: do they all reach a true minimum, and at what price?

    python benchmarks/quench.py --surface torus --bubbles 200 1000 5000 --seeds 0-9 --csv torus.csv
    python benchmarks/quench.py --surface sphere --bubbles 20000 --seeds 0

Each run has a process of its own, so that its peak memory is its own; every process uses one thread. One
line per run, a summary per number of bubbles. With ``--check-t1`` every sweep of T1s is made again from
its events, and the charges are summed after each: 6 χ always. Ends with an error if any run failed.

Columns: seconds to build and to relax; whether the run converged and its Hessian is that of a minimum;
Newton steps; T1s; film length over the honeycomb bound; μ₂ of the sides; force residual (γ d); relative
volume error; Σ charges; peak memory of the process, libraries included (MB).
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import csv
import multiprocessing
import sys
import time
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, fields
from itertools import groupby
from pathlib import Path

import numpy as np
from common import cell_of, over_bound, whole_numbers

import warpedfoam as wf
from warpedfoam.moves import rewire


@dataclass
class Run:
    """One random start and what became of it."""

    surface: str
    bubbles: int
    seed: int
    build_s: float = float("nan")
    relax_s: float = float("nan")
    converged: bool = False
    is_minimum: bool = False
    iterations: int = 0
    t1s: int = 0
    over_bound: float = float("nan")
    mu2: float = float("nan")
    residual: float = float("nan")
    volume_error: float = float("nan")
    charge: int = 0
    charge_wanted: int = 0
    sweeps_checked: int = 0
    peak_mb: float = float("nan")
    message: str = ""

    @property
    def good(self) -> bool:
        """Converged to a minimum, with the right charge."""
        return self.converged and self.is_minimum and self.charge == self.charge_wanted


def peak_memory() -> float:
    """Largest resident memory of this process so far, MB; NaN where the system does not tell."""
    try:
        import resource
    except ImportError:
        return float("nan")
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return kilobytes / (1024.0**2 if sys.platform == "darwin" else 1024.0)


def checked_sweeps(foam: wf.Foam, result: wf.Relaxation) -> int:
    """Make all T1s again from their events, sum the charges after each sweep; the number of sweeps."""
    network, wanted = foam.network, 6 * foam.cell.surface.euler_characteristic
    sweeps = 0
    for iteration, events in groupby(result.events, key=lambda event: event.iteration):
        network = rewire(network, [event.film for event in events])
        sweeps += 1
        charge = int(network.charges.sum())
        if charge != wanted:
            raise AssertionError(f"charges add up to {charge}, not {wanted}, after step {iteration}")
    if not np.array_equal(network.sides, result.foam.network.sides):
        raise AssertionError("the events do not lead to the final network")
    return sweeps


def run(surface: str, bubbles: int, seed: int, solver: str, limit: int, check: bool) -> Run:
    """Build and relax one random foam; a failure is a row like any other."""
    row = Run(surface, bubbles, seed)
    try:
        cell = cell_of(surface)
        # load every library before the clock starts
        wf.relax(wf.voronoi_foam(cell_of("sphere"), 20, seeds="lattice"), solver=solver)
        start = time.perf_counter()
        foam = wf.voronoi_foam(cell, bubbles, seeds="random", seed=seed)
        middle = time.perf_counter()
        result = wf.relax(foam, solver=solver, max_iterations=limit)
        end = time.perf_counter()
        row.build_s, row.relax_s = middle - start, end - middle
        row.peak_mb = peak_memory()
        row.converged, row.is_minimum, row.message = result.converged, result.is_minimum, result.message
        row.iterations, row.t1s = result.iterations, result.n_t1
        row.residual, row.volume_error = result.residual, result.volume_error
        row.over_bound = over_bound(result.foam)
        sides = wf.side_distribution(result.foam)
        row.mu2, row.charge = sides.mu2, sides.total_charge
        row.charge_wanted = 6 * cell.surface.euler_characteristic
        if check:
            row.sweeps_checked = checked_sweeps(foam, result)
    except Exception:
        row.converged = False
        row.message = traceback.format_exc().strip().splitlines()[-1]
    return row


def line(row: Run) -> str:
    """One row of the table."""
    text = (
        f"{row.bubbles:7d} {row.seed:5d} {row.build_s:8.2f} {row.relax_s:8.2f}   "
        f"{'yes' if row.converged else 'NO':>4} {'yes' if row.is_minimum else 'NO':>4} {row.iterations:6d} "
        f"{row.t1s:6d}  {row.over_bound:.5f} {row.mu2:6.3f}  {row.residual:.1e}  {row.volume_error:.1e} "
        f"{row.charge:7d} {row.peak_mb:8.0f}"
    )
    if row.sweeps_checked:
        text += f"  {row.sweeps_checked} sweeps checked"
    return text if row.good else f"{text}  {row.message}"


def summary(rows: list[Run]) -> str:
    """How many runs were good, medians and extremes."""
    ended = [row for row in rows if np.isfinite(row.relax_s)] or rows
    middle = {
        name: float(np.median([getattr(row, name) for row in ended]))
        for name in ("build_s", "relax_s", "iterations", "t1s", "mu2")
    }
    bound = [row.over_bound for row in ended]
    bad = [row.seed for row in rows if not row.good]
    return (
        f"# {rows[0].surface} {rows[0].bubbles}: {len(rows) - len(bad)} of {len(rows)} converged to a minimum"
        f"{f' (not seeds {bad})' if bad else ''}; medians: build {middle['build_s']:.2f} s, "
        f"relax {middle['relax_s']:.2f} s, {middle['iterations']:.0f} steps, {middle['t1s']:.0f} T1s, "
        f"mu2 {middle['mu2']:.3f}; energy over bound {min(bound):.4f} to {max(bound):.4f}; "
        f"largest residual {max(row.residual for row in ended):.1e}, "
        f"volume error {max(row.volume_error for row in ended):.1e}; "
        f"slowest {max(row.build_s + row.relax_s for row in ended):.1f} s; "
        f"peak {max(row.peak_mb for row in ended):.0f} MB"
    )


def main() -> int:
    """Run all, print the table; 1 if any run failed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--surface", choices=("torus", "sphere"), default="torus")
    parser.add_argument("--bubbles", type=int, nargs="+", default=[200, 1000, 5000])
    parser.add_argument("--seeds", type=whole_numbers, default=list(range(10)), metavar="0-9")
    parser.add_argument("--solver", choices=("auto", "superlu", "pardiso"), default="auto")
    parser.add_argument("--max-iterations", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time; times are honest with 1 only")
    parser.add_argument("--check-t1", action="store_true", help="sum the charges after every sweep of T1s")
    parser.add_argument("--csv", type=Path, help="write the runs to this file too")
    args = parser.parse_args()

    print(
        "bubbles  seed  build/s  relax/s  conv.  min.  steps    T1s  E/bound    mu2  residual  vol.err  "
        "charge  peak/MB"
    )
    rows: list[Run] = []
    spawn = multiprocessing.get_context("spawn")
    for bubbles in args.bubbles:
        batch: list[Run] = []
        with ProcessPoolExecutor(args.jobs, mp_context=spawn, max_tasks_per_child=1) as pool:
            waiting = [
                pool.submit(run, args.surface, bubbles, seed, args.solver, args.max_iterations, args.check_t1)
                for seed in args.seeds
            ]
            for future in as_completed(waiting):
                batch.append(future.result())
                print(line(batch[-1]), flush=True)
        print(summary(sorted(batch, key=lambda row: row.seed)), flush=True)
        rows += batch
        if args.csv:
            with args.csv.open("w", newline="") as file:
                writer = csv.DictWriter(file, [column.name for column in fields(Run)])
                writer.writeheader()
                writer.writerows(map(asdict, rows))
    return 0 if all(row.good for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
