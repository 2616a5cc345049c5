"""Why a drift may end before its time."""

from __future__ import annotations

TOO_SHORT = (
    "stopped: steps became too short at time {time:.6g} ({fault}); a film is about to vanish that may not "
    "turn: one that ends in a marker, or of a bubble with three sides"
)
MET = "stopped: outlines have met at time {time:.6g}, and {fault}"
RIM = "stopped at time {time:.6g}: {fault}"
VANISHED = "stopped: bubble {name} has all but vanished at time {time:.6g}"
