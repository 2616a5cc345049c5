"""Circuits round regions of bubbles, laid out in the honeycomb: holonomy and Burgers vectors, exactly.

A region is a set of bubbles; its rim is a closed walk along films that turns by 60° to the left or to the
right at every vertex of the honeycomb. Turning in the honeycomb as the walk turns in the foam *is* the
transport of a lattice frame round the region: no coordinates enter, all numbers are whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Bools, Ints, frozen
from warpedfoam.kernels.loops import loops_of
from warpedfoam.network import CellNetwork

#: Steps along the honeycomb's films at 0°, 60°, … 300°, in the basis (1, e^{iπ/3}) and film lengths.
STEPS = np.array([[1, 0], [0, 1], [-1, 1], [-1, 0], [0, -1], [1, -1]])
#: The basis as complex numbers.
BASIS = np.array([1.0, 0.5 + 0.5j * np.sqrt(3.0)])


@dataclass(frozen=True, eq=False)
class Circuits:
    """Rims of regions, walked with the region on the left.

    Attributes
    ----------
    halves : (m,) integer array
        Half-films of the rims, walk after walk.
    region : (m,) integer array
        Region of each.
    direction : (m,) integer array
        Its direction in the honeycomb, in steps of 60° from the first half-film of its walk.
    walks : (n_regions,) integer array
        Number of closed walks that make up the rim.
    euler : (n_regions,) integer array
        Euler number: 1 if the region is a disk.
    turning : (n_regions,) integer array
        Left turns less right turns, 6 euler − charge by Gauss–Bonnet.
    charge : (n_regions,) integer array
        Total charge Q; laid-out directions turn by −60° Q in one round of a disk.
    advance : (n_regions, 2) integer array
        End minus start of the laid-out walk in the basis (1, e^{iπ/3}), in film lengths. It means a
        translation where ``closed``.
    hexagons : (n_regions,) integer array
        Hexagons inside the laid-out walk, where it ends at its start.
    closed : (n_regions,) array of bool
        True for disks of charge 0.
    """

    halves: Ints
    region: Ints
    direction: Ints
    walks: Ints
    euler: Ints
    turning: Ints
    charge: Ints
    advance: Ints
    hexagons: Ints
    closed: Bools

    @property
    def disk(self) -> Bools:
        """True for regions that are disks."""
        out: Bools = (self.walks == 1) & (self.euler == 1)
        return out


def circuits(network: CellNetwork, labels: Ints, n_regions: int) -> Circuits:
    """Walk round every region at once.

    Parameters
    ----------
    network : CellNetwork
    labels : (n_bubbles,) integer array
        Region of each bubble, −1 for none. No bubble of a region may touch a rim of the surface.
    n_regions : int

    Examples
    --------
    Two neighbours of a cube's six: a disk of charge 4.

    >>> from warpedfoam import network_from_loops
    >>> cube = network_from_loops([(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4),
    ...                            (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])
    >>> found = circuits(cube, np.array([0, -1, 0, -1, -1, -1]), 1)
    >>> found.disk.tolist(), found.charge.tolist(), len(found.halves)
    ([True], [4], 6)
    """
    near = labels[network.bubble]
    far = near.reshape(-1, 2)[:, ::-1].ravel()
    chosen = np.flatnonzero((near >= 0) & (near != far))
    rim = np.zeros(len(near), dtype=bool)
    rim[chosen] = True
    follow = network.next[chosen]
    straight = rim[follow]
    # the next film lies inside the region: the one behind it is on the rim
    after = np.where(straight, follow, network.next[follow ^ 1])
    marker = network.vertex_degrees[network.origin[after]] == 2
    place = np.full(len(near), -1, dtype=np.int64)
    place[chosen] = np.arange(len(chosen))
    following = place[after]
    turn = np.empty(len(chosen), dtype=np.int64)  # on arriving at each half-film
    turn[following] = np.where(marker, 0, np.where(straight, 1, -1))
    walk = loops_of(following, near[chosen])
    halves = chosen[walk.halves]
    region = near[halves]
    turn = turn[walk.halves]
    heading = np.cumsum(turn)
    heading -= np.repeat(heading[walk.starts], walk.sizes)

    # a film in several pieces is one step, taken on its first piece
    corner = network.vertex_degrees[network.origin[halves]] == 3
    step = STEPS[heading % 6] * corner[:, None]
    advance = _sums(step, region, n_regions)
    reached = np.cumsum(step, axis=0) - step
    before = np.repeat(reached[walk.starts], walk.sizes, axis=0)
    place_of = reached - before
    twice = place_of[:, 0] * step[:, 1] - place_of[:, 1] * step[:, 0]
    # a hexagon has six of the triangles that the basis spans by halves
    hexagons = _sums(twice, region, n_regions)

    inside = labels >= 0
    count = np.bincount(labels[inside], minlength=n_regions)
    charge = _sums(network.charges[inside], labels[inside], n_regions)
    left, right = labels[network.left], labels[network.right]
    inner_films = np.bincount(left[(left == right) & (left >= 0)], minlength=n_regions)
    lowest = np.full(network.n_vertices, np.iinfo(np.int64).max)
    highest = np.full(network.n_vertices, -1)
    np.minimum.at(lowest, network.origin, near)
    np.maximum.at(highest, network.origin, near)
    inner_vertices = np.bincount(lowest[(lowest == highest) & (lowest >= 0)], minlength=n_regions)
    walks = np.bincount(region[walk.starts], minlength=n_regions)
    euler = count - inner_films + inner_vertices
    closed = (walks == 1) & (euler == 1) & (charge == 0)
    return Circuits(
        frozen(halves),
        frozen(region),
        frozen(heading % 6),
        frozen(walks),
        frozen(euler),
        frozen(_sums(turn, region, n_regions)),
        frozen(charge),
        frozen(advance),
        frozen(hexagons // 6),
        frozen(closed),
    )


def _sums(values: Ints, owner: Ints, count: int) -> Ints:
    out = np.zeros((count, *values.shape[1:]), dtype=np.int64)
    np.add.at(out, owner, values)
    return out
