"""Export a foam for other programs, and keep it to go on with later.

foam.ply        bubbles as polygons, films as edges, with areas, volumes, pressures, sides, charges
foam_view.ply   coloured triangles, for any viewer
foam.npz        the foam itself, bit for bit

    python examples/03_export_ply.py [FOLDER]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import trimesh

import warpedfoam as wf
from warpedfoam.io import load, save, write_bubbles_csv, write_films_csv


def main(folder: str | Path) -> tuple[float, float]:
    """Return the area of the triangles of ``foam_view.ply`` over the sphere's, and the foam's energy."""
    folder = Path(folder)
    sphere = wf.Sphere(radius=1.0)
    cell = wf.HeleShawCell(sphere, gap=0.05)
    relaxed = wf.relax(wf.voronoi_foam(cell, n_bubbles=72, seeds="lattice"))
    if not relaxed.converged:
        raise SystemExit(f"not converged: {relaxed.message}")
    foam = relaxed.foam

    ply, view = wf.write_ply(folder / "foam.ply", foam, color_by="pressure")
    write_bubbles_csv(folder / "bubbles.csv", foam)
    write_films_csv(folder / "films.csv", foam)
    save(folder / "foam.npz", foam)
    if load(folder / "foam.npz").energy != foam.energy:
        raise SystemExit("the foam read back differs")

    mesh = trimesh.load(view, process=False)
    print(f"{ply}: {foam.network.n_bubbles} bubbles, {foam.network.n_films} films, energy {foam.energy:.9f}")
    print(f"{view}: {len(mesh.faces)} triangles, {100.0 * mesh.area / sphere.area:.2f} % of the sphere")
    return float(mesh.area / sphere.area), foam.energy


if __name__ == "__main__":
    if sys.argv[1:]:
        Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    main(sys.argv[1] if sys.argv[1:] else tempfile.mkdtemp(prefix="warpedfoam-"))
