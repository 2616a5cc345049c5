"""Read triangle meshes from files, by trimesh."""

from __future__ import annotations

import warnings
from os import PathLike
from pathlib import Path

import numpy as np

from warpedfoam.errors import MeshError
from warpedfoam.surfaces.mesh import TriangleMesh

#: Kinds of files by their endings, and those that write each triangle's corners anew.
KINDS = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")
SOUPS = (".stl", ".obj", ".glb", ".gltf")


def read_mesh(path: str | PathLike[str]) -> TriangleMesh:
    """Triangle mesh of a PLY, OBJ, STL, OFF, GLB or GLTF file.

    Quadrilaterals are cut in two. Formats that repeat a triangle's corners (STL, textured OBJ and
    GLB) have corners of exactly equal position merged. Nothing else is changed or mended.

    Parameters
    ----------
    path : str or path

    Raises
    ------
    TypeError
        If ``path`` is no path.
    FileNotFoundError
        If there is no such file.
    MeshError
        If the file is of an unknown kind, damaged, or holds no triangles.
    """
    if not isinstance(path, (str, PathLike)):
        raise TypeError(f"path must be a file name, got {type(path).__name__}")
    file = Path(path)
    kind = file.suffix.lower()
    if not file.exists():
        raise FileNotFoundError(f"cannot read {file}: there is no such file")
    if not file.is_file():
        raise MeshError(f"cannot read {file}: it is not a file")
    if kind not in KINDS:
        raise MeshError(f"cannot read {file}: meshes come as {', '.join(KINDS)}, not as {kind or 'nothing'}")
    import trimesh

    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            found = trimesh.load_mesh(file, process=False, maintain_order=True)
        nodes, triangles = np.asarray(found.vertices), np.asarray(found.faces)
    except Exception as fault:  # whatever a damaged file makes the readers raise
        raise MeshError(f"cannot read {file}: it is damaged or no mesh ({fault!r:.200})") from None
    if not len(triangles):
        raise MeshError(f"cannot read {file}: it holds {len(nodes)} points but no triangles")
    if kind in SOUPS and np.isfinite(nodes).all():
        nodes, place = np.unique(nodes, axis=0, return_inverse=True)
        triangles = place.reshape(-1)[triangles]
    try:
        return TriangleMesh(nodes, triangles)
    except (TypeError, ValueError) as fault:
        raise MeshError(f"cannot read {file}: {fault}") from None
