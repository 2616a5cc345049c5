"""`LevelSurface`: everything a foam needs, on the zero set of a smooth function."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Bools, Floats, Ints, as_generator, as_integer, as_points, frozen
from warpedfoam.kernels import height_arcs as arcs
from warpedfoam.kernels.fans import fan_integrals
from warpedfoam.kernels.gap_films import swept_change, varied_measure, varied_terms
from warpedfoam.kernels.jets import frames_of
from warpedfoam.kernels.loops import Loops
from warpedfoam.kernels.nodal import bump_offsets
from warpedfoam.kernels.periodic import loop_shifts, nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.kernels.shapes import bent_mean_gauss, mean_gauss, normal_shape
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.patches import PatchedMesh, Quadrature
from warpedfoam.surfaces.places import Places, spread_out
from warpedfoam.surfaces.protocol import ArcTerms, Layer
from warpedfoam.surfaces.rim import Rim, with_walls

#: Newton steps along a line to the surface, steps to the nearest point.
LINE_STEPS, NEAREST_STEPS = 12, 200
#: Rounds of the even lattice.
LATTICE_ROUNDS = 40
#: Step of the differences of shape operators, in sizes.
SLOPE_STEP = 1e-4

#: f, its gradient and, if asked for, second derivatives, at new places of some points of `LevelSurface.near`.
Look = Callable[[Floats, "Ints | slice", bool], tuple[Floats, Floats, Floats | None]]


class LevelSurface(ABC):
    """Base of surfaces given by f = 0, with f growing outwards (into the gap).

    A subclass provides `level`, `triangulate`, `size` and `euler_characteristic`; all else follows:
    n = ∇f/|∇f|, W = (I − nnᵀ) ∇²f (I − nnᵀ)/|∇f|. Films are `warpedfoam.kernels.height_arcs`, volumes
    `warpedfoam.kernels.fans`, whole integrals are summed over a fine mesh. A surface that ends somewhere
    provides `rim_loops` too: f = 0 goes on a little beyond, the surface does not.
    """

    #: Squared share of the normal component below which a rigid motion is a symmetry.
    symmetry = 1e-13
    #: Nodes of the mesh that carries integrals over the whole surface.
    integral_nodes = 10_000

    @abstractmethod
    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """f (n,), its gradient (n, 3), and its second derivatives (n, 3, 3) if asked for."""

    def near(self, points: Floats) -> Look:  # noqa: ARG002
        """`level` for points that will move a little: whatever can be found once is found here."""
        return lambda places, _, second: self.level(places, second=second)

    def least_rays(self, n_loops: int) -> int:  # noqa: ARG002
        """Fewest points on a ray from the centre of one of ``n_loops`` loops that resolve the surface."""
        return 0

    @abstractmethod
    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """A triangulation with about ``n_nodes`` nodes, all on the surface."""

    @property
    @abstractmethod
    def size(self) -> float:
        """Radius of a ball round the origin that holds the surface."""

    @property
    @abstractmethod
    def euler_characteristic(self) -> int:
        """χ."""

    @property
    def period(self) -> Floats | None:
        """It does not repeat."""
        return None

    def rim_loops(self) -> Sequence[Sequence[Floats]]:
        """Points along the smooth sides of each loop of the rim, see `Rim`; none for a closed surface."""
        return ()

    @cached_property
    def rim(self) -> Rim | None:
        """Where the surface ends, or None."""
        loops = self.rim_loops()
        return Rim(loops, lambda x: self.foot(x, self._unit(x)), self._unit) if len(loops) else None

    def beyond(self, points: Floats) -> Bools:
        """Which points of f = 0 lie beyond the rim: by its nearest point, unless a subclass knows better."""
        if self.rim is None:
            return np.zeros(len(points), dtype=np.bool_)
        return self.rim.beyond(points)

    @property
    def precision(self) -> float:
        """Relative error that loop integrals may show on a sound foam."""
        return 1e-3

    @property
    def mesh(self) -> TriangleMesh:
        """A triangulation with about 10 000 nodes."""
        return self.triangulate(self.integral_nodes)

    @cached_property
    def area(self) -> float:
        """Total area."""
        return self.integral(Layer.surface())

    # --- points -----------------------------------------------------------------------------------

    def foot(self, points: Floats, axes: Floats) -> Floats:
        """The points moved along their axes to the surface; NaN where a line does not meet it."""
        out = points.copy()
        live = np.arange(len(points))
        scale, look = self.size, self.near(points)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for _ in range(LINE_STEPS):
                value, gradient, _ = look(out[live], live, False)
                step = value / arcs.dots(gradient, axes[live])
                step = np.clip(step, -0.2 * scale, 0.2 * scale)
                out[live] -= step[:, None] * axes[live]
                # a step leaves an error of its square
                live = live[~(np.abs(step) <= 1e-8 * scale)]
                if not live.size:
                    return out
        out[live] = np.nan
        return out

    def project(self, points: ArrayLike) -> Floats:
        """Nearest points of the surface: x = p − (p − x)·n n, then down to the surface, until it stays.

        What lands beyond a rim goes to the rim.

        Raises
        ------
        ValueError
            If a point is so far away that it has no clear nearest point.
        """
        found = self._nearest(as_points(points, "points", minimum=0))
        if self.rim is not None and len(found):
            far = self.beyond(found)
            if far.any():
                found[far] = self.rim.nearest(found[far])
        return found

    def _nearest(self, p: Floats) -> Floats:
        """Nearest points of f = 0."""
        x = p.copy()
        live, look = np.arange(len(p)), self.near(p)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for _ in range(NEAREST_STEPS):
                value, gradient, _ = look(x[live], live, False)
                square = arcs.dots(gradient, gradient)
                # first order: the foot of p on the tangent plane of the level set through x, moved to f = 0
                ahead = p[live] - x[live]
                lift = (arcs.dots(ahead, gradient) + value) / square
                move = ahead - lift[:, None] * gradient
                span = np.linalg.norm(move, axis=1)
                move *= np.minimum(1.0, 0.1 * self.size / np.maximum(span, 1e-300))[:, None]
                x[live] += move
                live = live[~(span <= 1e-14 * self.size)]
                if not live.size:
                    return x
        value, gradient, _ = self.level(x[live], second=False)
        far = ~(np.abs(value) <= 1e-10 * self.size * np.linalg.norm(gradient, axis=1))
        far |= ~(span[~(span <= 1e-14 * self.size)] <= 1e-8 * self.size)
        if far.any():
            raise ValueError(
                f"points must lie near the surface, but point {int(live[far][0])} has no clear nearest point "
                "on it"
            )
        return x

    def _unit(self, points: Floats) -> Floats:
        _, gradient, _ = self.level(points, second=False)
        out: Floats = gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
        return out

    def _shape(self, points: Floats) -> tuple[Floats, Floats]:
        """Normals (n, 3) and shape operators (n, 3, 3) at points of the surface."""
        _, gradient, second = self.level(points, second=True)
        assert second is not None
        return normal_shape(gradient, second)

    def _shape_slopes(self, points: Floats, normals: Floats) -> Floats:
        """∂_a W along the surface at points (…, 3) of it, (…, 3, 3, 3), by central differences."""
        frames, h = frames_of(normals.reshape(-1, 3)), SLOPE_STEP * self.size
        out = np.zeros((len(frames), 3, 3, 3))
        for e in (frames[:, 0], frames[:, 1]):
            ahead, behind = (self._shape(points.reshape(-1, 3) + s * h * e)[1] for s in (1.0, -1.0))
            out += e[:, :, None, None] * ((ahead - behind) / (2.0 * h))[:, None]
        return out.reshape(*points.shape, 3, 3)

    def _settled(self, points: Floats, axes: Floats) -> tuple[Floats, Floats, Floats]:
        """Where lines from near points meet the surface, normals and shape operators there."""
        found, gradient, second = self._landed(points, axes, second=True)
        assert second is not None
        return found, *normal_shape(gradient, second)

    def _landed(self, points: Floats, axes: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """Where lines from near points meet the surface, to about 1e-9; ∇f and ∇²f there.

        A step or two and a look at where they led; only lines that are not there yet go on.
        """
        near, live, scale = points.copy(), np.arange(len(points)), self.size
        look = self.near(points)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for _ in range(2):
                value, gradient, _ = look(near[live], live, False)
                step = np.clip(value / arcs.dots(gradient, axes[live]), -0.2 * scale, 0.2 * scale)
                near[live] -= step[:, None] * axes[live]
                live = live[~(np.abs(step) <= 3e-5 * scale)]
                if not live.size:
                    break
            value, gradient, bend = look(near, slice(None), second)
            left = value / arcs.dots(gradient, axes)
            late = np.flatnonzero(~(np.abs(left) <= 1e-9 * scale))
            if late.size:
                near[late], left[late] = self.foot(near[late], axes[late]), 0.0
                _, gradient[late], again = self.level(near[late], second=second)
                if bend is not None and again is not None:
                    bend = np.array(bend)
                    bend[late] = again
        # the look's own step costs nothing more
        return near - left[:, None] * axes, gradient, bend

    def normals(self, points: ArrayLike) -> Floats:
        """∇f/|∇f| at the projections of the points."""
        return self._unit(self.project(points))

    def principal_curvatures(self, points: ArrayLike) -> Floats:
        """Eigenvalues of W in the tangent plane, the larger one first."""
        _, shape = self._shape(self.project(points))
        mean, gauss = mean_gauss(shape)
        root = np.sqrt(np.maximum(mean**2 - gauss, 0.0))
        return np.stack([mean + root, mean - root], axis=1)

    def gaussian_curvature(self, points: ArrayLike) -> Floats:
        """G = k1 k2."""
        _, shape = self._shape(self.project(points))
        return mean_gauss(shape)[1]

    def shape_operators(self, points: ArrayLike, *, project: bool = True) -> Floats:
        """W = (I − nnᵀ) ∇²f (I − nnᵀ)/|∇f|; without ``project`` that of the level set through each point."""
        return self._shape(self.project(points) if project else as_points(points, "points", minimum=0))[1]

    # --- the whole surface ------------------------------------------------------------------------

    @cached_property
    def _patches(self) -> PatchedMesh:
        fine = self.triangulate(self.integral_nodes)
        return PatchedMesh(fine, self._settled, self._unit, self.rim, self.beyond)

    def quadrature(self) -> Quadrature:
        """A rule for integrals over the whole surface, on a fine mesh."""
        return self._patches.quadrature()

    @cached_property
    def _moments(self) -> tuple[float, float, float, float, float]:
        """∫ dA, ∫ H dA, ∫ G dA, and the range of the principal curvatures."""
        rule = self._patches.quadrature()
        mean, gauss = mean_gauss(rule.shapes)
        weights = rule.weights
        root = np.sqrt(np.maximum(mean**2 - gauss, 0.0))
        return (
            float(weights.sum()),
            float(weights @ mean),
            float(weights @ gauss),
            float((mean - root).min()),
            float((mean + root).max()),
        )

    def integral(self, layer: Layer) -> float:
        """∫ (c0 + c1 H + c2 G) dA by Gauss quadrature over a fine mesh."""
        if layer.profile is None:
            return float(np.dot(layer.steiner, self._moments[:3]))
        rule = self.quadrature()
        return float(rule.weights @ layer.density(rule.points, *mean_gauss(rule.shapes)))

    def curvature_range(self) -> tuple[float, float]:
        """Least and greatest principal curvature on a fine mesh."""
        return self._moments[3:]

    def random_points(self, count: int, rng: object) -> Floats:
        """Uniform by area: points of mesh triangles, kept with a chance in proportion to their stretch."""
        n = as_integer(count, "count", minimum=0)
        return self._patches.random_points(n, as_generator(rng, "rng"))

    def lattice_points(self, count: int) -> Floats:
        """Centres of even cells: Lloyd's method on fixed pseudo-random points."""
        n = as_integer(count, "count", minimum=1)
        crowd = self._patches.random_points(40 * n, np.random.default_rng(0))
        centres = crowd[spread_out(crowd[: 10 * n], n, float(np.sqrt(self.area / n)), self.period)]
        for _ in range(LATTICE_ROUNDS):
            _, owner = Places(centres, self.period).nearest(crowd)
            size = np.bincount(owner, minlength=n)
            away = nearest_image(crowd - centres[owner], self.period)
            sums = np.stack([np.bincount(owner, away[:, k], n) for k in range(3)], axis=1)
            centres = centres + sums / np.maximum(size, 1)[:, None]
        return self.project(centres)

    def vertex_frames(self, points: Floats) -> Floats:
        """Two tangent unit vectors e1, e2 with e1 × e2 = n, by the branchless rule of Duff et al. (2017)."""
        return self.frames_at(points, self._unit(points))

    def frames_at(self, points: Floats, normals: Floats) -> Floats:  # noqa: ARG002
        """`vertex_frames` where the normals are known."""
        return frames_of(normals)[:, :2]

    def retract(self, points: Floats, steps: Floats) -> Floats:
        """Move in the tangent plane, then along the old normal to the surface."""
        normal = self._unit(points)
        frames = self.frames_at(points, normal)
        return self.foot(points + np.einsum("ni,nix->nx", steps, frames), normal)

    def rigid_motions(self, points: Floats) -> Floats:
        """Velocities of those translations and rotations that leave the surface where it is."""
        spread = _generators(points - self._symmetries[1], self.size)
        out: Floats = np.einsum("ka,anx->knx", self._symmetries[0], spread)
        return out

    def free_motions(self, points: Floats) -> Floats:
        """`rigid_motions` of what touches no rim, which need not stay where it is."""
        if self.rim is None:
            return self.rigid_motions(points)
        spread = _generators(points - self._free_symmetries[1], self.size)
        out: Floats = np.einsum("ka,anx->knx", self._free_symmetries[0], spread)
        return out

    @cached_property
    def _symmetries(self) -> tuple[Floats, Floats]:
        return self._tangent_motions(keep_rim=True)

    @cached_property
    def _free_symmetries(self) -> tuple[Floats, Floats]:
        return self._tangent_motions(keep_rim=False)

    def _tangent_motions(self, *, keep_rim: bool) -> tuple[Floats, Floats]:
        """Combinations (k, 6) of the six generators that are tangent everywhere, and the centre."""
        rule = self._patches.quadrature()
        points, weights = rule.points, rule.weights
        centre = weights @ points / weights.sum()
        spread = _generators(points - centre, self.size)[self._generators]
        across = np.einsum("anx,nx->an", spread, rule.normals)
        tangent = (across * weights) @ across.T
        if keep_rim and self.rim is not None:
            at, inward, share = self.rim.samples()
            over = np.einsum("anx,nx->an", _generators(at - centre, self.size)[self._generators], inward)
            tangent += (over * (share * weights.sum() / share.sum())) @ over.T
        whole = np.einsum("n,anx,bnx->ab", weights, spread, spread)
        root = np.linalg.inv(np.linalg.cholesky(whole))
        values, vectors = np.linalg.eigh(root @ tangent @ root.T)
        found = np.zeros((int((values < self.symmetry).sum()), 6))
        found[:, self._generators] = (root.T @ vectors[:, values < self.symmetry]).T
        return frozen(found), frozen(centre)

    @property
    def _generators(self) -> Ints:
        """Translations and rotations that respect the period: none turns a direction that repeats."""
        repeats = np.zeros(3, dtype=bool) if self.period is None else np.isfinite(self.period)
        turns = [k for k in range(3) if not np.delete(repeats, k).any()]
        return np.array([0, 1, 2, *(3 + k for k in turns)])

    # --- arcs -------------------------------------------------------------------------------------

    def _arcs(self, tail: Floats, head: Floats, offsets: Floats) -> arcs.HeightArcs:
        rule = lobatto(offsets.shape[1] + 1)
        if self.period is not None:
            head = tail + nearest_image(head - tail, self.period)
        return arcs.place(rule, tail, head, (self._unit(tail), self._unit(head)), offsets, self.foot)

    def arc_measure(self, tail: Floats, head: Floats, offsets: Floats, layer: Layer) -> Floats:
        """Σ_t shares_t ∫ |d(x + t n)/dξ| dξ."""
        placed = self._arcs(tail, head, offsets)
        normals = np.zeros_like(placed.points)
        if layer.heights.any():
            normals = self._unit(placed.points.reshape(-1, 3)).reshape(placed.points.shape)
        if layer.profile is not None:
            thickness = layer.profile.values(placed.points)
            return varied_measure(placed.rule, placed.points, normals, thickness, layer.heights, layer.shares)
        return arcs.film_measure(placed.rule, placed.points, normals, layer.heights, layer.shares)

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
        """See `warpedfoam.kernels.height_arcs`."""
        placed = self._arcs(tail, head, offsets)
        shape = placed.points.shape
        normal, bend = self._shape(placed.points.reshape(-1, 3))
        normals, shapes = normal.reshape(shape), bend.reshape(*shape, 3)
        frames = (self.frames_at(tail, normals[0]), self.frames_at(head, normals[-1]))
        moves = arcs.jacobians(placed, normals, shapes, frames)
        second = jump is not None
        across = (layer.heights, layer.shares)
        mean, gauss = mean_gauss(shapes)
        if layer.profile is None:
            value, gradient, hessian = arcs.film_terms(placed, normals, shapes, moves, *across, second=second)
        else:
            thickness = layer.profile.thickness(placed.points, second=second)
            slopes = self._shape_slopes(placed.points, normals) if second else None
            value, gradient, hessian = varied_terms(
                placed, normals, shapes, moves, thickness, *across, slopes
            )
        density = layer.density(placed.points, mean, gauss)
        volume, bending = arcs.swept_terms(placed, normals, density, moves, second=second)
        if bending is not None and layer.profile is not None and slopes is not None:
            slope = layer.density_slope(thickness, shapes, slopes)
            bending += swept_change(placed, normals, slope, moves)
        if hessian is not None and bending is not None and jump is not None:
            hessian *= tension
            hessian -= jump * bending
        return ArcTerms(value, gradient, volume, hessian)

    def arc_points(self, tail: Floats, head: Floats, offsets: Floats, xi: Floats) -> Floats:
        """The polynomial through the nodes, brought to the surface along the arc's axis."""
        placed = self._arcs(tail, head, offsets)
        curve = np.einsum("mk,kfx->fmx", placed.rule.interpolation(xi), placed.points)
        axes = np.broadcast_to(placed.axis[:, None], curve.shape)
        return self.foot(curve.reshape(-1, 3), axes.reshape(-1, 3)).reshape(curve.shape)

    def arc_fit(self, tail: Floats, head: Floats, arc: Ints, points: Floats, order: int) -> Floats:
        """Least-squares bump 4 s ξ (1 − ξ) in the plane of each arc."""
        placed = self._arcs(tail, head, np.zeros((len(tail), 1)))
        square = arcs.dots(placed.left, placed.left)
        along = np.cross(placed.left, placed.axis)
        ahead = nearest_image(points - tail[arc], self.period)
        xi = arcs.dots(ahead, along[arc]) / square[arc]
        lift = arcs.dots(ahead, placed.left[arc]) / square[arc]
        return bump_offsets(arc, xi, lift, len(tail), order)

    def loop_integrals(
        self, tail: Floats, head: Floats, offsets: Floats, loops: Loops, layer: Layer
    ) -> Floats:
        """Fans of quadrature points, see `warpedfoam.kernels.fans`."""
        placed = self._arcs(tail, head, offsets)
        c0, c1, c2 = layer.steiner
        bent = c1 != 0.0 or c2 != 0.0

        def land(points: Floats, axes: Floats) -> tuple[Floats, Floats]:
            at, gradient, second = self._landed(points, axes, second=bent)
            size = np.linalg.norm(gradient, axis=1)
            normal = gradient / size[:, None]
            if second is None:
                return normal, np.full(len(points), c0)
            return normal, layer.density(at, *bent_mean_gauss(normal, second / size[:, None, None]))

        back = (loops.halves & 1).astype(bool)[:, None]
        first, last = placed.points[0][loops.halves >> 1], placed.points[-1][loops.halves >> 1]
        start, end = np.where(back, last, first), np.where(back, first, last)
        shifts = loop_shifts(start, end, loops, self.period)
        rays = layer.rays if layer.rays == 2 else max(layer.rays, self.least_rays(len(loops.starts)))
        points = placed.points
        if self.rim is not None:
            points, loops = with_walls(self.rim, placed.rule, points, loops, start, end)
        return fan_integrals(placed.rule, points, loops, shifts, self.foot, land, self._unit, rays)


def _generators(points: Floats, size: float) -> Floats:
    """Three translations and three rotations at the points, (6, n, 3), of similar strength."""
    axes = np.eye(3)
    shifts = np.broadcast_to(axes[:, None], (3, len(points), 3))
    turns = np.cross(axes[:, None], points[None]) / size
    return np.concatenate([shifts, turns])
