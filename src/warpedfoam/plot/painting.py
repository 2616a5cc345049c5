"""A foam painted on the axes of a figure: patches and films from back to front."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warpedfoam.arrays import Floats, Ints, as_number
from warpedfoam.foam import Foam
from warpedfoam.io.colours import FILM_COLOUR, BubbleColours, as_rgb
from warpedfoam.io.patches import Patches
from warpedfoam.plot.projection import View, back_to_front, facing, shades
from warpedfoam.surfaces import Sphere

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Above this many polygons a vector file holds the foam as an image, its text as text.
_MOST_VECTORS = 20_000
# Backs keep this share of their colour, the rest is this grey.
BACK_SHARE, BACK_GREY = 0.25, 0.62
#: Directions that are tried for a view of a cluster, and degrees by which it is seen from above and the side.
DIRECTIONS, RAISED, SIDEWAYS = 4000, 20.0, 15.0


@dataclass(frozen=True, eq=False)
class Strokes:
    """Lines of a picture beside the plain films.

    Attributes
    ----------
    halves : (k,) integer array
        Half-films drawn otherwise, in ``film_rgb`` (k, 3) and ``film_widths`` (k,) times their plain width.
        Where a surface repeats, only the image of the film beside the half-film's bubble is.
    marks : (m, 2, 3) array
        Segments on the surface, each on a bubble ``mark_bubble`` (m,), in ``mark_rgb`` (m, 3) and
        ``mark_widths`` (m,) times the films' plain width.
    """

    halves: Ints
    film_rgb: Floats
    film_widths: Floats
    marks: Floats
    mark_bubble: Ints
    mark_rgb: Floats
    mark_widths: Floats


def as_pair(value: object, name: str) -> tuple[float, float]:
    """Two numbers, of an argument ``name``."""
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise TypeError(f"{name} must be a pair of numbers, got {value!r}")
    return as_number(value[0], f"{name}[0]"), as_number(value[1], f"{name}[1]")


def resolution(n_bubbles: int) -> tuple[int, int]:
    """Segments of each film and rings of each bubble: finer where a bubble is large in the picture."""
    for most, segments, rings in ((20, 24, 10), (300, 10, 5), (1500, 6, 3)):
        if n_bubbles <= most:
            return segments, rings
    return 4, 2


def default_view(foam: Foam, patches: Patches) -> tuple[float, float]:
    """Elevation and azimuth in degrees: from the side and a little above, or from above what lies flat.

    Clusters are seen from their front.
    """
    front = cluster_view([foam])
    if front is not None:
        # a little from above and from the side, so that the surface is seen to bend
        return min(front[0] + RAISED, max(front[0], 90.0 - RAISED)), front[1] - SIDEWAYS
    if np.ptp(patches.points[:, 2]) <= 1e-9 * foam.cell.surface.size:
        return 90.0, -90.0
    low_and_flat = np.argmin(np.ptp(patches.points, axis=0)) == 2
    return (48.0, -60.0) if low_and_flat and foam.cell.surface.euler_characteristic <= 0 else (25.0, -60.0)


def cluster_view(foams: Sequence[Foam]) -> tuple[float, float] | None:
    """Elevation and azimuth from which the bubbles of clusters are seen best, in all frames; or None."""
    first = foams[0]
    if first.exterior is None or first.cell.surface.period is not None:
        return None
    centres = np.concatenate([np.delete(foam.bubble_centres, first.exterior, axis=0) for foam in foams])
    normals = first.cell.surface.normals(centres)
    ways = Sphere(1.0).lattice_points(DIRECTIONS)
    worst = (ways @ normals.T).min(axis=1)
    if worst.max() <= 0.0:
        return None
    # of equally good ones the middle
    best = ways[worst >= worst.max() - 0.02].mean(axis=0)
    best /= np.linalg.norm(best)
    elevation = float(np.degrees(np.arcsin(np.clip(best[2], -1.0, 1.0))))
    return elevation, float(np.degrees(np.arctan2(best[1], best[0])))


def paint_foam(
    axes: Axes,
    foam: Foam,
    patches: Patches,
    colours: BubbleColours,
    view: View,
    segments: int,
    strokes: Strokes | None,
    thin: float | None = None,
) -> None:
    """Triangles and film segments in one collection, farthest first; ``patches`` have as many ``segments``.

    Films are ``thin`` points wide, or as suits the number of bubbles.
    """
    from matplotlib.collections import PolyCollection

    thin = film_width(foam.n_bubbles) if thin is None else thin

    surface = foam.cell.surface
    corners = view.project(patches.points)[patches.triangles]
    normals = view.project(surface.normals(patches.points))[patches.triangles].mean(axis=1)
    front = facing(corners) > 0.0
    # of a surface with edges in the picture the back is seen too: paler, lit as if turned round
    edged = surface.period is not None or surface.rim is not None
    seen = np.ones(len(corners), dtype=bool) if edged else front
    corners, normals, front = corners[seen], normals[seen], front[seen]
    fill = colours.rgb[patches.triangle_bubble[seen]] / 255.0
    fill = np.where(front[:, None], fill, BACK_SHARE * fill + (1.0 - BACK_SHARE) * BACK_GREY)
    fill *= shades(np.where(front[:, None], normals, -normals))[:, None]

    curves, film = foam.film_curves(segments + 1), np.arange(foam.network.n_films)
    special = None if strokes is None else strokes.halves >> 1
    if foam.loop_shifts is not None:
        # a bubble that reaches over the edge of the unit is drawn whole, with its own images of its films
        film = foam.network.loops.halves >> 1
        if strokes is not None:
            place = np.empty(2 * foam.network.n_films, dtype=np.int64)
            place[foam.network.loops.halves] = np.arange(len(film))
            special = place[strokes.halves]
        curves = curves[film] + foam.loop_shifts[:, None]
    middles = 0.5 * (curves[:, 1:] + curves[:, :-1]).reshape(-1, 3)
    towards = view.project(surface.normals(middles))[:, 2] > 0.0
    if edged:
        towards[:] = True
    flat = view.project(curves)
    pieces = np.stack([flat[:, :-1], flat[:, 1:]], axis=2).reshape(-1, 2, 3)[towards]
    # each piece is painted after the triangles beside it: lifted by the depth that these span
    span = np.zeros(foam.n_bubbles)
    np.maximum.at(span, patches.triangle_bubble[seen], np.ptp(corners[:, :, 2], axis=1))
    beside = np.maximum(span[foam.network.left], span[foam.network.right])[film]
    lift = np.repeat(beside, segments)[towards] + np.ptp(pieces[:, :, 2], axis=1)
    ink = np.tile(as_rgb(FILM_COLOUR) / 255.0, (len(film), 1))
    widths = np.full(len(film), thin)
    if strokes is not None and special is not None:
        ink[special], widths[special] = strokes.film_rgb, thin * strokes.film_widths
        # above plain films in the same place
        over = np.zeros(len(film))
        over[special] = beside[special]
        lift += np.repeat(over, segments)[towards]
    ink, widths = (np.repeat(a, segments, axis=0)[towards] for a in (ink, widths))
    if strokes is not None and len(strokes.marks):
        middle = strokes.marks.mean(axis=1)
        shown = view.project(surface.normals(middle))[:, 2] > 0.0
        marks = view.project(strokes.marks[shown])
        pieces = np.concatenate([pieces, marks])
        # over the bubble's films, which are lifted once
        lift = np.concatenate([lift, 2.0 * span[strokes.mark_bubble[shown]] + np.ptp(marks[:, :, 2], axis=1)])
        ink = np.concatenate([ink, strokes.mark_rgb[shown]])
        widths = np.concatenate([widths, thin * strokes.mark_widths[shown]])
    closed = np.concatenate([pieces, pieces[:, :1]], axis=1)

    owner = patches.triangle_bubble[seen]
    below = np.where(np.isin(owner, patches.sunk), 2.0 * span[owner], 0.0)
    depth = np.concatenate([corners[:, :, 2].mean(axis=1) - below, pieces[:, :, 2].mean(axis=1) + lift])
    order = back_to_front(depth)
    paths = np.concatenate([corners[:, :, :2], closed[:, :, :2]])[order]
    faces = np.concatenate([fill, ink])[order]
    # a hairline of its own colour closes the seams between triangles
    lines = np.concatenate([np.full(len(corners), 0.5), widths])[order]
    axes.add_collection(
        PolyCollection(
            list(paths),
            facecolors=faces,
            edgecolors=faces,
            linewidths=lines,
            capstyle="round",
            joinstyle="round",
            rasterized=len(paths) > _MOST_VECTORS,
        ),
        autolim=False,
    )
    low, high = corners[:, :, :2].min(axis=(0, 1)), corners[:, :, :2].max(axis=(0, 1))
    margin = 0.02 * float((high - low).max())
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)


def film_width(n_bubbles: int) -> float:
    """Points: 1.3 for a few bubbles down to 0.35 for thousands."""
    return float(np.clip(1.3 * (100.0 / n_bubbles) ** 0.3, 0.35, 1.3))
