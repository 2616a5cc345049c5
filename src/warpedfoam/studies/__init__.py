"""Studies: circles, single bubbles, clusters, their potentials, annealing, least partitions, ensembles."""

from warpedfoam.studies.annealing import Annealing, AnnealingHistory, anneal
from warpedfoam.studies.bubble import BubbleBetweenPlates, bubble_between_plates
from warpedfoam.studies.cluster import cluster_clearance, cluster_foam
from warpedfoam.studies.cluster_potential import ClusterPotential, cluster_potential
from warpedfoam.studies.ensemble import Ensemble, run_ensemble
from warpedfoam.studies.geodesic_circle import GeodesicCircle, geodesic_circle
from warpedfoam.studies.partition import MinimalPartition, PartitionTry, minimal_partition
from warpedfoam.studies.potential import (
    GeometricPotential,
    drift_path,
    geometric_potential,
    write_potential_csv,
)
from warpedfoam.studies.soft_probe import ProbePotential, held_centre, probe_potential
from warpedfoam.studies.study import Study, read_study
from warpedfoam.studies.thomson import ThomsonPoints, thomson_points
from warpedfoam.studies.warm_points import anneal_points

__all__ = [
    "Annealing",
    "AnnealingHistory",
    "BubbleBetweenPlates",
    "ClusterPotential",
    "Ensemble",
    "GeodesicCircle",
    "GeometricPotential",
    "MinimalPartition",
    "PartitionTry",
    "ProbePotential",
    "Study",
    "ThomsonPoints",
    "anneal",
    "anneal_points",
    "bubble_between_plates",
    "cluster_clearance",
    "cluster_foam",
    "cluster_potential",
    "drift_path",
    "geodesic_circle",
    "geometric_potential",
    "held_centre",
    "minimal_partition",
    "probe_potential",
    "read_study",
    "run_ensemble",
    "thomson_points",
    "write_potential_csv",
]
