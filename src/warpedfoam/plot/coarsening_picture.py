"""How a foam coarsens: bubbles that are left, disorder, and energy, against time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from warpedfoam.arrays import as_instance
from warpedfoam.motion import Coarsening
from warpedfoam.plot.style import BLUE, GREY, ORANGE, PANEL, Style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: μ₂ of a flat foam once it coarsens the same at all times: 1.4 in soap froths (J. Stavans and J. A. Glazier,
#: Phys. Rev. Lett. 62, 1318 (1989)).
FLAT_MU2 = 1.4


def plot_coarsening(coarsening: Coarsening, *, width: float | None = None) -> Figure:
    """Number of bubbles, variance of their sides, and energy against time.

    Dots under the number of bubbles are T1s. The dashed line is the μ₂ of flat foams that have coarsened
    for long.

    Parameters
    ----------
    coarsening : Coarsening
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column.

    Returns
    -------
    matplotlib.figure.Figure
        Not tied to pyplot: nothing to close.

    Raises
    ------
    TypeError, ValueError
        If ``coarsening`` is not a Coarsening, or made no step.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, coarsen, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), 20, seed=1)
    >>> figure = plot_coarsening(coarsen(foam, until=18), width=86.0)
    """
    one = as_instance(coarsening, "coarsening", Coarsening)
    if not one.n_steps:
        raise ValueError(f"coarsening made no step: there is nothing to draw ({one.message})")
    style = Style.of(width, 3 * PANEL)
    figure, (left, middle, right) = style.panels(3)
    line: dict[str, Any] = {"linewidth": 1.4 * style.line}
    time = one.step_times
    left.step(time, one.step_bubbles, where="post", color=BLUE, **line)
    turned = np.array([event.time for event in one.events if event.kind == "t1"])
    left.set_ylim(0.0, 1.06 * float(one.step_bubbles.max()))
    left.plot(turned, np.full(len(turned), 0.03 * one.step_bubbles.max()), ".", color=GREY, markersize=3.0)
    vanished = f"{one.n_t2} bubble{'s' if one.n_t2 != 1 else ''} vanished"
    style.dress(left, "time", "bubbles left", f"{vanished}, {one.n_t1} T1s (dots)")
    middle.step(time, one.step_mu2, where="post", color=BLUE, **line)
    middle.axhline(FLAT_MU2, color=ORANGE, linestyle="--", linewidth=style.line)
    middle.set_ylim(bottom=0.0)
    style.dress(middle, "time", "μ₂, variance of sides", f"last {one.step_mu2[-1]:.2f}; dashed: flat, late")
    right.plot(time, one.step_energies, color=BLUE, **line)
    right.set_ylim(bottom=0.0)
    style.dress(right, "time", "energy (γ × length²)", f"last {one.step_energies[-1]:.5g}")
    if not one.completed:
        figure.suptitle(one.message.partition(" (")[0], fontsize=style.small, color=ORANGE, wrap=True)
    return figure
