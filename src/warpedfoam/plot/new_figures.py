"""Two charts that the paper lacks: second-order theory against 3D films, and a cell where G = 0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from warpedfoam import theory
from warpedfoam.arrays import Floats, as_number
from warpedfoam.plot.charted import Charted, beside, shade_of
from warpedfoam.plot.style import Style
from warpedfoam.studies.paper_films import SCALED, cylinder_films, scaled_films, torus_films

GAP, VOLUME = 0.5, 0.5
MARKERS = "osD^vP"


def figure_second_order(
    gap: float = GAP,
    volume: float = VOLUME,
    *,
    films: Mapping[str, Floats] | None = None,
    along: Mapping[str, Mapping[str, Floats]] | None = None,
    width: float | None = None,
) -> Charted:
    """Second-order theory against 3D films: along φ on the torus, and its error as curvature falls.

    Parameters
    ----------
    gap, volume : float
    films : mapping, optional
        What `warpedfoam.studies.paper_films.scaled_films` gives; computed by default (a few seconds).
    along : mapping of "free" and "ruled" to mappings, optional
        Films at this volume along the torus R = 20, r = 4, as `torus_films` gives them, six layers and one;
        computed by default.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column, whose panels
        stand one below the other.

    Returns
    -------
    Charted
        The right panel's columns: ``case``, ``scale``, ``k1``, ``k2``, ``ratio``, ``theory``, ``error``;
        and ``slope`` = log(error ratio)/log(scale ratio) from the scale before, NaN at the first.

    Raises
    ------
    TypeError, ValueError
        If a size is not a number above 0.
    ConvergenceError
        If a bubble does not come to rest.
    """
    d, v = as_number(gap, "gap", positive=True), as_number(volume, "volume", positive=True)
    table = dict(scaled_films(d, v) if films is None else films)
    degrees = np.arange(0.0, 181.0, 15.0)
    lines = along or {
        "free": torus_films(d, [v], degrees.tolist(), layers=6),
        "ruled": torus_films(d, [v], degrees.tolist(), layers=1),
    }
    style = Style.of(width, 25.4 * 11.5)
    with style.context():
        figure, (left, right) = beside(style, 4.6, 2)
        phi = np.linspace(0.0, 180.0, 181)
        k1, k2 = theory.torus_curvatures(np.radians(phi), 20.0, 4.0)
        left.axhline(1.0, color="#bbbbbb", linewidth=0.8 * style.line)
        paper = theory.fitted_ratio(1.0, v, d, k1 * k2)
        left.plot(phi, paper, "--", color="#888888", label="the paper's E₀ − E₁G")
        for place, (name, mark) in enumerate((("free", "o"), ("ruled", "s"))):
            colour = shade_of(place, 3)
            ratio = theory.second_order_ratio(v, d, k1, k2, film=name)
            left.plot(phi, ratio, color=colour, label=f"second order, {name}")
            points = lines[name]
            left.plot(
                points["phi_degrees"], points["ratio"], mark, color=colour,
                markersize=4.0 * style.line, clip_on=False,
                label="3D film" if name == "free" else "ruled film",
            )  # fmt: skip
        left.set_ylabel("E/E₀")
        left.ticklabel_format(axis="y", useOffset=False)
        left.set_xlim(0.0, 180.0)
        left.set_xticks(np.arange(0.0, 181.0, 45.0))
        left.set_xlabel("φ on the torus (degrees)")
        left.legend(frameon=False)

        table["slope"] = _slopes(table)
        names = list(SCALED)
        shown = np.unique(table["case"]).astype(int)
        for place, number in enumerate(shown):
            mine = table["case"] == number
            right.loglog(
                1.0 / table["scale"][mine],
                table["error"][mine],
                MARKERS[place % len(MARKERS)] + "-",
                color=shade_of(place, len(shown)),
                markersize=4.5 * style.line,
                linewidth=style.line,
                label=names[number],
            )
        scale = np.array([table["scale"].min(), table["scale"].max()])
        top = 2.0 * float(table["error"].max())
        for power, dash in ((3, ":"), (4, "--")):
            right.loglog(1.0 / scale, top * (scale[0] / scale) ** power, dash, color="#888888",
                         linewidth=style.line, label=f"slope {power}")  # fmt: skip
        right.set_xticks(
            (1.0 / np.unique(table["scale"])).tolist(), [f"1/{s:g}" for s in np.unique(table["scale"])]
        )
        right.minorticks_off()
        right.set_xlim(right=5.0 / float(table["scale"].min()))  # room for the legend
        right.set_xlabel("curvature, in units of the first cell's")
        right.set_ylabel("|E(3D) − E(second order)| / E₀")
        right.legend(frameon=False, loc="center right")
        return Charted(figure, table)


def _slopes(table: Mapping[str, Floats]) -> Floats:
    out = np.full(len(table["case"]), np.nan)
    same = table["case"][1:] == table["case"][:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.diff(np.log(table["error"])) / -np.diff(np.log(table["scale"]))
    out[1:][same] = slope[same]
    return out


def figure_cylinder(
    gap: float = GAP,
    volumes: Sequence[float] = (0.3, 0.5, 0.7),
    *,
    radii: Sequence[float] = (3.0, 4.0, 6.0, 9.0, 14.0, 26.0),
    films: Mapping[str, Floats] | None = None,
    around: Mapping[str, Floats] | None = None,
    width: float | None = None,
) -> Charted:
    """A cylindrical cell, G = 0: the mean curvature shifts the energy, equally everywhere, so no force acts.

    Left, the shift E/E0 − 1, times the square of the radius midway between the plates; right, the shift at
    places round and along three cylinders, with the theory's value. The paper's energy depends on G alone:
    it has no shift and leaves the question open.

    Parameters
    ----------
    gap : float
    volumes : sequence of float
        Left panel; the right one takes the middle one.
    radii : sequence of float
        Of the inner plate.
    films, around : mapping, optional
        What `warpedfoam.studies.paper_films.cylinder_films` gives for the left panel and the right one;
        computed by default (about ten seconds).
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column, whose panels
        stand one below the other.

    Returns
    -------
    Charted
        Columns ``cylinder_radius``, ``volume``, ``angle_degrees``, ``z``, ``ratio``, ``second_order``,
        ``ruled`` (theory); the left panel's rows, then the right one's.

    Raises
    ------
    TypeError, ValueError
        If a size is not a number above 0.
    ConvergenceError
        If a bubble does not come to rest.
    """
    d = as_number(gap, "gap", positive=True)
    v = [as_number(volume, "volumes", positive=True) for volume in volumes]
    r = [as_number(radius, "radii", positive=True) for radius in radii]
    middle = v[len(v) // 2]
    first = cylinder_films(d, v, r) if films is None else films
    second = cylinder_films(d, [middle], r[:3], places=7) if around is None else around
    style = Style.of(width, 25.4 * 11.5)
    with style.context():
        figure, (left, right) = beside(style, 4.6, 2)
        # times the square of the radius midway the shift is a number: theory's lines are level
        share = (first["ratio"] - 1.0) * (first["cylinder_radius"] / d + 0.5) ** 2
        left.axhline(0.0, color="#888888", linestyle="--", linewidth=style.line, label="E₀ − E₁G, G = 0")
        for k, volume in enumerate(v):
            colour, mine = shade_of(k, len(v)), first["volume"] == volume
            c = theory.second_order_coefficients(volume, d)
            level = float(c.mean + c.twist) / (4.0 * d**2)
            left.axhline(
                level,
                color=colour,
                linewidth=1.2 * style.line,
                label=f"V = {volume:g}, V* = {volume / d**3:.2g}",
            )
            left.plot(
                first["cylinder_radius"][mine] / d,
                share[mine],
                "o",
                color=colour,
                markersize=4.5 * style.line,
            )
        left.axhline(1.0 / 192.0, color="#222222", linestyle=":", label="ruled film, any V")
        left.plot([], [], "o", color="#222222", markersize=4.5 * style.line, label="3D film")
        left.set_xscale("log")
        left.xaxis.set_major_formatter("{x:g}")
        left.xaxis.set_minor_formatter("{x:g}")
        left.set_xlabel("r/d")
        left.set_ylabel("(E/E₀ − 1) (r + d/2)²/d²")
        left.set_ylim(top=0.009 if style.narrow else 0.0075)
        left.legend(frameon=False, ncols=2, loc="upper left")
        cylinders = np.unique(second["cylinder_radius"])
        right.axhline(0.0, color="#888888", linestyle="--", linewidth=style.line, label="E₀ − E₁G, G = 0")
        for place, radius in enumerate(cylinders):
            mine, colour = second["cylinder_radius"] == radius, shade_of(place, len(cylinders))
            shift = float(theory.second_order_ratio(middle, d, 1.0 / radius, 0.0)) - 1.0
            right.axhline(1e5 * shift, color=colour, linewidth=1.2 * style.line)
            right.plot(
                second["angle_degrees"][mine], 1e5 * (second["ratio"][mine] - 1.0), "o", color=colour,
                markersize=5.0 * style.line, clip_on=False, label=f"r = {radius:g}",
            )  # fmt: skip
        right.set_xlim(0.0, 360.0)
        right.set_xticks(np.arange(0.0, 361.0, 90.0))
        turn = "angle round the cylinder (degrees),{}climbing by r on the way"
        right.set_xlabel(turn.format("\n" if style.narrow else " "))
        right.set_ylabel(f"10⁵ (E/E₀ − 1), V = {middle:g}")
        right.set_ylim(top=1.35 * 1e5 * float(second["ratio"].max() - 1.0))
        right.legend(frameon=False, ncols=2)
        table = {name: np.concatenate([first[name], second[name]]) for name in
                 ("cylinder_radius", "volume", "angle_degrees", "z", "ratio")}  # fmt: skip
        bend = 1.0 / table["cylinder_radius"]
        table["second_order"] = theory.second_order_ratio(table["volume"], d, bend, 0.0)
        table["ruled"] = theory.second_order_ratio(table["volume"], d, bend, 0.0, film="ruled")
        return Charted(figure, table)
