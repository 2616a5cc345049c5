"""Seven larger bubbles moved through a foam of 200 on the paper's torus, from outside to inside.

The foam comes from a lattice; the path goes from the outer equator over the top to the inner one and back.
Writes ``soft_probe.csv`` and prints how well forces agree with differences.

    PYTHONPATH=src python benchmarks/soft_probe.py [FOLDER]
"""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

import warpedfoam as wf

TORUS = wf.Torus(major_radius=20.0, minor_radius=4.0)
CELL = wf.HeleShawCell(TORUS, gap=0.5)
#: How much larger the probe's bubbles are, and step of the differences in radians.
LARGER, STEP = 1.5, 0.02
FIELDS = ["path", "phi", "energy", "force", "n_t1", "minimum"]


def probe(larger: float, **seeds: object) -> tuple[wf.Foam, np.ndarray]:
    """A relaxed foam, and a bubble near the outer equator with its neighbours, so much larger."""
    foam = wf.relax(wf.voronoi_foam(CELL, 200, **seeds), order=4).foam
    net = foam.network
    middle = int(np.linalg.norm(foam.bubble_centres - [24.0, 0.0, 0.0], axis=1).argmin())
    around = [net.left[net.right == middle], net.right[net.left == middle], [middle]]
    chosen = np.unique(np.concatenate(around))
    targets = foam.target_volumes.copy()
    targets[chosen] *= larger
    targets *= CELL.volume / targets.sum()
    relaxed = wf.relax(replace(foam, target_volumes=targets))
    assert relaxed.converged, relaxed.message
    return relaxed.foam, chosen


def differences(foam: wf.Foam, chosen: np.ndarray) -> None:
    """Forces beside the slope of the energy at fixed topology."""
    phi, theta = start_of(foam, chosen)
    for middle in (0.0, 0.2):
        near = phi + middle + STEP * np.arange(-2, 3)
        found = wf.probe_potential(
            foam, chosen, points=TORUS.points(near, np.full(5, theta)), t1=False, tolerance=1e-11
        )
        e = found.energies
        slope = (8.0 * (e[3] - e[1]) - (e[4] - e[0])) / (12.0 * STEP) / TORUS.minor_radius
        up = float(TORUS.vertex_frames(found.points[2:3])[0, 0] @ found.forces[2])
        print(f"phi = {np.degrees(near[2]):6.2f}: force {up:.12f}, minus the slope {-slope:.12f}")


def start_of(foam: wf.Foam, chosen: np.ndarray) -> tuple[float, float]:
    """Angles of the probe's centre."""
    phi, theta = TORUS.angles(wf.held_centre(foam, chosen)[None])
    return float(phi[0]), float(theta[0])


def path(name: str, foam: wf.Foam, chosen: np.ndarray, degrees: np.ndarray) -> list[dict]:
    """One row per place along the tube angle."""
    way = np.radians(degrees)
    points = TORUS.points(way, np.full(len(way), start_of(foam, chosen)[1]))
    found = wf.probe_potential(foam, chosen, points=points, tolerance=1e-9)
    up = np.einsum("nx,nx->n", found.forces, TORUS.vertex_frames(points)[:, 0])
    columns = zip(degrees, found.energies, up, found.n_t1, found.minima, strict=True)
    rows = [dict(zip(FIELDS, (name, *(v.item() for v in row)), strict=True)) for row in columns]
    for row in rows:
        print(*row.values(), flush=True)
    return rows


def main(folder: str | Path = "data") -> None:
    start = perf_counter()
    there = np.arange(0.0, 181.0, 15.0)
    foam, chosen = probe(LARGER, seeds="lattice")
    differences(foam, chosen)
    rows = path("out and back", foam, chosen, np.concatenate([there, there[-2::-1]]))
    out = Path(folder) / "soft_probe.csv"
    with out.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, FIELDS)
        writer.writeheader()
        writer.writerows(rows)
    print(f"{perf_counter() - start:.0f} s in all")


if __name__ == "__main__":
    main(*sys.argv[1:])
