"""Geodesic circles as isolines of distances on a mesh: exact ones on facets, or the heat method's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.errors import ResolutionError
from warpedfoam.studies.mesh_disk import MeshDisk, finer, mesh_disk
from warpedfoam.surfaces.protocol import Surface
from warpedfoam.tessellate.exact_geodesics import exact_distances
from warpedfoam.tessellate.geodesics import TIME_FACTOR, geodesic_report

#: Fewest edges from the centre to the circle.
FEWEST = 2.5
#: Error estimates of extrapolated values, in units of what extrapolation added.
SAFETY = 3.0


@dataclass(frozen=True, eq=False)
class Isoline:
    """Points (n, 3) in order, length, area inside, mean error of the distance there (0 if unknown)."""

    points: Floats
    perimeter: float
    area: float
    offset: float


def exact_circle(
    surface: Surface, centre: Floats, radius: float, spacing: float
) -> tuple[Isoline, float, float, float]:
    """Isoline of exact distances on facets, its C and A extrapolated to no facets at all.

    Facets make distances short by a share of h² k², so that values at h and at h/2 give those at 0:
    (4 C(h/2) − C(h))/3.

    Returns
    -------
    tuple
        The isoline at h/2 with extrapolated C and A, the errors of both, and the edge length h.
    """
    disk = mesh_disk(surface, centre, 1.02 * radius, spacing)
    edge = _resolved(disk, radius)
    coarse = _isoline(surface, disk, _exact(disk, centre, radius), radius, 0.0)
    fine_disk = finer(surface, disk)
    fine = _isoline(surface, fine_disk, _exact(fine_disk, centre, radius), radius, 0.0)
    gains = (fine.perimeter - coarse.perimeter) / 3.0, (fine.area - coarse.area) / 3.0
    out = Isoline(fine.points, fine.perimeter + gains[0], fine.area + gains[1], 0.0)
    # what is left is of order h⁴, a fraction of what was added; but on saddles the h² parts of different
    # directions cancel, so both gains count for both, with room
    error = SAFETY * (abs(gains[0]) + abs(gains[1]) / radius)
    return out, error, radius * error, edge


def heat_circle(
    surface: Surface, centre: Floats, radius: float, spacing: float
) -> tuple[Isoline, float, float, float]:
    """Isoline of libigl's heat distances; its errors are what the distances are estimated to be off by."""
    # wide enough that the rim, where heat is reflected, does not matter
    disk = mesh_disk(surface, centre, 1.5 * radius + 4.0 * spacing, spacing)
    edge = _resolved(disk, radius)
    mesh = disk.doubled()
    mesh.require_closed_surface()
    time = TIME_FACTOR * mesh.mean_edge**2
    report = geodesic_report(mesh, centre[None], time, method="heat")
    mirror = disk.mirror
    nearer = np.where(
        report.distances[mirror] < report.distances[: len(mirror)], mirror, np.arange(len(mirror))
    )
    distances, errors = report.distances[nearer], report.error[nearer]
    line = np.abs(distances - radius) < disk.lengths.max()
    offset = float(errors[line].mean()) if line.any() else float(errors.max())
    found = _isoline(surface, disk, distances, radius, offset)
    return found, 2.0 * np.pi * offset, found.perimeter * offset, edge


def _resolved(disk: MeshDisk, radius: float) -> float:
    edge = float(disk.lengths.mean())
    if radius < FEWEST * edge:
        raise ResolutionError(
            f"radius must be at least {FEWEST:g} edges, {FEWEST * edge:.3g} with edges of {edge:.3g}, got "
            f"{radius:g}; take a smaller spacing"
        )
    return edge


def _exact(disk: MeshDisk, centre: Floats, radius: float) -> Floats:
    found = exact_distances(disk.doubled(), centre[None], radius + 1.5 * float(disk.lengths.max()))
    mirror = disk.mirror
    out: Floats = np.minimum(found[: len(mirror)], found[mirror])
    return out


def _isoline(surface: Surface, disk: MeshDisk, distances: Floats, radius: float, offset: float) -> Isoline:
    """The set at distance ``radius``, if it is one closed curve.

    On an edge of length e, d² = (1 − s) d_A² + s d_B² − s (1 − s) e², as in the plane. Chords c become
    arcs by c (1 + κ² c²/24), with κ² = 1/ρ² (geodesic) + κ_n² (normal curvature).

    Raises
    ------
    ValueError
        If it is none, or several.
    """
    inside: Bools = distances <= radius
    a, b = disk.edges.T
    cut = inside[a] != inside[b]
    if not cut.any():
        raise ValueError(f"radius must be smaller, got {radius:g}: no point of the surface is that far away")
    several = (
        f"radius must be smaller, got {radius:g}: the points at that distance do not make one closed curve, "
        "so that it exceeds the injectivity radius (or the mesh does not resolve it)"
    )
    if (cut & disk.rim).any():
        raise ValueError(several)
    near, far = np.where(inside[a], a, b)[cut], np.where(inside[a], b, a)[cut]
    square = ((disk.nodes[far] - disk.nodes[near]) ** 2).sum(axis=1)
    low, high = distances[near] ** 2 - radius**2, distances[far] ** 2 - radius**2
    slope = high - low - square
    share = (-slope + np.sqrt(np.maximum(slope**2 - 4.0 * square * low, 0.0))) / (2.0 * square)
    share = np.clip(share, 0.0, 1.0)
    flat = disk.nodes[near] + share[:, None] * (disk.nodes[far] - disk.nodes[near])
    index = np.full(len(cut), -1)
    index[cut] = np.arange(int(cut.sum()))
    of_triangle = index[disk.sides]
    crossed: Bools = np.asarray((of_triangle >= 0).any(axis=1))
    pairs = np.sort(of_triangle[crossed], axis=1)[:, 1:]
    order = _in_order(pairs, len(flat))
    if order is None:
        raise ValueError(several)
    points = surface.project(flat[order])
    side = np.roll(points, -1, axis=0) - points
    chord = np.linalg.norm(side, axis=1)
    kept = chord > 0.0
    bend = np.einsum("nx,nxy,ny->n", side, surface.shape_operators(points, project=False), side)
    normal = np.where(kept, bend / np.where(kept, chord, 1.0) ** 2, 0.0)
    perimeter = float((chord * (1.0 + chord**2 * (radius**-2 + normal**2) / 24.0)).sum())
    area = _area(disk, inside, crossed, of_triangle, flat) + float((chord**3).sum()) / (12.0 * radius)
    return Isoline(points, perimeter, area, offset)


def _in_order(pairs: Ints, count: int) -> Ints | None:
    """Indices along the one closed chain that the pairs make, or None."""
    links = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(count, count))
    pieces, _ = connected_components(links, directed=False)
    if pieces != 1 or len(pairs) != count or (np.bincount(pairs.ravel(), minlength=count) != 2).any():
        return None
    beside = np.argsort(pairs.ravel(), kind="stable").reshape(count, 2)
    other = pairs[beside // 2, 1 - beside % 2]
    order, before = [0], -1
    while len(order) < count:
        one, two = other[order[-1]]
        order, before = [*order, int(two if one == before else one)], order[-1]
    return np.array(order)


def _area(disk: MeshDisk, inside: Bools, crossed: Bools, of_triangle: Ints, flat: Floats) -> float:
    """Area of the facets, and parts of facets, inside the isoline."""
    corners = disk.nodes[disk.triangles]
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    within = inside[disk.triangles]
    total = float(doubled[within.all(axis=1)].sum())
    tri, marks, at = disk.triangles[crossed], within[crossed], of_triangle[crossed]
    # the corner that is alone on its side of the line, and the crossings of the two edges that leave it
    alone = np.where(marks.sum(axis=1) == 1, marks.argmax(axis=1), (~marks).argmax(axis=1))
    rows = np.arange(len(tri))
    tip = disk.nodes[tri[rows, alone]]
    first, second = flat[at[rows, alone]], flat[at[rows, (alone + 2) % 3]]
    tips = np.linalg.norm(np.cross(first - tip, second - tip), axis=1)
    single = marks.sum(axis=1) == 1
    return 0.5 * (total + float(tips[single].sum()) + float((doubled[crossed] - tips)[~single].sum()))
