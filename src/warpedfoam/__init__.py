"""Bubbles and foams trapped between curved plates: build, relax, study, export.

A foam one bubble thick sits between two parallel curved plates a small gap apart. The front door:

>>> import warpedfoam as wf
>>> cell = wf.HeleShawCell(wf.Torus(major_radius=20.0, minor_radius=4.0), gap=0.5)
>>> foam = wf.voronoi_foam(cell, n_bubbles=150, seeds="lattice")
>>> relaxed = wf.relax(foam)
>>> relaxed.converged, int(relaxed.foam.network.charges.sum())
(True, 0)
"""

from warpedfoam import startup  # first, before anything slow

# isort: split
from warpedfoam.analysis import (
    EquilibriumReport,
    SideDistribution,
    equilibrium_report,
    side_distribution,
)
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
from warpedfoam.io import (
    EvolverDump,
    Trajectory,
    TrajectoryWriter,
    import_polygons,
    load,
    read_dmp,
    read_vtp,
    save,
    write_bubbles_csv,
    write_bubbles_parquet,
    write_fe,
    write_films_csv,
    write_films_parquet,
    write_glb,
    write_graph_json,
    write_graphml,
    write_obj,
    write_ply,
    write_pvd,
    write_record,
    write_vtm,
    write_vtp,
)
from warpedfoam.moves import T1Event, t1
from warpedfoam.network import CellNetwork, network_from_loops
from warpedfoam.plot import plot_foam, save_picture
from warpedfoam.relax import Relaxation, relax
from warpedfoam.surfaces import (
    Cylinder,
    Ellipsoid,
    FlatTorus,
    Graph,
    Implicit,
    LevelSurface,
    MeshSurface,
    Revolution,
    SchwarzP,
    Sphere,
    Surface,
    Torus,
    TriangleMesh,
    mesh_report,
    read_mesh,
)
from warpedfoam.tessellate import (
    GeodesicDistances,
    HeatGeodesics,
    geodesic_distances,
    geodesic_report,
    voronoi_foam,
)

__version__ = "0.1.0"

__all__ = [
    "CellNetwork",
    "ConvergenceError",
    "Cylinder",
    "Ellipsoid",
    "EquilibriumReport",
    "EvolverDump",
    "FileFormatError",
    "FlatTorus",
    "Foam",
    "GeodesicDistances",
    "Graph",
    "HeatGeodesics",
    "HeleShawCell",
    "Implicit",
    "LevelSurface",
    "MeshError",
    "MeshSurface",
    "Relaxation",
    "ResolutionError",
    "Revolution",
    "SchwarzP",
    "SideDistribution",
    "Sphere",
    "Surface",
    "T1Event",
    "TopologyError",
    "Torus",
    "Trajectory",
    "TrajectoryWriter",
    "TriangleMesh",
    "WarpedFoamError",
    "equilibrium_report",
    "geodesic_distances",
    "geodesic_report",
    "import_polygons",
    "load",
    "mesh_report",
    "network_from_loops",
    "plot_foam",
    "read_dmp",
    "read_mesh",
    "read_vtp",
    "relax",
    "save",
    "save_picture",
    "side_distribution",
    "t1",
    "voronoi_foam",
    "write_bubbles_csv",
    "write_bubbles_parquet",
    "write_fe",
    "write_films_csv",
    "write_films_parquet",
    "write_glb",
    "write_graph_json",
    "write_graphml",
    "write_obj",
    "write_ply",
    "write_pvd",
    "write_record",
    "write_vtm",
    "write_vtp",
]
