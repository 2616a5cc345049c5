"""Write triangle meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpedfoam.arrays import as_instance
from warpedfoam.io.atomic import PathLike, atomic_binary, writable_path
from warpedfoam.surfaces.mesh import TriangleMesh


def write_mesh(path: PathLike, mesh: TriangleMesh) -> Path:
    """Write a triangle mesh as a binary PLY file in double precision, whole or not at all.

    Parameters
    ----------
    path : str or path
        Ends in ``.ply``; a file of that name is replaced.
    mesh : TriangleMesh

    Raises
    ------
    TypeError
        If ``mesh`` is not a TriangleMesh.
    FileNotFoundError, IsADirectoryError, ValueError
        If the path cannot be written or does not end in ``.ply``.
    """
    target = writable_path(path, suffixes=(".ply",))
    as_instance(mesh, "mesh", TriangleMesh)
    # not by trimesh, which writes single precision: nodes could fall together
    faces = np.empty(mesh.n_triangles, dtype=[("count", "u1"), ("nodes", "<i4", 3)])
    faces["count"], faces["nodes"] = 3, mesh.triangles
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment written by warpedfoam\n"
        f"element vertex {mesh.n_nodes}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {mesh.n_triangles}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with atomic_binary(target) as stream:
        stream.write(header.encode("ascii"))
        stream.write(mesh.nodes.astype("<f8").tobytes())
        stream.write(faces.tobytes())
    return target
