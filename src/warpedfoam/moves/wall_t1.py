"""T1s at a wall: a film that ends on the rim is lost to it, or pulled out of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints, as_choice, as_indices, as_number
from warpedfoam.errors import TopologyError
from warpedfoam.foam import Foam
from warpedfoam.moves.t1 import outward_tangents
from warpedfoam.network import CellNetwork
from warpedfoam.surfaces.protocol import Surface

KINDS = ("film", "wall")


@dataclass(frozen=True, eq=False)
class WallSites:
    """Where T1s at a wall may happen; arrays (k,).

    At the end of a film on the rim ``before`` and ``after`` are the two other half-films that leave its
    inner vertex; at a wall, the two half-films that leave its ends: first the one that comes first along
    the rim. ``bubbles`` (k, 3): the ones beside the film, after and before it along the rim, and the one
    opposite; or the ones beside the wall, and the one whose wall it is. ``film`` is the half-film to the
    rim (−1 at a wall).
    """

    film: Ints
    before: Ints
    after: Ints
    bubbles: Ints


def film_sites(network: CellNetwork, halves: Ints) -> WallSites:
    """Sites of half-films that run from a threefold vertex to the rim."""
    back = np.empty_like(network.next)
    back[network.next] = np.arange(len(back))
    before, after = network.next[halves ^ 1], back[halves] ^ 1
    bubbles = np.stack([network.bubble[halves], network.bubble[halves ^ 1], network.bubble[after]], axis=1)
    return WallSites(halves, before, after, bubbles)


def wall_sites(network: CellNetwork, walls: Ints) -> WallSites:
    """Sites of walls, given by the half-films that come before them."""
    before, after = walls ^ 1, network.next[walls]
    bubbles = np.stack([network.bubble[after ^ 1], network.bubble[before], network.bubble[walls]], axis=1)
    return WallSites(np.full(len(walls), -1), before, after, bubbles)


def wall_allowed(network: CellNetwork, sites: WallSites) -> Bools:
    """Whether each leaves a network: three different disks, losers of at least four sides, no marker."""
    ordered = np.sort(sites.bubbles, axis=1)
    fine = (np.diff(ordered, axis=1) > 0).all(axis=1)
    fine &= (network.bubble_euler[sites.bubbles] == 1).all(axis=1)
    fine &= (sites.before >> 1) != (sites.after >> 1)
    sides = network.sides[sites.bubbles]
    fine &= np.where(sites.film >= 0, sides[:, :2].min(axis=1), sides[:, 2]) >= 4
    degrees = network.vertex_degrees[network.origin[sites.before]]
    out: Bools = fine & (degrees == np.where(sites.film >= 0, 3, 1))
    return out


def rewire_walls(network: CellNetwork, sites: WallSites) -> tuple[CellNetwork, Ints]:
    """The network after a T1 at each site, and where its films were (−1 for new ones).

    A film lost to the wall leaves its two vertices to the ends of its neighbours; a film pulled out of
    the wall takes the ends of its neighbours for its own. No bubble may take part in two of them.

    Raises
    ------
    TopologyError
        If one is not allowed, or two share a bubble.
    """
    fine = wall_allowed(network, sites)
    if not fine.all():
        raise TopologyError(
            f"site {int(np.flatnonzero(~fine)[0])} at the wall cannot turn: its three bubbles must be "
            "different disks, those that lose a film or a wall must have at least four sides, and there must "
            "be no marker"
        )
    if len(np.unique(sites.bubbles)) != sites.bubbles.size:
        raise TopologyError("two of the T1s at walls share a bubble; make them one after the other")
    following, origin, bubble = network.next.copy(), network.origin.copy(), network.bubble.copy()
    back = np.empty_like(following)
    back[following] = np.arange(len(back))
    lost = sites.film >= 0
    h, before, after = sites.film[lost], sites.before[lost], sites.after[lost]
    # the first neighbour ends where the film ended, the second where it began
    origin[before] = origin[h ^ 1]
    following[after ^ 1], following[back[h ^ 1]] = following[h], before
    kept = np.ones(network.n_films, dtype=np.bool_)
    kept[h >> 1] = False
    before, after = sites.before[~lost], sites.after[~lost]
    count = len(before)
    new = len(following) + 2 * np.arange(count)
    at_rim, inside = origin[before], origin[after]
    after_on, before_on = following[after ^ 1], back[before]
    following = np.concatenate([following, np.empty(2 * count, dtype=np.int64)])
    following[new], following[after ^ 1] = after_on, new
    following[new + 1], following[before_on] = before, new + 1
    origin[before] = inside
    origin = np.concatenate([origin, np.stack([inside, at_rim], axis=1).ravel()])
    bubble = np.concatenate([bubble, np.stack([bubble[after ^ 1], bubble[before]], axis=1).ravel()])
    source = np.concatenate([np.flatnonzero(kept), np.full(count, -1)])
    stays = np.repeat(np.concatenate([kept, np.ones(count, dtype=np.bool_)]), 2)
    place = np.cumsum(stays) - 1
    return (
        CellNetwork(place[following[stays]], origin[stays], bubble[stays], network.bubble_euler),
        source,
    )


def inward_pull(
    surface: Surface, network: CellNetwork, points: Floats, offsets: Floats, sites: WallSites
) -> tuple[Floats, Floats]:
    """Sum of the neighbours' unit pulls into the surface, (k,), and the pulls (k, 2, 3).

    A short film to the wall grows if that sum is above 1, and is lost if it is below.
    """
    rim = surface.rim
    assert rim is not None
    halves = np.stack([sites.before, sites.after], axis=1)
    tangents = outward_tangents(surface, network, points, offsets, halves)
    at = np.where(sites.film >= 0, network.origin[sites.film ^ 1], network.origin[sites.before])
    inward = rim.frame(*rim.locate(points[at]))[1]
    return np.einsum("kix,kx->k", tangents, inward), tangents


def lay_walls(
    surface: Surface, network: CellNetwork, points: Floats, offsets: Floats, sites: WallSites, span: Floats
) -> tuple[Floats, Floats]:
    """Points and offsets (of the films as they were) for the network after the T1s.

    New walls and films are ``span`` (k,) long, about the middle of what was lost; neighbours straight. A
    new wall takes no more than a third of the ones beside it.
    """
    rim = surface.rim
    assert rim is not None
    moved, straight = points.copy(), offsets.copy()
    lost = sites.film >= 0
    straight[sites.before >> 1] = 0.0
    straight[sites.after >> 1] = 0.0
    h = sites.film[lost]
    foot, inner = network.origin[h ^ 1], network.origin[h]
    loop, u = rim.locate(points[foot])
    back = np.empty_like(network.next)
    back[network.next] = np.arange(len(back))
    _, first, last = rim.spans(points[network.origin[back[h ^ 1] ^ 1]], points[foot])
    _, start, end = rim.spans(points[foot], points[network.origin[network.next[h]]])
    half = 0.5 * span[lost] / rim.frame(loop, u)[2]
    moved[foot] = rim.at(loop, u - np.minimum(half, (last - first) / 3.0))
    moved[inner] = rim.at(loop, u + np.minimum(half, (end - start) / 3.0))
    one, other = network.origin[sites.before[~lost]], network.origin[sites.after[~lost]]
    loop, first, last = rim.spans(points[one], points[other])
    middle = 0.5 * (first + last)
    base = rim.at(loop, middle)
    moved[one] = base
    moved[other] = surface.project(base + span[~lost, None] * rim.frame(loop, middle)[1])
    return moved, straight


def wall_t1(foam: Foam, index: int, kind: str = "film", *, length: float | None = None) -> Foam:
    """Lose a film to the wall on which it ends, or pull one out of a wall.

    Losing film f, which joins a threefold vertex to the rim, takes that side from the two bubbles beside
    it and gives the bubble opposite a wall. Pulling is the inverse: the two films beside a wall meet
    inside, a new film joins them to the rim, and the bubble loses its wall.

    Parameters
    ----------
    foam : Foam
    index : int
        The film to lose, or the wall (an index into ``foam.walls``) to give up.
    kind : {"film", "wall"}, optional
        Which of the two.
    length : float, optional
        Of the new wall or film; a tenth of the bubble size by default.

    Returns
    -------
    Foam
        With one film less or more, the same volumes to hold and no pressures.

    Raises
    ------
    ValueError, TopologyError
        If there is no such film or wall, or it may not go.

    Examples
    --------
    >>> from warpedfoam import Catenoid, HeleShawCell, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Catenoid(1.0, 1.5), gap=0.05), 30, seeds="blue")
    >>> ends = np.isin(foam.network.origin.reshape(-1, 2), foam.network.rim_vertices).any(axis=1)
    >>> part = wall_t1(foam, int(np.flatnonzero(ends)[0]))
    >>> foam.network.n_films - part.network.n_films, int(part.network.charges.sum())
    (1, 0)
    """
    if not isinstance(foam, Foam):
        raise TypeError(f"foam must be a Foam, got {type(foam).__name__}")
    network, surface = foam.network, foam.cell.surface
    lost = as_choice(kind, "kind", KINDS) == "film"
    chosen = as_indices([index], "index", (1,), below=network.n_films if lost else len(network.walls))
    if lost:
        ends = network.vertex_degrees[network.origin[[2 * chosen[0], 2 * chosen[0] + 1]]]
        if sorted(ends.tolist()) != [1, 3]:
            raise TopologyError(f"film {int(chosen[0])} does not join a threefold vertex to the rim")
        sites = film_sites(network, 2 * chosen + int(ends[0] == 1))
    else:
        sites = wall_sites(network, network.walls[chosen])
    after, source = rewire_walls(network, sites)
    span = 0.1 * foam.bubble_size
    if length is not None:
        span = as_number(length, "length", positive=True, maximum=foam.bubble_size)
    points, offsets = lay_walls(
        surface, network, foam.vertex_points, foam.film_offsets, sites, np.array([span])
    )
    return replace(
        foam,
        network=after,
        vertex_points=points,
        film_offsets=carried(offsets, source),
        pressures=None,
    )


def carried(offsets: Floats, source: Ints) -> Floats:
    """Rows of the films that stay, and straight new ones."""
    out = offsets[np.maximum(source, 0)]
    out[source < 0] = 0.0
    return out
