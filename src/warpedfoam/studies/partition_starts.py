"""Starts of a search for least partitions: Voronoi cells, circles, meridians."""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import ResolutionError
from warpedfoam.foam import Foam
from warpedfoam.studies.thomson import thomson_points
from warpedfoam.surfaces.protocol import Surface
from warpedfoam.tessellate import voronoi_foam

KINDS = ("thomson", "random", "blue")
#: Films in which a circle or a meridian is divided.
PIECES = 8


def start_foam(cell: HeleShawCell, n: int, index: int, rng: np.random.Generator, order: int) -> Foam:
    """The foam that start ``index`` begins with.

    Two and three bubbles on a closed surface without handles: a great circle, three meridians, about a
    random axis. Otherwise in turn Voronoi cells of repelling points (of a random exponent from 1 to 6),
    of random points, and of blue noise.

    Raises
    ------
    ResolutionError
        If the bubbles would not be disks.
    """
    surface = cell.surface
    if n < 4 and surface.euler_characteristic == 2 and surface.rim is None and surface.period is None:
        return _meridians(cell, n, rng, order) if n == 3 else _circle(cell, rng, order)
    kind = start_kind(surface, n, index)
    if kind == "thomson":
        exponent = float(rng.uniform(1.0, 6.0))
        seeds: str | Floats = thomson_points(surface, n, seed=rng, exponent=exponent, tolerance=1e-4).points
    else:
        seeds = kind
    return voronoi_foam(cell, n, seeds=seeds, seed=rng, order=order)


def start_kind(surface: Surface, n: int, index: int) -> str:
    """``"circle"``, ``"meridians"``, ``"thomson"``, ``"random"`` or ``"blue"``."""
    if n < 4 and surface.euler_characteristic == 2 and surface.rim is None and surface.period is None:
        return "meridians" if n == 3 else "circle"
    return KINDS[index % len(KINDS)]


def _axes(rng: np.random.Generator) -> Floats:
    """Three random orthonormal vectors, right-handed, as rows."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    out: Floats = q.T * np.linalg.det(q)
    return out


def _circle(cell: HeleShawCell, rng: np.random.Generator, order: int) -> Foam:
    """Two bubbles on either side of a plane through the middle."""
    x, y, _ = _axes(rng)
    angle = 2.0 * np.pi * np.arange(PIECES) / PIECES
    points = np.outer(np.cos(angle), x) + np.outer(np.sin(angle), y)
    ring = list(range(PIECES))
    return _equal(cell, points, [ring, ring[::-1]], order)


def _meridians(cell: HeleShawCell, n: int, rng: np.random.Generator, order: int) -> Foam:
    """``n`` lunes round a random axis."""
    x, y, z = _axes(rng)
    polar = np.pi * np.arange(1, PIECES) / PIECES
    around = 2.0 * np.pi * np.arange(n)[:, None] / n
    points = np.concatenate(
        [
            z[None],
            -z[None],
            (
                (np.cos(around) * np.sin(polar))[..., None] * x
                + (np.sin(around) * np.sin(polar))[..., None] * y
                + np.broadcast_to(np.cos(polar), (n, PIECES - 1))[..., None] * z
            ).reshape(-1, 3),
        ]
    )
    lines = 2 + np.arange(n * (PIECES - 1)).reshape(n, -1)
    loops = [[0, *lines[k].tolist(), 1, *lines[(k + 1) % n, ::-1].tolist()] for k in range(n)]
    return _equal(cell, points, loops, order)


def _equal(cell: HeleShawCell, points: Floats, loops: list[list[int]], order: int) -> Foam:
    surface = cell.surface
    middle = surface.mesh.nodes.mean(axis=0)
    try:
        return Foam.from_loops(
            cell,
            middle + 0.5 * surface.size * points,
            loops,
            order=order,
            target_volumes=np.full(len(loops), cell.volume / len(loops)),
        )
    except ValueError as fault:
        raise ResolutionError(f"{len(loops)} bubbles cannot be laid out on this surface: {fault}") from fault
