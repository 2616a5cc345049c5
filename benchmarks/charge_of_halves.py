"""How the charge of a torus's outer half tends to 12 as foams grow, and how fast defects are found.

python benchmarks/charge_of_halves.py [FOAMS] [LARGEST]
"""

from __future__ import annotations

import sys
import time

import numpy as np

import warpedfoam as wf

RING, TUBE = 8.0, 4.0


def tube_angle(x: np.ndarray) -> np.ndarray:
    return np.abs(np.arctan2(x[:, 2], np.hypot(x[:, 0], x[:, 1]) - RING))


def main(n_foams: int = 24, largest: int = 800) -> None:
    cell = wf.HeleShawCell(wf.Torus(RING, TUBE), gap=0.05)
    print("bubbles  foams  outer half        its bubbles' (3/pi) int G  bands: mean square pull  defects, ms")
    n = 100
    while n <= largest:
        relaxed = [wf.relax(wf.voronoi_foam(cell, n, seed=seed)) for seed in range(n_foams)]
        foams = [r.foam for r in relaxed if r.converged]
        clock = time.perf_counter()
        assert all(wf.defects(foam).total_charge == 0 for foam in foams)
        spent = (time.perf_counter() - clock) / len(foams) * 1e3
        halves = wf.charge_profile(foams, tube_angle, [0.0, np.pi / 2, np.pi])
        bands = wf.charge_profile(foams, tube_angle, np.linspace(0.0, np.pi, 7))
        pull = (bands.charge - 12.0 * np.diff(np.sin(bands.edges))) / bands.charge_error
        print(
            f"{n:7d}  {len(foams):5d}  {halves.charge[0]:6.2f} ± {halves.charge_error[0]:4.2f}     "
            f"{halves.curvature[0]:8.3f}                 {(pull**2).mean():6.2f}                {spent:8.1f}",
            flush=True,
        )
        n *= 2


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
