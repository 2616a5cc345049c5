"""Pictures; matplotlib is imported when the first one is drawn."""

from warpedfoam.plot.charted import Charted
from warpedfoam.plot.foam_picture import plot_foam, save_picture
from warpedfoam.plot.paper_figures import figure_curvature, figure_gap, figure_spheres, figure_torus_energy
from warpedfoam.plot.potential_picture import plot_potential
from warpedfoam.plot.surface_pictures import figure_circles, figure_surface

__all__ = [
    "Charted",
    "figure_circles",
    "figure_curvature",
    "figure_gap",
    "figure_spheres",
    "figure_surface",
    "figure_torus_energy",
    "plot_foam",
    "plot_potential",
    "save_picture",
]
