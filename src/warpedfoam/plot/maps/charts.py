"""What maps there are of which surfaces."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints, as_choice
from warpedfoam.plot.maps.discs import Discs
from warpedfoam.plot.maps.plate import Plate
from warpedfoam.plot.maps.sheets import Axis, flat_sheet, globe_sheet, torus_sheet, turned_sheet
from warpedfoam.plot.maps.strands import Strands
from warpedfoam.surfaces import Catenoid, Cylinder, FlatTorus, Graph, Revolution, Sphere, Surface, Torus


class Chart(Protocol):
    """A map of a surface: one or two windows of the plane, cut along seams."""

    @property
    def name(self) -> str:
        """The projection."""
        ...

    @property
    def note(self) -> str:
        """What is true to scale on the map, for a reader."""
        ...

    @property
    def n_windows(self) -> int:
        """Number of windows."""
        ...

    @property
    def scale(self) -> float | None:
        """Area on the map per area of the surface if it is the same everywhere, else None."""
        ...

    def strands(self, curves: Floats) -> Strands:
        """Curves (F, k, 3) on the surface, cut where they leave a window."""
        ...

    def where(self, points: Floats) -> Floats:
        """Points (n, 3) of the surface as they are drawn, (n, 2)."""
        ...

    def jumps(self, at: Floats, window: Ints, then: Floats, then_window: Ints) -> Bools:
        """Whether one leaves a window between neighbouring points of a curve."""
        ...

    def edge(self) -> tuple[Floats, Floats]:
        """Points round a window, counter-clockwise, and their places along its edge."""
        ...

    def edge_places(self, at: Floats) -> Floats:
        """Places along the edge of points on it."""
        ...

    def drawn(self, at: Floats, window: Ints) -> Floats:
        """Coordinates in a window as they are drawn."""
        ...

    def graticule(self) -> list[Floats]:
        """Lines of equal angles, as they are drawn, for maps without axes."""
        ...

    def axes(self) -> tuple[Axis, Axis] | None:
        """How the two axes are marked, or None for maps that need a graticule."""
        ...


#: Projections of a globe, of surfaces of revolution, and of plane sheets; the first is the usual one.
GLOBE = ("hammer", "equirectangular", "equal_area", "stereographic")
TURNED = ("angles", "equal_area", "conformal")
PLANE = ("plane",)


def projections(surface: Surface) -> tuple[str, ...]:
    """Names of the projections of a surface, the usual one first; empty if it cannot be unrolled."""
    if isinstance(surface, Torus | Cylinder | Catenoid):
        return TURNED
    if isinstance(surface, Revolution):
        return TURNED if surface.euler_characteristic == 0 else TURNED[:2]
    if isinstance(surface, FlatTorus | Graph):
        return PLANE
    if isinstance(surface, Sphere) or (surface.euler_characteristic == 2 and _is_star(surface)):
        return GLOBE
    return ()


def chart_of(surface: Surface, projection: str | None, centre: tuple[float, float] | None) -> Chart:
    """The map of a surface, with the angles ``centre`` (in degrees) in its middle.

    Raises
    ------
    TypeError, ValueError
        If the surface has no such map, and which ones it has.
    """
    names = projections(surface)
    if not names:
        raise ValueError(
            f"{_called(surface)} cannot be unrolled into a map without a choice of cuts; draw the foam on "
            "it with plot_foam or plot_foam_3d, or turn it in a browser: write_view, warpedfoam view"
        )
    name = names[0] if projection is None else as_choice(projection, "projection", names)
    if names == PLANE:
        assert isinstance(surface, FlatTorus | Graph)
        if centre is not None:
            raise ValueError("centre is for maps of angles; a plane map has none")
        return (
            Plate(0.5 * surface.width) if isinstance(surface, Graph) and surface.disk else flat_sheet(surface)
        )
    if names is GLOBE:
        middle = (0.0, 0.0) if centre is None else centre
        radius = surface.radius if isinstance(surface, Sphere) else 1.0
        if name == "stereographic":
            if centre is not None:
                raise ValueError("centre is not for the stereographic map, which shows both halves")
            return Discs(radius, isinstance(surface, Sphere))
        return globe_sheet(name, radius, middle, isinstance(surface, Sphere))
    if isinstance(surface, Torus):
        return torus_sheet(name, surface, (0.0, 90.0) if centre is None else centre)
    assert isinstance(surface, Cylinder | Catenoid | Revolution)
    return turned_sheet(name, surface, 0.0 if centre is None else centre[0])


def _called(surface: Surface) -> str:
    name = type(surface).__name__
    return f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"


def _is_star(surface: Surface) -> bool:
    """Whether every ray from the origin meets the surface once, so that directions tell its points."""
    nodes = surface.triangulate(2000).nodes
    outward = np.einsum("ni,ni->n", surface.normals(nodes), nodes)
    return bool((outward > 0.0).all())
