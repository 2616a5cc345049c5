"""Films in full three dimensions for the paper's figures: one bubble in many cells, as columns of numbers.

The paper is A. Mughal, S. J. Cox and G. E. Schröder-Turk, Interface Focus 7, 20160106 (2017). γ = 1, and
E0 = 2 sqrt(π V d).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from warpedfoam.arrays import Floats, frozen
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import ConvergenceError
from warpedfoam.studies.bubble import bubble_between_plates
from warpedfoam.surfaces import Catenoid, Cylinder, Sphere, Surface, Torus
from warpedfoam.theory import second_order_ratio

Columns = dict[str, Floats]
#: Called with the fraction done.
Report = Callable[[float], None]


def _silent(_: float) -> None:
    pass


#: Cells whose curvature is scaled down: a name, and the surface and a place on it at a scale.
SCALED: dict[str, Callable[[float], tuple[Surface, Floats]]] = {
    "sphere": lambda s: (Sphere(4.0 * s), np.array([0.0, 0.0, 4.0 * s])),
    "torus, 0°": lambda s: _on_torus(s, 0.0),
    "torus, 90°": lambda s: _on_torus(s, 90.0),
    "torus, 180°": lambda s: _on_torus(s, 180.0),
    "cylinder": lambda s: (Cylinder(4.0 * s, 20.0 * s), np.array([4.0 * s, 0.0, 0.0])),
    "saddle": lambda s: (Catenoid(4.0 * s, 10.0 * s), np.array([4.0 * s, 0.0, 0.0])),
}


def sphere_films(
    gap: float, volumes: Sequence[float], radii: Sequence[float], *, layers: int = 4, report: Report = _silent
) -> Columns:
    """Bubbles between spheres: ``sphere_radius``, ``volume``, ``energy``, ``ratio`` = E/E0, ``pressure``.

    Raises
    ------
    ConvergenceError
        If a bubble does not come to rest.
    ValueError
        If a size is out of range.
    """
    tasks = [
        (HeleShawCell(Sphere(r), gap), v, np.array([0.0, 0.0, r]), [r, v]) for v in volumes for r in radii
    ]
    return _films(tasks, ("sphere_radius", "volume"), layers, report)


def torus_films(
    gap: float,
    volumes: Sequence[float],
    degrees: Sequence[float],
    *,
    major_radius: float = 20.0,
    minor_radius: float = 4.0,
    layers: int = 4,
    report: Report = _silent,
) -> Columns:
    """Bubbles held at tube angles: ``phi_degrees``, ``volume``, ``energy``, ``ratio``, ``pressure``.

    Raises
    ------
    ConvergenceError, ValueError
        As for `sphere_films`.
    """
    torus = Torus(major_radius, minor_radius)
    cell = HeleShawCell(torus, gap)
    tasks = [
        (cell, v, torus.points(np.radians(phi), np.zeros(())), [phi, v]) for v in volumes for phi in degrees
    ]
    return _films(tasks, ("phi_degrees", "volume"), layers, report)


def cylinder_films(
    gap: float,
    volumes: Sequence[float],
    radii: Sequence[float],
    *,
    places: int = 1,
    layers: int = 4,
    report: Report = _silent,
) -> Columns:
    """Bubbles at places round and along a cylinder of height 4r.

    Columns ``cylinder_radius``, ``volume``, ``angle_degrees``, ``z``, ``energy``, ``ratio``, ``pressure``.

    Raises
    ------
    ConvergenceError, ValueError
        As for `sphere_films`.
    """
    tasks = []
    for r in radii:
        cell = HeleShawCell(Cylinder(r, 4.0 * r), gap)
        for v in volumes:
            for k in range(places):
                angle = 360.0 * k / places
                z = r * (k / max(places - 1, 1) - 0.5) if places > 1 else 0.0
                turn = np.radians(angle)
                at = np.array([r * np.cos(turn), r * np.sin(turn), z])
                tasks.append((cell, v, at, [r, v, angle, z]))
    return _films(tasks, ("cylinder_radius", "volume", "angle_degrees", "z"), layers, report)


def scaled_films(
    gap: float,
    volume: float,
    scales: Sequence[float] = (1.0, 2.0, 4.0, 8.0),
    *,
    cases: Sequence[str] = tuple(SCALED),
    layers: int = 6,
    report: Report = _silent,
) -> Columns:
    """The same bubble in cells ever less curved, and what second-order theory leaves of its energy.

    Columns ``case`` (place in ``cases``), ``scale``, ``k1``, ``k2`` (inner plate), ``ratio``, ``theory``,
    ``error`` = |ratio − theory|.

    Raises
    ------
    ConvergenceError, ValueError
        As for `sphere_films`.
    """
    tasks, k = [], []
    for number, name in enumerate(cases):
        for scale in scales:
            surface, place = SCALED[name](scale)
            k.append(surface.principal_curvatures(place[None])[0])
            tasks.append((HeleShawCell(surface, gap), volume, place, [float(number), scale]))
    out = _films(tasks, ("case", "scale"), layers, report)
    k1, k2 = np.array(k).T
    theory = second_order_ratio(volume, gap, k1, k2)
    return {
        "case": out["case"],
        "scale": out["scale"],
        "k1": frozen(k1),
        "k2": frozen(k2),
        "ratio": out["ratio"],
        "theory": frozen(theory),
        "error": frozen(np.abs(out["ratio"] - theory)),
    }


def _films(
    tasks: list[tuple[HeleShawCell, float, Floats, list[float]]],
    names: tuple[str, ...],
    layers: int,
    report: Report,
) -> Columns:
    rows = []
    for done, (cell, volume, place, key) in enumerate(tasks):
        bubble = bubble_between_plates(cell, volume, place, layers=layers)
        if not bubble.converged:
            where = ", ".join(f"{name} = {value:g}" for name, value in zip(names, key, strict=True))
            raise ConvergenceError(f"the bubble at {where} does not come to rest: {bubble.message}")
        rows.append([*key, bubble.energy, bubble.energy / bubble.flat_energy, bubble.pressure])
        report((done + 1) / len(tasks))
    table = np.array(rows).T
    return {
        name: frozen(column)
        for name, column in zip((*names, "energy", "ratio", "pressure"), table, strict=True)
    }


def _on_torus(scale: float, degrees: float) -> tuple[Surface, Floats]:
    torus = Torus(20.0 * scale, 4.0 * scale)
    return torus, torus.points(np.radians(degrees), np.zeros(()))
