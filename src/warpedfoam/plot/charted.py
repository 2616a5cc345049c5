"""`Charted`: a drawn figure together with the numbers that it shows."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.io.atomic import PathLike, atomic_text, writable_path
from warpedfoam.plot.style import LEAST, Style, write_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Charted:
    """A figure and its table.

    Attributes
    ----------
    figure : matplotlib.figure.Figure
        Not tied to pyplot: nothing to close.
    table : dict of str to (n,) array
        Columns, all of one length.
    """

    figure: Figure
    table: dict[str, Floats]

    def save(self, path: PathLike, *, dpi: int = 160) -> Path:
        """Write the figure as PNG, SVG or PDF, by the ending of ``path``.

        Raises
        ------
        TypeError, ValueError
            Other endings; ``dpi`` below 20 or above 2400.
        FileNotFoundError, IsADirectoryError
            If the path cannot be written.
        """
        return write_figure(path, self.figure, dpi)

    def write_csv(self, path: PathLike) -> Path:
        """Write the table, one row per line of the columns, in full precision.

        Raises
        ------
        FileNotFoundError, IsADirectoryError, ValueError
            If the path cannot be written.
        """
        target = writable_path(path, suffixes=(".csv",))
        with atomic_text(target) as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(self.table)
            writer.writerows(zip(*(column.tolist() for column in self.table.values()), strict=True))
        return target


def beside(
    style: Style, height: float, count: int, shares: Sequence[float] | None = None
) -> tuple[Figure, list[Axes]]:
    """Panels beside each other on a figure ``height`` inches high, or one below the other on a narrow one."""
    if style.narrow:
        return style.panels(count)
    figure = style.figure(height * style.width / style.usual)
    return figure, list(np.atleast_1d(figure.subplots(1, count, width_ratios=shares)))


def with_inset(
    style: Style, height: float, place: tuple[float, float, float, float]
) -> tuple[Figure, Axes, Axes, Style]:
    """A panel with another one in it, which stands below it on a narrow figure; and the style of that."""
    if style.narrow:
        figure, (axes, below) = style.panels(2)
        return figure, axes, below, style
    figure, (axes,) = beside(style, height, 1)
    # letters of an inset are a fifth smaller, but readable
    less = replace(style, text=max(LEAST, 0.8 * style.text), small=max(LEAST, 0.7 * style.text))
    return figure, axes, axes.inset_axes(place), less


def shade_of(place: int, count: int) -> tuple[float, float, float]:
    """Colours of a family of lines, from dark to light, safe for colour-blind readers."""
    from matplotlib import colormaps

    red, green, blue, _ = colormaps["viridis"](0.85 * place / max(count - 1, 1))
    return float(red), float(green), float(blue)


def degrees_axis(axes: Axes, *, short: bool = False) -> None:
    """φ from 0 to 180 degrees, marked at the outer and inner equator; named in two lines if ``short``."""
    axes.set_xlim(0.0, 180.0)
    axes.set_xticks(np.arange(0.0, 181.0, 45.0))
    name = "φ (degrees)\n0 outer, 180 inner equator" if short else "φ (degrees; 0 outer, 180 inner equator)"
    axes.set_xlabel(name)


def columns(**parts: Floats) -> dict[str, Floats]:
    """A table from arrays that broadcast against one another."""
    spread = np.broadcast_arrays(*parts.values())
    return {name: np.array(part, dtype=np.float64).ravel() for name, part in zip(parts, spread, strict=True)}
