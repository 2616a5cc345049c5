"""A landscape: the graph of a height function over a rectangle or a disk."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints, as_flag, as_floats, as_number
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.flat_torus import FlatTorus
from warpedfoam.surfaces.formula import Formula
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import SIZES
from warpedfoam.surfaces.turned import circle, strip_mesh, turned_mesh

#: Step of second derivatives, in widths; error allowed to the gradient and to the periods.
STEP, FAULT = 1e-5, 1e-4
#: How far h is followed beyond the rim, in widths; points of each side of a rectangle's rim.
ROOM, SIDE_POINTS = 0.01, 128


@dataclass(frozen=True, eq=False)
class Graph(LevelSurface):
    """z = h(x, y) over a rectangle or a disk about the origin; the gap lies above.

    The surface ends in a rim along the domain's edge, which has corners over a rectangle; a periodic
    one has the opposite sides of its rectangle joined. Made by `from_formula` its derivatives are exact,
    and a foam on it can be saved.

    Parameters
    ----------
    function : callable
        h at points (n, 2), returning (n,); smooth, also a little beyond the rim.
    gradient : callable or None
        (∂h/∂x, ∂h/∂y) the same way, returning (n, 2); None if ``function`` is a `Formula`.
    width, height : float
        Sides along x and y, above 0; diameters of a disk.
    periodic : bool, optional
        Whether h repeats after ``width`` and ``height``.
    disk : bool, optional
        Whether the domain is a disk; then ``width`` and ``height`` are equal.

    Raises
    ------
    TypeError, ValueError
        If a function is not callable, returns the wrong shape, does not repeat though ``periodic``, or
        ``gradient`` is not the gradient of ``function``; if a side is not above 0, or a disk is periodic
        or of two diameters.

    Examples
    --------
    >>> k = 2.0 * np.pi / 10.0
    >>> hills = Graph(
    ...     lambda x: np.cos(k * x).sum(axis=1), lambda x: -k * np.sin(k * x), 10.0, 10.0, periodic=True
    ... )
    >>> bool(abs(hills.gaussian_curvature([[0.0, 0.0, 2.0]])[0] - k**4) < 1e-5)
    True

    The same by its formula:

    >>> hills = Graph.from_formula("cos(pi*x/5) + cos(pi*y/5)", 10.0, 10.0, periodic=True)
    >>> bool(abs(hills.gaussian_curvature([[0.0, 0.0, 2.0]])[0] - k**4) < 1e-14)
    True
    """

    function: Callable[[Floats], Floats]
    gradient: Callable[[Floats], Floats] | None
    width: float
    height: float
    periodic: bool = False
    disk: bool = False

    def __post_init__(self) -> None:
        exact = isinstance(self.function, Formula)
        for name in ("function", "gradient"):
            if not callable(getattr(self, name)) and not (exact and self.gradient is None):
                raise TypeError(f"{name} must be callable, got {type(getattr(self, name)).__name__}")
        if isinstance(self.function, Formula) and self.function.variables != "xy":
            raise ValueError(f"function must be a formula of x and y, got one of {self.function.variables}")
        for name in ("width", "height"):
            object.__setattr__(self, name, as_number(getattr(self, name), name, positive=True, **SIZES))
        if as_flag(self.disk, "disk") and (as_flag(self.periodic, "periodic") or self.width != self.height):
            raise ValueError("a disk is not periodic, and its width and height are both its diameter")
        x = self._flat(400)[0]
        slope = self._slope(x)
        steep = max(float(np.abs(slope).max()), 1e-12)
        sides = (self.width * np.array([1.0, 0.0]), self.height * np.array([0.0, 1.0]))
        for side in sides if as_flag(self.periodic, "periodic") else ():
            off = float(np.abs(self._height(x + side) - self._height(x)).max())
            if off > FAULT * steep * float(side.sum()):
                raise ValueError(f"function does not repeat after {side.tolist()}: it differs by {off:.3g}")
        h = STEP * self.width
        for k, axis in enumerate(() if self.gradient is None else np.eye(2)):
            found = (self._height(x + h * axis) - self._height(x - h * axis)) / (2.0 * h)
            off = float(np.abs(found - slope[:, k]).max())
            if not off <= FAULT * steep:
                raise ValueError(f"gradient is not that of function: it is off by {off:.3g}")

    @classmethod
    def from_formula(
        cls, formula: str, width: float, height: float, *, periodic: bool = False, disk: bool = False
    ) -> Graph:
        """The landscape of a formula of x and y, see `Formula`."""
        return cls(Formula(formula, "xy"), None, width, height, periodic, disk)

    @property
    def _sheet(self) -> FlatTorus:
        return FlatTorus(self.width, self.height)

    def _height(self, x: Floats) -> Floats:
        return as_floats(self.function(x.copy()), "function's values", (len(x),))

    def _slope(self, x: Floats) -> Floats:
        slope = self.function.gradient if isinstance(self.function, Formula) else self.gradient
        assert slope is not None
        return as_floats(slope(x.copy()), "gradient's values", (len(x), 2))

    def _bend(self, x: Floats) -> Floats:
        """Second derivatives of h, (n, 2, 2)."""
        if isinstance(self.function, Formula):
            return as_floats(self.function.hessian(x.copy()), "function's derivatives", (len(x), 2, 2))
        h = STEP * self.width
        steps = h * np.eye(2)
        rows = [(self._slope(x + step) - self._slope(x - step)) / (2.0 * h) for step in steps]
        bend = np.stack(rows, axis=1)
        out: Floats = 0.5 * (bend + bend.transpose(0, 2, 1))
        return out

    @property
    def period(self) -> Floats | None:
        """(width, height, ∞) if periodic."""
        return self._sheet.period if self.periodic else None

    @property
    def size(self) -> float:
        """Radius of a ball round the origin that holds one unit."""
        return self._extent

    @cached_property
    def _extent(self) -> float:
        z = self._height(self._flat(400)[0])
        return float(np.hypot(0.5 * self._sheet.size, 1.1 * np.abs(z).max()))

    @property
    def euler_characteristic(self) -> int:
        """χ: 0 if periodic, or else 1."""
        return 0 if self.periodic else 1

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """z − h(x, y)."""
        # one unit of the plane is enough to know, and keeps the digits
        x = np.nan_to_num(nearest_image(points, self.period)[:, :2])
        if not self.periodic:
            x = self._held(x)
        slope = self._slope(x)
        gradient = np.column_stack([-slope, np.ones(len(x))])
        value = points[:, 2] - self._height(x)
        if not second:
            return value, gradient, None
        bend = np.zeros((len(x), 3, 3))
        bend[:, :2, :2] = -self._bend(x)
        return value, gradient, bend

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """A triangulation of the domain, lifted."""
        known: dict[int, TriangleMesh] = self.__dict__.setdefault("_meshes", {})
        if n_nodes not in known:
            x, triangles = self._flat(n_nodes)
            known[n_nodes] = TriangleMesh(self._lifted(x), triangles, self.period)
        return known[n_nodes]

    def _lifted(self, x: Floats) -> Floats:
        return np.column_stack([x, self._height(x)])

    def _flat(self, n_nodes: int) -> tuple[Floats, Ints]:
        """Nodes (n, 2) and triangles of the domain."""
        if self.periodic:
            sheet = self._sheet.triangulate(n_nodes)
            return sheet.nodes[:, :2], sheet.triangles
        if not self.disk:
            return strip_mesh(self.width, self.height, n_nodes)
        # a disk is a body of no height: radii fall from the rim to its middle
        r = 0.5 * self.width
        cone = turned_mesh(lambda z: r * (1.0 - z), 0.0, 1.0, n_nodes, (False, True), flat=True)
        return cone.nodes[:, :2], cone.triangles

    def _held(self, x: Floats) -> Floats:
        """Places in the plane, those far beyond the rim moved next to it: h need not be known there."""
        if self.disk:
            r = np.linalg.norm(x, axis=1, keepdims=True)
            near: Floats = x * np.minimum(1.0, (0.5 + ROOM) * self.width / np.maximum(r, 1e-300))
            return near
        sides = (0.5 + ROOM) * np.array([self.width, self.height])
        return np.clip(x, -sides, sides)

    def beyond(self, points: Floats) -> Bools:
        """Over places outside the domain."""
        if self.periodic:
            return np.zeros(len(points), dtype=np.bool_)
        if self.disk:
            out: Bools = np.hypot(points[:, 0], points[:, 1]) > 0.5 * self.width
            return out
        over: Bools = np.abs(points[:, :2]) > [0.5 * self.width, 0.5 * self.height]
        return over[:, 0] | over[:, 1]

    def rim_loops(self) -> Sequence[Sequence[Floats]]:
        """The domain's edge, lifted: a circle, or four sides."""
        if self.periodic:
            return ()
        if self.disk:
            return [[self._lifted(circle(0.5 * self.width, 0.0, turned=False)[:, :2])]]
        a, b = 0.5 * self.width, 0.5 * self.height
        corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b]])
        share = np.linspace(0.0, 1.0, SIDE_POINTS)[:, None]
        sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        return [[self._lifted((1.0 - share) * one + share * other) for one, other in sides]]
