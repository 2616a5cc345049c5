"""One bubble, consistent to second order in both principal curvatures (derivation: docs/theory.md).

Volume fixed, contact angle 90°, film free to slide and to bulge. With H and D half the sum and half the
difference of the principal curvatures of the surface midway between the plates, ρ² = V/πd, x = d/2ρ:

    E/E0 = 1 − k1 k2 (ρ²/8 + d²/24)
             + H² (ρ²/2) [1 + x²/3 − tan(x)/x]
             + D² {d²/48 + (ρ²/4) [1 − x² − tanh(√3 x)/(√3 x)]} + O(k³).

A *ruled* film, made of normals, does not bulge: for it both square brackets are 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, as_choice
from warpedfoam.theory.bubbles import flat_energy
from warpedfoam.theory.inputs import as_values

#: Kinds of film: free to bulge, or made of straight normals.
FILMS = ("free", "ruled")

ROOT3 = np.sqrt(3.0)


class Coefficients(NamedTuple):
    """E/E0 − 1 = ``gauss`` · k1 k2 + ``mean`` · H² + ``twist`` · D², each a length squared."""

    gauss: Floats
    mean: Floats
    twist: Floats


def midway_curvature(curvature: ArrayLike, gap: ArrayLike, height: ArrayLike = 0.0) -> Floats:
    """k/(1 + (d/2 − t) k), a principal curvature of the surface midway, from the one at height t; 1/L.

    Raises
    ------
    ValueError
        If the surfaces between fold: 1 + (d/2 − t) k is not above 0.

    Examples
    --------
    >>> float(midway_curvature(0.25, gap=0.5).round(6))
    0.235294
    """
    k, d = as_values(curvature, "curvature"), as_values(gap, "gap", positive=True)
    stretch: Floats = 1.0 + (0.5 * d - as_values(height, "height")) * k
    if (stretch <= 0.0).any():
        raise ValueError("gap must be less than the radii of curvature: the surface midway folds")
    return k / stretch


def second_order_coefficients(volume: ArrayLike, gap: ArrayLike, film: str = "free") -> Coefficients:
    """Coefficients of k1 k2, H² and D² in E/E0 (see the module).

    Parameters
    ----------
    volume, gap : float or array
    film : {"free", "ruled"}
        Free to bulge, or made of normals.

    Returns
    -------
    Coefficients

    Raises
    ------
    ValueError
        If the film is free and the gap not below d_crit = (πV)^{1/3}, where the flat cylinder becomes
        unstable and the coefficient of H² infinite.

    Examples
    --------
    >>> [float(c.round(5)) for c in second_order_coefficients(0.5, 0.5)]
    [-0.05021, -0.00089, 0.00224]
    """
    rho2, d, x = _sizes(volume, gap, film)
    gauss = -(rho2 / 8.0 + d**2 / 24.0)
    if film == "ruled":
        return Coefficients(gauss, np.zeros_like(gauss), d**2 / 48.0 + 0.0 * rho2)
    mean = 0.5 * rho2 * (1.0 + x**2 / 3.0 - np.tan(x) / x)
    twist = d**2 / 48.0 + 0.25 * rho2 * (1.0 - x**2 - np.tanh(ROOT3 * x) / (ROOT3 * x))
    return Coefficients(gauss, mean, twist)


def second_order_ratio(
    volume: ArrayLike,
    gap: ArrayLike,
    k1: ArrayLike,
    k2: ArrayLike,
    *,
    height: ArrayLike = 0.0,
    film: str = "free",
) -> Floats:
    """E/E0 to second order in the principal curvatures; the next terms are of third order.

    Parameters
    ----------
    volume, gap : float or array
        V and d.
    k1, k2 : float or array
        Principal curvatures at the bubble's centre, as ``surface.principal_curvatures`` gives them.
    height : float or array
        Where between the plates they are those of a parallel surface: 0 at the inner plate, d/2 midway.
    film : {"free", "ruled"}
        Free to bulge through the gap, or made of the surface's normals.

    Returns
    -------
    array
        Of the arguments' common shape.

    Raises
    ------
    TypeError, ValueError
        If an argument is not made of finite numbers in range, the plates fold, or the film is free and the
        gap not below d_crit = (πV)^{1/3}.

    Examples
    --------
    >>> from warpedfoam.theory import torus_curvatures
    >>> second_order_ratio(0.5, 0.5, *torus_curvatures([0.0, np.pi], 20.0, 4.0)).round(9)
    array([0.99951692, 1.00079337])
    """
    gauss, mean, twist = second_order_coefficients(volume, gap, film)
    a, b = _midway(k1, k2, gap, height)
    return 1.0 + gauss * a * b + mean * (0.5 * (a + b)) ** 2 + twist * (0.5 * (a - b)) ** 2


def second_order_energy(
    volume: ArrayLike,
    gap: ArrayLike,
    k1: ArrayLike,
    k2: ArrayLike,
    tension: ArrayLike = 1.0,
    *,
    height: ArrayLike = 0.0,
    film: str = "free",
) -> Floats:
    """E0 times `second_order_ratio`; energy."""
    ratio = second_order_ratio(volume, gap, k1, k2, height=height, film=film)
    return flat_energy(volume, gap, tension) * ratio


def second_order_pressure(
    volume: ArrayLike,
    gap: ArrayLike,
    k1: ArrayLike,
    k2: ArrayLike,
    tension: ArrayLike = 1.0,
    *,
    height: ArrayLike = 0.0,
    film: str = "free",
) -> Floats:
    """p = ∂E/∂V of `second_order_energy`, against an exterior of pressure 0; energy per volume.

    Examples
    --------
    >>> float(second_order_pressure(0.5, 0.5, 1.0 / 12.0, 1.0 / 12.0).round(5))  # 1.770933 in 3D
    1.77093
    """
    rho2, _, x = _sizes(volume, gap, film)
    v = as_values(volume, "volume", positive=True)
    a, b = _midway(k1, k2, gap, height)
    slope = -0.125 * a * b
    if film == "free":
        s = np.tanh(ROOT3 * x) / (ROOT3 * x)
        slope = slope + (0.5 * (a + b)) ** 2 * (0.5 + 0.25 / np.cos(x) ** 2 - 0.75 * np.tan(x) / x)
        slope = slope + (0.5 * (a - b)) ** 2 * (0.25 - 0.375 * s + 0.125 / np.cosh(ROOT3 * x) ** 2)
    ratio = second_order_ratio(volume, gap, k1, k2, height=height, film=film)
    # E0 grows as √V, and ∂ρ²/∂V = ρ²/V
    return flat_energy(volume, gap, tension) * (0.5 * ratio + rho2 * slope) / v


def film_displacement(
    volume: ArrayLike,
    gap: ArrayLike,
    k1: ArrayLike,
    k2: ArrayLike,
    height: ArrayLike,
    angle: ArrayLike,
) -> Floats:
    """First-order shape of the free film: u = a(t) + b(t) cos 2ψ beyond the radius ρ; length.

        a = −ρH t + ρ² H sin(t/ρ)/cos x,    b = −ρD t + ρ² D sinh(√3 t/ρ)/(√3 cosh √3x)

    Parameters
    ----------
    volume, gap : float or array
    k1, k2 : float or array
        Principal curvatures midway between the plates.
    height : float or array
        t above the surface midway, from −d/2 to d/2.
    angle : float or array
        ψ from the direction of k1.

    Returns
    -------
    array
        The film lies at the point of the surface midway that is ρ + u from the centre, lifted by t. It
        leaves both plates at 90°: ∂u/∂t = 0 at t = ±d/2.

    Raises
    ------
    ValueError
        If the gap is not below d_crit.
    """
    rho2, d, x = _sizes(volume, gap, "free")
    rho, t = np.sqrt(rho2), as_values(height, "height")
    if (np.abs(t) > 0.5 * d * (1.0 + 1e-12)).any():
        raise ValueError("height must lie between −d/2 and d/2, measured from midway between the plates")
    first, second = as_values(k1, "k1"), as_values(k2, "k2")
    even = rho2 * np.sin(t / rho) / np.cos(x) - rho * t
    oval = rho2 * np.sinh(ROOT3 * t / rho) / (ROOT3 * np.cosh(ROOT3 * x)) - rho * t
    psi = as_values(angle, "angle")
    out: Floats = 0.5 * (first + second) * even + 0.5 * (first - second) * oval * np.cos(2.0 * psi)
    return out


def sphere_delta(volume: ArrayLike, gap: ArrayLike, film: str = "free") -> Floats:
    """Δ of E = E0 − Δ E1 G on a large sphere: ¾ + πd³/4V, and 3 (tan(x)/x − 1 − x²/3) more for free films.

    Erratum: the paper reads its Δ ≈ 1 for small bubbles as a success of Δ = 1. The limit of a thin gap is
    ¾; what lifts it to 1 is the gap's thickness.

    Examples
    --------
    >>> sphere_delta([0.3, 0.5, 0.7], 0.5, film="ruled").round(4)
    array([1.0772, 0.9463, 0.8902])
    """
    rho2, _, _ = _sizes(volume, gap, film)
    gauss, mean, _ = second_order_coefficients(volume, gap, film)
    return -6.0 * (gauss + mean) / rho2


def _midway(k1: ArrayLike, k2: ArrayLike, gap: ArrayLike, height: ArrayLike) -> tuple[Floats, Floats]:
    first, second = as_values(k1, "k1"), as_values(k2, "k2")
    return midway_curvature(first, gap, height), midway_curvature(second, gap, height)


def _sizes(volume: ArrayLike, gap: ArrayLike, film: str) -> tuple[Floats, Floats, Floats]:
    """ρ², d and x = d/2ρ."""
    as_choice(film, "film", FILMS)
    v, d = as_values(volume, "volume", positive=True), as_values(gap, "gap", positive=True)
    rho2: Floats = v / (np.pi * d)
    x: Floats = 0.5 * d / np.sqrt(rho2)
    if film == "free" and (x >= 0.5 * np.pi).any():
        raise ValueError(
            "gap must be less than d_crit = (π volume)^(1/3), beyond which the flat cylinder is unstable; "
            f"found {(2.0 / np.pi * x.max()) ** (2.0 / 3.0):.4g} d_crit"
        )
    return rho2, d, x
