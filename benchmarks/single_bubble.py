"""Seconds for one bubble between plates, and for the potential of the paper's torus.

    python benchmarks/single_bubble.py

First a fresh process: seconds of the first bubble after ``import warpedfoam`` (torus R = 20, r = 4,
d = V = 0.5, φ = 90°, default layers) and the error of its E/E0 against 12 layers. Then the grid of 65
places, V = 0.3 … 0.7 and φ = 0 … 180° in steps of 15°, on one core. Ends with an error if the first takes
longer than ``--first`` seconds or errs by more than 1e-6, or the grid takes longer than ``--grid``.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import subprocess
import sys
import time

import numpy as np
from common import one_core

import warpedfoam as wf

FIRST = """
import time, warpedfoam as wf
start = time.perf_counter()
cell = wf.HeleShawCell(wf.Torus(20.0, 4.0), gap=0.5)
bubble = wf.bubble_between_plates(cell, volume=0.5, position=[20.0, 0.0, 4.0])
print(time.perf_counter() - start, repr(bubble.energy / bubble.flat_energy))
"""


def main() -> int:
    """Print both times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--first", type=float, default=0.5)
    parser.add_argument("--grid", type=float, default=60.0)
    options = parser.parse_args()
    one_core()
    torus = wf.Torus(20.0, 4.0)
    cell = wf.HeleShawCell(torus, gap=0.5)
    fine = wf.bubble_between_plates(cell, 0.5, [20.0, 0.0, 4.0], layers=12)
    times, ratio = [], 0.0
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", FIRST], capture_output=True, text=True, check=True)
        seconds, ratio = map(float, done.stdout.split())
        times.append(seconds)
    first, error = float(np.median(times)), abs(ratio - fine.energy / fine.flat_energy)
    print(f"first bubble in a fresh process: {first:.3f} s (median of 3), E/E0 off by {error:.1e}")

    phi = np.radians(np.arange(0, 181, 15))
    path = torus.points(phi, np.zeros(13))
    print("layers  seconds for 65 bubbles")
    worst = 0.0
    for layers in (1, 4, 6):
        start = time.perf_counter()
        for volume in (0.3, 0.4, 0.5, 0.6, 0.7):
            method = "ruled" if layers == 1 else "free"
            out = wf.geometric_potential(cell, volume, path=path, method=method, layers=max(layers, 2))
            if not out.converged.all():
                print("# a bubble did not come to rest")
                return 1
        took = time.perf_counter() - start
        worst = max(worst, took)
        print(f"{layers:6d} {took:8.1f}")
    missed = first > options.first or error > 1e-6 or worst > options.grid
    print(f"# limits {options.first:g} s, 1e-6 and {options.grid:g} s: {'MISSED' if missed else 'met'}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
