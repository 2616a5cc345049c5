"""Measurements on foams: sides and charges, equilibrium, the honeycomb bound."""

from warpedfoam.analysis.equilibrium import EquilibriumReport, equilibrium_report
from warpedfoam.analysis.honeycomb import honeycomb_bound
from warpedfoam.analysis.sides import SideDistribution, side_distribution

__all__ = [
    "EquilibriumReport",
    "SideDistribution",
    "equilibrium_report",
    "honeycomb_bound",
    "side_distribution",
]
