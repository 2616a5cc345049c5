"""Parting two bubbles of an open cluster whose film has the exterior at both ends; inverse of `join`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpedfoam.arrays import Floats, Ints, as_indices
from warpedfoam.errors import TopologyError
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.join import FRESH, exterior_of
from warpedfoam.moves.markers import Layout, divide, layout_of
from warpedfoam.moves.t1 import outward_tangents, pulls, t1_sites
from warpedfoam.network import CellNetwork


def may_part(network: CellNetwork, films: Ints, exterior: int) -> np.ndarray:
    """Whether films (k,) lie between bubbles with the exterior at both ends: a T1 would make a bridge."""
    sites = t1_sites(network, films)
    out: np.ndarray = (network.vertex_degrees[network.origin[np.stack([sites.a, sites.c])]] == 3).all(axis=0)
    out &= (sites.bubbles[:, 2:] == exterior).all(axis=1) & (sites.bubbles[:, :2] != exterior).all(axis=1)
    return out


def rewire_part(network: CellNetwork, film: int, exterior: int) -> CellNetwork:
    """The network without a film that has the exterior at both ends; its vertices become markers.

    The inverse of `rewire_join`: a T1 would leave a bridge with the exterior on both sides, which nothing
    but tension holds; it ruptures. The exterior's Euler number falls by 1.

    Raises
    ------
    TopologyError
        If the film has no exterior at both ends, or all of a bubble's outline is one film (divide it).
    """
    (chosen,) = as_indices([film], "film", (1,), below=network.n_films)
    if not may_part(network, np.array([chosen]), exterior)[0]:
        raise TopologyError(
            f"film {int(chosen)} cannot be parted: bubbles must lie on both of its sides and the exterior at "
            "both of its ends"
        )
    sites = t1_sites(network, np.array([chosen]))
    (a,), (c,), (before_a,), (into_a,), (before_c,), (into_b,) = (
        getattr(sites, name) for name in ("a", "c", "a0", "a1", "b0", "b1")
    )
    into_a, into_b, from_a, from_b = into_a ^ 1, into_b ^ 1, before_a ^ 1, before_c ^ 1
    if from_a == into_a or from_b == into_b:
        raise TopologyError(f"film {int(chosen)} cannot be parted: a film would begin and end at one vertex")
    following, origin = network.next.copy(), network.origin.copy()
    following[into_a], following[into_b] = from_a, from_b
    following[from_a ^ 1], following[from_b ^ 1] = into_a ^ 1, into_b ^ 1
    origin[from_a], origin[from_b] = network.origin[c], network.origin[a]
    kept = np.ones(len(following), dtype=np.bool_)
    kept[[a, c]] = False
    place = np.cumsum(kept) - 1
    euler = network.bubble_euler.copy()
    euler[exterior] -= 1
    return CellNetwork(place[following[kept]], origin[kept], network.bubble[kept], euler)


def part(foam: Foam, film: int) -> Foam:
    """Part two bubbles whose film has the exterior at both ends; it vanishes.

    This is what a T1 on it leads to: the film left over has the exterior on both sides, pulls its ends
    together and ruptures. Each bubble's outline closes over a marker where the film ended.

    Parameters
    ----------
    foam : Foam
        With an exterior.
    film : int

    Returns
    -------
    Foam
        With the same volumes to hold and no pressures.

    Raises
    ------
    TypeError, ValueError, TopologyError
        If there is no such film or it is none of the kind.

    Examples
    --------
    >>> from warpedfoam import FlatTorus, HeleShawCell, cluster_foam, relax
    >>> cell = HeleShawCell(FlatTorus(20.0, 20.0), gap=1.0)
    >>> foam = cluster_foam(cell, 2, volumes=1.0)
    >>> between = [f for f in range(foam.network.n_films)
    ...            if foam.exterior not in (foam.network.left[f], foam.network.right[f])]
    >>> apart = relax(part(foam, between[0]), contacts=False)
    >>> apart.foam.network.bubble_euler.tolist(), round(apart.energy, 6)
    ([1, 1, -2], 7.089815)
    """
    exterior = exterior_of(foam)
    (chosen,) = as_indices([film], "film", (1,), below=foam.network.n_films).tolist()
    surface = foam.cell.surface
    if not may_part(foam.network, np.array([chosen]), exterior)[0]:
        rewire_part(foam.network, chosen, exterior)  # says why
    layout = layout_of(foam)
    while (alone := _closing(layout.network, chosen)).size:
        # a film that goes all round its bubble is divided at thirds
        layout = divide(surface, layout, alone, np.full(len(alone), 1.0 / 3.0))
        rest = layout.network.n_films - len(alone) + np.arange(len(alone))
        layout = divide(surface, layout, rest, np.full(len(alone), 0.5))
    network = layout.network
    parted = rewire_part(network, chosen, exterior)
    gone = np.arange(network.n_films) != chosen
    points = _drawn_apart(foam, layout, chosen)
    return replace(
        foam,
        network=parted,
        vertex_points=points,
        film_offsets=layout.offsets[gone],
        pressures=None,
        exterior=exterior,
    )


def _closing(network: CellNetwork, film: int) -> Ints:
    """Films that begin and end at a film's two vertices, with the exterior on one side."""
    sites = t1_sites(network, np.array([film]))
    both = np.stack([sites.a0 >> 1, sites.b0 >> 1]), np.stack([sites.a1 >> 1, sites.b1 >> 1])
    return np.unique(both[0][both[0] == both[1]])


def _drawn_apart(foam: Foam, layout: Layout, film: int) -> Floats:
    """Vertices with the film's two ends each at its own bubble's side of the film's middle."""
    surface, network = foam.cell.surface, layout.network
    sites = t1_sites(network, np.array([film]))
    tangents = outward_tangents(surface, network, layout.points, layout.offsets, sites.outer)
    (a,), (c,) = sites.a, sites.c
    tail, head = network.origin[a], network.origin[c]
    chord = nearest_image(layout.points[head] - layout.points[tail], surface.period)
    middle = surface.project((layout.points[tail] + 0.5 * chord)[None])
    along = pulls(tangents)[1][0]
    normal = surface.normals(middle)[0]
    along = along - (along @ normal) * normal
    along = along / max(float(np.linalg.norm(along)), 1e-300)
    # as far as the film was long, but to be seen apart in any case
    reach = 0.5 * max(float(np.linalg.norm(chord)), 0.5 * FRESH * foam.bubble_size)
    ends = surface.project(np.concatenate([middle + reach * along, middle - reach * along]))
    # `rewire_part` gives the head to the bubble left of the film and the tail to the one on its right
    inward = tangents[0, 0] + tangents[0, 2]
    one, other = (head, tail) if float(inward @ along) > 0.0 else (tail, head)
    points = layout.points.copy()
    points[one], points[other] = ends
    return np.asarray(points)
