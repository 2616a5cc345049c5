"""Parts of a foam that lie close together and face one way: what is out of sight is not drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.view.geometry import Geometry

# So many bubbles a part, and no more parts than these: each is one call of the graphics library.
_BUBBLES, _MOST = 12, 512
# How far normals count beside places: across a whole closed surface they differ by 2.
_NORMALS = 0.25


@dataclass(frozen=True, eq=False)
class Chunks:
    """Parts of a `Geometry` whose triangles and pieces of films stand in the order of these parts.

    Attributes
    ----------
    triangles, segments : (n + 1,) arrays of int
        Where the triangles and line pieces of each part start; the last is their number.
    balls : (n, 4) array
        Centre and radius of a ball that holds the part.
    cones : (n, 4) array
        Axis and cosine of the half-angle of a cone that holds the normals of its points and triangles;
        cosine −1 where there is none.
    """

    triangles: Ints
    segments: Ints
    balls: NDArray[np.float32]
    cones: NDArray[np.float32]


def parts_of_bubbles(centres: Floats, normals: Floats, disks: Bools) -> Ints:
    """Part (n_bubbles,) of each bubble, by halving along the widest side; what is no disk has its own.

    Examples
    --------
    >>> x = np.arange(96.0)
    >>> centres = np.stack([x, 0.0 * x, 0.0 * x], axis=1)
    >>> up = np.tile([0.0, 0.0, 1.0], (96, 1))
    >>> np.bincount(parts_of_bubbles(centres, up, x >= 0.0)).tolist()
    [12, 12, 12, 12, 12, 12, 12, 12]
    """
    size = float(np.ptp(centres, axis=0).max()) or 1.0
    traits = np.concatenate([centres / size, _NORMALS * normals], axis=1)
    groups = [np.flatnonzero(disks)]
    while len(groups) < _MOST and max(map(len, groups)) >= 2 * _BUBBLES:
        groups = [half for group in groups for half in _halves(traits, group)]
    groups += [np.array([place]) for place in np.flatnonzero(~disks)]
    part = np.zeros(len(centres), dtype=np.int64)
    for number, group in enumerate(group for group in groups if len(group)):
        part[group] = number
    return part


def _halves(traits: Floats, group: Ints) -> list[Ints]:
    if len(group) < 2 * _BUBBLES:
        return [group]
    widest = int(np.argmax(np.ptp(traits[group], axis=0)))
    order = group[np.argsort(traits[group, widest], kind="stable")]
    return [np.sort(order[: len(order) // 2]), np.sort(order[len(order) // 2 :])]


def in_chunks(mesh: Geometry, part: Ints) -> tuple[Geometry, Chunks]:
    """The mesh, its triangles and line pieces in the order of the parts of their bubbles, and the parts."""
    of_triangle = part[mesh.owner[mesh.triangles[:, 0]]]
    of_segment = part[mesh.beside[:, 0]]
    triangles = mesh.triangles[np.argsort(of_triangle, kind="stable")]
    order = np.argsort(of_segment, kind="stable")
    n = int(part.max()) + 1
    points, places, normals, owners = _samples(mesh, part)
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    np.minimum.at(low, places, points)
    np.maximum.at(high, places, points)
    centres = 0.5 * (low + high)
    radii = np.zeros(n)
    np.maximum.at(radii, places, np.linalg.norm(points - centres[places], axis=1))
    # what is drawn below the surface may lie outside its ball by as much
    deep = np.zeros(n)
    np.maximum.at(deep, part[mesh.owner], mesh.sunk)
    axes = np.stack([np.bincount(owners, normals[:, k], n) for k in range(3)], axis=1)
    lengths = np.linalg.norm(axes, axis=1, keepdims=True)
    axes = np.where(lengths > 0.0, axes / np.where(lengths > 0.0, lengths, 1.0), [0.0, 0.0, 1.0])
    cosines = np.ones(n)
    np.minimum.at(cosines, owners, np.einsum("pi,pi->p", normals, axes[owners]))
    cosines[deep > 0.0] = -1.0
    chunks = Chunks(
        np.concatenate([[0], np.cumsum(np.bincount(of_triangle, minlength=n))]),
        np.concatenate([[0], np.cumsum(np.bincount(of_segment, minlength=n))]),
        np.column_stack([centres, (radii + deep) * (1.0 + 1e-4)]).astype(np.float32),
        np.column_stack([axes, cosines - 1e-4]).astype(np.float32),
    )
    lines = (mesh.line_points, mesh.line_normals, mesh.segments[order], mesh.beside[order])
    return Geometry(
        mesh.points, mesh.normals, mesh.sunk, mesh.owner, mesh.curvature, triangles, *lines
    ), chunks


def _samples(mesh: Geometry, part: Ints) -> tuple[Floats, Ints, Floats, Ints]:
    """Points and unit normals of everything that is drawn, and the part of each."""
    ends, beside = mesh.segments.ravel(), np.repeat(part[mesh.beside[:, 0]], 2)
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    areas = np.linalg.norm(across, axis=1)
    # slivers say nothing of where they face
    fair = areas > 1e-6 * areas.max(initial=0.0)
    flat = across[fair] / areas[fair, None]
    of_points, of_flat = part[mesh.owner], part[mesh.owner[mesh.triangles[fair, 0]]]
    return (
        np.concatenate([mesh.points, mesh.line_points[ends]]),
        np.concatenate([of_points, beside]),
        np.concatenate([mesh.normals, mesh.line_normals[ends], flat]),
        np.concatenate([of_points, beside, of_flat]),
    )
