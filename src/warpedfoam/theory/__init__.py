"""Formulas for one bubble in a curved Hele-Shaw cell: the paper's models, and what goes beyond them.

Pure functions of numbers or arrays that broadcast. The paper is A. Mughal, S. J. Cox and G. E.
Schröder-Turk, *Curvature driven motion of a bubble in a toroidal Hele-Shaw cell*, Interface Focus 7,
20160106 (2017). Derivations and errata: docs/theory.md.

>>> from warpedfoam import theory
>>> float(theory.cylinder_energy(volume=0.5, gap=0.5, gaussian_curvature=0.01).round(6))
1.771514
"""

from warpedfoam.theory.bubbles import (
    cap_area,
    cap_perimeter,
    cone_angle,
    cone_film_area,
    cone_volume,
    critical_gap,
    curvature_coefficient,
    cylinder_energy,
    disk_perimeter,
    fit_delta,
    fitted_ratio,
    flat_energy,
    flat_radius,
    relative_gap,
    relative_volume,
    shell_factor,
    spherical_cone_energy,
    spherical_cone_radius,
    spherical_cone_ratio,
    torus_curvatures,
    torus_gaussian_curvature,
)
from warpedfoam.theory.circles import (
    area_series,
    circle_area,
    circle_perimeter,
    curvature_from_area,
    curvature_from_perimeter,
    perimeter_series,
    validity_radius,
)
from warpedfoam.theory.gap import (
    balancing_gap_change,
    curvature_energy_change,
    gap_energy_change,
    gap_to_curvature_ratio,
    second_order_balance,
    varying_gap_energy,
)
from warpedfoam.theory.second_order import (
    Coefficients,
    film_displacement,
    midway_curvature,
    second_order_coefficients,
    second_order_energy,
    second_order_pressure,
    second_order_ratio,
    sphere_delta,
)

__all__ = [
    "Coefficients",
    "area_series",
    "balancing_gap_change",
    "cap_area",
    "cap_perimeter",
    "circle_area",
    "circle_perimeter",
    "cone_angle",
    "cone_film_area",
    "cone_volume",
    "critical_gap",
    "curvature_coefficient",
    "curvature_energy_change",
    "curvature_from_area",
    "curvature_from_perimeter",
    "cylinder_energy",
    "disk_perimeter",
    "film_displacement",
    "fit_delta",
    "fitted_ratio",
    "flat_energy",
    "flat_radius",
    "gap_energy_change",
    "gap_to_curvature_ratio",
    "midway_curvature",
    "perimeter_series",
    "relative_gap",
    "relative_volume",
    "second_order_balance",
    "second_order_coefficients",
    "second_order_energy",
    "second_order_pressure",
    "second_order_ratio",
    "shell_factor",
    "sphere_delta",
    "spherical_cone_energy",
    "spherical_cone_radius",
    "spherical_cone_ratio",
    "torus_curvatures",
    "torus_gaussian_curvature",
    "validity_radius",
    "varying_gap_energy",
]
