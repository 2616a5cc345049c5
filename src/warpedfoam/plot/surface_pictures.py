"""Pictures of bare surfaces: coloured by Gaussian curvature, with geodesic circles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from warpedfoam import theory
from warpedfoam.arrays import Floats, as_floats, as_number
from warpedfoam.plot.charted import Charted, beside, columns, shade_of
from warpedfoam.plot.projection import View, back_to_front, facing, shades
from warpedfoam.plot.style import Style
from warpedfoam.studies import GeodesicCircle, geodesic_circle
from warpedfoam.surfaces import Surface, Torus

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

#: Nodes of the meshes that are painted.
NODES = 20_000
#: Blue below 0, red above, pale at 0.
SIGNED = ("#163f80", "#2f78bd", "#7db9e2", "#ececea", "#ee8a5f", "#cc3d28", "#8c1322")


def figure_surface(
    surface: Surface | None = None, *, view: tuple[float, float] = (38.0, -60.0), width: float | None = None
) -> Charted:
    """A surface coloured by G, red where positive, blue where negative (the paper's Fig. torus_geometry).

    Parameters
    ----------
    surface : Surface, optional
        The paper's torus, R = 20 and r = 4, by default.
    view : (float, float)
        Elevation above the xy plane and azimuth from the x axis, in degrees.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column, whose panels
        stand one below the other.

    Returns
    -------
    Charted
        Columns ``x``, ``y``, ``z``, ``gaussian_curvature`` at the nodes of the mesh that is painted.

    Raises
    ------
    TypeError
        If ``surface`` is not a surface.
    """
    chosen = _surface(surface)
    style = Style.of(width, 25.4 * 7.6)
    with style.context():
        figure, (axes,) = beside(style, 4.8, 1)
        nodes, g, bar = _paint(axes, chosen, View.from_angles(*view), [], style)
        _bar(figure, axes, bar, style)
        return Charted(figure, columns(x=nodes[:, 0], y=nodes[:, 1], z=nodes[:, 2], gaussian_curvature=g))


def figure_circles(
    radius: float = 3.0,
    phi_degrees: Sequence[float] = (0.0, 90.0, 180.0),
    *,
    major_radius: float = 20.0,
    minor_radius: float = 4.0,
    view: tuple[float, float] = (38.0, -60.0),
    width: float | None = None,
) -> Charted:
    """Geodesic circles of one radius on a torus, and what curvature makes of their perimeters (Fig. circles).

    The chart shows C/2πρ − 1 from traced geodesics (dots), with two terms of the series (dashed) and with
    three, ΔG among them (full).

    Parameters
    ----------
    radius : float
        ρ of the circles in the picture; the chart goes up to it.
    phi_degrees : sequence of float
        Tube angles of the centres.
    major_radius, minor_radius : float
    view : (float, float)
        As for `figure_surface`.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column, whose panels
        stand one below the other.

    Returns
    -------
    Charted
        Columns ``phi_degrees``, ``radius``, ``perimeter``, ``area``, ``gaussian_curvature``, ``laplacian``,
        ``two_terms``, ``three_terms``.

    Raises
    ------
    TypeError, ValueError
        If a size is not a number in range, or circles of that radius cross themselves.
    """
    rho = as_number(radius, "radius", positive=True)
    angles = as_floats(list(phi_degrees), "phi_degrees", (None,))
    torus = Torus(major_radius, minor_radius)
    # where each is seen best: outer ones in front, inner ones across the hole, the rest at the side
    cos = np.cos(np.radians(angles))
    turn = np.radians(view[1]) + np.select([cos < -0.3, cos < 0.3], [np.pi, 0.5 * np.pi], 0.0)
    centres = torus.points(np.radians(angles), turn)
    radii = rho * np.linspace(0.1, 1.0, 10)
    style = Style.of(width, 25.4 * 11.5)
    with style.context():
        figure, (left, right) = beside(style, 4.6, 2, (1.25, 1.0))
        circles: list[tuple[GeodesicCircle, tuple[float, float, float]]] = []
        rows: list[Floats] = []
        for k, (phi, centre) in enumerate(zip(angles, centres, strict=True)):
            colour = shade_of(k, len(angles))
            found = [geodesic_circle(torus, centre, float(r), n_directions=128) for r in radii]
            circles.append((found[-1], colour))
            g, bend = (
                found[-1].gaussian_curvature,
                torus_laplacian(np.radians(phi), major_radius, minor_radius),
            )
            two = theory.perimeter_series(radii, g, terms=2)
            three = theory.perimeter_series(radii, g, bend)
            c = np.array([circle.perimeter for circle in found])
            flat = 2.0 * np.pi * radii
            right.plot(
                radii, c / flat - 1.0, "o", color=colour, markersize=4.0 * style.line, label=f"φ = {phi:g}°"
            )
            right.plot(radii, two / flat - 1.0, "--", color=colour, linewidth=style.line)
            right.plot(radii, three / flat - 1.0, color=colour, linewidth=1.2 * style.line)
            area = np.array([circle.area for circle in found])
            rows.append(np.stack(np.broadcast_arrays(phi, radii, c, area, g, bend, two, three)))
        _, _, bar = _paint(left, torus, View.from_angles(*view), circles, style)
        _bar(figure, left, bar, style)
        right.axhline(0.0, color="#bbbbbb", linewidth=0.8 * style.line)
        right.set_xlabel("geodesic radius ρ")
        right.set_ylabel("C/2πρ − 1")
        right.plot([], [], "--", color="#222222", linewidth=style.line, label="series to ρ³")
        right.plot([], [], color="#222222", linewidth=1.2 * style.line, label="series to ρ⁵")
        right.legend(frameon=False)
        names = (
            "phi_degrees", "radius", "perimeter", "area", "gaussian_curvature", "laplacian",
            "two_terms", "three_terms",
        )  # fmt: skip
        return Charted(figure, dict(zip(names, np.concatenate(rows, axis=1), strict=True)))


def torus_laplacian(phi: float, major_radius: float, minor_radius: float) -> float:
    """ΔG = (w G')'/(r² w) with w = R + r cos φ, G' = −R sin φ/(r w²): −R (w cos φ + r sin²φ)/(r³ w³)."""
    w = major_radius + minor_radius * np.cos(phi)
    over = w * np.cos(phi) + minor_radius * np.sin(phi) ** 2
    return float(-major_radius * over / (minor_radius**3 * w**3))


def _bar(figure: Figure, axes: Axes, scale: ScalarMappable, style: Style) -> None:
    """A colour bar beside the surface, or below it on a narrow figure."""
    if style.narrow:
        bar = figure.colorbar(scale, ax=axes, location="bottom", shrink=0.75, pad=0.03, aspect=30)
    else:
        bar = figure.colorbar(scale, ax=axes, shrink=0.75, pad=0.02)
    bar.set_label("Gaussian curvature G")


def _surface(surface: Surface | None) -> Surface:
    if surface is None:
        return Torus(20.0, 4.0)
    if isinstance(surface, type) or not isinstance(surface, Surface):
        raise TypeError(f"surface must be a surface such as Torus(20.0, 4.0), got {type(surface).__name__}")
    return surface


def _paint(
    axes: Axes,
    surface: Surface,
    view: View,
    circles: list[tuple[GeodesicCircle, tuple[float, float, float]]],
    style: Style,
) -> tuple[Floats, Floats, ScalarMappable]:
    """Triangles and pieces of circles from back to front; nodes, their G, and the colours' scale."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm

    mesh = surface.triangulate(NODES)
    g = surface.gaussian_curvature(mesh.nodes)
    most = max(float(np.abs(g).max()), 1e-300)
    scale = TwoSlopeNorm(0.0, min(float(g.min()), -1e-3 * most), max(float(g.max()), 1e-3 * most))
    bar = ScalarMappable(scale, LinearSegmentedColormap.from_list("signed", SIGNED))
    corners = view.project(mesh.corners)
    seen = facing(corners) > 0.0
    lit = shades(view.project(surface.normals(mesh.corners[seen].mean(axis=1))))
    fill = bar.to_rgba(g[mesh.triangles[seen]].mean(axis=1))[:, :3] * lit[:, None]
    paths, faces, widths = [corners[seen][:, :, :2]], [fill], [np.full(int(seen.sum()), 0.4)]
    depth = [corners[seen][:, :, 2].mean(axis=1)]
    lift = 2.0 * mesh.mean_edge
    for circle, colour in circles:
        ring = circle.points
        ends = view.project(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))
        towards = view.project(surface.normals(ring))[:, 2] > 0.0
        piece = ends[towards][:, [0, 1, 0]]
        # a white rim keeps dark lines apart from dark ground
        for ink, width, share in (((1.0, 1.0, 1.0), 4.5, 1.0), (colour, 2.2, 2.0)):
            paths.append(piece[:, :, :2])
            faces.append(np.tile(ink, (len(piece), 1)))
            widths.append(np.full(len(piece), width * style.line))
            depth.append(piece[:, :, 2].mean(axis=1) + share * lift)
    order = back_to_front(np.concatenate(depth))
    colours = np.concatenate(faces)[order]
    axes.add_collection(
        PolyCollection(
            list(np.concatenate(paths)[order]),
            facecolors=colours,
            edgecolors=colours,
            linewidths=np.concatenate(widths)[order],
            capstyle="round",
            joinstyle="round",
            rasterized=True,
        ),
        autolim=False,
    )
    flat = corners[:, :, :2].reshape(-1, 2)
    margin = 0.02 * float(np.ptp(flat, axis=0).max())
    axes.set_xlim(flat[:, 0].min() - margin, flat[:, 0].max() + margin)
    axes.set_ylim(flat[:, 1].min() - margin, flat[:, 1].max() + margin)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return mesh.nodes, g, bar
