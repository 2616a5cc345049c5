"""Ready-made gaps: a wedge, a sphere in a shifted sphere, a torus in a torus of shifted tube."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, as_floats, as_instance, as_number
from warpedfoam.surfaces.protocol import SIZES
from warpedfoam.surfaces.sphere import Sphere
from warpedfoam.surfaces.torus import Torus

Vector = tuple[float, float, float]


def _vector(value: Sequence[float], name: str) -> Vector:
    x, y, z = as_floats(value, name, (3,)).tolist()
    return x, y, z


@dataclass(frozen=True)
class LinearGap:
    """d = d0 + s · (x − x0): the gap of a wedge over a plane.

    Parameters
    ----------
    gap : float
        d0 > 0, the gap at ``origin``.
    slope : (3,) vector
        s, change of the gap per length.
    origin : (3,) vector, optional
        x0, the coordinates' origin by default.

    Raises
    ------
    TypeError, ValueError
        If an argument is not made of finite numbers, or ``gap`` is not above 0.

    Examples
    --------
    >>> import numpy as np
    >>> LinearGap(0.5, slope=(0.01, 0.0, 0.0))(np.array([[2.0, 5.0, 0.0]]))
    array([0.52])
    """

    gap: float
    slope: Vector
    origin: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "gap", as_number(self.gap, "gap", positive=True, **SIZES))
        put(self, "slope", _vector(self.slope, "slope"))
        put(self, "origin", _vector(self.origin, "origin"))

    def __call__(self, points: Floats) -> Floats:
        """The gap, (n,)."""
        out: Floats = self.gap + (np.asarray(points) - np.array(self.origin)) @ np.array(self.slope)
        return out

    def gradient(self, points: Floats) -> Floats:
        """S, the same everywhere."""
        return np.tile(np.array(self.slope), (len(points), 1))

    def hessian(self, points: Floats) -> Floats:
        """0."""
        return np.zeros((len(points), 3, 3))


@dataclass(frozen=True)
class ShiftedSphereGap:
    """Gap between a sphere and one of radius r + d0 whose centre is shifted by c.

    Along the inner sphere's normal n the outer one is met at r + d = c·n + sqrt((r + d0)² − |c|² + (c·n)²).

    Parameters
    ----------
    surface : Sphere
        The inner plate.
    gap : float
        d0 > 0, the gap of the spheres if they were concentric.
    shift : (3,) vector
        c, shorter than d0.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or range, or the spheres touch.

    Examples
    --------
    >>> import numpy as np
    >>> gap = ShiftedSphereGap(Sphere(10.0), 0.5, shift=(0.0, 0.0, 0.1))
    >>> gap(np.array([[0.0, 0.0, 10.0], [0.0, 0.0, -10.0]])).round(12)
    array([0.6, 0.4])
    """

    surface: Sphere
    gap: float
    shift: Vector

    def __post_init__(self) -> None:
        put = object.__setattr__
        as_instance(self.surface, "surface", Sphere)
        put(self, "gap", as_number(self.gap, "gap", positive=True, **SIZES))
        put(self, "shift", _vector(self.shift, "shift"))
        _require_apart(self.gap, float(np.linalg.norm(self.shift)))

    def __call__(self, points: Floats) -> Floats:
        """The gap, (n,)."""
        r, away = self.surface.radius, np.asarray(points)
        along = away @ np.array(self.shift) / np.linalg.norm(away, axis=1)
        return _met(along, r, self.gap, float(np.dot(self.shift, self.shift)))[0]

    def gradient(self, points: Floats) -> Floats:
        """∇d: d' ∇(c·n), with ∇(c·n) = (c − (c·n) n)/|x|."""
        along, across, _, size = _direction(np.asarray(points), np.array(self.shift))
        square = float(np.dot(self.shift, self.shift))
        first = _met(along, self.surface.radius, self.gap, square)[1]
        out: Floats = (first / size)[:, None] * across
        return out

    def hessian(self, points: Floats) -> Floats:
        """∇²d."""
        along, across, normal, size = _direction(np.asarray(points), np.array(self.shift))
        square = float(np.dot(self.shift, self.shift))
        _, first, second = _met(along, self.surface.radius, self.gap, square)
        slope = across / size[:, None]
        mixed = slope[:, :, None] * normal[:, None]
        flat = np.eye(3) - normal[:, :, None] * normal[:, None]
        bend = -(mixed + mixed.transpose(0, 2, 1)) / size[:, None, None]
        bend -= (along / size**2)[:, None, None] * flat
        out: Floats = first[:, None, None] * bend
        out += second[:, None, None] * slope[:, :, None] * slope[:, None]
        return out


@dataclass(frozen=True)
class ShiftedTubeGap:
    """Gap between a torus and one of tube radius r + d0 whose tube is shifted within each half-plane.

    The outer tube's centre lies at (R + a, b) in the half-plane (distance from the axis, z), the inner one's
    at (R, 0). At the tube angle φ, with u = a cos φ + b sin φ, the outer tube is met at
    r + d = u + sqrt((r + d0)² − a² − b² + u²).

    Parameters
    ----------
    surface : Torus
        The inner plate.
    gap : float
        d0 > 0, the gap of concentric tubes.
    outward, upward : float, optional
        a and b: to first order the gap is d0 + a cos φ + b sin φ.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or range, or the tubes touch.

    Examples
    --------
    >>> import numpy as np
    >>> gap = ShiftedTubeGap(Torus(20.0, 4.0), 0.5, outward=0.01)
    >>> gap(np.array([[24.0, 0.0, 0.0], [16.0, 0.0, 0.0]])).round(12)
    array([0.51, 0.49])
    """

    surface: Torus
    gap: float
    outward: float = 0.0
    upward: float = 0.0

    def __post_init__(self) -> None:
        put = object.__setattr__
        as_instance(self.surface, "surface", Torus)
        put(self, "gap", as_number(self.gap, "gap", positive=True, **SIZES))
        for name in ("outward", "upward"):
            put(self, name, as_number(getattr(self, name), name))
        _require_apart(self.gap, float(np.hypot(self.outward, self.upward)))

    @property
    def _shift(self) -> Floats:
        return np.array([self.outward, self.upward])

    def _plane(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Places in the half-plane from the tube's centre (n, 2), the direction outward, the distance."""
        x = np.asarray(points)
        out = np.hypot(x[:, 0], x[:, 1])
        radial = np.stack([x[:, 0] / out, x[:, 1] / out, np.zeros(len(x))], axis=1)
        return np.stack([out - self.surface.major_radius, x[:, 2]], axis=1), radial, out

    def __call__(self, points: Floats) -> Floats:
        """The gap, (n,)."""
        place, _, _ = self._plane(points)
        along = _direction(place, self._shift)[0]
        return _met(along, self.surface.minor_radius, self.gap, float(self._shift @ self._shift))[0]

    def gradient(self, points: Floats) -> Floats:
        """∇d."""
        place, radial, _ = self._plane(points)
        along, across, _, size = _direction(place, self._shift)
        first = _met(along, self.surface.minor_radius, self.gap, float(self._shift @ self._shift))[1]
        out: Floats = _in_space((first / size)[:, None] * across, radial)
        return out

    def hessian(self, points: Floats) -> Floats:
        """∇²d."""
        place, radial, distance = self._plane(points)
        along, across, normal, size = _direction(place, self._shift)
        _, first, second = _met(along, self.surface.minor_radius, self.gap, float(self._shift @ self._shift))
        slope = across / size[:, None]
        mixed = slope[:, :, None] * normal[:, None]
        flat = np.eye(2) - normal[:, :, None] * normal[:, None]
        bend = -(mixed + mixed.transpose(0, 2, 1)) / size[:, None, None]
        bend -= (along / size**2)[:, None, None] * flat
        plane = first[:, None, None] * bend + second[:, None, None] * slope[:, :, None] * slope[:, None]
        axes = np.stack([radial, np.broadcast_to([0.0, 0.0, 1.0], radial.shape)], axis=1)
        out: Floats = np.einsum("nix,nij,njy->nxy", axes, plane, axes)
        # the outward direction turns round the axis
        around = np.stack([-radial[:, 1], radial[:, 0], radial[:, 2]], axis=1)
        turning = first * slope[:, 0] / distance
        out += turning[:, None, None] * around[:, :, None] * around[:, None]
        return out


def _require_apart(gap: float, shift: float) -> None:
    if not shift < gap:
        raise ValueError(f"shift must be less than the gap {gap:g}, or the plates touch; got {shift:g}")


def _direction(away: Floats, shift: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """c·n, c − (c·n) n, n and |x| for places x (n, k) with direction n, and a shift c (k,)."""
    size = np.linalg.norm(away, axis=1)
    normal = away / size[:, None]
    along = normal @ shift
    return along, shift - along[:, None] * normal, normal, size


def _met(along: Floats, radius: float, gap: float, square: float) -> tuple[Floats, Floats, Floats]:
    """d, dd/du and d²d/du² where u + sqrt((r + d0)² − |c|² + u²) = r + d, and u = c·n."""
    root = np.sqrt((radius + gap) ** 2 - square + along**2)
    # root − r − d0 without losing digits
    rest = (along**2 - square) / (root + radius + gap)
    return gap + along + rest, 1.0 + along / root, ((radius + gap) ** 2 - square) / root**3


def _in_space(plane: Floats, radial: Floats) -> Floats:
    """Vectors of the half-plane (n, 2) in space, (n, 3)."""
    out = plane[:, :1] * radial
    out[:, 2] += plane[:, 1]
    return out
