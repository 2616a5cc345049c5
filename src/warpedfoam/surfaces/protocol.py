"""What a surface must offer to carry a foam.

A surface knows points and *arcs* (curves between two of its points), not foams. `Layer` says what is
measured along an arc and inside a loop of arcs, so that one set of formulas gives lengths and areas on
the surface, film areas and volumes between plates, and integrated curvature.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, Ints, frozen
from warpedfoam.kernels.gap_films import Thickness
from warpedfoam.kernels.loops import Loops
from warpedfoam.kernels.quadrature import gauss
from warpedfoam.surfaces.gap_field import Profile
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.rim import Rim

#: Range of the lengths that describe a surface: beyond it their powers leave floating point.
SIZES = {"minimum": 1e-60, "maximum": 1e60}


@dataclass(frozen=True, eq=False)
class Layer:
    """Heights above the surface at which arcs are measured, and Steiner's coefficients of volumes.

    Along an arc: Σ_t shares_t · length of the arc lifted to height t. Inside a loop:
    ∫ (c0 + c1 H + c2 G) dA with ``steiner`` = (c0, c1, c2), by ``rays`` Gauss points from the centre to
    the rim on surfaces without closed forms (2 for a draft).

    With a ``profile`` p(x), which `LevelSurface` alone can take, heights and shares are those of the mean gap
    and stretch by p, and the integrand is p c0 + p² c1 H + p³ c2 G.
    """

    heights: Floats
    shares: Floats
    steiner: tuple[float, float, float]
    rays: int = 6
    profile: Profile | None = None

    @classmethod
    def surface(cls) -> Layer:
        """Lengths and areas on the surface itself."""
        return cls(frozen(np.zeros(1)), frozen(np.ones(1)), (1.0, 0.0, 0.0))

    @classmethod
    def curvature(cls) -> Layer:
        """Lengths on the surface, and ∫ G dA inside a loop."""
        return cls(frozen(np.zeros(1)), frozen(np.ones(1)), (0.0, 0.0, 1.0))

    @classmethod
    def between_plates(cls, gap: float, n_heights: int = 2) -> Layer:
        """Ruled film areas by Gauss quadrature through the gap d, and volumes d + H d² + G d³/3."""
        heights, shares = gauss(n_heights)
        return cls(frozen(gap * heights), frozen(gap * shares), (gap, gap**2, gap**3 / 3.0))

    def density(self, points: Floats, mean: Floats, gauss: Floats) -> Floats:
        """The integrand c0 + c1 H + c2 G, at points (…, 3) of the surface with curvatures (…)."""
        c0, c1, c2 = self.steiner
        if self.profile is None:
            return c0 + c1 * mean + c2 * gauss
        p = self.profile.values(points)
        out: Floats = p * (c0 + p * (c1 * mean + p * (c2 * gauss)))
        return out

    def density_slope(self, thickness: Thickness, shapes: Floats, slopes: Floats) -> Floats:
        """∇ of the integrand along the surface, (…, 3), from p, W (…, 3, 3) and ∂_a W (…, 3, 3, 3)."""
        c0, c1, c2 = self.steiner
        p, trace = thickness.value, np.einsum("...xx->...", shapes)
        by_trace = np.einsum("...axx->...a", slopes)
        square = np.einsum("...xy,...xy->...", shapes, shapes)
        by_square = np.einsum("...axy,...xy->...a", slopes, shapes)
        by_p = c0 + p * (c1 * trace + p * (1.5 * c2 * (trace**2 - square)))
        bent: Floats = (0.5 * c1 * p**2)[..., None] * by_trace
        bent += (c2 * p**3)[..., None] * (trace[..., None] * by_trace - by_square)
        bent += by_p[..., None] * thickness.gradient
        return bent


@dataclass(frozen=True, eq=False)
class ArcTerms:
    """Value and derivatives of arcs by (A₁, A₂, B₁, B₂, u_1 … u_{p−1}); arcs on the last axis.

    ``measure`` (F,) is the arc's measure, ``gradient`` (p + 3, F) its derivative, ``volume`` (p + 3, F)
    the derivative of the integral over the region left of the arc, and ``hessian`` (p + 3, p + 3, F),
    if asked for, that of tension · measure − jump · (integral on the left). The volume derivatives leave
    out what cancels round every closed loop of arcs, and the Hessian is symmetrised accordingly: both are
    right when summed over closed loops, not arc by arc.
    """

    measure: Floats
    gradient: Floats
    volume: Floats
    hessian: Floats | None


@runtime_checkable
class Surface(Protocol):
    """A smooth oriented surface; normals point into the gap and W = +I/r on a sphere of radius r."""

    @property
    def area(self) -> float:
        """Total area."""
        ...

    @property
    def euler_characteristic(self) -> int:
        """χ."""
        ...

    @property
    def mesh(self) -> TriangleMesh:
        """A triangulation for geodesics and pictures."""
        ...

    @property
    def size(self) -> float:
        """Radius of a ball round the origin that holds the surface; the scale of round-off."""
        ...

    @property
    def period(self) -> Floats | None:
        """Lengths (3,) after which the surface repeats along x, y, z, infinite where it does not; or None."""
        ...

    @property
    def rim(self) -> Rim | None:
        """Where the surface ends and films may, or None."""
        ...

    @property
    def precision(self) -> float:
        """Relative error that loop integrals may show on a sound foam: round-off, or that of quadrature."""
        ...

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """A triangulation with about ``n_nodes`` nodes, all on the surface."""
        ...

    def project(self, points: ArrayLike) -> Floats:
        """Nearest points of the surface, (n, 3)."""
        ...

    def normals(self, points: ArrayLike) -> Floats:
        """Unit normals at the projections of the points, (n, 3)."""
        ...

    def principal_curvatures(self, points: ArrayLike) -> Floats:
        """Eigenvalues (k1, k2) of W = dn, (n, 2)."""
        ...

    def gaussian_curvature(self, points: ArrayLike) -> Floats:
        """G = k1 k2, (n,)."""
        ...

    def shape_operators(self, points: ArrayLike, *, project: bool = True) -> Floats:
        """W = dn as symmetric matrices (n, 3, 3), W n = 0; ``project=False`` for points that lie on it."""
        ...

    def curvature_range(self) -> tuple[float, float]:
        """Least and greatest principal curvature anywhere on the surface."""
        ...

    def integral(self, layer: Layer) -> float:
        """∫ (c0 + c1 H + c2 G) dA over the whole surface."""
        ...

    def random_points(self, count: int, rng: object) -> Floats:
        """Points drawn uniformly by area, (count, 3)."""
        ...

    def lattice_points(self, count: int) -> Floats:
        """An even, deterministic arrangement (a Fibonacci spiral or a rank-1 lattice), (count, 3)."""
        ...

    def vertex_frames(self, points: Floats) -> Floats:
        """Orthonormal tangent vectors at points of the surface, (n, 2, 3)."""
        ...

    def retract(self, points: Floats, steps: Floats) -> Floats:
        """Points moved by tangent ``steps`` (n, 2) in `vertex_frames`, back on the surface."""
        ...

    def rigid_motions(self, points: Floats) -> Floats:
        """Velocity fields of the surface's continuous symmetries at the points, (k, n, 3)."""
        ...

    def arc_measure(self, tail: Floats, head: Floats, offsets: Floats, layer: Layer) -> Floats:
        """Measure of each arc from ``tail`` (F, 3) to ``head`` with ``offsets`` (F, p − 1)."""
        ...

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
        """Measures and derivatives; the Hessian too if ``jump`` (F,), left minus right, is given."""
        ...

    def arc_points(self, tail: Floats, head: Floats, offsets: Floats, xi: Floats) -> Floats:
        """Points of each arc at the parameters ``xi`` (m,) in [0, 1], (F, m, 3)."""
        ...

    def arc_fit(self, tail: Floats, head: Floats, arc: Ints, points: Floats, order: int) -> Floats:
        """Offsets (F, p − 1) of the parabola-shaped arcs nearest to points (m, 3) of arcs (m,)."""
        ...

    def loop_integrals(
        self, tail: Floats, head: Floats, offsets: Floats, loops: Loops, layer: Layer
    ) -> Floats:
        """∫ (c0 + c1 H + c2 G) dA inside each loop, (n_loops,)."""
        ...
