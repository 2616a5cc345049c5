"""Maps whose window is a rectangle of two coordinates: angles, heights or plane coordinates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints
from warpedfoam.plot.maps.strands import Segments, Strands, cut_at_seam, divided
from warpedfoam.surfaces import Catenoid, Cylinder, FlatTorus, Graph, Revolution, Torus

TURN = 2.0 * np.pi
#: Longest step in an angle that a film is drawn with; points along each side of a window's edge.
STEP, EDGE_POINTS = np.radians(0.5), 480
#: Points of the tables that turn heights into distances along a profile.
LOOKS = 8001

Places = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Axis:
    """How an axis of a map is marked."""

    label: str
    ticks: Floats
    texts: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Sheet:
    """A rectangle [low, high] of coordinates, some of whose opposite sides are joined.

    Attributes
    ----------
    name, note : str
    low, high : (2,) arrays
    joined : pair of bool
        Along which coordinate one comes in again where one goes out.
    places : callable
        Points (n, 3) of the surface to coordinates (n, 2), up to whole periods.
    flattened : callable
        Coordinates (n, 2) to those that are drawn.
    marks : pair of Axis or None
    lines : tuple of (k, 2) arrays
        Graticule, in coordinates.
    scale : float or None
        Drawn area per area of the surface.
    level : callable or None
        Points (n, 3) to places (n, 2) about the axis on which the first coordinate is no more defined: films
        that come near it are drawn in small steps.
    """

    name: str
    note: str
    low: Floats
    high: Floats
    joined: tuple[bool, bool]
    places: Places
    flattened: Places
    marks: tuple[Axis, Axis] | None
    lines: tuple[Floats, ...]
    scale: float | None
    level: Places | None = None

    n_windows = 1

    def strands(self, curves: Floats) -> Strands:
        """Curves (F, k, 3) on the surface, cut where they leave the rectangle."""
        n_films, k, _ = curves.shape
        pieces = np.ones((n_films, k - 1), dtype=np.int64)
        if self.level is not None:
            flat = self.level(curves.reshape(-1, 3)).reshape(n_films, k, 2)
            pieces = np.ceil(_turning(flat[:, :-1], flat[:, 1:]) / STEP).astype(np.int64)
        parts = divided(curves, pieces)
        a = self._inside(self.places(parts.a))
        b = a + self._nearest(self._inside(self.places(parts.b)) - a)
        parts = Segments(a, b, parts.film, parts.last)
        cut = np.zeros(len(a), dtype=bool)
        for axis in (0, 1):
            if self.joined[axis]:
                parts, cut = cut_at_seam(parts, cut, axis, self.low[axis], self.high[axis])
        points, segment, _ = parts.points(cut)
        return Strands(points, np.zeros(len(points), dtype=np.int64), parts.film[segment])

    def where(self, points: Floats) -> Floats:
        """Points of the surface as they are drawn."""
        return self.flattened(self._inside(self.places(points)))

    def _inside(self, at: Floats) -> Floats:
        period = self.high - self.low
        turned = at - period * np.floor((at - self.low) / period)
        # a hair below the lower side comes back as the upper one
        turned = np.where(turned >= self.high, self.low, turned)
        out: Floats = np.where(self.joined, turned, np.clip(at, self.low, self.high))
        return out

    def _nearest(self, step: Floats) -> Floats:
        period = self.high - self.low
        out: Floats = np.where(self.joined, step - period * np.round(step / period), step)
        return out

    def jumps(self, at: Floats, window: Ints, then: Floats, then_window: Ints) -> Bools:
        """Steps of more than half a period."""
        far = np.abs(then - at) > 0.5 * (self.high - self.low)
        out: Bools = (far & np.array(self.joined)).any(axis=1) | (window != then_window)
        return out

    def edge(self) -> tuple[Floats, Floats]:
        """Points counter-clockwise from the lower left corner; a side is as long as 1."""
        places = np.linspace(0.0, 4.0, 4 * EDGE_POINTS, endpoint=False)
        side, t = np.divmod(places, 1.0)
        u = np.select([side == 0, side == 1, side == 2], [t, np.ones_like(t), 1.0 - t], 0.0)
        v = np.select([side == 0, side == 1, side == 2], [np.zeros_like(t), t, np.ones_like(t)], 1.0 - t)
        return self.low + np.stack([u, v], axis=1) * (self.high - self.low), places

    def edge_places(self, at: Floats) -> Floats:
        """By the side that a point is nearest to."""
        u, v = ((at - self.low) / (self.high - self.low)).T
        side = np.argmin(np.stack([np.abs(v), np.abs(1.0 - u), np.abs(1.0 - v), np.abs(u)]), axis=0)
        out: Floats = np.select([side == 0, side == 1, side == 2], [u, 1.0 + v, 3.0 - u], 4.0 - v)
        return out % 4.0

    def drawn(self, at: Floats, window: Ints) -> Floats:  # noqa: ARG002
        """The projection."""
        return self.flattened(at)

    def graticule(self) -> list[Floats]:
        """Lines of equal angles."""
        return [self.flattened(line) for line in self.lines]

    def axes(self) -> tuple[Axis, Axis] | None:
        """Marks of the axes."""
        return self.marks


def _turning(a: Floats, b: Floats) -> Floats:
    """Greatest angle about the origin per length of segments (…, 2) from a to b, times their length."""
    along = b - a
    square = np.maximum((along**2).sum(axis=-1), 1e-300)
    t = np.clip(-(a * along).sum(axis=-1) / square, 0.0, 1.0)
    near = np.linalg.norm(a + t[..., None] * along, axis=-1)
    out: Floats = np.minimum(np.sqrt(square) / np.maximum(near, 1e-300), 1e6)
    return out


def degrees(low: float, high: float, step: float, across: Callable[[Floats], Floats], label: str) -> Axis:
    """An axis of angles in radians, marked in degrees; ``across`` gives their places."""
    first, last = np.ceil(np.degrees(low) / step - 1e-9), np.floor(np.degrees(high) / step + 1e-9)
    marks = step * np.arange(first, last + 1.0)
    texts = tuple(f"{m:.0f}°".replace("-", "−") for m in marks)
    return Axis(label, across(np.radians(marks)), texts)


def globe_sheet(name: str, radius: float, centre: tuple[float, float], round_one: bool) -> Sheet:
    """Longitude and latitude of directions from the origin."""
    middle = np.radians(centre[0])
    lean = np.radians(centre[1])
    turn = np.array([[np.cos(lean), 0.0, np.sin(lean)], [0.0, 1.0, 0.0], [-np.sin(lean), 0.0, np.cos(lean)]])
    turn = turn @ np.array(
        [[np.cos(middle), np.sin(middle), 0.0], [-np.sin(middle), np.cos(middle), 0.0], [0.0, 0.0, 1.0]]
    )

    def places(points: Floats) -> Floats:
        x, y, z = (points @ turn.T).T
        return np.stack([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))], axis=1)

    def hammer(at: Floats) -> Floats:
        lon, lat = at.T
        over = np.sqrt(2.0 / (1.0 + np.cos(lat) * np.cos(0.5 * lon)))
        x, y = 2.0 * over * np.cos(lat) * np.sin(0.5 * lon), over * np.sin(lat)
        return radius * np.stack([x, y], axis=1)

    def lambert(at: Floats) -> Floats:
        return radius * np.stack([at[:, 0], np.sin(at[:, 1])], axis=1)

    def plain(at: Floats) -> Floats:
        return radius * at

    flattened = {"hammer": hammer, "equirectangular": plain, "equal_area": lambert}[name]
    low, high = np.array([-np.pi, -0.5 * np.pi]), np.array([np.pi, 0.5 * np.pi])
    marks = None
    if name != "hammer":
        shift = "" if centre == (0.0, 0.0) else " from the middle"
        up = (lambda v: radius * np.sin(v)) if name == "equal_area" else (lambda v: radius * v)
        marks = (
            degrees(low[0], high[0], 60.0, lambda u: radius * u, f"longitude{shift}"),
            degrees(low[1], high[1], 45.0 if name == "equal_area" else 30.0, up, f"latitude{shift}"),
        )
    lon, lat = np.linspace(low[0], high[0], 181), np.linspace(low[1], high[1], 181)
    lines = [np.stack([lon, np.full_like(lon, v)], axis=1) for v in np.radians([-60, -30, 0, 30, 60])]
    lines += [np.stack([np.full_like(lat, u), lat], axis=1) for u in np.radians(np.arange(-150, 151, 30))]
    true = {
        "hammer": "Hammer projection, areas true",
        "equirectangular": "equirectangular: lengths true along meridians and the equator",
        "equal_area": "Lambert's cylindrical projection, areas true",
    }[name]
    if not round_one:
        true = true.split(":")[0].split(",")[0] + " of directions from the origin, nothing to scale"
    keeps = round_one and name != "equirectangular"
    return Sheet(
        name, true, low, high, (True, False), places, flattened, marks,
        tuple(lines) if name == "hammer" else (), 1.0 if keeps else None,
        lambda points: (points @ turn.T)[:, :2],
    )  # fmt: skip


def torus_sheet(name: str, torus: Torus, centre: tuple[float, float]) -> Sheet:
    """Ring angle θ to the right, tube angle φ upwards: seen from outside."""
    ring, tube = torus.major_radius, torus.minor_radius
    middle = np.radians(centre)
    low, high = middle - np.pi, middle + np.pi

    def places(points: Floats) -> Floats:
        phi, theta = torus.angles(points)
        return np.stack([theta, phi], axis=1)

    def up(phi: Floats) -> Floats:
        if name == "equal_area":
            return tube * phi + tube**2 / ring * np.sin(phi)
        if name == "conformal":
            # ∫ R r dφ / (R + r cos φ), continued over whole turns
            root = np.sqrt((ring - tube) / (ring + tube))
            turns = np.round(phi / TURN)
            inner = np.arctan2(root * np.sin(0.5 * (phi - TURN * turns)), np.cos(0.5 * (phi - TURN * turns)))
            out: Floats = 2.0 * ring * tube / np.sqrt(ring**2 - tube**2) * (inner + np.pi * turns)
            return out
        return tube * phi

    def flattened(at: Floats) -> Floats:
        return np.stack([ring * at[:, 0], up(at[:, 1])], axis=1)

    outer, inner = ring / (ring + tube), ring / (ring - tube)
    note = {
        "angles": "lengths true up and down; along θ true at φ = ±90°, "
        f"×{outer:.2f} at φ = 0, ×{inner:.2f} at φ = 180°",
        "equal_area": f"areas true; lengths along θ true at φ = ±90°, ×{outer:.2f} at φ = 0, "
        f"×{inner:.2f} at φ = 180°",
        "conformal": f"angles true; lengths ×{outer:.2f} at φ = 0, ×{inner:.2f} at φ = 180°",
    }[name]
    marks = (
        degrees(low[0], high[0], 60.0, lambda u: ring * u, "ring angle θ"),
        degrees(low[1], high[1], 90.0, up, "tube angle φ"),
    )
    scale = 1.0 if name == "equal_area" else None
    return Sheet(name, note, low, high, (True, True), places, flattened, marks, (), scale)


def turned_sheet(name: str, surface: Cylinder | Catenoid | Revolution, centre: float) -> Sheet:
    """Angle round the axis to the right, along the axis upwards."""
    bottom, top, profile = _profile(surface)
    z = 0.5 * (bottom + top) - 0.5 * (top - bottom) * np.cos(np.linspace(0.0, np.pi, LOOKS))
    r = profile(z)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(z), np.diff(r)))])
    middle = 0.5 * (r[1:] + r[:-1])
    swept = np.concatenate([[0.0], np.cumsum(middle * np.diff(way))])
    # the parallel whose length is true: the mean one, so that both directions have one scale
    true = swept[-1] / way[-1]
    if name == "equal_area":
        table = swept / true
    elif name == "conformal":
        table = true * np.concatenate([[0.0], np.cumsum(np.diff(way) / middle)])
    else:
        table = way
    table = table - np.interp(0.5 * (bottom + top), z, table)
    low = np.array([np.radians(centre) - np.pi, bottom])
    high = np.array([np.radians(centre) + np.pi, top])
    periodic = surface.period is not None

    def places(points: Floats) -> Floats:
        return np.stack([np.arctan2(points[:, 1], points[:, 0]), points[:, 2]], axis=1)

    def up(height: Floats) -> Floats:
        out: Floats = np.interp(height, z, table)
        return out

    def flattened(at: Floats) -> Floats:
        return np.stack([true * at[:, 0], up(at[:, 1])], axis=1)

    if isinstance(surface, Cylinder):
        note = "unrolled: lengths, angles and areas true"
    else:
        most, least = true / float(r.max()), true / max(float(r.min()), 1e-300)
        spread = f"from ×{most:.2f}" + (f" to ×{least:.2f}" if least < 100.0 else " up without bound")
        note = {
            "angles": f"lengths true along meridians, round the axis {spread}",
            "equal_area": f"areas true; lengths round the axis {spread}",
            "conformal": f"angles true; lengths {spread}",
        }[name]
    step = _round_step((top - bottom) / 5.0)
    heights = step * np.arange(np.ceil(bottom / step - 1e-9), np.floor(top / step + 1e-9) + 1.0)
    marks = (
        degrees(low[0], high[0], 60.0, lambda u: true * u, "angle θ round the axis"),
        Axis("height z", up(heights), tuple(f"{h:g}".replace("-", "−") for h in heights)),
    )
    poles = max(float(r[0]), float(r[-1])) == 0.0 or surface.euler_characteristic > 0
    scale = 1.0 if name == "equal_area" or isinstance(surface, Cylinder) else None
    return Sheet(
        name, note, low, high, (True, periodic), places, flattened, marks, (), scale,
        (lambda points: points[:, :2]) if poles else None,
    )  # fmt: skip


def axis_of_lengths(name: str, side: float) -> Axis:
    """Round numbers from −side/2 to side/2."""
    step = _round_step(side / 5.0)
    ticks = step * np.arange(np.ceil(-0.5 * side / step - 1e-9), np.floor(0.5 * side / step + 1e-9) + 1.0)
    return Axis(name, ticks, tuple(f"{t:g}".replace("-", "−") for t in ticks))


def flat_sheet(surface: FlatTorus | Graph) -> Sheet:
    """The rectangle seen from above."""
    sides = np.array([surface.width, surface.height])
    periodic = surface.period is not None

    def places(points: Floats) -> Floats:
        return points[:, :2].copy()

    def flattened(at: Floats) -> Floats:
        return at

    marks = [axis_of_lengths(name, float(side)) for side, name in zip(sides, "xy", strict=True)]
    flat = isinstance(surface, FlatTorus)
    note = "to scale" if flat else "seen from above: slopes are foreshortened"
    if periodic:
        note += "; opposite sides are joined"
    return Sheet(
        "plane", note, -0.5 * sides, 0.5 * sides, (periodic, periodic), places, flattened,
        (marks[0], marks[1]), (), 1.0 if flat else None,
    )  # fmt: skip


def _profile(surface: Cylinder | Catenoid | Revolution) -> tuple[float, float, Callable[[Floats], Floats]]:
    """Ends of the height, and the radius at heights."""
    if isinstance(surface, Revolution):
        return surface.bottom, surface.top, lambda z: np.sqrt(np.maximum(surface.square(z), 0.0))
    end = 0.5 * surface.height
    if isinstance(surface, Catenoid):
        neck = surface.neck_radius
        return -end, end, lambda z: neck * np.cosh(z / neck)
    return -end, end, lambda z: np.full(len(z), surface.radius)


def _round_step(most: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above ``most``."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(power * max(k for k in (1.0, 2.0, 5.0) if k * power <= most * (1.0 + 1e-12)))
