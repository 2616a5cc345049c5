"""`HeleShawCell`: two curved plates a gap apart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from warpedfoam.arrays import Floats, as_integer, as_number
from warpedfoam.surfaces.fitted_gap import FittedGap, fitted_gap
from warpedfoam.surfaces.gap_field import Function, GapField
from warpedfoam.surfaces.level import LevelSurface
from warpedfoam.surfaces.level_twins import without_twin
from warpedfoam.surfaces.protocol import SIZES, Layer, Surface


@dataclass(frozen=True)
class HeleShawCell:
    """The space between a surface and an outer plate at height ``gap`` along its normals.

    Parameters
    ----------
    surface : Surface
        The inner plate; its normal points into the gap.
    gap : float, callable or GapField
        d > 0: a number for parallel plates, or a function of points (n, 3) that returns the gap there, (n,),
        with derivatives of its own (`GapField`) or without (differences are taken). The plates must not
        fold: 1 + t k > 0 for every principal curvature k and 0 ≤ t ≤ d. A function that is the same
        everywhere counts as that number.
    n_heights : int, optional
        Gauss points through the gap for ruled film areas (2: exact on spheres, relative error
        of order (d k)⁴/4000 elsewhere, for d k well below 1).

    Attributes
    ----------
    surface : Surface
        The inner plate. Under a gap that varies a `Sphere` or `Torus` has the films of a level set (see
        docs/gaps.md) and is otherwise what it was.

    Raises
    ------
    TypeError
        If ``surface`` is not a surface or ``gap`` neither a number nor a function.
    ValueError
        If ``gap`` is not above 0, the plates would fold, or a gap that varies is not smooth, does not repeat
        where the surface does, or has derivatives that are not its own.

    Examples
    --------
    >>> from warpedfoam import Torus
    >>> cell = HeleShawCell(Torus(20.0, 4.0), gap=0.5)
    >>> round(cell.volume, 3)
    1677.833
    >>> wedge = HeleShawCell(Torus(20.0, 4.0), gap=lambda x: 0.5 + 0.01 * x[:, 2])
    >>> wedge.parallel, round(wedge.mean_gap, 9)
    (False, 0.5)
    """

    surface: Surface
    gap: float | GapField
    n_heights: int

    def __init__(self, surface: Surface, gap: float | Function | GapField, n_heights: int = 2) -> None:
        if isinstance(surface, type) or not isinstance(surface, Surface):
            raise TypeError(
                "surface must be a surface such as Sphere(1.0) or Torus(20.0, 4.0), "
                f"got {type(surface).__name__}"
            )
        put = object.__setattr__
        put(self, "n_heights", as_integer(n_heights, "n_heights", minimum=1, maximum=64))
        found = fitted_gap(surface, gap) if callable(gap) else gap
        if isinstance(found, FittedGap):
            put(self, "surface", found.surface)
            put(self, "gap", found.field)
            self.__dict__["_fitted"] = found
            return
        number = as_number(found, "gap", positive=True, maximum=SIZES["maximum"])
        least, _ = surface.curvature_range()
        # plates that touch to round-off have folded: 1 + 49 · (−1/49) need not be 0
        if not 1.0 + number * least > 1e-12:
            raise ValueError(
                f"gap {number:g} folds the outer plate: it must be less than {-1.0 / least:g}, "
                "the least radius of curvature on the side of the gap"
            )
        put(self, "surface", without_twin(surface))
        put(self, "gap", number)
        self.__dict__["_fitted"] = None

    @property
    def _varied(self) -> FittedGap | None:
        found: FittedGap | None = self.__dict__["_fitted"]
        return found

    @property
    def parallel(self) -> bool:
        """Whether the gap is the same everywhere."""
        return self._varied is None

    @property
    def mean_gap(self) -> float:
        """∫ d dA over the area of the inner plate."""
        return float(self.gap) if self._varied is None else self._varied.mean  # type: ignore[arg-type]

    def parallel_gap(self, what: str) -> float:
        """The gap of parallel plates, for ``what`` needs them.

        Raises
        ------
        ValueError
            If the gap varies.
        """
        if self._varied is not None:
            raise ValueError(f"{what} needs parallel plates, but the gap of this cell varies")
        return self.mean_gap

    @cached_property
    def layer(self) -> Layer:
        """Heights and shares of film areas, and Steiner's coefficients (d, d², d³/3) of volumes."""
        mean = Layer.between_plates(self.mean_gap, self.n_heights)
        return mean if self._varied is None else replace(mean, profile=self._varied.profile)

    @cached_property
    def volume(self) -> float:
        """V = ∫ (d + H d² + G d³/3) dA, exact for plates along each other's normals or not."""
        return float(self.surface.integral(self.layer))

    def gaps(self, points: Floats) -> Floats:
        """The gap at points (n, 3) of the inner plate, (n,)."""
        if self._varied is None:
            return np.full(len(points), self.mean_gap)
        return self._varied.profile.values(points) * self._varied.mean

    def log_gap_slopes(self, points: Floats) -> Floats:
        """∇ ln d at points (…, 3) of the inner plate; its part across the plate means nothing."""
        if self._varied is None:
            return np.zeros(points.shape)
        profile = self._varied.profile
        out: Floats = profile.gradients(points) / profile.values(points)[..., None]
        return out

    def rigid_motions(self, points: Floats) -> Floats:
        """Velocity fields (k, n, 3) of the motions that leave both plates where they are."""
        return (self.surface if self._varied is None else self._varied).rigid_motions(points)

    def free_motions(self, points: Floats) -> Floats:
        """`rigid_motions` of what touches no rim (k, n, 3): the rims need not stay where they are."""
        if self._varied is not None:
            return self._varied.free_motions(points)
        if isinstance(self.surface, LevelSurface):
            return self.surface.free_motions(points)
        return self.surface.rigid_motions(points)
