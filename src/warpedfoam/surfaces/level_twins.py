"""Sphere and torus with the arcs of level sets: for gaps that their closed forms cannot know.

A twin is a `Sphere` or a `Torus` in every respect but one: films are heights over planes and volumes are fans
(see `warpedfoam.surfaces.level`), so that what is measured may vary from place to place.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property, lru_cache

from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.level_forms import as_level
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import Layer, Surface
from warpedfoam.surfaces.sphere import Sphere
from warpedfoam.surfaces.torus import Torus


class LevelTwin(LevelSurface):
    """Points, curvatures and frames of a surface of closed forms, arcs and loops of a level set."""

    @property
    @abstractmethod
    def closed(self) -> Sphere | Torus:
        """The surface itself."""

    @cached_property
    def _form(self) -> LevelSurface:
        return as_level(self.closed)

    def __repr__(self) -> str:
        return repr(self.closed)

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """f and its derivatives."""
        return self._form.level(points, second=second)

    def frames_at(self, points: Floats, normals: Floats) -> Floats:  # noqa: ARG002
        """Those of the surface."""
        return self.closed.vertex_frames(points)

    def vertex_frames(self, points: Floats) -> Floats:
        """Those of the surface."""
        return self.closed.vertex_frames(points)

    def integral(self, layer: Layer) -> float:
        """That of the surface, exact, unless the layer varies."""
        return self.closed.integral(layer) if layer.profile is None else super().integral(layer)

    @property
    def area(self) -> float:
        """That of the surface."""
        return self.closed.area

    @property
    def size(self) -> float:
        """That of the surface."""
        return self.closed.size

    @property
    def euler_characteristic(self) -> int:
        """χ."""
        return self.closed.euler_characteristic

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """That of the surface."""
        return self.closed.triangulate(n_nodes)

    def project(self, points: ArrayLike) -> Floats:
        """That of the surface."""
        return self.closed.project(points)

    def normals(self, points: ArrayLike) -> Floats:
        """That of the surface."""
        return self.closed.normals(points)

    def principal_curvatures(self, points: ArrayLike) -> Floats:
        """That of the surface."""
        return self.closed.principal_curvatures(points)

    def gaussian_curvature(self, points: ArrayLike) -> Floats:
        """That of the surface."""
        return self.closed.gaussian_curvature(points)

    def shape_operators(self, points: ArrayLike, *, project: bool = True) -> Floats:
        """That of the surface."""
        return self.closed.shape_operators(points, project=project)

    def curvature_range(self) -> tuple[float, float]:
        """That of the surface."""
        return self.closed.curvature_range()

    def random_points(self, count: int, rng: object) -> Floats:
        """Those of the surface."""
        return self.closed.random_points(count, rng)

    def lattice_points(self, count: int) -> Floats:
        """Those of the surface."""
        return self.closed.lattice_points(count)

    def rigid_motions(self, points: Floats) -> Floats:
        """Those of the surface."""
        return self.closed.rigid_motions(points)


@dataclass(frozen=True, repr=False)
class LevelSphere(LevelTwin, Sphere):  # type: ignore[misc]
    """A sphere with the arcs of a level set."""

    @property
    def closed(self) -> Sphere:
        """The sphere itself."""
        return Sphere(self.radius)


@dataclass(frozen=True, repr=False)
class LevelTorus(LevelTwin, Torus):  # type: ignore[misc]
    """A torus with the arcs of a level set."""

    @property
    def closed(self) -> Torus:
        """The torus itself."""
        return Torus(self.major_radius, self.minor_radius)


# files, tables and titles name the surface that it is
LevelSphere.__name__, LevelTorus.__name__ = "Sphere", "Torus"


def level_twin(surface: Surface) -> LevelSurface:
    """The surface with the arcs of a level set; itself if it has them.

    Raises
    ------
    TypeError
        If no level set is known.

    Examples
    --------
    >>> twin = level_twin(Torus(20.0, 4.0))
    >>> twin, isinstance(twin, Torus), isinstance(twin, LevelSurface)
    (Torus(major_radius=20.0, minor_radius=4.0), True, True)
    """
    if isinstance(surface, LevelSurface):
        return surface
    if isinstance(surface, (Sphere, Torus)):
        return _twin(surface)
    raise TypeError(
        f"gap varies, which a {type(surface).__name__} cannot carry: derive it from LevelSurface, or give a "
        "number"
    )


@lru_cache(maxsize=4)
def _twin(surface: Sphere | Torus) -> LevelTwin:
    """One for all cells: its quadrature is kept."""
    if isinstance(surface, Sphere):
        return LevelSphere(surface.radius)
    return LevelTorus(surface.major_radius, surface.minor_radius)


def without_twin(surface: Surface) -> Surface:
    """The surface with its own arcs."""
    return surface.closed if isinstance(surface, LevelTwin) else surface
