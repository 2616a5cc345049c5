"""The geodesic 120° nets of the unit sphere, built from seeds at their bubbles' centres.

Lengths are the closed forms (tetrahedron, cube, dodecahedron) or their known values to eight decimals;
a bubble of n sides has area (6 − n) π/3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import SphericalVoronoi

import warpedfoam as wf


@dataclass(frozen=True)
class Net:
    """A net: seeds of its bubbles, total length, and (length, how many) of its films."""

    name: str
    seeds: np.ndarray
    length: float
    films: tuple[tuple[float, int], ...]
    check_order: int = 8

    @property
    def n_bubbles(self) -> int:
        return len(self.seeds)

    def foam(self, gap: float, order: int) -> wf.Foam:
        """The Voronoi network of the seeds with the net's areas to hold."""
        cell = wf.HeleShawCell(wf.Sphere(1.0), gap)
        foam = spherical_voronoi_foam(cell, self.seeds, order)
        targets = foam.network.charges * (np.pi / 3.0) * cell.volume / (4.0 * np.pi)
        return wf.Foam(cell, foam.network, foam.vertex_points, foam.film_offsets, targets)


def spherical_voronoi_foam(cell: wf.HeleShawCell, seeds: np.ndarray, order: int = 4) -> wf.Foam:
    """Foam of SciPy's spherical Voronoi cells on a unit sphere."""
    diagram = SphericalVoronoi(seeds)
    diagram.sort_vertices_of_regions()
    loops = []
    for seed, region in zip(seeds, diagram.regions, strict=True):
        corners = diagram.vertices[region]
        area = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        loops.append(region if area @ seed > 0 else region[::-1])
    return wf.Foam.from_loops(cell, diagram.vertices, loops, order=order)


def _rings(*rings: tuple[float, int, float]) -> np.ndarray:
    """Unit vectors in rings (z, count, turn); the turn is in steps of the ring."""
    points = []
    for z, count, turn in rings:
        angle = 2.0 * np.pi * (np.arange(count) + turn) / count
        rho = np.sqrt(1.0 - z * z)
        points.append(np.stack([rho * np.cos(angle), rho * np.sin(angle), np.full(count, z)], axis=1))
    return np.concatenate(points)


_Z5 = 1.0 / np.sqrt(5.0)
NETS = (
    Net("tetrahedron", _rings((1.0, 1, 0), (-1 / 3, 3, 0)), 6 * np.arccos(-1 / 3), ((1.910633, 6),), 20),
    Net(
        "triangular prism",
        _rings((1.0, 1, 0), (0.0, 3, 0), (-1.0, 1, 0)),
        13.50282087,
        ((1.910633, 6), (0.679674, 3)),
        20,
    ),
    Net("cube", _rings((1.0, 1, 0), (0.0, 4, 0), (-1.0, 1, 0)), 12 * np.arccos(1 / 3), ((1.230959, 12),), 12),
    Net(
        "pentagonal prism",
        _rings((1.0, 1, 0), (0.0, 5, 0), (-1.0, 1, 0)),
        16.48165843,
        ((0.729728, 10), (1.836876, 5)),
        20,
    ),
    Net(
        "4 squares + 4 pentagons",
        _rings((0.78, 2, 0), (0.2, 2, 0.5), (-0.2, 2, 0), (-0.78, 2, 0.5)),
        17.85650824,
        ((1.462615, 6), (1.016774, 8), (0.236657, 4)),
        16,
    ),
    Net(
        "3 squares + 6 pentagons",
        _rings((0.71, 3, 0), (0.0, 3, 0.5), (-0.71, 3, 0)),
        19.01567686,
        ((1.230959, 12), (0.615480, 6), (0.183762, 3)),
        12,
    ),
    Net(
        "2 squares + 8 pentagons",
        _rings((1.0, 1, 0), (0.4, 4, 0), (-0.4, 4, 0.5), (-1.0, 1, 0)),
        20.16279829,
        ((0.915397, 8), (0.373993, 8), (1.230959, 8)),
        12,
    ),
    Net(
        "dodecahedron",
        _rings((1.0, 1, 0), (_Z5, 5, 0), (-_Z5, 5, 0.5), (-1.0, 1, 0)),
        30 * 0.7297276562269663,
        ((0.729728, 30),),
        10,
    ),
)


def hemispheres(gap: float, n_markers: int, order: int, tilt: float, share: float = 0.5) -> wf.Foam:
    """Two bubbles that share a closed film of ``n_markers`` pieces, wobbling by ``tilt``."""
    cell = wf.HeleShawCell(wf.Sphere(1.0), gap)
    angle = 2.0 * np.pi * np.arange(n_markers) / n_markers
    z = 1.0 - 2.0 * share + tilt * np.where(np.arange(n_markers) % 2, 1.0, -0.7)
    rho = np.sqrt(1.0 - z * z)
    points = np.stack([rho * np.cos(angle), rho * np.sin(angle), z], axis=1)
    around = list(range(n_markers))
    targets = cell.volume * np.array([share, 1.0 - share])
    return wf.Foam.from_loops(cell, points, [around, around[::-1]], order=order, target_volumes=targets)


def lunes(gap: float, order: int, noise: float) -> wf.Foam:
    """Three lunes between two poles, each meridian divided by a marker off its middle."""
    cell = wf.HeleShawCell(wf.Sphere(1.0), gap)
    angle = 2.0 * np.pi * np.arange(3) / 3 + noise * np.array([0.0, 1.0, -1.0])
    z = noise * np.array([1.0, -1.0, 0.5])
    rho = np.sqrt(1.0 - z * z)
    middle = np.stack([rho * np.cos(angle), rho * np.sin(angle), z], axis=1)
    points = np.concatenate([[[noise, 0.0, 1.0], [0.0, noise, -1.0]], middle])
    loops = [[0, 2 + k, 1, 2 + (k + 1) % 3] for k in range(3)]
    targets = np.full(3, cell.volume / 3.0)
    return wf.Foam.from_loops(cell, points, loops, order=order, target_volumes=targets)
