"""Pictures of a foam on its surface."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from warpedfoam.arrays import Floats, Ints, as_integer, as_number
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_binary, writable_path
from warpedfoam.io.colours import (
    CHARGE_RANGE,
    FILM_COLOUR,
    OUTSIDE_COLOUR,
    RAMP,
    BubbleColours,
    as_rgb,
    bubble_colours,
    charge_rgb,
    ramp_rgb,
)
from warpedfoam.io.patches import Patches, bubble_patches
from warpedfoam.plot.projection import View, back_to_front, facing, shades

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Above this many polygons a vector file holds the foam as an image, its text as text.
_MOST_VECTORS = 20_000
# Surfaces that are called after somebody.
PROPER = {"SchwarzP": "Schwarz P surface"}
# Backs keep this share of their colour, the rest is this grey.
BACK_SHARE, BACK_GREY = 0.25, 0.62
FORMATS = (".png", ".svg", ".pdf")


def plot_foam(
    foam: Foam,
    color_by: str = "charge",
    *,
    view: tuple[float, float] | None = None,
    size: tuple[float, float] = (9.0, 6.2),
    title: str | None = None,
) -> Figure:
    """Draw the bubbles as curved patches and the films as lines, hidden parts left out.

    Orthographic; triangles and film segments are painted from back to front, those that face away
    are not drawn at all, so nothing shows through.

    Parameters
    ----------
    foam : Foam
    color_by : {"charge", "pressure", "sides", "area"}, optional
        Charges and sides get a legend with counts over the whole foam, the others a colour bar.
    view : (float, float), optional
        Elevation above the xy plane and azimuth from the x axis, in degrees. By default from the
        side and a little above, or well above for surfaces with holes.
    size : (float, float), optional
        Width and height in inches.
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
    colours = bubble_colours(foam, color_by)
    figure, axes = painted_foam(foam, colours, view=view, size=size, title=title)
    if colours.name in ("charge", "sides"):
        counted_sides(figure, foam, colours)
    else:
        colour_bar(figure, axes, colours)
    return figure


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


def painted_foam(
    foam: Foam,
    colours: BubbleColours,
    *,
    view: tuple[float, float] | None,
    size: tuple[float, float],
    title: str | None,
    strokes: Strokes | None = None,
) -> tuple[Figure, Axes]:
    """Figure with the foam in these colours, and its axes; no legend yet."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = _pair(size, "size")
    if min(width, height) < 1.0:
        raise ValueError(f"size must be at least 1 inch each way, got {width:g} by {height:g}")
    if title is not None and not isinstance(title, str):
        raise TypeError(f"title must be a string or None, got {type(title).__name__}")
    chosen = None if view is None else _pair(view, "view")
    segments, rings = _resolution(foam.n_bubbles)
    patches = bubble_patches(foam, curve_points=segments + 1, rings=rings)
    elevation, azimuth = _default_view(foam, patches) if chosen is None else chosen

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.set_axis_off()
    _paint(axes, foam, patches, colours, View.from_angles(elevation, azimuth), segments, strokes)
    axes.set_title(_heading(foam) if title is None else title, fontsize=13)
    return figure, axes


def save_picture(
    path: PathLike,
    foam: Foam,
    color_by: str = "charge",
    *,
    view: tuple[float, float] | None = None,
    size: tuple[float, float] = (9.0, 6.2),
    title: str | None = None,
    dpi: int = 160,
) -> Path:
    """Write the picture of `plot_foam` as PNG, SVG or PDF, by the ending of ``path``.

    Parameters
    ----------
    path : str or path
        Ends in ``.png``, ``.svg`` or ``.pdf``.
    foam : Foam
    color_by, view, size, title
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
    figure = plot_foam(foam, color_by, view=view, size=size, title=title)
    return save_figure(path, figure, dpi=dpi)


def save_figure(path: PathLike, figure: Figure, *, dpi: int = 160) -> Path:
    """Write a figure as PNG, SVG or PDF, by the ending of ``path``; the same figure gives the same file.

    Raises
    ------
    TypeError, ValueError, FileNotFoundError, IsADirectoryError
        As `save_picture`.
    """
    from matplotlib import rc_context

    target = writable_path(path, suffixes=FORMATS)
    dots = as_integer(dpi, "dpi", minimum=20, maximum=2400)
    kind = target.suffix.lower().removeprefix(".")
    # no dates and no random names: the same foam gives the same file
    metadata: dict[str, Any] = {} if kind == "png" else {"CreationDate" if kind == "pdf" else "Date": None}
    with atomic_binary(target) as stream, rc_context({"svg.hashsalt": "warpedfoam"}):
        figure.savefig(stream, format=kind, dpi=dots, metadata=metadata)
    return target


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
) -> None:
    """Triangles and film segments in one collection, farthest first."""
    from matplotlib.collections import PolyCollection

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
    thin = _film_width(foam.n_bubbles)
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


def _heading(foam: Foam) -> str:
    name = type(foam.cell.surface).__name__
    kind = PROPER.get(name) or re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    article = "an" if kind[0] in "aeiou" else "a"
    count = int((foam.network.bubble_euler == 1).sum())
    return f"{count} bubble{'' if count == 1 else 's'} on {article} {kind} · energy {foam.energy:.6g}"


def counted_sides(
    figure: Figure,
    foam: Foam,
    colours: BubbleColours,
    loc: Literal["outside right center", "outside right upper"] = "outside right center",
) -> None:
    """One entry per number of sides that occurs, with how many bubbles have it."""
    from matplotlib.patches import Patch

    # away from walls a bubble of n sides has the charge 6 − n; at them both do not go together
    walled = len(foam.network.walls) > 0
    found = 6 - foam.network.charges if colours.name == "charge" else foam.network.sides
    sides, counts = np.unique(found[colours.inside], return_counts=True)
    by_charge = colours.name == "charge"
    entries: list[tuple[Floats, str]] = []
    rgb = (
        charge_rgb((6 - sides).astype(np.float64))
        if by_charge
        else ramp_rgb(sides.astype(np.float64), colours.limits)
    )
    ends = np.clip(sides, 6 - CHARGE_RANGE, 6 + CHARGE_RANGE) if by_charge else sides
    for end in np.unique(ends):
        same = ends == end
        least, most = int(sides[same].min()), int(sides[same].max())
        name = f"n = {least}" if least == most else f"n = {least} … {most}"
        if by_charge and walled:
            name = f"q = {_signed(6 - least)}" + ("" if least == most else f" … {_signed(6 - most)}")
        elif by_charge:
            charge = f"q = {_signed(6 - least)}"
            name += f"  ({charge})" if least == most else f"  ({charge} … {_signed(6 - most)})"
        entries.append((rgb[same][0] / 255.0, f"{name}:  {int(counts[same].sum())}"))
    outside = int((~colours.inside).sum())
    if outside:
        entries.append((as_rgb(OUTSIDE_COLOUR) / 255.0, f"exterior:  {outside}"))
    title = "sides n, charge q = 6 − n:  bubbles" if by_charge else "sides n:  bubbles"
    if by_charge and walled:
        title = "charge q = 6 − films − 2 walls:  bubbles"
    figure.legend(
        handles=[Patch(facecolor=tuple(c), edgecolor="#555555", linewidth=0.6, label=t) for c, t in entries],
        title=title,
        loc=loc,
        frameon=False,
        fontsize=11,
        title_fontsize=11,
        alignment="left",
    )


def _signed(charge: int) -> str:
    return "0" if charge == 0 else f"{'+' if charge > 0 else '−'}{abs(charge)}"


def colour_bar(figure: Figure, axes: Axes, colours: BubbleColours) -> None:
    """Colour bar of values on the ramp."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    low, high = colours.limits
    if not high - low > 1e-9 * max(abs(low), abs(high)):
        half = 0.5 * abs(low) or 0.5  # one value: it sits in the middle of the bar
        low, high = low - half, high + half
    ramp = LinearSegmentedColormap.from_list("ramp", RAMP)
    bar = figure.colorbar(ScalarMappable(Normalize(low, high), ramp), ax=axes, shrink=0.7, pad=0.03)
    bar.set_label(colours.label, fontsize=12)
    bar.ax.tick_params(labelsize=11)
    bar.outline.set_linewidth(0.6)
