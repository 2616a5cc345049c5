"""The flat torus: a rectangle of the plane whose opposite sides are joined."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from warpedfoam.arrays import Floats, Ints, as_generator, as_integer, as_number, frozen
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import SIZES, Layer


@dataclass(frozen=True)
class FlatTorus(LevelSurface):
    """The plane z = 0, repeating after ``width`` along x and ``height`` along y; the gap lies above.

    Points may lie in any copy of the rectangle about the origin. Nothing curves: the plates are
    parallel planes.

    Parameters
    ----------
    width, height : float
        Above 0.

    Raises
    ------
    TypeError, ValueError
        If a side is not a finite number above 0.

    Examples
    --------
    >>> sheet = FlatTorus(width=4.0, height=3.0)
    >>> sheet.area, sheet.euler_characteristic
    (12.0, 0)
    """

    width: float
    height: float

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            object.__setattr__(self, name, as_number(getattr(self, name), name, positive=True, **SIZES))

    @property
    def period(self) -> Floats | None:
        """(width, height, ∞)."""
        return np.array([self.width, self.height, np.inf])

    @property
    def size(self) -> float:
        """The diagonal."""
        return float(np.hypot(self.width, self.height))

    @property
    def euler_characteristic(self) -> int:
        """χ = 0."""
        return 0

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """f = z."""
        gradient = np.zeros_like(points)
        gradient[:, 2] = 1.0
        return points[:, 2].copy(), gradient, np.zeros((len(points), 3, 3)) if second else None

    def integral(self, layer: Layer) -> float:
        """c0 · width · height."""
        if layer.profile is not None:
            return super().integral(layer)
        return layer.steiner[0] * self.width * self.height

    def curvature_range(self) -> tuple[float, float]:
        """Flat."""
        return 0.0, 0.0

    def random_points(self, count: int, rng: object) -> Floats:
        """Uniform in the rectangle about the origin."""
        draw = as_generator(rng, "rng").random((as_integer(count, "count", minimum=0), 2))
        return np.column_stack([(draw - 0.5) * [self.width, self.height], np.zeros(len(draw))])

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """Rows of nearly equilateral triangles."""
        return _flat_mesh(self, as_integer(n_nodes, "n_nodes", minimum=12))


@lru_cache(maxsize=4)
def _flat_mesh(sheet: FlatTorus, n_nodes: int) -> TriangleMesh:
    edge = np.sqrt(sheet.width * sheet.height / n_nodes * 2.0 / np.sqrt(3.0))
    columns = max(3, round(sheet.width / edge))
    rows = max(4, 2 * round(sheet.height / (edge * np.sqrt(3.0))))
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    x = ((i + 0.5 * (j % 2)) / columns - 0.5) * sheet.width
    y = (j / rows - 0.5) * sheet.height
    nodes = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)

    def at(a: Ints, b: Ints) -> Ints:
        out: Ints = (a % columns) * rows + b % rows
        return out

    odd = j % 2
    low, right, up, up_right = at(i, j), at(i + 1, j), at(i + odd - 1, j + 1), at(i + odd, j + 1)
    triangles = np.concatenate(
        [np.stack([low, up_right, up], axis=-1), np.stack([low, right, up_right], axis=-1)]
    )
    return TriangleMesh(frozen(nodes), triangles.reshape(-1, 3), period=sheet.period)
