"""Maps on the surface: defects by charge with their clusters outlined, and bond orientation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warpedfoam.analysis import BondOrder, DefectReport, bond_order, defects
from warpedfoam.arrays import Bools, Floats, Ints, as_instance, frozen
from warpedfoam.foam import Foam
from warpedfoam.io.colours import OUTSIDE_COLOUR, BubbleColours, as_rgb, bubble_colours, ramp_rgb
from warpedfoam.plot.foam_picture import painted_foam
from warpedfoam.plot.legends import counted_sides, explain, put_legend
from warpedfoam.plot.painting import Strokes
from warpedfoam.plot.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Outlines of clusters by kind, told apart by colour-blind readers; single charges need none.
OUTLINES = {
    "dislocation": "#e69f00",
    "scar": "#000000",
    "pleat": "#009e73",
    "vacancy": "#cc79a7",
    "interstitial": "#56b4e9",
    "neutral": "#f0e442",
    "aggregate": "#7a5195",
    "network": "#6d6d6d",
    "rim": "#8c6d31",
}
_WIDE = 3.0
_STAR = "#101014"
#: Letters of an entry in the legend of clusters.
_ENTRY = 16


def plot_defects(
    foam: Foam,
    report: DefectReport | None = None,
    *,
    view: tuple[float, float] | None = None,
    size: tuple[float, float] = (10.0, 6.4),
    width: float | None = None,
    title: str | None = None,
) -> Figure:
    """Draw the foam coloured by charge, its clusters outlined by kind, and Burgers vectors as arrows.

    Parameters
    ----------
    foam : Foam
    report : DefectReport, optional
        Of this foam; found anew by default.
    view, size, width, title
        As for `plot_foam`.

    Returns
    -------
    matplotlib.figure.Figure
        Arrows start at the cluster and are as long as the Burgers vector.

    Raises
    ------
    TypeError, ValueError
        As `plot_foam`; a report of another foam.
    """
    as_instance(foam, "foam", Foam)
    found = defects(foam) if report is None else as_instance(report, "report", DefectReport)
    if found.network is not foam.network:
        raise ValueError("report is of another foam; leave it out, or make it with defects(foam)")
    colours = bubble_colours(foam, "charge")
    if title is None:
        title = (
            f"{_held(foam)} bubbles, {len(found.disclinations.charge)} of them charged; "
            f"total charge {found.total_charge}"
        )
    painted = painted_foam(
        foam,
        colours,
        view=view,
        size=size,
        width=width,
        title=title,
        strokes=outlines(foam, found),
        legends=2,
    )
    counted_sides(painted.host(0), foam, colours, painted.style, "outside right upper")
    kinds_legend(painted.host(1), found, painted.style)
    painted.settle()
    return painted.figure


def plot_order(
    foam: Foam,
    order: BondOrder | None = None,
    *,
    view: tuple[float, float] | None = None,
    size: tuple[float, float] = (9.0, 6.2),
    width: float | None = None,
    title: str | None = None,
) -> Figure:
    """Draw the foam coloured by |ψ6|, with a star of three lines along the six directions to neighbours.

    Stars show orientation without a global frame, which a curved surface does not have. Their size
    goes with |ψ6|.

    Parameters
    ----------
    foam : Foam
    order : BondOrder, optional
        Of this foam; computed by default.
    view, size, width, title
        As for `plot_foam`.

    Raises
    ------
    TypeError, ValueError
        As `plot_foam`; an order of another number of bubbles.
    """
    as_instance(foam, "foam", Foam)
    found = bond_order(foam) if order is None else as_instance(order, "order", BondOrder)
    if len(found.psi6) != foam.n_bubbles:
        raise ValueError(f"order is of {len(found.psi6)} bubbles, the foam has {foam.n_bubbles}")
    values = found.magnitude
    inside = foam.network.bubble_euler == 1
    if foam.exterior is not None:
        inside[foam.exterior] = False
    rgb = ramp_rgb(values, (0.0, 1.0))
    rgb[~inside] = as_rgb(OUTSIDE_COLOUR)
    colours = BubbleColours(
        "order",
        "hexatic order |ψ6|",
        frozen(values),
        frozen(rgb),
        (0.0, 1.0),
        inside,
    )
    if title is None:
        mean = found.mean_magnitude if inside.all() else float(values[inside].mean())
        title = f"{_held(foam)} bubbles, mean |ψ6| {mean:.3f}"
    painted = painted_foam(
        foam,
        colours,
        view=view,
        size=size,
        width=width,
        title=title,
        strokes=_stars(foam, found, inside),
        legends=1,
    )
    explain(painted.host(0), painted.axes, foam, colours, painted.style)
    painted.settle()
    return painted.figure


def _held(foam: Foam) -> int:
    """Number of bubbles, an exterior not counted."""
    return foam.n_bubbles - (foam.exterior is not None)


def outlines(foam: Foam, found: DefectReport) -> Strokes:
    """Outlines of clusters in the colours of their kinds, and Burgers vectors as arrows."""
    network, clusters = foam.network, found.clusters
    colour = (
        np.array([as_rgb(OUTLINES.get(kind, "#000000")) for kind in clusters.kind]).reshape(-1, 3) / 255.0
    )
    drawn = np.append(np.isin(clusters.kind, list(OUTLINES)), False)
    # clusters never touch: at most one of the two bubbles of a rim is in one
    near = found.cluster_of[network.bubble]
    halves = np.flatnonzero((near != near.reshape(-1, 2)[:, ::-1].ravel()) & drawn[near])
    owner = near[halves]
    rows = np.flatnonzero(clusters.burgers_squared > 0)
    arrows, arrow_row = _arrows(foam, clusters.position[rows], clusters.burgers[rows] * found.spacing)
    # the arrow's bubble only tells how far to lift it: any of its cluster
    first = np.full(len(clusters.size), -1)
    rank = found.cluster_of[found.disclinations.bubble]
    first[rank[::-1]] = found.disclinations.bubble[::-1]
    return Strokes(
        halves=halves,
        film_rgb=colour[owner],
        film_widths=np.full(len(halves), _WIDE),
        marks=arrows,
        mark_bubble=first[rows[arrow_row]],
        mark_rgb=np.tile(as_rgb(_STAR) / 255.0, (len(arrows), 1)),
        mark_widths=np.full(len(arrows), 2.0),
    )


def _arrows(foam: Foam, start: Floats, vector: Floats) -> tuple[Floats, Ints]:
    """Segments (3 k, 2, 3) of arrows from ``start`` (k, 3), and the arrow of each."""
    count = len(start)
    if not count:
        return np.zeros((0, 2, 3)), np.zeros(0, dtype=np.int64)
    surface = foam.cell.surface
    tip = surface.project(start + vector)
    side = 0.3 * np.cross(surface.normals(start), vector)
    barbs = [surface.project(start + 0.65 * vector + turn * side) for turn in (1.0, -1.0)]
    pairs = [np.stack([start, tip], axis=1), *(np.stack([tip, barb], axis=1) for barb in barbs)]
    return np.concatenate(pairs), np.tile(np.arange(count), 3)


def _stars(foam: Foam, found: BondOrder, inside: Bools) -> Strokes:
    bubbles = np.flatnonzero(inside)
    first = found.directions[bubbles]
    second = np.cross(found.normals[bubbles], first)
    centre = foam.bubble_centres[bubbles]
    reach = (0.32 * np.sqrt(foam.bubble_areas[bubbles]) * found.magnitude[bubbles])[:, None]
    ends = []
    for angle in (0.0, np.pi / 3.0, 2.0 * np.pi / 3.0):
        arm = reach * (np.cos(angle) * first + np.sin(angle) * second)
        ends.append(np.stack([centre - arm, centre + arm], axis=1))
    none = np.zeros(0, dtype=np.int64)
    count = 3 * len(bubbles)
    return Strokes(
        halves=none,
        film_rgb=np.zeros((0, 3)),
        film_widths=np.zeros(0),
        marks=np.concatenate(ends),
        mark_bubble=np.tile(bubbles, 3),
        mark_rgb=np.tile(as_rgb(_STAR) / 255.0, (count, 1)),
        mark_widths=np.full(count, 0.9),
    )


def kinds_legend(host: Figure | Axes, found: DefectReport, style: Style) -> None:
    """One entry per kind of cluster that occurs."""
    from matplotlib.lines import Line2D

    handles = []
    for name, count in found.kinds.items():
        if count and name in OUTLINES:
            line = _WIDE * style.line
            handles.append(Line2D([], [], color=OUTLINES[name], linewidth=line, label=f"{name}:  {count}"))
        elif count:
            handles.append(Line2D([], [], linestyle="none", label=f"{name} (no outline):  {count}"))
    if handles:
        put_legend(host, handles, "clusters", style, "outside right lower", _ENTRY)
