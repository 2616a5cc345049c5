"""The torus of revolution: films in its angles, volumes by an exact one-form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, Ints, as_generator, as_integer, as_number, as_points, frozen
from warpedfoam.kernels import revolution_arcs as arcs
from warpedfoam.kernels.lattice import best_lattice
from warpedfoam.kernels.loops import Loops
from warpedfoam.kernels.nodal import bump_offsets, shape_values
from warpedfoam.kernels.quadrature import LobattoRule, lobatto
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.protocol import SIZES, ArcTerms, Layer
from warpedfoam.surfaces.rings import stitched_rings

TURN = 2.0 * np.pi


def wrapped(angle: Floats) -> Floats:
    """The angle's representative in [−π, π)."""
    return angle - TURN * np.round(angle / TURN)


@dataclass(frozen=True)
class Torus:
    """Torus about the z axis: tube of radius r whose centre runs round a ring of radius R > r.

    With tube angle φ (0 on the outer equator) and ring angle θ a point is
    ((R + r cos φ) cos θ, (R + r cos φ) sin θ, r sin φ); k1 = 1/r, k2 = cos φ / (R + r cos φ).

    Parameters
    ----------
    major_radius, minor_radius : float
        R and r, R > r > 0.

    Raises
    ------
    TypeError, ValueError
        If a radius is not a finite number above 0, or R ≤ r.

    Examples
    --------
    >>> torus = Torus(major_radius=20.0, minor_radius=4.0)
    >>> torus.gaussian_curvature([[24.0, 0.0, 0.0]]).round(8)
    array([0.01041667])
    """

    major_radius: float
    minor_radius: float

    def __post_init__(self) -> None:
        ring = as_number(self.major_radius, "major_radius", positive=True, **SIZES)
        tube = as_number(self.minor_radius, "minor_radius", positive=True, **SIZES)
        if ring <= tube:
            raise ValueError(
                "major_radius must exceed minor_radius (else the torus cuts itself), "
                f"got {ring:g} <= {tube:g}"
            )
        object.__setattr__(self, "major_radius", ring)
        object.__setattr__(self, "minor_radius", tube)

    @property
    def area(self) -> float:
        """4 π² R r."""
        return TURN**2 * self.major_radius * self.minor_radius

    @property
    def size(self) -> float:
        """R + r."""
        return self.major_radius + self.minor_radius

    @property
    def euler_characteristic(self) -> int:
        """χ = 0."""
        return 0

    @property
    def period(self) -> Floats | None:
        """It does not repeat."""
        return None

    @property
    def rim(self) -> None:
        """None: the surface is closed."""
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
        """Rings of evenly spaced nodes, each with as many as its length asks for, stitched by angle."""
        return _torus_mesh(self, as_integer(n_nodes, "n_nodes", minimum=48))

    def angles(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Tube angle φ and ring angle θ of each point, both in [−π, π].

        Raises
        ------
        ValueError
            If a point lies on the axis or on the tube's centre circle, where no angle exists.
        """
        x = as_points(points, "points", minimum=0)
        out = np.hypot(x[:, 0], x[:, 1])
        depth = np.hypot(out - self.major_radius, x[:, 2])
        tiny = 1e-12 * self.size
        if (out <= tiny).any() or (depth <= tiny).any():
            raise ValueError(
                "points must not lie on the torus's axis or on the centre circle of its tube: "
                "they have no nearest point"
            )
        return self._angles(x)

    def _angles(self, x: Floats) -> tuple[Floats, Floats]:
        out = np.hypot(x[:, 0], x[:, 1]) - self.major_radius
        return np.arctan2(x[:, 2], out), np.arctan2(x[:, 1], x[:, 0])

    def points(self, phi: Floats, theta: Floats) -> Floats:
        """The point at tube angle φ and ring angle θ; arrays of one shape give (…, 3)."""
        out = self.major_radius + self.minor_radius * np.cos(phi)
        return np.stack([out * np.cos(theta), out * np.sin(theta), self.minor_radius * np.sin(phi)], axis=-1)

    def project(self, points: ArrayLike) -> Floats:
        """The point of the same angles; see `angles` for what it refuses."""
        return self.points(*self.angles(points))

    def normals(self, points: ArrayLike) -> Floats:
        """(cos φ cos θ, cos φ sin θ, sin φ)."""
        phi, theta = self.angles(points)
        c = np.cos(phi)
        return np.stack([c * np.cos(theta), c * np.sin(theta), np.sin(phi)], axis=1)

    def principal_curvatures(self, points: ArrayLike) -> Floats:
        """(1/r, cos φ / (R + r cos φ))."""
        cos = np.cos(self.angles(points)[0])
        along = cos / (self.major_radius + self.minor_radius * cos)
        return np.stack([np.full_like(cos, 1.0 / self.minor_radius), along], axis=1)

    def gaussian_curvature(self, points: ArrayLike) -> Floats:
        """cos φ / (r (R + r cos φ))."""
        out: Floats = self.principal_curvatures(points).prod(axis=1)
        return out

    def shape_operators(self, points: ArrayLike, *, project: bool = True) -> Floats:  # noqa: ARG002
        """k1 e_φ e_φᵀ + k2 e_θ e_θᵀ."""
        x = as_points(points, "points", minimum=0)
        curvatures, frames = self.principal_curvatures(x), self.vertex_frames(x)
        out: Floats = np.einsum("ni,nix,niy->nxy", curvatures, frames, frames)
        return out

    def curvature_range(self) -> tuple[float, float]:
        """From −1/(R − r) on the inner equator to 1/r round the tube."""
        return -1.0 / (self.major_radius - self.minor_radius), 1.0 / self.minor_radius

    def _one_form(self, layer: Layer) -> tuple[float, float]:
        """(α, β) with (c0 + c1 H + c2 G) dA = d(αφ + β sin φ) ∧ dθ."""
        ring, tube = self.major_radius, self.minor_radius
        c0, c1, c2 = layer.steiner
        return c0 * tube * ring + 0.5 * c1 * ring, c0 * tube**2 + c1 * tube + c2

    def integral(self, layer: Layer) -> float:
        """4 π² α, with α of the layer's one-form."""
        return TURN**2 * self._one_form(layer)[0]

    def random_points(self, count: int, rng: object) -> Floats:
        """θ uniform; φ by the inverse of the area below it."""
        n = as_integer(count, "count", minimum=0)
        draw = as_generator(rng, "rng").random((2, n))
        return self.points(self._tube_angle(draw[0]), TURN * draw[1])

    def lattice_points(self, count: int) -> Floats:
        """The rank-1 lattice in equal-area coordinates whose nearest neighbours are farthest apart."""
        n = as_integer(count, "count", minimum=1)
        along, across = best_lattice(n, TURN * self.major_radius, TURN * self.minor_radius)
        return self.points(self._tube_angle(across), TURN * along)

    def _tube_angle(self, share: Floats) -> Floats:
        """φ below which the given share of the area lies: (φ + (r/R) sin φ)/2π = share (Newton)."""
        k = self.minor_radius / self.major_radius
        phi = TURN * np.asarray(share)
        low, high = phi - k, phi + k
        for _ in range(60):
            fault = phi + k * np.sin(phi) - TURN * share
            low, high = np.where(fault < 0, phi, low), np.where(fault > 0, phi, high)
            step = phi - fault / (1.0 + k * np.cos(phi))
            phi_next = np.where((step > low) & (step < high), step, 0.5 * (low + high))
            if np.abs(phi_next - phi).max(initial=0.0) < 1e-15:
                break
            phi = phi_next
        return phi

    def vertex_frames(self, points: Floats) -> Floats:
        """(e_φ, −e_θ), so that e1 × e2 is the outward normal."""
        phi, theta = self._angles(points)
        s, zero = np.sin(phi), np.zeros_like(phi)
        around = np.stack([-s * np.cos(theta), -s * np.sin(theta), np.cos(phi)], axis=1)
        along = np.stack([np.sin(theta), -np.cos(theta), zero], axis=1)
        return np.stack([around, along], axis=1)

    def retract(self, points: Floats, steps: Floats) -> Floats:
        """Move the angles by (s1 / r, −s2 / (R + r cos φ))."""
        phi, theta = self._angles(points)
        out = self.major_radius + self.minor_radius * np.cos(phi)
        return self.points(phi + steps[:, 0] / self.minor_radius, theta - steps[:, 1] / out)

    def rigid_motions(self, points: Floats) -> Floats:
        """The rotation about the axis."""
        return np.cross([0.0, 0.0, 1.0], points)[None]

    def _chart(self, tail: Floats, head: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """φ_A, φ_B (on the branch next to φ_A), Δθ, θ_A of each arc."""
        phi_a, theta_a = self._angles(tail)
        phi_b, theta_b = self._angles(head)
        return phi_a, phi_a + wrapped(phi_b - phi_a), wrapped(theta_b - theta_a), theta_a

    def _nodes(self, tail: Floats, head: Floats, offsets: Floats) -> arcs.TubeArcs:
        phi_a, phi_b, dtheta, _ = self._chart(tail, head)
        rule = lobatto(offsets.shape[1] + 1)
        return arcs.tube_arcs(rule, self.major_radius, self.minor_radius, phi_a, phi_b, dtheta, offsets.T)

    def arc_measure(self, tail: Floats, head: Floats, offsets: Floats, layer: Layer) -> Floats:
        """Σ_t shares_t ∫ sqrt((r + t)² φ'² + (R + (r + t) cos φ)² θ'²) dξ."""
        nodes = self._nodes(tail, head, offsets)
        radii = self.minor_radius + layer.heights
        out: Floats = nodes.rule.weights @ arcs.film_density(nodes, self.major_radius, radii, layer.shares)
        return out

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
        """Densities of (φ, φ', θ') pulled back to the ends' angles and the offsets."""
        ring, tube = self.major_radius, self.minor_radius
        radii = tube + layer.heights
        alpha, beta = self._one_form(layer)
        phi_a, phi_b, dtheta, _ = self._chart(tail, head)
        rule = lobatto(offsets.shape[1] + 1)
        nodes = arcs.tube_arcs(rule, ring, tube, phi_a, phi_b, dtheta, offsets.T)
        jacobian, bends = arcs.chain(nodes, tube)
        value, first = arcs.film_density_first(nodes, ring, radii, layer.shares)
        sin, cos = np.sin(nodes.phi), np.cos(nodes.phi)
        # the one-form F dθ, with F measured from its value at A: the rest is exact and cancels
        f_a = alpha * phi_a + beta * np.sin(phi_a)
        f = alpha * nodes.phi + beta * sin - f_a
        slope = alpha + beta * cos
        swept = np.stack([slope * nodes.dtheta, np.zeros_like(f), f])
        by_film = arcs.pulled_gradient(nodes, first, jacobian)
        by_form = arcs.pulled_gradient(nodes, swept, jacobian)
        scale = _end_scales(ring, tube, phi_a, phi_b)
        gradient = _to_frames(by_film, scale)
        form = _to_frames(by_form, scale)
        f_b = alpha * phi_b + beta * np.sin(phi_b) - f_a
        form[3] -= f_b * scale[3]
        hessian = None
        if jump is not None:
            second = tension * arcs.film_density_second(nodes, ring, radii, layer.shares)
            second[0] -= jump * beta * sin * nodes.dtheta
            second[2] += jump * slope
            combined = tension * first
            combined += jump * swept
            local = arcs.pulled_hessian(nodes, combined, second, jacobian, bends)
            hessian = _hessian_to_frames(local, scale)
        return ArcTerms(rule.weights @ value, gradient, -form, hessian)

    def arc_points(self, tail: Floats, head: Floats, offsets: Floats, xi: Floats) -> Floats:
        """Points at the interpolated angles."""
        phi_a, phi_b, dtheta, theta_a = self._chart(tail, head)
        rule = lobatto(offsets.shape[1] + 1)
        values, _ = shape_values(rule, offsets.T)
        v = (rule.interpolation(xi) @ values).T
        out = self.major_radius + self.minor_radius * np.cos(0.5 * (phi_a + phi_b))
        up, along = out * dtheta / self.minor_radius, -self.minor_radius * (phi_b - phi_a) / out
        phi = phi_a[:, None] + xi * (phi_b - phi_a)[:, None] + v * up[:, None]
        theta = theta_a[:, None] + xi * dtheta[:, None] + v * along[:, None]
        return self.points(phi, theta)

    def arc_fit(self, tail: Floats, head: Floats, arc: Ints, points: Floats, order: int) -> Floats:
        """Least-squares bump 4 s ξ (1 − ξ) through the points' chart coordinates."""
        phi_a, phi_b, dtheta, theta_a = self._chart(tail, head)
        dphi = phi_b - phi_a
        out = self.major_radius + self.minor_radius * np.cos(0.5 * (phi_a + phi_b))
        chord = (self.minor_radius * dphi) ** 2 + (out * dtheta) ** 2
        phi, theta = self._angles(points)
        x = self.minor_radius * wrapped(phi - phi_a[arc])
        y = out[arc] * wrapped(theta - theta_a[arc])
        dx, dy = self.minor_radius * dphi[arc], (out * dtheta)[arc]
        return bump_offsets(
            arc, (x * dx + y * dy) / chord[arc], (x * dy - y * dx) / chord[arc], len(tail), order
        )

    def loop_integrals(
        self, tail: Floats, head: Floats, offsets: Floats, loops: Loops, layer: Layer
    ) -> Floats:
        """−∮ (αφ + β sin φ) dθ with φ continued along each loop, for loops of disks."""
        nodes = self._nodes(tail, head, offsets)
        return self.round_loops(nodes.rule, nodes.phi, nodes.dtheta, nodes.turned[4], loops, layer)

    def round_loops(
        self, rule: LobattoRule, phi: Floats, slope: Floats, turned: Floats, loops: Loops, layer: Layer
    ) -> Floats:
        """`loop_integrals` from φ and dθ/dξ at the nodes of arcs (K, F), and Δθ of each, (F,)."""
        alpha, beta = self._one_form(layer)
        f = alpha * phi + beta * np.sin(phi)
        # each arc's one-form is measured from its tail, each loop's from its first point: the large
        # exact parts cancel round a loop, and would leave their round-off
        along = rule.weights @ ((f - f[0]) * slope)
        film, back = loops.halves >> 1, (loops.halves & 1).astype(bool)
        sign = np.where(back, -1.0, 1.0)
        first, last = phi[0][film], phi[-1][film]
        start, end = np.where(back, last, first), np.where(back, first, last)
        jump = np.zeros(len(film))
        jump[1:] = np.round((end[:-1] - start[1:]) / TURN)
        turns = np.cumsum(jump)
        sizes = loops.sizes
        turns -= np.repeat(turns[loops.starts], sizes)
        here = f[0][film] + TURN * alpha * turns
        here -= np.repeat(here[loops.starts], sizes)
        terms = sign * (along[film] + here * turned[film])
        out: Floats = -np.add.reduceat(terms, loops.starts)
        return out


def _end_scales(ring: float, tube: float, phi_a: Floats, phi_b: Floats) -> Floats:
    """Chart angle per unit step along (e1, e2) at A and at B: rows φ_A, θ_A, φ_B, θ_B."""
    around = np.full_like(phi_a, 1.0 / tube)
    return np.stack(
        [around, -1.0 / (ring + tube * np.cos(phi_a)), around, -1.0 / (ring + tube * np.cos(phi_b))]
    )


def _to_frames(chart: Floats, scale: Floats) -> Floats:
    """Gradient by (φ_A, φ_B, Δθ, u) into one by (A₁, A₂, B₁, B₂, u)."""
    ends = scale * np.stack([chart[0], -chart[2], chart[1], chart[2]])
    return np.concatenate([ends, chart[3:]])


def _hessian_to_frames(chart: Floats, scale: Floats) -> Floats:
    n = len(chart) + 1
    take = np.concatenate([[0, 2, 1, 2], np.arange(3, n - 1)])
    out: Floats = chart[take][:, take]
    out[1] = -out[1]
    out[:, 1] = -out[:, 1]
    out[:4] *= scale[:, None]
    out[:, :4] *= scale[None]
    return out


@lru_cache(maxsize=4)
def _torus_mesh(torus: Torus, n_nodes: int) -> TriangleMesh:
    # equilateral triangles of edge h: rows h √3/2 apart, area per node h² √3/2
    h = np.sqrt(torus.area / n_nodes * 2.0 / np.sqrt(3.0))
    n_rings = max(4, round(TURN * torus.minor_radius / (h * np.sqrt(3.0) / 2.0)))
    n_rings += n_rings % 2
    phi = TURN * np.arange(n_rings) / n_rings
    radius = torus.major_radius + torus.minor_radius * np.cos(phi)
    counts = np.maximum(5, np.round(TURN * radius / h).astype(np.int64))
    ring, theta, triangles = stitched_rings(counts, closed=True)
    return TriangleMesh(frozen(torus.points(phi[ring], theta)), triangles)
