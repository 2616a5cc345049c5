"""Plates that are not quite parallel against plates that are curved (paper, section "Perturbation …")."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats
from warpedfoam.theory.bubbles import curvature_coefficient, flat_energy
from warpedfoam.theory.inputs import as_values
from warpedfoam.theory.second_order import second_order_ratio


def gap_energy_change(
    volume: ArrayLike, gap: ArrayLike, gap_change: ArrayLike, tension: ArrayLike = 1.0, *, exact: bool = False
) -> Floats:
    """ΔE = (E0/2) δd/d for a cylinder between flat plates at d + δd (paper, Eq. diff1); energy.

    ``exact`` gives E0 (sqrt(1 + δd/d) − 1), of which the paper keeps the first order.

    Raises
    ------
    TypeError, ValueError
        If an argument is not made of finite numbers in range, or d + δd is not above 0.

    Examples
    --------
    >>> float(gap_energy_change(0.5, 0.5, 0.001).round(6))
    0.001772
    """
    energy = flat_energy(volume, gap, tension)
    share: Floats = as_values(gap_change, "gap_change") / as_values(gap, "gap", positive=True)
    if (share <= -1.0).any():
        raise ValueError("gap_change must leave a gap: d + δd must be greater than 0")
    return energy * (np.expm1(0.5 * np.log1p(share)) if exact else 0.5 * share)


def curvature_energy_change(
    volume: ArrayLike, gap: ArrayLike, gaussian_curvature: ArrayLike, tension: ArrayLike = 1.0
) -> Floats:
    """ΔE = −E1 G (paper, Eq. diff2); energy."""
    g = as_values(gaussian_curvature, "gaussian_curvature")
    return -curvature_coefficient(volume, gap, tension) * g


def gap_to_curvature_ratio(volume: ArrayLike, gap_change: ArrayLike, gaussian_curvature: ArrayLike) -> Floats:
    """−3πδd/(GV), the energy change by the gap over that by curvature (paper, Eq. Eratios).

    Raises
    ------
    ValueError
        If G is 0 somewhere: curvature changes nothing there.
    """
    g = as_values(gaussian_curvature, "gaussian_curvature")
    if (g == 0.0).any():
        raise ValueError("gaussian_curvature must not be 0: there is no energy change to compare with")
    v = as_values(volume, "volume", positive=True)
    return -3.0 * np.pi * as_values(gap_change, "gap_change") / (g * v)


def balancing_gap_change(volume: ArrayLike, gaussian_curvature: ArrayLike) -> Floats:
    """δd = GV/(3π), the change of the gap that makes up for the curvature; length.

    Curvature dominates where |δd| is much less than |GV/3π|. Erratum: for V = 0.5 on a sphere of radius 12
    the paper prints 0.00036; it is 0.000368.

    Examples
    --------
    >>> float(balancing_gap_change(0.5, 1.0 / 144.0).round(6))
    0.000368
    """
    v = as_values(volume, "volume", positive=True)
    return as_values(gaussian_curvature, "gaussian_curvature") * v / (3.0 * np.pi)


def second_order_balance(
    volume: ArrayLike,
    gap: ArrayLike,
    k1: ArrayLike,
    k2: ArrayLike,
    *,
    height: ArrayLike = 0.0,
    film: str = "free",
) -> Floats:
    """δd = 2d (1 − E/E0) with `second_order_ratio`: `balancing_gap_change` to second order; length.

    Its change from one place to another is that of the gap which leaves a bubble no preference. On top of a
    torus, films ruled, the tube must be shifted by (¾ + 5πd³/16V) V/(3π (r + d/2) R), not by V/(3πrR).

    Examples
    --------
    >>> from warpedfoam.theory import torus_curvatures
    >>> k1, k2 = torus_curvatures([1.57, 1.5716], 20.0, 4.0)
    >>> above, below = second_order_balance(0.5, 0.5, k1, k2, film="ruled")
    >>> float(((above - below) / 0.0016).round(6))  # the paper: 0.000663
    0.000621
    """
    ratio = second_order_ratio(volume, gap, k1, k2, height=height, film=film)
    out: Floats = 2.0 * as_values(gap, "gap", positive=True) * (1.0 - ratio)
    return out


def varying_gap_energy(
    volume: ArrayLike,
    gap: ArrayLike,
    slope: ArrayLike,
    laplacian: ArrayLike = 0.0,
    tension: ArrayLike = 1.0,
) -> Floats:
    """E = 2γ sqrt(πVd) [1 − ρ²|∇d|²/8d² + 3ρ²Δd/16d] of a bubble over a plane; energy.

    d, |∇d| and Δd are those at the bubble's centre of volume and ρ² = V/πd; the next terms are of fourth
    order in ρ over the length along which the gap changes. Derivation: docs/gaps.md.

    Parameters
    ----------
    volume, gap : float or array
    slope : float or array
        |∇d|.
    laplacian : float or array, optional
        Δd.
    tension : float or array, optional

    Raises
    ------
    TypeError, ValueError
        If an argument is not made of finite numbers in range.

    Examples
    --------
    >>> float(varying_gap_energy(1.0, 1.0, slope=0.02).round(6))
    3.544851
    """
    d = as_values(gap, "gap", positive=True)
    rho2 = as_values(volume, "volume", positive=True) / (np.pi * d)
    steep, bent = as_values(slope, "slope"), as_values(laplacian, "laplacian")
    change = 0.1875 * rho2 * bent / d - 0.125 * rho2 * (steep / d) ** 2
    return flat_energy(volume, gap, tension) * (1.0 + change)
