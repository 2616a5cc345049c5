"""GLB files (binary glTF 2.0): coloured triangles and films for browsers, Blender and slides."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpedfoam.arrays import as_instance, as_integer
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_binary, writable_path
from warpedfoam.io.colours import FILM_COLOUR, as_rgb, bubble_colours
from warpedfoam.io.patches import bubble_patches


def write_glb(
    path: PathLike, foam: Foam, *, color_by: str = "charge", curve_points: int | None = None
) -> Path:
    """Write ``foam`` as a coloured surface with dark strips for films, in single precision as glTF wants.

    One mesh ``bubbles`` with normals, colours, and the vertex attributes ``_BUBBLE`` (the id, exact up
    to 2²⁴) and ``_QUALITY`` (the value that the colour stands for). Axes are the foam's; glTF takes y for up.

    Parameters
    ----------
    path : str or path
        Ends in ``.glb``.
    foam : Foam
    color_by : {"charge", "pressure", "sides", "area"}, optional
    curve_points : int, optional
        Points along each film, ends included. By default 9, or 5 above 2000 bubbles.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError, ValueError
        Arguments of the wrong type or out of range, missing pressures, a name that does not end in ``.glb``.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.
    """
    import trimesh
    import trimesh.exchange.gltf

    target = writable_path(path, suffixes=(".glb",))
    as_instance(foam, "foam", Foam)
    colours = bubble_colours(foam, color_by)
    many = foam.n_bubbles > 2000
    k = (5 if many else 9) if curve_points is None else as_integer(curve_points, "curve_points", minimum=2)
    patches = bubble_patches(foam, curve_points=k, rings=2 if many else 4, rim_width=0.02)
    rgb = np.where(patches.point_rim[:, None], as_rgb(FILM_COLOUR), colours.rgb[patches.point_bubble])
    mesh = trimesh.Trimesh(
        vertices=patches.points,
        faces=patches.triangles,
        vertex_normals=foam.cell.surface.normals(patches.points),
        vertex_colors=np.column_stack([rgb, np.full(len(rgb), 255)]).astype(np.uint8),
        process=False,
    )
    mesh.vertex_attributes["_BUBBLE"] = foam.bubble_ids[patches.point_bubble].astype(np.float32)
    mesh.vertex_attributes["_QUALITY"] = colours.values[patches.point_bubble].astype(np.float32)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, geom_name="bubbles", node_name="bubbles")
    data: bytes = trimesh.exchange.gltf.export_glb(  # type: ignore[no-untyped-call]
        scene, include_normals=True
    )
    with atomic_binary(target) as stream:
        stream.write(data)
    return target
