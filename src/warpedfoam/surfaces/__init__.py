"""Smooth surfaces and their triangulations; they know arcs, not foams."""

from warpedfoam.surfaces.catenoid import Catenoid
from warpedfoam.surfaces.cylinder import Cylinder
from warpedfoam.surfaces.ellipsoid import Ellipsoid
from warpedfoam.surfaces.files import read_mesh
from warpedfoam.surfaces.flat_torus import FlatTorus
from warpedfoam.surfaces.formula import Formula
from warpedfoam.surfaces.formula_gap import FormulaGap
from warpedfoam.surfaces.gap_field import FunctionGap, GapField
from warpedfoam.surfaces.gaps import LinearGap, ShiftedSphereGap, ShiftedTubeGap
from warpedfoam.surfaces.graph import Graph
from warpedfoam.surfaces.health import MeshFinding, MeshReport, mesh_report, repaired
from warpedfoam.surfaces.implicit import Implicit
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.mesh_surface import MeshSurface
from warpedfoam.surfaces.netted import NettedSurface
from warpedfoam.surfaces.protocol import ArcTerms, Layer, Surface
from warpedfoam.surfaces.revolution import Revolution
from warpedfoam.surfaces.rim import Rim
from warpedfoam.surfaces.schwarz_p import SchwarzP
from warpedfoam.surfaces.sphere import Sphere
from warpedfoam.surfaces.torus import Torus

__all__ = [
    "ArcTerms",
    "Catenoid",
    "Cylinder",
    "Ellipsoid",
    "FlatTorus",
    "Formula",
    "FormulaGap",
    "FunctionGap",
    "GapField",
    "Graph",
    "Implicit",
    "Layer",
    "LevelSurface",
    "LinearGap",
    "MeshFinding",
    "MeshReport",
    "MeshSurface",
    "NettedSurface",
    "Revolution",
    "Rim",
    "SchwarzP",
    "ShiftedSphereGap",
    "ShiftedTubeGap",
    "Sphere",
    "Surface",
    "Torus",
    "TriangleMesh",
    "mesh_report",
    "read_mesh",
    "repaired",
]
