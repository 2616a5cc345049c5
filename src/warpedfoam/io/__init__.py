"""Files: PLY for viewers, CSV for tables, `save` and `load` for foams, JSON for run records."""

from warpedfoam.io.atomic import atomic_binary, atomic_text
from warpedfoam.io.meshes import write_mesh
from warpedfoam.io.ply import write_ply
from warpedfoam.io.record import versions, write_record
from warpedfoam.io.state import load, save
from warpedfoam.io.tables import write_bubbles_csv, write_columns_csv, write_films_csv

__all__ = [
    "atomic_binary",
    "atomic_text",
    "load",
    "save",
    "versions",
    "write_bubbles_csv",
    "write_columns_csv",
    "write_films_csv",
    "write_mesh",
    "write_ply",
    "write_record",
]
