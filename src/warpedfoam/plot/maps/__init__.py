"""Unrolled maps of surfaces: projections, and films and bubbles cut at the edges of a map."""

from warpedfoam.plot.maps.charts import Chart, chart_of, projections
from warpedfoam.plot.maps.regions import Regions, regions, window_area
from warpedfoam.plot.maps.strands import Strands

__all__ = ["Chart", "Regions", "Strands", "chart_of", "projections", "regions", "window_area"]
