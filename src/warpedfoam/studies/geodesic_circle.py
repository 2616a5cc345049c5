"""`geodesic_circle`: perimeter and area of geodesic circles, by three methods that check one another."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, as_choice, as_floats, as_integer, as_number, frozen
from warpedfoam.studies.measured_circle import exact_circle, heat_circle
from warpedfoam.studies.rims import require_on_surface
from warpedfoam.studies.traced_circle import MOST_DIRECTIONS, require_off_rim, traced_circle
from warpedfoam.surfaces.mesh_surface import MeshSurface
from warpedfoam.surfaces.protocol import Surface
from warpedfoam.theory import curvature_from_area, curvature_from_perimeter, validity_radius

#: Ways to find the circle.
CIRCLE_METHODS = ("jacobi", "exact", "heat")
#: Default edge length in radii.
SPACING = 0.1


@dataclass(frozen=True, eq=False)
class GeodesicCircle:
    """The points at geodesic distance ``radius`` from ``centre``, and what they enclose.

    Attributes
    ----------
    centre : (3,) array
        On the surface.
    radius : float
        ρ.
    perimeter, area : float
        C(q) and A(q).
    points : (n, 3) array
        Of the circle, in order; evenly spread in direction for "jacobi".
    error, area_error : float
        Estimates of what C and A are off by.
    gaussian_curvature : float
        G at the centre.
    method : str
    spacing : float or None
        Mean edge of the mesh (before the last halving for "exact"); None for "jacobi".
    """

    centre: Floats
    radius: float
    perimeter: float
    area: float
    points: Floats
    error: float
    area_error: float
    gaussian_curvature: float
    method: str
    spacing: float | None = None

    @property
    def curvature_from_perimeter(self) -> float:
        """G ≈ 3 (2πρ − C)/(πρ³)."""
        return float(curvature_from_perimeter(self.radius, self.perimeter))

    @property
    def curvature_from_area(self) -> float:
        """G ≈ 12 (πρ² − A)/(πρ⁴)."""
        return float(curvature_from_area(self.radius, self.area))

    @property
    def series_limit(self) -> float:
        """sqrt(6/|G|): the paper's bound on ρ for the series (`warpedfoam.theory.validity_radius`)."""
        return float(validity_radius(self.gaussian_curvature))

    def film_area(self, gap: float) -> float:
        """d · C(q), the paper's area of the film over the circle in a gap d."""
        return as_number(gap, "gap", positive=True) * self.perimeter

    def film_energy(self, gap: float, tension: float = 1.0) -> float:
        """γ d C(q)."""
        return as_number(tension, "tension", positive=True) * self.film_area(gap)


def geodesic_circle(
    surface: Surface,
    centre: ArrayLike,
    radius: float,
    method: str = "jacobi",
    *,
    spacing: float | None = None,
    n_directions: int = 64,
    tolerance: float | None = None,
) -> GeodesicCircle:
    """Find the points at geodesic distance ``radius`` from a point, their perimeter and the area inside.

    Parameters
    ----------
    surface : Surface
        Formula or mesh.
    centre : (3,) array
        Any point; projected to the surface.
    radius : float
        ρ > 0.
    method : {"jacobi", "exact", "heat"}
        "jacobi" traces geodesics and the Jacobi equation m'' = −G m, C = ∫ m dθ: about 1e-12 on formulas.
        "exact" takes isolines of exact distances on a fine mesh round the centre, at two edge lengths,
        and extrapolates: good to a percent or two of the curvature term at a spacing of 0.2 ρ. "heat"
        takes isolines of libigl's heat distances, which cannot resolve the curvature term.
    spacing : float, optional
        Edge length of the mesh for "exact" and "heat", by default ρ/10. The surface's own mesh is refined
        round the centre until its edges are about as short (within a factor of 1.3, or shorter).
    n_directions : int
        Geodesics to begin with for "jacobi", a multiple of 4; doubled until C and A stay, at most to 1024.
    tolerance : float, optional
        Relative accuracy that "jacobi" aims at, from 1e-13 to 1e-3; by default 1e-12, on meshes 1e-7, which
        is far below what their curvatures are known to.

    Returns
    -------
    GeodesicCircle

    Raises
    ------
    TypeError
        If ``surface`` is not a surface, or an argument has the wrong type.
    ValueError
        If an argument is out of range; if "jacobi" meets a conjugate point before ρ or its circle crosses
        itself; if the points at distance ρ on the mesh do not make one closed curve; if a geodesic of
        length ρ leaves the surface over its rim.
    ResolutionError
        If the mesh is too coarse for the radius, or the spacing too fine for memory.
    ConvergenceError
        If the integration or libigl fails.

    Notes
    -----
    What is checked of the injectivity radius: m > 0 at every step of every geodesic (no conjugate point),
    and that the circle, interpolated to 1024 points, does not cross itself. A circle whose radius exceeds
    the injectivity radius by less than about 5e-6 of itself may pass. C, A and ``error`` of "jacobi" come
    from an adaptive Runge–Kutta method of order 8 (DOP853) on all directions at once, run at
    the tolerance and at 100 times that; the error is the difference between the runs plus what the last
    doubling of directions changed.

    Examples
    --------
    >>> import numpy as np
    >>> import warpedfoam as wf
    >>> torus = wf.Torus(major_radius=20.0, minor_radius=4.0)
    >>> circle = wf.geodesic_circle(torus, [24.0, 0.0, 0.0], radius=0.5)
    >>> round(circle.perimeter / np.pi, 9), circle.error < 1e-9
    (0.999566452, True)
    >>> round(circle.curvature_from_perimeter, 6), round(circle.gaussian_curvature, 6)
    (0.010405, 0.010417)
    >>> wf.geodesic_circle(torus, [24.0, 0.0, 0.0], radius=13.0)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ValueError: radius must be smaller, got 13: the circle crosses itself near ...
    """
    if isinstance(surface, type) or not isinstance(surface, Surface):
        raise TypeError(
            f"surface must be a surface such as Sphere(1.0) or Torus(20.0, 4.0), got {type(surface).__name__}"
        )
    place = as_floats(centre, "centre", (3,))
    rho = as_number(radius, "radius", positive=True)
    as_choice(method, "method", CIRCLE_METHODS)
    count = as_integer(n_directions, "n_directions", minimum=16, maximum=MOST_DIRECTIONS)
    if count % 4:
        raise ValueError(f"n_directions must be a multiple of 4, got {count}")
    if tolerance is None:
        goal = 1e-7 if isinstance(surface, MeshSurface) else 1e-12
    else:
        goal = as_number(tolerance, "tolerance", minimum=1e-13, maximum=1e-3)
    if rho > 10.0 * surface.size:
        raise ValueError(f"radius must be at most ten times the surface's size {surface.size:g}, got {rho:g}")
    q = surface.project(place[None])[0]
    require_on_surface(surface, q, "centre")
    gauss = float(surface.gaussian_curvature(q[None])[0])
    if method == "jacobi":
        if spacing is not None:
            raise ValueError("spacing is for method='exact' and 'heat' only: 'jacobi' needs no mesh")
        traced = traced_circle(surface, q, rho, count, goal)
        return GeodesicCircle(
            frozen(q),
            rho,
            traced.perimeter,
            traced.area,
            frozen(traced.points),
            traced.perimeter_error,
            traced.area_error,
            gauss,
            method,
        )
    require_off_rim(surface, q, rho)
    edge = SPACING * rho if spacing is None else as_number(spacing, "spacing", positive=True)
    measure = exact_circle if method == "exact" else heat_circle
    line, error, area_error, found = measure(surface, q, rho, edge)
    return GeodesicCircle(
        frozen(q),
        rho,
        line.perimeter,
        line.area,
        frozen(line.points),
        error,
        area_error,
        gauss,
        method,
        found,
    )
