"""OBJ files: bubbles as polygons, films as lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpedfoam.arrays import as_instance, as_integer
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, atomic_text, writable_path
from warpedfoam.io.patches import film_points, loop_points


def write_obj(path: PathLike, foam: Foam, *, curve_points: int | None = None) -> Path:
    """Write the cell network as Wavefront OBJ: a group and a polygon per bubble, a polyline per film.

    Vertices: the foam's, then the points along the films. Groups are named ``bubble_<id>`` and ``films``.
    OBJ has no place for numbers; what is no disk has no polygon. `import_polygons` reads the file.

    Parameters
    ----------
    path : str or path
        Ends in ``.obj``.
    foam : Foam
    curve_points : int, optional
        Points along each film, ends included. By default 9, or 5 above 2000 bubbles.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError, ValueError
        Arguments of the wrong type or out of range, a name that does not end in ``.obj``.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from warpedfoam import Foam, HeleShawCell, Sphere
    >>> points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]
    >>> loops = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    >>> foam = Foam.from_loops(HeleShawCell(Sphere(1.0), gap=0.01), points, loops)
    >>> folder = tempfile.TemporaryDirectory()
    >>> lines = write_obj(pathlib.Path(folder.name) / "foam.obj", foam).read_text().splitlines()
    >>> sum(line.startswith("f ") for line in lines), sum(line.startswith("l ") for line in lines)
    (4, 6)
    >>> folder.cleanup()
    """
    target = writable_path(path, suffixes=(".obj",))
    as_instance(foam, "foam", Foam)
    default = 5 if foam.n_bubbles > 2000 else 9
    k = default if curve_points is None else as_integer(curve_points, "curve_points", minimum=2)
    along = film_points(foam, k)
    points, corners, sizes, bubble = loop_points(foam, along)
    disk = foam.network.bubble_euler[bubble] == 1
    ends = np.cumsum(sizes)
    with atomic_text(target) as stream:
        stream.write("# cell network of a foam between curved plates, written by warpedfoam\n")
        stream.write(f"# vertices 1 to {foam.network.n_vertices} are the foam's\no foam\n")
        stream.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
        places = (corners + 1).tolist()
        ids = foam.bubble_ids[bubble].tolist()
        for number, size, end, keep in zip(ids, sizes.tolist(), ends.tolist(), disk.tolist(), strict=True):
            if keep:
                stream.write(f"g bubble_{number}\nf {' '.join(map(str, places[end - size : end]))}\n")
        stream.write("g films\n")
        stream.writelines(f"l {' '.join(map(str, chain))}\n" for chain in (along.chains + 1).tolist())
    return target
