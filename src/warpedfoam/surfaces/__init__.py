"""Smooth surfaces and their triangulations; they know arcs, not foams."""

from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import ArcTerms, Layer, Surface
from warpedfoam.surfaces.sphere import Sphere
from warpedfoam.surfaces.torus import Torus

__all__ = ["ArcTerms", "Layer", "Sphere", "Surface", "Torus", "TriangleMesh"]
