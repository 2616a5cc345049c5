"""Legends and colour bars of pictures of foams."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.foam import Foam
from warpedfoam.io.colours import (
    CHARGE_RANGE,
    CHARGES,
    OUTSIDE_COLOUR,
    RAMP,
    BubbleColours,
    as_rgb,
    charge_rgb,
    ramp_rgb,
)
from warpedfoam.plot.style import Style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure

Place = Literal["outside right center", "outside right upper", "outside right lower"]
#: Letters of an entry in the legend of sides.
ENTRY = 21


def counted_sides(
    host: Figure | Axes,
    foam: Foam,
    colours: BubbleColours,
    style: Style,
    loc: Place = "outside right center",
) -> None:
    """One entry per number of sides that occurs, with how many bubbles have it.

    On a figure at ``loc``, on axes in their middle.
    """
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
    handles = [Patch(facecolor=tuple(c), edgecolor="#555555", linewidth=0.6, label=t) for c, t in entries]
    put_legend(host, handles, title, style, loc, ENTRY)


def put_legend(
    host: Figure | Axes, handles: Sequence[Artist], title: str, style: Style, loc: Place, letters: int
) -> None:
    """A legend at ``loc`` of a figure, or in the middle of axes, in columns for so many letters an entry."""
    from matplotlib.figure import Figure

    below = not isinstance(host, Figure)
    host.legend(
        handles=list(handles),
        title=title,
        loc="upper center" if below else loc,
        ncols=_columns(len(handles), style, letters) if below else 1,
        frameon=False,
        fontsize=style.text,
        title_fontsize=style.text,
        alignment="left",
        handlelength=1.6,
        columnspacing=1.2,
        borderaxespad=0.2,
    )


def _columns(count: int, style: Style, letters: int) -> int:
    """How many entries of so many letters fit beside each other."""
    most = max(1, int(72.0 * style.width / ((letters + 4) * 0.56 * style.text)))
    rows = max(1, -(-count // most))
    return max(1, -(-count // rows))


def _signed(charge: int) -> str:
    return "0" if charge == 0 else f"{'+' if charge > 0 else '−'}{abs(charge)}"


def explain(host: Figure | Axes, axes: Axes, foam: Foam, colours: BubbleColours, style: Style) -> None:
    """A legend with counts, or a colour bar, whichever the colours of the foam on ``axes`` need."""
    from matplotlib.figure import Figure

    if colours.kind in ("charge", "counted"):
        counted_sides(host, foam, colours, style)
    elif isinstance(host, Figure):
        _bar(host.colorbar(_scale(colours), ax=axes, shrink=0.7, pad=0.03), colours, style)
    else:
        from matplotlib.ticker import MaxNLocator

        host.set_axis_on()
        ticks = MaxNLocator(5)
        bar = host.figure.colorbar(_scale(colours), cax=host, orientation="horizontal", ticks=ticks)
        _bar(bar, colours, style)


def _scale(colours: BubbleColours) -> ScalarMappable:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    low, high = colours.limits
    if not high - low > 1e-9 * max(abs(low), abs(high)):
        half = 0.5 * abs(low) or 0.5  # one value: it sits in the middle of the bar
        low, high = low - half, high + half
    stops = RAMP if colours.kind != "diverging" else CHARGES
    return ScalarMappable(Normalize(low, high), LinearSegmentedColormap.from_list("ramp", stops))


def _bar(bar: Colorbar, colours: BubbleColours, style: Style) -> None:
    letters = int(72.0 * style.width / (0.6 * style.text)) if style.narrow else 200
    bar.set_label(textwrap.fill(colours.label, letters), fontsize=1.1 * style.text)
    bar.ax.tick_params(labelsize=style.text)
    for axis in (bar.ax.xaxis, bar.ax.yaxis):
        axis.get_offset_text().set_fontsize(style.small)
    bar.outline.set_linewidth(0.6)
