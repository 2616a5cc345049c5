"""Surfaces of revolution that close on their axis, from a profile function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, as_floats, as_number
from warpedfoam.surfaces.netted import NettedSurface

#: Heights at which the profile is looked at, step of its second derivative, error allowed to the first.
LOOKS, STEP, SLOPE_ERROR = 400, 1e-5, 1e-4


@dataclass(frozen=True, eq=False)
class Revolution(NettedSurface):
    """x² + y² = s(z) between two poles on the z axis; the gap lies outside.

    The *square* of the radius is given, since it stays smooth at the poles, where the radius does not:
    a spheroid of semi-axes a, c has s(z) = a² (1 − z²/c²).

    Parameters
    ----------
    square : callable
        s at heights (n,), returning (n,): 0 at both poles, above 0 between; smooth a little beyond them.
    slope : callable
        s', the same way.
    bottom, top : float
        Heights of the poles.

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
    """

    square: Callable[[Floats], Floats]
    slope: Callable[[Floats], Floats]
    bottom: float
    top: float

    def __post_init__(self) -> None:
        for name in ("square", "slope"):
            if not callable(getattr(self, name)):
                raise TypeError(f"{name} must be callable, got {type(getattr(self, name)).__name__}")
        low, high = as_number(self.bottom, "bottom"), as_number(self.top, "top")
        if not low < high:
            raise ValueError(f"top must lie above bottom, got {high:g} and {low:g}")
        object.__setattr__(self, "bottom", low)
        object.__setattr__(self, "top", high)
        z = np.linspace(low, high, LOOKS + 1)
        found = self._s(z)
        most = float(found.max())
        if not found[1:-1].min() > 0.0 or max(abs(found[0]), abs(found[-1])) > 1e-9 * most:
            raise ValueError("square must be 0 at bottom and top and above 0 between: they are the poles")
        h = STEP * (high - low)
        given = self._ds(z)
        off = np.abs((self._s(z + h) - self._s(z - h)) / (2.0 * h) - given)
        if not (off <= SLOPE_ERROR * np.abs(given).max()).all():
            bad = int(off.argmax())
            raise ValueError(
                f"slope is not the derivative of square: at z = {z[bad]:.4g} it is off by {off[bad]:.3g}"
            )
        if not (given[0] > 0.0 > given[-1]):
            raise ValueError("slope must be above 0 at bottom and below 0 at top: the poles must be round")

    def _s(self, z: Floats) -> Floats:
        return as_floats(self.square(z.copy()), "square's values", (len(z),))

    def _ds(self, z: Floats) -> Floats:
        return as_floats(self.slope(z.copy()), "slope's values", (len(z),))

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
        """χ = 2."""
        return 2

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """x² + y² − s(z); beyond the poles s goes on along a straight line."""
        z = np.nan_to_num(points[:, 2], nan=self.bottom)
        held = np.clip(z, self.bottom, self.top)
        slope = self._ds(held)
        value = points[:, 0] ** 2 + points[:, 1] ** 2 - self._s(held) - slope * (z - held)
        gradient = np.stack([2.0 * points[:, 0], 2.0 * points[:, 1], -slope], axis=1)
        if not second:
            return value, gradient, None
        h = STEP * (self.top - self.bottom)
        bend = np.zeros((len(points), 3, 3))
        bend[:, 0, 0] = bend[:, 1, 1] = 2.0
        bend[:, 2, 2] = -(self._ds(held + h) - self._ds(held - h)) / (2.0 * h)
        return value, gradient, bend
