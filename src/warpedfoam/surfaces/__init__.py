"""Smooth surfaces and their triangulations; they know arcs, not foams."""

from warpedfoam.surfaces.ellipsoid import Ellipsoid
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import ArcTerms, Layer, Surface
from warpedfoam.surfaces.sphere import Sphere
from warpedfoam.surfaces.torus import Torus

__all__ = ["ArcTerms", "Ellipsoid", "Layer", "LevelSurface", "Sphere", "Surface", "Torus", "TriangleMesh"]
