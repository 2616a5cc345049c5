"""Series of geodesic circles (Bertrand, Diquet, Puiseux), and curvatures read back from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, as_integer
from warpedfoam.theory.inputs import as_values


def perimeter_series(
    radius: ArrayLike, gaussian_curvature: ArrayLike, laplacian: ArrayLike = 0.0, *, terms: int = 3
) -> Floats:
    """C = 2πρ − (π/3) ρ³ G + πρ⁵ (G²/60 − ΔG/40) + O(ρ⁷), perimeter of a geodesic circle; length.

    Parameters
    ----------
    radius : float or array
        ρ, above 0.
    gaussian_curvature : float or array
        G at the centre.
    laplacian : float or array
        ΔG there, the Laplace–Beltrami operator of G; 1/L⁴.
    terms : {1, 2, 3}
        How many terms to add up.

    Returns
    -------
    array
        Of the arguments' common shape.

    Raises
    ------
    TypeError, ValueError
        If an argument is not made of finite numbers, or ``terms`` is none of 1, 2, 3.

    Notes
    -----
    Two terms are the paper's Eq. C1theorem. Erratum: its appendix (Eq. theorem) leaves out ΔG, so that it
    holds for constant G only, and gives the next order as ρ⁵ instead of ρ⁷. The series alternates only if
    G > 0. The fifth-order term follows from the Jacobi equation averaged over directions (docs/theory.md).

    Examples
    --------
    >>> float(perimeter_series(0.1, 1.0) - 2.0 * np.pi * np.sin(0.1)) < 1e-9
    True
    """
    rho, g, bend, count = _arguments(radius, gaussian_curvature, laplacian, terms)
    parts = [2.0 * rho, -(rho**3) * g / 3.0, rho**5 * (g**2 / 60.0 - bend / 40.0)]
    return np.pi * sum(parts[1:count], parts[0] + 0.0 * (g + bend))


def area_series(
    radius: ArrayLike, gaussian_curvature: ArrayLike, laplacian: ArrayLike = 0.0, *, terms: int = 3
) -> Floats:
    """A = πρ² − (π/12) ρ⁴ G + πρ⁶ (G²/360 − ΔG/240) + O(ρ⁸), area inside a geodesic circle; L².

    See `perimeter_series`, of which it is the integral, for arguments and errata (paper, Eqs. A1theorem and
    Atheorem, whose ρ⁶ term again lacks ΔG).

    Examples
    --------
    >>> float(area_series(0.1, 1.0) - 2.0 * np.pi * (1.0 - np.cos(0.1))) < 1e-11
    True
    """
    rho, g, bend, count = _arguments(radius, gaussian_curvature, laplacian, terms)
    parts = [rho**2, -(rho**4) * g / 12.0, rho**6 * (g**2 / 360.0 - bend / 240.0)]
    return np.pi * sum(parts[1:count], parts[0] + 0.0 * (g + bend))


def _arguments(
    radius: ArrayLike, gaussian_curvature: ArrayLike, laplacian: ArrayLike, terms: int
) -> tuple[Floats, Floats, Floats, int]:
    return (
        as_values(radius, "radius", positive=True),
        as_values(gaussian_curvature, "gaussian_curvature"),
        as_values(laplacian, "laplacian"),
        as_integer(terms, "terms", minimum=1, maximum=3),
    )


def circle_perimeter(radius: ArrayLike, gaussian_curvature: ArrayLike) -> Floats:
    """C = 2π sin(√G ρ)/√G, or sinh for G < 0: a geodesic circle where G is constant; length.

    Raises
    ------
    ValueError
        If ρ is beyond the conjugate point π/√G.

    Examples
    --------
    >>> circle_perimeter(1.0, [1.0, 0.0, -1.0]).round(4)
    array([5.2871, 6.2832, 7.384 ])
    """
    rho, g, angle = _turns(radius, gaussian_curvature)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(g > 0.0, np.sin(angle), np.sinh(angle)) / angle
    return 2.0 * np.pi * rho * np.where(angle > 0.0, share, 1.0)


def circle_area(radius: ArrayLike, gaussian_curvature: ArrayLike) -> Floats:
    """A = 4π sin²(√G ρ/2)/G, or sinh² for G < 0: inside a geodesic circle where G is constant; L²."""
    rho, g, angle = _turns(radius, gaussian_curvature)
    half = 0.5 * angle
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(g > 0.0, np.sin(half), np.sinh(half)) / half
    out: Floats = np.pi * rho**2 * np.where(half > 0.0, share, 1.0) ** 2
    return out


def _turns(radius: ArrayLike, gaussian_curvature: ArrayLike) -> tuple[Floats, Floats, Floats]:
    rho = as_values(radius, "radius", positive=True)
    g = as_values(gaussian_curvature, "gaussian_curvature")
    angle: Floats = rho * np.sqrt(np.abs(g))
    if ((g > 0.0) & (angle > np.pi * (1.0 + 1e-12))).any():
        raise ValueError("radius must be at most π/sqrt(G), where geodesics meet again")
    return rho, g, angle


def validity_radius(gaussian_curvature: ArrayLike) -> Floats:
    """ρ = sqrt(6/|G|), where the second term of C equals the first (paper, Eq. condition); infinite at G = 0.

    Examples
    --------
    >>> validity_radius([1.0 / 96.0, 0.0, -1.0 / 64.0]).round(3)
    array([24.   ,    inf, 19.596])
    """
    g = np.abs(as_values(gaussian_curvature, "gaussian_curvature"))
    with np.errstate(divide="ignore"):
        return np.sqrt(6.0 / g)


def curvature_from_perimeter(radius: ArrayLike, perimeter: ArrayLike) -> Floats:
    """G ≈ 3 (2πρ − C)/(πρ³), off by ρ² (ΔG/40 − G²/60)·3 to leading order; 1/L².

    Examples
    --------
    >>> float(curvature_from_perimeter(0.01, circle_perimeter(0.01, 4.0)).round(3))
    4.0
    """
    rho, c = as_values(radius, "radius", positive=True), as_values(perimeter, "perimeter")
    return 3.0 * (2.0 * np.pi * rho - c) / (np.pi * rho**3)


def curvature_from_area(radius: ArrayLike, area: ArrayLike) -> Floats:
    """G ≈ 12 (πρ² − A)/(πρ⁴), off by ρ² (ΔG/240 − G²/360)·12 to leading order; 1/L²."""
    rho, a = as_values(radius, "radius", positive=True), as_values(area, "area")
    return 12.0 * (np.pi * rho**2 - a) / (np.pi * rho**4)
