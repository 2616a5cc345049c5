"""Foams in time: films that drift against friction, gas that passes through them."""

from warpedfoam.motion.coarsening import coarsen
from warpedfoam.motion.coarsening_result import Coarsening, CoarseningEvent
from warpedfoam.motion.drifting import drift, resume_drift
from warpedfoam.motion.gas import gas_dissipation, gas_flow
from warpedfoam.motion.result import Drift, DriftEvent

__all__ = [
    "Coarsening",
    "CoarseningEvent",
    "Drift",
    "DriftEvent",
    "coarsen",
    "drift",
    "gas_dissipation",
    "gas_flow",
    "resume_drift",
]
