"""From seeds to a foam: geodesic distances, Voronoi cells, the network they form."""

from warpedfoam.tessellate.build import voronoi_foam
from warpedfoam.tessellate.geodesics import HeatGeodesics, geodesic_distances

__all__ = ["HeatGeodesics", "geodesic_distances", "voronoi_foam"]
