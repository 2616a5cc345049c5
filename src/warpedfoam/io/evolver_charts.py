"""Volumes on surfaces without closed forms: one-forms with polynomials that are fitted bubble by bubble.

A *chart* gives a part of the surface two coordinates a, b. There the volume ∫ w dA is ∫ F da db with
F = w / (∇a × ∇b · n), and F is fitted by a polynomial P(a, b); ∮ Q db with Q = ∫ P da, from a0 on, is the
volume then. Along walls at a = a0 or b = const the form vanishes, so that films alone count.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.foam import Foam
from warpedfoam.io.evolver_forms import Triple, number, refuse, rest_of
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.surfaces.level import LevelSurface

#: Points along a film, points from the middle of a bubble outwards, and how far beyond its films they reach.
ALONG, OUTWARD, MARGIN = 12, 12, 1.08
#: Degrees that are tried, the fit that is good enough, and the worst that is taken; relative.
DEGREES, GOAL, WORST = (2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18), 1e-6, 1e-4
#: Least n·N at which a surface is seen along N, and the most of a period that a bubble may reach.
STEEPEST, REACH = 0.15, 0.45
#: Largest relative error of a bubble's volume by its form.
OFF = 1e-4


@dataclass(frozen=True, eq=False)
class Chart:
    """Coordinates (a, b) of a part of a surface, in numbers and as text.

    Attributes
    ----------
    coordinates : callable
        (n, 2) of points (n, 3).
    place : callable
        Points (n, 3) near given coordinates (n, 2), and lines through them along which these stay the same.
    gradients : callable
        ∇a and ∇b at points (n, 3).
    texts : (str, str)
        a and b as formulas of x, y, z.
    along : (str, str, str)
        db as a one-form.
    """

    coordinates: Callable[[Floats], Floats]
    place: Callable[[Floats, Floats], tuple[Floats, Floats]]
    gradients: Callable[[Floats], tuple[Floats, Floats]]
    texts: tuple[str, str]
    along: Triple


def seen_from(
    axis: Floats,
    middle: Floats,
    scale: float,
    bend: float,
    period: Floats | None,
    films: Floats | None = None,
) -> Chart:
    """Where rays from the point 1/``bend`` below the ``middle`` (parallel ones if 0) meet a plane there.

    With u and v constant along ``axis`` and h the height along it, a = u/(1 + bend h), b = v/(1 + bend h), in
    units of ``scale``. On a sphere of mean curvature H bend = H/2 makes it the stereographic projection,
    whose F is the smoothest. In a space that repeats the coordinates are those of the image next to
    the middle; ``films`` are the points that the text will meet, which tell how far off their images lie.
    """
    last = int(np.argmax(np.abs(axis)))
    i, j = (last + 1) % 3, (last + 2) % 3
    if axis[last] < 0.0:
        i, j = j, i
    rows = np.zeros((3, 3))
    rows[0, i] = rows[1, j] = 1.0 / scale
    rows[:2, last] = [-axis[i] / axis[last] / scale, -axis[j] / axis[last] / scale]
    rows[np.abs(rows) < 1e-15 / scale] = 0.0
    rows[2] = axis
    # what has the coordinates (1, 0) and (0, 1) and no height
    spread = np.linalg.inv(rows)[:, :2].T

    def lifted(points: Floats) -> tuple[Floats, Floats]:
        u, v, h = (nearest_image(points - middle, period) @ rows.T).T
        under = 1.0 + bend * h
        return np.column_stack([u / under, v / under]), under[:, None]

    def place(at: Floats, guess: Floats) -> tuple[Floats, Floats]:
        side = at @ spread
        line = axis + bend * side
        height = nearest_image(guess - middle, period) @ axis
        return middle + side + height[:, None] * line, line / np.linalg.norm(line, axis=1, keepdims=True)

    def gradients(points: Floats) -> tuple[Floats, Floats]:
        at, under = lifted(points)
        return (rows[0] - bend * at[:, :1] * axis) / under, (rows[1] - bend * at[:, 1:] * axis) / under

    turns: list[Ints | None] = [None] * 3
    if films is not None and period is not None:
        away = films - middle
        off = np.round(np.where(np.isfinite(period), (away - nearest_image(away, period)) / period, 0.0))
        turns = [np.unique(column) for column in off.astype(np.int64).T]
    names = [_near(e, k, middle[k], period, turns[k]) for k, e in enumerate("xyz")]
    u, v, h = (
        "(" + " + ".join(f"{number(c)}*{name}" for c, name in zip(row, names, strict=True) if c) + ")"
        for row in rows.tolist()
    )
    across = [number(c) if c else "0" for c in rows[1].tolist()]
    if bend:
        under = f"(1 + {number(bend)}*{h})"
        u, v = f"({u}/{under})", f"({v}/{under})"
        across = [
            f"(({c} - {number(bend * n)}*{v})/{under})" for c, n in zip(across, axis.tolist(), strict=True)
        ]
    return Chart(
        lambda points: lifted(points)[0], place, gradients, (u, v), (across[0], across[1], across[2])
    )


def _near(name: str, axis: int, middle: float, period: Floats | None, turns: Ints | None) -> str:
    """A coordinate less ``middle``: that of the nearest image, or of points that are so many periods on."""
    if period is None or not np.isfinite(period[axis]):
        return f"({name} - {number(middle)})"
    if turns is not None and len(turns) == 1:
        return f"({name} - {number(middle + turns[0] * period[axis])})"
    half = 0.5 * period[axis]
    return f"(({name} - {number(middle - half)})%{number(period[axis])} - {number(half)})"


def turned(chart: Chart) -> Chart:
    """The same with (b, −a) for (a, b); the form then runs along a."""

    def coordinates(points: Floats) -> Floats:
        a, b = chart.coordinates(points).T
        return np.column_stack([b, -a])

    def gradients(points: Floats) -> tuple[Floats, Floats]:
        a, b = chart.gradients(points)
        return b, -a

    def place(at: Floats, guess: Floats) -> tuple[Floats, Floats]:
        return chart.place(np.column_stack([-at[:, 1], at[:, 0]]), guess)

    at = np.zeros((1, 3))
    x, y, z = (number(c) if c else "0" for c in (-chart.gradients(at)[0][0]).tolist())
    return Chart(coordinates, place, gradients, (chart.texts[1], f"(-{chart.texts[0]})"), (x, y, z))


def round_axis(middle: Floats, scale: float) -> Chart:
    """The angle about the z axis and the height, both 0 at the ``middle``, each in units of ``scale``."""
    start, radius, height = np.arctan2(middle[1], middle[0]), float(np.hypot(*middle[:2])), middle[2]

    def coordinates(points: Floats) -> Floats:
        return np.column_stack([_angle(points, start) * radius, points[:, 2] - height]) / scale

    def place(at: Floats, guess: Floats) -> tuple[Floats, Floats]:
        out = _ray(start + at[:, 0] * scale / radius)
        r = np.hypot(guess[:, 0], guess[:, 1])[:, None]
        return r * out + (height + scale * at[:, 1:]) * [0.0, 0.0, 1.0], out

    def gradients(points: Floats) -> tuple[Floats, Floats]:
        up = np.broadcast_to([0.0, 0.0, 1.0 / scale], points.shape)
        return _angle_slope(points) * (radius / scale), up

    angle = f"({number(radius / scale)}*{_angle_text(start)})"
    level = f"({number(1.0 / scale)}*(z - {number(height)}))"
    return Chart(coordinates, place, gradients, (angle, level), ("0", "0", number(1.0 / scale)))


def from_rim(middle: Floats, rim: float, scale: float) -> Chart:
    """The distance from the z axis beyond ``rim``, and the angle about it, 0 at the ``middle``."""
    start = np.arctan2(middle[1], middle[0])

    def coordinates(points: Floats) -> Floats:
        r = np.hypot(points[:, 0], points[:, 1])
        return np.column_stack([r - rim, _angle(points, start) * rim]) / scale

    def place(at: Floats, guess: Floats) -> tuple[Floats, Floats]:
        points = (rim + scale * at[:, :1]) * _ray(start + at[:, 1] * scale / rim)
        points[:, 2] = guess[:, 2]
        return points, np.broadcast_to([0.0, 0.0, 1.0], guess.shape)

    def gradients(points: Floats) -> tuple[Floats, Floats]:
        out = points * [1.0, 1.0, 0.0]
        out = out / np.linalg.norm(out, axis=1, keepdims=True)
        return out / scale, _angle_slope(points) * (rim / scale)

    share = number(rim / scale)
    return Chart(
        coordinates,
        place,
        gradients,
        (f"({number(1.0 / scale)}*(sqrt(x^2 + y^2) - {number(rim)}))", f"({share}*{_angle_text(start)})"),
        (f"-{share}*y/(x^2 + y^2)", f"{share}*x/(x^2 + y^2)", "0"),
    )


def _angle(points: Floats, start: float) -> Floats:
    c, s = np.cos(start), np.sin(start)
    x, y = points[:, 0], points[:, 1]
    out: Floats = np.arctan2(c * y - s * x, c * x + s * y)
    return out


def _angle_text(start: float) -> str:
    c, s = number(np.cos(start)), number(np.sin(start))
    return f"atan2({c}*y - {s}*x, {c}*x + {s}*y)"


def _angle_slope(points: Floats) -> Floats:
    x, y = points[:, 0], points[:, 1]
    return np.stack([-y, x, np.zeros(len(x))], axis=1) / (x**2 + y**2)[:, None]


def _ray(angle: Floats) -> Floats:
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))], axis=1)


def outlines(foam: Foam) -> tuple[Floats, Ints]:
    """Points along films and walls (n, 3), each once for every bubble beside it, and these bubbles (n,)."""
    network = foam.network
    xi = lobatto(ALONG).nodes
    films = foam.film_curves_at(xi).reshape(-1, 3)
    owners = [np.repeat(side, len(xi)) for side in (network.left, network.right)]
    at, wall = foam.wall_points(ALONG)
    walls = foam.walls.bubble[wall]
    return np.concatenate([films, films, at]), np.concatenate([*owners, walls])


def fitted_forms(
    foam: Foam, charts: list[Chart], bases: Floats, weights: tuple[float, float, float]
) -> Callable[[int], Triple]:
    """The one-form of every bubble, by its place; ``weights`` are c0, c1, c2 of w = c0 + c1 H + c2 G.

    Raises
    ------
    ValueError
        If a bubble is so large that its chart does not see all of it, or no polynomial fits.
    """
    surface = foam.cell.surface
    assert isinstance(surface, LevelSurface)
    polynomials = _polynomials(foam, surface, charts, weights)
    size = max(len(p) for p in polynomials) + 1
    powers = np.zeros((foam.n_bubbles, size, size))
    for k, p in enumerate(polynomials):
        order = np.arange(1, len(p) + 1)[:, None]
        powers[k, 1 : len(p) + 1, : p.shape[1]] = p / order
        # Q(a0, b) = 0
        lift = bases[k] ** np.arange(size)
        powers[k, 0] = -lift[1:] @ powers[k, 1:]
    _check(foam, charts, powers, weights)

    def form(place: int) -> Triple:
        size = max(len(polynomials[place]) + 1, 1)
        value = _horner(powers[place][:size, :size], *charts[place].texts)
        x, y, z = (
            "0" if part == "0" else value if part == "1" else f"{part}*{value}"
            for part in charts[place].along
        )
        return x, y, z

    return form


def _polynomials(
    foam: Foam, surface: LevelSurface, charts: list[Chart], weights: tuple[float, float, float]
) -> list[Floats]:
    """Coefficients of a^i b^j for each bubble, fitted to F over the bubble and a little more."""
    rest = rest_of(foam)
    edge, owner = outlines(foam)
    keep = owner != rest
    edge, owner = edge[keep], owner[keep]
    middles = foam.bubble_centres
    away = nearest_image(edge - middles[owner], surface.period)
    shares = MARGIN * np.sin(0.5 * np.pi * (np.arange(OUTWARD) + 0.5) / OUTWARD)
    normals = surface.normals(middles)
    order = np.argsort(owner, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(owner, minlength=foam.n_bubbles))[:-1])
    # straight from the middle to the films in the chart, and up to the surface
    rise = np.einsum("nx,nx->n", away, normals[owner])[:, None] * normals[owner]
    guess = middles[owner, None] + shares[:, None] * away[:, None]
    guess += (shares**2 - shares)[:, None] * rise[:, None]
    axes = np.empty_like(guess)
    goal = np.empty((*guess.shape[:2], 2))
    for k, mine in enumerate(parts):
        if mine.size:
            start = charts[k].coordinates(middles[k : k + 1])
            end = charts[k].coordinates(middles[k] + away[mine])
            goal[mine] = start + shares[:, None] * (end - start)[:, None]
            points, lines = charts[k].place(goal[mine].reshape(-1, 2), guess[mine].reshape(-1, 3))
            guess[mine], axes[mine] = points.reshape(guess[mine].shape), lines.reshape(axes[mine].shape)
    flat = guess.reshape(-1, 3)
    found = surface.foot(flat, axes.reshape(-1, 3))
    sound: Bools = np.asarray(np.isfinite(found).all(axis=1))
    landed = np.where(sound[:, None], found, foam.vertex_points[0])
    # what landed on another sheet is far from where it started
    reach = np.linalg.norm(away, axis=1).repeat(OUTWARD)
    sound &= np.linalg.norm(landed - flat, axis=1) < 0.7 * reach
    sound &= ~surface.beyond(landed)
    normal, shape = surface._shape(landed)  # the points lie on it already
    trace = np.einsum("nxx->n", shape)
    square = np.einsum("nxy,nxy->n", shape, shape)
    density = weights[0] + 0.5 * weights[1] * trace + 0.5 * weights[2] * (trace**2 - square)
    inner = (shares <= 1.0)[None].repeat(len(edge), axis=0).ravel()
    out: list[Floats] = []
    hidden, rough = np.zeros(foam.n_bubbles, dtype=np.bool_), np.zeros(foam.n_bubbles, dtype=np.bool_)
    if surface.period is not None:
        far = (np.abs(away) > REACH * surface.period).any(axis=1)
        np.logical_or.at(hidden, owner, far)
    columns = np.arange(len(edge) * OUTWARD).reshape(len(edge), OUTWARD)
    for k, mine in enumerate(parts):
        if not mine.size:
            out.append(np.zeros((1, 1)))
            continue
        here = columns[mine].ravel()
        by_a, by_b = charts[k].gradients(landed[here])
        cross = np.cross(by_a, by_b)
        stretch = np.einsum("nx,nx->n", cross, normal[here])
        steep = stretch < STEEPEST * np.linalg.norm(cross, axis=1)
        hidden[k] |= bool(((~sound[here] | steep) & inner[here] & ~surface.beyond(landed[here])).any())
        good = sound[here] & ~steep
        if hidden[k] or good.sum() < 12:
            hidden[k] = True
            out.append(np.zeros((1, 1)))
            continue
        values = density[here][good] / stretch[good]
        fitted, error = _fit(goal[mine].reshape(-1, 2)[good], values)
        rough[k] = error > WORST
        out.append(fitted)
    refuse(foam, hidden, "cannot be seen from one side")
    refuse(foam, rough, f"has a volume that polynomials fit worse than {WORST:g}")
    return out


def _fit(places: Floats, values: Floats) -> tuple[Floats, float]:
    """Coefficients of the first degree that fits, and its error over the mean value, root mean square."""
    scale = float(np.abs(values).mean())
    best, least = np.zeros((1, 1)), np.inf
    for degree in DEGREES:
        i, j = np.nonzero(np.add.outer(np.arange(degree + 1), np.arange(degree + 1)) <= degree)
        if 2 * len(i) > len(values):
            break
        a, b = (places[:, k, None] ** np.arange(degree + 1) for k in range(2))
        found, *_ = np.linalg.lstsq(a[:, i] * b[:, j], values, rcond=1e-14)
        error = float(np.linalg.norm((a[:, i] * b[:, j]) @ found - values)) / scale / np.sqrt(len(values))
        if error < least:
            least, best = error, np.zeros((degree + 1, degree + 1))
            best[i, j] = found
        if least < GOAL:
            break
    return best, least


def _check(foam: Foam, charts: list[Chart], powers: Floats, weights: tuple[float, float, float]) -> None:
    """Compare the forms with the volumes.

    Raises
    ------
    ValueError
        If one is off.
    """
    found = _form_volumes(foam, charts, powers)
    wanted = foam.bubble_volumes if weights[1] else weights[0] * foam.bubble_areas
    off: Bools = np.abs(found - wanted) > OFF * np.abs(wanted)
    refuse(foam, off, "has a form that does not give its volume: it is folded, or not star-shaped")


def _form_volumes(foam: Foam, charts: list[Chart], powers: Floats) -> Floats:
    """∮ Q db round each bubble, by Gauss–Lobatto quadrature along the films."""
    network, rule = foam.network, lobatto(16)
    curves = foam.film_curves_at(rule.nodes)
    steps = np.einsum("kl,flx->fkx", rule.derivative, curves)
    out = np.zeros(foam.n_bubbles)
    rest = rest_of(foam)
    for sign, side in ((1.0, network.left), (-1.0, network.right)):
        for k in np.delete(np.arange(foam.n_bubbles), rest).tolist():
            mine = side == k
            if not mine.any():
                continue
            points = curves[mine].reshape(-1, 3)
            at = charts[k].coordinates(points)
            value = np.polynomial.polynomial.polyval2d(at[:, 0], at[:, 1], powers[k])
            by_b = np.einsum("nx,nx->n", charts[k].gradients(points)[1], steps[mine].reshape(-1, 3))
            out[k] += sign * float(np.tile(rule.weights, int(mine.sum())) @ (value * by_b))
    return out


def _horner(powers: Floats, a: str, b: str) -> str:
    """Σ c_ij a^i b^j by nested products, without the zeros at the ends."""

    def nested(parts: list[str | None], name: str) -> str | None:
        text: str | None = None
        for part in reversed(parts):
            if text is None:
                text = part
            else:
                text = f"{name}*({text})" if part is None else f"{part} + {name}*({text})"
        return text

    least = 1e-13 * float(np.abs(powers).max())
    rows = [nested([f"({c:.13g})" if abs(c) > least else None for c in row], b) for row in powers.tolist()]
    return f"({nested(rows, a) or '0'})"
