"""Markers spaced evenly again: they move along their film, which keeps its shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.cell import HeleShawCell
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.network import CellNetwork
from warpedfoam.relax.system import State

#: Lengths of a marker's two films that differ by this share of their sum call for spacing.
UNEVEN = 0.04
#: Share of the way to the middle that a marker goes; all at once would overshoot in chains.
RELAXED = 0.6
#: By how much the order of the interpolated curve exceeds that of the films; Newton steps, their step.
MORE, STEPS, DIFFERENCE = 10, 12, 1e-4
#: A node has found the old film when it is nearer than this, in lengths of its film.
FOUND = 1e-12


def spaced(cell: HeleShawCell, state: State) -> State | None:
    """The state with markers nearer to the middle between their neighbours, or None where they are.

    The nodes of the new films lie on the old ones, so that the shape changes only by what a polynomial of the
    films' order leaves.
    """
    network, surface = state.network, cell.surface
    markers = network.markers
    if not len(markers):
        return None
    out, back = _beside(network, markers)
    rule = lobatto(state.offsets.shape[1] + 1 + MORE)
    films = np.unique(np.concatenate([out, back]) >> 1)
    place = np.full(network.n_films, -1)
    place[films] = np.arange(len(films))
    tail, head = state.points[network.tails[films]], state.points[network.heads[films]]
    curve = surface.arc_points(tail, head, state.offsets[films], rule.nodes)
    slope = np.linalg.norm(np.einsum("kl,flx->fkx", rule.derivative, curve), axis=2)
    length = slope @ rule.weights
    ahead, behind = length[place[out >> 1]], length[place[back >> 1]]
    uneven = (ahead - behind) / (ahead + behind)
    if np.abs(uneven).max() < UNEVEN:
        return None
    move = 0.5 * RELAXED * (ahead - behind)
    onto = np.where(move > 0.0, out, back)
    share = np.abs(move) / length[place[onto >> 1]]
    # parameter along the film itself: half-films run either way
    shift = np.where(onto & 1, 1.0 - share, share)
    points = state.points.copy()
    points[markers] = surface.project(_at(rule.interpolation(shift), curve[place[onto >> 1]]))
    chain = _Chain(network, films, place, curve, rule.order)
    offsets = _refitted(cell, state, films, points, chain)
    if offsets is None:
        return None
    fresh = state.offsets.copy()
    fresh[films] = offsets
    return replace(state, points=points, offsets=fresh)


def _beside(network: CellNetwork, markers: Ints) -> tuple[Ints, Ints]:
    """The two half-films that start at each marker."""
    order = np.argsort(network.origin, kind="stable")
    first = order[np.searchsorted(network.origin[order], markers)]
    return first, network.next[first ^ 1]


def _at(weights: Floats, curves: Floats) -> Floats:
    out: Floats = np.einsum("nk,nkx->nx", weights, curves)
    return out


class _Chain:
    """Old films with what joins them at markers: places s in [−1, 2], outside [0, 1] on the neighbours."""

    def __init__(self, network: CellNetwork, films: Ints, place: Ints, curve: Floats, order: int) -> None:
        self._rule, self._curve = lobatto(order), curve
        self._slope = np.einsum("kl,flx->fkx", self._rule.derivative, curve)
        degrees = network.vertex_degrees
        after, before = network.next[2 * films], network.next[2 * films + 1]
        self._after = np.where(degrees[network.heads[films]] == 2, after, -1)
        self._before = np.where(degrees[network.tails[films]] == 2, before, -1)
        self._place = place

    def look(self, film: Ints, s: Floats) -> tuple[Floats, Floats]:
        """Points (n, 3) and derivatives by s (n, 3) at places ``s`` of films (n,), as numbered here."""
        half = np.where(s > 1.0, self._after[film], np.where(s < 0.0, self._before[film], -1))
        other = half >= 0
        # along the neighbouring half-film, away from this film
        beyond = np.where(s > 1.0, s - 1.0, -s)
        reverse = (half & 1).astype(bool)
        t = np.where(other, np.where(reverse, 1.0 - beyond, beyond), s)
        sign = np.where(other, np.where(reverse, -1.0, 1.0) * np.where(s > 1.0, 1.0, -1.0), 1.0)
        which = np.where(other, self._place[np.maximum(half, 0) >> 1], film)
        weights = self._rule.interpolation(t)
        return _at(weights, self._curve[which]), sign[:, None] * _at(weights, self._slope[which])


def _refitted(cell: HeleShawCell, state: State, films: Ints, points: Floats, chain: _Chain) -> Floats | None:
    """Offsets (m, p − 1) that put the nodes of films with moved ends on the old films; None if it fails."""
    surface, network = cell.surface, state.network
    rule = lobatto(state.offsets.shape[1] + 1)
    tail, head = points[network.tails[films]], points[network.heads[films]]
    span = np.linalg.norm(nearest_image(head - tail, surface.period), axis=1)
    inner = rule.nodes[1:-1]
    film = np.repeat(np.arange(len(films)), len(inner))
    offsets = state.offsets[films].copy()
    s = np.tile(inner, len(films))

    def nodes(*tries: Floats) -> Floats:
        # all at once: for few films a call costs more than what it computes
        first, last = (np.tile(end, (len(tries), 1)) for end in (tail, head))
        return surface.arc_points(first, last, np.concatenate(tries), inner).reshape(len(tries), -1, 3)

    for _ in range(STEPS):
        here, ahead, behind = nodes(offsets, offsets + DIFFERENCE, offsets - DIFFERENCE)
        across = (ahead - behind) / (2.0 * DIFFERENCE)
        old, along = chain.look(film, s)
        fault = nearest_image(here - old, surface.period)
        # least squares in the tangent plane: here + across du = old + along ds
        aa, ab = np.einsum("nx,nx->n", across, across), np.einsum("nx,nx->n", across, along)
        bb = np.einsum("nx,nx->n", along, along)
        ra, rb = np.einsum("nx,nx->n", across, fault), np.einsum("nx,nx->n", along, fault)
        det = aa * bb - ab**2
        du, ds = (-bb * ra + ab * rb) / det, (aa * rb - ab * ra) / det
        if not np.isfinite(du).all():
            return None
        offsets += np.clip(du, -0.3, 0.3).reshape(offsets.shape)
        s = np.clip(s + np.clip(ds, -0.3, 0.3), -1.0, 2.0)
        if float(np.abs(du).max()) < FOUND:
            break
    old, _ = chain.look(film, s)
    away = np.linalg.norm(nearest_image(nodes(offsets)[0] - old, surface.period), axis=1)
    return offsets if float((away / span[film]).max()) < 1e-9 else None
