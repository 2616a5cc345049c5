"""Studies of one bubble's surroundings and of single bubbles: geodesic circles."""

from warpedfoam.studies.geodesic_circle import GeodesicCircle, geodesic_circle

__all__ = ["GeodesicCircle", "geodesic_circle"]
