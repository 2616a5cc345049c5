"""Coarsening towards the scaling state: the variance of sides, and how the mean area grows.

A flat foam of unequal bubbles, periodic. In the end all lengths grow as the square root of time, μ₂ stays
(1.4 in soap froths: J. Stavans and J. A. Glazier, Phys. Rev. Lett. 62, 1318 (1989)) and the mean area grows
by the same amount in equal times. Columns: time in first mean areas / κγ, bubbles left, μ₂, growth of the
mean area since the last row, in κγ.

    python benchmarks/coarsening.py [BUBBLES] [UNTIL] [SURFACE]
"""

from __future__ import annotations

import sys
import time

import numpy as np

import warpedfoam as wf


def main(n_bubbles: int = 400, until: int = 80, surface: str = "flat") -> None:
    """Print the table; end with status 1 if the run had to stop."""
    kinds = {"flat": wf.FlatTorus(1.0, 1.0), "sphere": wf.Sphere(float(np.sqrt(0.25 / np.pi)))}
    cell = wf.HeleShawCell(kinds[surface], gap=1e-3)
    relaxed = wf.relax(wf.voronoi_foam(cell, n_bubbles, seed=0, volumes=0.5))
    start = time.process_time()
    run = wf.coarsen(relaxed.foam, until=until)
    seconds = time.process_time() - start
    print(f"{n_bubbles} bubbles, {surface}, area 1, log-normal volumes 0.5; {seconds:.0f} processor seconds,")
    print(f"{run.n_steps} steps ({run.n_rejected} taken back), {run.n_t1} T1s, {run.n_t2} T2s: {run.message}")
    unit = 1.0 / n_bubbles
    print("   time  bubbles    mu2  growth")
    marks = n_bubbles * np.geomspace(1.0, until / n_bubbles, 9)
    last = None
    for mark in marks:
        k = int(np.argmax(run.step_bubbles <= mark + 0.5))
        area, now = 1.0 / run.step_bubbles[k], run.step_times[k]
        near = np.abs(run.step_bubbles - run.step_bubbles[k]) <= 0.05 * run.step_bubbles[k]
        spread = float(run.step_mu2[near].mean())
        growth = "" if last is None else f"{(area - last[1]) / (now - last[0]):7.3f}"
        print(f"{now / unit:7.3f}  {run.step_bubbles[k]:7d}  {spread:5.2f}  {growth}")
        last = (now, area)
    rises = float(np.diff(run.step_energies).max() / run.step_energies[0])
    print(f"largest rise of the energy in a step: {rises:.1e}")
    if not run.completed:
        raise SystemExit(1)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:4])
