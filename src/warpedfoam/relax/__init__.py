"""Relaxation of foams: Newton's method on energy and volumes, with T1s between the steps."""

from warpedfoam.relax.contacts import outline_gap, with_contacts
from warpedfoam.relax.driver import relax
from warpedfoam.relax.layered import LayeredRelaxation
from warpedfoam.relax.result import Relaxation, RelaxationHistory

__all__ = ["LayeredRelaxation", "Relaxation", "RelaxationHistory", "outline_gap", "relax", "with_contacts"]
