"""Coarsening on a sphere: von Neumann's law with curvature, and what is left of a random foam.

On the unit sphere dA/dt = (π/3)(n − 6) + A: a bubble of n sides shrinks below (6 − n)π/3 and grows above.

    python examples/10_coarsening_on_a_sphere.py [BUBBLES] [UNTIL] [OUT]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import warpedfoam as wf


def main(n_bubbles: int = 60, until: int = 30, out: str | Path | None = None) -> tuple[float, wf.Coarsening]:
    """Return how far the rates of a foam are from the law, and the run."""
    cell = wf.HeleShawCell(wf.Sphere(radius=1.0), gap=1e-3)
    relaxed = wf.relax(wf.voronoi_foam(cell, n_bubbles, seed=2), order=8)
    if not relaxed.converged:
        raise SystemExit(relaxed.message)
    foam = relaxed.foam
    law = np.pi / 3.0 * (foam.network.sides - 6) + foam.bubble_areas
    off = float(np.abs(wf.gas_flow(foam) / 1e-3 - law).max())
    print(f"rates of {n_bubbles} bubbles differ from (pi/3)(n - 6) + A by {off:.1e} at most")
    run = wf.coarsen(foam.with_order(4), until=until)
    print(run.message)
    print("   time  bubbles   mu2   energy/gap")
    for k in np.linspace(0, run.n_steps, 6).astype(int):
        print(
            f"{run.step_times[k]:7.3f}  {run.step_bubbles[k]:7d}  {run.step_mu2[k]:4.2f}  "
            f"{run.step_energies[k] / 1e-3:11.4f}"
        )
    if not run.completed:
        raise SystemExit(run.message)
    if out is not None:
        Path(out).mkdir(parents=True, exist_ok=True)
        wf.save_figure(Path(out) / "coarsening.png", wf.plot_coarsening(run), dpi=110)
    return off, run


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:4])
