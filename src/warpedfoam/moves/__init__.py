"""Topological moves: operations that return a new network or foam."""

from warpedfoam.moves.t1 import T1Event, rewire, t1

__all__ = ["T1Event", "rewire", "t1"]
