"""Friction of films that move over the plates: its potential, as a function of the unknowns of films.

A film that has moved by δ = v_n h across itself in a time h has paid D = Σ ∫ φ(δ) dA over its area
through the gap, φ(δ) = λ δ²/(2h) + τ |δ|. Here D is a sum over the nodes of films, of φ at numbers that are
linear in the unknowns near a guess, the *base*: convex, with exact derivatives. Nodes slide along their film
too, by amounts that have kinks at the vertices. So normals and areas are those of the base, where forces
balance, and the displacement of the base itself is measured with the normals of both ends, right to third
order: or sliding would bend the films a little in every step, and cost an order in the step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.cell import HeleShawCell
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.network import CellNetwork
from warpedfoam.relax.system import State
from warpedfoam.surfaces.protocol import Surface

#: Step of differences of the films' nodes, in bubble sizes.
DIFFERENCE = 1e-4
#: Films that yield friction holds creep with this share of the speed τ/λ at most, or nearly so.
CREEP = 1e-3


@dataclass(frozen=True)
class FrictionLaw:
    """Force against a film's motion, per area: λ v + τ v/|v|, λ in tension · time / length²."""

    friction: float
    yielding: float = 0.0

    def potential(self, moved: Floats, time: float, blunt: float = 1.0) -> Floats:
        """φ(δ) of normal displacements made in a ``time``."""
        out = (0.5 * self.friction / time) * moved**2
        if self.yielding:
            edge = self._edge(time, blunt)
            out = out + self.yielding * (np.hypot(moved, edge) - edge)
        return out

    def derivatives(self, moved: Floats, time: float, blunt: float = 1.0) -> tuple[Floats, Floats]:
        """φ' and φ''."""
        slope, bend = (self.friction / time) * moved, np.full_like(moved, self.friction / time)
        if self.yielding:
            root = np.hypot(moved, self._edge(time, blunt))
            slope = slope + self.yielding * moved / root
            bend = bend + self.yielding * self._edge(time, blunt) ** 2 / root**3
        return slope, bend

    def _edge(self, time: float, blunt: float) -> float:
        """|δ| is rounded off below this: √(δ² + edge²)."""
        return blunt * CREEP * self.yielding / self.friction * time


class Across:
    """Which way is across the films at a state, node by node, and how the unknowns move nodes that way.

    ``areas`` (K, F) belong to the nodes; ``moves`` (K, 5, F) has the normal displacement of node k by steps
    of its film's ends in ℓ (A₁, A₂, B₁, B₂) and by its own offset. No other unknown moves it.
    """

    def __init__(self, cell: HeleShawCell, state: State, length: float) -> None:
        self.cell, self.state, self.length = cell, state, length
        self.frames = cell.surface.vertex_frames(state.points)
        self.areas, self.moves = normal_moves(cell, state, length)

    def places(self, state: State) -> Floats:
        """Places of another state's vertices seen from here, in the frames here and ℓ, (n_vertices, 2)."""
        away = nearest_image(state.points - self.state.points, self.cell.surface.period)
        out: Floats = np.einsum("vix,vx->vi", self.frames, away) / self.length
        return out

    def displacements(self, state: State) -> Floats:
        """Normal displacement of each node on the way to another state, to second order, (K, F)."""
        network, places = self.state.network, self.places(state)
        ends = np.concatenate([places[network.tails].T, places[network.heads].T])
        moved: Floats = np.einsum("kif,if->kf", self.moves[:, :4], ends)
        moved[1:-1] += self.moves[1:-1, 4] * (state.offsets - self.state.offsets).T
        return moved


class Drag:
    """Friction from a start on, in units of the bubble size; see `warpedfoam.relax.system.Loads`.

    Parameters
    ----------
    start, base : Across
        Where displacements count from, and a guess at where the step ends.
    law : FrictionLaw
    time : float
        h.
    unit : float
        Energy per unit of the system: γ d ℓ.
    """

    def __init__(self, start: Across, base: Across, law: FrictionLaw, time: float, unit: float) -> None:
        self._base, self.law, self.time, self._unit = base, law, time, unit
        self.blunt = 1.0
        self._offset = np.zeros_like(base.areas)
        if base is not start:
            self._offset = 0.5 * (start.displacements(base.state) - base.displacements(start.state))

    def displacements(self, state: State) -> Floats:
        """Normal displacement of each node since the start, (K, F)."""
        return self._offset + self._base.displacements(state)

    def dissipated(self, state: State) -> float:
        """D, in the system's unit of energy."""
        paid = self.law.potential(self.displacements(state), self.time)
        return float((self._base.areas * paid).sum()) / self._unit

    def squared_speed(self, state: State) -> float:
        """∫ v_n² dA for the way from the start to ``state``."""
        return float((self._base.areas * (self.displacements(state) / self.time) ** 2).sum())

    def add(self, state: State, force: Floats, hessian: Floats) -> None:
        """Add the derivatives of D by the unknowns at ``state``."""
        network, count = state.network, len(force) - 4
        slope, bend = self.law.derivatives(self.displacements(state), self.time, self.blunt)
        scale = self._base.areas / self._unit
        slope, bend = scale * slope, scale * bend
        ends, own = self._base.moves[:, :4], self._base.moves[1:-1, 4]
        pull = np.einsum("kf,kif->if", slope, ends)
        stiff = np.einsum("kf,kif,kjf->ijf", bend, ends, ends)
        mixed = (bend[1:-1] * own)[:, None] * ends[1:-1]
        turned = self._turned(state)
        turns = (turned[network.tails], turned[network.heads])
        bends = self._bends(state)
        curls = (bends[network.tails], bends[network.heads])
        for i, (turn, curl) in enumerate(zip(turns, curls, strict=True)):
            a = slice(2 * i, 2 * i + 2)
            force[a] += np.einsum("fij,if->jf", turn, pull[a])
            hessian[a, a] += np.einsum("fijk,if->jkf", curl, pull[a])
            for j, other in enumerate(turns):
                b = slice(2 * j, 2 * j + 2)
                hessian[a, b] += np.einsum("fij,ilf,flm->jmf", turn, stiff[a, b], other)
            part = np.einsum("kif,fij->kjf", mixed[:, a], turn)
            hessian[4:, a] += part
            hessian[a, 4:] += part.transpose(1, 0, 2)
        force[4:] += slope[1:-1] * own
        place = np.arange(4, 4 + count)
        hessian[place, place] += bend[1:-1] * own**2

    def _turned(self, state: State) -> Floats:
        """Derivatives of the places by steps in the state's frames, (n_vertices, 2, 2)."""
        frames = self._base.cell.surface.vertex_frames(state.points)
        out: Floats = np.einsum("vix,vjx->vij", self._base.frames, frames)
        return out

    def _bends(self, state: State) -> Floats:
        """Second derivatives of the places, (n_vertices, 2, 2, 2), by differences of the retraction."""
        surface, length = self._base.cell.surface, self._base.length
        h = 10.0 * DIFFERENCE

        def at(x: float, y: float) -> Floats:
            steps = np.broadcast_to([x * h * length, y * h * length], (len(state.points), 2))
            away = nearest_image(surface.retract(state.points, steps) - state.points, surface.period)
            out: Floats = np.einsum("vix,vx->vi", self._base.frames, away) / length
            return out

        out = np.empty((len(state.points), 2, 2, 2))
        out[:, :, 0, 0] = at(1, 0) + at(-1, 0)
        out[:, :, 1, 1] = at(0, 1) + at(0, -1)
        cross = 0.5 * (at(1, 1) + at(-1, -1) - out[:, :, 0, 0] - out[:, :, 1, 1])
        out[:, :, 0, 1] = out[:, :, 1, 0] = cross
        return out / h**2


def normal_moves(cell: HeleShawCell, state: State, length: float) -> tuple[Floats, Floats]:
    """Areas of films that belong to their nodes (K, F), and how the nodes move across their film.

    The second, (K, 5, F), has the normal displacement of node k by steps of the film's ends in ℓ (A₁, A₂,
    B₁, B₂) and by its own offset; no other unknown moves it.
    """
    surface, network = cell.surface, state.network
    rule = lobatto(state.offsets.shape[1] + 1)
    h = DIFFERENCE * length
    steps = h * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    moved = [surface.retract(state.points, np.broadcast_to(step, (len(state.points), 2))) for step in steps]
    tail, head = state.points[network.tails], state.points[network.heads]
    small = np.full_like(state.offsets, DIFFERENCE)
    variants = [(tail, head, state.offsets)]
    variants += [(points[network.tails], head, state.offsets) for points in moved]
    variants += [(tail, points[network.heads], state.offsets) for points in moved]
    variants += [(tail, head, state.offsets + small), (tail, head, state.offsets - small)]
    curves = surface.arc_points(
        np.concatenate([v[0] for v in variants]),
        np.concatenate([v[1] for v in variants]),
        np.concatenate([v[2] for v in variants]),
        rule.nodes,
    ).reshape(len(variants), network.n_films, -1, 3)
    here = curves[0]
    change = 0.5 / DIFFERENCE * nearest_image(curves[1::2] - curves[2::2], surface.period)
    normal = surface.normals(here.reshape(-1, 3)).reshape(here.shape)
    slope = np.einsum("kl,flx->fkx", rule.derivative, here)
    across = np.cross(normal, slope)
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    moves = np.einsum("ifkx,fkx->kif", change, across)
    moves[0, 2:] = moves[-1, :2] = moves[0, 4] = moves[-1, 4] = 0.0
    areas = rule.weights[:, None] * _area_density(cell, here, slope, normal, rule.derivative)
    return areas, moves


def _area_density(
    cell: HeleShawCell, points: Floats, slope: Floats, normal: Floats, derivative: Floats
) -> Floats:
    """Area of each film through the gap per parameter at its nodes, (K, F): Σ_t shares_t |x' + t n'|.

    Heights and shares stretch with a gap that varies; its slope along the film only shears what is ruled.
    """
    bend = np.einsum("kl,flx->fkx", derivative, normal)
    if cell.layer.profile is not None:
        stretch = cell.layer.profile.values(points)
        bend *= stretch[..., None]
    out = np.zeros(points.shape[:2])
    for height, share in zip(cell.layer.heights, cell.layer.shares, strict=True):
        out += share * np.linalg.norm(slope + height * bend, axis=2)
    return out.T if cell.layer.profile is None else (stretch * out).T


def motion_of(surface: Surface, network: CellNetwork, one: State, other: State) -> Floats:
    """Distances between the vertices and nodes of two states of one network, (n_vertices + F (p − 1),)."""
    away = np.linalg.norm(nearest_image(other.points - one.points, surface.period), axis=1)
    chord = nearest_image(one.points[network.heads] - one.points[network.tails], surface.period)
    span = np.linalg.norm(chord, axis=1)[:, None]
    return np.concatenate([away, (np.abs(other.offsets - one.offsets) * span).ravel()])
