"""Small foams for the tests of files and pictures, built without the tessellation."""

from __future__ import annotations

import numpy as np

from warpedfoam import CellNetwork, Foam, HeleShawCell, Sphere, Torus


def sphere_foam(n_bubbles: int = 40, *, radius: float = 2.0, seed: int = 0, even: bool = False) -> Foam:
    """Voronoi foam of random (or evenly spread) seeds on a sphere."""
    from scipy.spatial import SphericalVoronoi

    sphere = Sphere(radius)
    seeds = sphere.lattice_points(n_bubbles) if even else sphere.random_points(n_bubbles, seed)
    regions = SphericalVoronoi(seeds, radius)
    regions.sort_vertices_of_regions()
    loops = []
    for region, middle in zip(regions.regions, seeds, strict=True):
        a, b = regions.vertices[region[:2]]
        loops.append(region if np.cross(a, b) @ middle > 0 else region[::-1])
    return Foam.from_loops(HeleShawCell(sphere, gap=0.1), regions.vertices, loops)


def torus_foam(
    rows: int = 6, columns: int = 16, *, major_radius: float = 3.0, minor_radius: float = 1.2
) -> Foam:
    """Bricks of six sides: ``rows`` (even) round the tube, ``columns`` round the ring."""
    torus = Torus(major_radius, minor_radius)
    row, column = (g.ravel() for g in np.meshgrid(np.arange(rows), np.arange(2 * columns), indexing="ij"))
    wave = 0.15 * np.where((row + column) % 2 == 0, 1.0, -1.0)
    points = torus.points((row + wave) * 2 * np.pi / rows, column * np.pi / columns)

    def corner(i: int, j: int) -> int:
        return (i % rows) * 2 * columns + j % (2 * columns)

    # seen from outside θ grows to the right and φ upwards
    loops = []
    for i in range(rows):
        for k in range(columns):
            j = 2 * k + i % 2
            below = [corner(i, j + s) for s in (0, 1, 2)]
            above = [corner(i + 1, j + s) for s in (0, 1, 2)]
            loops.append(below + above[::-1])
    return Foam.from_loops(HeleShawCell(torus, gap=0.2), points, loops)


def with_pressures(foam: Foam) -> Foam:
    """The foam with made-up pressures and ids, to tell columns apart."""
    n = foam.n_bubbles
    return Foam(
        foam.cell,
        foam.network,
        foam.vertex_points,
        foam.film_offsets + 0.02 * np.sin(np.arange(foam.film_offsets.size)).reshape(foam.film_offsets.shape),
        bubble_ids=1000 + 3 * np.arange(n),
        tension=0.7,
        pressures=np.cos(np.arange(n)) / 3.0,
        seed=2**70,
    )


def resized(foam: Foam, scale: float) -> Foam:
    """A foam on a sphere, all lengths times ``scale``."""
    assert isinstance(foam.cell.surface, Sphere)
    cell = HeleShawCell(Sphere(foam.cell.surface.radius * scale), foam.cell.mean_gap * scale)
    pressures = None if foam.pressures is None else foam.pressures / scale
    return Foam(cell, foam.network, foam.vertex_points * scale, foam.film_offsets, pressures=pressures)


def lone_bubble(height: float = 0.8) -> Foam:
    """A round bubble at the north pole of the unit sphere, and the rest of the sphere."""
    rho = np.sqrt(1.0 - height**2)
    angle = 2.0 * np.pi * np.arange(3) / 3.0
    points = np.stack([rho * np.cos(angle), rho * np.sin(angle), np.full(3, height)], axis=1)
    return Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.1), points, [(0, 1, 2), (0, 2, 1)])


def bubble_on_torus() -> Foam:
    """One small disk on a torus; its exterior is no disk (Euler number −1)."""
    torus = Torus(3.0, 1.2)
    angle = 2.0 * np.pi * np.arange(3) / 3.0
    points = torus.points(0.4 * np.sin(angle), 0.2 * np.cos(angle))
    disk = CellNetwork([2, 5, 4, 1, 0, 3], [0, 1, 1, 2, 2, 0], [0, 1, 0, 1, 0, 1], [1, -1])
    cell = HeleShawCell(torus, gap=0.2)
    small = 0.01 * cell.volume
    return Foam(cell, disk, points, np.zeros((3, 3)), [small, cell.volume - small])
