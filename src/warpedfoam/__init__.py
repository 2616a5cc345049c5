"""Bubbles and foams trapped between curved plates: build, relax, study, export.

A foam one bubble thick sits between two parallel curved plates a small gap apart. The front door:

>>> import warpedfoam as wf
>>> cell = wf.HeleShawCell(wf.Torus(major_radius=20.0, minor_radius=4.0), gap=0.5)
>>> foam = wf.voronoi_foam(cell, n_bubbles=150, seeds="lattice")
>>> relaxed = wf.relax(foam)
>>> relaxed.converged, int(relaxed.foam.network.charges.sum())
(True, 0)
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from warpedfoam import startup  # first, before anything slow

if TYPE_CHECKING:
    from warpedfoam import theory
    from warpedfoam.analysis import (
        BondOrder,
        ChargeEnergies,
        ChargeProfile,
        Correlations,
        DefectReport,
        EquilibriumReport,
        FoamStatistics,
        PointGroup,
        SideDistribution,
        bond_order,
        charge_energies,
        charge_in,
        charge_profile,
        cluster_charges,
        cluster_labels,
        correlations,
        defects,
        equilibrium_report,
        foam_statistics,
        point_group,
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
        write_columns_csv,
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
    from warpedfoam.motion import (
        Coarsening,
        CoarseningEvent,
        Drift,
        DriftEvent,
        coarsen,
        drift,
        gas_dissipation,
        gas_flow,
        resume_drift,
    )
    from warpedfoam.moves import (
        ContactEvent,
        T1Event,
        add_markers,
        join,
        part,
        remove_markers,
        t1,
        t2,
        wall_t1,
    )
    from warpedfoam.network import CellNetwork, network_from_loops
    from warpedfoam.plot import (
        animate,
        plot_annealing,
        plot_charge_energies,
        plot_charge_profile,
        plot_cluster_potential,
        plot_coarsening,
        plot_correlations,
        plot_defects,
        plot_drift,
        plot_foam,
        plot_foam_3d,
        plot_histogram,
        plot_map,
        plot_order,
        plot_potential,
        plot_potential_path,
        plot_relaxation,
        plot_sides,
        save_figure,
        save_picture,
    )
    from warpedfoam.relax import (
        LayeredRelaxation,
        Relaxation,
        RelaxationHistory,
        outline_gap,
        relax,
        with_contacts,
    )
    from warpedfoam.studies import (
        Annealing,
        AnnealingHistory,
        BubbleBetweenPlates,
        ClusterPotential,
        Ensemble,
        GeodesicCircle,
        GeometricPotential,
        MinimalPartition,
        PartitionTry,
        ProbePotential,
        Study,
        ThomsonPoints,
        anneal,
        anneal_points,
        bubble_between_plates,
        cluster_clearance,
        cluster_foam,
        drift_path,
        geometric_potential,
        held_centre,
        minimal_partition,
        probe_potential,
        read_study,
        run_ensemble,
        thomson_points,
        write_potential_csv,
    )
    from warpedfoam.studies.cluster_potential import cluster_potential
    from warpedfoam.studies.geodesic_circle import geodesic_circle
    from warpedfoam.surfaces import (
        Catenoid,
        Cylinder,
        Ellipsoid,
        FlatTorus,
        Formula,
        FormulaGap,
        GapField,
        Graph,
        Implicit,
        LevelSurface,
        LinearGap,
        MeshSurface,
        Revolution,
        SchwarzP,
        ShiftedSphereGap,
        ShiftedTubeGap,
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
    from warpedfoam.view import write_view

__version__ = "0.1.0"

__all__ = [
    "Annealing",
    "AnnealingHistory",
    "BondOrder",
    "BubbleBetweenPlates",
    "Catenoid",
    "CellNetwork",
    "ChargeEnergies",
    "ChargeProfile",
    "ClusterPotential",
    "Coarsening",
    "CoarseningEvent",
    "ContactEvent",
    "ConvergenceError",
    "Correlations",
    "Cylinder",
    "DefectReport",
    "Drift",
    "DriftEvent",
    "Ellipsoid",
    "Ensemble",
    "EquilibriumReport",
    "EvolverDump",
    "FileFormatError",
    "FlatTorus",
    "Foam",
    "FoamStatistics",
    "Formula",
    "FormulaGap",
    "GapField",
    "GeodesicCircle",
    "GeodesicDistances",
    "GeometricPotential",
    "Graph",
    "HeatGeodesics",
    "HeleShawCell",
    "Implicit",
    "LayeredRelaxation",
    "LevelSurface",
    "LinearGap",
    "MeshError",
    "MeshSurface",
    "MinimalPartition",
    "PartitionTry",
    "PointGroup",
    "ProbePotential",
    "Relaxation",
    "RelaxationHistory",
    "ResolutionError",
    "Revolution",
    "SchwarzP",
    "ShiftedSphereGap",
    "ShiftedTubeGap",
    "SideDistribution",
    "Sphere",
    "Study",
    "Surface",
    "T1Event",
    "ThomsonPoints",
    "TopologyError",
    "Torus",
    "Trajectory",
    "TrajectoryWriter",
    "TriangleMesh",
    "WarpedFoamError",
    "add_markers",
    "animate",
    "anneal",
    "anneal_points",
    "bond_order",
    "bubble_between_plates",
    "charge_energies",
    "charge_in",
    "charge_profile",
    "cluster_charges",
    "cluster_clearance",
    "cluster_foam",
    "cluster_labels",
    "cluster_potential",
    "coarsen",
    "correlations",
    "defects",
    "drift",
    "drift_path",
    "equilibrium_report",
    "foam_statistics",
    "gas_dissipation",
    "gas_flow",
    "geodesic_circle",
    "geodesic_distances",
    "geodesic_report",
    "geometric_potential",
    "held_centre",
    "import_polygons",
    "join",
    "load",
    "mesh_report",
    "minimal_partition",
    "network_from_loops",
    "outline_gap",
    "part",
    "plot_annealing",
    "plot_charge_energies",
    "plot_charge_profile",
    "plot_cluster_potential",
    "plot_coarsening",
    "plot_correlations",
    "plot_defects",
    "plot_drift",
    "plot_foam",
    "plot_foam_3d",
    "plot_histogram",
    "plot_map",
    "plot_order",
    "plot_potential",
    "plot_potential_path",
    "plot_relaxation",
    "plot_sides",
    "point_group",
    "probe_potential",
    "read_dmp",
    "read_mesh",
    "read_study",
    "read_vtp",
    "relax",
    "remove_markers",
    "resume_drift",
    "run_ensemble",
    "save",
    "save_figure",
    "save_picture",
    "side_distribution",
    "t1",
    "t2",
    "theory",
    "thomson_points",
    "voronoi_foam",
    "wall_t1",
    "with_contacts",
    "write_bubbles_csv",
    "write_bubbles_parquet",
    "write_columns_csv",
    "write_fe",
    "write_films_csv",
    "write_films_parquet",
    "write_glb",
    "write_graph_json",
    "write_graphml",
    "write_obj",
    "write_ply",
    "write_potential_csv",
    "write_pvd",
    "write_record",
    "write_view",
    "write_vtm",
    "write_vtp",
]

#: Where names are found when they are first asked for: numpy and scipy take most of a second to import.
_HOMES = {
    "analysis": (
        "BondOrder ChargeEnergies ChargeProfile Correlations DefectReport EquilibriumReport "
        "FoamStatistics PointGroup SideDistribution bond_order charge_energies charge_in charge_profile "
        "cluster_charges cluster_labels correlations defects equilibrium_report foam_statistics "
        "point_group side_distribution"
    ),
    "cell": "HeleShawCell",
    "errors": "ConvergenceError FileFormatError MeshError ResolutionError TopologyError WarpedFoamError",
    "foam": "Foam",
    "io": (
        "EvolverDump Trajectory TrajectoryWriter import_polygons load read_dmp read_vtp save "
        "write_bubbles_csv write_bubbles_parquet write_columns_csv write_fe write_films_csv "
        "write_films_parquet write_glb write_graph_json write_graphml write_obj write_ply write_pvd "
        "write_record write_vtm write_vtp"
    ),
    "motion": (
        "Coarsening CoarseningEvent Drift DriftEvent coarsen drift gas_dissipation gas_flow resume_drift"
    ),
    "moves": "ContactEvent T1Event add_markers join part remove_markers t1 t2 wall_t1",
    "network": "CellNetwork network_from_loops",
    "plot": (
        "animate plot_annealing plot_charge_energies plot_charge_profile plot_cluster_potential "
        "plot_coarsening plot_correlations plot_defects plot_drift plot_foam plot_foam_3d plot_histogram "
        "plot_map plot_order plot_potential plot_potential_path plot_relaxation plot_sides save_figure "
        "save_picture"
    ),
    "relax": "LayeredRelaxation Relaxation RelaxationHistory outline_gap relax with_contacts",
    "studies": (
        "Annealing AnnealingHistory BubbleBetweenPlates ClusterPotential Ensemble GeodesicCircle "
        "GeometricPotential MinimalPartition PartitionTry ProbePotential Study ThomsonPoints anneal "
        "anneal_points bubble_between_plates cluster_clearance cluster_foam cluster_potential drift_path "
        "geodesic_circle geometric_potential held_centre minimal_partition probe_potential read_study "
        "run_ensemble thomson_points write_potential_csv"
    ),
    "surfaces": (
        "Catenoid Cylinder Ellipsoid FlatTorus Formula FormulaGap GapField Graph Implicit LevelSurface "
        "LinearGap MeshSurface Revolution SchwarzP ShiftedSphereGap ShiftedTubeGap Sphere Surface Torus "
        "TriangleMesh mesh_report read_mesh"
    ),
    "tessellate": "GeodesicDistances HeatGeodesics geodesic_distances geodesic_report voronoi_foam",
    "view": "write_view",
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names.split()}
_PACKAGES = {*_HOMES, "arrays", "energy", "kernels", "theory"}


class _Front(ModuleType):
    """Keeps `relax` the function: Python would put the package of that name, once imported, in its place."""

    def __setattr__(self, name: str, value: object) -> None:
        if name == "relax" and isinstance(value, ModuleType):
            value = value.relax
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Front


if not TYPE_CHECKING:  # type checkers know all names from above, and should miss others

    def __getattr__(name: str) -> object:
        if name in _HOME_OF:
            found = getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
            globals()[name] = found
            return found
        if name in _PACKAGES:
            return import_module(f"{__name__}.{name}")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__, *_PACKAGES})
