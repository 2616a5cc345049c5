"""Volumes as integrals that the Surface Evolver can take: one-forms along films, fluxes through them.

A one-form's integral round a bubble, counter-clockwise, is the bubble's volume. A flux is that of a vector
field of divergence 1 that runs along both plates, so that only the films count. Each bubble has forms of its
own, which are cut on the far side of the surface.
"""

from __future__ import annotations

import numpy as np

from warpedfoam.arrays import Bools, Floats
from warpedfoam.foam import Foam
from warpedfoam.kernels.quadrature import gauss

#: Components along x, y and z.
Triple = tuple[str, str, str]

#: Points of Gauss's rule from the middle of a bubble to its films, where there is no closed form.
RAYS = 6
_SAMPLES = 9


def number(value: float) -> str:
    """A number that may stand behind any sign."""
    return f"({float(value)!r})"


def films_cross(foam: Foam, angle: Floats, centre: Floats) -> Bools:
    """Bubbles some film of which crosses the half-plane opposite to their middle.

    Parameters
    ----------
    angle : (n_films, k) array
        Angle of points along each film.
    centre : (n_bubbles,) array
        Angle of the bubbles' middles.
    """
    network = foam.network
    crossed = np.zeros(foam.n_bubbles, dtype=bool)
    for bubble in (network.left, network.right):
        turned = angle - centre[bubble][:, None]
        seen = np.angle(np.exp(1j * turned))
        cut = (np.abs(np.diff(seen, axis=1)) > np.pi).any(axis=1)
        np.logical_or.at(crossed, bubble, cut)
    return crossed


def samples(foam: Foam) -> Floats:
    """Points along each film, (n_films, k, 3)."""
    return foam.film_curves_at(np.linspace(0.0, 1.0, _SAMPLES))


def round_axis(points: Floats) -> Floats:
    """Angle θ about the z axis."""
    out: Floats = np.arctan2(points[..., 1], points[..., 0])
    return out


def refuse(foam: Foam, bad: Bools, why: str) -> None:
    """Raise for bubbles without a form; what takes up the rest needs none.

    Raises
    ------
    ValueError
        If there are any.
    """
    bad = bad.copy()
    bad[rest_of(foam)] = False
    if bad.any():
        raise ValueError(f"bubble {int(np.argmax(bad))} {why}; give the foam more bubbles")


def rest_of(foam: Foam) -> int:
    """The bubble whose volume follows from the others': the exterior, or the last."""
    return foam.n_bubbles - 1 if foam.exterior is None else foam.exterior


def turned_angle(start: float, sine: str, cosine: str) -> str:
    """The angle whose sine and cosine these are (up to a factor), without a jump round ``start``."""
    c, s = number(np.cos(start)), number(np.sin(start))
    return f"({number(start)} + atan2({c}*({sine}) - {s}*({cosine}), {c}*({cosine}) + {s}*({sine})))"


def near_image(axis: str, period: float, middle: float) -> str:
    """A coordinate less ``middle`` in a space that repeats: 0 there, without a jump half a period about."""
    k = 2.0 * np.pi / period
    angle = f"{number(k)}*({axis} - {number(middle)})"
    return f"(atan2(sin({angle}), cos({angle}))/{number(k)})"


def solid_angle(axis: Floats, scale: float) -> Triple:
    """∮ (m × x)·dx / (|x| (|x| + m·x)), the solid angle of a loop about the unit vector m, times ``scale``.

    Of degree 0, so that a chord counts for the great circle above it; singular at −m only.
    """
    a, b, c = (number(v) for v in axis)
    length = "sqrt(x^2 + y^2 + z^2)"
    under = f"({length}*({length} + {a}*x + {b}*y + {c}*z))"
    factor = number(scale)
    return (
        f"{factor}*({b}*z - {c}*y)/{under}",
        f"{factor}*({c}*x - {a}*z)/{under}",
        f"{factor}*({a}*y - {b}*x)/{under}",
    )


def ball_flux(axis: Floats) -> Triple:
    """(x (m·x) − m |x|²)/(|x| + m·x): along the meridians about m, r tan(ϑ/2) long at the angle ϑ from m."""
    m = [number(v) for v in axis]
    along, square = f"({m[0]}*x + {m[1]}*y + {m[2]}*z)", "(x^2 + y^2 + z^2)"
    x, y, z = (
        f"({along}*{e} - {square}*{part})/(sqrt{square} + {along})" for e, part in zip("xyz", m, strict=True)
    )
    return x, y, z


def axis_flux(theta: str) -> Triple:
    """θ (−y, x, 0), along every surface of revolution about z."""
    return f"-y*{theta}", f"x*{theta}", "0"


def along_rays(centre: Floats, density: str, depth: int = RAYS) -> Triple:
    """The potential of a closed two-form that rays from the origin do not see.

    Its field is B(y) = ``density`` · y, with the density as a formula of ``#1``, ``#2``, ``#3`` for y. By
    Poincaré's homotopy from the point c, ω = (c × x)·dx ∫₀¹ s density(c + s (x − c)) ds, by Gauss's rule.
    """
    a, b, c = (number(v) for v in centre)
    nodes, weights = gauss(depth)
    terms = []
    for s, w in zip(nodes.tolist(), weights.tolist(), strict=True):
        text = density
        for k, (axis, v) in enumerate(zip("xyz", centre.tolist(), strict=True)):
            text = text.replace(f"#{k + 1}", f"({number((1.0 - s) * v)} + {number(s)}*{axis})")
        terms.append(f"{number(s * w)}*{text}")
    total = f"({' + '.join(terms)})"
    return f"({b}*z - {c}*y)*{total}", f"({c}*x - {a}*z)*{total}", f"({a}*y - {b}*x)*{total}"
