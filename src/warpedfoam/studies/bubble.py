"""`bubble_between_plates`: one bubble whose film is free to slide on the plates and to bulge between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats, as_choice, as_floats, as_instance, as_integer, as_number, frozen
from warpedfoam.cell import HeleShawCell
from warpedfoam.kernels.lateral_film import film_grid, region_moments, region_points, resampled, truncation
from warpedfoam.studies.chart import Chart, OutOfChart, angle_coordinates, tangent_coordinates
from warpedfoam.studies.held import HeldBubble, Solved, solve, stiffness
from warpedfoam.studies.rims import OverRim, beyond, near_rim, require_on_surface

#: Numbers of angles tried in turn, and the truncation that is good enough.
ANGLES, RESOLVED = (17, 25, 37, 55), 1e-9
#: Truncation from which a result says so.
ROUGH = 1e-4
#: Radial nodes: this many, and one more for so many angles more.
RADIAL, ANGLES_A_RADIAL = 8, 6
#: Least radius of a bubble in sizes of the surface: below, round-off hides its nodes.
LEAST_RADIUS = 1e-8
#: Ways to hold a bubble.
HOLDS = ("centroid", "projection", "free")
#: Gaps above this share of the critical one are named as the reason when no bubble is stable.
NEARLY = 0.85


@dataclass(frozen=True, eq=False)
class BubbleBetweenPlates:
    """One bubble at rest between two plates, or the place where the search for it ended.

    Attributes
    ----------
    cell : HeleShawCell
    volume : float
        V.
    position : (3,) array
        Where it is held, on the inner plate; where it came to rest if ``hold`` is "free".
    hold : str
        "centroid", "projection" or "free".
    layers : int
        Layers of the film, 1 if it is ruled.
    energy : float
        E = γ × film area, γ = 1.
    pressure : float
        p = ∂E/∂V, above that outside.
    force : (3,) array
        −∂E/∂q, tangent to the inner plate at ``position``: where the bubble would drift.
    contact_radii : (2,) array
        Lengths of the contact lines on the inner and the outer plate over 2π.
    contact_error : float
        Largest deviation of a contact angle from 90°, in radians.
    centroid : (3,) array
        (1/V) ∫ X dV.
    points : (layers + 1, m, 3) array
        Curves of nodes round the film, from the inner plate to the outer one.
    residual : float
        Largest force on a node that nothing balances, in units of γ d.
    volume_error : float
        Largest relative error of the volume and of the held coordinates (these in units of the radius).
    truncation : float
        Highest modes of the film in its angle, in radii: how well ``m`` angles resolve it.
    stiffness : float
        Least eigenvalue of the energy's Hessian, by the radii of nodes, under the constraints.
    is_minimum : bool
        Whether no small change of the film's shape lowers the energy; under "free" of its place neither.
    converged : bool
        Residual and errors below 1e-9 (round-off, where that is more: in gaps of a thousandth of the radius),
        and a minimum.
    iterations : int
        Newton steps on the last grid.
    message : str
        Why it ended, and what to mind.
    """

    cell: HeleShawCell
    volume: float
    position: Floats
    hold: str
    layers: int
    energy: float
    pressure: float
    force: Floats
    contact_radii: Floats
    contact_error: float
    centroid: Floats
    points: Floats
    residual: float
    volume_error: float
    truncation: float
    stiffness: float
    is_minimum: bool
    converged: bool
    iterations: int
    message: str

    @property
    def flat_energy(self) -> float:
        """E0 = 2 γ sqrt(π V d), that of a round bubble between parallel planes."""
        return 2.0 * float(np.sqrt(np.pi * self.volume * self.cell.mean_gap))

    @property
    def flat_radius(self) -> float:
        """sqrt(V / (π d))."""
        return float(np.sqrt(self.volume / (np.pi * self.cell.mean_gap)))


def critical_gap(volume: float) -> float:
    """d_crit = (π V)^(1/3): between planes farther apart a round bubble is unstable."""
    return float(np.cbrt(np.pi * volume))


def bubble_between_plates(
    cell: HeleShawCell,
    volume: float,
    position: ArrayLike,
    *,
    layers: int = 4,
    hold: str = "centroid",
    angles: int | None = None,
) -> BubbleBetweenPlates:
    """Bubble of least film area at a given volume, in full three dimensions.

    The film spans the gap. The plates are frictionless: it slides on them, meets them at 90° at rest, and
    bulges between them to a surface of constant mean curvature. It is a polynomial of degree ``layers``
    through Gauss–Lobatto heights and a Fourier series around the bubble; Newton's method finds the least
    E = γ A at fixed volume, with exact gradients.

    Parameters
    ----------
    cell : HeleShawCell
    volume : float
        V > 0.
    position : (3,) array
        Where the bubble is held, or starts: a point of the inner plate, or near it.
    layers : int, optional
        1 to 12. One layer is the ruled film along the plate's normals; 2 or more bulge. On the torus R = 20,
        r = 4 with V = d = 0.5 the ratio E/E0 is within 1.1e-5, 1.1e-8, 1.6e-9 and 5e-12 of the converged one
        for 2, 3, 4 and 5 layers.
    hold : {"centroid", "projection", "free"}, optional
        What stays where it is. "projection": the centroid (1/V) ∫ X dV, whose nearest point of the plate is
        ``position``. "centroid": the bubble's mean angles on surfaces that have angles, (1/V) ∫ φ dV = φ0 and
        the same for the other one on a `Torus` and a `Cylinder`; as "projection" on all others. "free":
        nothing; the bubble drifts to the nearest place where no force acts.
    angles : int, optional
        Nodes around the bubble, odd, 5 to 99; by default as many as it takes (17 to 55).

    Returns
    -------
    BubbleBetweenPlates

    Raises
    ------
    TypeError, ValueError
        For bad input; if the gap varies; if ``position`` is not near the surface, or beyond its rim, or the
        bubble is too large for its surface or reaches over its rim.

    Notes
    -----
    The force on a held bubble is the constraint's multiplier; it is −dE/dq to the accuracy of the energy.
    A gap beyond d_crit = (π V)^(1/3) (exact between planes) makes the round bubble unstable: the Hessian then
    has a negative eigenvalue, and the result says so in ``is_minimum``, ``converged`` and ``message``. On
    curved plates the film loses its balance a little earlier.

    O(I L m) evaluations of the surface and one dense solve of L m unknowns per step, 3 to 6 steps.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere
    >>> bubble = bubble_between_plates(HeleShawCell(Sphere(12.0), 0.5), volume=0.5, position=[0.0, 0.0, 12.0])
    >>> round(bubble.energy, 8), round(bubble.pressure, 7), bubble.contact_radii.round(7)
    (1.77185043, 1.7709332, array([0.5516696, 0.5763222]))
    """
    task = _Task.checked(cell, volume, layers, hold, angles)
    start = as_floats(position, "position", (3,))
    point = cell.surface.project(start[None])[0]
    require_on_surface(cell.surface, point, "position")
    if hold == "free":
        return _at_rest(task, point)
    return _held(task, point)


@dataclass(frozen=True, eq=False)
class _Task:
    """The checked arguments of `bubble_between_plates`, but for the position."""

    cell: HeleShawCell
    volume: float
    layers: int
    hold: str
    angles: tuple[int, ...]

    @classmethod
    def checked(cls, cell: object, volume: object, layers: object, hold: object, angles: object) -> _Task:
        between = as_instance(cell, "cell", HeleShawCell)
        between.parallel_gap("a bubble between plates")
        amount = as_number(volume, "volume", positive=True)
        count = as_integer(layers, "layers", minimum=1, maximum=12)
        how = as_choice(hold, "hold", HOLDS)
        if not amount < between.volume:
            raise ValueError(
                f"volume must be less than the cell's, {between.volume:.6g}, got {amount:g}; "
                "take a smaller bubble or a larger surface"
            )
        radius, least = (
            float(np.sqrt(amount / (np.pi * between.mean_gap))),
            LEAST_RADIUS * between.surface.size,
        )
        if radius < least:
            raise ValueError(
                f"volume must be larger, got {amount:g}: on a surface of size {between.surface.size:.3g} the "
                f"nodes of a bubble of radius {radius:.2g}, less than {least:.2g}, differ by round-off only"
            )
        tried: tuple[int, ...] = ANGLES
        if angles is not None:
            number = as_integer(angles, "angles", minimum=5, maximum=99)
            if number % 2 == 0:
                raise ValueError(f"angles must be odd (an even film would not feel a zigzag), got {number}")
            tried = (number,)
        return cls(between, amount, count, how, tried)

    @property
    def radius(self) -> float:
        """Of the flat bubble."""
        return float(np.sqrt(self.volume / (np.pi * self.cell.mean_gap)))

    def too_large(self, point: Floats) -> ValueError:
        return ValueError(
            f"volume {self.volume:g} is too large for the surface near {point.round(4).tolist()}: a bubble "
            f"of radius about {self.radius:.3g} reaches to where the surface has turned away from it, or to "
            "itself; take a smaller volume, a wider gap or a larger surface"
        )


def _held(task: _Task, point: Floats) -> BubbleBetweenPlates:
    """The bubble held at a point of the surface, on the first grid that resolves it."""
    surface, gap = task.cell.surface, task.cell.mean_gap
    chart = Chart.at(surface, point)
    angular = angle_coordinates(chart) if task.hold != "projection" else None
    coordinates = tangent_coordinates(chart) if angular is None else angular
    radius = task.radius
    if surface.period is not None and 2.2 * radius > surface.period.min():
        raise task.too_large(point)
    multipliers = np.array([np.sqrt(np.pi * gap / task.volume), 0.0, 0.0])
    radii = np.full((1, task.angles[0]), radius)
    solved: Solved | None = None
    for count in task.angles:
        grid = film_grid(gap, task.layers, count, RADIAL + (count - ANGLES[0]) // ANGLES_A_RADIAL)
        held = HeldBubble(chart, grid, task.volume, coordinates)
        start = np.broadcast_to(resampled(radii, count), (grid.n_free, count))
        try:
            solved = solve(held, start, multipliers)
        except (OutOfChart, np.linalg.LinAlgError):
            raise task.too_large(point) from None
        radii, multipliers = solved.state.radii, solved.multipliers
        left = truncation(grid, radii, solved.state.nodes.points)
        if left <= RESOLVED or solved.worst > held.tolerance:
            break
    assert solved is not None
    _require_inside_rim(task, held, solved)
    return _report(task, held, solved, left, force_turns=angular is None)


def _require_inside_rim(task: _Task, held: HeldBubble, solved: Solved) -> None:
    """Refuse a bubble that has the rim under it: films that end there are another problem."""
    surface, origin, nodes = task.cell.surface, held.chart.origin, solved.state.nodes
    reach = float(np.linalg.norm(nodes.points - origin, axis=-1).max())
    if not near_rim(surface, origin, reach):
        return
    # where the region touches the inner plate, and the feet of the whole film
    feet = nodes.points[-1] - held.grid.heights[:, None, None] * nodes.normals
    under = np.concatenate([nodes.points[:, 0].reshape(-1, 3), feet.reshape(-1, 3)])
    if beyond(surface, under).any():
        away = float(np.linalg.norm(surface.rim.nearest(origin[None])[0] - origin)) if surface.rim else 0.0
        raise OverRim(
            f"volume {task.volume:g} is too large so close to the rim: the bubble at "
            f"{origin.round(4).tolist()} has a radius of about {task.radius:.3g} and would reach over "
            f"the rim, {away:.3g} away; hold it farther from the rim or take a smaller volume"
        )


def _report(
    task: _Task, held: HeldBubble, solved: Solved, left: float, *, force_turns: bool
) -> BubbleBetweenPlates:
    chart, grid, state = held.chart, held.grid, solved.state
    film = state.nodes.points[-1]
    around = np.matmul(grid.turn, film)
    edges = np.linalg.norm(around[[0, -1]], axis=2).mean(axis=1)
    # dX/dt at both plates, from the polynomial through the heights
    ends = np.linalg.solve(grid.rise.T @ grid.rise, grid.rise.T @ grid.climb)[[0, -1]]
    across = np.cross(around[[0, -1]], np.tensordot(ends, film, 1))
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    slip = np.einsum("kjx,kjx->kj", across, state.nodes.normals[[0, -1]])
    at = region_points(grid, state.nodes.points) - chart.origin
    moments, _ = region_moments(grid, state.nodes.points, np.moveaxis(at, -1, 0), np.zeros((3, *at.shape)))
    away = moments / task.volume
    slope = task.volume * solved.multipliers[1:]
    if force_turns:
        # as q moves, the tangent plane at q turns under the centroid, which lies above it
        shape = task.cell.surface.shape_operators(chart.origin[None], project=False)[0]
        lever = float(away @ chart.frame[2]) * (chart.frame[:2] @ shape @ chart.frame[:2].T)
        slope = slope + lever @ slope
    met = bool(solved.worst <= held.tolerance)
    softest = stiffness(held, solved)
    minimum = softest > 0.0
    return BubbleBetweenPlates(
        cell=task.cell,
        volume=task.volume,
        position=frozen(chart.origin),
        hold=task.hold,
        layers=task.layers,
        energy=state.energy,
        pressure=float(solved.multipliers[0]),
        force=frozen(-slope @ chart.frame[:2]),
        contact_radii=frozen(edges),
        contact_error=float(np.abs(np.arcsin(slip)).max()),
        centroid=frozen(chart.origin + away),
        points=frozen(film),
        residual=solved.residual,
        volume_error=solved.fault,
        truncation=left,
        stiffness=softest,
        is_minimum=minimum,
        converged=met and minimum,
        iterations=solved.iterations,
        message=_message(task, met, minimum)
        + (f", but {len(grid.angles)} angles resolve it only to {left:.1g}" if left > ROUGH else ""),
    )


def _message(task: _Task, met: bool, minimum: bool) -> str:
    gap, limit = task.cell.mean_gap, critical_gap(task.volume)
    where = "beyond" if gap > limit else "close to"
    wide = f"the gap {gap:g} is {where} (pi V)^(1/3) = {limit:.4g}, where a round bubble loses its stability"
    if not met:
        return f"forces do not balance: {wide if gap > NEARLY * limit else 'the bubble may be too large'}"
    if not minimum:
        return f"unstable: {wide if gap > NEARLY * limit else 'a change of shape lowers the energy'}"
    if gap > limit and task.layers == 1:
        return f"at rest as a ruled film, but one that may bulge would be unstable: {wide}"
    return "at rest"


#: Steps of a free bubble; force in units of γ d at which it rests; step of differences, in radii; stiffness
#: of its place, in units of γ d per radius, that counts as none.
FREE_STEPS, REST, DIFFERENCE, FLAT = 60, 1e-9, 1e-2, 1e-9


def _at_rest(task: _Task, point: Floats) -> BubbleBetweenPlates:
    """Follow the force of a held bubble to a place without force: Newton's method in two dimensions."""
    surface, gap, h = task.cell.surface, task.cell.mean_gap, DIFFERENCE * task.radius
    bubble = _held(task, point)
    longest = max(0.5 * task.radius, 0.25 / max(1e-60, *map(abs, surface.curvature_range())))
    values = np.zeros(2)
    for _ in range(FREE_STEPS):
        if not bubble.converged:
            break
        frame = surface.vertex_frames(bubble.position[None])[0]
        pull = frame @ bubble.force
        columns = []
        for step in h * np.eye(2):
            ahead, behind = (
                _held(task, surface.retract(bubble.position[None], s * step[None])[0]) for s in (1.0, -1.0)
            )
            columns.append(frame @ (behind.force - ahead.force) / (2.0 * h))
        bend = np.stack(columns, axis=1)
        values, vectors = np.linalg.eigh(0.5 * (bend + bend.T))
        if np.abs(pull).max() <= REST * gap:
            break
        along = vectors.T @ pull / np.maximum(np.abs(values), FLAT * gap / task.radius)
        move = vectors @ along
        move *= min(1.0, longest / float(np.linalg.norm(move)))
        for _ in range(8):
            there = _held(task, surface.retract(bubble.position[None], move[None])[0])
            if there.energy <= bubble.energy * (1.0 + 1e-13):
                break
            move = 0.5 * move
        else:
            break
        bubble = there
    return _settled(bubble, values, gap)


def _settled(bubble: BubbleBetweenPlates, values: Floats, gap: float) -> BubbleBetweenPlates:
    rests = float(np.abs(bubble.force).max()) <= REST * gap
    lowest = bool(values.min() >= -FLAT * gap / bubble.flat_radius)
    message = bubble.message
    if bubble.converged and not rests:
        message = "still drifting: start nearer to a place of rest"
    elif bubble.converged and not lowest:
        message = "at rest, but not where the energy is least"
    return replace(
        bubble,
        is_minimum=bubble.is_minimum and rests and lowest,
        converged=bubble.converged and rests and lowest,
        message=message,
    )
