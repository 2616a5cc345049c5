"""Measurements on foams: sides and charges, equilibrium."""

from warpedfoam.analysis.equilibrium import EquilibriumReport, equilibrium_report
from warpedfoam.analysis.sides import SideDistribution, side_distribution

__all__ = ["EquilibriumReport", "SideDistribution", "equilibrium_report", "side_distribution"]
