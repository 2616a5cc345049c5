"""Motion with friction: foams that drift down their energy in time."""

from warpedfoam.motion.drifting import drift, resume_drift
from warpedfoam.motion.result import Drift, DriftEvent

__all__ = ["Drift", "DriftEvent", "drift", "resume_drift"]
