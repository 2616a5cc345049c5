"""The T1: two bubbles lose the film between them, their two neighbours gain one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Bools, Floats, Ints, as_indices, as_number
from warpedfoam.errors import TopologyError
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.network import CellNetwork
from warpedfoam.surfaces.protocol import Surface


@dataclass(frozen=True)
class T1Event:
    """One T1: which bubbles, where, and the energy of its films just before and after.

    At a wall a film is lost to the rim or pulled out of it: then one side has a single bubble.

    Attributes
    ----------
    iteration : int
        Newton step after which it was made.
    film : int
        The film that turned; at a wall the one that was lost, as numbered before, or the new one.
    losers, gainers : tuple of int
        Ids of the bubbles that lost a side and of those that gained one (at a wall: whose charge rose
        and fell).
    position : tuple of three float
        Middle of the film, on the inner plate.
    energy_before, energy_after : float
        γ Σ areas of the film and its neighbours, before any further relaxation.
    """

    iteration: int
    film: int
    losers: tuple[int, ...]
    gainers: tuple[int, ...]
    position: tuple[float, float, float]
    energy_before: float
    energy_after: float


@dataclass(frozen=True, eq=False)
class T1Sites:
    """The half-films round films that might turn; arrays (k,).

    ``a``, ``c`` are the film's half-films, ``a0``/``a1`` and ``b0``/``b1`` the ones before and after
    them on their bubbles. ``bubbles`` (k, 4): the two beside the film, then the ones at its ends.
    """

    a: Ints
    c: Ints
    a0: Ints
    a1: Ints
    b0: Ints
    b1: Ints
    bubbles: Ints

    @property
    def outer(self) -> Ints:
        """Outgoing half-films of the four neighbours: twin(a0), b1 at the tail, a1, twin(b0) at the head."""
        return np.stack([self.a0 ^ 1, self.b1, self.a1, self.b0 ^ 1], axis=1)


def t1_sites(network: CellNetwork, films: Ints) -> T1Sites:
    """Half-films and bubbles round each of ``films`` (k,)."""
    before = np.empty_like(network.next)
    before[network.next] = np.arange(len(before))
    a, c = 2 * films, 2 * films + 1
    a1, b1 = network.next[a], network.next[c]
    ends = np.stack([network.bubble[a], network.bubble[c], network.bubble[a1 ^ 1], network.bubble[b1 ^ 1]])
    return T1Sites(a, c, before[a], a1, before[c], b1, ends.T)


def allowed(network: CellNetwork, sites: T1Sites) -> Bools:
    """Whether each T1 leaves a network: four different bubbles, losers of at least four sides, no marker.

    What is no disk, such as an exterior, may be any of the four: its loop only loses or gains one film,
    and having different neighbours at the film's ends keeps two films at least.
    """
    beside = sites.bubbles[:, :2]
    sides = ((network.sides[beside] >= 4) | (network.bubble_euler[beside] != 1)).all(axis=1)
    ordered = np.sort(sites.bubbles, axis=1)
    distinct = (np.diff(ordered, axis=1) > 0).all(axis=1)
    threefold = (network.vertex_degrees[network.origin[np.stack([sites.a, sites.c])]] == 3).all(axis=0)
    out: Bools = sides & distinct & threefold
    return out


def rewire(network: CellNetwork, films: ArrayLike) -> CellNetwork:
    """Turn several films at once: the network after a T1 on each.

    Parameters
    ----------
    network : CellNetwork
    films : (k,) integer array
        No bubble may take part in two of the T1s.

    Returns
    -------
    CellNetwork
        Four T1s on one film give the first network back.

    Raises
    ------
    TopologyError
        If a film may not turn (its four bubbles are not four different ones, a loser is a disk of fewer
        than four sides, an end is a marker), or two of the T1s share a bubble.
    """
    chosen = as_indices(films, "films", (None,), below=network.n_films)
    sites = t1_sites(network, chosen)
    fine = allowed(network, sites)
    if not fine.all():
        raise TopologyError(
            f"film {int(chosen[~fine][0])} cannot turn: its four bubbles must differ, "
            "the two beside it must have at least four sides, and both its ends must be threefold"
        )
    if len(np.unique(sites.bubbles)) != sites.bubbles.size:
        raise TopologyError("two of the T1s share a bubble; make them one after the other")
    return _rewired(network, sites)


def _rewired(network: CellNetwork, sites: T1Sites) -> CellNetwork:
    following, origin, bubble = network.next.copy(), network.origin.copy(), network.bubble.copy()
    a, c, a0, a1, b0, b1 = sites.a, sites.c, sites.a0, sites.a1, sites.b0, sites.b1
    following[a0], following[b0] = a1, b1
    following[a1 ^ 1], following[a] = a, b0 ^ 1
    following[b1 ^ 1], following[c] = c, a0 ^ 1
    origin[a1], origin[b1] = origin[a], origin[c]
    bubble[a], bubble[c] = sites.bubbles[:, 2], sites.bubbles[:, 3]
    return CellNetwork(following, origin, bubble, network.bubble_euler)


def independent(bubbles: Ints, priority: Floats) -> Bools:
    """A set of sites with no bubble in common: each has the greatest priority of its ``bubbles`` (k, m)."""
    rank = np.empty(len(priority), dtype=np.int64)
    rank[np.argsort(priority, kind="stable")] = np.arange(len(priority))
    best = np.full(int(bubbles.max(initial=-1)) + 1, -1, dtype=np.int64)
    np.maximum.at(best, bubbles, rank[:, None])
    out: Bools = (best[bubbles] == rank[:, None]).all(axis=1)
    return out


def outward_tangents(
    surface: Surface, network: CellNetwork, points: Floats, offsets: Floats, halves: Ints
) -> Floats:
    """Unit tangents of half-films (…,) where they start, (…, 3)."""
    film, back = halves >> 1, (halves & 1).astype(bool)
    rule = lobatto(offsets.shape[1] + 1)
    flat = film.ravel()
    curve = surface.arc_points(
        points[network.tails[flat]], points[network.heads[flat]], offsets[flat], rule.nodes
    )
    ends: Floats = np.where(
        back.ravel()[:, None],
        -np.einsum("k,fkx->fx", rule.derivative[-1], curve),
        np.einsum("k,fkx->fx", rule.derivative[0], curve),
    )
    ends /= np.linalg.norm(ends, axis=1, keepdims=True)
    out: Floats = ends.reshape(*halves.shape, 3)
    return out


def pulls(tangents: Floats) -> tuple[Floats, Floats]:
    """Pull of the four neighbours on the film's tail against its head: now, and after a T1.

    ``tangents`` (k, 4, 3) in the order of `T1Sites.outer`. If the film is short, its energy falls at
    the rate |pull|/2 − 1 per length as it grows along the pull, so the larger pull wins.
    """
    a0, b1, a1, b0 = (tangents[:, i] for i in range(4))
    return a0 + b1 - a1 - b0, a0 + a1 - b0 - b1


def local_energy(foam: Foam, films: Ints) -> Floats:
    """γ times the areas of each film and its four neighbours, (k,)."""
    around = t1_sites(foam.network, films).outer >> 1
    five = np.concatenate([films[:, None], around], axis=1)
    out: Floats = foam.tension * foam.film_areas[five].sum(axis=1)
    return out


def t1(foam: Foam, film: int, *, length: float | None = None) -> Foam:
    """Make one T1 and lay the new film across the old one's middle.

    The new film runs along the pull of its four neighbours, with straight shape; nothing is relaxed.

    Parameters
    ----------
    foam : Foam
    film : int
        The film that turns.
    length : float, optional
        Length of the new film, at most the bubble size; a tenth of that by default.

    Returns
    -------
    Foam
        With the same volumes to hold and no pressures.

    Raises
    ------
    ValueError, TopologyError
        If there is no such film, or it may not turn (see `rewire`).
    """
    if not isinstance(foam, Foam):
        raise TypeError(f"foam must be a Foam, got {type(foam).__name__}")
    chosen = as_indices([film], "film", (1,), below=foam.network.n_films)
    sites = t1_sites(foam.network, chosen)
    network = rewire(foam.network, chosen)
    surface = foam.cell.surface
    tangents = outward_tangents(surface, foam.network, foam.vertex_points, foam.film_offsets, sites.outer)
    span = 0.1 * foam.bubble_size
    if length is not None:
        span = as_number(length, "length", positive=True, maximum=foam.bubble_size)
    points, offsets = lay_films(
        surface,
        foam.network,
        foam.vertex_points,
        foam.film_offsets,
        sites,
        pulls(tangents)[1],
        np.array([span]),
    )
    return replace(foam, network=network, vertex_points=points, film_offsets=offsets, pressures=None)


def lay_films(
    surface: Surface,
    network: CellNetwork,
    points: Floats,
    offsets: Floats,
    sites: T1Sites,
    along: Floats,
    length: Floats,
) -> tuple[Floats, Floats]:
    """Points and offsets with each site's film laid along ``along`` (k, 3), about its middle."""
    tail, head = network.origin[sites.a], network.origin[sites.c]
    middle = surface.project(points[tail] + 0.5 * nearest_image(points[head] - points[tail], surface.period))
    normal = surface.normals(middle)
    flat = along - np.einsum("ki,ki->k", along, normal)[:, None] * normal
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    moved, straight = points.copy(), offsets.copy()
    half = 0.5 * length[:, None] * flat
    moved[tail] = surface.project(middle + half)
    moved[head] = surface.project(middle - half)
    straight[sites.a >> 1] = 0.0
    straight[sites.outer >> 1] = 0.0
    return moved, straight
