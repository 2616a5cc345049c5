"""Curved patches over the triangles of a mesh: quadrature and random points on a smooth surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from itertools import permutations

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.errors import MeshError
from warpedfoam.kernels.height_arcs import dots
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import gauss, lobatto
from warpedfoam.surfaces.mesh import TriangleMesh
from warpedfoam.surfaces.rim import Rim

#: Rules on a triangle (Dunavant 1985): degree 6 with 12 points, 4 with 6, 2 with 3, as barycentric triples
#: (whose permutations follow) and weights; from so many triangles on the second and third do.
RULES = (
    (
        (0.116786275726379, (0.501426509658179, 0.249286745170910, 0.249286745170910)),
        (0.050844906370207, (0.873821971016996, 0.063089014491502, 0.063089014491502)),
        (0.082851075618374, (0.053145049844817, 0.310352451033784, 0.636502499121399)),
    ),
    (
        (0.223381589678011, (0.108103018168070, 0.445948490915965, 0.445948490915965)),
        (0.109951743655322, (0.816847572980459, 0.091576213509771, 0.091576213509771)),
    ),
    ((1.0 / 3.0, (2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0)),),
)
MANY = (12_000, 100_000)


def triangle_rule(which: int) -> tuple[Floats, Floats]:
    """Barycentric points (k, 3) and weights (k,), which add up to 1, of one of `RULES`."""
    points, weights = [], []
    for weight, triple in RULES[which]:
        orbit = sorted(set(permutations(triple)))
        points += orbit
        weights += [weight] * len(orbit)
    shares = np.array(weights)
    return np.array(points), shares / shares.sum()


#: Moves points along axes to the surface: there they are, with normals and shape operators.
Landing = Callable[[Floats, Floats], tuple[Floats, Floats, Floats]]


@dataclass(frozen=True, eq=False)
class Quadrature:
    """Points (n, 3) of a surface, weights (n,) that add up to its area, normals and shape operators."""

    points: Floats
    weights: Floats
    normals: Floats
    shapes: Floats


class PatchedMesh:
    """Each triangle's points moved to the surface along the interpolated normals of its corners.

    Neighbours share the normals along their edge, so the patches meet without gap or overlap.
    """

    def __init__(
        self,
        mesh: TriangleMesh,
        land: Landing,
        unit: Callable[[Floats], Floats],
        rim: Rim | None,
        beyond: Callable[[Floats], Bools],
    ) -> None:
        self._mesh, self._land, self._rim, self._beyond = mesh, land, rim, beyond
        self._normals = unit(mesh.nodes)
        self._rule = triangle_rule(sum(mesh.n_triangles > many for many in MANY))
        self._ready: Quadrature | None = None

    def _lifted(self, triangles: Ints, shares: Floats) -> Quadrature:
        """Points of triangles at barycentric ``shares`` (n, 3), weighted by dA over the unit triangle."""
        corners, normals = self._corners(triangles), self._normals[triangles]
        flat = np.einsum("ni,nix->nx", shares, corners)
        axes = np.einsum("ni,nix->nx", shares, normals)
        points, n, shapes = self._land(flat, axes)
        slope = dots(axes, n)
        height = dots(points - flat, axes) / dots(axes, axes)
        sides = []
        for i in (1, 2):
            move = corners[:, i] - corners[:, 0] + height[:, None] * (normals[:, i] - normals[:, 0])
            sides.append(move - (dots(move, n) / slope)[:, None] * axes)
        return Quadrature(points, 0.5 * dots(np.cross(sides[0], sides[1]), n), n, shapes)

    def _corners(self, triangles: Ints) -> Floats:
        corners = self._mesh.nodes[triangles]
        return corners[:, :1] + nearest_image(corners - corners[:, :1], self._mesh.period)

    def quadrature(self) -> Quadrature:
        """A rule for integrals over the whole surface."""
        if self._ready is None:
            found = self._triangles()
            if self._rim is not None:
                found = _joined(found, self._slivers(self._rim))
            self._ready = found
        return self._ready

    def _triangles(self) -> Quadrature:
        shares, weights = self._rule
        triangles = np.repeat(self._mesh.triangles, len(shares), axis=0)
        found = self._lifted(triangles, np.tile(shares, (self._mesh.n_triangles, 1)))
        return replace(found, weights=found.weights * np.tile(weights, self._mesh.n_triangles))

    def _slivers(self, rim: Rim) -> Quadrature:
        """What lies between the curved triangles' edges and the rim, with its sign."""
        a, b = self._mesh.rim_edges.T
        rule, (xi, omega), (r, share) = lobatto(6), gauss(5), gauss(2)
        ends = self._mesh.nodes
        loop, first, last = rim.spans(ends[a], ends[b])
        length = np.linalg.norm(ends[b] - ends[a], axis=1)
        astray = last - first > 3.0 * length
        if astray.any():
            x, y, z = ends[a[np.argmax(astray)]]
            raise MeshError(
                f"the rim is too rough at ({x:.4g}, {y:.4g}, {z:.4g}) to pass a curve through: smooth it, or "
                "use more nodes"
            )
        outer = rim.nodes(rule, loop, first, last)
        part = rule.nodes[:, None, None]
        flat, axes = ((1.0 - part) * x[a] + part * x[b] for x in (ends, self._normals))
        inner = self._land(flat.reshape(-1, 3), axes.reshape(-1, 3))[0].reshape(outer.shape)
        values = rule.interpolation(xi)
        slopes = values @ rule.derivative
        axis = self._normals[a] + self._normals[b]
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        width = np.tensordot(values, outer - inner, 1)
        start = np.tensordot(values, inner, 1) + r[:, None, None, None] * width
        along = np.tensordot(slopes, inner, 1) + r[:, None, None, None] * np.tensordot(
            slopes, outer - inner, 1
        )
        down = np.broadcast_to(axis, start.shape)
        points, n, shapes = self._land(start.reshape(-1, 3), down.reshape(-1, 3))
        flux = dots(np.cross(np.broadcast_to(width, along.shape), along), down).ravel()
        weights = np.broadcast_to(share[:, None, None] * omega[:, None], start.shape[:3]).ravel()
        return Quadrature(points, weights * flux / dots(n, down.reshape(-1, 3)), n, shapes)

    def random_points(self, count: int, rng: np.random.Generator) -> Floats:
        """Points drawn uniformly by area, (count, 3)."""
        per = len(self._rule[1])
        # slivers along a rim are too narrow to count
        weights = self.quadrature().weights[: per * self._mesh.n_triangles]
        stretch = weights.reshape(-1, per) / self._rule[1]
        most = 1.05 * stretch.max(axis=1)
        below = np.cumsum(most) / most.sum()
        found: list[Floats] = []
        missing = count
        while missing > 0:
            draw = rng.random((missing + missing // 5 + 16, 4))
            triangle = np.minimum(np.searchsorted(below, draw[:, 0]), len(below) - 1)
            a, b = draw[:, 1], draw[:, 2]
            a, b = np.where(a + b > 1.0, 1.0 - a, a), np.where(a + b > 1.0, 1.0 - b, b)
            drawn = self._lifted(self._mesh.triangles[triangle], np.stack([1.0 - a - b, a, b], axis=1))
            kept = drawn.points[draw[:, 3] * most[triangle] < drawn.weights]
            if self._rim is not None:
                kept = kept[~self._beyond(kept)]
            kept = kept[:missing]
            found.append(kept)
            missing -= len(kept)
        return np.concatenate(found) if found else np.zeros((0, 3))


def _joined(one: Quadrature, other: Quadrature) -> Quadrature:
    pairs = ((getattr(one, f.name), getattr(other, f.name)) for f in fields(Quadrature))
    return Quadrature(*(np.concatenate(pair) for pair in pairs))
