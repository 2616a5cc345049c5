"""Pictures of a foam on its surface."""

from __future__ import annotations

import re
import textwrap
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, Ints, as_integer, as_number
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, writable_path
from warpedfoam.io.colours import (
    FILM_COLOUR,
    BubbleColours,
    as_rgb,
    bubble_colours,
)
from warpedfoam.io.patches import Patches, bubble_patches
from warpedfoam.plot.legends import explain
from warpedfoam.plot.projection import View, back_to_front, facing, shades
from warpedfoam.plot.stack import Stack
from warpedfoam.plot.style import FORMATS, USUAL, Style, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Above this many polygons a vector file holds the foam as an image, its text as text.
_MOST_VECTORS = 20_000
# Surfaces that are called after somebody.
PROPER = {"SchwarzP": "Schwarz P surface"}
# Backs keep this share of their colour, the rest is this grey.
BACK_SHARE, BACK_GREY = 0.25, 0.62


def plot_foam(
    foam: Foam,
    color_by: str | ArrayLike = "charge",
    *,
    label: str | None = None,
    view: tuple[float, float] | None = None,
    size: tuple[float, float] = (9.0, 6.2),
    width: float | None = None,
    title: str | None = None,
) -> Figure:
    """Draw the bubbles as curved patches and the films as lines, hidden parts left out.

    Orthographic; triangles and film segments are painted from back to front, those that face away
    are not drawn at all, so nothing shows through.

    Parameters
    ----------
    foam : Foam
    color_by : {"charge", "pressure", "sides", "area", "volume", "curvature"} or (n_bubbles,) array, optional
        Charges and sides get a legend with counts over the whole foam, the others a colour bar.
    label : str, optional
        What the colours mean, with the unit; for arrays above all.
    view : (float, float), optional
        Elevation above the xy plane and azimuth from the x axis, in degrees. By default from the
        side and a little above, or well above for surfaces with holes.
    size : (float, float), optional
        Width and height in inches.
    width : float, optional
        Instead, the width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one
        column. Letters are never below 6 points; legends stand below the foam on narrow figures.
    title : str, optional
        In place of the number of bubbles and the energy.

    Returns
    -------
    matplotlib.figure.Figure
        Not tied to pyplot: nothing to close.

    Raises
    ------
    TypeError
        If ``foam`` is not a Foam, or an argument has the wrong type.
    ValueError
        If ``color_by`` is unknown or asks for missing pressures, or a number is out of range.

    Notes
    -----
    O(n log n) in the number of triangles, about 70 per bubble for thousands of bubbles.
    """
    colours = bubble_colours(foam, color_by, label)
    painted = painted_foam(foam, colours, view=view, size=size, width=width, title=title, legends=1)
    explain(painted.host(0), painted.axes, foam, colours, painted.style)
    painted.settle()
    return painted.figure


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


@dataclass(frozen=True, eq=False)
class Painted:
    """A figure with a foam on ``axes``; a narrow one is stacked, its legends below the foam."""

    figure: Figure
    axes: Axes
    style: Style
    stack: Stack | None

    def host(self, k: int) -> Figure | Axes:
        """What carries the legend ``k``."""
        return self.figure if self.stack is None else self.stack.feet[k]

    def settle(self) -> None:
        """Fit the height of a narrow figure."""
        if self.stack is not None:
            self.stack.settle()


def painted_foam(
    foam: Foam,
    colours: BubbleColours,
    *,
    view: tuple[float, float] | None,
    size: tuple[float, float],
    width: float | None = None,
    title: str | None,
    strokes: Strokes | None = None,
    legends: int,
) -> Painted:
    """Figure with the foam in these colours; no legends yet, but room for so many."""
    wide, high = _pair(size, "size")
    if min(wide, high) < 1.0:
        raise ValueError(f"size must be at least 1 inch each way, got {wide:g} by {high:g}")
    if title is not None and not isinstance(title, str):
        raise TypeError(f"title must be a string or None, got {type(title).__name__}")
    chosen = None if view is None else _pair(view, "view")
    if width is None:
        style = Style.of(None, float(np.clip(25.4 * wide, 40.0, 1000.0)))
        style = replace(style, narrow=False)
    else:
        style = Style.of(width)
        high = style.width * high / wide
    segments, rings = _resolution(foam.n_bubbles)
    patches = bubble_patches(foam, curve_points=segments + 1, rings=rings)
    elevation, azimuth = _default_view(foam, patches) if chosen is None else chosen

    stack = Stack.of(style, legends) if style.narrow else None
    if stack is not None:
        figure, axes = stack.figure, stack.axes
    else:
        figure = replace(style, width=wide if width is None else style.width).figure(high)
        axes = figure.add_subplot()
        axes.set_aspect("equal")
    axes.set_axis_off()
    thin = _film_width(foam.n_bubbles) * min(1.0, style.width / (USUAL / 25.4)) ** 0.6
    _paint(axes, foam, patches, colours, View.from_angles(elevation, azimuth), segments, strokes, thin)
    text = heading(foam) if title is None else title
    if style.narrow:
        text = textwrap.fill(text, int(72.0 * style.width / (0.56 * style.title)))
    axes.set_title(text, fontsize=style.title)
    return Painted(figure, axes, style, stack)


def save_picture(
    path: PathLike,
    foam: Foam,
    color_by: str | ArrayLike = "charge",
    *,
    label: str | None = None,
    view: tuple[float, float] | None = None,
    size: tuple[float, float] = (9.0, 6.2),
    width: float | None = None,
    title: str | None = None,
    dpi: int = 160,
) -> Path:
    """Write the picture of `plot_foam` as PNG, SVG or PDF, by the ending of ``path``.

    Parameters
    ----------
    path : str or path
        Ends in ``.png``, ``.svg`` or ``.pdf``.
    foam : Foam
    color_by, label, view, size, width, title
        As for `plot_foam`.
    dpi : int, optional
        Dots per inch.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError, ValueError
        As `plot_foam`; other endings; ``dpi`` below 20 or above 2400.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.
    """
    writable_path(path, suffixes=FORMATS)
    as_integer(dpi, "dpi", minimum=20, maximum=2400)
    figure = plot_foam(foam, color_by, label=label, view=view, size=size, width=width, title=title)
    return save_figure(path, figure, dpi=dpi)


def save_figure(path: PathLike, figure: Figure, *, dpi: int = 160) -> Path:
    """Write a figure as PNG, SVG or PDF, by the ending of ``path``; the same figure gives the same file.

    Text stays text in SVG and PDF. Foams of more than 20 000 triangles and films are an image in them.

    Raises
    ------
    TypeError, ValueError, FileNotFoundError, IsADirectoryError
        As `save_picture`.
    """
    return write_figure(path, figure, dpi)


def _pair(value: object, name: str) -> tuple[float, float]:
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise TypeError(f"{name} must be a pair of numbers, got {value!r}")
    return as_number(value[0], f"{name}[0]"), as_number(value[1], f"{name}[1]")


def _resolution(n_bubbles: int) -> tuple[int, int]:
    """Segments of each film and rings of each bubble: finer where a bubble is large in the picture."""
    for most, segments, rings in ((20, 24, 10), (300, 10, 5), (1500, 6, 3)):
        if n_bubbles <= most:
            return segments, rings
    return 4, 2


def _default_view(foam: Foam, patches: Patches) -> tuple[float, float]:
    if np.ptp(patches.points[:, 2]) <= 1e-9 * foam.cell.surface.size:
        return 90.0, -90.0
    low_and_flat = np.argmin(np.ptp(patches.points, axis=0)) == 2
    return (48.0, -60.0) if low_and_flat and foam.cell.surface.euler_characteristic <= 0 else (25.0, -60.0)


def _paint(
    axes: Axes,
    foam: Foam,
    patches: Patches,
    colours: BubbleColours,
    view: View,
    segments: int,
    strokes: Strokes | None,
    thin: float | None = None,
) -> None:
    """Triangles and film segments in one collection, farthest first."""
    from matplotlib.collections import PolyCollection

    thin = _film_width(foam.n_bubbles) if thin is None else thin

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


def _film_width(n_bubbles: int) -> float:
    """Points: 1.3 for a few bubbles down to 0.35 for thousands."""
    return float(np.clip(1.3 * (100.0 / n_bubbles) ** 0.3, 0.35, 1.3))


def heading(foam: Foam) -> str:
    """Number of bubbles, surface and energy."""
    name = type(foam.cell.surface).__name__
    kind = PROPER.get(name) or re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    article = "an" if kind[0] in "aeiou" else "a"
    count = foam.n_bubbles - (foam.exterior is not None)
    return f"{count} bubble{'' if count == 1 else 's'} on {article} {kind} · energy {foam.energy:.6g}"
