"""Studies: geodesic circles round one bubble, and ensembles of foams."""

from warpedfoam.studies.ensemble import Ensemble, run_ensemble
from warpedfoam.studies.geodesic_circle import GeodesicCircle, geodesic_circle
from warpedfoam.studies.study import Study, read_study

__all__ = ["Ensemble", "GeodesicCircle", "Study", "geodesic_circle", "read_study", "run_ensemble"]
