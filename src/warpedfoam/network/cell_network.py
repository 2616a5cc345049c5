"""`CellNetwork`: the combinatorial network of a foam as half-films; it knows no coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Ints, as_indices, frozen
from warpedfoam.errors import TopologyError
from warpedfoam.kernels.loops import Loops, loops_of

if TYPE_CHECKING:
    import networkx as nx


@dataclass(frozen=True, eq=False)
class CellNetwork:
    """Bubbles, films and vertices of a foam, by half-films.

    Film f has the half-films 2f and 2f + 1, so the twin of h is ``h ^ 1``. A half-film has its bubble
    on the left, starts at vertex ``origin[h]`` and is followed round its bubble by ``next[h]``. Three
    films meet at a vertex; a *marker* vertex joins two and only divides a film; at a *rim vertex* a
    single film ends on the surface's rim. ``next`` then jumps along the *wall*, the arc of the rim on
    which the bubble ends, to the rim vertex where its next half-film starts. Walls are no films.

    Parameters
    ----------
    next, origin, bubble : (2 n_films,) integer arrays
    bubble_euler : (n_bubbles,) integer array, optional
        Euler number of each bubble, 1 (a disk) by default; an open cluster's exterior has another.

    Raises
    ------
    TopologyError
        If the arrays do not describe a network: see `validate`.

    Examples
    --------
    Two bubbles that share a closed film, divided by two markers:

    >>> net = CellNetwork(next=[2, 3, 0, 1], origin=[0, 1, 1, 0], bubble=[0, 1, 0, 1])
    >>> net.n_bubbles, net.n_films, net.euler_characteristic
    (2, 2, 2)
    >>> net.sides
    array([0, 0])
    """

    next: Ints
    origin: Ints
    bubble: Ints
    bubble_euler: Ints

    def __init__(
        self,
        next: ArrayLike,
        origin: ArrayLike,
        bubble: ArrayLike,
        bubble_euler: ArrayLike | None = None,
    ) -> None:
        following = as_indices(next, "next", (None,))
        count = len(following)
        object.__setattr__(self, "next", frozen(following))
        object.__setattr__(self, "origin", frozen(as_indices(origin, "origin", (count,))))
        object.__setattr__(self, "bubble", frozen(as_indices(bubble, "bubble", (count,))))
        if count and self.next.max() >= count:
            raise TopologyError("next must be a permutation of the half-films")
        for name in ("origin", "bubble"):
            if getattr(self, name).max(initial=0) > count:
                raise TopologyError(
                    f"{name} must number from 0 without gaps, got {int(getattr(self, name).max())} "
                    f"with {count} half-films"
                )
        if bubble_euler is None:
            euler = np.ones(int(self.bubble.max(initial=-1)) + 1, dtype=np.int64)
        else:
            euler = np.asarray(bubble_euler)
            if euler.ndim != 1 or euler.dtype.kind not in "iu":
                raise TypeError("bubble_euler must be an (n_bubbles,) array of integers")
            euler = euler.astype(np.int64)
        object.__setattr__(self, "bubble_euler", frozen(euler))
        self.validate()

    @property
    def n_films(self) -> int:
        """Number of films."""
        return len(self.next) // 2

    @property
    def n_bubbles(self) -> int:
        """Number of bubbles."""
        return len(self.bubble_euler)

    @cached_property
    def n_vertices(self) -> int:
        """Number of vertices, markers included."""
        return int(self.origin.max(initial=-1)) + 1

    @property
    def tails(self) -> Ints:
        """Vertex where each film starts, (n_films,)."""
        return self.origin[0::2]

    @property
    def heads(self) -> Ints:
        """Vertex where each film ends, (n_films,)."""
        return self.origin[1::2]

    @property
    def left(self) -> Ints:
        """Bubble on the left of each film, (n_films,)."""
        return self.bubble[0::2]

    @property
    def right(self) -> Ints:
        """Bubble on the right of each film, (n_films,)."""
        return self.bubble[1::2]

    @cached_property
    def vertex_degrees(self) -> Ints:
        """Films at each vertex: 3, or 2 at a marker, or 1 on a rim."""
        return frozen(np.bincount(self.origin, minlength=self.n_vertices))

    @cached_property
    def markers(self) -> Ints:
        """The twofold vertices."""
        return frozen(np.flatnonzero(self.vertex_degrees == 2))

    @cached_property
    def rim_vertices(self) -> Ints:
        """The onefold vertices, on a rim."""
        return frozen(np.flatnonzero(self.vertex_degrees == 1))

    @cached_property
    def walls(self) -> Ints:
        """Half-films after which a wall follows, (n_walls,): it ends where the next half-film starts."""
        ends = self.origin[np.arange(len(self.origin)) ^ 1]
        return frozen(np.flatnonzero(self.vertex_degrees[ends] == 1))

    @cached_property
    def wall_counts(self) -> Ints:
        """Walls of each bubble, (n_bubbles,)."""
        return frozen(np.bincount(self.bubble[self.walls], minlength=self.n_bubbles))

    @cached_property
    def rim_cycles(self) -> tuple[Ints, ...]:
        """Walls round each loop of the rim, as indices into ``walls``, in order."""
        if not len(self.walls):
            return ()
        at = np.empty(self.n_vertices, dtype=np.int64)
        at[self.origin[self.walls ^ 1]] = np.arange(len(self.walls))
        after = at[self.origin[self.next[self.walls]]]
        loops = loops_of(after, np.zeros(len(after), dtype=np.int64))
        return tuple(frozen(part) for part in np.split(loops.halves, loops.starts[1:]))

    @cached_property
    def loops(self) -> Loops:
        """Half-films round each bubble, bubble after bubble."""
        return loops_of(self.next, self.bubble)

    @cached_property
    def sides(self) -> Ints:
        """Sides n of each bubble: its films (markers not counted) and its walls, (n_bubbles,)."""
        corner = self.vertex_degrees[self.origin] == 3
        corners = np.bincount(self.bubble[corner], minlength=self.n_bubbles)
        return frozen(corners + 2 * self.wall_counts)

    @cached_property
    def charges(self) -> Ints:
        """Topological charges q = 6 − films − 2 walls, (n_bubbles,): 6 − n inside.

        They add up to 6 χ if all bubbles are disks. A wall counts twice since films meet it at 90°, not
        120°: a bubble of three films and a wall is at home on a straight rim. A film that faces an exterior
        is a side like any other: with one taken off for each such film, the charges of a cluster's bubbles
        add up to 6, whatever its outline.
        """
        return frozen(6 - self.sides - self.wall_counts)

    @cached_property
    def euler_characteristic(self) -> int:
        """χ = vertices − films − walls + Σ bubble_euler, of the surface that the network fills."""
        return self.n_vertices - self.n_films - len(self.walls) + int(self.bubble_euler.sum())

    @cached_property
    def outgoing(self) -> Ints:
        """Half-films that start at each threefold vertex, counter-clockwise, (n_threefold, 3)."""
        order = np.argsort(self.origin, kind="stable")
        first = order[np.searchsorted(self.origin[order], np.flatnonzero(self.vertex_degrees == 3))]
        # leaving along h, arriving back along its twin, the next half-film is the next one clockwise
        second = self.next[first ^ 1]
        return frozen(np.stack([first, self.next[second ^ 1], second], axis=1))

    def validate(self) -> None:
        """Check every rule of a network.

        Raises
        ------
        TopologyError
            Odd or no half-films; ``next`` not a permutation, or not staying on its bubble, or not
            starting where the half-film ends, unless both are rim vertices; a vertex without films or
            with more than three, or two fans of them; unused vertex or bubble numbers; a disk with
            several boundary loops; a wall from a vertex to itself.
        """
        count = len(self.next)
        if count == 0 or count % 2:
            raise TopologyError(f"a network needs an even number of half-films above 0, got {count}")
        if (np.bincount(self.next, minlength=count)[:count] != 1).any() or self.next.max() >= count:
            raise TopologyError("next must be a permutation of the half-films")
        if self.bubble.max() >= self.n_bubbles:
            raise TopologyError(
                f"bubble names bubble {int(self.bubble.max())}, but there are {self.n_bubbles}"
            )
        if (self.bubble[self.next] != self.bubble).any():
            bad = int(np.flatnonzero(self.bubble[self.next] != self.bubble)[0])
            raise TopologyError(f"half-film {bad} and its next lie on different bubbles")
        twin = np.arange(count) ^ 1
        degrees = self.vertex_degrees
        start, end = self.origin[self.next], self.origin[twin]
        walled = (degrees[start] == 1) & (degrees[end] == 1)
        if ((start != end) & ~walled).any():
            bad = int(np.flatnonzero((start != end) & ~walled)[0])
            raise TopologyError(f"half-film {bad} does not end where its next begins")
        if ((degrees < 1) | (degrees > 3)).any():
            bad = int(np.flatnonzero((degrees < 1) | (degrees > 3))[0])
            raise TopologyError(
                f"vertex {bad} has {int(degrees[bad])} films; three must meet, two at a marker, one on a rim"
            )
        if (walled & (start == end)).any():
            bad = int(np.flatnonzero(walled & (start == end))[0])
            raise TopologyError(f"the wall after half-film {bad} comes back to vertex {int(end[bad])}")
        around = self.next[twin]
        thrice = np.where(degrees[self.origin] == 3, around[around[around]], around[around])
        still = (thrice != np.arange(count)) | (around == np.arange(count))
        still &= degrees[self.origin] > 1
        if still.any():
            raise TopologyError(
                f"the films at vertex {int(self.origin[np.flatnonzero(still)[0]])} do not form one fan"
            )
        n_loops = np.bincount(self.bubble[self.loops.halves[self.loops.starts]], minlength=self.n_bubbles)
        if (n_loops == 0).any():
            raise TopologyError(f"bubble {int(np.flatnonzero(n_loops == 0)[0])} has no films")
        if ((self.bubble_euler == 1) & (n_loops != 1)).any():
            bad = int(np.flatnonzero((self.bubble_euler == 1) & (n_loops != 1))[0])
            raise TopologyError(
                f"bubble {bad} is said to be a disk but has {int(n_loops[bad])} boundary loops"
            )

    def to_networkx(self) -> nx.MultiGraph:
        """Dual multigraph: bubbles as nodes (``sides``, ``charge``), films as edges keyed by film.

        Examples
        --------
        >>> net = CellNetwork(next=[2, 3, 0, 1], origin=[0, 1, 1, 0], bubble=[0, 1, 0, 1])
        >>> net.to_networkx().number_of_edges(0, 1)
        2
        """
        import networkx as nx

        graph = nx.MultiGraph()
        graph.add_nodes_from(
            (i, {"sides": n, "charge": q})
            for i, (n, q) in enumerate(zip(self.sides.tolist(), self.charges.tolist(), strict=True))
        )
        graph.add_edges_from(
            (a, b, f, {"film": f})
            for f, (a, b) in enumerate(zip(self.left.tolist(), self.right.tolist(), strict=True))
        )
        return graph

    def film_graph(self) -> nx.MultiGraph:
        """Film multigraph: vertices as nodes, films as edges keyed by film, with the bubbles beside them."""
        import networkx as nx

        graph = nx.MultiGraph()
        graph.add_nodes_from((v, {"degree": k}) for v, k in enumerate(self.vertex_degrees.tolist()))
        columns = (self.tails, self.heads, self.left, self.right)
        graph.add_edges_from(
            (a, b, f, {"film": f, "left": left, "right": right})
            for f, (a, b, left, right) in enumerate(zip(*(c.tolist() for c in columns), strict=True))
        )
        return graph
