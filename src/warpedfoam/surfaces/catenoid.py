"""The catenoid between two rims: no mean curvature, negative Gaussian curvature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Bools, Floats, as_number
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import SIZES, Layer
from warpedfoam.surfaces.turned import turned_mesh, turned_rims

#: Heights in units of the neck beyond which cosh leaves what is of use.
MOST = 20.0


@dataclass(frozen=True)
class Catenoid(LevelSurface):
    """√(x² + y²) = a cosh(z/a) for |z| ≤ h/2, about the z axis; normals outward, a rim at both ends.

    k1 = −k2 = 1/(a cosh²(z/a)) and G = −1/(a² cosh⁴(z/a)): a minimal surface.

    Parameters
    ----------
    neck_radius, height : float
        a and h, above 0; h at most 20 a.

    Raises
    ------
    TypeError, ValueError
        If a size is not a finite number above 0, or the height is too large.

    Examples
    --------
    >>> Catenoid(neck_radius=2.0, height=3.0).gaussian_curvature([[2.0, 0.0, 0.0]])
    array([-0.25])
    """

    neck_radius: float
    height: float

    def __post_init__(self) -> None:
        for name in ("neck_radius", "height"):
            object.__setattr__(self, name, as_number(getattr(self, name), name, positive=True, **SIZES))
        if self.height > MOST * self.neck_radius:
            raise ValueError(
                f"height must be at most {MOST:g} neck radii, {MOST * self.neck_radius:g}, "
                f"got {self.height:g}"
            )

    def _radius(self, z: Floats) -> Floats:
        out: Floats = self.neck_radius * np.cosh(z / self.neck_radius)
        return out

    @property
    def size(self) -> float:
        """Distance of the rims from the origin."""
        end = 0.5 * self.height
        return float(np.hypot(self._radius(np.array(end)), end))

    @property
    def euler_characteristic(self) -> int:
        """χ = 0."""
        return 0

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """(x² + y² − a² cosh²(z/a))/2a; far beyond the rims z is held."""
        a = self.neck_radius
        z = np.clip(np.nan_to_num(points[:, 2]) / a, -0.75 * self.height / a, 0.75 * self.height / a)
        x, y = points[:, 0] / a, points[:, 1] / a
        value = 0.5 * a * (x**2 + y**2 - np.cosh(z) ** 2)
        gradient = np.stack([x, y, -0.5 * np.sinh(2.0 * z)], axis=1)
        if not second:
            return value, gradient, None
        bend = np.zeros((len(points), 3, 3))
        bend[:, 0, 0] = bend[:, 1, 1] = 1.0 / a
        bend[:, 2, 2] = -np.cosh(2.0 * z) / a
        return value, gradient, bend

    def integral(self, layer: Layer) -> float:
        """∫ dA = πa² (h/a + sinh(h/a)), ∫ H dA = 0, ∫ G dA = −4π tanh(h/2a)."""
        a, long = self.neck_radius, self.height / self.neck_radius
        if layer.profile is not None:
            return super().integral(layer)
        c0, _, c2 = layer.steiner
        area = np.pi * a**2 * (long + np.sinh(long))
        return float(c0 * area - c2 * 4.0 * np.pi * np.tanh(0.5 * long))

    def curvature_range(self) -> tuple[float, float]:
        """±1/a, at the neck."""
        return -1.0 / self.neck_radius, 1.0 / self.neck_radius

    def beyond(self, points: Floats) -> Bools:
        """|z| > h/2."""
        out: Bools = np.abs(points[:, 2]) > 0.5 * self.height
        return out

    def rim_loops(self) -> Sequence[Sequence[Floats]]:
        """The two circles."""
        return turned_rims(self._radius, -0.5 * self.height, 0.5 * self.height, (False, False))

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """Rings from rim to rim."""
        known: dict[int, TriangleMesh] = self.__dict__.setdefault("_meshes", {})
        if n_nodes not in known:
            known[n_nodes] = turned_mesh(self._radius, -0.5 * self.height, 0.5 * self.height, n_nodes)
        return known[n_nodes]
