"""Pictures; matplotlib is imported when the first one is drawn."""

from warpedfoam.plot.curves import plot_charge_energies, plot_charge_profile, plot_correlations, plot_sides
from warpedfoam.plot.defect_picture import plot_defects, plot_order
from warpedfoam.plot.foam_picture import plot_foam, save_figure, save_picture

__all__ = [
    "plot_charge_energies",
    "plot_charge_profile",
    "plot_correlations",
    "plot_defects",
    "plot_foam",
    "plot_order",
    "plot_sides",
    "save_figure",
    "save_picture",
]
