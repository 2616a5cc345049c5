"""Bubbles and foams trapped between curved plates."""

from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import (
    ConvergenceError,
    FileFormatError,
    MeshError,
    ResolutionError,
    TopologyError,
    WarpedFoamError,
)
from warpedfoam.foam import Foam
from warpedfoam.network import CellNetwork, network_from_loops
from warpedfoam.surfaces import Sphere, Surface, Torus, TriangleMesh
