"""Charts of the paper with the theory's lines: curvatures, spheres, tori, the gap's perturbation.

The paper is A. Mughal, S. J. Cox and G. E. Schröder-Turk, Interface Focus 7, 20160106 (2017); its cells
have d = 0.5, V = 0.3 … 0.7, spheres r = 10 … 26, the torus R = 20, r = 4. Energies of 3D films, where a
figure takes them, come as arrays: nothing here computes a film.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam import theory
from warpedfoam.arrays import Floats, as_floats, as_number
from warpedfoam.plot.charted import Charted, beside, columns, degrees_axis, shade_of, with_inset
from warpedfoam.plot.style import LEAST, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GAP, VOLUMES, RADII = 0.5, (0.3, 0.4, 0.5, 0.6, 0.7), (10.0, 26.0)
RING, TUBE = 20.0, 4.0


def figure_curvature(
    gap: float = GAP,
    volumes: Sequence[float] = (VOLUMES[0], VOLUMES[-1]),
    *,
    major_radius: float = RING,
    minor_radius: float = TUBE,
    sphere_radii: tuple[float, float] = RADII,
    width: float | None = None,
) -> Charted:
    """G, cone angle ρ sqrt|G| and relative gap d sqrt|G| along φ on a torus (the paper's Fig. gcurvature).

    Parameters
    ----------
    gap : float
    volumes : sequence of float
        One cone angle each.
    major_radius, minor_radius : float
        The torus.
    sphere_radii : (float, float)
        Spheres whose constant values are drawn beside, dotted.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column, whose panels
        stand one below the other.

    Returns
    -------
    Charted
        Columns ``phi_degrees``, ``volume``, ``gaussian_curvature``, ``cone_angle``, ``relative_gap``.

    Raises
    ------
    TypeError, ValueError
        If a size is not a number above 0.
    """
    v = as_floats(list(volumes), "volumes", (None,))
    phi = np.linspace(0.0, 180.0, 181)
    g = theory.torus_gaussian_curvature(np.radians(phi), major_radius, minor_radius)
    angle = theory.cone_angle(v[:, None], gap, g)
    star = theory.relative_gap(gap, g)
    style = Style.of(width, 25.4 * 12.0)
    with style.context():
        tight = not style.narrow and style.width < 9.0  # three panels of less than 7 cm
        figure, (left, middle, right) = beside(style, 5.6 if tight else 3.8, 3)
        left.plot(phi, g, color="#2f5fb3", label=f"torus {major_radius:g}, {minor_radius:g}")
        left.axhline(0.0, color="#bbbbbb", linewidth=0.8 * style.line)
        left.set_ylabel("Gaussian curvature G")
        for place, (volume, line) in enumerate(zip(v, angle, strict=True)):
            middle.plot(phi, line, color=shade_of(place, len(v)), label=f"V = {volume:g}")
        middle.set_ylabel("cone angle θ = ρ √|G|")
        right.plot(phi, star, color="#2f5fb3")
        right.set_ylabel("relative gap d* = d √|G|")
        for radius, colour in zip(sphere_radii, ("#d9822b", "#c23030"), strict=True):
            k = 1.0 / as_number(radius, "sphere_radii", positive=True)
            dotted: dict[str, Any] = {"color": colour, "linestyle": ":", "linewidth": 1.4 * style.line}
            left.axhline(k**2, label=f"sphere {radius:g}", **dotted)
            volume = float(v.max() if radius == min(sphere_radii) else v.min())
            extreme = float(theory.cone_angle(volume, gap, k**2))
            middle.axhline(extreme, label=f"sphere {radius:g}, V = {volume:g}", **dotted)
            right.axhline(float(theory.relative_gap(gap, k**2)), **dotted)
        left.legend(frameon=False, handlelength=1.0 if tight else 2.0)
        ncols, room = (1, 1.75) if tight else (2, 1.35)
        fit = max(LEAST, style.small - 0.5)
        middle.legend(frameon=False, loc="upper center", ncols=ncols, columnspacing=1.0, fontsize=fit)
        for axes in (left, middle, right):
            degrees_axis(axes, short=tight)
        middle.set_ylim(0.0, room * float(angle.max()))
        right.set_ylim(bottom=0.0)
        return Charted(
            figure,
            columns(
                phi_degrees=phi, volume=v[:, None], gaussian_curvature=g, cone_angle=angle, relative_gap=star
            ),
        )


def figure_spheres(
    gap: float = GAP,
    volumes: Sequence[float] = VOLUMES,
    *,
    sphere_radii: tuple[float, float] = RADII,
    points: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    width: float | None = None,
) -> Charted:
    """E/E0 against r/d between spheres, cone and second-order theory; inset: cone angle (Fig. spheres).

    Parameters
    ----------
    gap : float
    volumes : sequence of float
    sphere_radii : (float, float)
        Least and greatest radius of the inner plate.
    points : (radii, volumes, ratios), optional
        Three (n,) arrays: 3D films to draw as dots.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column, whose panels
        stand one below the other.

    Returns
    -------
    Charted
        Columns ``sphere_radius``, ``volume``, ``cone_angle``, ``cone``, ``second_order``.

    Raises
    ------
    TypeError, ValueError
        If a size is not a number above 0, or ``points`` are not three arrays of one length.
    """
    v = as_floats(list(volumes), "volumes", (None,))
    low, high = (as_number(r, "sphere_radii", positive=True) for r in sphere_radii)
    r = np.linspace(low, high, 121)
    cone = theory.spherical_cone_ratio(v[:, None], gap, r)
    free = theory.second_order_ratio(v[:, None], gap, 1.0 / r, 1.0 / r)
    angle = theory.cone_angle(v[:, None], gap, r**-2.0)
    style = Style.of(width, 25.4 * 7.4)
    with style.context():
        figure, axes, inset, less = with_inset(style, 5.2, (0.53, 0.10, 0.44, 0.42))
        for k, volume in enumerate(v):
            colour = shade_of(k, len(v))
            axes.plot(r / gap, cone[k], "--", color=colour, linewidth=style.line)
            axes.plot(r / gap, free[k], color=colour, label=f"V = {volume:g}, V* = {volume / gap**3:.2g}")
            inset.plot(angle[k], free[k], color=colour, linewidth=style.line)
        if points is not None:
            at, size, ratio = _points(points)
            for volume in np.unique(size):
                mine = size == volume
                place = int(np.abs(v - volume).argmin())
                colour, angles = shade_of(place, len(v)), theory.cone_angle(volume, gap, at[mine] ** -2.0)
                axes.plot(at[mine] / gap, ratio[mine], "o", color=colour, markersize=4.0 * style.line)
                inset.plot(angles, ratio[mine], "o", color=colour, markersize=2.0 * style.line)
        _styles(
            axes, style, "second-order theory", "spherical cone", "3D film" if points is not None else None
        )
        axes.set_xlabel("r/d")
        axes.set_ylabel("E/E₀")
        axes.ticklabel_format(axis="y", useOffset=False)
        # room below the lines for the inset
        least = float(min(cone.min(), free.min()))
        room = 0.02 if style.narrow else 0.15
        axes.set_ylim(least - room * (1.0 - least), 1.0 + 0.02 * (1.0 - least))
        inset.set_xlabel("cone angle ρ/r", fontsize=less.text)
        inset.set_ylabel("E/E₀", fontsize=less.text)
        inset.tick_params(labelsize=less.small)
        inset.ticklabel_format(axis="y", useOffset=False)
        return Charted(
            figure,
            columns(sphere_radius=r, volume=v[:, None], cone_angle=angle, cone=cone, second_order=free),
        )


def figure_torus_energy(
    gap: float = GAP,
    volumes: Sequence[float] = VOLUMES,
    *,
    major_radius: float = RING,
    minor_radius: float = TUBE,
    points: tuple[ArrayLike, ArrayLike, ArrayLike] | None = None,
    width: float | None = None,
) -> Charted:
    """E/E0 along φ on a torus: second order, the paper's cylinder, Δ(V) of its fit (Fig. tori_vary_phi_1).

    Parameters
    ----------
    gap : float
    volumes : sequence of float
    major_radius, minor_radius : float
    points : (phi_degrees, volumes, ratios), optional
        Three (n,) arrays: 3D films to draw as dots; Δ is fitted to them too.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column, whose panels
        stand one below the other.

    Returns
    -------
    Charted
        Columns ``phi_degrees``, ``volume``, ``second_order``, ``ruled``, ``cylinder``, ``delta``; the last
        is Δ fitted to the second-order theory at each volume.

    Raises
    ------
    TypeError, ValueError
        If a size is not a number above 0, or ``points`` are not three arrays of one length.
    """
    v = as_floats(list(volumes), "volumes", (None,))
    phi = np.linspace(0.0, 180.0, 181)
    k1, k2 = theory.torus_curvatures(np.radians(phi), major_radius, minor_radius)
    free = theory.second_order_ratio(v[:, None], gap, k1, k2)
    ruled = theory.second_order_ratio(v[:, None], gap, k1, k2, film="ruled")
    cylinder = theory.fitted_ratio(1.0, v[:, None], gap, k1 * k2)
    delta = np.array([theory.fit_delta(free[k], volume, gap, k1 * k2) for k, volume in enumerate(v)])
    style = Style.of(width, 25.4 * 7.4)
    with style.context():
        figure, axes, inset, less = with_inset(style, 5.2, (0.14, 0.56, 0.36, 0.38))
        axes.axhline(1.0, color="#bbbbbb", linewidth=0.8 * style.line)
        for k, volume in enumerate(v):
            colour = shade_of(k, len(v))
            axes.plot(phi, cylinder[k], "--", color=colour, linewidth=style.line)
            axes.plot(phi, free[k], color=colour, label=f"V = {volume:g}, V* = {volume / gap**3:.2g}")
        if points is not None:
            at, size, ratio = _points(points)
            fits = []
            for volume in np.unique(size):
                mine = size == volume
                place = int(np.abs(v - volume).argmin())
                axes.plot(
                    at[mine],
                    ratio[mine],
                    "o",
                    color=shade_of(place, len(v)),
                    markersize=4.0 * style.line,
                    clip_on=False,
                )
                g = theory.torus_gaussian_curvature(np.radians(at[mine]), major_radius, minor_radius)
                fits.append(theory.fit_delta(ratio[mine], float(volume), gap, g))
            inset.plot(np.unique(size) / gap**3, fits, "o", color="#222222", markersize=3.5 * style.line)
        many = np.linspace(0.9 * v.min(), 1.1 * v.max(), 41)
        fitted = [
            theory.fit_delta(theory.second_order_ratio(volume, gap, k1, k2), float(volume), gap, k1 * k2)
            for volume in many
        ]
        inset.plot(many / gap**3, fitted, color="#222222", linewidth=1.2 * style.line)
        inset.axhline(1.0, color="#222222", linestyle="--", linewidth=0.8 * style.line)
        inset.axhline(0.75, color="#222222", linestyle=":", linewidth=0.8 * style.line)
        inset.set_xlabel("V* = V/d³", fontsize=less.text)
        inset.set_ylabel("Δ (dotted: thin gap, ¾)", fontsize=less.text)
        inset.tick_params(labelsize=less.small)
        _styles(
            axes,
            style,
            "second-order theory",
            "E₀ − E₁G",
            "3D film" if points is not None else None,
            "lower right",
        )
        degrees_axis(axes)
        axes.set_ylabel("E/E₀")
        axes.ticklabel_format(axis="y", useOffset=False)
        low, high = float(min(free.min(), cylinder.min())), float(max(free.max(), cylinder.max()))
        # the lines rise to the right: the upper left is free for the inset, the lower right for the legend
        axes.set_ylim(low - 0.05 * (high - low), high + (0.05 if style.narrow else 0.35) * (high - low))
        return Charted(
            figure,
            columns(
                phi_degrees=phi,
                volume=v[:, None],
                second_order=free,
                ruled=ruled,
                cylinder=cylinder,
                delta=delta[:, None],
            ),
        )


def figure_gap(
    gap: float = GAP,
    volumes: Sequence[float] = VOLUMES,
    *,
    major_radius: float = RING,
    minor_radius: float = TUBE,
    tilts: Sequence[float] = (0.0, 2e-4, 4e-4, 8e-4),
    width: float | None = None,
) -> Charted:
    """How little plates may miss being parallel on a torus: balance GV/3π, and energies in a gap d + ε cos φ.

    Parameters
    ----------
    gap : float
    volumes : sequence of float
        Left panel; the right one takes the middle one.
    major_radius, minor_radius : float
    tilts : sequence of float
        ε: how much wider the gap is on the outer equator, as when the tube of one plate is a little off
        centre.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column, whose panels
        stand one below the other.

    Returns
    -------
    Charted
        Columns ``phi_degrees``, ``tilt``, ``volume`` (the middle one), ``balance`` (δd that makes up for the
        curvature there), ``ratio`` = E/E0 = sqrt(1 + ε cos φ/d) − (E1/E0) G.

    Raises
    ------
    TypeError, ValueError
        If a size is not a number above 0.
    """
    v = as_floats(list(volumes), "volumes", (None,))
    eps = as_floats(list(tilts), "tilts", (None,))
    phi = np.linspace(0.0, 180.0, 181)
    g = theory.torus_gaussian_curvature(np.radians(phi), major_radius, minor_radius)
    style = Style.of(width, 25.4 * 10.5)
    with style.context():
        figure, (left, right) = beside(style, 4.2, 2)
        left.axhline(0.0, color="#bbbbbb", linewidth=0.8 * style.line)
        for k, volume in enumerate(v):
            left.plot(
                phi,
                1e4 * theory.balancing_gap_change(volume, g),
                color=shade_of(k, len(v)),
                label=f"V = {volume:g}",
            )
        left.set_ylabel("balancing δd = GV/3π  (10⁻⁴)")
        left.legend(frameon=False)
        chosen = float(v[len(v) // 2])
        energy = theory.flat_energy(chosen, gap)
        change = theory.curvature_energy_change(chosen, gap, g)
        change = change + theory.gap_energy_change(
            chosen, gap, eps[:, None] * np.cos(np.radians(phi)), exact=True
        )
        ratio = 1.0 + change / energy
        right.axhline(1.0, color="#bbbbbb", linewidth=0.8 * style.line)
        for k, tilt in enumerate(eps):
            right.plot(phi, ratio[k], color=shade_of(k, len(eps)), label=f"ε = {tilt:g}")
        right.set_ylabel(f"E/E₀ in a gap d + ε cos φ, V = {chosen:g}")
        right.ticklabel_format(axis="y", useOffset=False)
        right.legend(frameon=False)
        for axes in (left, right):
            degrees_axis(axes)
        balance = theory.balancing_gap_change(chosen, g)
        return Charted(
            figure,
            columns(
                phi_degrees=phi, tilt=eps[:, None], volume=np.array(chosen), balance=balance, ratio=ratio
            ),
        )


def _points(points: tuple[ArrayLike, ArrayLike, ArrayLike]) -> tuple[Floats, Floats, Floats]:
    if not isinstance(points, (tuple, list)) or len(points) != 3:
        raise TypeError("points must be three arrays: places, volumes and ratios E/E0")
    at = as_floats(points[0], "points[0]", (None,))
    size = as_floats(points[1], "points[1]", (len(at),))
    return at, size, as_floats(points[2], "points[2]", (len(at),))


def _styles(
    axes: Axes,
    style: Style,
    full: str,
    dashed: str,
    dots: str | None,
    place: Literal["upper left", "lower right"] = "upper left",
) -> None:
    """A legend of the lines' colours, and of their styles in black."""
    from matplotlib.lines import Line2D

    handles: list[Any] = list(axes.get_legend_handles_labels()[0])
    handles += [
        Line2D([], [], color="#222222", label=full),
        Line2D([], [], color="#222222", linestyle="--", linewidth=style.line, label=dashed),
    ]
    if dots is not None:
        handles.append(
            Line2D([], [], color="#222222", marker="o", linestyle="", markersize=4.0 * style.line, label=dots)
        )
    if style.narrow:
        # above the panel: there is no room in it
        axes.legend(
            handles=handles, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2,
            columnspacing=1.0,
        )  # fmt: skip
    else:
        axes.legend(handles=handles, frameon=False, loc=place, fontsize=max(LEAST, style.small - 1.0))
