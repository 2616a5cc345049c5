"""Studies of one bubble's surroundings, of single bubbles and of open clusters."""

from warpedfoam.studies.cluster import cluster_clearance, cluster_foam
from warpedfoam.studies.cluster_potential import ClusterPotential, cluster_potential
from warpedfoam.studies.geodesic_circle import GeodesicCircle, geodesic_circle

__all__ = [
    "ClusterPotential",
    "GeodesicCircle",
    "cluster_clearance",
    "cluster_foam",
    "cluster_potential",
    "geodesic_circle",
]
