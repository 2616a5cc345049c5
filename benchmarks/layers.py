"""One bubble's energy against the number of layers of its film, on the paper's torus.

    python benchmarks/layers.py --csv benchmarks/data/layers.csv

Torus(20, 4), gap 0.5, volume 0.5, held at φ = 0, 90 and 180 degrees. E/E0 with 1 … 7 layers less that with 9;
one layer is the ruled film, whose distance is that of the model. Ends with an error if 4 layers miss by 1e-8.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import csv
import sys
from pathlib import Path

import numpy as np

import warpedfoam as wf

GAP, VOLUME, DEGREES, LAYERS, BEST, WANTED = 0.5, 0.5, (0.0, 90.0, 180.0), range(1, 8), 9, 1e-8


def main() -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--csv", type=Path, help="write the table there")
    options = parser.parse_args()
    torus = wf.Torus(20.0, 4.0)
    cell = wf.HeleShawCell(torus, GAP)
    rows, met = [], True
    print("  phi  layers   E/E0             less that of 9")
    for degrees in DEGREES:
        place = torus.points(np.radians([degrees]), np.zeros(1))[0]
        ratio = {}
        for layers in (*LAYERS, BEST):
            bubble = wf.bubble_between_plates(cell, VOLUME, place, layers=layers)
            if not bubble.converged:
                print(f"# {degrees:g} degrees, {layers} layers: {bubble.message}")
                return 1
            ratio[layers] = bubble.energy / bubble.flat_energy
        for layers in LAYERS:
            apart = ratio[layers] - ratio[BEST]
            met &= layers != 4 or abs(apart) < WANTED
            rows.append([degrees, layers, repr(float(ratio[layers])), f"{apart:.3g}"])
            print(f"{degrees:5g} {layers:7d}   {ratio[layers]:.12f}   {apart:+.1e}", flush=True)
    if options.csv:
        with options.csv.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(["phi_degrees", "layers", "ratio", "difference"])
            writer.writerows(rows)
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
