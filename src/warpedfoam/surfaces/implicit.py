"""`Implicit`: the zero set of a user's own function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, as_floats, frozen
from warpedfoam.surfaces.formula import Formula
from warpedfoam.surfaces.netted import FIRST_LOOK, NettedSurface

#: Step of second derivatives by differences, and largest error of the user's gradient; in sizes, relative.
STEP, GRADIENT_ERROR = 1e-5, 1e-4


@dataclass(frozen=True, eq=False)
class Implicit(NettedSurface):
    """Closed surface f = 0 inside a box, from f and its gradient or a formula; f grows into the gap.

    Made by `from_formula` its derivatives are exact, and a foam on it can be saved.

    Parameters
    ----------
    function : callable
        f at points (n, 3), returning (n,); smooth, at least three times differentiable.
    gradient : callable or None
        ∇f at points (n, 3), returning (n, 3); None if ``function`` is a `Formula`.
    bounds : (2, 3) array
        Lower and upper corner of a box that holds the surface with room to spare.
    hessian : callable, optional
        ∇²f, returning (n, 3, 3); a formula's own, or central differences of the gradient by default.

    Raises
    ------
    TypeError, ValueError
        If a function is not callable, returns the wrong shape, or ``gradient`` is not f's gradient.
    MeshError
        If f does not change sign in the box, or f = 0 reaches its walls; once it is
        meshed, if it is not one closed surface.

    Examples
    --------
    A torus:

    >>> def f(x):
    ...     return (np.hypot(x[:, 0], x[:, 1]) - 3.0) ** 2 + x[:, 2] ** 2 - 1.0
    >>> def grad(x):
    ...     q = np.hypot(x[:, 0], x[:, 1])
    ...     s = 2.0 * (q - 3.0) / q
    ...     return np.stack([s * x[:, 0], s * x[:, 1], 2.0 * x[:, 2]], axis=1)
    >>> ring = Implicit(f, grad, [[-4.5, -4.5, -1.5], [4.5, 4.5, 1.5]])
    >>> ring.euler_characteristic, bool(abs(ring.area / (12.0 * np.pi**2) - 1.0) < 1e-5)
    (0, True)

    The same by its formula:

    >>> ring = Implicit.from_formula("(hypot(x, y) - 3)**2 + z**2 - 1", [[-4.5, -4.5, -1.5], [4.5, 4.5, 1.5]])
    >>> ring.gaussian_curvature([[4.0, 0.0, 0.0]]).round(12).tolist()
    [0.25]
    """

    function: Callable[[Floats], Floats]
    gradient: Callable[[Floats], Floats] | None
    bounds: Floats
    hessian: Callable[[Floats], Floats] | None = None

    def __init__(
        self,
        function: Callable[[Floats], Floats],
        gradient: Callable[[Floats], Floats] | None,
        bounds: ArrayLike,
        hessian: Callable[[Floats], Floats] | None = None,
    ) -> None:
        exact = isinstance(function, Formula)
        for name, item in (("function", function), ("gradient", gradient), ("hessian", hessian)):
            if not callable(item) and not (item is None and (name == "hessian" or exact)):
                raise TypeError(f"{name} must be callable, got {type(item).__name__}")
        if isinstance(function, Formula) and function.variables != "xyz":
            raise ValueError(f"function must be a formula of x, y and z, got one of {function.variables}")
        box = as_floats(bounds, "bounds", (2, 3))
        if not (box[0] < box[1]).all():
            raise ValueError("bounds must be two corners, the lower one first, with room between them")
        put = object.__setattr__
        put(self, "function", function)
        put(self, "gradient", gradient)
        put(self, "hessian", hessian)
        put(self, "bounds", frozen(box))
        nodes, _ = self.net(float((box[1] - box[0]).max()) / FIRST_LOOK)
        if gradient is not None:
            self._check_gradient(nodes)
        if hessian is not None:
            self._check_hessian(hessian, nodes)

    @classmethod
    def from_formula(cls, formula: str, bounds: ArrayLike) -> Implicit:
        """The closed surface where a formula of x, y and z is 0, see `Formula`; it grows into the gap."""
        return cls(Formula(formula), None, bounds)

    def _check_gradient(self, points: Floats) -> None:
        h = STEP * self.size
        slopes = [(self.values(points + h * e) - self.values(points - h * e)) / (2.0 * h) for e in np.eye(3)]
        given = self._g(points)
        fault = np.abs(np.stack(slopes, axis=1) - given).max(axis=1)
        if not (fault <= GRADIENT_ERROR * np.linalg.norm(given, axis=1).max()).all():
            bad = int(np.nanargmax(fault))
            found = [round(float(slope[bad]), 4) for slope in slopes]
            raise ValueError(
                f"gradient is not that of function: at {points[bad].round(4).tolist()} it is "
                f"{given[bad].round(4).tolist()}, differences of function give {found}"
            )

    def _check_hessian(self, hessian: Callable[[Floats], Floats], points: Floats) -> None:
        given = as_floats(hessian(points.copy()), "hessian's values", (len(points), 3, 3))
        h = STEP * self.size
        rows = [(self._g(points + h * e) - self._g(points - h * e)) / (2.0 * h) for e in np.eye(3)]
        fault = np.abs(np.stack(rows, axis=1) - given).max(axis=(1, 2))
        most = max(float(np.abs(given).max()), float(np.abs(self._g(points)).max()) / self.size)
        if not (fault <= 10.0 * GRADIENT_ERROR * most).all():
            bad = int(np.nanargmax(fault))
            raise ValueError(
                f"hessian is not that of function: at {points[bad].round(4).tolist()} it is off by "
                f"{fault[bad]:.3g}; correct it or leave it out"
            )

    def values(self, points: Floats) -> Floats:
        """The user's function."""
        return as_floats(self.function(points.copy()), "function's values", (len(points),))

    def _g(self, points: Floats) -> Floats:
        slope = self.function.gradient if isinstance(self.function, Formula) else self.gradient
        assert slope is not None
        return as_floats(slope(points.copy()), "gradient's values", (len(points), 3))

    @property
    def size(self) -> float:
        """Distance of the farthest corner of the box from the origin."""
        return float(np.linalg.norm(np.abs(self.bounds).max(axis=0)))

    @property
    def euler_characteristic(self) -> int:
        """χ of a triangulation."""
        return self.triangulate(4000).euler_characteristic

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """The user's function."""
        safe = np.where(np.isfinite(points).all(axis=1, keepdims=True), points, self.bounds[0])
        if not len(points):
            return np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)) if second else None
        value, slope = self.values(safe), self._g(safe)
        if not second:
            return value, slope, None
        given = self.hessian
        if given is None and isinstance(self.function, Formula):
            given = self.function.hessian
        if given is not None:
            return value, slope, as_floats(given(safe.copy()), "hessian's values", (len(points), 3, 3))
        h = STEP * self.size
        rows = [(self._g(safe + h * e) - self._g(safe - h * e)) / (2.0 * h) for e in np.eye(3)]
        bend = np.stack(rows, axis=1)
        return value, slope, 0.5 * (bend + bend.transpose(0, 2, 1))

    @property
    def box(self) -> Floats:
        """The bounds."""
        return self.bounds
