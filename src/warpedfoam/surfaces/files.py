"""Read triangle meshes from files, by trimesh."""

from __future__ import annotations

import re
import warnings
from os import PathLike
from pathlib import Path

import numpy as np

from warpedfoam.errors import MeshError
from warpedfoam.surfaces.mesh import TriangleMesh

#: Kinds of files by their endings, and those that write each triangle's corners anew.
KINDS = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")
SOUPS = (".stl", ".obj", ".glb", ".gltf")
#: Kinds that may name files of materials.
LINKED = (".ply", ".obj")
#: Bytes in which a header must end for its counts to be looked at.
HEAD = 65536


def read_mesh(path: str | PathLike[str]) -> TriangleMesh:
    """Triangle mesh of a PLY, OBJ, STL, OFF, GLB or GLTF file.

    Quadrilaterals are cut in two. Formats that repeat a triangle's corners (STL, textured OBJ and
    GLB) have corners of exactly equal position merged; nodes keep the order in which they first appear.
    Nothing else is changed or mended.

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
        If the file is of an unknown kind, damaged, cut short, or holds no triangles.
    OSError
        If it cannot be opened.
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
    if not file.stat().st_size:
        raise MeshError(f"cannot read {file}: it is empty")
    with file.open("rb") as stream:  # an OSError speaks for itself
        head = stream.read(HEAD)
    import trimesh

    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            # materials name other files: a mesh needs none of them
            found = trimesh.load_mesh(
                file,
                process=False,
                maintain_order=True,
                **({"skip_materials": True} if kind in LINKED else {}),
            )
        nodes, triangles = np.asarray(found.vertices), np.asarray(found.faces)
    except Exception as fault:  # whatever a damaged file makes the readers raise
        said = ascii(f"{type(fault).__name__}: {fault!s:.200}" if str(fault) else type(fault).__name__)[1:-1]
        raise MeshError(
            f"cannot read {file}: it is damaged or cut short, or no {kind[1:].upper()} mesh ({said:.200})"
        ) from None
    promised = _promised(kind, head)
    if promised and (promised[0] > len(nodes) or promised[1] > len(triangles)):
        raise MeshError(
            f"cannot read {file}: it promises {promised[0]} nodes and {promised[1]} faces but holds "
            f"{len(nodes)} and {len(triangles)}: it is damaged or was cut short"
        )
    if not len(triangles):
        raise MeshError(
            f"cannot read {file}: it holds {len(nodes)} points but no triangles; "
            + ("save its faces too" if len(nodes) else f"it is damaged, or no {kind[1:].upper()} mesh")
        )
    # what is out of range is refused below
    named = triangles.min() >= 0 and triangles.max() < len(nodes)
    if kind in SOUPS and named and np.isfinite(nodes).all():
        # + 0.0: the two zeros are one place
        _, first, place = np.unique(nodes + 0.0, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)
        nodes = nodes[first[order]]
        triangles = np.argsort(order)[place.reshape(-1)][triangles]
    try:
        return TriangleMesh(nodes, triangles)
    except (TypeError, ValueError) as fault:
        raise MeshError(f"cannot read {file}: {fault}") from None


def _promised(kind: str, head: bytes) -> tuple[int, int] | None:
    """Numbers of nodes and faces in the header; the readers of text take files that were cut short."""
    if kind == ".ply":
        head = head.partition(b"end_header")[0]
        counts = [re.search(rb"element\s+%s\s+(\d+)" % name, head) for name in (b"vertex", b"face")]
        if counts[0] and counts[1]:
            return int(counts[0][1]), int(counts[1][1])
    if kind == ".off":
        found = re.match(rb"\s*OFF\s+(\d+)\s+(\d+)\s", re.sub(rb"#[^\n]*", b"", head))
        if found:
            return int(found[1]), int(found[2])
    return None
