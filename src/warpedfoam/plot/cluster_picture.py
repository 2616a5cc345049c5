"""Curves of a cluster's energy against its place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warpedfoam.arrays import as_instance
from warpedfoam.plot.style import BLUE, GREY, ORANGE, PANEL, Style
from warpedfoam.studies import ClusterPotential
from warpedfoam.surfaces import Torus

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_cluster_potential(potential: ClusterPotential, *, width: float | None = None) -> Figure:
    """E − min E and the force, against the angle round the tube of a torus or against G elsewhere.

    On a torus the force is that along growing φ; elsewhere its size, since points need not lie on a line.

    Parameters
    ----------
    potential : ClusterPotential
    width : float, optional
        Width in millimetres at which the figure is to be printed, 40 … 1000: 86 for one column.

    Raises
    ------
    TypeError
        If ``potential`` is not a `ClusterPotential`.
    """
    one = as_instance(potential, "potential", ClusterPotential)
    surface = one.foams[0].cell.surface
    style = Style.of(width, 2 * PANEL)
    figure, (left, right) = style.panels(2)
    line = isinstance(surface, Torus)
    if isinstance(surface, Torus):
        x = np.degrees(surface.angles(one.points)[0])
        x = np.where(x < -1e-9, x + 360.0, x)
        force = np.einsum("nx,nx->n", one.forces, surface.vertex_frames(one.points)[:, 0])
        name, what = "tube angle φ in degrees, 0 outside", "force along φ (γ × length)"
    else:
        x = surface.gaussian_curvature(one.points)
        force = np.linalg.norm(one.forces, axis=1)
        name, what = "Gaussian curvature G", "size of the force (γ × length)"
    order = np.argsort(x, kind="stable")
    marks = "o-" if line else "o"
    left.plot(x[order], (one.energies - one.energies.min())[order], marks, color=BLUE)
    right.plot(x[order], force[order], marks, color=ORANGE)
    n = one.pressures.shape[1] - 1
    style.dress(left, name, "E − min E (γ × length²)", f"{n} bubble{'s' if n > 1 else ''}")
    style.dress(right, name, what, "force −∇E")
    for axes in (left, right):
        if line:
            axes.set_xticks(np.arange(45.0 * np.floor(x.min() / 45.0), x.max() + 44.9, 45.0))
        axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=0)
    return figure
