"""`voronoi_foam`: the geodesic Voronoi cells of seeds, as a foam."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import (
    Floats,
    Ints,
    as_choice,
    as_floats,
    as_generator,
    as_instance,
    as_integer,
    as_number,
)
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import ResolutionError
from warpedfoam.foam import MAX_ORDER, Foam, bubble_integrals
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.places import Places
from warpedfoam.surfaces.protocol import Layer
from warpedfoam.tessellate.fields import SeedFields, heat_solver, seed_fields
from warpedfoam.tessellate.geodesics import COLOUR_TIME_FACTOR
from warpedfoam.tessellate.power import power_weights
from warpedfoam.tessellate.regions import (
    RegionNetwork,
    corner_weights,
    opened_rings,
    region_network,
    tidy_labels,
)
from warpedfoam.tessellate.seeds import blue_noise_seeds, check_seeds, lattice_seeds, random_seeds

#: Mesh nodes per bubble, the fewest nodes of a mesh, and how often it is refined if too coarse.
NODES_PER_BUBBLE, LEAST_NODES, REFINEMENTS = 24, 4000, 2
TOO_LONG = "a film would be too long for the surface: it spans half a turn or more"
#: Beyond these memory ends before patience does.
MOST_NODES, MOST_BUBBLES = 5_000_000, 200_000
SEED_KINDS = ("random", "blue", "lattice")
CELL_KINDS = ("voronoi", "power")


def voronoi_foam(
    cell: HeleShawCell,
    n_bubbles: int | None = None,
    *,
    seeds: str | ArrayLike = "random",
    seed: int | np.random.Generator = 0,
    lloyd: int = 0,
    volumes: float | ArrayLike | None = None,
    cells: str = "voronoi",
    n_nodes: int | None = None,
    order: int = 4,
    progress: Callable[[str, float], None] | None = None,
) -> Foam:
    """Foam of the geodesic Voronoi cells of seeds on the cell's inner plate.

    Distances come from the heat method, one solve for each colour of seeds, on the whole mesh by libigl
    or, from 40 000 nodes on, domain by domain (see `warpedfoam.tessellate.domains`); mesh nodes go to
    their nearest seed, films to where d² is equal, interpolated linearly along mesh edges. The
    cells' volumes are what they are; `warpedfoam.relax` brings them to the volumes asked for.

    Parameters
    ----------
    cell : HeleShawCell
    n_bubbles : int, optional
        At least 4; not needed if ``seeds`` is an array.
    seeds : {"random", "blue", "lattice"} or (n, 3) array, optional
        Uniformly random points (default), blue noise, an even deterministic lattice, or points on
        the surface.
    seed : int or numpy.random.Generator, optional
        Source of all randomness.
    lloyd : int, optional
        Sweeps that move each seed to the centre of its cell.
    volumes : float or (n,) array, optional
        Target volumes: equal (default), an array that adds up to the cell's volume, or the width of
        a log-normal distribution (standard deviation of ln V).
    cells : {"voronoi", "power"}, optional
        Power cells hold the target volumes to a few percent from the start, which saves a polydisperse
        foam most of the way (see `warpedfoam.tessellate.power`); even seeds suit them best.
    n_nodes : int, optional
        Nodes of the mesh that carries the distances; by default 24 per bubble (at least 4000),
        refined by itself where that is too coarse.
    order : int, optional
        Polynomial order p of the films.
    progress : callable, optional
        Called as ``progress("build", fraction)``.

    Returns
    -------
    Foam

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range; volumes that do not add up.
    ResolutionError
        If bubbles would not be disks (too few for the surface) or the mesh is too coarse.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=12, seeds="lattice")
    >>> int(foam.network.charges.sum())
    12
    """
    as_instance(cell, "cell", HeleShawCell)
    rng = as_generator(seed)
    points = _seed_points(cell, n_bubbles, seeds, rng)
    count = len(points)
    sweeps = as_integer(lloyd, "lloyd", minimum=0, maximum=1000)
    targets = _target_volumes(cell, count, volumes, rng)
    power = as_choice(cells, "cells", CELL_KINDS) == "power"
    p = as_integer(order, "order", minimum=2, maximum=MAX_ORDER)
    fixed = None if n_nodes is None else as_integer(n_nodes, "n_nodes", minimum=100, maximum=MOST_NODES)
    if fixed is not None and fixed < 6 * count:
        raise ResolutionError(
            f"n_nodes = {fixed} is too coarse for {count} bubbles; use at least {6 * count}, "
            f"better {NODES_PER_BUBBLE * count}"
        )
    if cell.surface.rim is None and cell.surface.euler_characteristic > 0 and count < 4:
        raise ResolutionError(
            f"n_bubbles must be at least 4 on a closed surface without handles, got {count}; "
            "two hemispheres and three lunes can be built with Foam.from_loops"
        )
    if 9 * count < _fitting(cell):
        raise ResolutionError(
            f"too few bubbles for the surface: {count} would not be disks but reach round its tightest "
            "circle. "
            f"{_advice(cell, count, 0)}"
        )
    nodes = fixed or max(LEAST_NODES, NODES_PER_BUBBLE * count)
    attempts = 1 if fixed is not None else 1 + REFINEMENTS
    for attempt in range(attempts):
        try:
            return _built(
                cell,
                points,
                targets,
                nodes,
                sweeps,
                p,
                power,
                None if isinstance(seed, np.random.Generator) else int(seed),
                progress,
            )
        except ResolutionError as fault:
            if attempt == attempts - 1:
                raise ResolutionError(f"{fault}. {_advice(cell, count, nodes)}") from None
            nodes *= 2
    raise AssertionError("unreachable")


def _built(
    cell: HeleShawCell,
    points: Floats,
    targets: Floats,
    n_nodes: int,
    sweeps: int,
    order: int,
    power: bool,
    seed: int | None,
    progress: Callable[[str, float], None] | None,
) -> Foam:
    surface, count = cell.surface, len(points)
    mesh = surface.triangulate(n_nodes)
    heat = heat_solver(mesh, COLOUR_TIME_FACTOR * mesh.mean_edge**2)
    spacing = float(np.sqrt(surface.area / count))
    rounds = sweeps + 1

    def fields(at: Floats, done: int) -> SeedFields:
        told = None if progress is None else lambda share: progress("build", (done + share) / rounds)
        return seed_fields(heat, at, spacing, told)

    for sweep in range(sweeps):
        points = _centres(cell, mesh, fields(points, sweep).labels(), points)
    field = fields(points, sweeps)
    if power:
        field = field.weighted(power_weights(field, points, _node_volumes(cell, mesh), targets))
    labels, homes = field.labels(), _nearest_nodes(mesh, points)
    for _ in range(3):
        # an opened ring may cut off an island, an island given away may empty a region
        labels = opened_rings(mesh, tidy_labels(mesh, labels, homes), points)
    regions = region_network(mesh, labels, count)
    foam, areas = _laid_out(cell, field, labels, regions, targets, order, seed)
    _check_areas(foam, areas, mesh, labels)
    return foam


def _laid_out(
    cell: HeleShawCell,
    field: SeedFields,
    labels: Ints,
    regions: RegionNetwork,
    targets: Floats,
    order: int,
    seed: int | None,
) -> tuple[Foam, Floats]:
    """Vertices where three d² are equal, films fitted to the crossings of mesh edges; rough areas."""
    mesh, surface, network = field.mesh, cell.surface, regions.network
    corner = mesh.triangles[regions.corners]
    at = np.broadcast_to(corner[:, :, None], (len(corner), 3, 3))
    to = np.broadcast_to(labels[corner][:, None, :], (len(corner), 3, 3))
    squares, known = field.square_to(at, to)
    place = corner_weights(squares, np.all(known, axis=(1, 2)))
    vertices = surface.project(np.einsum("mi,mix->mx", place, mesh.corners[regions.corners]))
    a, b = regions.crossings.T
    ends = np.stack([labels[a], labels[b]], axis=1)
    at_a, known_a = field.square_to(np.stack([a, a], axis=1), ends)
    at_b, known_b = field.square_to(np.stack([b, b], axis=1), ends)
    gap_a = at_a @ np.array([-1.0, 1.0])
    gap_b = at_b @ np.array([1.0, -1.0])
    total = gap_a + gap_b
    sound = known_a.all(axis=1) & known_b.all(axis=1) & (total > 0.0)
    share = np.where(sound, np.clip(gap_a / np.where(sound, total, 1.0), 0.0, 1.0), 0.5)
    edge = nearest_image(mesh.nodes[b] - mesh.nodes[a], mesh.period)
    crossings = surface.project(mesh.nodes[a] + share[:, None] * edge)
    if surface.rim is not None:
        vertices = np.concatenate([vertices, surface.rim.nearest(crossings[regions.rim_crossings])])
    tail, head = vertices[network.tails], vertices[network.heads]
    offsets = surface.arc_fit(tail, head, regions.film, crossings, order)
    chord = np.linalg.norm(nearest_image(head - tail, surface.period), axis=1)
    short = chord < 0.3 * float(np.sqrt(surface.area / network.n_bubbles))
    offsets[short] = 0.0
    # a draft is enough to see that nothing is amiss
    for layer in (replace(Layer.surface(), rays=2), Layer.surface()):
        areas = bubble_integrals(cell, network, vertices, offsets, layer)
        if abs(areas.sum() - surface.area) <= surface.precision * surface.area:
            return Foam(cell, network, vertices, offsets, targets, seed=seed), areas
    raise ResolutionError(TOO_LONG)


def _check_areas(foam: Foam, areas: Floats, mesh: TriangleMesh, labels: Ints) -> None:
    """Compare the foam's areas with the mesh regions': a film on the wrong side of a handle shows."""
    rough = np.bincount(labels, mesh.node_areas, foam.n_bubbles) * (foam.cell.surface.area / mesh.area)
    mean = foam.cell.surface.area / foam.n_bubbles
    per_node = mesh.area / mesh.n_nodes
    allowance = 0.5 * mean + 4.0 * np.sqrt(rough * per_node)
    if (np.abs(areas - rough) > allowance).any():
        raise ResolutionError(TOO_LONG)


def _seed_points(
    cell: HeleShawCell, n_bubbles: int | None, seeds: str | ArrayLike, rng: np.random.Generator
) -> Floats:
    surface = cell.surface
    if isinstance(seeds, str):
        kind = as_choice(seeds, "seeds", SEED_KINDS)
        if n_bubbles is None:
            raise TypeError("n_bubbles is needed unless seeds is an array of points")
        count = as_integer(n_bubbles, "n_bubbles", minimum=1, maximum=MOST_BUBBLES)
        if kind == "random":
            return random_seeds(surface, count, rng)
        if kind == "blue":
            return blue_noise_seeds(surface, count, rng)
        return lattice_seeds(surface, count)
    points = check_seeds(surface, seeds)
    if n_bubbles is not None and as_integer(n_bubbles, "n_bubbles", minimum=1) != len(points):
        raise ValueError(f"n_bubbles is {n_bubbles}, but seeds holds {len(points)} points; leave one out")
    return points


def _target_volumes(
    cell: HeleShawCell, count: int, volumes: float | ArrayLike | None, rng: np.random.Generator
) -> Floats:
    if volumes is None:
        return np.full(count, cell.volume / count)
    if isinstance(volumes, (int, float, np.integer, np.floating)) or np.ndim(volumes) == 0:
        width = as_number(volumes, "volumes", minimum=0.0)
        if width > 1.0:
            raise ValueError(f"volumes as a log-normal width must be at most 1, got {width:g}")
        drawn = np.exp(width * rng.standard_normal(count))
        shares: Floats = drawn / drawn.sum()
        return cell.volume * shares
    given = as_floats(volumes, "volumes", (count,))
    if (given <= 0.0).any():
        raise ValueError(f"volumes must be above 0, but bubble {int(given.argmin())} has {given.min():g}")
    total = given.sum()
    if abs(total - cell.volume) > 1e-9 * cell.volume:
        raise ValueError(
            f"volumes must add up to the cell's volume {cell.volume:.12g}, got {total:.12g}; "
            "multiply them by cell.volume / volumes.sum()"
        )
    scaled: Floats = given * (cell.volume / total)
    return scaled


def _node_volumes(cell: HeleShawCell, mesh: TriangleMesh) -> Floats:
    """Volume between the plates that each mesh node stands for."""
    k1, k2 = cell.surface.principal_curvatures(mesh.nodes).T
    out: Floats = mesh.node_areas * cell.layer.density(mesh.nodes, 0.5 * (k1 + k2), k1 * k2)
    return out


def _nearest_nodes(mesh: TriangleMesh, points: Floats) -> Ints:
    """The four nodes nearest to each point, (n, 4)."""
    return Places(mesh.nodes, mesh.period).nearest(points, 4)[1]


def _centres(cell: HeleShawCell, mesh: TriangleMesh, labels: Ints, points: Floats) -> Floats:
    """Area-weighted mean of each region's nodes, on the surface; an empty region keeps its seed."""
    count = len(points)
    total = np.bincount(labels, mesh.node_areas, minlength=count)
    away = nearest_image(mesh.nodes - points[labels], mesh.period) * mesh.node_areas[:, None]
    sums = [np.bincount(labels, away[:, k], minlength=count) for k in range(3)]
    mean = points + np.stack(sums, axis=1) / np.where(total > 0.0, total, 1.0)[:, None]
    return cell.surface.project(np.where((total > 0.0)[:, None], mean, points))


def _fitting(cell: HeleShawCell) -> int:
    """Bubbles so small that three of them go round the tightest circle, 2π / k_max or a period."""
    around = max(abs(k) for k in cell.surface.curvature_range()) / (2.0 * np.pi)
    if cell.surface.period is not None:
        around = max(around, 1.0 / float(cell.surface.period.min()))
    return int(np.ceil(cell.surface.area * (3.0 * around) ** 2))


def _advice(cell: HeleShawCell, count: int, n_nodes: int) -> str:
    least = _fitting(cell)
    if count < least:
        return f"Use about {least} bubbles or more (now {count})"
    return (
        f"Use more bubbles, seeds that are more even (seeds='blue'), or n_nodes = {4 * n_nodes} or more "
        f"(tried {n_nodes})"
    )
