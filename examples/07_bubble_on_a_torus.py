"""A bubble's energy along a torus: films in three dimensions on the line of second-order theory.

The paper's torus (R = 20, r = 4, gap 0.5) and a bubble of volume 0.5. The bubble has least energy on the
outer equator, where the surface is curved like a sphere, and drifts there; E0 is its energy between planes.

    python examples/07_bubble_on_a_torus.py [PLACES] [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import warpedfoam as wf
from warpedfoam import plot, theory

GAP, VOLUME = 0.5, 0.5


def main(n_places: int = 7, folder: str | Path = "out") -> tuple[float, float]:
    """Return E/E0 on the inner equator, and the largest distance of the theory from the films."""
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    torus = wf.Torus(major_radius=20.0, minor_radius=4.0)
    cell = wf.HeleShawCell(torus, gap=GAP)
    degrees = np.linspace(0.0, 180.0, n_places)
    path = torus.points(np.radians(degrees), np.zeros(n_places))
    films = wf.geometric_potential(cell, VOLUME, path=path)
    if not films.converged.all():
        raise SystemExit("a bubble did not come to rest")
    lines = theory.second_order_ratio(VOLUME, GAP, *torus.principal_curvatures(path).T)
    print("   phi        E/E0      theory    force")
    for row in zip(degrees, films.ratios, lines, np.linalg.norm(films.forces, axis=1), strict=True):
        print("{:6.1f}  {:.8f}  {:.8f}  {:.1e}".format(*row))
    points = (degrees, np.full(n_places, VOLUME), films.ratios)
    chart = plot.figure_torus_energy(GAP, (VOLUME,), points=points)
    chart.save(out / "torus_energy.png")
    chart.write_csv(out / "torus_energy.csv")
    return float(films.ratios[-1]), float(np.abs(films.ratios - lines).max())


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:3])
