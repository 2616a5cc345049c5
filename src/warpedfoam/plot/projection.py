"""Orthographic view with hidden parts removed: arrays only, no drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, Ints, as_floats

# Light from above the viewer's left shoulder, in (right, up, towards the viewer).
_LIGHT = np.array([-0.35, 0.55, 0.76])
# How much of the colour stays where the light only grazes.
_AMBIENT = 0.72


@dataclass(frozen=True, eq=False)
class View:
    """Axes of an orthographic view, rows of ``axes``: right, up, towards the viewer."""

    axes: Floats

    @classmethod
    def from_angles(cls, elevation: float, azimuth: float) -> View:
        """View from ``elevation`` above the xy plane and ``azimuth`` from the x axis, in degrees.

        Examples
        --------
        >>> View.from_angles(0.0, 0.0).axes.round().astype(int).tolist()
        [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
        """
        e, a = np.radians(as_floats([elevation, azimuth], "view", (2,)))
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return cls(np.stack([right, np.cross(towards, right), towards]))

    def project(self, points: Floats) -> Floats:
        """Right, up and depth (larger is nearer) of points (…, 3)."""
        out: Floats = points @ self.axes.T
        return out


def facing(corners: Floats) -> Floats:
    """Twice the signed area (n,) of projected triangles (n, 3, 3): above 0 if they face the viewer."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    out: Floats = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return out


def shades(normals: Floats) -> Floats:
    """Brightness (n,) of surfaces with projected unit ``normals`` (n, 3), mild to keep colours legible."""
    light = np.clip(normals @ (_LIGHT / np.linalg.norm(_LIGHT)), 0.0, 1.0)
    out: Floats = _AMBIENT + (1.0 - _AMBIENT) * light
    return out


def back_to_front(depth: Floats) -> Ints:
    """Order in which things at these depths are painted."""
    return np.argsort(depth, kind="stable")
