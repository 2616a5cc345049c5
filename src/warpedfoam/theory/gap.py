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
