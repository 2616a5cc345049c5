"""From seeds to a foam: geodesic distances, Voronoi cells, the network they form."""

from warpedfoam.tessellate.build import voronoi_foam
from warpedfoam.tessellate.geodesics import (
    GeodesicDistances,
    HeatGeodesics,
    geodesic_distances,
    geodesic_report,
)

__all__ = ["GeodesicDistances", "HeatGeodesics", "geodesic_distances", "geodesic_report", "voronoi_foam"]
