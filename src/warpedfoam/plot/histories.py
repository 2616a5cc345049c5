"""Curves of what happened step by step: relaxations, annealing, potentials along a path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints, as_instance
from warpedfoam.plot.style import BLUE, GREEN, GREY, ORANGE, PANEL, PURPLE, Style
from warpedfoam.relax import Relaxation
from warpedfoam.studies import Annealing, GeometricPotential

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours and dashes of curves in one panel, told apart without colour too.
_CURVES = ((BLUE, "-"), (ORANGE, "--"), (GREEN, "-."), (PURPLE, ":"), (GREY, "-"))


def plot_relaxation(relaxed: Relaxation, *, width: float | None = None) -> Figure:
    """Energy, residual with volume error, and T1s against the steps of a relaxation.

    Steps of Newton's method on the KKT system are on grey ground. The energy may rise while volumes are
    being corrected.

    Parameters
    ----------
    relaxed : Relaxation
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column.

    Returns
    -------
    matplotlib.figure.Figure
        Not tied to pyplot: nothing to close.

    Raises
    ------
    TypeError, ValueError
        If ``relaxed`` is not a Relaxation, or failed before its first step.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, relax, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=40, seed=1)
    >>> figure = plot_relaxation(relax(foam), width=86.0)
    """
    one = as_instance(relaxed, "relaxed", Relaxation)
    history = one.history
    if not len(history.iteration):
        raise ValueError(f"relaxed has no history: it failed at once ({one.message})")
    style = Style.of(width, 3 * PANEL)
    figure, (left, middle, right) = style.panels(3)
    step = history.iteration
    for axes in (left, middle, right):
        _ground(axes, step, history.exact)
    marker: dict[str, Any] = {"marker": ".", "markersize": 5.0 * style.line, "linewidth": 1.4 * style.line}
    left.plot(step, history.energy, color=BLUE, **marker)
    style.dress(left, "step", "energy (γ × length²)", f"last energy {history.energy[-1]:.6g}")
    for values, name, (colour, dash) in (
        (history.residual, "residual (γ × gap)", _CURVES[0]),
        (history.volume_error, "volume error (relative)", _CURVES[1]),
    ):
        shown = np.where((values > 0.0) & np.isfinite(values), values, np.nan)
        middle.plot(step, shown, dash, color=colour, label=name, **marker)
    middle.set_yscale("log")
    middle.legend(frameon=False, fontsize=style.small, handlelength=1.4)
    state = "converged" if one.converged else "NOT CONVERGED"
    style.dress(middle, "step", "largest error", f"{state} in {one.iterations} steps")
    right.step(step, history.n_t1, where="post", color=BLUE, linewidth=1.4 * style.line)
    style.dress(right, "step", "T1s so far", f"{one.n_t1} T1s")
    for axes in (left, middle, right):
        _whole_numbers(axes.xaxis)
    _whole_numbers(right.yaxis)
    right.set_ylim(-0.05 * max(one.n_t1, 1), 1.05 * max(one.n_t1, 1))
    return figure


def plot_annealing(annealing: Annealing, *, width: float | None = None) -> Figure:
    """Energies and temperature against the steps of an annealing.

    Proposals that were taken are dots, those left are crosses, those that failed are not shown.

    Parameters
    ----------
    annealing : Annealing
    width : float, optional
        As for `plot_relaxation`.

    Raises
    ------
    TypeError, ValueError
        If ``annealing`` is not an Annealing, or made no step.
    """
    one = as_instance(annealing, "annealing", Annealing)
    history = one.history
    count = len(history.best)
    if not count:
        raise ValueError("annealing made no steps: there is nothing to draw")
    style = Style.of(width, 2 * PANEL)
    figure, (left, right) = style.panels(2)
    step = np.arange(1, count + 1)
    start = one.start_energy
    left.axhline(1.0, color=GREY, linewidth=0.8)
    for mask, mark, colour, name in (
        (history.accepted, "o", BLUE, "taken"),
        (~history.accepted & np.isfinite(history.proposed), "x", GREY, "left"),
    ):
        left.plot(
            step[mask],
            history.proposed[mask] / start,
            mark,
            color=colour,
            markersize=3.5 * style.line,
            label=name,
        )
    left.plot(step, history.energy / start, "-", color=BLUE, linewidth=1.2 * style.line, label="present")
    left.plot(step, history.best / start, "--", color=ORANGE, linewidth=1.6 * style.line, label="best")
    left.legend(frameon=False, fontsize=style.small)
    style.dress(left, "step", "energy / energy at the start", f"best {history.best[-1] / start:.6f}")
    hot = history.temperature > 0.0
    right.plot(step, np.where(hot, history.temperature, np.nan), color=ORANGE, linewidth=1.4 * style.line)
    if hot.any():
        right.set_yscale("log")
    style.dress(right, "step", "temperature (γ d ℓ)", f"{one.n_accepted} of {count} steps taken")
    for axes in (left, right):
        _whole_numbers(axes.xaxis)
    return figure


def plot_potential_path(
    potentials: GeometricPotential | Sequence[GeometricPotential], *, width: float | None = None
) -> Figure:
    """Energy of one bubble along a path, and the force that pulls it along; several methods in one figure.

    Parameters
    ----------
    potentials : GeometricPotential, or sequence of them
        Computed along a path (``path=``), such as one for each method.
    width : float, optional
        As for `plot_relaxation`.

    Returns
    -------
    matplotlib.figure.Figure
        Left E/E0, right −dE/ds over the path's length s; gaps where no bubble came to rest.

    Raises
    ------
    TypeError, ValueError
        If one is no GeometricPotential or not along a path, or there is none, or more than five.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Torus, geometric_potential
    >>> torus = Torus(20.0, 4.0)
    >>> path = torus.points(np.linspace(0.0, np.pi, 21), np.zeros(21))
    >>> found = geometric_potential(HeleShawCell(torus, gap=0.5), 0.5, path=path, method="theory")
    >>> figure = plot_potential_path(found)
    """
    if isinstance(potentials, Sequence):
        many = [as_instance(one, "potentials", GeometricPotential) for one in potentials]
    else:
        many = [as_instance(potentials, "potentials", GeometricPotential)]
    if not 1 <= len(many) <= len(_CURVES):
        raise ValueError(f"potentials must be 1 to {len(_CURVES)} of them, got {len(many)}")
    style = Style.of(width, 2 * PANEL)
    figure, (left, right) = style.panels(2)
    right.axhline(0.0, color=GREY, linewidth=0.8)
    for one, (colour, dash) in zip(many, _CURVES, strict=False):
        if one.lengths is None:
            raise ValueError("potentials must be along a path: geometric_potential(..., path=points)")
        s = one.lengths
        look: dict[str, Any] = {
            "color": colour,
            "linestyle": dash,
            "linewidth": 1.5 * style.line,
            "label": one.method,
        }
        left.plot(s, one.ratios, **look)
        right.plot(s, _along(one, s), **look)
    style.dress(left, "distance along the path s (length)", "E / E0", "energy")
    style.dress(right, "distance along the path s (length)", "−dE/ds (γ × length)", "force along the path")
    # E/E0 differs from 1 far behind the point: the ticks say it, not an offset in the corner
    left.ticklabel_format(axis="y", useOffset=False)
    if len(many) > 1:
        left.legend(frameon=False, fontsize=style.small)
    return figure


def _along(one: GeometricPotential, s: Floats) -> Floats:
    """Force along the path, (n,)."""
    tangent = np.gradient(one.points, s, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    out: Floats = (one.forces * tangent).sum(axis=1)
    return out


def _ground(axes: Axes, step: Ints, exact: Bools) -> None:
    """Grey where steps are Newton's."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], exact, [False]]).astype(np.int8)))
    for first, after in edges.reshape(-1, 2).tolist():
        axes.axvspan(step[first] - 0.5, step[after - 1] + 0.5, color="#eeeeee", linewidth=0.0, zorder=0.0)


def _whole_numbers(axis: Any) -> None:
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(integer=True, nbins=6))
