"""Pictures; matplotlib is imported when the first one is drawn."""

from warpedfoam.plot.foam_picture import plot_foam, save_picture
from warpedfoam.plot.potential_picture import plot_potential

__all__ = ["plot_foam", "plot_potential", "save_picture"]
