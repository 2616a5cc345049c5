"""A foam's films as curved triangles from plate to plate: the Surface Evolver's soapfilm model.

Each film is a grid of quadrilaterals, cut along alternating diagonals. Elements are quadratic: an edge has a
vertex in its middle, so that the vertices are those of a grid of twice as many steps each way, the even ones
corners. The vertices of the foam become lines through the gap.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from warpedfoam.arrays import Floats, Ints
from warpedfoam.foam import Foam
from warpedfoam.io.evolver_formulas import Formulas
from warpedfoam.io.evolver_strings import borders, held, wraps


def sheets(foam: Foam, formulas: Formulas, segments: int, layers: int) -> Iterator[str]:
    """Vertices, edges and faces, line by line."""
    network, period = foam.network, foam.cell.surface.period
    n_lines, n_films = network.n_vertices, network.n_films
    steps, levels = 2 * segments, 2 * layers + 1
    heights = foam.cell.mean_gap * np.arange(levels) / (levels - 1)

    def lifted(points: Floats) -> Floats:
        normals = foam.cell.surface.normals(points.reshape(-1, 3)).reshape(points.shape)
        out: Floats = points[..., None, :] + heights[:, None] * normals[..., None, :]
        return out

    yield "vertices"
    lines = lifted(foam.vertex_points)
    inner = lifted(foam.film_curves_at(np.arange(1, steps) / steps))
    on_plates = {0: " constraint 1", levels - 1: " constraint 2"}
    words = _line_words(formulas, levels - 1)
    for k, (x, y, z) in enumerate(lines.reshape(-1, 3).tolist()):
        vertex, level = divmod(k, levels)
        yield f"{k + 1} {x!r} {y!r} {z!r}{words.get((vertex, level), on_plates.get(level, ''))}"
    start = n_lines * levels
    for k, (x, y, z) in enumerate(inner.reshape(-1, 3).tolist()):
        yield f"{start + k + 1} {x!r} {y!r} {z!r}{on_plates.get(k % levels, '')}"

    # places of the vertices of every film, (n_films, steps + 1, levels), and what lies between two images
    grid = np.empty((n_films, steps + 1, levels), dtype=np.int64)
    column = np.arange(levels)
    grid[:, 0], grid[:, -1] = (end[:, None] * levels + column for end in (network.tails, network.heads))
    grid[:, 1:-1] = start + np.arange(n_films * (steps - 1) * levels).reshape(n_films, steps - 1, levels)
    shift = foam.film_ends[1] - foam.vertex_points[network.heads]

    yield from ("", "edges")
    upright, along, rising, slanted = _edge_numbers(n_lines, n_films, segments, layers)
    none = wraps(np.zeros((1, 3)), period)[0]
    film_wraps = wraps(shift, period)
    on_rims = {v: f" constraint {k + 3}" for k, (_, ends) in enumerate(formulas.rims) for v in ends}
    for vertex in range(n_lines):
        for k in range(layers):
            a = vertex * levels + 2 * k + 1
            yield f"{upright[vertex, k]} {a} {a + 2} {a + 1}{none}{on_rims.get(vertex, '')}"
    for film in range(n_films):
        g = (grid[film] + 1).tolist()
        for i in range(segments):
            wrap = film_wraps[film] if i == segments - 1 else none
            a, m, b = g[2 * i], g[2 * i + 1], g[2 * i + 2]
            for k in range(layers + 1):
                e = 2 * k
                yield f"{along[film, i, k]} {a[e]} {b[e]} {m[e]}{wrap}{on_plates.get(e, '')}"
            for k in range(layers):
                e = 2 * k
                low, high = (a[e], b[e + 2]) if (i + k) % 2 else (a[e + 2], b[e])
                yield f"{slanted[film, i, k]} {low} {high} {m[e + 1]}{wrap}"
                if i:
                    yield f"{rising[film, i - 1, k]} {a[e]} {a[e + 2]} {a[e + 1]}{none}"

    yield from ("", "faces")
    beside = borders(foam)
    sides = np.concatenate([upright[network.tails][:, None], rising, upright[network.heads][:, None]], axis=1)
    number = 0
    for film in range(n_films):
        end = f" tension {foam.tension!r}{beside[film]}"
        for i in range(segments):
            for k in range(layers):
                low, high = along[film, i, k], along[film, i, k + 1]
                left, right, cut = sides[film, i, k], sides[film, i + 1, k], slanted[film, i, k]
                pair = (
                    (f"{low} {right} -{cut}", f"{cut} -{high} -{left}")
                    if (i + k) % 2
                    else (f"{low} -{cut} -{left}", f"{right} -{high} {cut}")
                )
                for loop in pair:
                    number += 1
                    yield f"{number} {loop}{end}"


def _line_words(formulas: Formulas, top: int) -> dict[tuple[int, int], str]:
    """Words for vertices (line, level) that have other constraints than the plates'."""
    words: dict[tuple[int, int], str] = {}
    for k, (_, vertices) in enumerate(formulas.rims):
        for vertex in vertices:
            words |= {(vertex, level): f" constraint {k + 3}" for level in range(1, top)}
            words[vertex, 0], words[vertex, top] = f" constraint 1 {k + 3}", f" constraint 2 {k + 3}"
    return words | {(vertex, 0): word for vertex, word in held(formulas).items()}


def _edge_numbers(n_lines: int, n_films: int, segments: int, layers: int) -> tuple[Ints, Ints, Ints, Ints]:
    """Numbers, from 1, of the edges up the lines, along films, up films, and of the diagonals."""
    shapes = (
        (n_lines, layers),
        (n_films, segments, layers + 1),
        (n_films, segments - 1, layers),
        (n_films, segments, layers),
    )
    start, out = 1, []
    for shape in shapes:
        count = int(np.prod(shape))
        out.append(np.arange(start, start + count).reshape(shape))
        start += count
    return out[0], out[1], out[2], out[3]
