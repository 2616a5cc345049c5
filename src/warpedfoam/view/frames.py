"""One foam as bytes that the page reads: arrays one after the other, compressed, in base64."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import Floats, Ints
from warpedfoam.foam import Foam
from warpedfoam.view.chunks import Chunks
from warpedfoam.view.geometry import Geometry
from warpedfoam.view.scalars import Scalar

# Positions are 16-bit fractions of a cube, which is 1e-5 of the picture; normals are bytes.
_STEPS = 65535
# Arrays start at multiples of this, as typed arrays in a browser must.
_ALIGN = 8

Arrays = Mapping[str, NDArray[Any]]


def bounding_cube(meshes: Sequence[Geometry]) -> tuple[Floats, float]:
    """Lowest corner and side of a cube that holds all points."""
    points = [part for g in meshes for part in (g.points, g.line_points)]
    low = np.min([part.min(axis=0) for part in points], axis=0)
    high = np.max([part.max(axis=0) for part in points], axis=0)
    side = float((high - low).max())
    return 0.5 * (low + high - side), side


def frame_arrays(
    foam: Foam,
    meshes: Sequence[tuple[Geometry, Chunks]],
    scalars: Sequence[Scalar],
    frame: int,
    cube: tuple[Floats, float],
) -> dict[str, NDArray[Any]]:
    """Arrays of frame number ``frame``; whole numbers that mostly rise evenly as their differences.

    ``meshes`` are the foam in one or more degrees of detail, finest first.
    """
    network = foam.network
    arrays: dict[str, NDArray[Any]] = {
        "pairs": _steps(np.stack([network.left, network.right])),
        "ids": foam.bubble_ids.astype(np.float64),
        "euler": network.bubble_euler.astype(np.int32),
        "targets": foam.target_volumes.astype(np.float64),
        "centres": foam.bubble_centres.astype(np.float64),
        "facing": foam.cell.surface.normals(foam.bubble_centres).astype(np.float32),
    }
    for scalar in scalars:
        if scalar.name not in ("surface", "id"):
            arrays[f"value:{scalar.name}"] = scalar.values[frame].astype(np.float64)
        if scalar.name != "surface":
            arrays[f"rgb:{scalar.name}"] = scalar.rgb[frame]
    (curvature,) = (s for s in scalars if s.name == "surface")
    for number, (mesh, chunks) in enumerate(meshes):
        found = _mesh_arrays(mesh, curvature.limits, cube) | _chunk_arrays(chunks)
        for name, array in found.items():
            arrays[f"mesh{number}:{name}"] = array
    return arrays


def _mesh_arrays(
    mesh: Geometry, limits: tuple[float, float], cube: tuple[Floats, float]
) -> dict[str, NDArray[Any]]:
    low, high = limits
    # limits that differ by round-off only are one value, in the middle of the colour bar
    wide = high - low > 1e-9 * max(-low, high)
    share = (mesh.curvature - low) / (high - low) if wide else np.full(len(mesh.points), 0.5)
    n_lines = len(mesh.line_points)
    return {
        "points": _placed(mesh.points, share, cube),
        "normals": _directions(mesh.normals, mesh.sunk > 0.0),
        "owner": _steps(mesh.owner),
        "triangles": _steps(mesh.triangles.T),
        "line_points": _placed(mesh.line_points, np.zeros(n_lines), cube),
        "line_normals": _directions(mesh.line_normals, np.zeros(n_lines, dtype=bool)),
        "segments": _steps(mesh.segments.T),
        "beside": _steps(mesh.beside.T),
    }


def _chunk_arrays(chunks: Chunks) -> dict[str, NDArray[Any]]:
    return {
        "chunk_triangles": chunks.triangles.astype(np.int32),
        "chunk_segments": chunks.segments.astype(np.int32),
        "chunk_balls": chunks.balls,
        "chunk_cones": chunks.cones,
    }


def packed(arrays: Arrays) -> tuple[list[list[Any]], str]:
    """Layout (name, type, start, length of each array) and the bytes in base64 after zlib.

    Examples
    --------
    >>> layout, text = packed({"a": np.array([1, 2, 3], dtype=np.uint8), "b": np.array([0.5])})
    >>> layout
    [['a', 'uint8', 0, 3], ['b', 'float64', 8, 1]]
    >>> unpacked(layout, text)["b"].tolist()
    [0.5]
    """
    layout: list[list[Any]] = []
    parts, start = [], 0
    for name, array in arrays.items():
        little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
        raw = little.tobytes()
        layout.append([name, array.dtype.name, start, array.size])
        padding = -len(raw) % _ALIGN
        parts += [raw, bytes(padding)]
        start += len(raw) + padding
    return layout, base64.b64encode(zlib.compress(b"".join(parts), 6)).decode("ascii")


def unpacked(layout: Sequence[Sequence[Any]], text: str) -> dict[str, NDArray[Any]]:
    """The arrays of `packed`, flat."""
    raw = zlib.decompress(base64.b64decode(text))
    return {
        name: np.frombuffer(raw, np.dtype(kind).newbyteorder("<"), count, start)
        for name, kind, start, count in layout
    }


def _placed(points: Floats, fourth: Floats, cube: tuple[Floats, float]) -> NDArray[np.uint16]:
    low, side = cube
    inside = np.column_stack([(points - low) / side, fourth])
    return np.round(np.clip(inside, 0.0, 1.0) * _STEPS).astype(np.uint16)


def _directions(normals: Floats, flag: NDArray[np.bool_]) -> NDArray[np.int8]:
    return np.round(127.0 * np.column_stack([normals, flag])).astype(np.int8)


def _steps(values: Ints) -> NDArray[np.int32]:
    """Differences along the last axis, from 0: long runs of the same number, which compress well."""
    zero = np.zeros((*values.shape[:-1], 1), dtype=np.int64)
    return np.diff(values, axis=-1, prepend=zero).astype(np.int32)
