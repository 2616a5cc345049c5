"""Make the mesh files in this folder: ``python data/make_meshes.py [FOLDER]``.

torus.ply   R = 20, r = 4 (the paper's torus), 2000 nodes or so
sphere.ply  r = 1, 1962 nodes, a subdivided icosahedron
double_torus.ply  two tori R = 6, r = 2.5, merged by a smooth minimum: genus 2
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import warpedfoam as wf

#: Of the double torus: ring, tube, distance of the rings' centres from the origin, softness of the merger.
RING, TUBE, APART, SOFT = 6.0, 2.5, 8.4, 2.0


def _torus(x: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance from one torus, and its gradient."""
    y = x - [side, 0.0, 0.0]
    with np.errstate(divide="ignore", invalid="ignore"):
        q = np.hypot(y[:, 0], y[:, 1])
        away = np.hypot(q - RING, y[:, 2])
        share = (q - RING) / (away * q)
        return away - TUBE, np.stack([share * y[:, 0], share * y[:, 1], y[:, 2] / away], axis=1)


def two_rings(x: np.ndarray) -> np.ndarray:
    """A smooth minimum of the distances from two tori."""
    one, two = (_torus(x, side)[0] for side in (-APART, APART))
    return -SOFT * np.logaddexp(-one / SOFT, -two / SOFT)


def two_rings_gradient(x: np.ndarray) -> np.ndarray:
    """Its gradient."""
    (one, first), (two, second) = (_torus(x, side) for side in (-APART, APART))
    share = 1.0 / (1.0 + np.exp((one - two) / SOFT))
    return share[:, None] * first + (1.0 - share)[:, None] * second


SURFACES = {
    "torus.ply": wf.Torus(major_radius=20.0, minor_radius=4.0),
    "sphere.ply": wf.Sphere(radius=1.0),
    "double_torus.ply": wf.Implicit(two_rings, two_rings_gradient, [[-19, -11, -6], [19, 11, 6]]),
}


def main(folder: Path = Path(__file__).parent) -> list[Path]:
    """Write each mesh as binary PLY; return the paths."""
    paths = []
    for name, surface in SURFACES.items():
        mesh = surface.triangulate(4000 if name.startswith("double") else 2000).to_trimesh()
        path = folder / name
        path.write_bytes(mesh.export(file_type="ply", vertex_normal=False))
        print(f"{path}: {len(mesh.vertices)} nodes, {len(mesh.faces)} triangles")
        paths.append(path)
    return paths


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
