"""A picture of true proportions above its legends, as wide as asked for and as high as need be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from warpedfoam.plot.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Inches: border of the figure, space between its parts, thickness of a colour bar.
BORDER, BETWEEN, BAR = 0.04, 0.06, 0.11
#: Highest picture, and its greatest width, in widths of the figure.
TALLEST = 1.2


@dataclass(frozen=True, eq=False)
class Stack:
    """A figure with a picture on ``axes`` and empty axes below it, each for a legend or a colour bar."""

    figure: Figure
    axes: Axes
    feet: tuple[Axes, ...]
    style: Style

    @classmethod
    def of(cls, style: Style, n_feet: int) -> Stack:
        """Nothing drawn yet."""
        figure = style.figure(style.width)
        figure.set_layout_engine("none")
        axes = figure.add_axes((0.1, 0.3, 0.8, 0.6))
        axes.set_aspect("equal")
        feet = tuple(figure.add_axes((0.15, 0.1, 0.7, 0.02)) for _ in range(n_feet))
        for foot in feet:
            foot.set_axis_off()
        return cls(figure, axes, feet, style)

    def settle(self) -> None:
        """Put all in place, once it is drawn."""
        figure, axes, width = self.figure, self.axes, self.style.width
        figure.draw_without_rendering()
        box, around = axes.get_window_extent(), axes.get_tightbbox()
        assert around is not None
        sides = ((box.x0, around.x0), (around.x1, box.x1))
        left, right = (max(a - b, 0.0) / figure.dpi for a, b in sides)
        above, below = ((a - b) / figure.dpi for a, b in ((around.y1, box.y1), (box.y0, around.y0)))
        (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
        shape = (y1 - y0) / (x1 - x0)
        free = width - left - right - 2.0 * BORDER
        wide = min(max(free, 0.4 * width), TALLEST * width / shape)
        tall = wide * shape
        heights = []
        for foot in self.feet:
            room = foot.get_tightbbox()
            base = foot.get_window_extent()
            bar = foot.axison
            heights.append(
                0.0 if room is None else (room.height - base.height * bar) / figure.dpi + BAR * bar
            )
        total = 2.0 * BORDER + above + tall + below + sum(heights) + BETWEEN * len(heights)
        figure.set_size_inches(width, total)
        # in the middle of what the labels leave
        first = (
            BORDER + max(left, 0.0) + 0.5 * (width - 2.0 * BORDER - max(left, 0.0) - max(right, 0.0) - wide)
        )
        top = total - BORDER - above
        axes.set_position((first / width, (top - tall) / total, wide / width, tall / total))
        top -= tall + below
        for foot, height in zip(self.feet, heights, strict=True):
            top -= BETWEEN
            if foot.axison:
                foot.set_position((0.15, (top - BAR) / total, 0.7, BAR / total))
            else:
                foot.set_position((0.0, (top - height) / total, 1.0, height / total))
            top -= height
