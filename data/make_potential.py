"""Make torus_potential.csv in this folder: ``python data/make_potential.py [FOLDER]``.

The paper's torus R = 20, r = 4 with gap 0.5: energy, pressure and dE/dφ of one bubble whose mean tube angle
is held at φ (φ = 0 on the outer equator), for films in full three dimensions (six layers) and ruled ones.
V = 0.3 … 0.7 in steps of 0.1, φ = 0 … 180° in steps of 15°; γ = 1; E0 = 2 sqrt(π V d).
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

import warpedfoam as wf
from warpedfoam.io.atomic import atomic_text

RING, TUBE, GAP = 20.0, 4.0, 0.5
VOLUMES = (0.3, 0.4, 0.5, 0.6, 0.7)
DEGREES = range(0, 181, 15)


def rows(layers: int, volumes: tuple[float, ...] = VOLUMES) -> list[list[float]]:
    """[V, φ in degrees, E, E/E0, dE/dφ, p] at every place of the grid."""
    torus = wf.Torus(RING, TUBE)
    cell = wf.HeleShawCell(torus, GAP)
    out = []
    for volume in volumes:
        for degrees in DEGREES:
            phi = np.radians(degrees)
            place = torus.points(phi, np.zeros(()))
            bubble = wf.bubble_between_plates(cell, volume, place, layers=layers)
            if not bubble.converged:
                raise SystemExit(f"V = {volume}, phi = {degrees}: {bubble.message}")
            along = np.array([-np.sin(phi), 0.0, np.cos(phi)])
            slope = -TUBE * float(bubble.force @ along)
            ratio = bubble.energy / bubble.flat_energy
            out.append([volume, degrees, bubble.energy, ratio, slope, bubble.pressure])
    return out


def main() -> None:
    """Write the table."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    free, ruled = rows(6), rows(1)
    with atomic_text(folder / "torus_potential.csv") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        names = ("energy", "ratio", "dE_dphi", "pressure")
        writer.writerow(["V", "phi_degrees", *(f"free_{n}" for n in names), *(f"ruled_{n}" for n in names)])
        for a, b in zip(free, ruled, strict=True):
            # round-off of forces that vanish by symmetry differs from machine to machine
            writer.writerow([a[0], a[1], *(f"{round(v, 12) + 0.0:.12f}" for v in (*a[2:], *b[2:]))])


if __name__ == "__main__":
    main()
