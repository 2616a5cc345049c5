"""Make the mesh files in this folder: ``python data/make_meshes.py [FOLDER]``.

torus.ply   R = 20, r = 4 (the paper's torus), 2000 nodes or so
sphere.ply  r = 1, 1962 nodes, a subdivided icosahedron
double_torus.ply  two tori R = 6, r = 2.5, merged by a smooth minimum: genus 2
junction.ply  three tubes of radius 3 that melt into each other, cut off at 11: three rims, nodes shaken
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


#: Of the junction: radius and length of its tubes, softness of the merger; jitter in edges.
TUBES, LONG, MELT, SHAKEN = 3.0, 11.0, 1.5, 0.15
AXES = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.radians([90.0, 210.0, 330.0])])


def _capsules(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (3, n) from three segments that start in the origin, and their gradients (3, n, 3)."""
    along = np.clip(AXES @ x.T, 0.0, LONG + TUBES)
    off = x - along[..., None] * AXES[:, None]
    away = np.sqrt((off**2).sum(axis=2) + 1e-6)
    return away, off / away[..., None]


def three_tubes(x: np.ndarray) -> np.ndarray:
    """A smooth minimum of the distances from three tubes with round ends."""
    away, _ = _capsules(x)
    return -MELT * np.logaddexp.reduce(-away / MELT, axis=0) - TUBES + MELT * np.log(2.0)


def three_tubes_gradient(x: np.ndarray) -> np.ndarray:
    """Its gradient."""
    away, slopes = _capsules(x)
    share = np.exp(-(away - away.min(axis=0)) / MELT)
    return ((share / share.sum(axis=0))[..., None] * slopes).sum(axis=0)


def junction(n_nodes: int = 6500) -> wf.TriangleMesh:
    """The tubes cut across: triangles beyond the cuts removed, the rims' nodes moved into the cuts."""
    reach = LONG + TUBES + 5.0
    body = wf.Implicit(three_tubes, three_tubes_gradient, [[-reach, -reach, -6.0], [reach, reach, 6.0]])
    whole = body.triangulate(n_nodes)
    rng = np.random.default_rng(0)
    shaken = body.project(whole.nodes + SHAKEN * whole.mean_edge * rng.uniform(-1.0, 1.0, whole.nodes.shape))
    inside = (shaken @ AXES.T < LONG).all(axis=1)
    kept = whole.triangles[inside[whole.triangles].all(axis=1)]
    # a triangle that hangs on by a single edge would be folded over
    for _ in range(3):
        rim = wf.TriangleMesh(shaken, kept).rim_edges
        count = np.bincount(rim[:, 0], minlength=len(shaken))
        teeth = (count[kept] > 0).all(axis=1)
        kept = kept[~teeth]
    used, triangles = np.unique(kept, return_inverse=True)
    nodes = shaken[used]
    mesh = wf.TriangleMesh(nodes, triangles.reshape(-1, 3))
    rim = np.unique(mesh.rim_edges)
    which = (nodes[rim] @ AXES.T).argmax(axis=1)
    for _ in range(30):
        over = LONG - np.einsum("nx,nx->n", nodes[rim], AXES[which])
        nodes[rim] = body.project(nodes[rim] + over[:, None] * AXES[which])
    return wf.TriangleMesh(nodes, mesh.triangles)


SURFACES = {
    "torus.ply": wf.Torus(major_radius=20.0, minor_radius=4.0),
    "sphere.ply": wf.Sphere(radius=1.0),
    "double_torus.ply": wf.Implicit(two_rings, two_rings_gradient, [[-19, -11, -6], [19, 11, 6]]),
}


def main(folder: Path = Path(__file__).parent) -> list[Path]:
    """Write each mesh as binary PLY; return the paths."""
    paths = []
    for name, surface in SURFACES.items():
        mesh = surface.triangulate(4000 if name.startswith("double") else 2000)
        paths.append(_written(folder / name, mesh))
    paths.append(_written(folder / "junction.ply", junction()))
    return paths


def _written(path: Path, mesh: wf.TriangleMesh) -> Path:
    path.write_bytes(mesh.to_trimesh().export(file_type="ply", vertex_normal=False))
    print(f"{path}: {mesh.n_nodes} nodes, {mesh.n_triangles} triangles")
    return path


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
