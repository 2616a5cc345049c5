"""Studies: geodesic circles round a bubble's place, annealing, least partitions, repelling points."""

from warpedfoam.studies.annealing import Annealing, AnnealingHistory, anneal
from warpedfoam.studies.geodesic_circle import GeodesicCircle, geodesic_circle
from warpedfoam.studies.partition import MinimalPartition, PartitionTry, minimal_partition
from warpedfoam.studies.thomson import ThomsonPoints, thomson_points

__all__ = [
    "Annealing",
    "AnnealingHistory",
    "GeodesicCircle",
    "MinimalPartition",
    "PartitionTry",
    "ThomsonPoints",
    "anneal",
    "geodesic_circle",
    "minimal_partition",
    "thomson_points",
]
