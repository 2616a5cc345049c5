"""The Newton system of a foam at one state, in units of the bubble size.

Lengths are in ℓ = sqrt(A/N), energies in γ d ℓ, volumes in V̄/1 with V̄ the mean volume. The unknowns
are vertex steps, film offsets and pressures; the offsets are eliminated film by film.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Protocol

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.cell import HeleShawCell
from warpedfoam.energy import film_terms
from warpedfoam.foam import bubble_integrals
from warpedfoam.kernels.condense import Condensed, clip_to_positive, condense
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.network import CellNetwork
from warpedfoam.relax.following import Following
from warpedfoam.relax.held import held_vertices, hold, without_markers
from warpedfoam.relax.linear import Factoriser
from warpedfoam.relax.pattern import Pattern

#: Least stiffness of an offset in a proximal step, relative to a straight film of the same length.
STIFFNESS_FLOOR = 0.5

#: Surfaces more precise than this integrate exactly, so that their symmetries are exact too.
INVARIANT = 1e-5


#: A rigid motion of which held vertices leave less than this share is none.
SLIDES = 0.05


class Stopwatch:
    """Adds the seconds since it was last read to a kind of work."""

    def __init__(self, timings: dict[str, float]) -> None:
        self._timings, self._last = timings, perf_counter()

    def lap(self, kind: str) -> None:
        """Book the time since the last lap under ``kind``."""
        now = perf_counter()
        self._timings[kind] += now - self._last
        self._last = now


@dataclass(frozen=True, eq=False)
class State:
    """One state of a relaxation; ``pressures`` are in units of γ d ℓ / V̄."""

    network: CellNetwork
    points: Floats
    offsets: Floats
    pressures: Floats


@dataclass(frozen=True, eq=False)
class Step:
    """Vertex steps in ℓ (n_vertices, 2), offsets (F, p − 1) and pressures (n_bubbles,) to add."""

    vertices: Floats
    offsets: Floats
    pressures: Floats


@dataclass(frozen=True, eq=False)
class Residuals:
    """How far a state is from equilibrium.

    ``vertex`` (n_vertices,): net force on each vertex, and on the nodes of its films, in γ d.
    ``volume`` (n_bubbles,): V − V* in V̄. ``force``: largest of ``vertex``.
    """

    vertex: Floats
    volume: Floats
    force: float
    volume_error: float


class Loads(Protocol):
    """Forces on a foam besides those of its films and pressures."""

    def add(self, state: State, force: Floats, hessian: Floats) -> None:
        """Add them and their derivatives to ``force`` (p + 3, F) and ``hessian`` (p + 3, p + 3, F)."""
        ...


class System:
    """Builds and solves the Newton systems of one foam, and keeps the time they take."""

    def __init__(
        self,
        cell: HeleShawCell,
        targets: Floats,
        order: int,
        factoriser: Factoriser,
        n_bubbles: int,
        exterior: int | None = None,
    ) -> None:
        self.cell, self.targets, self.factoriser = cell, targets, factoriser
        self.exterior = exterior
        self.loads: Loads | None = None
        # whether markers go with their bubbles, or stay where they are along their film
        self.follows = False
        self.length = float(np.sqrt(cell.surface.area / n_bubbles))
        self.mean_volume = float(targets.mean())
        if exterior is not None:
            # the clusters set the scale, not the cell round them
            self.mean_volume = float(np.delete(targets, exterior).mean())
            self.length = float(np.sqrt(cell.surface.area * self.mean_volume / cell.volume))
        self.film_unit = float(cell.layer.shares.sum()) * self.length
        self.shares = targets / self.mean_volume
        self.invariant = cell.surface.precision <= INVARIANT
        self.rule = lobatto(order)
        self.timings = {"assemble": 0.0, "solve": 0.0, "pattern": 0.0, "t1": 0.0, "total": 0.0}
        self._pattern: Pattern | None = None
        self._network: CellNetwork | None = None
        n = order - 1
        stiffness = self.rule.products.sum(axis=0).reshape(n, n, 1)
        # pivots of a straight film of unit length: what an eliminated offset's pivot should be
        self.reference = condense(stiffness.copy(), np.zeros((n, 1)), 0, None).pivots

    def pattern(self, network: CellNetwork) -> Pattern:
        """The sparsity pattern, built anew when the topology has changed."""
        if self._pattern is None or self._network is not network:
            clock = Stopwatch(self.timings)
            self._pattern, self._network = Pattern(network), network
            clock.lap("pattern")
        return self._pattern

    def linearise(self, state: State, *, draft: bool = False) -> Linearised:
        """Forces, volumes and second derivatives at a state; a ``draft`` has rough volumes."""
        return Linearised(self, state, draft and not self.invariant)


class Linearised:
    """Forces, volume errors and film Hessians at one state."""

    def __init__(self, system: System, state: State, draft: bool) -> None:
        clock = Stopwatch(system.timings)
        self.system, self.state, self.draft = system, state, draft
        self.rigid: Floats | None = None
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            # a film without length makes forces undefined: `Residuals.force` is then infinite
            self._linearise()
        clock.lap("assemble")

    def _linearise(self) -> None:
        system, state = self.system, self.state
        network = state.network
        terms = film_terms(
            system.cell,
            network,
            state.points,
            state.offsets,
            tension=1.0 / system.film_unit,
            pressures=state.pressures / system.mean_volume,
        )
        assert terms.hessian is not None
        self.area = terms.measure
        self.hessian, self.volume = terms.hessian, terms.volume / system.mean_volume
        jump = state.pressures[network.left] - state.pressures[network.right]
        self.force = terms.gradient / system.film_unit - jump * self.volume
        self.hessian[:4] *= system.length
        self.hessian[:, :4] *= system.length
        self.volume[:4] *= system.length
        self.force[:4] *= system.length
        if system.loads is not None:
            system.loads.add(state, self.force, self.hessian)
        held = held_vertices(system.cell.surface, network, state.points, state.offsets)
        self.following: Following | None = None
        self._along: Floats | None = None
        if held is not None and system.follows and len(network.markers):
            self.following, self._along = Following(held, network), held.directions[: len(network.markers)]
            held = without_markers(held, len(network.markers))
        if held is not None:
            hold(held, network, system.length, (self.force, self.volume, self.hessian))
        if system.loads is None and (held is not None or self.following is not None or not system.invariant):
            # what is left of a rigid motion's torque is quadrature error: it must not drive a drift
            modes = rigid_modes(system.cell, state)
            self.rigid = np.linalg.qr(modes.T)[0] if len(modes) else None
        layer = replace(system.cell.layer, rays=2) if self.draft else system.cell.layer
        volumes = bubble_integrals(system.cell, network, state.points, state.offsets, layer)
        self.volumes = volumes / system.mean_volume
        # one constraint is redundant: what all volumes together are off by (round-off, if nothing has
        # slipped) is shared out, or a single bubble would bear the round-off of all
        excess, self.slip = self._excess()
        self.volume_fault = self.volumes - excess * system.shares
        relative = np.abs(self.volume_fault) / system.shares
        self.residuals = self._residuals(float(relative.max()))

    def _excess(self) -> tuple[float, float]:
        """All volumes over what they should be, and how far that is off; an exterior takes the rest."""
        system = self.system
        total, loops = float(system.shares.sum()), float(self.volumes.sum())
        if system.exterior is None:
            return loops / total, abs(loops / total - 1.0)
        volumes = self.volumes
        volumes[system.exterior] = 0.0
        clusters = float(volumes.sum())
        volumes[system.exterior] = total - clusters
        # run the other way round, the exterior's loops hold the clusters, or all but them
        fault = 0.0
        if system.invariant and self._all_disks():
            fault = min(abs(loops), abs(loops - total))
        return 1.0, fault / max(clusters, 1e-300)

    def _all_disks(self) -> bool:
        """Whether every cluster is a disk: the loops round a ring do not tell what lies outside."""
        network, exterior = self.state.network, self.system.exterior
        starts = network.loops.halves[network.loops.starts]
        outlines = int((network.bubble[starts] == exterior).sum())
        chi = self.system.cell.surface.euler_characteristic - int(network.bubble_euler[exterior])
        return outlines == chi

    def _residuals(self, volume_error: float) -> Residuals:
        network = self.state.network
        count = network.n_vertices
        ends = np.concatenate(
            [2 * network.tails, 2 * network.tails + 1, 2 * network.heads, 2 * network.heads + 1]
        )
        summed = np.bincount(ends, self.force[:4].ravel(), 2 * count).astype(np.float64, copy=False)
        net = self.without_rigid(self.across(summed)).reshape(count, 2)
        at_vertex = np.linalg.norm(net, axis=1)
        if len(self.force) > 4:
            # an offset u moves its node by u times the film's length
            chord = self.area / self.system.film_unit
            at_nodes = np.abs(self.force[4:]).max(axis=0) / np.maximum(chord, 1e-12)
            np.maximum.at(at_vertex, network.tails, at_nodes)
            np.maximum.at(at_vertex, network.heads, at_nodes)
        force = float(at_vertex.max())
        if not np.isfinite(self.hessian).all() or not np.isfinite(force) or not np.isfinite(volume_error):
            force = np.inf
        return Residuals(at_vertex, self.volume_fault, force, volume_error)

    def across(self, forces: Floats) -> Floats:
        """Vertex forces (2 n_vertices,) without those on markers along their films."""
        if self._along is None:
            return forces
        out = forces.reshape(-1, 2).copy()
        markers, t = self.state.network.markers, self._along
        out[markers] -= np.einsum("mi,mi->m", out[markers], t)[:, None] * t
        return out.ravel()

    def loaded(self, forces: Floats) -> Linearised:
        """The same state under ``forces`` (p + 3, F) in place of its own; Hessian and volumes are shared."""
        other = copy(self)
        other.force = forces
        relative = np.abs(self.volume_fault) / self.system.shares
        other.residuals = other._residuals(float(relative.max()))
        return other

    def without_rigid(self, forces: Floats) -> Floats:
        """Vertex forces (2 n_vertices,) without their rigid part, where that is no real force."""
        if self.rigid is None:
            return forces
        return forces - self.rigid @ (self.rigid.T @ forces)

    def condensed(self, *, positive: bool) -> Condensed:
        """Film blocks on (A₁, A₂, B₁, B₂, pressure jump), offsets eliminated.

        ``positive`` mends weak or negative offset pivots and makes the vertex blocks positive
        semidefinite: then a step exists whatever the state.
        """
        clock = Stopwatch(self.system.timings)
        n, count = len(self.force) - 4, self.force.shape[1]
        matrix = np.empty((5 + n, 5 + n, count))
        take = np.concatenate([np.arange(4), 4 + np.arange(n)])
        put = np.concatenate([np.arange(4), 5 + np.arange(n)])
        matrix[np.ix_(put, put)] = self.hessian[np.ix_(take, take)]
        matrix[put, 4] = -self.volume
        matrix[4, put] = -self.volume
        matrix[4, 4] = 0.0
        rhs = np.empty((5 + n, count))
        rhs[put] = -self.force
        rhs[4] = 0.0
        floor = None
        if positive:
            # a wiggling film is softer than a straight one, and Newton's step then overshoots for ever
            chord = np.maximum(self.area / self.system.film_unit, 1e-3)
            floor = STIFFNESS_FLOOR * self.system.reference * chord
        out = condense(matrix, rhs, 5, floor)
        if positive:
            out.matrix[:4, :4] = clip_to_positive(out.matrix[:4, :4])
        clock.lap("assemble")
        return out


def one_ring(network: CellNetwork, values: Floats) -> Floats:
    """Greatest value over each vertex and its neighbours."""
    out = values.copy()
    np.maximum.at(out, network.tails, values[network.heads])
    np.maximum.at(out, network.heads, values[network.tails])
    return out


def rigid_modes(cell: HeleShawCell, state: State) -> Floats:
    """Rigid motions as vertex steps (k, 2 n_vertices), without what held vertices do not do.

    Parts of a foam that no films join move on their own, turn where the surface is flat, and take no notice
    of a rim that they do not touch.
    """
    modes = cell.rigid_motions(state.points)
    network = state.network
    if (network.bubble_euler != 1).any() or len(network.markers):
        part = parts_of(network)
        count = int(part.max()) + 1
        if cell.parallel and cell.surface.curvature_range() == (0.0, 0.0) and cell.surface.rim is None:
            points, round_ = unfolded(cell, state, part)
            turning = np.cross(cell.surface.normals(state.points), points)
            # what goes round the surface cannot turn
            modes = np.concatenate([modes, np.where(round_[part][:, None], 0.0, turning)[None]])
        own = part == np.arange(count)[:, None]
        bound = np.zeros(count, dtype=np.bool_)
        bound[part[network.rim_vertices]] = True
        kinds = [(modes, own)]
        if cell.surface.rim is not None:
            # what touches no rim does not mind its moving
            kinds = [(modes, own[bound]), (cell.free_motions(state.points), own[~bound])]
        strength = np.concatenate([np.tile(_strength(some), len(mine)) for some, mine in kinds])
        parts = [(some[None] * mine[:, None, :, None]).reshape(-1, *some.shape[1:]) for some, mine in kinds]
        modes = np.concatenate(parts)
    else:
        strength = _strength(modes)
    frames = cell.surface.vertex_frames(state.points)
    matrix = np.einsum("kvx,vix->kvi", modes, frames)
    whole = np.linalg.norm(matrix, axis=(1, 2))
    held = held_vertices(cell.surface, state.network, state.points, state.offsets)
    if held is not None:
        across = held.directions
        matrix[:, held.vertices] -= np.einsum("kmi,mi,mj->kmj", matrix[:, held.vertices], across, across)
    flat: Floats = matrix.reshape(len(modes), 2 * state.network.n_vertices)
    # against the whole motion, whose unit is that of its surface: lengths for some, their inverse for others;
    # a motion along the films alone, such as a lone bubble's turning, has next to nothing left
    size = np.linalg.norm(flat, axis=1)
    kept: Floats = flat[(size > 1e-6 * strength) & (size > SLIDES * whole)]
    return kept


def _strength(modes: Floats) -> Floats:
    """Largest step of any vertex in each motion (k, n_vertices, 3)."""
    out: Floats = np.abs(modes).max(axis=(1, 2), initial=0.0)
    return out


def parts_of(network: CellNetwork) -> Ints:
    """Which part of a foam each vertex belongs to, films joining them; (n_vertices,)."""
    links = coo_array(
        (np.ones(network.n_films), (network.tails, network.heads)), shape=(network.n_vertices,) * 2
    )
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)


def unfolded(cell: HeleShawCell, state: State, part: Ints) -> tuple[Floats, Bools]:
    """Vertices of each part of a foam in one copy of the surface, and which parts go round it."""
    network, period = state.network, cell.surface.period
    n_parts = int(part.max()) + 1
    if period is None:
        return state.points, np.zeros(n_parts, dtype=np.bool_)
    chord = state.points[network.heads] - state.points[network.tails]
    shift = nearest_image(chord, period) - chord
    # whole periods from the first vertex of each part, along a tree of its films
    links = coo_array(
        (np.ones(network.n_films), (network.tails, network.heads)), shape=(network.n_vertices,) * 2
    ).tocsr()
    total = np.zeros_like(state.points)
    ends = np.concatenate([network.tails, network.heads]), np.concatenate([network.heads, network.tails])
    code = ends[0] * network.n_vertices + ends[1]
    order = np.argsort(code, kind="stable")
    signed = np.concatenate([shift, -shift])
    first = np.unique(part, return_index=True)[1]
    before = np.full(network.n_vertices, -1)
    for start in first.tolist():
        reached, parent = breadth_first_order(links, start, directed=False)
        before[reached[1:]] = parent[reached[1:]]
    joined = np.flatnonzero(before >= 0)
    at = order[np.searchsorted(code[order], before[joined] * network.n_vertices + joined)]
    total[joined] = signed[at]
    ahead = np.where(before >= 0, before, np.arange(network.n_vertices))
    for _ in range(int(np.ceil(np.log2(network.n_vertices + 1)))):
        total, ahead = total + total[ahead], ahead[ahead]
    points = state.points + total
    gap = points[network.heads] - points[network.tails] - nearest_image(chord, period)
    wraps = np.linalg.norm(gap, axis=1) > 0.1 * float(period[np.isfinite(period)].min())
    out = np.zeros(n_parts, dtype=np.bool_)
    out[part[network.tails[wraps]]] = True
    return points, out


def pinned_unknowns(cell: HeleShawCell, state: State) -> Ints:
    """Vertex unknowns (indices into (n_vertices, 2), flattened) that fix the rigid motions."""
    from scipy.linalg import qr

    modes = rigid_modes(cell, state)
    if not len(modes):
        return np.zeros(0, dtype=np.int64)
    _, triangle, pivots = qr(modes, mode="economic", pivoting=True)
    size = np.abs(np.diagonal(triangle))
    rank = int((size > 1e-6 * size.max(initial=1e-300)).sum())
    return np.asarray(pivots[:rank], dtype=np.int64)
