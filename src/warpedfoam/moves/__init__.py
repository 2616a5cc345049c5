"""Topological moves: operations that return a new network or foam."""

from warpedfoam.moves.join import ContactEvent, join, rewire_join
from warpedfoam.moves.markers import add_markers, remove_markers
from warpedfoam.moves.part import part, rewire_part
from warpedfoam.moves.t1 import T1Event, rewire, t1
from warpedfoam.moves.t2 import rewire_t2, t2
from warpedfoam.moves.wall_t1 import wall_t1

__all__ = [
    "ContactEvent",
    "T1Event",
    "add_markers",
    "join",
    "part",
    "remove_markers",
    "rewire",
    "rewire_join",
    "rewire_part",
    "rewire_t2",
    "t1",
    "t2",
    "wall_t1",
]
