"""`Foam`: a cell network laid out in a Hele-Shaw cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, Ints, as_floats, as_indices, as_integer, as_number, as_points, frozen
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import TopologyError
from warpedfoam.kernels.periodic import loop_shifts, nearest_image
from warpedfoam.kernels.quadrature import gauss, lobatto
from warpedfoam.network import CellNetwork, network_from_loops
from warpedfoam.surfaces.protocol import Layer

if TYPE_CHECKING:
    import networkx as nx


#: Highest polynomial order of films.
MAX_ORDER = 24


@dataclass(frozen=True, eq=False)
class Walls:
    """Arcs of the rim between neighbouring rim vertices, the surface on the left of each; arrays (n_walls,).

    ``bubble`` ends there; ``tails`` and ``heads`` are the rim vertices; ``loop``, ``first`` and ``last``
    their places on the surface's `Rim`.
    """

    bubble: Ints
    tails: Ints
    heads: Ints
    loop: Ints
    first: Floats
    last: Floats


@dataclass(frozen=True, eq=False)
class Foam:
    """A foam one bubble thick: topology, vertex positions, film shapes and the volumes to hold.

    A film of order p is a polynomial arc over the segment between its end vertices, with a
    transverse offset (in units of the segment) at each of its p − 1 interior Gauss–Lobatto nodes,
    positive to the left. Through the gap it is ruled by the surface's normals.

    Parameters
    ----------
    cell : HeleShawCell
    network : CellNetwork
        Of the same Euler characteristic as the surface.
    vertex_points : (n_vertices, 3) array
        On the surface, to 1e-9 of its size.
    film_offsets : (n_films, p − 1) array, optional
        Straight films of order 4 by default.
    target_volumes : (n_bubbles,) array, optional
        Above 0, adding up to the cell's volume; the present volumes by default.
    bubble_ids : (n_bubbles,) integer array, optional
        Names that stay with the bubbles; 0 … n − 1 by default.
    tension : float, optional
        γ, energy per film area, both faces included.
    pressures : (n_bubbles,) array, optional
        Pressures found by `warpedfoam.relax`.
    seed : int, optional
        The random seed that the foam came from.
    exterior : int, optional
        The bubble that is the rest of the cell round open clusters: at pressure 0, with the volume that
        is left. By default the only bubble that is no disk, if there is just one; round one cluster on a
        sphere the exterior is a disk too and must be named.

    Raises
    ------
    TypeError, ValueError
        Wrong types, shapes, or values that contradict each other.
    TopologyError
        If the network's Euler characteristic is not the surface's.
    """

    cell: HeleShawCell
    network: CellNetwork
    vertex_points: Floats
    film_offsets: Floats
    target_volumes: Floats
    bubble_ids: Ints
    tension: float
    pressures: Floats | None
    seed: int | None
    exterior: int | None

    def __init__(
        self,
        cell: HeleShawCell,
        network: CellNetwork,
        vertex_points: ArrayLike,
        film_offsets: ArrayLike | None = None,
        target_volumes: ArrayLike | None = None,
        bubble_ids: ArrayLike | None = None,
        tension: float = 1.0,
        pressures: ArrayLike | None = None,
        seed: int | None = None,
        exterior: int | None = None,
    ) -> None:
        if not isinstance(cell, HeleShawCell):
            raise TypeError(f"cell must be a HeleShawCell, got {type(cell).__name__}")
        if not isinstance(network, CellNetwork):
            raise TypeError(f"network must be a CellNetwork, got {type(network).__name__}")
        put = object.__setattr__
        put(self, "cell", cell)
        put(self, "network", network)
        put(self, "tension", as_number(tension, "tension", positive=True))
        put(self, "seed", None if seed is None else as_integer(seed, "seed", minimum=0))
        if exterior is not None:
            exterior = as_integer(exterior, "exterior", minimum=0, maximum=network.n_bubbles - 1)
        elif (odd := np.flatnonzero(network.bubble_euler != 1)).size == 1:
            exterior = int(odd[0])
        put(self, "exterior", exterior)
        chi = cell.surface.euler_characteristic
        if network.euler_characteristic != chi:
            raise TopologyError(
                f"the network has Euler characteristic {network.euler_characteristic}, its surface {chi}"
            )
        points = as_points(vertex_points, "vertex_points")
        if len(points) != network.n_vertices:
            raise ValueError(
                f"vertex_points must hold {network.n_vertices} points, one per vertex, got {len(points)}"
            )
        size = cell.surface.size
        away = np.linalg.norm(cell.surface.project(points) - points, axis=1)
        if away.max() > 1e-9 * size:
            raise ValueError(
                f"vertex_points must lie on the surface, but vertex {int(away.argmax())} is "
                f"{away.max():g} away; project them first (cell.surface.project)"
            )
        put(self, "vertex_points", frozen(points))
        self._check_rim()
        if film_offsets is None:
            film_offsets = np.zeros((network.n_films, 3))
        offsets = as_floats(film_offsets, "film_offsets", (network.n_films, None))
        if offsets.shape[1] >= MAX_ORDER:
            raise ValueError(f"film_offsets must be of order {MAX_ORDER} at most, got {offsets.shape[1] + 1}")
        put(self, "film_offsets", frozen(offsets))
        if target_volumes is None:
            targets = self.bubble_volumes
        else:
            targets = as_floats(target_volumes, "target_volumes", (network.n_bubbles,))
        # the loops of a bubble that is no disk do not tell its volume; an exterior has what is left
        disks = bool((network.bubble_euler == 1).all()) and exterior is None
        allowed = cell.surface.precision * cell.volume
        # a draft is enough to see that nothing is amiss
        draft = bubble_integrals(cell, network, points, offsets, replace(cell.layer, rays=2))
        if disks and not abs(draft.sum() - cell.volume) <= allowed:
            total = float(self.bubble_volumes.sum())
        else:
            total = cell.volume
        if disks and not abs(total - cell.volume) <= allowed:
            raise ValueError(
                f"the bubbles' volumes add up to {total:.9g}, not to the cell's {cell.volume:.9g}: "
                "the loops must run counter-clockwise seen from outside and cover the surface once, "
                "and no film may span half a turn"
            )
        if (targets <= 0.0).any():
            bad = int(np.argmin(targets))
            raise ValueError(f"target_volumes must be above 0, but bubble {bad} has {targets[bad]:g}")
        if abs(targets.sum() - cell.volume) > 1e-9 * cell.volume:
            raise ValueError(
                f"target_volumes must add up to the cell's volume {cell.volume:.12g}, "
                f"got {targets.sum():.12g}; "
                "scale them by the ratio"
            )
        put(self, "target_volumes", frozen(targets))
        if bubble_ids is None:
            bubble_ids = np.arange(network.n_bubbles)
        ids = as_indices(bubble_ids, "bubble_ids", (network.n_bubbles,))
        if len(np.unique(ids)) != len(ids):
            raise ValueError("bubble_ids must differ from each other")
        put(self, "bubble_ids", frozen(ids))
        if pressures is not None:
            pressures = frozen(as_floats(pressures, "pressures", (network.n_bubbles,)))
        put(self, "pressures", pressures)

    def _check_rim(self) -> None:
        """Rim vertices lie on the rim, and walls go once round each of its loops."""
        network, rim, size = self.network, self.cell.surface.rim, self.cell.surface.size
        n_loops = 0 if rim is None else rim.n_loops
        # an exterior may hold whole loops of the rim on which no film ends
        if len(network.rim_cycles) != n_loops and not (
            self.exterior is not None and len(network.rim_cycles) < n_loops
        ):
            raise TopologyError(
                f"the network's walls make {len(network.rim_cycles)} loops, the surface's rim has {n_loops}"
            )
        if rim is None or not len(network.rim_vertices):
            return
        at = self.vertex_points[network.rim_vertices]
        away = np.linalg.norm(rim.nearest(at) - at, axis=1)
        if away.max() > 1e-9 * size:
            raise ValueError(
                f"rim vertices must lie on the rim, but vertex {int(network.rim_vertices[away.argmax()])} is "
                f"{away.max():g} away"
            )
        walls = self.walls
        for cycle in network.rim_cycles:
            turns = (walls.last - walls.first)[cycle].sum() / rim.lengths[walls.loop[cycle[0]]]
            if abs(turns - 1.0) > 1e-6 or len(np.unique(walls.loop[cycle])) > 1:
                raise ValueError(
                    "walls must follow each other round a loop of the rim, the surface on their left, but "
                    f"the one of vertex {int(network.origin[network.walls[cycle[0]] ^ 1])} do not"
                )

    @classmethod
    def from_loops(
        cls,
        cell: HeleShawCell,
        vertex_points: ArrayLike,
        loops: Sequence[Sequence[int]],
        *,
        order: int = 4,
        target_volumes: ArrayLike | None = None,
    ) -> Foam:
        """Foam of bubbles given as counter-clockwise loops of vertices; points are projected.

        Examples
        --------
        >>> import numpy as np
        >>> from warpedfoam import HeleShawCell, Sphere
        >>> points = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])
        >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
        >>> foam = Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)
        >>> round(float(foam.film_lengths.sum()), 8)
        11.46379942
        """
        if not isinstance(cell, HeleShawCell):
            raise TypeError(f"cell must be a HeleShawCell, got {type(cell).__name__}")
        rim = cell.surface.rim
        network = network_from_loops(loops, rims=rim is not None)
        points = cell.surface.project(as_points(vertex_points, "vertex_points"))
        if rim is not None and len(points) == network.n_vertices:
            points[network.rim_vertices] = rim.nearest(points[network.rim_vertices])
        n = as_integer(order, "order", minimum=2, maximum=MAX_ORDER) - 1
        return cls(cell, network, points, np.zeros((network.n_films, n)), target_volumes)

    @property
    def order(self) -> int:
        """p, the polynomial order of the films."""
        return int(self.film_offsets.shape[1]) + 1

    @property
    def n_bubbles(self) -> int:
        """Number of bubbles."""
        return self.network.n_bubbles

    @property
    def bubble_size(self) -> float:
        """ℓ = sqrt(area of the surface / number of bubbles), the unit of length; an exterior left out."""
        area = self.cell.surface.area
        if self.exterior is None:
            return float(np.sqrt(area / self.n_bubbles))
        held = np.delete(self.target_volumes, self.exterior)
        return float(np.sqrt(area * held.mean() / self.cell.volume))

    @property
    def film_ends(self) -> tuple[Floats, Floats]:
        """Points where each film starts and ends (its image next to the start), two (n_films, 3) arrays."""
        tail, head = self.vertex_points[self.network.tails], self.vertex_points[self.network.heads]
        if self.cell.surface.period is not None:
            head = tail + nearest_image(head - tail, self.cell.surface.period)
        return tail, head

    @cached_property
    def walls(self) -> Walls:
        """The arcs of the rim on which bubbles end; none on a surface without rim."""
        network, rim = self.network, self.cell.surface.rim
        tails = network.origin[network.walls ^ 1]
        heads = network.origin[network.next[network.walls]]
        loop, first, last = np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)
        if rim is not None and len(tails):
            loop, first, last = rim.spans(self.vertex_points[tails], self.vertex_points[heads])
        bubble = network.bubble[network.walls]
        return Walls(*(frozen(array) for array in (bubble, tails, heads, loop, first, last)))

    @cached_property
    def wall_turning(self) -> Floats:
        """∮ κ_g ds along the walls of each bubble, corners included, (n_bubbles,)."""
        rim, walls = self.cell.surface.rim, self.walls
        turned = np.zeros(0) if rim is None else rim.turning(walls.loop, walls.first, walls.last)
        return frozen(np.bincount(walls.bubble, turned, self.n_bubbles).astype(np.float64, copy=False))

    def wall_points(self, k: int) -> tuple[Floats, Ints]:
        """Points along the walls for drawing: (m, 3) with the wall of each, (m,), both ends left out.

        About ``k`` on a bubble size, and the rim's corners.
        """
        rim, walls = self.cell.surface.rim, self.walls
        if rim is None:
            return np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
        wall, low, high = rim.pieces(walls.loop, walls.first, walls.last)
        count = np.maximum(np.ceil((high - low) * (k / self.bubble_size)), 1.0).astype(np.int64)
        piece = np.repeat(np.arange(len(wall)), count)
        within = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
        u = low[piece] + within * ((high - low) / count)[piece]
        inner = u > walls.first[wall[piece]]
        at = rim.at(walls.loop[wall[piece]][inner], u[inner])
        return at, wall[piece][inner]

    @cached_property
    def film_areas(self) -> Floats:
        """Area of each ruled film, ∫₀ᵈ∫ |(I + tW)T| ds dt, (n_films,)."""
        return self._measure(self.cell.layer)

    @cached_property
    def film_lengths(self) -> Floats:
        """Length of each film on the inner plate, (n_films,)."""
        return self._measure(Layer.surface())

    @property
    def energy(self) -> float:
        """E = γ Σ film areas."""
        return self.tension * float(self.film_areas.sum())

    @cached_property
    def bubble_volumes(self) -> Floats:
        """Steiner volume of each bubble, ∫ (d + H d² + G d³/3) dA, (n_bubbles,)."""
        return self._inside(self.cell.layer)

    @cached_property
    def bubble_areas(self) -> Floats:
        """Area of each bubble on the inner plate, (n_bubbles,)."""
        return self._inside(Layer.surface())

    @cached_property
    def bubble_curvatures(self) -> Floats:
        """Integrated Gaussian curvature ∫ G dA of each bubble, (n_bubbles,)."""
        return self._inside(Layer.curvature())

    @cached_property
    def bubble_centres(self) -> Floats:
        """Mean point of each bubble's boundary, projected on the surface, (n_bubbles, 3)."""
        nodes, weights = gauss(3)
        points = np.einsum("q,fqx->fx", weights, self.film_curves_at(nodes))
        tail, head = self.film_ends
        halves, count = self.network.loops.halves, self.n_bubbles
        film, owner = halves >> 1, self.network.bubble[halves]
        sign = np.where(halves & 1, -1.0, 1.0)[:, None]
        weight = self.film_lengths[film][:, None]
        middle = points[film]
        shifts = self.loop_shifts
        if shifts is not None:
            middle = middle + shifts
        parts = np.hstack([weight * middle, sign * np.cross(middle, (head - tail)[film]), weight])
        if len(self.walls.bubble):
            parts = np.concatenate([parts, self._wall_parts()])
            owner = np.concatenate([owner, self.walls.bubble])
        sums = np.stack([np.bincount(owner, part, minlength=count) for part in parts.T], axis=1)
        # a hair along the loop's vector area, so that a hemisphere has a centre too
        normal = sums[:, 3:6] / np.maximum(np.linalg.norm(sums[:, 3:6], axis=1, keepdims=True), 1e-300)
        mean = sums[:, :3] / sums[:, 6:] + 1e-3 * self.bubble_size * normal
        return frozen(self.cell.surface.project(mean))

    def _wall_parts(self) -> Floats:
        """Length times middle, middle × chord and length of each wall, (n_walls, 7)."""
        rim, walls = self.cell.surface.rim, self.walls
        assert rim is not None
        wall, low, high = rim.pieces(walls.loop, walls.first, walls.last)
        nodes, loop = lobatto(2), walls.loop[wall]
        start, middle, end = rim.nodes(nodes, loop, low, high)
        length = np.linalg.norm(end - start, axis=1)[:, None]
        parts = np.hstack([length * middle, np.cross(middle, end - start), length])
        return np.stack([np.bincount(wall, part, len(walls.bubble)) for part in parts.T], axis=1)

    @cached_property
    def loop_shifts(self) -> Floats | None:
        """Whole periods (m, 3) that join the half-films of ``network.loops`` next to the origin, or None."""
        if self.cell.surface.period is None:
            return None
        loops, (tail, head) = self.network.loops, self.film_ends
        film, back = loops.halves >> 1, (loops.halves & 1).astype(bool)[:, None]
        start, end = np.where(back, head[film], tail[film]), np.where(back, tail[film], head[film])
        shifts = loop_shifts(start, end, loops, self.cell.surface.period)
        assert shifts is not None
        # of all images of a bubble take the one next to the origin
        middle = np.add.reduceat(start + shifts, loops.starts) / loops.sizes[:, None]
        inward = nearest_image(middle, self.cell.surface.period) - middle
        return shifts + np.repeat(inward, loops.sizes, axis=0)

    def film_curves(self, k: int = 16) -> Floats:
        """``k`` points along each film, ends included, for drawing: (n_films, k, 3).

        Raises
        ------
        TypeError, ValueError
            If ``k`` is not an integer of at least 2.
        """
        return self.film_curves_at(np.linspace(0.0, 1.0, as_integer(k, "k", minimum=2)))

    def film_curves_at(self, xi: Floats) -> Floats:
        """Points of each film at parameters ``xi`` (m,) in [0, 1]: (n_films, m, 3)."""
        tail, head = self.film_ends
        return self.cell.surface.arc_points(tail, head, self.film_offsets, xi)

    def with_order(self, order: int) -> Foam:
        """The same foam with films of another order, their shapes interpolated."""
        p = as_integer(order, "order", minimum=2, maximum=MAX_ORDER)
        if p == self.order:
            return self
        old, new = lobatto(self.order), lobatto(p)
        values = old.interpolation(new.nodes[1:-1])[:, 1:-1]
        return replace(self, film_offsets=self.film_offsets @ values.T)

    def to_networkx(self) -> nx.MultiGraph:
        """Dual multigraph; nodes carry their bubble's id (``bubble``), area, volume, pressure, position."""
        graph = self.network.to_networkx()
        columns = {
            "bubble": self.bubble_ids.tolist(),
            "area": self.bubble_areas.tolist(),
            "volume": self.bubble_volumes.tolist(),
            **{axis: self.bubble_centres[:, k].tolist() for k, axis in enumerate("xyz")},
        }
        if self.pressures is not None:
            columns["pressure"] = self.pressures.tolist()
        for name, values in columns.items():
            for node, value in enumerate(values):
                graph.nodes[node][name] = value
        for _, _, film, data in graph.edges(keys=True, data=True):
            data["length"] = float(self.film_lengths[film])
        return graph

    def _measure(self, layer: Layer) -> Floats:
        tail, head = self.film_ends
        return frozen(self.cell.surface.arc_measure(tail, head, self.film_offsets, layer))

    def _inside(self, layer: Layer) -> Floats:
        inside = bubble_integrals(self.cell, self.network, self.vertex_points, self.film_offsets, layer)
        if self.exterior is not None:
            inside[self.exterior] = 0.0
            inside[self.exterior] = self.cell.surface.integral(layer) - inside.sum()
        return frozen(inside)


def bubble_integrals(
    cell: HeleShawCell, network: CellNetwork, points: Floats, offsets: Floats, layer: Layer
) -> Floats:
    """∫ (c0 + c1 H + c2 G) dA over each bubble of a foam that is not yet a `Foam`, (n_bubbles,)."""
    loops = network.loops
    parts = cell.surface.loop_integrals(points[network.tails], points[network.heads], offsets, loops, layer)
    owner = network.bubble[loops.halves[loops.starts]]
    return np.bincount(owner, parts, network.n_bubbles).astype(np.float64, copy=False)
