"""Pictures of a foam on its surface."""

from __future__ import annotations

import re
import textwrap
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import as_integer
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, writable_path
from warpedfoam.io.colours import (
    BubbleColours,
    bubble_colours,
)
from warpedfoam.io.patches import bubble_patches
from warpedfoam.plot.legends import explain
from warpedfoam.plot.painting import Strokes, as_pair, default_view, film_width, paint_foam, resolution
from warpedfoam.plot.projection import View
from warpedfoam.plot.stack import Stack
from warpedfoam.plot.style import FORMATS, USUAL, Style, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Surfaces that are called otherwise than their classes.
PROPER = {"SchwarzP": "Schwarz P surface", "Graph": "landscape", "Revolution": "surface of revolution"}


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
    wide, high = as_pair(size, "size")
    if min(wide, high) < 1.0:
        raise ValueError(f"size must be at least 1 inch each way, got {wide:g} by {high:g}")
    if title is not None and not isinstance(title, str):
        raise TypeError(f"title must be a string or None, got {type(title).__name__}")
    chosen = None if view is None else as_pair(view, "view")
    if width is None:
        style = Style.of(None, float(np.clip(25.4 * wide, 40.0, 1000.0)))
        style = replace(style, narrow=False)
    else:
        style = Style.of(width)
        high = style.width * high / wide
    segments, rings = resolution(foam.n_bubbles)
    patches = bubble_patches(foam, curve_points=segments + 1, rings=rings)
    elevation, azimuth = default_view(foam, patches) if chosen is None else chosen

    stack = Stack.of(style, legends) if style.narrow else None
    if stack is not None:
        figure, axes = stack.figure, stack.axes
    else:
        figure = replace(style, width=wide if width is None else style.width).figure(high)
        axes = figure.add_subplot()
        axes.set_aspect("equal")
    axes.set_axis_off()
    thin = film_width(foam.n_bubbles) * min(1.0, style.width / (USUAL / 25.4)) ** 0.6
    paint_foam(axes, foam, patches, colours, View.from_angles(elevation, azimuth), segments, strokes, thin)
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


def heading(foam: Foam) -> str:
    """Number of bubbles, surface and energy."""
    name = type(foam.cell.surface).__name__
    kind = PROPER.get(name) or re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    article = "an" if kind[0] in "aeiou" else "a"
    count = foam.n_bubbles - (foam.exterior is not None)
    return f"{count} bubble{'' if count == 1 else 's'} on {article} {kind} · energy {foam.energy:.6g}"
