"""Pictures; matplotlib is imported when the first one is drawn."""

from warpedfoam.plot.foam_picture import plot_foam, save_picture

__all__ = ["plot_foam", "save_picture"]
