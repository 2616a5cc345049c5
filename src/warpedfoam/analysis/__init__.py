"""Measurements on foams: sides and charges, defects, order, curvature, equilibrium, the honeycomb bound."""

from warpedfoam.analysis.charge_curvature import (
    ChargeEnergies,
    ChargeProfile,
    band_curvatures,
    charge_energies,
    charge_in,
    charge_profile,
)
from warpedfoam.analysis.clusters import cluster_charges, cluster_labels
from warpedfoam.analysis.correlations import Correlations, correlations, excess_charges
from warpedfoam.analysis.defect_report import KINDS, DefectReport
from warpedfoam.analysis.defects import defects
from warpedfoam.analysis.equilibrium import EquilibriumReport, equilibrium_report
from warpedfoam.analysis.honeycomb import honeycomb_bound
from warpedfoam.analysis.order import BondOrder, bond_order
from warpedfoam.analysis.sides import SideDistribution, side_distribution
from warpedfoam.analysis.statistics import FoamStatistics, foam_statistics
from warpedfoam.analysis.symmetry import PointGroup, point_group

__all__ = [
    "KINDS",
    "BondOrder",
    "ChargeEnergies",
    "ChargeProfile",
    "Correlations",
    "DefectReport",
    "EquilibriumReport",
    "FoamStatistics",
    "PointGroup",
    "SideDistribution",
    "band_curvatures",
    "bond_order",
    "charge_energies",
    "charge_in",
    "charge_profile",
    "cluster_charges",
    "cluster_labels",
    "correlations",
    "defects",
    "equilibrium_report",
    "excess_charges",
    "foam_statistics",
    "honeycomb_bound",
    "point_group",
    "side_distribution",
]
