"""Sizes of figures and of what is written on them: readable at the width at which they are printed."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpedfoam.arrays import as_integer, as_number
from warpedfoam.io.atomic import PathLike, atomic_binary, writable_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Widths in millimetres: one column of a journal, both, and what figures are without a width.
COLUMN, PAGE, USUAL = 86.0, 180.0, 228.6
#: Width of one of several panels.
PANEL = 117.0
#: Panels beside each other that are narrower (mm) are higher than wide.
SMALL_PANEL = 75.0
#: Narrower ones (mm) have their panels and legends one below the other.
NARROW = 130.0
#: Points of letters on one column and on the usual width; none are smaller than the least.
_AT_COLUMN, _AT_USUAL, LEAST = 7.0, 11.0, 6.0
#: Okabe and Ito's colours: told apart by colour-blind readers.
BLUE, ORANGE, GREEN, GREY, PURPLE = "#0072b2", "#d55e00", "#009e73", "#7f7f7f", "#cc79a7"
FORMATS = (".png", ".svg", ".pdf")


@dataclass(frozen=True)
class Style:
    """Width in inches, letters and lines in points, for a figure printed at that width.

    Attributes
    ----------
    width : float
    text, small, title : float
        Sizes of labels, of ticks and of titles.
    line : float
        Factor for widths of lines, 1 at the usual width.
    usual : float
        Width in inches of the figure without a width.
    narrow : bool
        Whether panels and legends stand one below the other.
    """

    width: float
    text: float
    small: float
    title: float
    line: float
    usual: float
    narrow: bool

    @classmethod
    def of(cls, width: float | None = None, usual: float = USUAL) -> Style:
        """For a width in millimetres, 40 … 1000, or ``usual``.

        Examples
        --------
        >>> Style.of(86.0).text, Style.of(86.0).narrow, Style.of().text
        (7.0, True, 11.0)
        """
        mm = usual if width is None else as_number(width, "width", minimum=40.0, maximum=1000.0)
        share = (mm - COLUMN) / (USUAL - COLUMN)
        text = float(np.clip(_AT_COLUMN + share * (_AT_USUAL - _AT_COLUMN), LEAST + 0.5, _AT_USUAL))
        sizes = text, max(LEAST, text - 1.0), 1.15 * text
        return cls(mm / 25.4, *sizes, text / _AT_USUAL, usual / 25.4, mm < NARROW)

    @property
    def rise(self) -> float:
        """Height of a line of text, in inches."""
        return 1.5 * self.text / 72.0

    def figure(self, height: float) -> Figure:
        """An empty figure ``height`` inches high that no window belongs to."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(self.width, height), layout="constrained")
        FigureCanvasAgg(figure)
        return figure

    def context(self) -> AbstractContextManager[None]:
        """Letters, lines and ticks of this style for all that is drawn meanwhile."""
        from matplotlib import rc_context

        share = self.line
        return rc_context(
            {
                "font.size": self.text,
                "axes.labelsize": self.text,
                "axes.titlesize": self.text,
                "xtick.labelsize": self.small,
                "ytick.labelsize": self.small,
                "legend.fontsize": self.small,
                "lines.linewidth": 1.5 * share,
                "axes.linewidth": 0.8 * share,
                "xtick.major.width": 0.8 * share,
                "ytick.major.width": 0.8 * share,
                "xtick.major.size": 3.5 * share,
                "ytick.major.size": 3.5 * share,
            }
        )

    def small_panels(self, count: int) -> bool:
        """Whether so many panels beside each other are small."""
        return not self.narrow and 25.4 * self.width / count < SMALL_PANEL

    def panels(self, count: int) -> tuple[Figure, list[Axes]]:
        """Panels beside each other, or flatter ones below each other on a narrow figure."""
        wide = self.width / (1 if self.narrow else count)
        # so that legends have room
        tall = 1.15 if self.small_panels(count) else 0.87
        figure = self.figure(wide * 0.62 * count if self.narrow else wide * tall)
        rows, columns = (count, 1) if self.narrow else (1, count)
        return figure, [figure.add_subplot(rows, columns, k + 1) for k in range(count)]

    def dress(self, axes: Axes, x: str, y: str, title: str | None = None) -> None:
        """Labels, title and ticks of a panel."""
        axes.set_xlabel(x, fontsize=self.text)
        axes.set_ylabel(y, fontsize=self.text)
        if title is not None:
            axes.set_title(title, fontsize=self.text)
        axes.tick_params(labelsize=self.small)
        for axis in (axes.xaxis, axes.yaxis):
            axis.get_offset_text().set_fontsize(self.small)
        axes.spines[["top", "right"]].set_visible(False)


def write_figure(path: PathLike, figure: Figure, dpi: int) -> Path:
    """Write a figure as PNG, SVG or PDF, by the ending of ``path``; the same figure gives the same file."""
    from matplotlib import rc_context

    target = writable_path(path, suffixes=FORMATS)
    dots = as_integer(dpi, "dpi", minimum=20, maximum=2400)
    kind = target.suffix.lower().removeprefix(".")
    # no dates and no random names; letters stay letters, to be searched, edited and set in any font
    metadata: dict[str, Any] = {} if kind == "png" else {"CreationDate" if kind == "pdf" else "Date": None}
    with (
        atomic_binary(target) as stream,
        rc_context({"svg.hashsalt": "warpedfoam", "svg.fonttype": "none", "pdf.fonttype": 42}),
    ):
        figure.savefig(stream, format=kind, dpi=dots, metadata=metadata)
    return target
