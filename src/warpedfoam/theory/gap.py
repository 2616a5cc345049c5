"""Plates that are not quite parallel against plates that are curved (paper, section "Perturbation …")."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats
from warpedfoam.theory.bubbles import curvature_coefficient, flat_energy
from warpedfoam.theory.inputs import as_values


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


def second_order_balance(volume: ArrayLike, gap: ArrayLike, gaussian_curvature: ArrayLike) -> Floats:
    """δd = (¾ + πd³/4V) GV/(3π): `balancing_gap_change` for ruled films, consistent in the curvatures; length.

    To second order in the curvatures E/E0 = 1 − G (ρ²/8 + d²/24) + …, not 1 − G ρ²/6; what is left out is
    the twist of the films, −d² D²/24 with D half the difference of the principal curvatures, and
    relative corrections of the order of the bubble's size over the radii of curvature, squared.

    Examples
    --------
    >>> float((second_order_balance(0.5, 0.5, 0.0125) / balancing_gap_change(0.5, 0.0125)).round(5))
    0.94635
    """
    v, d = as_values(volume, "volume", positive=True), as_values(gap, "gap", positive=True)
    return (0.75 + 0.25 * np.pi * d**3 / v) * balancing_gap_change(v, gaussian_curvature)


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
