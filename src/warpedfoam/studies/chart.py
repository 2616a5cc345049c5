"""Where the nodes of one bubble lie: rays from its place, brought down to the surface, lifted off it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.lateral_film import FilmGrid
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces import Cylinder, LevelSurface, Surface, Torus

#: Newton steps along an axis to a surface that is known by its nearest points.
STEPS = 30
#: Least cosine between a bubble's axis and the normal at its film.
LEAST_COSINE = 0.3


class OutOfChart(ValueError):
    """A node has no place: the surface turns away from the bubble's axis."""


@dataclass(frozen=True, eq=False)
class Chart:
    """Rays about a point of the surface.

    A point at (radius, angle) is q + radius (cos φ e1 + sin φ e2), moved along the axis n(q) to the surface.

    Attributes
    ----------
    surface : Surface
    origin : (3,) array
        q, a point of the surface.
    frame : (3, 3) array
        Rows e1, e2 and n(q).
    """

    surface: Surface
    origin: Floats
    frame: Floats

    @classmethod
    def at(cls, surface: Surface, point: Floats) -> Chart:
        """The chart about a point of the surface, with the surface's own frame."""
        first, second = surface.vertex_frames(point[None])[0]
        return cls(surface, point, np.stack([first, second, np.cross(first, second)]))

    def nodes(self, grid: FilmGrid, radii: Floats) -> Nodes:
        """All nodes of a bubble whose film has the ``radii`` (L, m).

        Raises
        ------
        OutOfChart
            If a ray does not meet the surface, or meets it at more than about 70 degrees.
        """
        rays = np.cos(grid.angles)[:, None] * self.frame[0] + np.sin(grid.angles)[:, None] * self.frame[1]
        reach = grid.scales[:, None, None] * radii
        shape = (*reach.shape, 3)
        axis = self.frame[2]
        foot = self._foot((self.origin + reach[..., None] * rays).reshape(-1, 3))
        if not np.isfinite(foot).all():
            raise OutOfChart
        e = self.surface.vertex_frames(foot)
        normal = np.cross(e[:, 0], e[:, 1])
        if (normal @ axis).min() < LEAST_COSINE:
            raise OutOfChart
        normals = normal.reshape(shape)
        bend = self.surface.shape_operators(foot, project=False).reshape(*shape, 3)
        slant = np.einsum("ikjx,jx->ikj", normals, rays) / (normals @ axis)
        flat = rays - slant[..., None] * axis
        turned = np.einsum("ikjxy,ikjy->ikjx", bend, flat)
        heights = grid.heights[:, None, None]
        moves = flat + heights * turned
        return Nodes(
            foot.reshape(shape) + heights * normals,
            moves,
            normals[-1],
            -np.einsum("kjx,kjx->kj", turned[-1], moves[-1]),
        )

    def _foot(self, points: Floats) -> Floats:
        axis = self.frame[2]
        if isinstance(self.surface, LevelSurface):
            return self.surface.foot(points, np.broadcast_to(axis, points.shape))
        out = points.copy()
        for _ in range(STEPS):
            near = self.surface.project(out)
            e = self.surface.vertex_frames(near)
            normal = np.cross(e[:, 0], e[:, 1])
            slope = normal @ axis
            if slope.min() < 0.1:
                raise OutOfChart
            # the distance from the surface has the normal for its gradient
            step = np.einsum("nx,nx->n", out - near, normal) / slope
            out -= step[:, None] * axis
            if np.abs(step).max() <= 1e-8 * self.surface.size:
                return out
        raise OutOfChart


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes and what the film's kernels need.

    ``points`` and ``moves`` = dX/dρ per unit of the film's radius at the film (I, L, m, 3); ``normals``
    (L, m, 3) and ``bends`` = n · d²X/dρ² (L, m) at the film.
    """

    points: Floats
    moves: Floats
    normals: Floats
    bends: Floats


#: Two coordinates (2, n) about the bubble's place and their gradients (2, n, 3) at points (n, 3).
Coordinates = Callable[[Floats], tuple[Floats, Floats]]


def angle_coordinates(chart: Chart) -> Coordinates | None:
    """Lengths that go with the angles of a torus or a cylinder; None for surfaces without angles.

    On a torus r (φ − φ0) and the ring's angle times R + r cos φ0, along e1 and e2; on a cylinder the angle
    times its radius, and the height. Their mean over a bubble vanishes where its mean angles are those of q.
    """
    surface, origin, frame = chart.surface, chart.origin, chart.frame
    if isinstance(surface, Torus):
        ring, tube = surface.major_radius, surface.minor_radius
        (phi0,), (theta0,) = surface.angles(origin[None])
        out0 = ring + tube * np.cos(phi0)

        def on_torus(points: Floats) -> tuple[Floats, Floats]:
            phi, theta = surface.angles(points)
            out = np.hypot(points[:, 0], points[:, 1])
            depth = np.hypot(out - ring, points[:, 2])
            e = surface.vertex_frames(points)
            values = np.stack([tube * _turned(phi - phi0), -out0 * _turned(theta - theta0)])
            return values, np.stack([(tube / depth)[:, None] * e[:, 0], (out0 / out)[:, None] * e[:, 1]])

        return on_torus
    if isinstance(surface, Cylinder):
        radius = surface.radius
        start = np.arctan2(origin[1], origin[0])
        along = np.array([-np.sin(start), np.cos(start), 0.0])
        # shares of (e_θ, e_z) in e1 and e2
        mix = np.stack([frame[:2] @ along, frame[:2, 2]], axis=1)

        def on_cylinder(points: Floats) -> tuple[Floats, Floats]:
            x, y, z = points.T
            square = x * x + y * y
            turn = radius * _turned(np.arctan2(y, x) - start)
            slope = radius * np.stack([-y / square, x / square, np.zeros_like(x)], axis=1)
            up = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
            values = mix @ np.stack([turn, z - origin[2]])
            return values, np.einsum("ab,bnx->anx", mix, np.stack([slope, up]))

        return on_cylinder
    return None


def tangent_coordinates(chart: Chart) -> Coordinates:
    """(X − q) · e1 and (X − q) · e2: their means vanish where the centroid's nearest point is q."""
    first_two = chart.frame[:2]

    def in_tangent_plane(points: Floats) -> tuple[Floats, Floats]:
        values = first_two @ (points - chart.origin).T
        return values, np.broadcast_to(first_two[:, None], (2, *points.shape))

    return in_tangent_plane


def _turned(angle: Floats) -> Floats:
    out: Floats = nearest_image(angle[..., None], np.array([2.0 * np.pi]))[..., 0]
    return out
