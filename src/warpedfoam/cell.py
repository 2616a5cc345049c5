"""`HeleShawCell`: two parallel curved plates a gap apart."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from warpedfoam.arrays import as_integer, as_number
from warpedfoam.surfaces.protocol import SIZES, Layer, Surface


@dataclass(frozen=True)
class HeleShawCell:
    """The space between a surface and its parallel surface at height ``gap``.

    Parameters
    ----------
    surface : Surface
        The inner plate; its normal points into the gap.
    gap : float
        d > 0. The plates must not fold: 1 + t k > 0 for every principal curvature k and 0 ≤ t ≤ d.
    n_heights : int, optional
        Gauss points through the gap for ruled film areas (2: exact on spheres, relative error
        of order (d k)⁴/4000 elsewhere, for d k well below 1).

    Raises
    ------
    TypeError
        If ``surface`` is not a surface or ``gap`` is not a number.
    ValueError
        If ``gap`` is not above 0, or the plates would fold.

    Examples
    --------
    >>> from warpedfoam import Torus
    >>> cell = HeleShawCell(Torus(20.0, 4.0), gap=0.5)
    >>> round(cell.volume, 3)
    1677.833
    """

    surface: Surface
    gap: float
    n_heights: int = 2

    def __post_init__(self) -> None:
        if isinstance(self.surface, type) or not isinstance(self.surface, Surface):
            raise TypeError(
                "surface must be a surface such as Sphere(1.0) or Torus(20.0, 4.0), "
                f"got {type(self.surface).__name__}"
            )
        if callable(self.gap):
            raise TypeError("gap must be a number: gaps that vary with position are not available yet")
        gap = as_number(self.gap, "gap", positive=True, maximum=SIZES["maximum"])
        least, _ = self.surface.curvature_range()
        # plates that touch to round-off have folded: 1 + 49 · (−1/49) need not be 0
        if not 1.0 + gap * least > 1e-12:
            raise ValueError(
                f"gap {gap:g} folds the outer plate: it must be less than {-1.0 / least:g}, "
                "the least radius of curvature on the side of the gap"
            )
        object.__setattr__(self, "gap", gap)
        object.__setattr__(self, "n_heights", as_integer(self.n_heights, "n_heights", minimum=1, maximum=64))

    @cached_property
    def layer(self) -> Layer:
        """Heights and shares of film areas, and Steiner's coefficients (d, d², d³/3) of volumes."""
        return Layer.between_plates(self.gap, self.n_heights)

    @cached_property
    def volume(self) -> float:
        """V = ∫ (d + H d² + G d³/3) dA, exact for parallel plates."""
        return float(self.surface.integral(self.layer))
