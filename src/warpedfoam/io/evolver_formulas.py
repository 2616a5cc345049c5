"""Surfaces, film energies and volumes as formulas of the Surface Evolver."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.foam import Foam
from warpedfoam.io.evolver_forms import (
    Triple,
    along_rays,
    axis_flux,
    ball_flux,
    films_cross,
    near_image,
    number,
    refuse,
    round_axis,
    samples,
    solid_angle,
    turned_angle,
)
from warpedfoam.kernels.quadrature import gauss
from warpedfoam.surfaces import Catenoid, Cylinder, Ellipsoid, FlatTorus, Sphere, Torus

_AXIS = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Formulas:
    """What the Evolver has to know of a surface and its gap.

    Attributes
    ----------
    surface : str
        An equation of x, y, z.
    outer : str or None
        That of the outer plate, where it is one.
    tension : float
        Energy per length of an edge; 0 if ``energy`` says it all.
    energy : str or None
        Density by position x1, x2, x3 and tangent x4, x5, x6, of degree 1 in the tangent.
    one_form : callable
        For a bubble's place: its integral round the bubble is the volume.
    flux : callable or None
        For a bubble's place: its flux through the bubble's films is the volume.
    volume : float
        Of the whole cell, as the forms have it.
    fixed : tuple of int
        Vertices kept in place, which hold translations or rotations back.
    pinned : tuple of (int, (3,) array)
        Vertices kept on the plane through where they are, by its normal.
    rims : tuple of (str, tuple of int)
        Equations of the rim's loops, and the vertices on each.
    """

    surface: str
    outer: str | None
    tension: float
    energy: str | None
    one_form: Callable[[int], Triple]
    flux: Callable[[int], Triple] | None
    volume: float
    fixed: tuple[int, ...] = ()
    pinned: tuple[tuple[int, Floats], ...] = ()
    rims: tuple[tuple[str, tuple[int, ...]], ...] = ()


def formulas_of(foam: Foam, *, ruled: bool) -> Formulas:
    """Formulas for the foam's surface.

    Raises
    ------
    ValueError
        If there are none for it, or a bubble is too large for its form.
    """
    surface = foam.cell.surface
    makers: dict[type, Callable[[Foam, bool], Formulas]] = {
        Sphere: _sphere,
        Torus: _torus,
        Cylinder: _cylinder,
        Catenoid: _catenoid,
        Ellipsoid: _ellipsoid,
        FlatTorus: lambda flat, _: _flat(flat),
    }
    if type(surface) in makers:
        return makers[type(surface)](foam, ruled)
    names = sorted(kind.__name__ for kind in makers)
    raise ValueError(
        f"foam must lie on a {', '.join(names[:-1])} or {names[-1]}, got {type(surface).__name__}: "
        "the Evolver needs the surface and its volumes as formulas; a Graph, Implicit or Revolution has them "
        "if it is made by from_formula"
    )


def layers(foam: Foam, ruled: bool) -> tuple[float, float, float]:
    """c0, c1, c2 of ∫ (c0 + c1 H + c2 G) dA, H the mean of the principal curvatures' sum."""
    d = foam.cell.mean_gap
    return (d, d**2, d**3 / 3.0) if ruled else (d, 0.0, 0.0)


def ruled_films(foam: Foam, squares: Callable[[float], str]) -> str:
    """γ Σ_t w_t √(|(I + tW) T|²), by the square at each height."""
    heights, shares = gauss(foam.cell.n_heights)
    d = foam.cell.mean_gap
    return " + ".join(
        f"{number(foam.tension * d * w)}*sqrt({squares(d * t)})"
        for t, w in zip(heights.tolist(), shares.tolist(), strict=True)
    )


def levelled(slope: Triple, bend: Sequence[Triple]) -> Callable[[float], str]:
    """|(I + tW) T|² on a level set f = 0: WT = (BT − n n·BT)/|∇f|, B the second derivatives of f."""
    size = f"({slope[0]}^2 + {slope[1]}^2 + {slope[2]}^2)"
    parts = [[f"{b}*x{k + 4}" for k, b in enumerate(row) if b != "0"] for row in bend]
    bt = [f"({' + '.join(row)})" if row else "0" for row in parts]
    along = " + ".join(f"x{k + 4}*{part}" for k, part in enumerate(bt))
    square = " + ".join(f"{part}^2" for part in bt)
    up = f"({' + '.join(f'{n}*{part}' for n, part in zip(slope, bt, strict=True))})"
    # T is a chord, which lies along the surface at its middle only: n·T is dropped everywhere alike
    return lambda t: (
        f"x4^2 + x5^2 + x6^2 + {number(2.0 * t)}*({along})/sqrt({size})"
        f" + {number(t * t)}*({square} - {up}^2/{size})/{size}"
    )


def diagonal(a: str, b: str, c: str) -> tuple[Triple, Triple, Triple]:
    """Second derivatives that do not mix."""
    return (a, "0", "0"), ("0", b, "0"), ("0", "0", c)


def _sphere(foam: Foam, ruled: bool) -> Formulas:
    sphere = foam.cell.surface
    assert isinstance(sphere, Sphere)
    r, d = sphere.radius, foam.cell.mean_gap
    depth = ((r + d) ** 3 - r**3) / 3.0 if ruled else d * r**2
    film = d + d**2 / (2.0 * r) if ruled else d
    axes = foam.bubble_centres / r
    # a vertex held in place and one, a quarter turn away, on the great circle through it
    points = foam.vertex_points
    other = int(np.argmin(np.abs(points @ points[0])))
    return Formulas(
        surface=f"x^2 + y^2 + z^2 = {r**2!r}",
        outer=f"x^2 + y^2 + z^2 = {(r + d) ** 2!r}",
        tension=foam.tension * film,
        energy=None,
        one_form=lambda place: solid_angle(axes[place], depth),
        flux=lambda place: ball_flux(axes[place]),
        volume=4.0 * np.pi * depth,
        fixed=(0,),
        pinned=((other, np.cross(points[0], points[other]) / r**2),),
    )


def _torus(foam: Foam, ruled: bool) -> Formulas:
    """V = −∮ F dθ, F = R (r d + d²/2) φ + ((r+d)³ − r³)/3 · sin φ, or ∮ θ dF, as the bubble lies.

    A ruled film is γ Σ_t w_t |(1 + t/r) T_∥ + (1 + t cos φ / ρ) T_θ|, with T_θ the part of the tangent
    round the axis and ρ the distance from it.
    """
    torus = foam.cell.surface
    assert isinstance(torus, Torus)
    ring, tube, d = torus.major_radius, torus.minor_radius, foam.cell.mean_gap
    if ruled:
        flat, bent = ring * (tube * d + 0.5 * d**2), ((tube + d) ** 3 - tube**3) / 3.0
    else:
        flat, bent = d * ring * tube, d * tube**2

    def round_tube(x: Floats) -> Floats:
        out: Floats = np.arctan2(x[..., 2], np.hypot(x[..., 0], x[..., 1]) - ring)
        return out

    along, middles = samples(foam), foam.bubble_centres
    around, about = round_tube(middles), round_axis(middles)
    by_ring = films_cross(foam, round_tube(along), around)
    refuse(
        foam,
        by_ring & films_cross(foam, round_axis(along), about),
        "reaches round the tube and round the ring",
    )
    out = f"(sqrt(x^2 + y^2) - {number(ring)})"
    tube_square = f"({out}^2 + z^2)"

    def theta(place: int) -> str:
        return turned_angle(about[place], "y", "x")

    def phi(place: int) -> str:
        return turned_angle(around[place], "z", out)

    def one_form(place: int) -> Triple:
        if by_ring[place]:
            # dF = (flat + bent cos φ) dφ, dφ = (out dz − z d out)/(out² + z²)
            value = f"{theta(place)}*({number(flat)} + {number(bent)}*{out}/sqrt{tube_square})/{tube_square}"
            side = f"-{value}*z/sqrt(x^2 + y^2)"
            return f"{side}*x", f"{side}*y", f"{value}*{out}"
        value = f"({number(flat)}*{phi(place)} + {number(bent)}*z/sqrt{tube_square})"
        return f"{value}*y/(x^2 + y^2)", f"-{value}*x/(x^2 + y^2)", "0"

    def flux(place: int) -> Triple:
        if by_ring[place]:
            return axis_flux(theta(place))
        # t (R φ + t sin φ)/ρ along φ
        value = f"(({number(ring)}*{phi(place)} + z)/sqrt(x^2 + y^2))"
        side = f"-{value}*z/sqrt(x^2 + y^2)"
        return f"{side}*x", f"{side}*y", f"{value}*{out}"

    def squares(t: float) -> str:
        stretch = number(1.0 + t / tube)
        round_ring = f"({stretch} - {number(t * ring / tube)}/sqrt(x1^2 + x2^2))"
        turned = "(x1*x5 - x2*x4)^2/(x1^2 + x2^2)"
        return f"{stretch}^2*(x4^2 + x5^2 + x6^2) + ({round_ring}^2 - {stretch}^2)*{turned}"

    return Formulas(
        surface=f"(sqrt(x^2 + y^2) - {ring!r})^2 + z^2 = {tube**2!r}",
        outer=f"(sqrt(x^2 + y^2) - {ring!r})^2 + z^2 = {(tube + d) ** 2!r}",
        tension=0.0 if ruled else foam.tension * d,
        energy=ruled_films(foam, squares) if ruled else None,
        one_form=one_form,
        flux=flux,
        volume=4.0 * np.pi**2 * flat,
        pinned=(_against_turning(foam, _AXIS),),
    )


def _cylinder(foam: Foam, ruled: bool) -> Formulas:
    """V = (r d + d²/2) ∮ θ dz; walls lie at one z and add nothing."""
    tube = foam.cell.surface
    assert isinstance(tube, Cylinder)
    r, d = tube.radius, foam.cell.mean_gap
    share = r * d + 0.5 * d**2 if ruled else r * d
    about = round_axis(foam.bubble_centres)
    refuse(foam, films_cross(foam, round_axis(samples(foam)), about), "reaches round the axis")

    def theta(place: int) -> str:
        return turned_angle(about[place], "y", "x")

    def squares(t: float) -> str:
        turned = "(x1*x5 - x2*x4)^2/(x1^2 + x2^2)"
        return f"x4^2 + x5^2 + x6^2 + {number((1.0 + t / r) ** 2 - 1.0)}*{turned}"

    half = 0.5 * tube.height
    return Formulas(
        surface=f"x^2 + y^2 = {r**2!r}",
        outer=f"x^2 + y^2 = {(r + d) ** 2!r}",
        tension=0.0 if ruled else foam.tension * d,
        energy=ruled_films(foam, squares) if ruled else None,
        one_form=lambda place: ("0", "0", f"{number(share)}*{theta(place)}"),
        flux=lambda place: axis_flux(theta(place)),
        volume=2.0 * np.pi * share * tube.height,
        # a joined cylinder may shift along its axis too
        fixed=(0,) if tube.periodic else (),
        pinned=() if tube.periodic else (_against_turning(foam, _AXIS),),
        rims=() if tube.periodic else _flat_rims(foam, half),
    )


def _catenoid(foam: Foam, ruled: bool) -> Formulas:
    """V = ∮ θ w(z) dz, w = (d + G d³/3) a cosh²(z/a): the area element, and H = 0."""
    waist = foam.cell.surface
    assert isinstance(waist, Catenoid)
    a, half = waist.neck_radius, 0.5 * waist.height
    c0, _, c2 = layers(foam, ruled)
    about = round_axis(foam.bubble_centres)
    refuse(foam, films_cross(foam, round_axis(samples(foam)), about), "reaches round the axis")
    cosh = f"cosh(z/{number(a)})"
    width = f"({number(c0 * a)}*{cosh}^2 - {number(c2 / a)}/{cosh}^2)"
    bent = f"(1 - 2*cosh(x3/{number(a)})^2)"
    steep = f"(-{number(a)}*cosh(x3/{number(a)})*sinh(x3/{number(a)}))"
    area = np.pi * a * (waist.height + a * np.sinh(waist.height / a))
    return Formulas(
        surface=f"x^2 + y^2 - {number(a**2)}*{cosh}^2 = 0",
        outer=None,
        tension=0.0 if ruled else foam.tension * foam.cell.mean_gap,
        energy=ruled_films(foam, levelled(("x1", "x2", steep), diagonal("1", "1", bent))) if ruled else None,
        one_form=lambda place: ("0", "0", f"{turned_angle(about[place], 'y', 'x')}*{width}"),
        flux=None,
        volume=c0 * area - c2 * 4.0 * np.pi * np.tanh(half / a),
        pinned=(_against_turning(foam, _AXIS),),
        rims=_flat_rims(foam, half),
    )


def _ellipsoid(foam: Foam, ruled: bool) -> Formulas:
    """Volumes by the two-form that rays from the centre do not see.

    With q = Σ y²/a², p = Σ y²/a⁴ and X = y/√q on the surface, the support is h = √(q/p), so that a unit of
    solid angle holds |X|³/h of area; G = h⁴/(abc)², H = h³ (a² + b² + c² − |X|²)/2(abc)².
    """
    egg = foam.cell.surface
    assert isinstance(egg, Ellipsoid)
    axes = np.array([egg.a, egg.b, egg.c])
    c0, c1, c2 = layers(foam, ruled)
    middles, along = foam.bubble_centres, samples(foam)
    far = np.zeros(foam.n_bubbles, dtype=bool)
    for bubble in (foam.network.left, foam.network.right):
        cosine = np.einsum("fkx,fx->fk", along, middles[bubble])
        cosine /= np.linalg.norm(along, axis=2) * np.linalg.norm(middles[bubble], axis=1)[:, None]
        np.logical_or.at(far, bubble, (cosine < 0.1).any(axis=1))
    refuse(foam, far, "spans half of the ellipsoid")
    q = "(" + " + ".join(f"{number(s**-2.0)}*#{k + 1}^2" for k, s in enumerate(axes)) + ")"
    p = "(" + " + ".join(f"{number(s**-4.0)}*#{k + 1}^2" for k, s in enumerate(axes)) + ")"
    density = number(c0)
    if ruled:
        square = float(np.prod(axes)) ** 2
        reach = f"({number((axes**2).sum())} - (#1^2 + #2^2 + #3^2)/{q})"
        density = (
            f"({density} + {number(0.5 * c1 / square)}*({q}/{p})^1.5*{reach}"
            f" + {number(c2 / square)}*({q}/{p})^2)"
        )
    # dA = |X|³/h dΩ and |X| = |y|/√q: the field is w y √(p/q)/√q³
    density = f"{density}*sqrt({p})/{q}^2"
    slope = tuple(f"({number(s**-2.0)}*x{k + 1})" for k, s in enumerate(axes))
    bend = tuple(number(s**-2.0) for s in axes)
    squares = levelled((slope[0], slope[1], slope[2]), diagonal(*bend))
    fixed: tuple[int, ...] = ()
    pinned: tuple[tuple[int, Floats], ...] = ()
    alike = [abs(axes[k - 1] - axes[k - 2]) < 1e-9 * egg.size for k in range(3)]
    if all(alike):
        points = foam.vertex_points
        other = int(np.argmin(np.abs(points @ points[0])))
        fixed, pinned = (0,), ((other, np.cross(points[0], points[other]) / egg.a**2),)
    elif any(alike):
        pinned = (_against_turning(foam, np.eye(3)[alike.index(True)]),)
    return Formulas(
        surface=" + ".join(f"{number(s**-2.0)}*{e}^2" for s, e in zip(axes, "xyz", strict=True)) + " = 1",
        outer=None,
        tension=0.0 if ruled else foam.tension * foam.cell.mean_gap,
        energy=ruled_films(foam, squares) if ruled else None,
        one_form=lambda place: along_rays(middles[place], density),
        flux=None,
        volume=foam.cell.volume if ruled else foam.cell.mean_gap * egg.area,
        fixed=fixed,
        pinned=pinned,
    )


def _flat(foam: Foam) -> Formulas:
    """V = d ∮ x dy or −d ∮ y dx, in the image of the bubble; the Evolver's torus model joins the sides."""
    sheet = foam.cell.surface
    assert isinstance(sheet, FlatTorus)
    d, along, middles = foam.cell.mean_gap, samples(foam), foam.bubble_centres
    sides = (sheet.width, sheet.height)
    crossed = [
        films_cross(foam, 2.0 * np.pi / side * along[..., k], 2.0 * np.pi / side * middles[:, k])
        for k, side in enumerate(sides)
    ]
    refuse(foam, crossed[0] & crossed[1], "reaches over half of the rectangle both ways")

    def near(place: int) -> str:
        k = int(crossed[0][place])
        return near_image("xy"[k], sides[k], middles[place, k])

    def one_form(place: int) -> Triple:
        value = f"{number(d)}*{near(place)}"
        return (f"-{value}", "0", "0") if crossed[0][place] else ("0", value, "0")

    def flux(place: int) -> Triple:
        return ("0", near(place), "0") if crossed[0][place] else (near(place), "0", "0")

    return Formulas(
        surface="z = 0",
        outer=f"z = {d!r}",
        tension=foam.tension * d,
        energy=None,
        one_form=one_form,
        flux=flux,
        volume=d * sheet.width * sheet.height,
        fixed=(0,),
    )


def _against_turning(foam: Foam, axis: Floats) -> tuple[int, Floats]:
    """A vertex off the axis and off the rim, and the normal of the plane through it and the axis."""
    across = np.cross(axis, foam.vertex_points)
    distance = np.linalg.norm(across, axis=1)
    distance[foam.network.rim_vertices] = 0.0
    vertex = 0 if distance[0] > 0.5 * distance.max() else int(np.argmax(distance))
    return vertex, across[vertex] / distance[vertex]


def _flat_rims(foam: Foam, half: float) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """z = ∓ half, and the vertices there."""
    ends = foam.network.rim_vertices
    above = foam.vertex_points[ends, 2] > 0.0
    return (
        (f"z = {-half!r}", tuple(ends[~above].tolist())),
        (f"z = {half!r}", tuple(ends[above].tolist())),
    )
