"""The sphere: films in a frame of their own great circle, volumes by spherical triangles and lunes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, Ints, as_generator, as_integer, as_number, as_points, frozen
from warpedfoam.kernels import sphere_arcs as arcs
from warpedfoam.kernels.loops import Loops
from warpedfoam.kernels.nodal import bump_offsets, shape_values
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.surfaces.icosphere import icosphere
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import SIZES, ArcTerms, Layer

GOLDEN = (1.0 + np.sqrt(5.0)) / 2.0


@dataclass(frozen=True)
class Sphere:
    """Sphere of radius r about the origin, normals outward: k1 = k2 = 1/r, G = 1/r².

    Parameters
    ----------
    radius : float
        r > 0, in the user's unit of length.

    Raises
    ------
    TypeError, ValueError
        If ``radius`` is not a finite number above 0 (1e-60 … 1e60, so that its powers are finite).

    Examples
    --------
    >>> sphere = Sphere(radius=2.0)
    >>> sphere.gaussian_curvature([[0.0, 0.0, 5.0]])
    array([0.25])
    >>> sphere.euler_characteristic
    2
    """

    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", as_number(self.radius, "radius", positive=True, **SIZES))

    @property
    def area(self) -> float:
        """4 π r²."""
        return 4.0 * np.pi * self.radius**2

    @property
    def size(self) -> float:
        """r."""
        return self.radius

    @property
    def euler_characteristic(self) -> int:
        """χ = 2."""
        return 2

    @property
    def period(self) -> Floats | None:
        """It does not repeat."""
        return None

    @property
    def precision(self) -> float:
        """Loop integrals are exact."""
        return 1e-6

    @property
    def mesh(self) -> TriangleMesh:
        """A triangulation with about 10 000 nodes."""
        return self.triangulate(10_000)

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """Subdivided icosahedron: 10 m² + 2 nodes for the m whose count is nearest to ``n_nodes``."""
        count = as_integer(n_nodes, "n_nodes", minimum=12)
        return _sphere_mesh(self.radius, max(1, round(float(np.sqrt((count - 2) / 10.0)))))

    def project(self, points: ArrayLike) -> Floats:
        """r x / |x|.

        Raises
        ------
        ValueError
            If a point is the centre, which has no nearest point.
        """
        return self.radius * self.normals(points)

    def normals(self, points: ArrayLike) -> Floats:
        """x / |x|."""
        x = as_points(points, "points", minimum=0)
        norm = np.linalg.norm(x, axis=1, keepdims=True)
        if (norm <= 1e-12 * self.radius).any():
            raise ValueError("points must not hold the sphere's centre: it has no nearest point")
        out: Floats = x / norm
        return out

    def principal_curvatures(self, points: ArrayLike) -> Floats:
        """(1/r, 1/r) at each point."""
        return np.full((len(as_points(points, "points", minimum=0)), 2), 1.0 / self.radius)

    def gaussian_curvature(self, points: ArrayLike) -> Floats:
        """1/r² at each point."""
        return np.full(len(as_points(points, "points", minimum=0)), self.radius**-2)

    def shape_operators(self, points: ArrayLike, *, project: bool = True) -> Floats:  # noqa: ARG002
        """(I − nnᵀ)/r."""
        n = self.normals(points)
        return (np.eye(3) - n[:, :, None] * n[:, None]) / self.radius

    def curvature_range(self) -> tuple[float, float]:
        """(1/r, 1/r)."""
        return 1.0 / self.radius, 1.0 / self.radius

    def _factor(self, layer: Layer) -> float:
        """(c0 + c1 H + c2 G) r²: integrals are this times the solid angle."""
        c0, c1, c2 = layer.steiner
        return c0 * self.radius**2 + c1 * self.radius + c2

    def _lift(self, layer: Layer) -> float:
        """Σ shares (r + t): measures are this times the arc's angle."""
        return float(layer.shares @ (self.radius + layer.heights))

    def integral(self, layer: Layer) -> float:
        """4 π (c0 r² + c1 r + c2)."""
        return 4.0 * np.pi * self._factor(layer)

    def random_points(self, count: int, rng: object) -> Floats:
        """Normalised Gaussian vectors."""
        n = as_integer(count, "count", minimum=0)
        return self.project(as_generator(rng, "rng").standard_normal((n, 3)))

    def lattice_points(self, count: int) -> Floats:
        """Fibonacci spiral: heights evenly spaced, longitudes by the golden angle."""
        n = as_integer(count, "count", minimum=1)
        z = 1.0 - (2.0 * np.arange(n) + 1.0) / n
        angle = 2.0 * np.pi * np.arange(n) / GOLDEN
        rho = np.sqrt(1.0 - z * z)
        return self.radius * np.stack([rho * np.cos(angle), rho * np.sin(angle), z], axis=1)

    def vertex_frames(self, points: Floats) -> Floats:
        """Tangent vectors e1, e2 with e1 × e2 = n, from the axis least aligned with n."""
        n = points / self.radius
        axis = np.eye(3)[np.argmin(np.abs(n), axis=1)]
        first = np.cross(axis, n)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return np.stack([first, np.cross(n, first)], axis=1)

    def retract(self, points: Floats, steps: Floats) -> Floats:
        """Add the tangent step, then project."""
        moved = points + np.einsum("vi,vij->vj", steps, self.vertex_frames(points))
        out: Floats = moved * (self.radius / np.linalg.norm(moved, axis=1, keepdims=True))
        return out

    def rigid_motions(self, points: Floats) -> Floats:
        """The three rotations ω × x."""
        return np.stack([np.cross(axis, points) for axis in np.eye(3)])

    def arc_measure(self, tail: Floats, head: Floats, offsets: Floats, layer: Layer) -> Floats:
        """Angle of each arc times Σ shares (r + t)."""
        length, _, _, _ = arcs.geodesic_frame(tail / self.radius, head / self.radius)
        rule = lobatto(offsets.shape[1] + 1)
        return self._lift(layer) * arcs.arc_length_and_lune(rule, length, offsets.T)[0]

    def arc_terms(
        self,
        tail: Floats,
        head: Floats,
        offsets: Floats,
        layer: Layer,
        *,
        tension: float,
        jump: Floats | None,
    ) -> ArcTerms:
        """Closed forms of `warpedfoam.kernels.sphere_arcs`, scaled to the radius and the layer."""
        rule = lobatto(offsets.shape[1] + 1)
        lift, factor, r = self._lift(layer), self._factor(layer), self.radius
        a, b, u = tail / r, head / r, offsets.T
        length, left, ta, tb = arcs.geodesic_frame(a, b)
        frame_a, frame_b = self.vertex_frames(tail), self.vertex_frames(head)
        bases = (
            np.einsum("fij,fj->if", frame_a, ta),
            np.einsum("fij,fj->if", frame_a, left),
            np.einsum("fij,fj->if", frame_b, tb),
            np.einsum("fij,fj->if", frame_b, left),
        )
        angle, by_length, by_lune = arcs.arc_gradients(rule, length, u)
        tau = np.concatenate([-bases[0], bases[2]]) / r
        sweep = np.tan(0.5 * length) * np.concatenate([bases[1], bases[3]]) / r
        gradient = lift * np.concatenate([by_length[0] * tau, by_length[1:]])
        volume = -factor * np.concatenate([by_lune[0] * tau + sweep, by_lune[1:]])
        hessian = None
        if jump is not None:
            pressure = factor * jump
            inner = arcs.arc_hessian(rule, length, u, tension * lift, pressure)
            slope = tension * lift * by_length[0] + pressure * by_lune[0]
            n = len(gradient)
            hessian = np.empty((n, n, len(length)))
            ends = arcs.vertex_hessian(length, bases, slope, inner[0, 0], pressure)
            hessian[:4, :4] = ends / r**2
            mixed = tau[:, None] * inner[0, 1:][None]
            hessian[:4, 4:] = mixed
            hessian[4:, :4] = mixed.transpose(1, 0, 2)
            hessian[4:, 4:] = inner[1:, 1:]
        return ArcTerms(lift * angle, gradient, volume, hessian)

    def arc_points(self, tail: Floats, head: Floats, offsets: Floats, xi: Floats) -> Floats:
        """Points at longitude ξ L and latitude L v(ξ) over the great circle of the ends."""
        r = self.radius
        length, left, ta, _ = arcs.geodesic_frame(tail / r, head / r)
        rule = lobatto(offsets.shape[1] + 1)
        values, _ = shape_values(rule, offsets.T)
        beta = (length * (rule.interpolation(xi) @ values)).T[..., None]
        along = (length[:, None] * xi)[..., None]
        flat = np.cos(along) * (tail / r)[:, None] + np.sin(along) * ta[:, None]
        return r * (np.cos(beta) * flat + np.sin(beta) * left[:, None])

    def arc_fit(self, tail: Floats, head: Floats, arc: Ints, points: Floats, order: int) -> Floats:
        """Least-squares bump 4 s ξ (1 − ξ) through the points' longitudes and latitudes."""
        r = self.radius
        length, left, ta, _ = arcs.geodesic_frame(tail / r, head / r)
        x = points / r
        xi = np.arctan2((x * ta[arc]).sum(1), (x * tail[arc]).sum(1) / r) / length[arc]
        lift = np.arcsin(np.clip((x * left[arc]).sum(1), -1.0, 1.0)) / length[arc]
        return bump_offsets(arc, xi, lift, len(tail), order)

    def loop_integrals(
        self, tail: Floats, head: Floats, offsets: Floats, loops: Loops, layer: Layer
    ) -> Floats:
        """Spherical triangles about each loop's middle, plus the lunes: a whole foam sums to 4π exactly."""
        a, b = tail / self.radius, head / self.radius
        length, _, _, _ = arcs.geodesic_frame(a, b)
        _, lune = arcs.arc_length_and_lune(lobatto(offsets.shape[1] + 1), length, offsets.T)
        film, back = loops.halves >> 1, (loops.halves & 1).astype(bool)
        start = np.where(back[:, None], b[film], a[film])
        end = np.where(back[:, None], a[film], b[film])
        c = np.repeat(_middles(start, end, length[film], loops), loops.sizes, axis=0)
        # from differences: the triple product of three near points would lose its digits
        volume = np.einsum("hi,hi->h", c, np.cross(start - c, end - c))
        dots = np.einsum("hi,hi->h", start, end) + np.einsum("hi,hi->h", c, start + end)
        solid = 2.0 * np.arctan2(volume, 1.0 + dots) + np.where(back, lune[film], -lune[film])
        inside: Floats = np.add.reduceat(solid, loops.starts)
        if abs(inside.sum()) < 1.0:
            # one region is larger than the rest together: its middle lies outside it
            inside[np.argmin(inside)] += 4.0 * np.pi
        return self._factor(layer) * inside


def _middles(start: Floats, end: Floats, length: Floats, loops: Loops) -> Floats:
    """A unit vector in the middle of each loop, (n_loops, 3).

    The mean of the loop's points, whichever way it runs, so that a bubble turned inside out has a
    negative area; for loops near a great circle, whose mean is no direction, the vector area.
    """
    weight = np.maximum(length, 1e-300)[:, None]
    total = np.add.reduceat(weight, loops.starts, axis=0)
    mean = np.add.reduceat(0.5 * weight * (start + end), loops.starts, axis=0) / total
    normal = np.add.reduceat(np.cross(start, end), loops.starts, axis=0)
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    chosen = np.where(size > 0.3, mean, normal)
    norm = np.linalg.norm(chosen, axis=1, keepdims=True)
    out: Floats = np.where(norm > 0.0, chosen / np.where(norm > 0.0, norm, 1.0), [0.0, 0.0, 1.0])
    return out


@lru_cache(maxsize=4)
def _sphere_mesh(radius: float, frequency: int) -> TriangleMesh:
    nodes, triangles = icosphere(frequency)
    return TriangleMesh(frozen(radius * nodes), triangles)
