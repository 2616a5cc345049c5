"""Topological moves: operations that return a new network or foam."""

from warpedfoam.moves.t1 import T1Event, rewire, t1
from warpedfoam.moves.wall_t1 import wall_t1

__all__ = ["T1Event", "rewire", "t1", "wall_t1"]
