"""Studies of few bubbles: one bubble between its plates, the potential that curvature makes."""

from warpedfoam.studies.bubble import BubbleBetweenPlates, bubble_between_plates
from warpedfoam.studies.potential import (
    GeometricPotential,
    drift_path,
    geometric_potential,
    write_potential_csv,
)

__all__ = [
    "BubbleBetweenPlates",
    "GeometricPotential",
    "bubble_between_plates",
    "drift_path",
    "geometric_potential",
    "write_potential_csv",
]
