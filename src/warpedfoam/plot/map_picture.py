"""Maps of foams: a surface unrolled into the plane."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.analysis import DefectReport
from warpedfoam.analysis import defects as find_defects
from warpedfoam.arrays import Floats, Ints, as_flag, as_instance, as_number
from warpedfoam.foam import Foam
from warpedfoam.io.colours import FILM_COLOUR, bubble_colours
from warpedfoam.plot.defect_picture import kinds_legend, outlines
from warpedfoam.plot.foam_picture import heading
from warpedfoam.plot.legends import explain
from warpedfoam.plot.maps import Chart, Regions, Strands, chart_of, regions, window_area
from warpedfoam.plot.stack import TALLEST, Stack
from warpedfoam.plot.style import PAGE, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Share of the surface by which the outlines on a map may miss it.
MISSED = 1e-3
_LINE = "#8a8a8a"


def plot_map(
    foam: Foam,
    projection: str | None = None,
    *,
    color_by: str | ArrayLike = "charge",
    label: str | None = None,
    defects: bool | DefectReport = False,
    vertices: bool = False,
    centre: tuple[float, float] | None = None,
    width: float | None = PAGE,
    title: str | None = None,
) -> Figure:
    """Draw the whole foam on one map of its surface, unrolled into the plane.

    Bubbles are filled, films are curves, and what crosses a seam of the map is cut there. Sides of the map
    that are joined are dashed, rims are heavy lines.

    Parameters
    ----------
    foam : Foam
        On a surface that has a map: a torus, cylinder, catenoid, surface of revolution, plane, landscape
        over a rectangle or a disk, sphere, or another surface that every ray from the origin meets once.
    projection : str, optional
        Of a torus or a surface of revolution: "angles" (the angle θ round the axis against the tube angle φ,
        or against height, with lengths up and down to scale), "equal_area" or "conformal". Of a sphere and
        its like: "hammer" (equal areas), "equirectangular", "equal_area" (Lambert's cylinder) or
        "stereographic" (both halves, angles true). Of a plane: "plane". The first is the default.
    color_by : {"charge", "pressure", "sides", "area", "volume", "curvature"} or (n_bubbles,) array, optional
        Bubbles whose value is NaN, and the exterior of clusters, are grey.
    label : str, optional
        What the colours mean, with the unit; for arrays above all.
    defects : bool or DefectReport, optional
        Outline clusters of charged bubbles by kind, with their Burgers vectors as arrows.
    vertices : bool, optional
        Mark the vertices.
    centre : (float, float), optional
        Degrees of longitude and latitude (θ and φ on a torus; θ on surfaces of revolution) in the middle.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column. Letters
        are never below 6 points.
    title : str, optional
        In place of the number of bubbles and the energy.

    Returns
    -------
    matplotlib.figure.Figure
        Not tied to pyplot: nothing to close.

    Raises
    ------
    TypeError, ValueError
        If an argument has the wrong type or value; if the surface has no such map; if the films do not bound
        the bubbles, as may be where a foam did not converge.

    References
    ----------
    J. P. Snyder, *Map projections: a working manual*, US Geological Survey Professional Paper 1395 (1987).

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=40, seed=1)
    >>> figure = plot_map(foam, "hammer", width=86.0)
    """
    as_instance(foam, "foam", Foam)
    if projection is not None and not isinstance(projection, str):
        raise TypeError(f"projection must be a string or None, got {type(projection).__name__}")
    for name, text in (("label", label), ("title", title)):
        if text is not None and not isinstance(text, str):
            raise TypeError(f"{name} must be a string or None, got {type(text).__name__}")
    as_flag(vertices, "vertices")
    found = _report(foam, defects)
    colours = bubble_colours(foam, color_by, label)
    chart = chart_of(foam.cell.surface, projection, _centre(centre))
    strands = chart.strands(foam.film_curves(_points(foam.n_bubbles)))
    areas = regions(foam.network, strands, chart)
    _require_cover(areas, chart)

    style = Style.of(width, PAGE)
    edge = _edges(chart)
    low, high = np.concatenate(edge).min(axis=0), np.concatenate(edge).max(axis=0)
    stack = Stack.of(style, 1 if found is None else 2)
    axes, inches = stack.axes, _inches(style, chart, high - low)
    scale = 72.0 * inches / float(high[0] - low[0])
    size = scale * float(np.sqrt(areas.areas.sum() / foam.n_bubbles))
    thin = float(np.clip(0.045 * size, 0.25, 1.2))
    _fill(axes, areas, colours.rgb / 255.0)
    _lines(axes, chart.graticule(), _LINE, 0.5 * style.line, alpha=0.7, zorder=1.5)
    _lines(axes, _pieces(strands, chart), FILM_COLOUR, thin, zorder=2.0)
    _frame(axes, foam, chart, edge, style)
    if found is not None:
        _defects(axes, foam, found, chart, strands, thin)
    if vertices:
        at = chart.where(foam.vertex_points)
        dot = float(np.clip(0.12 * size, 1.2, 4.0))
        axes.scatter(
            at[:, 0], at[:, 1], s=dot**2, c=FILM_COLOUR, edgecolors="white", linewidths=0.12 * dot, zorder=4.0
        )
    _marks(axes, chart, style, inches)
    margin = 0.012 * (high - low).max()
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    text = heading(foam) if title is None else title
    axes.set_title(_wrapped(text, inches, style.title), fontsize=style.title)
    explain(stack.feet[0], axes, foam, colours, style)
    if found is not None:
        kinds_legend(stack.feet[1], found, style)
    stack.settle()
    return stack.figure


def _report(foam: Foam, defects: bool | DefectReport) -> DefectReport | None:
    if isinstance(defects, DefectReport):
        if defects.network is not foam.network:
            raise ValueError("defects is a report of another foam; say True, or make it with defects(foam)")
        return defects
    return find_defects(foam) if as_flag(defects, "defects") else None


def _centre(centre: object) -> tuple[float, float] | None:
    if centre is None:
        return None
    if not isinstance(centre, (tuple, list)) or len(centre) != 2:
        raise TypeError(f"centre must be a pair of angles in degrees, got {centre!r}")
    return as_number(centre[0], "centre[0]"), as_number(centre[1], "centre[1]")


def _points(n_bubbles: int) -> int:
    """Points along each film: more where a bubble is large in the picture."""
    for most, points in ((20, 41), (300, 17), (1500, 9)):
        if n_bubbles <= most:
            return points
    return 6


def _require_cover(areas: Regions, chart: Chart) -> None:
    whole = window_area(chart)
    per_bubble = areas.bubble_areas(int(areas.bubble.max()) + 1)
    off = abs(float(areas.areas.sum()) / whole - 1.0)
    if off > MISSED or per_bubble.min() < -MISSED * whole:
        raise ValueError(
            f"the films do not bound the bubbles: together they cover {1.0 + off:.3g} times the surface "
            f"(bubble {int(np.argmax(per_bubble))} most); a film spans half a turn, or the foam did not "
            "converge"
        )


def _edges(chart: Chart) -> list[Floats]:
    """Outline of each window as drawn."""
    points, _ = chart.edge()
    return [chart.drawn(points, np.full(len(points), w)) for w in range(chart.n_windows)]


def _inches(style: Style, chart: Chart, extent: Floats) -> float:
    """About how many inches the map is wide."""
    inches = style.width - (4.0 if chart.axes() is not None else 0.6) * style.rise
    return min(inches, TALLEST * style.width * float(extent[0] / extent[1]))


def _fill(axes: Axes, areas: Regions, rgb: Floats) -> None:
    """One compound path a bubble, holes left out."""
    from matplotlib.collections import PathCollection
    from matplotlib.path import Path

    bubbles, first = np.unique(areas.bubble, return_index=True)
    size = np.diff(np.append(areas.starts, len(areas.points)))
    points = areas.points
    codes = np.full(len(points), Path.LINETO, dtype=np.uint8)
    codes[areas.starts] = Path.MOVETO
    stop = np.append(areas.starts[first[1:]], len(points))
    paths = [
        Path(points[a:b], codes[a:b], closed=False)
        for a, b in zip(areas.starts[first].tolist(), stop.tolist(), strict=True)
    ]
    assert size.sum() == len(points)
    fill = rgb[bubbles]
    # a hairline of its own colour closes the seams between fills
    axes.add_collection(
        PathCollection(paths, facecolors=fill, edgecolors=fill, linewidths=0.3, zorder=1.0), autolim=False
    )


def _pieces(strands: Strands, chart: Chart, film: Ints | None = None) -> list[Floats]:
    """Polylines as drawn, one for each stretch of a film inside a window."""
    at, window, owner = strands.at, strands.window, strands.film
    if film is not None:
        keep = np.isin(owner, film)
        at, window, owner = at[keep], window[keep], owner[keep]
    if not len(at):
        return []
    parted = (owner[1:] != owner[:-1]) | chart.jumps(at[:-1], window[:-1], at[1:], window[1:])
    return np.split(chart.drawn(at, window), np.flatnonzero(parted) + 1)


def _lines(axes: Axes, lines: Sequence[Floats], colour: object, width: float, **more: float) -> None:
    from matplotlib.collections import LineCollection

    if len(lines):
        axes.add_collection(
            LineCollection(list(lines), colors=colour, linewidths=width, capstyle="round", **more),
            autolim=False,
        )


def _frame(axes: Axes, foam: Foam, chart: Chart, edges: list[Floats], style: Style) -> None:
    """The map's outline: joined sides dashed, rims heavy, the rest thin."""
    joined = getattr(chart, "joined", None)
    rim = foam.cell.surface.rim is not None
    if joined is None or chart.axes() is None:
        thick = (2.2 if rim else 0.8) * style.line
        _lines(axes, [np.concatenate([e, e[:1]]) for e in edges], FILM_COLOUR, thick, zorder=3.0)
        return
    around = np.concatenate([edges[0], edges[0][:1]])
    sides = [around[k : k + len(around) // 4 + 1] for k in range(0, len(around) - 1, len(around) // 4)]
    for k, side in enumerate(sides):
        # bottom, right, top, left: the second coordinate is constant on the first of each two
        if joined[1 - k % 2]:
            axes.plot(*side.T, color=_LINE, linewidth=0.8 * style.line, linestyle=(0, (4, 3)), zorder=3.0)
        else:
            width = 2.2 if rim else 0.8
            axes.plot(*side.T, color=FILM_COLOUR, linewidth=width * style.line, zorder=3.0)


def _defects(
    axes: Axes, foam: Foam, found: DefectReport, chart: Chart, strands: Strands, thin: float
) -> None:
    """Outlines of clusters and Burgers vectors."""
    strokes = outlines(foam, found)
    colours, which = np.unique(strokes.film_rgb, axis=0, return_inverse=True)
    for k, colour in enumerate(colours):
        films = strokes.halves[which.reshape(-1) == k] >> 1
        _lines(axes, _pieces(strands, chart, films), colour, max(3.0 * thin, 0.9), zorder=3.5)
    if len(strokes.marks):
        arrows = chart.strands(strokes.marks)
        _lines(axes, _pieces(arrows, chart), strokes.mark_rgb[0], max(1.6 * thin, 0.7), zorder=3.6)


def _marks(axes: Axes, chart: Chart, style: Style, inches: float) -> None:
    marks = chart.axes()
    axes.spines[:].set_visible(False)
    note = _wrapped(chart.note, max(inches, 0.6 * style.width), style.small)
    if marks is None:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_xlabel(note, fontsize=style.small)
        return
    across, up = marks
    axes.set_xticks(across.ticks, across.texts, fontsize=style.small)
    axes.set_yticks(up.ticks, up.texts, fontsize=style.small)
    axes.tick_params(length=2.5, width=0.6)
    axes.set_xlabel(f"{across.label}\n{note}", fontsize=style.small)
    axes.set_ylabel(up.label, fontsize=style.small)


def _wrapped(text: str, inches: float, size: float) -> str:
    """In lines that fit a width."""
    return textwrap.fill(text, max(20, int(72.0 * inches / (0.56 * size))))
