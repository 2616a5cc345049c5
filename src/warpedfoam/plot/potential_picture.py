"""Pictures of a geometric potential on its surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warpedfoam.arrays import Floats, as_instance, as_number
from warpedfoam.io.colours import RAMP
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.plot.projection import View, back_to_front, facing, shades
from warpedfoam.plot.style import Style
from warpedfoam.studies import GeometricPotential

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Nodes of the pale surface under points that do not cover it, and its grey.
BACKDROP, PALE = 3000, 0.88
#: Halvings of the edges of coarse triangulations, until there are so many triangles.
FINE = 6000


def plot_potential(
    potential: GeometricPotential,
    *,
    view: tuple[float, float] = (35.0, -60.0),
    size: tuple[float, float] = (8.0, 5.6),
    width: float | None = None,
    title: str | None = None,
) -> Figure:
    """Draw E/E0 as colours on the surface; points or a path as coloured dots on a pale surface.

    Parameters
    ----------
    potential : GeometricPotential
    view : (float, float), optional
        Elevation and azimuth in degrees.
    size : (float, float), optional
        Width and height in inches.
    width : float, optional
        Instead, the width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column.
    title : str, optional

    Returns
    -------
    matplotlib.figure.Figure
        Not tied to pyplot: nothing to close.

    Raises
    ------
    TypeError
        If ``potential`` is not a GeometricPotential.
    ValueError
        If no energy in it is a number.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    one = as_instance(potential, "potential", GeometricPotential)
    values = one.ratios
    known = np.isfinite(values)
    if not known.any():
        raise ValueError("potential has no energy to draw: no bubble came to rest")
    angles = [as_number(v, "view") for v in view]
    low, high = float(values[known].min()), float(values[known].max())
    if not high - low > 1e-12:
        low, high = low - 0.5e-6, high + 0.5e-6
    ramp, norm = LinearSegmentedColormap.from_list("ramp", RAMP), Normalize(low, high)

    wide, tall = (as_number(number, "size", positive=True) for number in size)
    style = Style.of(25.4 * wide if width is None else width)
    figure = style.figure(style.width * tall / wide)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.set_axis_off()
    eyes = View.from_angles(angles[0], angles[1])
    covers = one.triangles is not None
    if one.triangles is not None:
        corners, level = _refined(_whole(one, one.points[one.triangles]), values[one.triangles])
        corners = one.cell.surface.project(corners.reshape(-1, 3)).reshape(-1, 3, 3)
        shown = np.asarray(ramp(norm(level.mean(axis=1))))[:, :3]
        shown[~np.isfinite(level).all(axis=1)] = 0.5
    else:
        mesh = one.cell.surface.triangulate(BACKDROP)
        corners = _whole(one, mesh.nodes[mesh.triangles])
        shown = np.full((len(corners), 3), PALE)
    _paint(axes, one, corners, shown, eyes)
    if not covers:
        seen = eyes.project(one.cell.surface.normals(one.points))[:, 2] > 0.0
        x, y, _ = eyes.project(one.points).T
        if one.lengths is not None:
            axes.plot(np.where(seen, x, np.nan), np.where(seen, y, np.nan), color="0.3", lw=0.8, zorder=2)
        axes.scatter(
            x[seen], y[seen], c=values[seen], cmap=ramp, norm=norm, s=26, edgecolors="0.2", lw=0.4, zorder=3
        )
    bar = figure.colorbar(ScalarMappable(norm, ramp), ax=axes, shrink=0.75, pad=0.02)
    bar.ax.tick_params(labelsize=style.small)
    # differences of E/E0 lie far behind the point: the ticks carry them, not an offset over the bar
    bar.set_ticks(np.linspace(low, high, 5).tolist())
    digits = int(np.clip(np.ceil(-np.log10(high - low)) + 3, 2, 13))
    bar.set_ticklabels([f"{v:.{digits}f}" for v in np.linspace(low, high, 5)])
    bar.set_label("E / E0", fontsize=style.text)
    heading = f"V = {one.volume:g}, d = {one.cell.mean_gap:g}, {one.method}"
    axes.set_title(heading if title is None else title, fontsize=style.title)
    return figure


def _whole(one: GeometricPotential, corners: Floats) -> Floats:
    """Triangles (k, 3, 3) with their corners together, also those over the edge of a unit that repeats."""
    first = corners[:, :1]
    out: Floats = first + nearest_image(corners - first, one.cell.surface.period)
    return out


def _refined(corners: Floats, level: Floats) -> tuple[Floats, Floats]:
    """Triangles (k, 3, 3) and their values (k, 3), quartered until there are many."""
    while len(corners) < FINE:
        middle, between = (
            0.5 * (corners + np.roll(corners, -1, axis=1)),
            0.5 * (level + np.roll(level, -1, axis=1)),
        )
        pick = [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)]
        all_corners = np.concatenate([corners, middle], axis=1)
        all_level = np.concatenate([level, between], axis=1)
        corners = np.concatenate([all_corners[:, list(p)] for p in pick])
        level = np.concatenate([all_level[:, list(p)] for p in pick])
    return corners, level


def _paint(axes: Axes, one: GeometricPotential, corners: Floats, colours: Floats, eyes: View) -> None:
    """Triangles that face the viewer, farthest first."""
    from matplotlib.collections import PolyCollection

    surface = one.cell.surface
    seen_at = eyes.project(corners)
    normals = eyes.project(surface.normals(corners.mean(axis=1)))
    front = facing(seen_at) > 0.0
    if surface.period is not None:
        front[:] = True
        normals = np.where(normals[:, 2:] < 0.0, -normals, normals)
    seen_at, normals, colours = seen_at[front], normals[front], colours[front]
    order = back_to_front(seen_at[:, :, 2].mean(axis=1))
    fill = (colours * shades(normals)[:, None])[order]
    axes.add_collection(
        PolyCollection(list(seen_at[order, :, :2]), facecolors=fill, edgecolors=fill, linewidths=0.4)
    )
    axes.autoscale_view()
