"""Surfaces, film energies and volumes as formulas of the Surface Evolver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.foam import Foam
from warpedfoam.kernels.quadrature import gauss
from warpedfoam.surfaces import Sphere, Torus

OneForm = tuple[str, str, str]


@dataclass(frozen=True, eq=False)
class Formulas:
    """What the Evolver has to know of a surface and its gap.

    Attributes
    ----------
    surface : str
        An equation of x, y, z.
    tension : float
        Energy per length of an edge; 0 if ``energy`` says it all.
    energy : str or None
        Density by position x1, x2, x3 and tangent x4, x5, x6, of degree 1 in the tangent.
    one_form : callable
        Three components for a bubble's place; its integral round the bubble is the volume.
    volume_share : float
        The file's volumes over the foam's.
    fixed, on_pin : tuples of int
        Vertices that hold rotations back: kept in place, kept on the plane ``pin``.
    pin : (3,) array or None
        Normal of a plane through the origin.
    """

    surface: str
    tension: float
    energy: str | None
    one_form: Callable[[int], OneForm]
    volume_share: float
    fixed: tuple[int, ...]
    on_pin: tuple[int, ...]
    pin: Floats | None


def formulas_of(foam: Foam, *, ruled: bool) -> Formulas:
    """Formulas for the foam's surface.

    Raises
    ------
    ValueError
        If there are none for it.
    """
    surface = foam.cell.surface
    if type(surface) is Sphere:
        return _sphere(foam, surface, ruled)
    if type(surface) is Torus:
        return _torus(foam, surface, ruled)
    raise ValueError(
        f"foam must lie on a Sphere or a Torus, got {type(surface).__name__}: "
        "other surfaces have no closed form of volumes for the Evolver"
    )


def _number(value: float) -> str:
    return f"({float(value)!r})"


def _sphere(foam: Foam, sphere: Sphere, ruled: bool) -> Formulas:
    """Volumes are solid angles: ∮ (m × x)·dx / (|x| (|x| + m·x)) is that of a loop about the axis m.

    The form is of degree 0, so a chord counts for the great circle above it. It is singular at −m only,
    opposite to the bubble.
    """
    r, d = sphere.radius, foam.cell.mean_gap
    depth = ((r + d) ** 3 - r**3) / 3.0 if ruled else d * r**2
    film = d + d**2 / (2.0 * r) if ruled else d
    axes = foam.bubble_centres / r
    length = "sqrt(x^2 + y^2 + z^2)"

    def one_form(place: int) -> OneForm:
        a, b, c = (_number(v) for v in axes[place])
        under = f"({length}*({length} + {a}*x + {b}*y + {c}*z))"
        scale = _number(depth)
        return (
            f"{scale}*({b}*z - {c}*y)/{under}",
            f"{scale}*({c}*x - {a}*z)/{under}",
            f"{scale}*({a}*y - {b}*x)/{under}",
        )

    # a vertex held in place and one, a quarter turn away, on the great circle through it
    points = foam.vertex_points
    other = int(np.argmin(np.abs(points @ points[0])))
    return Formulas(
        surface=f"x^2 + y^2 + z^2 = {r**2!r}",
        tension=foam.tension * film,
        energy=None,
        one_form=one_form,
        volume_share=4.0 * np.pi * depth / foam.cell.volume,
        fixed=(0,),
        on_pin=(other,),
        pin=np.cross(points[0], points[other]) / r**2,
    )


def _torus(foam: Foam, torus: Torus, ruled: bool) -> Formulas:
    """V = −∮ F dθ, F = R (r d + d²/2) φ + ((r+d)³ − r³)/3 · sin φ, with φ cut opposite to the bubble.

    A ruled film is γ Σ_t w_t |(1 + t/r) T_∥ + (1 + t cos φ / ρ) T_θ|, with T_θ the part of the tangent
    round the axis and ρ the distance from it.
    """
    ring, tube, d = torus.major_radius, torus.minor_radius, foam.cell.mean_gap
    if ruled:
        flat, bent = ring * (tube * d + 0.5 * d**2), ((tube + d) ** 3 - tube**3) / 3.0
    else:
        flat, bent = d * ring * tube, d * tube**2
    x, y, z = foam.bubble_centres.T
    across = np.hypot(x, y) - ring
    angle = np.arctan2(z, across)
    out = f"(sqrt(x^2 + y^2) - {_number(ring)})"

    def one_form(place: int) -> OneForm:
        start, cos, sin = (_number(f(angle[place])) for f in (float, np.cos, np.sin))
        phi = f"({start} + atan2({cos}*z - {sin}*{out}, {cos}*{out} + {sin}*z))"
        value = f"({_number(flat)}*{phi} + {_number(bent)}*z/sqrt({out}^2 + z^2))"
        return f"{value}*y/(x^2 + y^2)", f"-{value}*x/(x^2 + y^2)", "0"

    terms = []
    heights, shares = gauss(foam.cell.n_heights)
    for t, w in zip(d * heights, d * shares, strict=True):
        stretch = _number(1.0 + t / tube)
        round_axis = f"({stretch} - {_number(t * ring / tube)}/sqrt(x1^2 + x2^2))"
        turned = "(x1*x5 - x2*x4)^2/(x1^2 + x2^2)"
        terms.append(
            f"{_number(foam.tension * w)}*sqrt({stretch}^2*(x4^2 + x5^2 + x6^2)"
            f" + ({round_axis}^2 - {stretch}^2)*{turned})"
        )
    first = foam.vertex_points[0]
    total = 4.0 * np.pi**2 * flat if ruled else 4.0 * np.pi**2 * ring * tube * d
    return Formulas(
        surface=f"(sqrt(x^2 + y^2) - {ring!r})^2 + z^2 = {tube**2!r}",
        tension=0.0 if ruled else foam.tension * d,
        energy=" + ".join(terms) if ruled else None,
        one_form=one_form,
        volume_share=total / foam.cell.volume,
        fixed=(),
        on_pin=(0,),
        pin=np.array([first[1], -first[0], 0.0]) / np.hypot(first[0], first[1]),
    )
