"""`cluster_foam`: open clusters of bubbles in an otherwise empty cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from warpedfoam.arrays import Floats, as_choice, as_floats, as_instance, as_integer, as_number, as_points
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import TopologyError
from warpedfoam.foam import MAX_ORDER, Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.network import CellNetwork, network_from_loops
from warpedfoam.surfaces.protocol import Surface
from warpedfoam.tessellate.layouts import (
    DRAWS,
    SPACING,
    Layout,
    along_x,
    ghosts,
    hexagonal_centres,
    planar_layout,
    random_centres,
)

#: Steps along each geodesic from a cluster's centre to a vertex.
MARCH = 32
#: Parts of clusters farther apart than the second along the surface may not come nearer than the first in
#: space, in spacings of bubbles.
TOUCH, APART = 0.5, 1.2
#: Smallest bubbles, in sizes of the surface: sixteen digits of a place leave ten of a film.
LEAST = 1e-6
#: Points along each film where clearances are measured.
SAMPLES = 9


def cluster_foam(
    cell: HeleShawCell,
    n_bubbles: int | Sequence[int] | None = None,
    *,
    volumes: float | ArrayLike,
    layout: str | ArrayLike = "hexagonal",
    centre: ArrayLike | None = None,
    orientation: float | ArrayLike = 0.0,
    max_turn: float = 60.0,
    order: int = 8,
    seed: int | None = None,
) -> Foam:
    """Open clusters of bubbles, to be relaxed by `relax`; the rest of the cell is the exterior.

    The exterior is the last bubble, at pressure 0 and without a volume to hold; with k clusters its Euler
    number is χ − k. A planar layout is laid out from each centre along geodesics: lengths and angles at
    the centre are kept.

    Parameters
    ----------
    cell : HeleShawCell
    n_bubbles : int or sequence of int
        Bubbles of the cluster, or of each of several. May be left out if ``layout`` holds points.
    volumes : float or (n,) array
        Of each bubble, cluster after cluster; one number for all.
    layout : {"hexagonal", "random"} or (n, 2) array, optional
        The most compact patch of a honeycomb (1, 2, 3, 7, 19, 37 … are symmetric); a disordered compact
        patch, from ``seed``; or planar centres of the bubbles of one cluster, in units of the square root
        of a bubble's area: the cluster has the topology of their Voronoi diagram.
    centre : (3,) or (k, 3) array, optional
        Middle of each cluster, projected; `Surface.lattice_points` by default.
    orientation : float or (k,) array, optional
        Angle in radians from the first of `Surface.vertex_frames` at the centre (on a torus: up the tube)
        to the layout's x axis, counter-clockwise; of a hexagonal patch that is its long axis, if it has
        one.
    max_turn : float, optional
        Outer films are divided by markers so that pieces turn by about this many degrees at most, 10 …
        150.
    order : int, optional
        p of the films.
    seed : int, optional
        For random layouts.

    Returns
    -------
    Foam
        Not relaxed: straight films, cells of equal size.

    Raises
    ------
    TypeError, ValueError
        Wrong types or shapes, volumes that do not fit in the cell, points that make no cluster.
    TopologyError
        If a cluster reaches round the surface and touches itself, or two clusters touch, or one touches a
        rim.

    Examples
    --------
    Two bubbles of unit area on a flat sheet have 6.359129 of film:

    >>> from warpedfoam import FlatTorus, HeleShawCell, relax
    >>> cell = HeleShawCell(FlatTorus(20.0, 20.0), gap=1.0)
    >>> relaxed = relax(cluster_foam(cell, 2, volumes=1.0))
    >>> round(relaxed.energy, 6), relaxed.foam.exterior
    (6.359129, 2)
    """
    as_instance(cell, "cell", HeleShawCell)
    surface = cell.surface
    layouts, seed = _layouts(n_bubbles, layout, max_turn, seed)
    counts = [plan.n_bubbles for plan in layouts]
    k, n = len(layouts), sum(counts)
    held = as_floats(np.full(n, volumes) if np.ndim(volumes) == 0 else volumes, "volumes", (n,))
    if (held <= 0.0).any():
        raise ValueError(f"volumes must be above 0, got {held.min():g}")
    if not held.sum() < 0.9 * cell.volume:
        raise ValueError(
            f"volumes must leave a tenth of the cell empty, but {held.sum():g} of {cell.volume:g} is taken"
        )
    p = as_integer(order, "order", minimum=2, maximum=MAX_ORDER)
    if centre is None:
        middles = surface.lattice_points(k)
    else:
        middles = surface.project(as_points(np.atleast_2d(np.asarray(centre)), "centre"))
    if len(middles) != k:
        raise ValueError(f"centre must hold {k} points, one per cluster, got {len(middles)}")
    angles = as_floats(
        np.full(k, orientation) if np.ndim(orientation) == 0 else orientation, "orientation", (k,)
    )

    shares = np.split(held, np.cumsum(counts)[:-1])
    units = [np.sqrt(_area_for(cell, q, share.mean())) for q, share in zip(middles, shares, strict=True)]
    if not min(units) >= LEAST * surface.size:
        raise ValueError(
            f"volumes make bubbles of size {min(units):.3g} on a surface of size {surface.size:.3g}: below "
            f"{LEAST:g} of that their films have too few digits; take larger volumes, or a smaller gap"
        )
    placed = [
        geodesic_chart(surface, q, unit * plan.points, angle)
        for plan, q, unit, angle in zip(layouts, middles, units, angles, strict=True)
    ]
    _check_apart(surface, layouts, placed, units)
    points = np.concatenate(placed)
    return Foam(
        cell,
        _joined(layouts, surface.euler_characteristic),
        surface.project(points),
        np.zeros((_count_films(layouts), p - 1)),
        np.append(held, cell.volume - held.sum()),
        seed=seed,
        exterior=n,
    )


def cluster_clearance(foam: Foam) -> float:
    """Least distance in space between outer films of bubbles that are no neighbours, in bubble sizes.

    A small one tells that clusters, or a cluster and itself round a thin surface, are about to meet, which
    `warpedfoam.relax` does not see if ``contacts=False``. Infinite if all outer bubbles are neighbours.

    Raises
    ------
    TypeError, ValueError
        If ``foam`` is not a Foam or has no exterior.
    """
    as_instance(foam, "foam", Foam)
    if foam.exterior is None:
        raise ValueError("foam must have an exterior; see cluster_foam")
    network = foam.network
    outer = np.flatnonzero((network.left == foam.exterior) | (network.right == foam.exterior))
    bubble = np.where(network.left == foam.exterior, network.right, network.left)[outer]
    points = foam.film_curves(SAMPLES)[outer].reshape(-1, 3)
    owner = np.repeat(bubble, SAMPLES)
    n = foam.n_bubbles
    near = set((network.left * n + network.right).tolist()) | set((network.right * n + network.left).tolist())
    near |= {i * (n + 1) for i in range(n)}
    pairs = cKDTree(points).query_pairs(2.0 * foam.bubble_size, output_type="ndarray")
    code = owner[pairs[:, 0]] * n + owner[pairs[:, 1]]
    far = pairs[~np.isin(code, np.fromiter(near, dtype=np.int64))]
    if not len(far):
        return float("inf")
    return float(np.linalg.norm(points[far[:, 0]] - points[far[:, 1]], axis=1).min() / foam.bubble_size)


def geodesic_chart(surface: Surface, centre: Floats, plane: Floats, angle: float) -> Floats:
    """Ends (n, 3) of geodesics from ``centre`` (3,) along plane vectors (n, 2) turned by ``angle``."""
    first, second = surface.vertex_frames(centre[None])[0]
    x = np.broadcast_to(centre, (len(plane), 3)).copy()
    cos, sin = np.cos(angle), np.sin(angle)
    turned = plane @ np.array([[cos, sin], [-sin, cos]])
    along = turned[:, :1] * first + turned[:, 1:] * second
    length = np.linalg.norm(along, axis=1)
    step = (length / MARCH)[:, None]
    tangent = along / np.maximum(length, 1e-300)[:, None]

    def flat(at: Floats, t: Floats) -> Floats:
        normal = surface.normals(at)
        t = t - np.einsum("ni,ni->n", t, normal)[:, None] * normal
        out: Floats = t / np.maximum(np.linalg.norm(t, axis=1, keepdims=True), 1e-300)
        return out

    for _ in range(MARCH):
        # straight on in space, seen from the surface: the midpoint rule of a geodesic
        middle = surface.project(x + 0.5 * step * tangent)
        across = flat(middle, tangent)
        x = surface.project(x + step * across)
        tangent = flat(x, across)
    return x


def _layouts(
    n_bubbles: int | Sequence[int] | None, layout: str | ArrayLike, max_turn: float, seed: int | None
) -> tuple[list[Layout], int | None]:
    turn = as_number(max_turn, "max_turn", minimum=10.0, maximum=150.0)
    if not isinstance(layout, str):
        centres = as_floats(layout, "layout", (None, 2))
        if n_bubbles is not None and n_bubbles != len(centres):
            raise ValueError(f"n_bubbles says {n_bubbles}, but layout holds {len(centres)} points")
        if not len(centres):
            raise ValueError("layout holds no points")
        return [_simple(centres - centres.mean(axis=0), None, turn)], seed
    kind = as_choice(layout, "layout", ("hexagonal", "random"))
    if n_bubbles is None:
        raise TypeError("n_bubbles must be given, or layout must hold points")
    listed = [n_bubbles] if np.ndim(n_bubbles) == 0 else list(n_bubbles)  # type: ignore[arg-type]
    if not listed:
        raise ValueError("n_bubbles is empty")
    counts = [as_integer(n, "n_bubbles", minimum=1) for n in listed]
    if kind == "hexagonal":
        middles = [hexagonal_centres(n) for n in counts]
        return [along_x(_simple(at, None, turn), at) for at in middles], seed
    if seed is None:
        raise ValueError('layout="random" needs a seed')
    seed = as_integer(seed, "seed", minimum=0)
    rng = np.random.default_rng(seed)
    out = []
    for n in counts:
        for draw in range(DRAWS):
            centres, around = random_centres(n, rng)
            try:
                out.append(_simple(centres, around, turn))
                break
            except ValueError:
                if draw == DRAWS - 1:
                    raise
    return out, seed


def _simple(centres: Floats, around: Floats | None, turn: float) -> Layout:
    """A layout without holes, in one piece."""
    if len(centres) > 1 and np.asarray(cKDTree(centres).query(centres, k=2)[0])[:, 1].min() < 0.2 * SPACING:
        raise ValueError("layout has two points closer than a fifth of the spacing of unit cells")
    plan = planar_layout(centres, ghosts(centres) if around is None else around, turn)
    if len(plan.outside) != 1:
        raise ValueError(
            f"layout makes {len(plan.outside)} outlines: it must be one cluster without holes, "
            "its points about 1 apart"
        )
    return plan


def _area_for(cell: HeleShawCell, point: Floats, volume: float) -> float:
    """Area on the inner plate that holds a volume, with the curvatures at a point."""
    k1, k2 = cell.surface.principal_curvatures(point[None]).T
    return float(volume / cell.layer.density(point[None], 0.5 * (k1 + k2), k1 * k2)[0])


def _check_apart(surface: Surface, layouts: list[Layout], placed: list[Floats], units: list[float]) -> None:
    """Refuse clusters that touch themselves, each other or the rim, by all vertices and bubble centres."""
    plane, space, owner, spacing = [], [], [], []
    for i, (plan, points, unit) in enumerate(zip(layouts, placed, units, strict=True)):
        middles = np.array([points[loop].mean(axis=0) for loop in plan.loops])
        flat = np.array([plan.points[loop].mean(axis=0) for loop in plan.loops])
        space.append(np.concatenate([points, surface.project(middles)]))
        plane.append(unit * np.concatenate([plan.points, flat]))
        owner.append(np.full(len(space[-1]), i))
        spacing.append(np.full(len(space[-1]), unit * SPACING))
    x, u = np.concatenate(space), np.concatenate(plane)
    which, size = np.concatenate(owner), np.concatenate(spacing)
    if surface.rim is not None:
        away = np.linalg.norm(surface.rim.nearest(x) - x, axis=1)
        if (away < TOUCH * size).any():
            nearest = int(which[int(np.argmin(away / size))])
            raise TopologyError(f"cluster {nearest} touches the rim; put its centre farther in")
    reach = float(size.max())
    if surface.period is not None:
        away = np.linalg.norm(nearest_image(x[:, None] - x[None], surface.period), axis=2)
        pairs = np.argwhere(np.triu(away < reach, 1))
        gap = away[pairs[:, 0], pairs[:, 1]]
    else:
        pairs = cKDTree(x).query_pairs(reach, output_type="ndarray")
        gap = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    a, b = pairs[:, 0], pairs[:, 1]
    scale = 0.5 * (size[a] + size[b])
    along = np.where(which[a] == which[b], np.linalg.norm(u[a] - u[b], axis=1), np.inf)
    bad = np.flatnonzero((gap < TOUCH * scale) & (along > APART * scale))
    if bad.size:
        i, j = int(which[a[bad[0]]]), int(which[b[bad[0]]])
        what = f"cluster {i} touches itself" if i == j else f"clusters {i} and {j} touch"
        raise TopologyError(
            f"{what} near {np.round(x[a[bad[0]]], 3).tolist()}: such an exterior is none of the kind that is "
            "handled; take fewer or smaller bubbles, or other centres"
        )


def _count_films(layouts: list[Layout]) -> int:
    return sum(sum(map(len, plan.loops)) + sum(map(len, plan.outside)) for plan in layouts) // 2


def _joined(layouts: list[Layout], chi: int) -> CellNetwork:
    """One network of several layouts, with one exterior, the last bubble."""
    inner, outer, shift = [], [], 0
    for plan in layouts:
        inner += [loop + shift for loop in plan.loops]
        outer += [loop + shift for loop in plan.outside]
        shift += len(plan.points)
    parts = network_from_loops([loop.tolist() for loop in (*inner, *outer)])
    n = len(inner)
    euler = np.ones(n + 1, dtype=np.int64)
    euler[n] = chi - (parts.n_vertices - parts.n_films + n)
    return CellNetwork(parts.next, parts.origin, np.minimum(parts.bubble, n), euler)
