"""The cylinder, between two rims or repeating along its axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Bools, Floats, as_flag, as_generator, as_integer, as_number
from warpedfoam.surfaces.flat_torus import FlatTorus
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import SIZES, Layer
from warpedfoam.surfaces.turned import turned_mesh, turned_rims


@dataclass(frozen=True)
class Cylinder(LevelSurface):
    """Cylinder of a radius about the z axis, |z| ≤ height/2, with a rim at both ends. Normals outward.

    A periodic one has its ends joined: it repeats after ``height`` and is isometric to a flat torus 2πr
    wide, so that a foam in a thin gap has the flat foam's energy.

    Parameters
    ----------
    radius, height : float
        Above 0.
    periodic : bool, optional
        Whether the ends are joined.

    Raises
    ------
    TypeError, ValueError
        If a size is not a finite number above 0, or ``periodic`` no bool.

    Examples
    --------
    >>> tube = Cylinder(radius=1.0, height=5.0)
    >>> tube.principal_curvatures([[2.0, 0.0, 0.0]])
    array([[1., 0.]])
    """

    radius: float
    height: float
    periodic: bool = False

    def __post_init__(self) -> None:
        for name in ("radius", "height"):
            object.__setattr__(self, name, as_number(getattr(self, name), name, positive=True, **SIZES))
        as_flag(self.periodic, "periodic")

    @property
    def period(self) -> Floats | None:
        """(∞, ∞, height) if periodic."""
        return np.array([np.inf, np.inf, self.height]) if self.periodic else None

    @property
    def size(self) -> float:
        """Radius of a ball round the origin that holds one unit."""
        return float(np.hypot(self.radius, 0.5 * self.height))

    @property
    def euler_characteristic(self) -> int:
        """χ = 0."""
        return 0

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """(x² + y² − r²)/2r."""
        flat = points * [1.0, 1.0, 0.0]
        value = 0.5 * ((flat**2).sum(axis=1) / self.radius - self.radius)
        bend = None
        if second:
            bend = np.broadcast_to(np.diag([1.0, 1.0, 0.0]) / self.radius, (len(points), 3, 3))
        return value, flat / self.radius, bend

    def integral(self, layer: Layer) -> float:
        """(c0 + c1/2r) 2πr · height."""
        if layer.profile is not None:
            return super().integral(layer)
        c0, c1, _ = layer.steiner
        return (c0 + 0.5 * c1 / self.radius) * 2.0 * np.pi * self.radius * self.height

    def curvature_range(self) -> tuple[float, float]:
        """0 along the axis, 1/r round it."""
        return 0.0, 1.0 / self.radius

    def rolled(self, points: Floats) -> Floats:
        """Points of the cylinder from points (s, z, 0) of the flat torus 2πr by height: s/r is the angle."""
        angle = points[:, 0] / self.radius
        return np.stack([self.radius * np.cos(angle), self.radius * np.sin(angle), points[:, 1]], axis=1)

    def random_points(self, count: int, rng: object) -> Floats:
        """Uniform in angle and height."""
        n = as_integer(count, "count", minimum=0)
        draw = as_generator(rng, "rng").random((n, 2)) - 0.5
        sides = draw * [2.0 * np.pi * self.radius, self.height]
        return self.rolled(np.column_stack([sides, np.zeros(n)]))

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """The flat torus's triangulation, rolled up; rings from rim to rim if there are rims."""
        known: dict[int, TriangleMesh] = self.__dict__.setdefault("_meshes", {})
        if n_nodes not in known and not self.periodic:
            known[n_nodes] = turned_mesh(self._radius, -0.5 * self.height, 0.5 * self.height, n_nodes)
        elif n_nodes not in known:
            sheet = FlatTorus(2.0 * np.pi * self.radius, self.height).triangulate(n_nodes)
            known[n_nodes] = TriangleMesh(self.rolled(sheet.nodes), sheet.triangles, self.period)
        return known[n_nodes]

    def _radius(self, z: Floats) -> Floats:
        return np.full(len(z), self.radius)

    def rim_loops(self) -> Sequence[Sequence[Floats]]:
        """The two circles, unless the ends are joined."""
        if self.periodic:
            return ()
        return turned_rims(self._radius, -0.5 * self.height, 0.5 * self.height, (False, False))

    def beyond(self, points: Floats) -> Bools:
        """|z| > height/2, unless the ends are joined."""
        out: Bools = np.abs(points[:, 2]) > (np.inf if self.periodic else 0.5 * self.height)
        return out
