"""Files: foams for other programs, tables, states and trajectories; see ``docs/formats.md``."""

from warpedfoam.io.atomic import atomic_binary, atomic_text
from warpedfoam.io.evolver import write_fe
from warpedfoam.io.evolver_dump import EvolverDump, read_dmp
from warpedfoam.io.glb import write_glb
from warpedfoam.io.graphs import write_graph_json, write_graphml
from warpedfoam.io.importing import import_polygons
from warpedfoam.io.meshes import write_mesh
from warpedfoam.io.obj import write_obj
from warpedfoam.io.parquet import write_bubbles_parquet, write_columns_parquet, write_films_parquet
from warpedfoam.io.ply import write_ply
from warpedfoam.io.record import versions, write_record
from warpedfoam.io.state import load, save
from warpedfoam.io.tables import write_bubbles_csv, write_columns_csv, write_films_csv
from warpedfoam.io.trajectory import Trajectory, TrajectoryWriter
from warpedfoam.io.vtk_series import write_pvd, write_vtm
from warpedfoam.io.vtp import read_vtp, write_vtp

__all__ = [
    "EvolverDump",
    "Trajectory",
    "TrajectoryWriter",
    "atomic_binary",
    "atomic_text",
    "import_polygons",
    "load",
    "read_dmp",
    "read_vtp",
    "save",
    "versions",
    "write_bubbles_csv",
    "write_bubbles_parquet",
    "write_columns_csv",
    "write_columns_parquet",
    "write_fe",
    "write_films_csv",
    "write_films_parquet",
    "write_glb",
    "write_graph_json",
    "write_graphml",
    "write_mesh",
    "write_obj",
    "write_ply",
    "write_pvd",
    "write_record",
    "write_vtm",
    "write_vtp",
]
