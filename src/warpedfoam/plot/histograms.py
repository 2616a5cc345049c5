"""Histograms of bubbles, films and vertices of a foam, and of columns of an ensemble's table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.analysis import equilibrium_report
from warpedfoam.arrays import Floats, as_choice, as_integer
from warpedfoam.foam import Foam
from warpedfoam.io.colours import charge_rgb
from warpedfoam.plot.style import BLUE, ORANGE, Style
from warpedfoam.studies import Ensemble

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What a foam has histograms of: the axis, and what is counted.
QUANTITIES: Mapping[str, tuple[str, str]] = {
    "sides": ("sides n", "bubbles"),
    "charge": ("charge q", "bubbles"),
    "area": ("area of the bubble (length²)", "bubbles"),
    "volume": ("volume of the bubble (length³)", "bubbles"),
    "pressure": ("pressure (γ / length)", "bubbles"),
    "curvature": ("Gaussian curvature, mean of the bubble (1 / length²)", "bubbles"),
    "film_length": ("length of the film (length)", "films"),
    "film_area": ("area of the film (length²)", "films"),
    "angle": ("angle at vertices (degrees)", "angles"),
}
#: Most bars of a histogram whose number of bars is left open.
MOST_BARS = 60
#: Values that differ by less than this share are one value.
SAME = 1e-9
#: By less than this share: they are shown less a number.
CLOSE = 5e-3


def plot_histogram(
    source: Foam | Ensemble | ArrayLike,
    quantity: str | None = None,
    *,
    bins: int | None = None,
    where: Mapping[str, Any] | None = None,
    label: str | None = None,
    width: float | None = None,
    title: str | None = None,
) -> Figure:
    """Histogram of one quantity, with its mean and standard deviation.

    Parameters
    ----------
    source : Foam, Ensemble or array
        An ensemble's table has one value a run; an array is flattened.
    quantity : str
        Of a foam: "sides", "charge", "area", "volume", "pressure", "curvature" (of bubbles, an exterior left
        out), "film_length", "film_area", or "angle" between films at threefold vertices. Of an ensemble: the
        name of a column. Of an array there is none.
    bins : int, optional
        Number of bars, 1 … 1000; chosen from the data by default. Whole numbers have a bar each.
    where : mapping, optional
        Only runs of the ensemble in which these columns have these values, ``{"status": "converged"}``.
    label : str, optional
        Of the axis, with the unit.
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column.
    title : str, optional
        In place of mean and standard deviation.

    Returns
    -------
    matplotlib.figure.Figure
        Bars of sides and charges have the colours of the charges. Blanks (NaN) are left out, and the axis
        says how many.

    Raises
    ------
    TypeError, ValueError
        If an argument has the wrong type or value, or there is no number to show.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=40, seed=1)
    >>> figure = plot_histogram(foam, "film_length", width=86.0)
    """
    count = None if bins is None else as_integer(bins, "bins", minimum=1, maximum=1000)
    for name, text in (("label", label), ("title", title)):
        if text is not None and not isinstance(text, str):
            raise TypeError(f"{name} must be a string or None, got {type(text).__name__}")
    if where is not None and not isinstance(source, Ensemble):
        raise ValueError("where is for ensembles: it picks runs")
    values, axis, counted = _values(source, quantity, where)
    known = values[np.isfinite(values)]
    if not known.size:
        raise ValueError("source has no number to show")
    axis = axis if label is None else label
    whole = bool((known == np.round(known)).all()) and np.ptp(known) <= MOST_BARS and count is None
    shift = 0.0 if whole else _round_middle(known)
    if shift:
        known, axis = known - shift, f"{axis} − {shift:.10g}".replace("− -", "+ ")
    style = Style.of(width, 130.0)
    figure = style.figure(0.68 * style.width)
    axes = figure.add_subplot()
    if whole:
        at, heights = np.unique(known, return_counts=True)
        q = at if quantity == "charge" else 6.0 - at
        # at walls a number of sides does not tell the charge
        charged = isinstance(source, Foam) and (
            quantity == "charge" or (quantity == "sides" and not len(source.network.walls))
        )
        axes.bar(
            at, heights, 0.85, color=charge_rgb(q) / 255.0 if charged else BLUE, edgecolor="#333333", lw=0.6
        )
        axes.set_xticks(at if len(at) <= 12 else at[:: len(at) // 8])
    else:
        edges = _edges(known, count)
        axes.hist(known, edges.tolist(), color=BLUE, edgecolor="white", linewidth=0.4)
        if shift or style.narrow:
            axes.locator_params(axis="x", nbins=4 if style.narrow else 6)
    mean, deviation = float(known.mean()), float(known.std())
    # pressures have no mean but round-off
    mean = 0.0 if abs(mean) < 1e-12 * float(np.abs(known).max()) else mean
    axes.axvline(mean, color=ORANGE, linestyle="--", linewidth=1.4 * style.line)
    blank = len(values) - len(known)
    missing = f", {blank} blank" if blank else ""
    told = f"{len(known)} {counted}{missing}, mean {mean + shift:.4g}, s.d. {deviation:.3g}"
    style.dress(axes, axis, f"number of {counted}", told if title is None else title)
    return figure


def _values(source: object, quantity: str | None, where: Mapping[str, Any] | None) -> tuple[Floats, str, str]:
    """Numbers, the name of their axis, and what is counted."""
    if isinstance(source, Foam):
        if quantity is None:
            raise ValueError(f"quantity must be one of {', '.join(map(repr, QUANTITIES))} for a foam")
        name = as_choice(quantity, "quantity", tuple(QUANTITIES))
        return (_of_foam(source, name), *QUANTITIES[name])
    if isinstance(source, Ensemble):
        if not isinstance(quantity, str):
            raise TypeError(f"quantity must be the name of a column, got {type(quantity).__name__}")
        return _numbers(source.column(quantity, where), f"column {quantity!r}"), quantity, "runs"
    if quantity is not None:
        raise ValueError("quantity is for foams and ensembles: an array has none, say label instead")
    return _numbers(source, "source"), "value", "values"


def _of_foam(foam: Foam, name: str) -> Floats:
    network = foam.network
    if name == "film_length":
        return foam.film_lengths
    if name == "film_area":
        return foam.film_areas
    if name == "angle":
        angles: Floats = np.degrees(equilibrium_report(foam).vertex_angles).ravel()
        return angles
    if name == "pressure" and foam.pressures is None:
        raise ValueError("quantity='pressure' needs pressures: relax the foam first (warpedfoam.relax)")
    inside = network.bubble_euler == 1
    if foam.exterior is not None:
        inside = inside & (np.arange(network.n_bubbles) != foam.exterior)
    values: Any
    if name == "curvature":
        values = foam.bubble_curvatures / foam.bubble_areas
    else:
        values = {
            "sides": network.sides,
            "charge": network.charges,
            "area": foam.bubble_areas,
            "volume": foam.bubble_volumes,
            "pressure": foam.pressures,
        }[name]
    out: Floats = np.asarray(values, dtype=np.float64)[inside]
    return out


def _numbers(values: Any, name: str) -> Floats:
    try:
        out: Floats = np.array(values, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        raise TypeError(f"{name} must hold numbers") from None
    return out


def _round_middle(known: Floats) -> float:
    """A round number amid values that differ by little, which are shown less it; else 0."""
    spread, size = float(np.ptp(known)), float(np.abs(known).max())
    if not SAME * size < spread < CLOSE * size:
        return 0.0
    return float(np.round(np.median(known), max(-int(np.floor(np.log10(spread))) - 1, 0)))


def _edges(known: Floats, count: int | None) -> Floats:
    low, high = float(known.min()), float(known.max())
    if high - low <= SAME * max(abs(low), abs(high)):
        half = 0.5 * abs(low) or 0.5  # one value: one bar in the middle
        return np.array([low - half, low - 0.1 * half, low + 0.1 * half, low + half])
    if count is None:
        # auto can ask for very many bars where a few values lie far out
        count = min(max(len(np.histogram_bin_edges(known[:2000], "auto")) - 1, 1), MOST_BARS)
    return np.linspace(low, high, count + 1)
