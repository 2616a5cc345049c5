"""Curves and histograms of foam statistics: sides, correlations, charge against curvature."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from warpedfoam.analysis import ChargeEnergies, ChargeProfile, Correlations, FoamStatistics
from warpedfoam.arrays import as_instance
from warpedfoam.io.colours import charge_rgb
from warpedfoam.plot.style import BLUE, GREEN, GREY, ORANGE, PANEL, Style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Mean areas, as shares of all, that differ by less are equal.
EQUAL = 1e-9


def plot_sides(statistics: FoamStatistics, *, width: float | None = None) -> Figure:
    """Histogram of sides with μ₂; mean sides of neighbours; mean areas: the laws of Aboav–Weaire and Lewis.

    Bars have the colours of charges 6 − n. Bubbles at walls have others, and are grey.

    Parameters
    ----------
    statistics : FoamStatistics
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column.

    Raises
    ------
    TypeError
        If ``statistics`` is not a `FoamStatistics`.
    """
    s = as_instance(statistics, "statistics", FoamStatistics)
    style = Style.of(width, 3 * PANEL)
    figure, (left, middle, right) = style.panels(3)
    rgb = charge_rgb((6 - s.sides).astype(np.float64)) / 255.0
    # colours are charges 6 − n, which bubbles at walls do not have
    walled = s.at_walls / s.n_bubbles
    edge: dict[str, Any] = {"edgecolor": "#333333", "linewidth": 0.6}
    left.bar(s.sides, s.fractions - walled, color=rgb, **edge)
    title = f"{s.n_bubbles} bubbles, μ₂ = {s.mu2:.3f}"
    if walled.any():
        left.bar(s.sides, walled, bottom=s.fractions - walled, color=GREY, **edge)
        title += f"; grey: {s.at_walls.sum()} at walls"
    style.dress(left, "sides n", "fraction of bubbles P(n)", title)
    middle.plot(s.sides, s.sides * s.neighbour_sides, "o", color=BLUE, label="measured")
    if s.aboav is not None:
        law = (s.mean_sides - s.aboav) * s.sides + s.mean_sides * s.aboav + s.mu2
        middle.plot(s.sides, law, "-", color=ORANGE, label=f"Aboav–Weaire, a = {s.aboav:.2f}")
    middle.legend(frameon=False, fontsize=style.small, handlelength=1.4)
    style.dress(middle, "sides n", "n · m(n)", "mean sides m(n) of neighbours")
    right.plot(s.sides, s.area_by_sides, "o", color=BLUE, label="measured")
    if np.ptp(s.area_by_sides) < EQUAL:
        # round-off has no slope
        right.set_ylim(0.9, 1.1)
        right.axhline(1.0, color=ORANGE, label="all areas equal")
    elif s.lewis is not None:
        law = 1.0 + s.lewis * (s.sides - s.mean_sides)
        right.plot(s.sides, law, "-", color=ORANGE, label=f"Lewis, slope {s.lewis:.3g}")
    right.legend(frameon=False, fontsize=style.small, handlelength=1.4)
    style.dress(right, "sides n", "mean area / that of all", "areas")
    right.ticklabel_format(axis="y", useOffset=False)
    if style.small_panels(3):
        middle.margins(y=0.4)  # room for the legends
        right.margins(y=0.4)
    for axes in (left, middle, right):
        axes.set_xticks(s.sides)
    return figure


def plot_correlations(found: Correlations, *, width: float | None = None) -> Figure:
    """g6, charge correlation and screening against geodesic distance in lattice spacings.

    Parameters
    ----------
    found : Correlations
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column.

    Raises
    ------
    TypeError
        If ``found`` is not a `Correlations`.
    """
    c = as_instance(found, "found", Correlations)
    style = Style.of(width, 3 * PANEL)
    figure, (left, middle, right) = style.panels(3)
    some = c.pairs > 0
    s = c.distance[some] / c.spacing
    note = "" if c.n_foams == 1 else f", {c.n_foams} foams"
    for axes, values, colour, name in (
        (left, c.g6[some], BLUE, "orientation g6(s)"),
        (middle, c.charge[some], GREEN, "charge ⟨δ δ⟩(s) / ⟨δ²⟩"),
    ):
        axes.axhline(0.0, color=GREY, linewidth=0.8)
        axes.plot(s, values, "o-", color=colour, markersize=4)
        style.dress(axes, "geodesic distance s / a", name, name.split()[0] + note)
    right.axhline(0.0, color=GREY, linewidth=0.8)
    right.plot(c.edges / c.spacing, c.screening, "o-", color=ORANGE, markersize=4)
    if c.screening_length is not None:
        at = c.screening_length / c.spacing
        right.axvline(at, color=GREY, linestyle="--", label=f"S = 1/e at {at:.2f} a")
        right.legend(frameon=False, fontsize=style.small, handlelength=1.4)
    style.dress(right, "distance s / a", "charge within s, S(s)", "screening" + note)
    return figure


def plot_charge_profile(
    profile: ChargeProfile, *, coordinate: str = "coordinate", width: float | None = None
) -> Figure:
    """Charge of bands against their curvature: by band, and one against the other.

    Points are the measured charge with its standard error; the line is (3/π)∫G dA of the band.

    Parameters
    ----------
    profile : ChargeProfile
    coordinate : str, optional
        What the bands are bands of, for the axis.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column.

    Raises
    ------
    TypeError
        If ``profile`` is not a `ChargeProfile` or ``coordinate`` not a string.
    """
    p = as_instance(profile, "profile", ChargeProfile)
    as_instance(coordinate, "coordinate", str)
    style = Style.of(width, 2 * PANEL)
    figure, (left, right) = style.panels(2)
    middles = 0.5 * (p.edges[1:] + p.edges[:-1])
    wings = 0.5 * np.diff(p.edges)
    count = len(p.charges)
    left.axhline(0.0, color=GREY, linewidth=0.8)
    left.stairs(p.region_curvature, p.edges, color=ORANGE, linewidth=1.6, label="(3/π) ∫ G dA of the band")
    left.errorbar(
        middles, p.charge, p.charge_error, wings, "o", color=BLUE, markersize=5, capsize=3, label="charge Q"
    )
    left.plot(middles, p.curvature, "x", color=GREEN, label="(3/π) ∫ G dA of its bubbles")
    left.legend(frameon=False, fontsize=style.small, handlelength=1.4)
    title = "1 foam, no error bars" if count == 1 else f"mean of {count} foams and its standard error"
    style.dress(left, coordinate, "charge in the band", title)
    low, high = float(p.region_curvature.min()), float(p.region_curvature.max())
    right.plot([low, high], [low, high], "-", color=ORANGE, label="Q = (3/π) ∫ G dA")
    right.errorbar(p.region_curvature, p.charge, p.charge_error, fmt="o", color=BLUE, markersize=5, capsize=3)
    right.legend(frameon=False, fontsize=style.small, handlelength=1.4)
    style.dress(right, "(3/π) ∫ G dA of the band", "charge Q", "charge against curvature")
    return figure


def plot_charge_energies(
    found: ChargeEnergies, *, coordinate: str = "f", width: float | None = None
) -> Figure:
    """Energy of each foam against where its charges sit, and against how many they are.

    Each panel shows the energy less the other variable's share, so that its line is the fitted slope.

    Parameters
    ----------
    found : ChargeEnergies
    coordinate : str, optional
        Name of f, for the axis.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column.

    Raises
    ------
    TypeError
        If ``found`` is not a `ChargeEnergies` or ``coordinate`` not a string.
    """
    e = as_instance(found, "found", ChargeEnergies)
    as_instance(coordinate, "coordinate", str)
    style = Style.of(width, 2 * PANEL)
    figure, panels = style.panels(2)
    mine = (
        (e.placement, e.slope, e.slope_error, f"Σ q {coordinate}"),
        (e.spread, e.spread_slope, e.spread_slope_error, "Σ |q|"),
    )
    for axes, (x, slope, error, name), (y, other, *_) in zip(panels, mine, mine[::-1], strict=True):
        rest = e.energies - other * (y - y.mean())
        axes.plot(x, rest, "o", color=BLUE, markersize=4)
        ends = np.array([x.min(), x.max()])
        axes.plot(ends, 1.0 + slope * (ends - x.mean()), "-", color=ORANGE)
        style.dress(axes, name, "energy / mean energy", f"slope {slope:.2g} ± {error:.1g}, {len(x)} foams")
    return figure
