"""Pictures; matplotlib is imported when the first one is drawn."""

from warpedfoam.plot.charted import Charted
from warpedfoam.plot.cluster_picture import plot_cluster_potential
from warpedfoam.plot.coarsening_picture import plot_coarsening
from warpedfoam.plot.curves import plot_charge_energies, plot_charge_profile, plot_correlations, plot_sides
from warpedfoam.plot.defect_picture import plot_defects, plot_order
from warpedfoam.plot.drift_picture import animate, plot_drift
from warpedfoam.plot.foam_3d import plot_foam_3d
from warpedfoam.plot.foam_picture import plot_foam, save_figure, save_picture
from warpedfoam.plot.histograms import plot_histogram
from warpedfoam.plot.histories import plot_annealing, plot_potential_path, plot_relaxation
from warpedfoam.plot.map_picture import plot_map
from warpedfoam.plot.new_figures import figure_cylinder, figure_second_order
from warpedfoam.plot.paper_figures import figure_curvature, figure_gap, figure_spheres, figure_torus_energy
from warpedfoam.plot.potential_picture import plot_potential
from warpedfoam.plot.surface_pictures import figure_circles, figure_surface

__all__ = [
    "Charted",
    "animate",
    "figure_circles",
    "figure_curvature",
    "figure_cylinder",
    "figure_gap",
    "figure_second_order",
    "figure_spheres",
    "figure_surface",
    "figure_torus_energy",
    "plot_annealing",
    "plot_charge_energies",
    "plot_charge_profile",
    "plot_cluster_potential",
    "plot_coarsening",
    "plot_correlations",
    "plot_defects",
    "plot_drift",
    "plot_foam",
    "plot_foam_3d",
    "plot_histogram",
    "plot_map",
    "plot_order",
    "plot_potential",
    "plot_potential_path",
    "plot_relaxation",
    "plot_sides",
    "save_figure",
    "save_picture",
]
