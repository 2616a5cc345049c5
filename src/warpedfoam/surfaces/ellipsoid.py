"""The ellipsoid x²/a² + y²/b² + z²/c² = 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, as_integer, as_number
from warpedfoam.surfaces.icosphere import icosphere
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import SIZES


@dataclass(frozen=True)
class Ellipsoid(LevelSurface):
    """Ellipsoid of semi-axes a, b, c along x, y, z about the origin, normals outward.

    Parameters
    ----------
    a, b, c : float
        Above 0.

    Raises
    ------
    TypeError, ValueError
        If a semi-axis is not a finite number above 0.

    Examples
    --------
    >>> egg = Ellipsoid(1.0, 1.0, 1.5)
    >>> egg.gaussian_curvature([[0.0, 0.0, 1.5]]).round(12)
    array([2.25])
    """

    a: float
    b: float
    c: float

    def __post_init__(self) -> None:
        for name in ("a", "b", "c"):
            object.__setattr__(self, name, as_number(getattr(self, name), name, positive=True, **SIZES))

    @property
    def size(self) -> float:
        """The largest semi-axis."""
        return max(self.a, self.b, self.c)

    @property
    def euler_characteristic(self) -> int:
        """χ = 2."""
        return 2

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """(Σ (x_i/a_i)² − 1)/2."""
        squares = np.array([self.a, self.b, self.c]) ** -2.0
        gradient = points * squares
        value = 0.5 * (np.einsum("ni,ni->n", gradient, points) - 1.0)
        bend = np.broadcast_to(np.diag(squares), (len(points), 3, 3)) if second else None
        return value, gradient, bend

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """An icosphere stretched along the axes."""
        count = as_integer(n_nodes, "n_nodes", minimum=12)
        nodes, triangles = icosphere(max(1, int(np.ceil(np.sqrt((count - 2) / 10.0)))))
        return TriangleMesh(nodes * np.array([self.a, self.b, self.c]), triangles)
