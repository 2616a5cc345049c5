"""`geometric_potential`: the energy of a bubble over its place, its force and its predicted path."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import (
    Bools,
    Floats,
    Ints,
    as_choice,
    as_floats,
    as_instance,
    as_integer,
    as_number,
    as_points,
    frozen,
)
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import ConvergenceError
from warpedfoam.io.atomic import PathLike, atomic_text, writable_path
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.studies.bubble import BubbleBetweenPlates, bubble_between_plates
from warpedfoam.studies.rims import OverRim, disks_over_rim, require_on_surface
from warpedfoam.surfaces.protocol import Layer, Surface
from warpedfoam.theory import second_order_energy

#: E of (volume, gap, k1, k2), the last two arrays of principal curvatures of the inner plate.
Model = Callable[[float, Any, Floats, Floats], Floats]
FILMS, THEORY = ("free", "ruled"), "theory"
#: Step of the differences that give a model's force, in flat radii.
DIFFERENCE = 0.05


@dataclass(frozen=True, eq=False)
class GeometricPotential:
    """Energies of one bubble at many places.

    Attributes
    ----------
    cell : HeleShawCell
    volume : float
    method : str
        "free" or "ruled" for relaxed films, "theory", or the name of the model.
    layers : int
        Layers of the films; 0 for a model.
    points : (n, 3) array
        Places on the inner plate.
    energies : (n,) array
        E(q), γ = 1; NaN where no bubble came to rest.
    forces : (n, 3) array
        −∂E/∂q, tangent to the inner plate.
    pressures : (n,) array
        ∂E/∂V; NaN for models.
    converged : (n,) bool array
        Whether the bubble there came to rest; for models, whether a disk of its flat radius stays on the
        surface.
    triangles : (k, 3) int array or None
        Of the triangulation whose nodes the points are, if they cover the surface.
    lengths : (n,) array or None
        Distance along the path, if the points are one: along the surface from each to the next, or straight
        where they are too far apart for a film.
    """

    cell: HeleShawCell
    volume: float
    method: str
    layers: int
    points: Floats
    energies: Floats
    forces: Floats
    pressures: Floats
    converged: Bools
    triangles: Ints | None
    lengths: Floats | None

    @property
    def flat_energy(self) -> float:
        """E0 = 2 γ sqrt(π V d)."""
        return 2.0 * float(np.sqrt(np.pi * self.volume * self.cell.mean_gap))

    @property
    def ratios(self) -> Floats:
        """E/E0, (n,)."""
        out: Floats = self.energies / self.flat_energy
        return out


def geometric_potential(
    cell: HeleShawCell,
    volume: float,
    *,
    points: ArrayLike | None = None,
    path: ArrayLike | None = None,
    method: str | Model = "free",
    layers: int = 4,
    hold: str = "centroid",
    nodes: int = 300,
) -> GeometricPotential:
    """Energy, force and pressure of a bubble held at each of many places.

    Parameters
    ----------
    cell : HeleShawCell
    volume : float
        V of the bubble.
    points : (n, 3) array, optional
        Places, on the inner plate or near it. Without ``points`` and ``path``: the nodes of a triangulation
        of the whole surface.
    path : (n, 3) array, optional
        Instead, places one after the other; the result has the distances along them.
    method : {"free", "ruled", "theory"} or callable, optional
        "free": films in full three dimensions, `bubble_between_plates`, about 0.1 s a place. "ruled": films
        along the plate's normals. "theory": `warpedfoam.theory.second_order_energy`, a moment for any
        surface. Any other callable that gives E from (volume, gap, k1, k2), the last two the inner plate's
        principal curvatures, (n,) each, will do as well; where the gap varies, models get the
        gap at each place, and films are refused.
    layers, hold : optional
        See `bubble_between_plates`; "free" is no choice here. A model has neither.
    nodes : int, optional
        About how many nodes if the whole surface is covered, at least 50.

    Returns
    -------
    GeometricPotential

    Raises
    ------
    TypeError, ValueError
        For bad input; if the bubble is too large for its surface somewhere, or reaches over the rim
        everywhere.

    Notes
    -----
    Bubbles that did not come to rest, or would reach over the rim of a surface that has one, have NaN for
    energy, force and pressure and False in ``converged``.
    Forces of models are differences of order four along the surface.

    Examples
    --------
    >>> import numpy as np
    >>> from warpedfoam import HeleShawCell, Torus
    >>> torus = Torus(20.0, 4.0)
    >>> cell = HeleShawCell(torus, gap=0.5)
    >>> path = torus.points(np.radians([0.0, 90.0, 180.0]), np.zeros(3))
    >>> geometric_potential(cell, 0.5, path=path, method="ruled").ratios.round(8)
    array([0.99956269, 1.00007266, 1.00086467])
    """
    between = as_instance(cell, "cell", HeleShawCell)
    amount = as_number(volume, "volume", positive=True)
    surface = between.surface
    triangles: Ints | None = None
    if points is not None and path is not None:
        raise ValueError("give points or path, not both")
    if points is None and path is None:
        mesh = surface.triangulate(as_integer(nodes, "nodes", minimum=50))
        places, triangles = mesh.nodes, mesh.triangles
    else:
        name, given = ("points", points) if path is None else ("path", path)
        assert given is not None
        places = surface.project(as_points(given, name, minimum=1 if path is None else 2))
    lengths = None if path is None else _travelled(surface, places)
    out = _evaluate(between, amount, places, method, layers, hold)
    return replace(out, triangles=triangles, lengths=lengths)


def _travelled(surface: Surface, places: Floats) -> Floats:
    """Distances along a path, (n,), places being joined as the ends of a film of no offset are."""
    tail = places[:-1]
    straight = nearest_image(places[1:] - tail, surface.period)
    steps = surface.arc_measure(tail, tail + straight, np.zeros((len(tail), 1)), Layer.surface())
    # no film reaches as far as the other side of a level set
    steps = np.where(np.isfinite(steps), steps, np.linalg.norm(straight, axis=1))
    return frozen(np.concatenate([[0.0], np.cumsum(steps)]))


def _evaluate(
    cell: HeleShawCell, volume: float, places: Floats, method: str | Model, layers: int, hold: str
) -> GeometricPotential:
    if method == THEORY or callable(method):
        model: Model = method if callable(method) else second_order_energy
        name = getattr(method, "__name__", type(method).__name__) if callable(method) else THEORY
        kept = ~disks_over_rim(cell.surface, places, _flat_radius(cell, volume))
        _require_some(kept, volume)
        rows = np.full((len(places), 5), np.nan)
        rows[kept, 0], rows[kept, 2:] = _of_model(cell, volume, places[kept], model)
        shared = (frozen(places), frozen(rows[:, 0]), frozen(rows[:, 2:]), frozen(rows[:, 1]), frozen(kept))
        return GeometricPotential(cell, volume, name, 0, *shared, triangles=None, lengths=None)
    kind = as_choice(method, "method", (*FILMS, THEORY))
    count = 1 if kind == "ruled" else as_integer(layers, "layers", minimum=2, maximum=12)
    how = as_choice(hold, "hold", ("centroid", "projection"))

    def bubble(q: Floats) -> BubbleBetweenPlates | None:
        try:
            return bubble_between_plates(cell, volume, q, layers=count, hold=how)
        except OverRim:
            return None

    return _collected(cell, volume, kind, count, places, [bubble(q) for q in places])


def _flat_radius(cell: HeleShawCell, volume: float) -> float:
    return float(np.sqrt(volume / (np.pi * cell.mean_gap)))


def _require_some(kept: Bools, volume: float) -> None:
    if not kept.any():
        raise OverRim(
            f"volume {volume:g} is too large so close to the rim: the bubble would reach over it at "
            + ("the place given" if len(kept) == 1 else f"all {len(kept)} places")
            + "; take places farther from the rim or a smaller volume"
        )


def _collected(
    cell: HeleShawCell,
    volume: float,
    kind: str,
    layers: int,
    places: Floats,
    bubbles: list[BubbleBetweenPlates | None],
) -> GeometricPotential:
    _require_some(np.array([b is not None for b in bubbles]), volume)
    rests = np.array([b is not None and b.converged for b in bubbles])
    rows = np.full((len(places), 5), np.nan)
    for row, b in zip(rows, bubbles, strict=True):
        if b is not None and b.converged:
            row[:] = [b.energy, b.pressure, *b.force]
    return GeometricPotential(
        cell,
        volume,
        kind,
        layers,
        frozen(places),
        frozen(rows[:, 0]),
        frozen(rows[:, 2:]),
        frozen(rows[:, 1]),
        frozen(rests),
        None,
        None,
    )


def _of_model(cell: HeleShawCell, volume: float, places: Floats, model: Model) -> tuple[Floats, Floats]:
    """Energies (n,) and forces (n, 3) of a model."""
    surface, n = cell.surface, len(places)

    def energies(points: Floats) -> Floats:
        k1, k2 = surface.principal_curvatures(points).T
        values = np.asarray(model(volume, cell.mean_gap if cell.parallel else cell.gaps(points), k1, k2))
        return as_floats(values, "the values of method", (len(points),))

    h = DIFFERENCE * _flat_radius(cell, volume)
    slopes = []
    for axis in np.eye(2):
        steps = np.repeat(h * np.array([-2.0, -1.0, 1.0, 2.0]), n)[:, None] * axis
        around = energies(surface.retract(np.tile(places, (4, 1)), steps)).reshape(4, n)
        slopes.append((around[0] - 8.0 * around[1] + 8.0 * around[2] - around[3]) / (12.0 * h))
    frames = surface.vertex_frames(places)
    return energies(places), -np.einsum("in,nix->nx", np.stack(slopes), frames)


def drift_path(
    cell: HeleShawCell,
    volume: float,
    start: ArrayLike,
    *,
    method: str | Model = "free",
    layers: int = 4,
    step: float | None = None,
    most: int = 200,
) -> GeometricPotential:
    """Path of steepest descent of the potential, along which a bubble with friction drifts.

    Midpoint steps along F/|F|, halved where the energy would rise or the force turn back, until they are 2⁻¹⁰
    of the first. On a surface with a rim the path ends where the bubble touches it.

    Parameters
    ----------
    cell, volume, method, layers
        As for `geometric_potential`.
    start : (3,) array
        Where the bubble is let go.
    step : float, optional
        Length of a step, by default the flat radius sqrt(V/(πd)).
    most : int, optional
        Most steps taken.

    Returns
    -------
    GeometricPotential
        At the points of the path, with the distances along it.

    Raises
    ------
    TypeError, ValueError
        For bad input.
    ConvergenceError
        If a bubble on the way does not come to rest.

    Examples
    --------
    >>> import numpy as np
    >>> from warpedfoam import HeleShawCell, Torus
    >>> torus = Torus(20.0, 4.0)
    >>> start = torus.points(np.array(3.0), np.array(0.0))
    >>> path = drift_path(HeleShawCell(torus, 0.5), 0.5, start, method=lambda v, d, k1, k2: -k1 * k2)
    >>> bool(abs(torus.angles(path.points[-1:])[0]) < 1e-2)  # the outer equator
    True
    """
    between = as_instance(cell, "cell", HeleShawCell)
    amount = as_number(volume, "volume", positive=True)
    surface = between.surface
    first = _flat_radius(between, amount) if step is None else as_number(step, "step", positive=True)
    count = as_integer(most, "most", minimum=1)
    place = surface.project(as_floats(start, "start", (3,))[None])
    require_on_surface(surface, place[0], "start")

    def at(point: Floats) -> GeometricPotential:
        out = _evaluate(between, amount, point, method, layers, "centroid")
        if not out.converged[0]:
            raise ConvergenceError(f"the bubble at {point[0].round(4).tolist()} does not come to rest")
        return out

    def moved(point: Floats, force: Floats, length: float) -> Floats:
        steps = np.einsum("nix,nx->ni", surface.vertex_frames(point), force)
        return surface.retract(point, length * steps / np.linalg.norm(steps))

    here, size = at(place), first
    trail, travelled = [here], [0.0]
    while len(trail) <= count and size > first / 1024.0:
        if np.linalg.norm(here.forces) <= 1e-12 * between.mean_gap:
            break
        try:
            middle = at(moved(here.points, here.forces, 0.5 * size))
            pull = middle.forces if np.linalg.norm(middle.forces) > 0.0 else here.forces
            there = at(moved(here.points, pull, size))
        except OverRim:
            size *= 0.5
            continue
        # neither uphill nor past the bottom
        ahead = float((there.forces * (there.points - here.points)).sum())
        if there.energies[0] < here.energies[0] and ahead >= 0.0:
            trail.append(there)
            travelled.append(travelled[-1] + size)
            here = there
        else:
            size *= 0.5

    def joined(name: str) -> Floats:
        return frozen(np.concatenate([getattr(part, name) for part in trail]))

    return replace(
        here,
        points=joined("points"),
        energies=joined("energies"),
        forces=joined("forces"),
        pressures=joined("pressures"),
        converged=frozen(np.ones(len(trail), dtype=bool)),
        lengths=frozen(np.array(travelled)),
    )


def write_potential_csv(path: PathLike, *potentials: GeometricPotential) -> Path:
    """Write potentials of the same places side by side, one row per place.

    Columns: ``x, y, z``; ``length`` along a path; ``gaussian_curvature``; then for each potential, under its
    method's name, energy, E/E0, pressure and the force's three components. Missing numbers stay blank.

    Parameters
    ----------
    path : str or path
    *potentials : GeometricPotential
        At least one, of the same cell and points, with different methods.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    TypeError, ValueError
        If there is none, or they do not belong together.
    FileNotFoundError, IsADirectoryError
        If the path cannot be written.
    """
    target = writable_path(path)
    if not potentials:
        raise ValueError("potentials must hold at least one GeometricPotential")
    first = as_instance(potentials[0], "potentials", GeometricPotential)
    columns: dict[str, list[float]] = dict(zip("xyz", first.points.T.tolist(), strict=True))
    if first.lengths is not None:
        columns["length"] = first.lengths.tolist()
    columns["gaussian_curvature"] = first.cell.surface.gaussian_curvature(first.points).tolist()
    for item in potentials:
        one = as_instance(item, "potentials", GeometricPotential)
        if one.cell is not first.cell or not np.array_equal(one.points, first.points):
            raise ValueError("potentials must be of the same cell and points")
        name = one.method
        if f"{name}_energy" in columns:
            raise ValueError(f"potentials must have different methods, but two are {name!r}")
        columns[f"{name}_energy"] = one.energies.tolist()
        columns[f"{name}_ratio"] = one.ratios.tolist()
        columns[f"{name}_pressure"] = one.pressures.tolist()
        for axis, force in zip("xyz", one.forces.T.tolist(), strict=True):
            columns[f"{name}_force_{axis}"] = force
    with atomic_text(target) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            writer.writerow(["" if np.isnan(value) else value for value in row])
    return target
