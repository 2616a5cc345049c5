"""One bubble by the paper's models: flat cylinder, disk on a sphere, spherical cone, curved cylinder.

Names of equations are those of A. Mughal, S. J. Cox and G. E. Schröder-Turk, *Curvature driven motion of
a bubble in a toroidal Hele-Shaw cell*, Interface Focus 7, 20160106 (2017), "the paper". Lengths are the
user's L; energies are tension × L². Arguments broadcast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats
from warpedfoam.theory.inputs import as_values


def flat_radius(volume: ArrayLike, gap: ArrayLike) -> Floats:
    """ρ = sqrt(V / πd), the radius of a flat cylinder (paper, Eq. grad); length.

    Examples
    --------
    >>> flat_radius([0.3, 0.7], 0.5).round(4)  # the paper's range
    array([0.437 , 0.6676])
    """
    v, d = as_values(volume, "volume", positive=True), as_values(gap, "gap", positive=True)
    return np.sqrt(v / (np.pi * d))


def flat_energy(volume: ArrayLike, gap: ArrayLike, tension: ArrayLike = 1.0) -> Floats:
    """E0 = 2γ sqrt(πVd) = 2πγρd, a cylinder between flat plates (paper, Eqs. fenergy, Ecoefs).

    Examples
    --------
    >>> float(flat_energy(0.5, 0.5).round(6))
    1.772454
    """
    v, d = as_values(volume, "volume", positive=True), as_values(gap, "gap", positive=True)
    return 2.0 * as_values(tension, "tension", positive=True) * np.sqrt(np.pi * v * d)


def curvature_coefficient(volume: ArrayLike, gap: ArrayLike, tension: ArrayLike = 1.0) -> Floats:
    """E1 = γ sqrt(V³/d) / (3 √π) of E = E0 − E1 G (paper, Eq. Ecoefs); energy × L².

    Notes
    -----
    E1/E0 = V/(6πd) = ρ²/6. Erratum: E1 takes the perimeter at fixed radius ρ but ρ(V) of flat plates; at
    fixed area of the bubble the coefficient is ¾ E1, and the gap's thickness adds terms of the same order
    (`warpedfoam.theory.second_order`).
    """
    v, d = as_values(volume, "volume", positive=True), as_values(gap, "gap", positive=True)
    out: Floats = as_values(tension, "tension", positive=True) * np.sqrt(v**3 / d) / (3.0 * np.sqrt(np.pi))
    return out


def cylinder_energy(
    volume: ArrayLike, gap: ArrayLike, gaussian_curvature: ArrayLike, tension: ArrayLike = 1.0
) -> Floats:
    """E = E0 − E1 G, the paper's model for any curved cell (Eq. approxE).

    Parameters
    ----------
    volume, gap : float or array
        V and d, above 0.
    gaussian_curvature : float or array
        G of the inner plate at the bubble, 1/L².
    tension : float or array
        γ per film area, both faces included.

    Returns
    -------
    array
        Of the arguments' common shape.

    Raises
    ------
    TypeError, ValueError
        If an argument is not made of finite numbers (above 0, but for G).

    Examples
    --------
    >>> float(cylinder_energy(0.5, 0.5, 1.0 / 96.0).round(6))  # outer equator of the paper's torus
    1.771474
    """
    g = as_values(gaussian_curvature, "gaussian_curvature")
    return flat_energy(volume, gap, tension) - curvature_coefficient(volume, gap, tension) * g


def critical_gap(volume: ArrayLike) -> Floats:
    """d_crit = (πV)^{1/3}: in a wider gap the flat cylinder is unstable (Cox, Weaire and Vaz 2002); length.

    There d = πρ: the gap is half the wavelength at which a cylinder of liquid breaks up.

    Examples
    --------
    >>> float(critical_gap(0.5).round(4))
    1.1624
    """
    return np.cbrt(np.pi * as_values(volume, "volume", positive=True))


# --- groups without dimension (Eqs. spscale, scale, vscale) -----------------------------------------


def cone_angle(volume: ArrayLike, gap: ArrayLike, gaussian_curvature: ArrayLike) -> Floats:
    """θ = ρ sqrt|G| with ρ = sqrt(V/πd) (paper, Eqs. spscale and scale); radians.

    Examples
    --------
    >>> float(cone_angle(0.7, 0.5, 0.01).round(5))  # the paper's largest on a sphere
    0.06676
    """
    g = as_values(gaussian_curvature, "gaussian_curvature")
    return flat_radius(volume, gap) * np.sqrt(np.abs(g))


def relative_gap(gap: ArrayLike, gaussian_curvature: ArrayLike) -> Floats:
    """d* = d sqrt|G| (paper, Eq. scale)."""
    g = as_values(gaussian_curvature, "gaussian_curvature")
    return as_values(gap, "gap", positive=True) * np.sqrt(np.abs(g))


def relative_volume(volume: ArrayLike, gap: ArrayLike) -> Floats:
    """V* = V/d³ (paper, Eq. vscale)."""
    return as_values(volume, "volume", positive=True) / as_values(gap, "gap", positive=True) ** 3


# --- spheres --------------------------------------------------------------------------------------------


def cap_area(radius: ArrayLike, sphere_radius: ArrayLike) -> Floats:
    """S = 2πr² (1 − cos(ρ/r)), inside a geodesic circle of radius ρ (paper, Eq. circarea0); L²."""
    rho, r = _rho_and_r(radius, sphere_radius)
    out: Floats = 4.0 * np.pi * r**2 * np.sin(0.5 * rho / r) ** 2
    return out


def cap_perimeter(radius: ArrayLike, sphere_radius: ArrayLike) -> Floats:
    """C = 2πr sin(ρ/r) (paper, Eq. circlen); length."""
    rho, r = _rho_and_r(radius, sphere_radius)
    return 2.0 * np.pi * r * np.sin(rho / r)


def disk_perimeter(area: ArrayLike, gaussian_curvature: ArrayLike) -> Floats:
    """P = sqrt(4πA − G A²), the least perimeter round an area A at constant G; length.

    On a sphere it is 2πr sqrt(1 − (1 − S/2πr²)²), the paper's 2D bubble (Eq. of E^2D), without the loss of
    digits for large r. A sphere holds no more than A = 4π/G.

    Raises
    ------
    ValueError
        If an area is larger than the whole sphere.

    Examples
    --------
    >>> float(disk_perimeter(2.0 * np.pi, 1.0).round(12))  # half the unit sphere: a great circle
    6.28318530718
    """
    a = as_values(area, "area", positive=True)
    g = as_values(gaussian_curvature, "gaussian_curvature")
    if (a * g > 4.0 * np.pi * (1.0 + 1e-12)).any():
        raise ValueError("area must be at most 4π/G, that of the whole sphere")
    return np.sqrt(np.maximum(a * (4.0 * np.pi - g * a), 0.0))


def shell_factor(power: int, gap: ArrayLike, sphere_radius: ArrayLike) -> Floats:
    """σ_n = (1 + d/r)^n − 1 for shells from r to r + d."""
    d = as_values(gap, "gap", positive=True)
    out: Floats = np.expm1(power * np.log1p(d / as_values(sphere_radius, "sphere_radius", positive=True)))
    return out


def cone_film_area(radius: ArrayLike, gap: ArrayLike, sphere_radius: ArrayLike) -> Floats:
    """A_T = πr² σ2 sin(ρ/r), side of a cone of inner geodesic radius ρ (paper, Eq. areacone); L²."""
    rho, r = _rho_and_r(radius, sphere_radius)
    return np.pi * r**2 * shell_factor(2, gap, r) * np.sin(rho / r)


def cone_volume(radius: ArrayLike, gap: ArrayLike, sphere_radius: ArrayLike) -> Floats:
    """V = (2πr³/3) σ3 (1 − cos(ρ/r)) (paper, Eq. volcone); L³."""
    rho, r = _rho_and_r(radius, sphere_radius)
    out: Floats = 4.0 * np.pi * r**3 / 3.0 * shell_factor(3, gap, r) * np.sin(0.5 * rho / r) ** 2
    return out


def spherical_cone_energy(
    volume: ArrayLike, gap: ArrayLike, sphere_radius: ArrayLike, tension: ArrayLike = 1.0
) -> Floats:
    """E = γπr² σ2 sqrt(1 − (1 − 3V/(2πσ3 r³))²), exact for a film along the normals (paper, Eq. scenergy).

    Parameters
    ----------
    volume, gap, sphere_radius : float or array
        V, d and the radius r of the inner plate.
    tension : float or array
        γ.

    Returns
    -------
    array
        Of the arguments' common shape.

    Raises
    ------
    TypeError, ValueError
        If an argument is not made of finite numbers above 0, or the bubble is larger than the shell.

    Examples
    --------
    >>> float((spherical_cone_energy(0.5, 0.5, 10.0) / flat_energy(0.5, 0.5)).round(6))
    0.999522
    """
    share = _shell_share(volume, gap, sphere_radius)
    r = as_values(sphere_radius, "sphere_radius", positive=True)
    # 1 − (1 − 2s)² = 4s(1 − s) keeps the digits of small bubbles
    root = 2.0 * np.sqrt(share * (1.0 - share))
    gamma = as_values(tension, "tension", positive=True)
    return gamma * np.pi * r**2 * shell_factor(2, gap, r) * root


def spherical_cone_ratio(volume: ArrayLike, gap: ArrayLike, sphere_radius: ArrayLike) -> Floats:
    """E/E0 = σ2 r²/(2ρd) · sqrt(1 − (1 − 3V/(2πσ3 r³))²) of a spherical cone.

    Erratum: the paper's Eq. analytical1 prints the factor before the root upside down.

    Examples
    --------
    >>> spherical_cone_ratio(0.3, 0.5, [10.0, 26.0]).round(7)
    array([0.9996737, 0.9999502])
    """
    return spherical_cone_energy(volume, gap, sphere_radius) / flat_energy(volume, gap)


def spherical_cone_radius(volume: ArrayLike, gap: ArrayLike, sphere_radius: ArrayLike) -> Floats:
    """ρ = r arccos(1 − 3V/(2πσ3 r³)), the cone's geodesic radius on the inner plate; length."""
    share = _shell_share(volume, gap, sphere_radius)
    return 2.0 * as_values(sphere_radius, "sphere_radius", positive=True) * np.arcsin(np.sqrt(share))


def _shell_share(volume: ArrayLike, gap: ArrayLike, sphere_radius: ArrayLike) -> Floats:
    """Volume over that of the whole shell."""
    v = as_values(volume, "volume", positive=True)
    r = as_values(sphere_radius, "sphere_radius", positive=True)
    share: Floats = v / (4.0 * np.pi / 3.0 * r**3 * shell_factor(3, gap, r))
    if (share > 1.0).any():
        raise ValueError(f"volume must be at most that of the shell, but is {share.max():g} times as large")
    return share


def _rho_and_r(radius: ArrayLike, sphere_radius: ArrayLike) -> tuple[Floats, Floats]:
    rho = as_values(radius, "radius", positive=True)
    r = as_values(sphere_radius, "sphere_radius", positive=True)
    if (rho > np.pi * r * (1.0 + 1e-12)).any():
        raise ValueError("radius must be at most π sphere_radius, the distance of opposite points")
    return rho, r


# --- tori -----------------------------------------------------------------------------------------------


def torus_curvatures(
    phi: ArrayLike, major_radius: ArrayLike, minor_radius: ArrayLike
) -> tuple[Floats, Floats]:
    """k1 = 1/r and k2 = cos φ / (R + r cos φ) of a torus, φ = 0 on the outer equator; 1/L.

    Their product is G (paper, Eq. Gtorus).

    Raises
    ------
    ValueError
        If a major radius does not exceed the minor one.

    Examples
    --------
    >>> k1, k2 = torus_curvatures([0.0, np.pi], 20.0, 4.0)
    >>> (k1 * k2).round(6)
    array([ 0.010417, -0.015625])
    """
    ring = as_values(major_radius, "major_radius", positive=True)
    tube = as_values(minor_radius, "minor_radius", positive=True)
    if (ring <= tube).any():
        raise ValueError("major_radius must exceed minor_radius")
    cos = np.cos(as_values(phi, "phi"))
    along = cos / (ring + tube * cos)
    return np.broadcast_to(1.0 / tube, along.shape).copy(), along


def torus_gaussian_curvature(phi: ArrayLike, major_radius: ArrayLike, minor_radius: ArrayLike) -> Floats:
    """G = cos φ / (r (R + r cos φ)) (paper, Eq. Gtorus); 1/L²."""
    k1, k2 = torus_curvatures(phi, major_radius, minor_radius)
    return k1 * k2


def fitted_ratio(
    delta: ArrayLike, volume: ArrayLike, gap: ArrayLike, gaussian_curvature: ArrayLike
) -> Floats:
    """E/E0 = 1 − Δ (E1/E0) G, the form that the paper fits to its tori (Eq. Tfit)."""
    g = as_values(gaussian_curvature, "gaussian_curvature")
    share = curvature_coefficient(volume, gap) / flat_energy(volume, gap)
    return 1.0 - as_values(delta, "delta") * share * g


def fit_delta(ratio: ArrayLike, volume: float, gap: float, gaussian_curvature: ArrayLike) -> float:
    """Δ of `fitted_ratio` by least squares over positions, as in the paper's inset.

    Parameters
    ----------
    ratio, gaussian_curvature : (n,) array
        E/E0 and G at each position.
    volume, gap : float

    Returns
    -------
    float
        Σ g (1 − E/E0) / Σ g² with g = G E1/E0.

    Raises
    ------
    ValueError
        If G is 0 everywhere: there is nothing to fit.

    Examples
    --------
    >>> g = torus_gaussian_curvature(np.radians([0.0, 60.0, 120.0, 180.0]), 20.0, 4.0)
    >>> round(fit_delta(fitted_ratio(0.9, 0.5, 0.5, g), 0.5, 0.5, g), 9)
    0.9
    """
    scale = 1.0 - fitted_ratio(1.0, volume, gap, gaussian_curvature)
    square = float((scale**2).sum())
    if square == 0.0:
        raise ValueError("gaussian_curvature is 0 everywhere: there is no Δ to fit")
    return float((scale * (1.0 - as_values(ratio, "ratio"))).sum()) / square
