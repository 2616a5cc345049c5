"""Write triangle meshes."""

from __future__ import annotations

from pathlib import Path

from warpedfoam.arrays import as_instance
from warpedfoam.io.atomic import PathLike, atomic_binary, writable_path
from warpedfoam.surfaces.mesh import TriangleMesh


def write_mesh(path: PathLike, mesh: TriangleMesh) -> Path:
    """Write a triangle mesh as a binary PLY file, whole or not at all.

    Parameters
    ----------
    path : str or path
        Written under exactly this name.
    mesh : TriangleMesh

    Raises
    ------
    TypeError
        If ``mesh`` is not a TriangleMesh.
    FileNotFoundError, IsADirectoryError, ValueError
        If the path cannot be written.
    """
    target = writable_path(path)
    as_instance(mesh, "mesh", TriangleMesh)
    data = mesh.to_trimesh().export(file_type="ply", encoding="binary")
    assert isinstance(data, bytes)
    with atomic_binary(target) as stream:
        stream.write(data)
    return target
