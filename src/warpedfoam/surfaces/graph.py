"""A landscape: the graph of a height function that repeats in both directions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, as_flag, as_floats, as_number
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.flat_torus import FlatTorus
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import SIZES

#: Step of second derivatives, in widths; error allowed to the gradient and to the periods.
STEP, FAULT = 1e-5, 1e-4


@dataclass(frozen=True, eq=False)
class Graph(LevelSurface):
    """z = h(x, y) over a rectangle whose opposite sides are joined; the gap lies above.

    Parameters
    ----------
    function : callable
        h at points (n, 2), returning (n,); smooth, of periods ``width`` and ``height``.
    gradient : callable
        (∂h/∂x, ∂h/∂y) the same way, returning (n, 2).
    width, height : float
        Periods along x and y, above 0.
    periodic : bool
        Must be True: graphs that end in rims are not available yet.

    Raises
    ------
    TypeError, ValueError
        If a function is not callable, returns the wrong shape, does not repeat, or ``gradient`` is not
        the gradient of ``function``; if a side is not above 0 or ``periodic`` is not True.

    Examples
    --------
    >>> k = 2.0 * np.pi / 10.0
    >>> hills = Graph(
    ...     lambda x: np.cos(k * x).sum(axis=1), lambda x: -k * np.sin(k * x), 10.0, 10.0, periodic=True
    ... )
    >>> bool(abs(hills.gaussian_curvature([[0.0, 0.0, 2.0]])[0] - k**4) < 1e-5)
    True
    """

    function: Callable[[Floats], Floats]
    gradient: Callable[[Floats], Floats]
    width: float
    height: float
    periodic: bool = False

    def __post_init__(self) -> None:
        for name in ("function", "gradient"):
            if not callable(getattr(self, name)):
                raise TypeError(f"{name} must be callable, got {type(getattr(self, name)).__name__}")
        for name in ("width", "height"):
            object.__setattr__(self, name, as_number(getattr(self, name), name, positive=True, **SIZES))
        if not as_flag(self.periodic, "periodic"):
            raise ValueError("a graph with rims is not available yet; take Graph(..., periodic=True)")
        x = self._sheet.triangulate(400).nodes[:, :2]
        slope = self._slope(x)
        steep = max(float(np.abs(slope).max()), 1e-12)
        for side in (self.width * np.array([1.0, 0.0]), self.height * np.array([0.0, 1.0])):
            off = float(np.abs(self._height(x + side) - self._height(x)).max())
            if off > FAULT * steep * float(side.sum()):
                raise ValueError(f"function does not repeat after {side.tolist()}: it differs by {off:.3g}")
        h = STEP * self.width
        for k, axis in enumerate(np.eye(2)):
            found = (self._height(x + h * axis) - self._height(x - h * axis)) / (2.0 * h)
            off = float(np.abs(found - slope[:, k]).max())
            if not off <= FAULT * steep:
                raise ValueError(f"gradient is not that of function: it is off by {off:.3g}")

    @property
    def _sheet(self) -> FlatTorus:
        return FlatTorus(self.width, self.height)

    def _height(self, x: Floats) -> Floats:
        return as_floats(self.function(x.copy()), "function's values", (len(x),))

    def _slope(self, x: Floats) -> Floats:
        return as_floats(self.gradient(x.copy()), "gradient's values", (len(x), 2))

    @property
    def period(self) -> Floats | None:
        """(width, height, ∞)."""
        return self._sheet.period

    @property
    def size(self) -> float:
        """Radius of a ball round the origin that holds one unit."""
        z = self._height(self._sheet.triangulate(400).nodes[:, :2])
        return float(np.hypot(0.5 * self._sheet.size, 1.1 * np.abs(z).max()))

    @property
    def euler_characteristic(self) -> int:
        """χ = 0."""
        return 0

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """z − h(x, y)."""
        # one unit of the plane is enough to know, and keeps the digits
        x = np.nan_to_num(nearest_image(points, self.period)[:, :2])
        slope = self._slope(x)
        gradient = np.column_stack([-slope, np.ones(len(x))])
        value = points[:, 2] - self._height(x)
        if not second:
            return value, gradient, None
        h = STEP * self.width
        bend = np.zeros((len(x), 3, 3))
        for k, axis in enumerate(np.eye(2)):
            bend[:, k, :2] = -(self._slope(x + h * axis) - self._slope(x - h * axis)) / (2.0 * h)
        return value, gradient, 0.5 * (bend + bend.transpose(0, 2, 1))

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """The flat torus's triangulation, lifted."""
        known: dict[int, TriangleMesh] = self.__dict__.setdefault("_meshes", {})
        if n_nodes not in known:
            sheet = self._sheet.triangulate(n_nodes)
            nodes = sheet.nodes.copy()
            nodes[:, 2] = self._height(nodes[:, :2])
            known[n_nodes] = TriangleMesh(nodes, sheet.triangles, self.period)
        return known[n_nodes]
