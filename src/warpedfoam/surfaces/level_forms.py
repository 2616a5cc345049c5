"""Closed-form surfaces once more, as level sets: for what needs the arcs of `LevelSurface`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.loops import Loops
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import Layer, Surface
from warpedfoam.surfaces.sphere import Sphere
from warpedfoam.surfaces.torus import Torus


def as_level(surface: Surface) -> LevelSurface:
    """The surface as the zero set of a function.

    Raises
    ------
    TypeError
        If no such function is known.

    Examples
    --------
    >>> import numpy as np
    >>> as_level(Sphere(2.0)).level(np.array([[0.0, 3.0, 4.0]]), second=False)[0]
    array([5.25])
    """
    if isinstance(surface, LevelSurface):
        return surface
    if isinstance(surface, (Sphere, Torus)):
        return _LevelForm(surface)
    raise TypeError(f"no level set is known for {type(surface).__name__}; derive it from LevelSurface")


@dataclass(frozen=True)
class _LevelForm(LevelSurface):
    """(|x|² − r²)/2r of a sphere, ((q − R)² + z² − r²)/2r of a torus, q the distance from its axis."""

    closed: Sphere | Torus

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """f and its derivatives."""
        eye = np.eye(3)
        if isinstance(self.closed, Sphere):
            r = self.closed.radius
            value = 0.5 * ((points**2).sum(axis=1) / r - r)
            bend = np.broadcast_to(eye / r, (len(points), 3, 3)) if second else None
            return value, points / r, bend
        ring, r = self.closed.major_radius, self.closed.minor_radius
        with np.errstate(divide="ignore", invalid="ignore"):
            out = np.hypot(points[:, 0], points[:, 1])
            share = 1.0 - ring / out
            value = 0.5 * (((out - ring) ** 2 + points[:, 2] ** 2) / r - r)
            gradient = points * np.stack([share, share, np.ones_like(share)], axis=1) / r
            if not second:
                return value, gradient, None
            radial = points * [1.0, 1.0, 0.0] / out[:, None]
            flat = np.diag([1.0, 1.0, 0.0])
            bend = share[:, None, None] * flat + (1.0 - share)[:, None, None] * (
                radial[:, :, None] * radial[:, None]
            )
        bend[:, 2, 2] = 1.0
        return value, gradient, bend / r

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """That of the surface."""
        return self.closed.triangulate(n_nodes)

    def integral(self, layer: Layer) -> float:
        """That of the surface, exact."""
        return self.closed.integral(layer)

    def loop_integrals(
        self, tail: Floats, head: Floats, offsets: Floats, loops: Loops, layer: Layer
    ) -> Floats:
        """On a torus those of its one-form: bubbles that reach round the tube are no fans."""
        if not isinstance(self.closed, Torus):
            return super().loop_integrals(tail, head, offsets, loops, layer)
        placed = self._arcs(tail, head, offsets)
        x = placed.points
        tube = np.arctan2(x[..., 2], np.hypot(x[..., 0], x[..., 1]) - self.closed.major_radius)
        ring = np.unwrap(np.arctan2(x[..., 1], x[..., 0]), axis=0)
        slope, turned = placed.rule.derivative @ ring, ring[-1] - ring[0]
        return self.closed.round_loops(placed.rule, np.unwrap(tube, axis=0), slope, turned, loops, layer)

    def rigid_motions(self, points: Floats) -> Floats:
        """Those of the surface, exact."""
        return self.closed.rigid_motions(points)

    @property
    def size(self) -> float:
        """That of the surface."""
        return self.closed.size

    @property
    def euler_characteristic(self) -> int:
        """That of the surface."""
        return self.closed.euler_characteristic
