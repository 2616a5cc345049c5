"""Make the mesh files in this folder: ``python data/make_meshes.py [FOLDER]``.

torus.ply   R = 20, r = 4 (the paper's torus), 2000 nodes or so
sphere.ply  r = 1, 1962 nodes, a subdivided icosahedron
"""

from __future__ import annotations

import sys
from pathlib import Path

import warpedfoam as wf

SURFACES = {
    "torus.ply": wf.Torus(major_radius=20.0, minor_radius=4.0),
    "sphere.ply": wf.Sphere(radius=1.0),
}


def main(folder: Path = Path(__file__).parent) -> list[Path]:
    """Write each mesh as binary PLY; return the paths."""
    paths = []
    for name, surface in SURFACES.items():
        mesh = surface.triangulate(2000).to_trimesh()
        path = folder / name
        path.write_bytes(mesh.export(file_type="ply", vertex_normal=False))
        print(f"{path}: {len(mesh.vertices)} nodes, {len(mesh.faces)} triangles")
        paths.append(path)
    return paths


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
