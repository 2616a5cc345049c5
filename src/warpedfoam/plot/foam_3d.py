"""A foam in pyvista: turned with the mouse, thousands of bubbles at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import as_flag, as_instance, as_integer
from warpedfoam.foam import Foam
from warpedfoam.io.colours import CHARGES, FILM_COLOUR, RAMP, BubbleColours, bubble_colours
from warpedfoam.io.patches import bubble_patches, film_points
from warpedfoam.io.scalars import bubble_scalars

if TYPE_CHECKING:
    import pyvista

#: Radius of the films' tubes in bubble sizes, and how many sides they have.
TUBE, TUBE_SIDES = 0.025, 8


def plot_foam_3d(
    foam: Foam,
    color_by: str | ArrayLike = "charge",
    *,
    label: str | None = None,
    films: bool = True,
    off_screen: bool = False,
    size: tuple[int, int] = (1000, 760),
) -> pyvista.Plotter:
    """Put a foam on a pyvista plotter: ``.show()`` opens a window, ``.screenshot(file)`` writes a picture.

    Parameters
    ----------
    foam : Foam
    color_by, label : optional
        As for `plot_foam`.
    films : bool, optional
        Draw the films as tubes.
    off_screen : bool, optional
        For pictures without a window.
    size : (int, int), optional
        Width and height in pixels, 50 … 10000.

    Returns
    -------
    pyvista.Plotter
        Its actors are called "bubbles" and "films".

    Raises
    ------
    ImportError
        If pyvista is not installed: ``pip install "warpedfoam[viewer3d]"``.
    TypeError, ValueError
        As `plot_foam`.
    """
    as_instance(foam, "foam", Foam)
    with_films, hidden = as_flag(films, "films"), as_flag(off_screen, "off_screen")
    if not isinstance(size, (tuple, list)) or len(size) != 2:
        raise TypeError(f"size must be a pair of numbers of pixels, got {size!r}")
    pixels = [as_integer(n, "size", minimum=50, maximum=10_000) for n in size]
    colours = bubble_colours(foam, color_by, label)
    try:
        import pyvista as pv
    except ImportError as fault:
        raise ImportError('plot_foam_3d needs pyvista: pip install "warpedfoam[viewer3d]"') from fault

    plotter: Any = pv.Plotter(off_screen=hidden, window_size=pixels)
    plotter.set_background("white")
    plotter.add_mesh(bubble_mesh(foam, colours), scalars="rgb", rgb=True, name="bubbles", ambient=0.25)
    if colours.kind in ("charge", "counted"):
        _legend(plotter, foam, colours)
    else:
        _bar(plotter, colours)
    if with_films:
        plotter.add_mesh(film_mesh(foam), color=FILM_COLOUR, name="films")
    return cast("pyvista.Plotter", plotter)


def _fine(foam: Foam) -> bool:
    return foam.n_bubbles <= 300


def bubble_mesh(foam: Foam, colours: BubbleColours) -> Any:
    """Triangles with the numbers of their bubble as cell data, and its colour, ``rgb``."""
    import pyvista as pv

    fine = _fine(foam)
    patches = bubble_patches(foam, curve_points=11 if fine else 6, rings=5 if fine else 3)
    owner = patches.triangle_bubble
    mesh: Any = pv.PolyData.from_regular_faces(
        np.array(patches.points), np.array(patches.triangles, dtype=int)
    )
    for name, values in bubble_scalars(foam).items():
        mesh.cell_data[name] = np.asarray(values)[owner]
    mesh.cell_data["shown"] = colours.values[owner]
    mesh.cell_data["rgb"] = colours.rgb[owner]
    # the surface's own normals: patches share no points, so none could be had from neighbours
    mesh.point_data["Normals"] = foam.cell.surface.normals(patches.points)
    return mesh


def film_mesh(foam: Foam) -> Any:
    """Films as tubes."""
    import pyvista as pv

    along = film_points(foam, 7 if _fine(foam) else 4)
    chains = np.asarray(along.chains)
    lines = np.column_stack([np.full(len(chains), chains.shape[1]), chains])
    mesh: Any = pv.PolyData(np.array(along.points), lines=lines.ravel())
    return mesh.tube(radius=TUBE * foam.bubble_size, n_sides=TUBE_SIDES)


def _bar(plotter: Any, colours: BubbleColours) -> None:
    """Colour bar of values."""
    import pyvista as pv
    from matplotlib.colors import LinearSegmentedColormap

    ramp: Any = LinearSegmentedColormap.from_list("ramp", CHARGES if colours.kind == "diverging" else RAMP)
    _scale(plotter, pv.LookupTable(ramp, scalar_range=colours.limits), colours.label, 5)


def _legend(plotter: Any, foam: Foam, colours: BubbleColours) -> None:
    """Numbers of sides or charges that occur, as a bar of their colours."""
    import pyvista as pv

    by_charge = colours.kind == "charge"
    values = (foam.network.charges if by_charge else foam.network.sides)[colours.inside]
    found, first, counts = np.unique(values, return_index=True, return_counts=True)
    shown = colours.rgb[colours.inside][first]
    table: Any = pv.LookupTable(scalar_range=(-0.5, len(found) - 0.5))
    table.values = np.column_stack([shown, np.full(len(found), 255)]).astype(np.uint8)
    names = [f"{v:+d}" if by_charge and v else str(v) for v in found.tolist()]
    table.annotations = {
        k: f"{name}: {n}" for k, (name, n) in enumerate(zip(names, counts.tolist(), strict=True))
    }
    _scale(plotter, table, "charge q" if by_charge else "sides n", 0)


def _scale(plotter: Any, table: Any, label: str, n_labels: int) -> None:
    """A bar below values, beside counts, its letters in black; VTK's own font has no Greek ones."""
    import pyvista as pv

    mapper: Any = pv.DataSetMapper()
    mapper.lookup_table = table
    plotter.add_scalar_bar(
        label.replace("γ", "tension").replace("²", "^2").replace("³", "^3"),
        mapper=mapper,
        color="black",
        n_labels=n_labels,
        vertical=not n_labels,
        position_x=0.2 if n_labels else 0.9,
        position_y=0.03 if n_labels else 0.2,
        height=0.1 if n_labels else 0.6,
        width=0.6 if n_labels else 0.05,
        title_font_size=16,
        label_font_size=14,
    )
