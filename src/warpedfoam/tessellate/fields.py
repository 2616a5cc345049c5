"""Squared distances from every mesh node to its nearest seeds, by coloured heat solves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.places import Places
from warpedfoam.tessellate.colouring import colour_seeds
from warpedfoam.tessellate.domains import WHOLE, DividedHeat
from warpedfoam.tessellate.geodesics import HeatGeodesics, factored

#: Nearest seeds kept per node, and how far apart (in mean spacings) seeds of one colour lie.
CANDIDATES, APART = 12, 4.5


@dataclass(frozen=True, eq=False)
class SeedFields:
    """``seeds`` (n_nodes, k): the seeds nearest to each node; ``squares`` (n_nodes, k): d² to them."""

    mesh: TriangleMesh
    seeds: Ints
    squares: Floats

    def labels(self) -> Ints:
        """Seed that owns each node: least d²."""
        best = np.argmin(self.squares, axis=1)
        out: Ints = self.seeds[np.arange(len(best)), best]
        return out

    def weighted(self, weights: Floats) -> SeedFields:
        """The same with d² − w of each seed instead of d²: power cells."""
        return replace(self, squares=self.squares - weights[self.seeds])

    def square_to(self, nodes: Ints, seeds: Ints) -> tuple[Floats, Bools]:
        """d² from nodes to seeds (same shape), and whether it is known."""
        hit = self.seeds[nodes] == seeds[..., None]
        found = hit.any(axis=-1)
        place = np.argmax(hit, axis=-1)
        return np.take_along_axis(self.squares[nodes], place[..., None], axis=-1)[..., 0], found


def heat_solver(mesh: TriangleMesh, t: float) -> HeatGeodesics | DividedHeat:
    """What `seed_fields` measures with: the whole mesh factored once or, if it is large, domains of it.

    Foams on the same mesh share what was factored for the last.
    """
    if mesh.n_nodes <= WHOLE:
        return factored(mesh, t)
    mesh.require_surface()
    return DividedHeat(mesh, t)


def seed_fields(
    heat: HeatGeodesics | DividedHeat,
    seeds: Floats,
    spacing: float,
    progress: Callable[[float], None] | None = None,
) -> SeedFields:
    """Solve once per colour and keep, for every node, d² to its nearest seeds.

    A solve measures from the mesh node next to each seed. Its value at that node is taken off (a
    solve for many sources leaves a different offset at each), and the seed's distance from the node
    enters by the difference of the squared chords. Where another seed of the colour is nearer the
    field tells of that one: no distance may be shorter than the chord by more than an edge.

    Parameters
    ----------
    heat : HeatGeodesics or DividedHeat
        See `heat_solver`.
    seeds : (n, 3) array
        On the surface, distinct.
    spacing : float
        Mean distance of neighbouring seeds.
    progress : callable, optional
        Called with the fraction done after each solve.
    """
    nodes = heat.mesh.nodes
    count = min(CANDIDATES, len(seeds))
    period = heat.mesh.period
    chord, near = Places(seeds, period).nearest(nodes, count)
    chord, near = np.reshape(chord, (len(nodes), count)), np.reshape(near, (len(nodes), count))
    _, source = Places(nodes, period).nearest(seeds)
    colours = colour_seeds(seeds, APART * spacing, period)
    # seeds that share a source node must not share a solve: they do not, being close together
    if isinstance(heat, DividedHeat):
        distance = heat.from_seeds(source, colours, near, chord, progress)
    else:
        distance = _whole(heat, source, colours, near, progress)
    shift = nearest_image(nodes[:, None, :] - nodes[source[near]], period)
    straight = np.einsum("nki,nki->nk", shift, shift)
    np.maximum(distance, np.maximum(np.sqrt(straight) - heat.mesh.mean_edge, 0.0), out=distance)
    squares = distance**2 + chord**2 - straight
    return SeedFields(heat.mesh, near.astype(np.int64), squares)


def _whole(
    heat: HeatGeodesics,
    source: Ints,
    colours: Ints,
    near: Ints,
    progress: Callable[[float], None] | None,
) -> Floats:
    """Distances (n_nodes, k) from the seeds ``near`` each node, less those of the seeds' own nodes."""
    count, wanted = near.shape[1], colours[near.ravel()]
    order = np.argsort(wanted, kind="stable")
    n_colours = int(colours.max()) + 1
    bounds = np.searchsorted(wanted[order], np.arange(n_colours + 1))
    by_colour = np.argsort(colours, kind="stable")
    first = np.searchsorted(colours[by_colour], np.arange(n_colours + 1))
    out = np.empty(near.size)
    for colour in range(n_colours):
        field = heat.distances(source[by_colour[first[colour] : first[colour + 1]]])
        take = order[bounds[colour] : bounds[colour + 1]]
        out[take] = field[take // count] - field[source[near.ravel()[take]]]
        if progress is not None:
            progress((colour + 1) / n_colours)
    return out.reshape(near.shape)
