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
from warpedfoam import theory
from warpedfoam.analysis import (
    BondOrder,
    ChargeEnergies,
    ChargeProfile,
    Correlations,
    DefectReport,
    EquilibriumReport,
    FoamStatistics,
    SideDistribution,
    bond_order,
    charge_energies,
    charge_in,
    charge_profile,
    correlations,
    defects,
    equilibrium_report,
    foam_statistics,
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
    load,
    save,
    write_bubbles_csv,
    write_columns_csv,
    write_films_csv,
    write_ply,
    write_record,
)
from warpedfoam.moves import T1Event, t1, wall_t1
from warpedfoam.network import CellNetwork, network_from_loops
from warpedfoam.plot import (
    plot_charge_energies,
    plot_charge_profile,
    plot_correlations,
    plot_defects,
    plot_foam,
    plot_order,
    plot_sides,
    save_figure,
    save_picture,
)
from warpedfoam.relax import Relaxation, relax
from warpedfoam.studies import (
    ClusterPotential,
    GeodesicCircle,
    cluster_clearance,
    cluster_foam,
    cluster_potential,
    geodesic_circle,
)
from warpedfoam.surfaces import (
    Catenoid,
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
    "BondOrder",
    "Catenoid",
    "CellNetwork",
    "ChargeEnergies",
    "ChargeProfile",
    "ClusterPotential",
    "ConvergenceError",
    "Correlations",
    "Cylinder",
    "DefectReport",
    "Ellipsoid",
    "EquilibriumReport",
    "FileFormatError",
    "FlatTorus",
    "Foam",
    "FoamStatistics",
    "GeodesicCircle",
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
    "TriangleMesh",
    "WarpedFoamError",
    "bond_order",
    "charge_energies",
    "charge_in",
    "charge_profile",
    "cluster_clearance",
    "cluster_foam",
    "cluster_potential",
    "correlations",
    "defects",
    "equilibrium_report",
    "foam_statistics",
    "geodesic_circle",
    "geodesic_distances",
    "geodesic_report",
    "load",
    "mesh_report",
    "network_from_loops",
    "plot_charge_energies",
    "plot_charge_profile",
    "plot_correlations",
    "plot_defects",
    "plot_foam",
    "plot_order",
    "plot_sides",
    "read_mesh",
    "relax",
    "save",
    "save_figure",
    "save_picture",
    "side_distribution",
    "t1",
    "theory",
    "voronoi_foam",
    "wall_t1",
    "write_bubbles_csv",
    "write_columns_csv",
    "write_films_csv",
    "write_ply",
    "write_record",
]
