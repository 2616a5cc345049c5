"""Studies of few bubbles: geodesic circles, one bubble between its plates, the potential of curvature."""

from warpedfoam.studies.bubble import BubbleBetweenPlates, bubble_between_plates
from warpedfoam.studies.geodesic_circle import GeodesicCircle, geodesic_circle
from warpedfoam.studies.potential import (
    GeometricPotential,
    drift_path,
    geometric_potential,
    write_potential_csv,
)

__all__ = [
    "BubbleBetweenPlates",
    "GeodesicCircle",
    "GeometricPotential",
    "bubble_between_plates",
    "drift_path",
    "geodesic_circle",
    "geometric_potential",
    "write_potential_csv",
]
