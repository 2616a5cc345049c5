"""Level surfaces that are triangulated by a surface net over a grid."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from warpedfoam.arrays import Floats, Ints, as_integer, frozen
from warpedfoam.errors import MeshError
from warpedfoam.kernels.nets import surface_net
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.mesh import TriangleMesh

#: Grid steps along the box at first and at most, rounds of smoothing.
FIRST_LOOK, FINEST, ROUNDS = 40, 1000, 30
#: Beyond so many grid cells memory ends before patience does.
MOST_CELLS = 20_000_000


class NettedSurface(LevelSurface):
    """Base of level surfaces inside a box; ``period``, if there is one, is the box itself."""

    @property
    @abstractmethod
    def box(self) -> Floats:
        """Lower and upper corner, (2, 3)."""

    def values(self, points: Floats) -> Floats:
        """f at points anywhere in the box, where its gradient need not exist, (n,)."""
        return self.level(points, second=False)[0]

    def triangulate(self, n_nodes: int) -> TriangleMesh:
        """A surface net on a grid of the right step, evened out and moved to the surface."""
        count = as_integer(n_nodes, "n_nodes", minimum=50)
        known: dict[int, TriangleMesh] = self.__dict__.setdefault("_meshes", {})
        if count not in known:
            span = float((self.box[1] - self.box[0]).max())
            step = span / FIRST_LOOK
            nodes, triangles = self.net(step)
            for _ in range(3):
                step = max(step * float(np.sqrt(len(nodes) / count)), span / FINEST)
                nodes, triangles = self.net(step)
            for last in (False, False, False, True):
                try:
                    known[count] = self._evened(nodes, triangles)
                    break
                except MeshError:
                    # a grid that cuts a saddle badly joins its sheets: another one does not
                    if last:
                        raise
                    step *= 0.93
                    nodes, triangles = self.net(step)
        return known[count]

    def net(self, step: float) -> tuple[Floats, Ints]:
        """Nodes near the surface, and triangles, from a grid of about this step.

        Raises
        ------
        MeshError
            If the level function keeps its sign, or its zero set reaches a wall of the box.
        """
        low, high = self.box
        periodic = self.period is not None
        room = self.__dict__.get("_room")
        coarse = step >= 0.99 * float((high - low).max()) / FIRST_LOOK
        if room is not None and not coarse:
            # a roomy box is not filled with grid points far from the surface
            low, high = np.maximum(low, room[0]), np.minimum(high, room[1])
        cells = np.maximum(np.ceil((high - low) / step).astype(int), 4)
        if cells.prod() > MOST_CELLS:
            raise MeshError(
                f"a grid of {cells.tolist()} cells takes too much memory: choose fewer nodes, or bounds that "
                "fit the surface more tightly"
            )
        axes = [
            np.linspace(a, b, n + 1 - periodic, endpoint=not periodic)
            for a, b, n in zip(low, high, cells, strict=True)
        ]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        values = self.values(grid.reshape(-1, 3)).reshape(grid.shape[:3])
        if not (values < 0.0).any() or not (values > 0.0).any():
            raise MeshError(
                "function does not change sign inside bounds: no surface, or one far too small for them"
            )
        walls = [np.moveaxis(values, axis, 0)[[0, -1]] < 0.0 for axis in range(3)]
        if not periodic and len({bool(sign) for wall in walls for sign in np.unique(wall)}) > 1:
            raise MeshError("the surface reaches the walls of bounds; choose a larger box")
        nodes, triangles = surface_net(values, periodic=periodic)
        found = low + nodes * (high - low) / cells
        if not periodic and coarse:
            self.__dict__["_room"] = (found.min(axis=0) - 3.0 * step, found.max(axis=0) + 3.0 * step)
        return found, triangles

    def _evened(self, nodes: Floats, triangles: Ints) -> TriangleMesh:
        mesh = TriangleMesh(nodes, triangles, self.period)
        mesh.require_surface(closed=True)
        a, b = mesh.edges.T
        start, end = np.concatenate([a, b]), np.concatenate([b, a])
        degree = np.bincount(start, minlength=mesh.n_nodes)[:, None]
        x = self.project(nodes)
        for _ in range(ROUNDS):
            away = nearest_image(x[end] - x[start], self.period)
            pull = np.stack([np.bincount(start, away[:, k], mesh.n_nodes) for k in range(3)], axis=1)
            x = self.foot(x + 0.5 * pull / degree, self._unit(x))
        if not np.isfinite(x).all():
            raise MeshError(
                "function has no clear zero set: its gradient vanishes on the surface or next to it, or "
                "it is not smooth there"
            )
        return TriangleMesh(frozen(x), triangles, self.period)
