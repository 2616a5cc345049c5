"""`thomson_points`: points on a surface that repel each other, as even starts for foams."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, as_generator, as_instance, as_integer, as_number, as_points, frozen
from warpedfoam.errors import ConvergenceError
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.surfaces.protocol import Surface

#: Pairs handled at once, and iterations between returns to the surface.
BLOCK, ROUND = 2_000_000, 50
#: What the logarithm of an energy never reaches.
WALL = 1e3


@dataclass(frozen=True, eq=False)
class ThomsonPoints:
    """Points at a local minimum of their Riesz energy.

    Attributes
    ----------
    points : (n, 3) array
        On the surface.
    energy : float
        Σ_{i<j} 1/|x_i − x_j|^s.
    exponent : float
        s.
    force : float
        Largest tangential force on a point, in units of s E / (n ℓ), ℓ = sqrt(area/n).
    iterations : int
    seed : int or None
        The random seed; None if a generator or points were given.
    """

    points: Floats
    energy: float
    exponent: float
    force: float
    iterations: int
    seed: int | None


def thomson_points(
    surface: Surface,
    n: int,
    *,
    seed: int | np.random.Generator = 0,
    exponent: float = 3.0,
    start: ArrayLike | None = None,
    max_iterations: int = 500,
    tolerance: float = 1e-5,
) -> ThomsonPoints:
    """Let points on a surface repel each other until they rest.

    Minimises the Riesz energy E = Σ_{i<j} 1/r_ij^s of straight distances (to nearest images on surfaces
    that repeat) by L-BFGS over E(Π(y)), Π the projection on the surface. At y = x + δ n the chain rule
    needs dΠ = (I + δ W)⁻¹ (I − n nᵀ), and δ is set back to 0 every 50 iterations.

    Parameters
    ----------
    surface : Surface
    n : int
        Number of points, at least 2.
    seed : int or numpy.random.Generator, optional
        Of the uniformly random start.
    exponent : float, optional
        s, from 0.5 to 12. 1 is Thomson's problem; from 2 on the points spread evenly by area on any
        surface as n grows, while charges (s = 1) crowd where a surface sticks out.
    start : (n, 3) array, optional
        Points to begin with; projected.
    max_iterations : int, optional
    tolerance : float, optional
        Stop once the largest force is below this (see `ThomsonPoints.force`). Not reaching it in
        ``max_iterations`` is no error: look at ``force``.

    Returns
    -------
    ThomsonPoints

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range.
    ConvergenceError
        If the energy is not finite: points coincide.

    Notes
    -----
    One evaluation costs O(n²) time, and memory for two million pairs. On surfaces that repeat the force
    jumps where the nearest image of a pair changes, and need not fall below about 1e-2.

    References
    ----------
    D. P. Hardin and E. B. Saff, Notices of the AMS 51, 1186 (2004), for the even spread at s ≥ 2.

    Examples
    --------
    >>> from warpedfoam import Sphere
    >>> found = thomson_points(Sphere(1.0), 12, seed=0, exponent=1.0)
    >>> round(found.energy, 6)  # the icosahedron
    49.165253
    """
    as_instance(surface, "surface", Surface)  # type: ignore[type-abstract]
    count = as_integer(n, "n", minimum=2, maximum=50_000)
    rng = as_generator(seed)
    s = as_number(exponent, "exponent", minimum=0.5, maximum=12.0)
    limit = as_integer(max_iterations, "max_iterations", minimum=0)
    goal = as_number(tolerance, "tolerance", minimum=0.0, maximum=1.0)
    if start is None:
        points = surface.random_points(count, rng)
    else:
        points = surface.project(as_points(start, "start"))
        if len(points) != count:
            raise ValueError(f"start must hold n = {count} points, got {len(points)}")
    from scipy.optimize import minimize

    spacing = float(np.sqrt(surface.area / count))
    done = 0
    energy, force = energy_and_force(surface, points, s, spacing)
    while done < limit and force > goal:
        # the logarithm, in units of the spacing: random starts have energies of any size
        found = minimize(
            _objective,
            points.ravel() / spacing,
            (surface, s, spacing),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": min(ROUND, limit - done), "maxcor": 20, "ftol": 0.0, "gtol": 0.0},
        )
        moved = surface.project(found.x.reshape(-1, 3) * spacing)
        lower, force_now = energy_and_force(surface, moved, s, spacing)
        done += max(int(found.nit), 1)
        gained = energy - lower
        if gained < 0.0:
            break
        points, energy, force = moved, lower, force_now
        if gained <= 1e-14 * energy:
            break
    fixed = None if isinstance(seed, np.random.Generator) or start is not None else int(seed)
    return ThomsonPoints(frozen(points), energy, s, force, done, fixed)


def energy_and_force(surface: Surface, points: Floats, s: float, spacing: float) -> tuple[float, float]:
    """Riesz energy, and the largest tangential force in units of s E / (n ℓ)."""
    energy, slope = riesz_energy(points, s, surface.period)
    if not np.isfinite(energy):
        raise ConvergenceError("the points' energy is not finite: two points coincide; use another seed")
    n = surface.normals(points)
    tangent = slope - np.einsum("ij,ij->i", slope, n)[:, None] * n
    unit = s * energy / (len(points) * spacing)
    return energy, float(np.linalg.norm(tangent, axis=1).max() / unit)


def _objective(unknowns: Floats, surface: Surface, s: float, spacing: float) -> tuple[float, Floats]:
    """log(E(Π(y)) spacing^s) and its gradient by the unknowns, y / spacing."""
    y = unknowns.reshape(-1, 3) * spacing
    try:
        x = surface.project(y)
    except ValueError:  # a trial step so far that a point has no nearest point: a wall to step back from
        return WALL, np.zeros(y.size)
    energy, slope = riesz_energy(x, s, surface.period)
    if not np.isfinite(energy):
        return WALL, np.zeros(y.size)
    n = surface.normals(x)
    height = np.einsum("ij,ij->i", nearest_image(y - x, surface.period), n)
    tangent = slope - np.einsum("ij,ij->i", slope, n)[:, None] * n
    bent = np.eye(3) + height[:, None, None] * surface.shape_operators(x, project=False)
    gradient = np.linalg.solve(bent, tangent[:, :, None])[:, :, 0]
    return float(np.log(energy) + s * np.log(spacing)), (gradient * (spacing / energy)).ravel()


def riesz_energy(points: Floats, exponent: float, period: Floats | None = None) -> tuple[float, Floats]:
    """Σ_{i<j} 1/r_ij^s and its gradient (n, 3); infinite if points coincide.

    Examples
    --------
    >>> riesz_energy(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), 2.0)[0]
    0.25
    """
    from scipy.spatial.distance import cdist

    n, total = len(points), 0.0
    gradient = np.empty_like(points)
    for rows in _blocks(n):
        here = np.arange(n)[rows]
        if period is None:
            square = cdist(points[rows], points, "sqeuclidean")
        else:
            apart = nearest_image(points[rows, None] - points[None], period)
            square = np.einsum("ijk,ijk->ij", apart, apart)
        square[np.arange(len(here)), here] = np.inf
        if not square.all():
            return np.inf, np.zeros_like(points)
        power = square ** (-0.5 * exponent)
        total += float(power.sum())
        weight = (-exponent) * power / square
        if period is None:
            gradient[rows] = weight.sum(axis=1)[:, None] * points[rows] - weight @ points
        else:
            gradient[rows] = np.einsum("ij,ijk->ik", weight, apart)
    return 0.5 * total, gradient


def _blocks(n: int) -> Iterator[slice]:
    step = max(1, BLOCK // n)
    return (slice(first, first + step) for first in range(0, n, step))
