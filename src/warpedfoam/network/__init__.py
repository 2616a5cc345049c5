"""The combinatorial cell network: bubbles, films, vertices, and nothing of their positions."""

from warpedfoam.network.cell_network import CellNetwork
from warpedfoam.network.polygons import network_from_loops

__all__ = ["CellNetwork", "network_from_loops"]
