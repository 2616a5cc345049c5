"""Marker vertices: put on films, and taken off again, with the film's curve kept."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Bools, Floats, Ints, as_floats, as_indices
from warpedfoam.errors import TopologyError
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.network import CellNetwork
from warpedfoam.surfaces.protocol import Surface

#: Points along a film from which a part of it is fitted again, points of the interpolation between them,
#: Newton steps of the fit, and its step of differences.
SAMPLES, STENCIL, FIT_STEPS, FIT_DIFFERENCE = 65, 6, 8, 1e-5


@dataclass(frozen=True, eq=False)
class Layout:
    """A network with its geometry; ``source`` (n_films,) tells which film each was or came from."""

    network: CellNetwork
    points: Floats
    offsets: Floats
    source: Ints


def divided(network: CellNetwork, films: Ints) -> CellNetwork:
    """Films (k,) divided by a new marker each: vertex n_vertices + i, and film n_films + i behind it."""
    count, k = len(network.next), len(films)
    ahead, back = 2 * films, 2 * films + 1
    new = count + 2 * np.arange(k)
    marker = network.n_vertices + np.arange(k)
    entry = np.arange(count)
    entry[back] = new + 1
    following = np.concatenate([entry[network.next], np.empty(2 * k, dtype=np.int64)])
    following[new] = following[ahead]
    following[ahead] = new
    following[new + 1] = back
    origin = np.concatenate([network.origin, np.empty(2 * k, dtype=np.int64)])
    origin[new], origin[new + 1] = marker, network.origin[back]
    origin[back] = marker
    bubble = np.concatenate([network.bubble, np.empty(2 * k, dtype=np.int64)])
    bubble[new], bubble[new + 1] = network.bubble[ahead], network.bubble[back]
    return CellNetwork(following, origin, bubble, network.bubble_euler)


def marker_chains(network: CellNetwork, markers: Ints) -> tuple[Ints, Ints]:
    """Half-films (k,) that end at each marker and, behind it, start there."""
    order = np.argsort(network.origin, kind="stable")
    start = order[np.searchsorted(network.origin[order], markers)]
    # the half-film that starts there on the film of the lower number is kept as the first part
    other = network.next[start ^ 1]
    onward = np.where((start >> 1) > (other >> 1), start, other)
    return np.where(onward == start, other, start) ^ 1, onward


def removable(network: CellNetwork, markers: Ints) -> Bools:
    """Whether the two films at each marker may become one: it must not come back to where it began."""
    first, second = marker_chains(network, markers)
    out: Bools = (network.origin[first] != network.origin[second ^ 1]) & ((first >> 1) != (second >> 1))
    return out


def merged(network: CellNetwork, markers: Ints) -> tuple[CellNetwork, Ints, Ints]:
    """Network without some markers, no film at two of them, and what is left of films and vertices.

    The film of the lower number is kept, and with it its direction.
    """
    first, second = marker_chains(network, markers)
    count = len(network.next)
    entry = np.arange(count)
    entry[second ^ 1] = first ^ 1
    following = network.next.copy()
    following[first] = following[second]
    following = entry[following]
    origin = network.origin.copy()
    origin[first ^ 1] = origin[second ^ 1]
    stays = np.ones(network.n_films, dtype=np.bool_)
    stays[second >> 1] = False
    lives = np.ones(network.n_vertices, dtype=np.bool_)
    lives[markers] = False
    halves = np.repeat(stays, 2)
    place, name = np.cumsum(halves) - 1, np.cumsum(lives) - 1
    out = CellNetwork(
        place[following[halves]], name[origin[halves]], network.bubble[halves], network.bubble_euler
    )
    return out, np.flatnonzero(stays), np.flatnonzero(lives)


def divide(surface: Surface, layout: Layout, films: Ints, at: Floats) -> Layout:
    """Put a marker on each of ``films`` (k,), different ones, at the parameters ``at`` (k,) in (0, 1)."""
    network, points, offsets = layout.network, layout.points, layout.offsets
    order = offsets.shape[1] + 1
    tail, head = points[network.tails[films]], points[network.heads[films]]
    ends = np.stack([np.zeros(len(films)), at, np.ones(len(films))])
    parts = np.stack(
        [film_samples(surface, tail, head, offsets[films], ends[i], ends[i + 1]) for i in range(2)]
    )
    middle = surface.project(parts[0, :, -1])
    near = refit(surface, tail, middle, parts[0][:, None], order)
    far = refit(surface, middle, head, parts[1][:, None], order)
    grown = np.concatenate([offsets, far])
    grown[films] = near
    return Layout(
        divided(network, films),
        np.concatenate([points, middle]),
        grown,
        np.concatenate([layout.source, layout.source[films]]),
    )


def merge(surface: Surface, layout: Layout, markers: Ints) -> tuple[Layout, Ints]:
    """Take off markers, no film at two of them; the films (k,) that were joined come second."""
    network, points, offsets = layout.network, layout.points, layout.offsets
    order = offsets.shape[1] + 1
    after, stays, lives = merged(network, markers)
    first, second = marker_chains(network, markers)
    # seen along the film that stays
    ahead = (first & 1) == 0
    halves = np.where(ahead, [first, second], [second ^ 1, first ^ 1])
    begin, end = network.origin[halves[0]], network.origin[halves[1] ^ 1]
    parts = np.stack([_half_samples(surface, layout, half) for half in halves], axis=1)
    if surface.period is not None:
        gap = parts[:, 0, -1] - parts[:, 1, 0]
        parts[:, 1] += (gap - nearest_image(gap, surface.period))[:, None]
    joined = refit(surface, points[begin], points[end], parts, order)
    kept = offsets.copy()
    kept[first >> 1] = joined
    place = np.cumsum(np.isin(np.arange(network.n_films), stays)) - 1
    return Layout(after, points[lives], kept[stays], layout.source[stays]), place[first >> 1]


def film_samples(
    surface: Surface, tail: Floats, head: Floats, offsets: Floats, start: Floats, stop: Floats
) -> Floats:
    """Points (k, SAMPLES, 3) of films, evenly from parameter ``start`` (k,) to ``stop`` (k,)."""
    t = np.linspace(0.0, 1.0, SAMPLES)
    fine = lobatto(2 * (offsets.shape[1] + 1) + 8)
    curve = surface.arc_points(tail, head, offsets, fine.nodes)
    at = start[:, None] + (stop - start)[:, None] * t
    weights = fine.interpolation(at.ravel()).reshape(*at.shape, -1)
    out: Floats = np.einsum("fsk,fkx->fsx", weights, curve)
    return out


def _half_samples(surface: Surface, layout: Layout, halves: Ints) -> Floats:
    """Points along half-films (k,), (k, SAMPLES, 3)."""
    network, film = layout.network, halves >> 1
    zero, one = np.zeros(len(film)), np.ones(len(film))
    tail, head = layout.points[network.tails[film]], layout.points[network.heads[film]]
    curve = film_samples(surface, tail, head, layout.offsets[film], zero, one)
    out: Floats = np.where((halves & 1).astype(np.bool_)[:, None, None], curve[:, ::-1], curve)
    return out


def refit(surface: Surface, tail: Floats, head: Floats, parts: Floats, order: int) -> Floats:
    """Offsets (k, p − 1) of films that run along given curves (k, pieces, SAMPLES, 3) from tail to head.

    Every node moves across its film until it lies on the curve: Newton's method for its offset and its
    place along the curve.
    """
    rule, pieces = lobatto(order), parts.shape[1]
    inner = rule.nodes[1:-1]
    if surface.period is not None:
        away = parts[:, 0, 0] - tail
        parts = parts - (away - nearest_image(away, surface.period))[:, None, None]
        head = tail + nearest_image(head - tail, surface.period)
    flat = parts.reshape(len(tail), -1, 3)
    zero = np.zeros((len(tail), order - 1))
    straight = surface.arc_points(tail, head, zero, rule.nodes)[:, 1:-1]
    chord = (head - tail)[:, None]
    span = np.maximum(np.einsum("fix,fix->fi", chord, chord), 1e-300)
    along = np.einsum("fsx,fix->fs", flat - tail[:, None], chord) / span
    nearest = np.abs(along[:, None] - inner[None, :, None]).argmin(axis=2)
    s = (nearest // SAMPLES) + (nearest % SAMPLES) / (SAMPLES - 1.0)
    bend = surface.arc_points(tail, head, zero + FIT_DIFFERENCE, rule.nodes)[:, 1:-1] - straight
    across = bend / FIT_DIFFERENCE
    away = np.take_along_axis(flat, nearest[..., None], axis=1) - straight
    u = np.einsum("fjx,fjx->fj", away, across) / np.maximum((across**2).sum(axis=2), 1e-300)
    for _ in range(FIT_STEPS):
        here = surface.arc_points(tail, head, u, rule.nodes)[:, 1:-1]
        slope = surface.arc_points(tail, head, u + FIT_DIFFERENCE, rule.nodes)[:, 1:-1]
        across = (slope - here) / FIT_DIFFERENCE
        there, ahead = _interpolated(parts, np.clip(s, 0.0, pieces))
        gap = there - here
        # least squares of gap = across δu − ahead δs
        aa, bb = (across**2).sum(axis=2), (ahead**2).sum(axis=2)
        ab = (across * ahead).sum(axis=2)
        ga, gb = (gap * across).sum(axis=2), (gap * ahead).sum(axis=2)
        det = np.maximum(aa * bb - ab**2, 1e-12 * aa * bb + 1e-300)
        u = u + np.clip((ga * bb - gb * ab) / det, -0.5, 0.5)
        s = np.clip(s + np.clip((ga * ab - gb * aa) / det, -0.5, 0.5), 0.0, pieces)
    return np.asarray(u, dtype=np.float64)


def _interpolated(parts: Floats, s: Floats) -> tuple[Floats, Floats]:
    """Points and derivatives (k, m, 3) of the curves at places ``s`` (k, m), one unit a piece."""
    pieces = parts.shape[1]
    piece = np.minimum(s.astype(np.int64), pieces - 1)
    x = (s - piece) * (SAMPLES - 1.0)
    first = np.clip(np.floor(x).astype(np.int64) - (STENCIL // 2 - 1), 0, SAMPLES - STENCIL)
    x = x - first
    knots = np.arange(STENCIL)
    gaps = knots[:, None] - knots[None]
    np.fill_diagonal(gaps, 1)
    scale = 1.0 / gaps.prod(axis=1)
    diff = x[..., None] - knots
    value, slope = np.empty(diff.shape), np.zeros(diff.shape)
    for i in range(STENCIL):
        others = [j for j in range(STENCIL) if j != i]
        value[..., i] = scale[i] * diff[..., others].prod(axis=-1)
        for j in others:
            rest = [m for m in others if m != j]
            slope[..., i] += scale[i] * diff[..., rest].prod(axis=-1)
    row = np.arange(len(parts))[:, None, None]
    at = parts[row, piece[..., None], first[..., None] + knots]
    point = np.einsum("fmi,fmix->fmx", value, at)
    return point, np.einsum("fmi,fmix->fmx", slope, at) * (SAMPLES - 1.0)


def steepness(offsets: Floats) -> Floats:
    """Greatest angle of each film with its own segment, in radians (n_films,): a half turn would be π/2."""
    rule = lobatto(offsets.shape[1] + 1)
    return np.asarray(np.arctan(np.abs(offsets @ rule.interior.T)).max(axis=1))


def layout_of(foam: Foam) -> Layout:
    """A foam's network and geometry."""
    films = np.arange(foam.network.n_films)
    return Layout(foam.network, foam.vertex_points, foam.film_offsets, films)


def add_markers(foam: Foam, films: ArrayLike, at: float | ArrayLike = 0.5) -> Foam:
    """Divide films by marker vertices; the curves stay as they are.

    Parameters
    ----------
    foam : Foam
    films : (k,) integer array
        Different films.
    at : float or (k,) array, optional
        Where, as a parameter between 0.05 and 0.95 along the film.

    Raises
    ------
    TypeError, ValueError
        If there is no such film, one is named twice, or ``at`` is out of range.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Torus, cluster_foam
    >>> foam = cluster_foam(HeleShawCell(Torus(20.0, 4.0), gap=0.5), 2, volumes=0.5)
    >>> more = add_markers(foam, [0, 1])
    >>> len(more.network.markers) - len(foam.network.markers)
    2
    """
    chosen, where = _checked(foam, films), at
    places = np.full(len(chosen), where) if np.ndim(where) == 0 else where
    places = as_floats(places, "at", (len(chosen),))
    if ((places < 0.05) | (places > 0.95)).any():
        raise ValueError("at must lie between 0.05 and 0.95")
    return _laid(foam, divide(foam.cell.surface, layout_of(foam), chosen, places))


def remove_markers(foam: Foam, markers: ArrayLike) -> Foam:
    """Take marker vertices off; the two films at each become one, along the same curve.

    Parameters
    ----------
    foam : Foam
    markers : (k,) integer array
        Twofold vertices, no two of them on one film.

    Raises
    ------
    TypeError, ValueError, TopologyError
        If a vertex is no marker, two share a film, or the film would begin and end at one vertex.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, cluster_foam
    >>> pair = cluster_foam(HeleShawCell(Sphere(10.0), gap=0.5), 2, volumes=0.5)
    >>> marked = add_markers(pair, [0])  # the last vertex is the new one
    >>> marked.network.n_vertices, remove_markers(marked, [marked.network.n_vertices - 1]).network.n_vertices
    (9, 8)
    """
    if not isinstance(foam, Foam):
        raise TypeError(f"foam must be a Foam, got {type(foam).__name__}")
    network = foam.network
    chosen = as_indices(markers, "markers", (None,), below=network.n_vertices)
    if (network.vertex_degrees[chosen] != 2).any():
        bad = int(chosen[network.vertex_degrees[chosen] != 2][0])
        raise TopologyError(f"vertex {bad} is no marker")
    first, second = marker_chains(network, chosen)
    both = np.concatenate([first, second]) >> 1
    if len(np.unique(both)) != len(both):
        raise TopologyError("two of the markers share a film; take them off one after the other")
    if not removable(network, chosen).all():
        bad = int(chosen[~removable(network, chosen)][0])
        raise TopologyError(f"without marker {bad} a film would begin and end at one vertex")
    return _laid(foam, merge(foam.cell.surface, layout_of(foam), chosen)[0])


def _checked(foam: Foam, films: ArrayLike) -> Ints:
    if not isinstance(foam, Foam):
        raise TypeError(f"foam must be a Foam, got {type(foam).__name__}")
    chosen = as_indices(films, "films", (None,), below=foam.network.n_films)
    if len(np.unique(chosen)) != len(chosen):
        raise ValueError("films names a film twice")
    return chosen


def _laid(foam: Foam, layout: Layout) -> Foam:
    return replace(foam, network=layout.network, vertex_points=layout.points, film_offsets=layout.offsets)
