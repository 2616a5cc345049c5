"""Schwarz's P surface in its nodal approximation, one translational unit with its opposite sides joined."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats, as_number
from warpedfoam.surfaces.netted import NettedSurface
from warpedfoam.surfaces.protocol import SIZES


@dataclass(frozen=True)
class SchwarzP(NettedSurface):
    """cos 2πx/a + cos 2πy/a + cos 2πz/a = 0, repeating after the period a along x, y and z.

    One unit is a closed surface of genus 3, χ = −4, so that Σ q = −24. The level set is within about
    half a percent of a of the minimal surface and shares all its symmetries. Normals point to where the
    sum is negative, out of the chamber about the origin.

    Parameters
    ----------
    cell_length : float
        a > 0.

    Raises
    ------
    TypeError, ValueError
        If ``cell_length`` is not a finite number above 0.

    Examples
    --------
    >>> SchwarzP(1.0).euler_characteristic
    -4
    """

    cell_length: float

    def __post_init__(self) -> None:
        length = as_number(self.cell_length, "cell_length", positive=True, **SIZES)
        object.__setattr__(self, "cell_length", length)

    @property
    def period(self) -> Floats | None:
        """(a, a, a)."""
        return np.full(3, self.cell_length)

    @property
    def box(self) -> Floats:
        """From −a/2 to a/2."""
        return np.array([[-0.5] * 3, [0.5] * 3]) * self.cell_length

    @property
    def size(self) -> float:
        """Half of the unit's diagonal."""
        return float(np.sqrt(0.75)) * self.cell_length

    @property
    def euler_characteristic(self) -> int:
        """χ = −4."""
        return -4

    def level(self, points: Floats, *, second: bool) -> tuple[Floats, Floats, Floats | None]:
        """−(cos 2πx/a + cos 2πy/a + cos 2πz/a) a/2π."""
        k = 2.0 * np.pi / self.cell_length
        cos, sin = np.cos(k * points), np.sin(k * points)
        bend = k * cos[:, :, None] * np.eye(3) if second else None
        return -cos.sum(axis=1) / k, sin, bend
