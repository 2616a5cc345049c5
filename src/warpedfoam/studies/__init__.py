"""Studies: geodesic circles, one bubble between its plates, the potential of curvature, ensembles."""

from warpedfoam.studies.bubble import BubbleBetweenPlates, bubble_between_plates
from warpedfoam.studies.ensemble import Ensemble, run_ensemble
from warpedfoam.studies.geodesic_circle import GeodesicCircle, geodesic_circle
from warpedfoam.studies.potential import (
    GeometricPotential,
    drift_path,
    geometric_potential,
    write_potential_csv,
)
from warpedfoam.studies.study import Study, read_study

__all__ = [
    "BubbleBetweenPlates",
    "Ensemble",
    "GeodesicCircle",
    "GeometricPotential",
    "Study",
    "bubble_between_plates",
    "drift_path",
    "geodesic_circle",
    "geometric_potential",
    "read_study",
    "run_ensemble",
    "write_potential_csv",
]
