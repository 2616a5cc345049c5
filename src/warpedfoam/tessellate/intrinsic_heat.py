"""The heat method on meshes that repeat in space, which libigl's coordinates cannot hold."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import splu

from warpedfoam.arrays import Floats, Ints
from warpedfoam.surfaces.mesh import TriangleMesh


class IntrinsicHeat:
    """Heat and Poisson equations of a closed mesh, from its triangles' corners alone; factored once.

    (M + t L) u = δ, X = −∇u/|∇u|, L φ = −∇·X, with the cotangent matrix L and lumped areas M (Crane,
    Weischedel and Wardetzky 2013).
    """

    def __init__(self, mesh: TriangleMesh, t: float) -> None:
        corners, tri, n = mesh.corners, mesh.triangles, mesh.n_nodes
        # side i of a triangle lies across from its corner i
        sides = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
        normal = np.cross(sides[:, 0], sides[:, 1])
        double = np.linalg.norm(normal, axis=1)
        unit = normal / double[:, None]
        cotangent = -np.einsum("mix,mix->mi", np.roll(sides, -1, axis=1), np.roll(sides, -2, axis=1))
        cotangent /= double[:, None]
        a, b = np.roll(tri, -1, axis=1).ravel(), np.roll(tri, -2, axis=1).ravel()
        half = 0.5 * cotangent.ravel()
        rows = np.concatenate([a, b, a, b])
        columns = np.concatenate([b, a, a, b])
        values = np.concatenate([-half, -half, half, half])
        stiffness = csc_array(coo_array((values, (rows, columns)), shape=(n, n)))
        mass = diags_array(mesh.node_areas)
        self._gradients = np.cross(unit[:, None], sides) / double[:, None, None]
        self._double, self._triangles, self._n = double, tri, n
        self._heat = _factored(csc_array(mass + t * stiffness))
        # a constant is free: the first node is held
        self._poisson = _factored(stiffness[1:, 1:])

    def solve(self, sources: Ints) -> Floats:
        """Distances from the nearest source, their mean over the sources 0."""
        start = np.zeros(self._n)
        start[sources] = 1.0
        heat: Floats = self._heat.solve(start)
        slope = np.einsum("mi,mix->mx", heat[self._triangles], self._gradients)
        size = np.linalg.norm(slope, axis=1, keepdims=True)
        field = -slope / np.maximum(size, 1e-300)
        flow = 0.5 * self._double[:, None] * np.einsum("mix,mx->mi", self._gradients, field)
        right = np.bincount(self._triangles.ravel(), flow.ravel(), self._n)
        out = np.zeros(self._n)
        out[1:] = self._poisson.solve(right[1:])
        return out - float(out[sources].mean())


def _factored(matrix: csc_array) -> Any:
    return splu(
        csc_array(matrix),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
