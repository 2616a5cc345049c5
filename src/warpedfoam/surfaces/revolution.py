"""Surfaces of revolution between poles or rims, from a profile function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpedfoam.arrays import Bools, Floats, as_floats, as_integer, as_number
from warpedfoam.surfaces.formula import Formula
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.netted import NettedSurface
from warpedfoam.surfaces.turned import turned_mesh, turned_rims

#: Heights at which the profile is looked at, step of its second derivative, error allowed to the first.
LOOKS, STEP, SLOPE_ERROR, POLE = 400, 1e-5, 1e-4, 1e-9
#: How far the profile is followed beyond a rim, in heights.
ROOM = 0.01


@dataclass(frozen=True, eq=False)
class Revolution(NettedSurface):
    """x² + y² = s(z) for heights from ``bottom`` to ``top``; the gap lies outside.

    The *square* of the radius is given, since it stays smooth at a pole, where the radius does not:
    a spheroid of semi-axes a, c has s(z) = a² (1 − z²/c²). Where s is 0 at an end there is a pole, where
    it is above 0 a rim. Made by `from_formula` its derivatives are exact, and a foam on it can be saved.

    Parameters
    ----------
    square : callable
        s at heights (n,), returning (n,): above 0 between the ends; smooth a little beyond them.
    slope : callable or None
        s', the same way; None if ``square`` is a `Formula`.
    bottom, top : float
        Heights of the ends.

    Raises
    ------
    TypeError, ValueError
        If a function is not callable, returns the wrong shape, is not as described, or ``slope`` is not
        the derivative of ``square``.

    Examples
    --------
    >>> egg = Revolution(lambda z: 4.0 * (1.0 - z**2 / 9.0), lambda z: -8.0 * z / 9.0, -3.0, 3.0)
    >>> egg.gaussian_curvature([[0.0, 0.0, 3.0]]).round(6)
    array([0.5625])
    >>> egg = Revolution.from_formula("4 * (1 - z**2 / 9)", -3.0, 3.0)
    >>> egg.gaussian_curvature([[0.0, 0.0, 3.0]]).tolist()
    [0.5625]
    """

    square: Callable[[Floats], Floats]
    slope: Callable[[Floats], Floats] | None
    bottom: float
    top: float

    def __post_init__(self) -> None:
        exact = isinstance(self.square, Formula)
        for name in ("square", "slope"):
            if not callable(getattr(self, name)) and not (exact and self.slope is None):
                raise TypeError(f"{name} must be callable, got {type(getattr(self, name)).__name__}")
        if isinstance(self.square, Formula) and self.square.variables != "z":
            raise ValueError(f"square must be a formula of z, got one of {self.square.variables}")
        low, high = as_number(self.bottom, "bottom"), as_number(self.top, "top")
        if not low < high:
            raise ValueError(f"top must lie above bottom, got {high:g} and {low:g}")
        object.__setattr__(self, "bottom", low)
        object.__setattr__(self, "top", high)
        z = np.linspace(low, high, LOOKS + 1)
        found = self._s(z)
        most = float(found.max())
        if not found[1:-1].min() > 0.0 or min(found[0], found[-1]) < -POLE * most:
            raise ValueError("square must be above 0 between bottom and top, and 0 or above there")
        h = STEP * (high - low)
        given = self._ds(z)
        off = np.zeros(len(z))
        if self.slope is not None:
            off = np.abs((self._s(z + h) - self._s(z - h)) / (2.0 * h) - given)
        if not (off <= SLOPE_ERROR * np.abs(given).max()).all():
            bad = int(off.argmax())
            raise ValueError(
                f"slope is not the derivative of square: at z = {z[bad]:.4g} it is off by {off[bad]:.3g}"
            )
        low_pole, high_pole = self._poles
        if (low_pole and not given[0] > 0.0) or (high_pole and not given[-1] < 0.0):
            raise ValueError("slope must be above 0 at bottom and below 0 at top: a pole must be round")

    @classmethod
    def from_formula(cls, formula: str, bottom: float, top: float) -> Revolution:
        """x² + y² is a formula of z, see `Formula`."""
        return cls(Formula(formula, "z"), None, bottom, top)

    def _s(self, z: Floats) -> Floats:
        return as_floats(self.square(z.copy()), "square's values", (len(z),))

    def _ds(self, z: Floats) -> Floats:
        slope = self.square.gradient if isinstance(self.square, Formula) else self.slope
        assert slope is not None
        return as_floats(slope(z.copy()), "slope's values", (len(z),))

    def _dds(self, z: Floats) -> Floats:
        if isinstance(self.square, Formula):
            return as_floats(self.square.hessian(z.copy()), "square's derivatives", (len(z),))
        h = STEP * (self.top - self.bottom)
        out: Floats = (self._ds(z + h) - self._ds(z - h)) / (2.0 * h)
        return out

    @cached_property
    def _poles(self) -> tuple[bool, bool]:
        """Which of the ends are poles."""
        low, high = self._s(np.array([self.bottom, self.top])) <= POLE * self._reach**2
        return bool(low), bool(high)

    @property
    def _reach(self) -> float:
        """Largest radius."""
        return float(np.sqrt(self._s(np.linspace(self.bottom, self.top, LOOKS + 1)).max()))

    @property
    def box(self) -> Floats:
        """A fifth wider than the surface."""
        r, room = 1.2 * self._reach, 0.1 * (self.top - self.bottom)
        return np.array([[-r, -r, self.bottom - room], [r, r, self.top + room]])

    @property
    def size(self) -> float:
        """Radius of a ball round the origin that holds the surface."""
        return float(np.hypot(self._reach, max(abs(self.bottom), abs(self.top))))

    @property
    def euler_characteristic(self) -> int:
        """χ, the number of poles."""
        return sum(self._poles)

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """x² + y² − s(z); beyond the poles, and a little beyond rims, s goes on along a straight line."""
        z = np.nan_to_num(points[:, 2], nan=self.bottom)
        room = np.where(self._poles, 0.0, ROOM * (self.top - self.bottom))
        held = np.clip(z, self.bottom - room[0], self.top + room[1])
        slope = self._ds(held)
        value = points[:, 0] ** 2 + points[:, 1] ** 2 - self._s(held) - slope * (z - held)
        gradient = np.stack([2.0 * points[:, 0], 2.0 * points[:, 1], -slope], axis=1)
        if not second:
            return value, gradient, None
        bend = np.zeros((len(points), 3, 3))
        bend[:, 0, 0] = bend[:, 1, 1] = 2.0
        bend[:, 2, 2] = -self._dds(held)
        return value, gradient, bend

    def _radius(self, z: Floats) -> Floats:
        out: Floats = np.sqrt(np.maximum(self._s(z), 0.0))
        return out

    def rim_loops(self) -> Sequence[Sequence[Floats]]:
        """The circles at those ends that are no poles."""
        return turned_rims(self._radius, self.bottom, self.top, self._poles)

    def beyond(self, points: Floats) -> Bools:
        """Below a rim at the bottom, above one at the top."""
        low, high = self._poles
        out: Bools = (points[:, 2] < self.bottom) & (not low) | (points[:, 2] > self.top) & (not high)
        return out

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """A surface net if both ends are poles, rings if there are rims."""
        if all(self._poles):
            return super().triangulate(n_nodes)
        count = as_integer(n_nodes, "n_nodes", minimum=50)
        known: dict[int, TriangleMesh] = self.__dict__.setdefault("_meshes", {})
        if count not in known:
            known[count] = turned_mesh(self._radius, self.bottom, self.top, count, self._poles)
        return known[count]
