"""The T2: a small bubble vanishes and the films round it meet where it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints, as_indices
from warpedfoam.errors import TopologyError
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.markers import Layout, merge, removable
from warpedfoam.moves.t1 import allowed, t1, t1_sites
from warpedfoam.network import CellNetwork


def rewire_t2(network: CellNetwork, bubble: int) -> tuple[CellNetwork, Ints, Ints]:
    """The network without one bubble, all of whose vertices become one.

    Three sides leave a threefold vertex, two a marker; two films and a wall leave a rim vertex; one film
    and a wall, or a bubble alone in what is no disk, leave nothing. Σ q + 6 · (Euler numbers of what is no
    disk) stays as it was.

    Parameters
    ----------
    network : CellNetwork
    bubble : int

    Returns
    -------
    CellNetwork
        Bubbles, films and vertices are numbered as before, those that are gone left out. The vertex that
        is left is the bubble's lowest.
    films, vertices : integer arrays
        The old numbers of those that are left.

    Raises
    ------
    TopologyError
        If the bubble is no disk, has more sides than that, or a film would begin and end at one vertex.
    """
    (chosen,) = as_indices([bubble], "bubble", (1,), below=network.n_bubbles).tolist()
    halves = np.flatnonzero(network.bubble == chosen)
    corners, walls = int(network.sides[chosen]), int(network.wall_counts[chosen])
    inner = corners - 2 * walls
    if network.bubble_euler[chosen] != 1:
        raise TopologyError(f"bubble {chosen} is no disk and cannot vanish")
    if (inner, walls) not in VANISHING:
        raise TopologyError(
            f"bubble {chosen} has {_sides(network, chosen)}: only one of two or three films, of one or two "
            "films and a wall, or alone in the exterior, can vanish; turn its films first (t1)"
        )
    if network.n_bubbles < 3:
        raise TopologyError("the last bubble but one cannot vanish")
    outer = halves ^ 1
    if np.isin(network.next[outer], outer).all() and walls:
        raise TopologyError(f"without bubble {chosen} no film would end on a loop of the rim")
    around = np.unique(network.bubble[outer])
    euler = network.bubble_euler.copy()
    if inner == 0 and walls == 0:
        if network.bubble_euler[around[0]] == 1:
            raise TopologyError(f"bubble {chosen} is all that parts the others")
        euler[around[0]] += 1
    following, origin = network.next.copy(), network.origin.copy()
    before = np.empty_like(following)
    before[following] = np.arange(len(following))
    gone = np.zeros(len(following), dtype=np.bool_)
    gone[halves] = gone[outer] = True
    # what came before a film of the bubble is followed by what comes after all of them
    beside = outer[~gone[before[outer]]]
    ahead = following[beside]
    while gone[ahead].any():
        ahead = np.where(gone[ahead], following[ahead], ahead)
    following[before[beside]] = ahead
    at = np.unique(network.origin[halves])
    origin[np.isin(origin, at)] = at[0]
    stays = ~gone
    lives = np.zeros(network.n_vertices, dtype=np.bool_)
    lives[origin[stays]] = True
    place, name = np.cumsum(stays) - 1, np.cumsum(lives) - 1
    number = np.arange(network.n_bubbles) - (np.arange(network.n_bubbles) > chosen)
    out = CellNetwork(
        place[following[stays]],
        name[origin[stays]],
        number[network.bubble[stays]],
        np.delete(euler, chosen),
    )
    if (out.tails == out.heads).any():
        raise TopologyError(f"without bubble {chosen} a film would begin and end at one vertex")
    return out, np.flatnonzero(stays[0::2]), np.flatnonzero(lives)


#: Two films become one if they are not longer together, in bubble sizes: a marker stays on half a turn.
MERGED = 1.5
#: Lengths of turned films that are tried, in those of the old.
SHARES = (1.0, 0.5, 0.25, 0.1)
#: Films' corners inside and walls of bubbles that can vanish.
VANISHING = frozenset({(3, 0), (2, 0), (0, 0), (1, 1), (0, 1)})


def _sides(network: CellNetwork, bubble: int) -> str:
    walls = int(network.wall_counts[bubble])
    films = int(network.sides[bubble]) - walls
    return f"{films} films" + (f" and {walls} wall{'s' if walls > 1 else ''}" if walls else "")


def t2(foam: Foam, bubble: int) -> Foam:
    """Let a bubble vanish: its films go, the films round it meet in its middle.

    A bubble of more than three sides first loses them, shortest film first, by T1s. Its volume to hold
    goes to its neighbours, by the area of the films that it shared with them. Nothing is relaxed.

    Parameters
    ----------
    foam : Foam
    bubble : int
        Its number; small, since what is round it is not moved.

    Returns
    -------
    Foam
        One bubble less; the others keep their ids, and pressures if there are any.

    Raises
    ------
    TypeError, ValueError
        If there is no such bubble, or it is the exterior.
    TopologyError
        If it cannot vanish (see `rewire_t2`), or is so large that what is left of the films is no foam.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, relax, voronoi_foam
    >>> foam = relax(voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), 30, seeds="blue")).foam
    >>> fewer = t2(foam, 7)
    >>> fewer.n_bubbles, int(fewer.network.charges.sum()), 7 in fewer.bubble_ids
    (29, 12, False)
    """
    if not isinstance(foam, Foam):
        raise TypeError(f"foam must be a Foam, got {type(foam).__name__}")
    (chosen,) = as_indices([bubble], "bubble", (1,), below=foam.n_bubbles).tolist()
    if chosen == foam.exterior:
        raise ValueError(f"bubble {chosen} is the exterior, which has what is left")
    if foam.n_bubbles < 3:
        raise TopologyError("the last bubble but one cannot vanish")
    pressures, targets = foam.pressures, _shared_out(foam, chosen)
    shed = _without_sides(foam, chosen)
    network, films, vertices = rewire_t2(shed.network, chosen)
    surface = foam.cell.surface
    points = shed.vertex_points.copy()
    at = np.unique(shed.network.origin[shed.network.bubble == chosen])
    points[at[0]] = _middle(shed, at)
    layout = Layout(network, points[vertices], shed.film_offsets[films], films)
    if at[0] in vertices:
        merged = np.searchsorted(vertices, at[:1])
        if network.vertex_degrees[merged[0]] == 2 and removable(network, merged)[0]:
            beside = films[np.flatnonzero(network.origin == merged[0]) >> 1]
            if shed.film_lengths[beside].sum() < MERGED * foam.bubble_size:
                layout, _ = merge(surface, layout, merged)
    exterior = foam.exterior
    try:
        return replace(
            foam,
            network=layout.network,
            vertex_points=layout.points,
            film_offsets=layout.offsets,
            target_volumes=targets,
            bubble_ids=np.delete(foam.bubble_ids, chosen),
            pressures=None if pressures is None else np.delete(pressures, chosen),
            exterior=None if exterior is None else exterior - (chosen < exterior),
        )
    except ValueError as fault:
        raise TopologyError(
            f"without bubble {chosen} there is no foam ({fault}); let it shrink first"
        ) from fault


def _shared_out(foam: Foam, bubble: int) -> Floats:
    """Volumes to hold, (n − 1,), once a bubble's is shared by its neighbours."""
    network = foam.network
    mine = network.left == bubble
    theirs = np.where(mine, network.right, network.left)
    beside = mine | (network.right == bubble)
    share = np.bincount(theirs[beside], foam.film_areas[beside], foam.n_bubbles)
    targets = foam.target_volumes + foam.target_volumes[bubble] * share / share.sum()
    out = np.delete(targets, bubble)
    out *= foam.cell.volume / out.sum()
    return out


def _without_sides(foam: Foam, bubble: int) -> Foam:
    """The foam after T1s on the shortest films of a bubble, until it may vanish."""
    while True:
        network = foam.network
        inner = int(network.sides[bubble] - 2 * network.wall_counts[bubble])
        if inner <= (1 if network.wall_counts[bubble] else 3):
            return foam
        films = np.unique(np.flatnonzero(network.bubble == bubble) >> 1)
        films = films[_may_turn(network, films)]
        if not films.size:
            raise TopologyError(
                f"bubble {bubble} has {_sides(network, bubble)} and cannot vanish: none of them may turn"
            )
        film = int(films[np.argmin(foam.film_lengths[films])])
        foam = _turned(foam, film, bubble)


def _turned(foam: Foam, film: int, bubble: int) -> Foam:
    """After a T1, the new film shorter where it would not lie on the surface."""
    length = min(float(foam.film_lengths[film]), foam.bubble_size)
    for share in SHARES:
        try:
            return t1(foam, film, length=share * length)
        except ValueError as error:
            fault = error
    raise TopologyError(
        f"bubble {bubble} is too large to vanish where it is: without its film {film} there is no foam "
        f"({fault}); let it shrink first"
    ) from fault


def _may_turn(network: CellNetwork, films: Ints) -> Bools:
    return allowed(network, t1_sites(network, films))


def _middle(foam: Foam, vertices: Ints) -> Floats:
    """Where the films meet: the mean of the corners, or on the rim."""
    network, surface = foam.network, foam.cell.surface
    points = foam.vertex_points
    onfold = vertices[network.vertex_degrees[vertices] == 1]
    shape = network.vertex_degrees[vertices] == 3
    corners = vertices[shape] if shape.any() else vertices
    first = points[corners[0]]
    away = nearest_image(points[corners] - first, surface.period)
    middle: Floats = surface.project((first + away.mean(axis=0))[None])[0]
    if len(onfold) and surface.rim is not None:
        middle = surface.rim.nearest(middle[None])[0]
    return middle
