"""`Charted`: a drawn figure together with the numbers that it shows."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.io.atomic import PathLike, atomic_text, writable_path
from warpedfoam.plot.style import write_figure

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


def new_figure(width: float, height: float) -> Figure:
    """An empty figure that no window belongs to."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def shade_of(place: int, count: int) -> tuple[float, float, float]:
    """Colours of a family of lines, from dark to light, safe for colour-blind readers."""
    from matplotlib import colormaps

    red, green, blue, _ = colormaps["viridis"](0.85 * place / max(count - 1, 1))
    return float(red), float(green), float(blue)


def degrees_axis(axes: Axes) -> None:
    """φ from 0 to 180 degrees, marked at the outer and inner equator."""
    axes.set_xlim(0.0, 180.0)
    axes.set_xticks(np.arange(0.0, 181.0, 45.0))
    axes.set_xlabel("φ (degrees; 0 outer, 180 inner equator)")


def columns(**parts: Floats) -> dict[str, Floats]:
    """A table from arrays that broadcast against one another."""
    spread = np.broadcast_arrays(*parts.values())
    return {name: np.array(part, dtype=np.float64).ravel() for name, part in zip(parts, spread, strict=True)}
