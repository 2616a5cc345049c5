"""A foam's films as chains of edges on the inner plate: the Surface Evolver's string model."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.foam import Foam
from warpedfoam.io.evolver_forms import rest_of
from warpedfoam.io.evolver_formulas import Formulas


def strings(foam: Foam, formulas: Formulas, segments: int) -> Iterator[str]:
    """Vertices and edges, line by line."""
    yield from _vertices(foam, formulas, segments)
    yield ""
    yield from _edges(foam, formulas, segments)


def held(formulas: Formulas) -> dict[int, str]:
    """Words that hold some of the foam's vertices on the inner plate, others being on constraint 1 only."""
    words: dict[int, str] = {}
    for k, (_, vertices) in enumerate(formulas.rims):
        words |= dict.fromkeys(vertices, f" constraint 1 {k + 3}")
    start = 3 + len(formulas.rims)
    words |= {vertex: f" constraint 1 {start + k}" for k, (vertex, _) in enumerate(formulas.pinned)}
    return words | dict.fromkeys(formulas.fixed, " fixed")


def wraps(shifts: Floats, period: Floats | None) -> list[str]:
    """How edges wrap round a space that repeats: a word per row of shifts (n, 3), blank where none does."""
    if period is None:
        return [""] * len(shifts)
    turns = np.round(np.where(np.isfinite(period), shifts / period, 0.0)).astype(np.int64)
    signs = np.array(["-", "*", "+"])[np.clip(turns, -1, 1) + 1]
    return [" " + " ".join(row) for row in signs.tolist()]


def borders(foam: Foam) -> list[str]:
    """Names of the quantities beside each film, with their signs."""
    network, rest = foam.network, rest_of(foam)
    names = [f" bubble_{i}" for i in foam.bubble_ids.tolist()]
    names[rest] = ""
    return [
        f"{names[a]}{names[b]}{' -' if names[b] else ''}"
        for a, b in zip(network.left.tolist(), network.right.tolist(), strict=True)
    ]


def _vertices(foam: Foam, formulas: Formulas, segments: int) -> Iterator[str]:
    """The foam's vertices, then film by film those between."""
    words, network = held(formulas), foam.network
    step = 0.25 / segments
    tail, head = foam.film_ends

    def numbers(points: Floats, along: Floats) -> list[list[float]]:
        along = along / np.linalg.norm(along, axis=-1, keepdims=True)
        level = np.einsum("...x,...x->...", points, along)[..., None]
        rows: list[list[float]] = np.concatenate([points, along, level], axis=-1).reshape(-1, 7).tolist()
        return rows

    def sided(k: int, row: list[float]) -> str:
        x, y, z, a, b, c, d = row
        return f"{k} {x!r} {y!r} {z!r} constraint 1 2 side {{{a!r}, {b!r}, {c!r}, {d!r}}}"

    # where only two films meet a vertex would slide as those between do
    sides: dict[int, list[float]] = {}
    if len(network.markers):
        near = foam.film_curves_at(np.array([0.0, step]))
        leaving = np.zeros((network.n_vertices, 3))
        leaving[network.tails] = near[:, 1] - near[:, 0]
        rows = numbers(foam.vertex_points[network.markers], leaving[network.markers])
        sides = dict(zip(network.markers.tolist(), rows, strict=True))
    yield "vertices"
    for k, (x, y, z) in enumerate(foam.vertex_points.tolist()):
        if k in sides and k not in words:
            yield sided(k + 1, sides[k])
        else:
            yield f"{k + 1} {x!r} {y!r} {z!r}{words.get(k, ' constraint 1')}"
    # chords of a parabola cut off 1/segments² of the area under it, so the points lie that much farther
    # out: the file starts near its volumes
    offsets = foam.film_offsets * (segments**2 / max(segments**2 - 1, 1))
    xi = np.arange(1, segments) / segments
    arcs = foam.cell.surface.arc_points
    points, behind, ahead = (arcs(tail, head, offsets, xi + s) for s in (0.0, -step, step))
    for k, row in enumerate(numbers(points, ahead - behind)):
        yield sided(network.n_vertices + 1 + k, row)


def _edges(foam: Foam, formulas: Formulas, segments: int) -> Iterator[str]:
    network = foam.network
    first = network.n_vertices + 1 + np.arange(network.n_films * (segments - 1)).reshape(-1, segments - 1)
    chains = np.concatenate(
        [network.tails[:, None] + 1, first.reshape(network.n_films, -1), network.heads[:, None] + 1], axis=1
    )
    # the Evolver's own length carries the energy where the films have no density
    density = f" tension {formulas.tension!r}"
    beside = borders(foam)
    none = wraps(np.zeros((1, 3)), foam.cell.surface.period)[0]
    last = wraps(foam.film_ends[1] - foam.vertex_points[network.heads], foam.cell.surface.period)
    yield "edges"
    for film, chain in enumerate(chains.tolist()):
        end = f" constraint 1{density}{beside[film]}"
        for k in range(segments):
            wrap = last[film] if k == segments - 1 else none
            yield f"{film * segments + k + 1} {chain[k]} {chain[k + 1]}{wrap}{end}"
