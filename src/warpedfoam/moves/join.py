"""Joining two outlines of open clusters where they meet; `part` is the inverse.

Two markers on outlines become the ends of a new film
between their bubbles: V stays, F grows by 1, and the exterior, cut across, gains 1 in Euler number.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, Ints, as_floats, as_indices, as_number
from warpedfoam.errors import TopologyError
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.enclosed import Half, enclosed_loop
from warpedfoam.moves.markers import (
    Layout,
    divide,
    film_samples,
    layout_of,
    merge,
    removable,
    steepness,
)
from warpedfoam.moves.t1 import outward_tangents
from warpedfoam.network import CellNetwork
from warpedfoam.surfaces.protocol import Layer, Surface

#: Cuts keep this far from the ends of a film, as a parameter along it; nearer to a marker than this they
#: take its place, unless what is left would be steeper than the third. Closer than the second they never are.
MARGIN, NEAR, UPRIGHT = 0.15, 0.03, np.radians(75.0)
#: A new film is this long, in bubble sizes, and takes no more than this share of the films it cuts.
FRESH, MOST_SHARE = 0.1, 0.3


@dataclass(frozen=True)
class ContactEvent:
    """Two outlines joined, or a bridge between them ruptured.

    Attributes
    ----------
    iteration : int
        Newton step after which it was made; 0 outside a relaxation.
    kind : {"join", "part"}
    bubbles : tuple of two int
        Ids of the bubbles that gained or lost a film between them (the same twice for a bubble that
        meets itself).
    position : tuple of three float
        Middle of that film, on the inner plate.
    energy_before, energy_after : float
        γ Σ film areas of the whole foam, before any further relaxation.
    enclosed : int or None
        Id of the bubble that a region of the exterior has become, if the join cut one off.
    """

    iteration: int
    kind: str
    bubbles: tuple[int, int]
    position: tuple[float, float, float]
    energy_before: float
    energy_after: float
    enclosed: int | None = None


def _outline(network: CellNetwork, marker: int, exterior: int) -> tuple[int, int]:
    """Half-films of the exterior that end and start at a marker."""
    halves = np.flatnonzero((network.origin == marker) & (network.bubble == exterior))
    if network.vertex_degrees[marker] != 2 or len(halves) != 1:
        raise TopologyError(f"vertex {marker} is no marker on a film between a bubble and the exterior")
    start = int(halves[0])
    inner = int(network.next[start ^ 1])
    return inner ^ 1, start


def rewire_join(
    network: CellNetwork, first: int, second: int, exterior: int, enclosed: int | None = None
) -> CellNetwork:
    """The network with a new film, the last, between the bubbles at two markers on outlines.

    Parameters
    ----------
    network : CellNetwork
    first, second : int
        Markers on films that face the exterior; they become the new film's ends.
    exterior : int
        Its Euler number rises by 1.
    enclosed : int, optional
        A half-film of the exterior, as numbered after: its loop becomes a bubble of its own, the last, a
        disk, and the exterior keeps its Euler number.

    Raises
    ------
    TopologyError
        If a vertex is no such marker, both lie on one film, or the exterior would be said to be a disk
        with several loops.

    Examples
    --------
    Joining adds a film and no vertex:

    >>> from warpedfoam import HeleShawCell, Torus, cluster_foam
    >>> foam = cluster_foam(HeleShawCell(Torus(20.0, 4.0), gap=0.5), [1, 1], volumes=0.5)
    >>> net = rewire_join(foam.network, 0, 6, foam.exterior)
    >>> net.sides.tolist(), net.bubble_euler.tolist()
    ([2, 2, 2], [1, 1, -1])
    """
    following, origin, bubble = join_arrays(network, first, second, exterior)
    euler = network.bubble_euler.copy()
    if enclosed is None:
        euler[exterior] += 1
    else:
        half = start = int(enclosed)
        while True:
            bubble[half] = len(euler)
            half = int(following[half])
            if half == start:
                break
        euler = np.append(euler, 1)
    return CellNetwork(following, origin, bubble, euler)


def join_arrays(network: CellNetwork, first: int, second: int, exterior: int) -> tuple[Ints, Ints, Ints]:
    """``next``, ``origin`` and ``bubble`` after a join, before anything is said about the exterior."""
    into_a, from_a = _outline(network, first, exterior)
    into_b, from_b = _outline(network, second, exterior)
    if first == second or from_a == into_b or from_b == into_a:
        raise TopologyError(f"markers {first} and {second} lie on one film: divide it between them first")
    count = len(network.next)
    following = np.append(network.next, [into_a ^ 1, into_b ^ 1])
    origin = np.append(network.origin, [second, first])
    bubble = np.append(network.bubble, network.bubble[[into_a ^ 1, into_b ^ 1]])
    following[into_a], following[into_b] = from_b, from_a
    following[from_a ^ 1], following[from_b ^ 1] = count, count + 1
    origin[from_b], origin[from_a] = first, second
    return following, origin, bubble


def join(foam: Foam, films: ArrayLike, *, at: ArrayLike | None = None, length: float | None = None) -> Foam:
    """Join two outlines by a new film between their bubbles.

    Both films are cut, and a short film is laid along them through the middle of the cuts. A region of
    the exterior that the join cuts off and that is a disk becomes a bubble, the last, which holds the
    volume that it has: its air cannot get out. Any other region stays with the exterior, so that a ring
    round a torus has an exterior with two outlines.

    Parameters
    ----------
    foam : Foam
        With an exterior.
    films : (2,) integer array
        Different films, each between a bubble and the exterior.
    at : (2,) array, optional
        Where to cut them, as parameters along them; where they come closest by default.
    length : float, optional
        Of the new film, at most the bubble size; a tenth of that by default.

    Returns
    -------
    Foam
        With the same volumes to hold and no pressures; the new film is the last.

    Raises
    ------
    TypeError, ValueError, TopologyError
        If there is no exterior, the films do not face it, or what is left of the exterior cannot be told.

    Examples
    --------
    >>> from warpedfoam import FlatTorus, HeleShawCell, cluster_foam, relax
    >>> cell = HeleShawCell(FlatTorus(20.0, 20.0), gap=1.0)
    >>> two = cluster_foam(cell, [1, 1], volumes=1.0, centre=[[0.0, 0, 0], [1.9, 0, 0]], orientation=0.5)
    >>> apart = relax(two)
    >>> together = relax(join(apart.foam, [1, 11]))
    >>> round(apart.energy, 6), round(together.energy, 6)
    (7.089815, 6.359129)
    """
    return join_from(foam, films, at=at, length=length)[0]


def join_from(
    foam: Foam, films: ArrayLike, *, at: ArrayLike | None = None, length: float | None = None
) -> tuple[Foam, Ints]:
    """`join`, and the film that each film comes from, −1 for the new one."""
    exterior = exterior_of(foam)
    network, surface = foam.network, foam.cell.surface
    pair = as_indices(films, "films", (2,), below=network.n_films)
    outer = (network.left[pair] == exterior) != (network.right[pair] == exterior)
    if not outer.all():
        raise TopologyError(f"film {int(pair[~outer][0])} does not lie between a bubble and the exterior")
    if pair[0] == pair[1]:
        raise TopologyError("films must differ: divide one that meets itself (add_markers)")
    span = FRESH * foam.bubble_size
    if length is not None:
        span = as_number(length, "length", positive=True, maximum=foam.bubble_size)
    if at is not None:
        at = as_floats(at, "at", (2,))
        if ((at < 0.0) | (at > 1.0)).any():
            raise ValueError("at must lie between 0 and 1")
    layout, first, second = _cut(foam, pair, at)
    halves = np.array([_outline(layout.network, v, exterior)[1] for v in (first, second)])
    ends = outward_tangents(surface, layout.network, layout.points, layout.offsets, halves)
    one, other = layout.points[[first, second]]
    middle = surface.project((one + 0.5 * nearest_image(other - one, surface.period))[None])
    # the exterior runs opposite ways along the two outlines
    along = ends[0] - ends[1]
    normal = surface.normals(middle)[0]
    along = along - (along @ normal) * normal
    size = float(np.linalg.norm(along))
    if size < 1e-9:
        raise TopologyError("the two outlines do not face each other")
    four = np.concatenate([halves, layout.network.next[halves ^ 1]]) >> 1
    tail, head = layout.points[layout.network.tails[four]], layout.points[layout.network.heads[four]]
    least = float(np.linalg.norm(nearest_image(head - tail, surface.period), axis=1).min())
    step = 0.5 * min(span, MOST_SHARE * least) / size * along
    points = layout.points.copy()
    # the exterior that comes to the first marker now turns back at the second outline
    points[[first, second]] = surface.project(np.concatenate([middle - step, middle + step]))
    offsets = np.concatenate([layout.offsets, np.zeros((1, layout.offsets.shape[1]))])
    following, origin, _ = join_arrays(layout.network, first, second, exterior)
    inner = enclosed_loop(surface, layout.network, exterior, Half(following, origin, points, offsets), halves)
    try:
        joined = rewire_join(layout.network, first, second, exterior, inner)
    except TopologyError as error:
        raise TopologyError(
            "the join cuts the exterior into regions of a kind that is not handled (a disk with other "
            "clusters in it)"
        ) from error
    return _after_join(foam, joined, points, offsets), np.append(layout.source, -1)


def _after_join(foam: Foam, joined: CellNetwork, points: Floats, offsets: Floats) -> Foam:
    """The foam after a join, an enclosed bubble with the volume that it has."""
    targets, ids = foam.target_volumes, foam.bubble_ids
    if joined.n_bubbles > foam.n_bubbles:
        targets = _enclosed_volume(foam, joined, points, offsets)
        ids = np.append(ids, int(ids.max()) + 1)
    return replace(
        foam,
        network=joined,
        vertex_points=points,
        film_offsets=offsets,
        target_volumes=targets,
        bubble_ids=ids,
        pressures=None,
        exterior=foam.exterior,
    )


def _enclosed_volume(foam: Foam, joined: CellNetwork, points: Floats, offsets: Floats) -> Floats:
    from warpedfoam.foam import bubble_integrals

    assert foam.exterior is not None
    total = foam.cell.surface.integral(Layer.surface())
    area = bubble_integrals(foam.cell, joined, points, offsets, Layer.surface())[-1]
    volume = bubble_integrals(foam.cell, joined, points, offsets, foam.cell.layer)[-1]
    if area <= 0.0:
        volume += foam.cell.volume * np.ceil(-area / total)
    targets = np.append(foam.target_volumes, volume)
    targets[foam.exterior] -= volume
    return targets


def exterior_of(foam: Foam) -> int:
    """The exterior of a foam of open clusters."""
    if not isinstance(foam, Foam):
        raise TypeError(f"foam must be a Foam, got {type(foam).__name__}")
    if foam.exterior is None:
        raise ValueError("foam must have an exterior; see cluster_foam")
    return foam.exterior


def _cut(foam: Foam, pair: Ints, at: Floats | None) -> tuple[Layout, int, int]:
    """Both films divided opposite each other, and the two new markers.

    A cut may come close to a marker, which then goes, but not to the end of another film.
    """
    surface, layout = foam.cell.surface, layout_of(foam)
    network = foam.network
    tail, head = foam.vertex_points[network.tails[pair]], foam.vertex_points[network.heads[pair]]
    curve = film_samples(surface, tail, head, foam.film_offsets[pair], np.zeros(2), np.ones(2))
    last = curve.shape[1] - 1
    marked = network.vertex_degrees[np.stack([network.tails[pair], network.heads[pair]], axis=1)] == 2
    low = np.where(marked[:, 0], NEAR, MARGIN) * last
    high = np.where(marked[:, 1], 1.0 - NEAR, 1.0 - MARGIN) * last
    if at is None:
        gap = nearest_image(curve[0][:, None] - curve[1][None], surface.period)
        found = np.unravel_index(int(np.linalg.norm(gap, axis=2).argmin()), gap.shape[:2])
        row = int(np.clip(found[0], np.ceil(low[0]), np.floor(high[0])))
    else:
        row = int(np.clip(round(float(at[0]) * last), np.ceil(low[0]), np.floor(high[0])))
    for _ in range(2):
        # the nearest point of the other, within its bounds, and back
        away = np.linalg.norm(nearest_image(curve[1] - curve[0, row], surface.period), axis=1)
        other = int(np.clip(away.argmin(), np.ceil(low[1]), np.floor(high[1])))
        away = np.linalg.norm(nearest_image(curve[0] - curve[1, other], surface.period), axis=1)
        row = int(np.clip(away.argmin(), np.ceil(low[0]), np.floor(high[0])))
    place = np.array([row, other]) / last
    layout = divide(surface, layout, pair, place)
    names = [network.n_vertices, network.n_vertices + 1]
    for k in range(2):
        layout, names = _cleared(surface, layout, names, k, float(place[k]))
    return layout, names[0], names[1]


def _cleared(
    surface: Surface, layout: Layout, names: list[int], which: int, place: float
) -> tuple[Layout, list[int]]:
    """Without a marker that is next to a new one on its film."""
    if MARGIN <= place <= 1.0 - MARGIN:
        return layout, names
    network, marker = layout.network, names[which]
    halves = np.flatnonzero(network.origin == marker)
    tail, head = layout.points[marker], layout.points[network.origin[halves ^ 1]]
    size = np.linalg.norm(nearest_image(head - tail, surface.period), axis=1)
    near = network.origin[halves[int(size.argmin())] ^ 1]
    alone = np.array([near])
    if network.vertex_degrees[near] != 2 or near in names or not removable(network, alone)[0]:
        return layout, names
    trial, films = merge(surface, layout, alone)
    if steepness(trial.offsets[films])[0] > UPRIGHT:
        return layout, names
    return trial, [name - int(name > near) for name in names]
