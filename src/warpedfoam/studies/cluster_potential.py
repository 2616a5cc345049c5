"""`cluster_potential`: energy, force and torque of a cluster against where its centre of volume is held."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import (
    Bools,
    Floats,
    as_choice,
    as_floats,
    as_instance,
    as_integer,
    as_number,
    as_points,
    frozen,
)
from warpedfoam.cell import HeleShawCell
from warpedfoam.errors import ConvergenceError, TopologyError
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.studies.cluster import cluster_clearance, cluster_foam, geodesic_chart
from warpedfoam.studies.held_cluster import HeldCluster, Hold, relax_held, turn_by, volume_moment

#: Torques below this share of the energy are none; where there is none, a turn tells whether it stays so.
NO_TORQUE, PROBE = 1e-9, 0.13
#: Steps in which a free orientation follows its torque, how many, and how well it is found; radians.
TURN, MOST_TURNS, ANGLE = 0.25, 30, 1e-6
#: A cluster turned by less than this starts from where it was, others from the layout; radians.
NEAR = 0.03
#: Clusters whose parts come nearer than this, in bubble sizes, touch themselves.
TOUCHING = 0.02


@dataclass(frozen=True, eq=False)
class _Rest:
    """A held cluster, its orientation, and whether both are a minimum."""

    held: HeldCluster
    angle: float
    minimum: bool


@dataclass(frozen=True, eq=False)
class ClusterPotential:
    """Energy of a cluster at each of several points.

    Attributes
    ----------
    points : (n, 3) array
        Where the centre of volume was held.
    energies : (n,) array
        γ Σ film areas.
    forces : (n, 3) array
        −∇E by the held point, tangent to the surface; with the orientation held, it is carried along
        parallel to itself.
    torques : (n,) array
        −dE/dα by the orientation, counter-clockwise: nearly 0 where it is free, 0 for one bubble.
    orientations : (n,) array
        α, held or found, in radians from the first of `Surface.vertex_frames`.
    pressures : (n, n_bubbles) array
        Against the exterior.
    residuals : (n,) array
        Largest force left on a vertex or node, in γ d.
    minima : (n,) array of bool
        Whether the energy is a local minimum under the constraints.
    foams : tuple of Foam
    """

    points: Floats
    energies: Floats
    forces: Floats
    torques: Floats
    orientations: Floats
    pressures: Floats
    residuals: Floats
    minima: Bools
    foams: tuple[Foam, ...]


def cluster_potential(
    cell: HeleShawCell,
    n_bubbles: int | None = None,
    *,
    points: ArrayLike,
    cluster: Foam | None = None,
    volumes: float | ArrayLike | None = None,
    layout: str | ArrayLike = "hexagonal",
    hold: str = "centre",
    orientation: float | ArrayLike = 0.0,
    order: int = 8,
    max_turn: float = 60.0,
    seed: int | None = None,
    tolerance: float = 1e-10,
    max_iterations: int = 200,
    progress: Callable[[str, float], None] | None = None,
) -> ClusterPotential:
    """Energy of a cluster against its position, every volume and the centre of volume held.

    At a point q the foam's energy is minimised under e_k · ∫ (x − q) w dA = 0 for both tangent vectors
    e_k at q, with w = d + H d² + G d³/3 the volume per area of the inner plate; the multipliers are the
    force. For one bubble it is the geometric potential of the paper, with films along the normals.

    Parameters
    ----------
    cell : HeleShawCell
    n_bubbles, volumes, layout, max_turn, seed
        As in `cluster_foam`.
    points : (n, 3) array
        Where to hold the centre of volume; projected.
    cluster : Foam, optional
        One cluster with its exterior, in place of ``n_bubbles``: its topology, volumes and film order are
        kept, also where it is not at rest. Its orientation counts from its present one.
    hold : {"centre", "both"}, optional
        ``"both"`` holds the orientation too, measured by the mean turn of the threefold vertices.
    orientation : float or (n,) array, optional
        Where held: angle in radians of the layout's x axis from the first of `Surface.vertex_frames` at
        each point. Where free: where to start from; the cluster turns the way it is driven until the
        torque vanishes.
    order : int, optional
        p of the films.
    tolerance : float, optional
        Of the residual, in γ d.
    progress : callable, optional
        Called as ``progress("cluster", fraction)``.

    Raises
    ------
    TypeError, ValueError, TopologyError
        As in `cluster_foam`; or the cluster touches itself once relaxed.
    ConvergenceError
        If a held cluster does not converge, for example because one of its films wants to vanish:
        no T1s are made while it is held.

    Examples
    --------
    >>> import numpy as np
    >>> from warpedfoam import Torus
    >>> torus = Torus(20.0, 4.0)
    >>> cell = HeleShawCell(torus, gap=0.5)
    >>> where = torus.points(np.array([0.0, np.pi]), np.zeros(2))
    >>> one = cluster_potential(cell, 1, volumes=0.5, points=where)
    >>> (one.energies / np.sqrt(4 * np.pi * 0.5 * 0.5)).round(7)  # over that of a flat bubble
    array([0.9995627, 1.0008647])
    """
    as_instance(cell, "cell", HeleShawCell)
    surface = cell.surface
    where = surface.project(as_points(points, "points"))
    kind = as_choice(hold, "hold", ("centre", "both"))
    angles = as_floats(
        np.full(len(where), orientation) if np.ndim(orientation) == 0 else orientation,
        "orientation",
        (len(where),),
    )
    tol = as_number(tolerance, "tolerance", minimum=1e-13, maximum=1e-3)
    limit = as_integer(max_iterations, "max_iterations", minimum=1)
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    if cluster is None:
        if volumes is None:
            raise TypeError("volumes must be given with n_bubbles")
        shape = cluster_foam(
            cell,
            n_bubbles,
            volumes=volumes,
            layout=layout,
            centre=where[0],
            max_turn=max_turn,
            order=order,
            seed=seed,
        )
    else:
        if n_bubbles is not None or volumes is not None:
            raise ValueError("cluster already has its bubbles and volumes: leave out n_bubbles and volumes")
        shape = _one_cluster(as_instance(cluster, "cluster", Foam), cell)
    if shape.n_bubbles < 3 and kind == "both":
        raise ValueError("a single bubble has no orientation to hold")
    plane = _plane(shape, None if cluster is not None else where[0])
    found = []
    for k, (point, angle) in enumerate(zip(where, angles, strict=True)):
        found.append(_held_at(shape, plane, point, float(angle), kind == "both", tol, limit))
        if progress is not None:
            progress("cluster", (k + 1) / len(where))
    return ClusterPotential(
        points=frozen(where),
        energies=frozen(np.array([one.held.foam.energy for one in found])),
        forces=frozen(np.array([one.held.force for one in found])),
        torques=frozen(np.nan_to_num(np.array([one.held.torque for one in found]), nan=0.0)),
        orientations=frozen(np.array([one.angle for one in found])),
        pressures=frozen(np.array([one.held.foam.pressures for one in found])),
        residuals=frozen(np.array([one.held.residual for one in found])),
        minima=frozen(np.array([one.minimum for one in found])),
        foams=tuple(one.held.foam for one in found),
    )


def _one_cluster(foam: Foam, cell: HeleShawCell) -> Foam:
    """A foam that is one cluster in this very cell."""
    if foam.exterior is None:
        raise ValueError("cluster must be a foam with an exterior; see cluster_foam")
    if foam.cell != cell:
        raise ValueError("cluster must lie in the same cell")
    network = foam.network
    starts = network.loops.halves[network.loops.starts]
    if int((network.bubble[starts] == foam.exterior).sum()) != 1:
        raise ValueError("cluster must be one cluster: its exterior has several outlines")
    return foam


def _plane(foam: Foam, centre: Floats | None) -> Floats:
    """Vertices of a cluster in the frame of its centre, (n_vertices, 2), as far along it as they are away."""
    surface = foam.cell.surface
    if centre is None:
        rough = surface.project(foam.vertex_points.mean(axis=0)[None])[0]
        moment, volume = volume_moment(foam, rough)
        centre = surface.project((rough + moment / volume)[None])[0]
    away = foam.vertex_points - centre
    if surface.period is not None:
        away = nearest_image(away, surface.period)
    flat = away @ surface.vertex_frames(centre[None])[0].T
    span = np.linalg.norm(flat, axis=1, keepdims=True)
    out: Floats = flat * (np.linalg.norm(away, axis=1, keepdims=True) / np.maximum(span, 1e-300))
    return out


def _held_at(
    shape: Foam, plane: Floats, point: Floats, angle: float, both: bool, tolerance: float, limit: int
) -> _Rest:
    """The cluster at rest at one point, at an orientation or at the nearest one that it settles in."""
    surface = shape.cell.surface
    frame = surface.vertex_frames(point[None])[0]
    arms = plane * (shape.network.vertex_degrees == 3)[:, None]
    near = np.round(point, 3).tolist()

    def solve(alpha: float, known: _Rest | None) -> _Rest:
        if known is not None and abs(known.angle - alpha) < NEAR:
            foam = known.held.foam
        else:
            placed = geodesic_chart(surface, point, plane, alpha)
            foam = replace(shape, vertex_points=placed, pressures=None)
        turned = arms @ turn_by(alpha) if arms.any() else None
        held = relax_held(foam, Hold(point, frame, turned), tolerance=tolerance, max_iterations=limit)
        if not held.converged:
            raise ConvergenceError(
                f"the cluster held at {near} did not converge in {held.iterations} steps: residual "
                f"{held.residual:.1e}, {held.displaced:.1e} bubble sizes from its place"
            )
        return _Rest(held, alpha, held.is_minimum)

    rest = solve(angle, None)
    if not both and arms.any():
        rest = _settled(solve, rest)
    if cluster_clearance(rest.held.foam) < TOUCHING:
        raise TopologyError(f"the cluster held at {near} touches itself")
    return rest


def _settled(solve: Callable[[float, _Rest | None], _Rest], first: _Rest) -> _Rest:
    """Follow the torque to where it vanishes; stay where it makes no difference."""
    from scipy.optimize import brentq

    small = NO_TORQUE * first.held.foam.energy
    here = first
    if abs(first.held.torque) <= small:
        here = solve(first.angle + PROBE, first)
        if here.held.torque <= small:
            return first
    way = np.sign(here.held.torque)
    for _ in range(MOST_TURNS):
        there = solve(here.angle + way * TURN, here)
        if there.held.torque * way <= 0.0:
            break
        here = there
    else:
        return replace(here, minimum=False)
    seen = {here.angle: here, there.angle: there}

    def torque(alpha: float) -> float:
        if alpha not in seen:
            nearest = min(seen, key=lambda known: abs(known - alpha))
            seen[alpha] = solve(alpha, seen[nearest])
        return seen[alpha].held.torque

    alpha = float(brentq(torque, here.angle, there.angle, xtol=ANGLE, rtol=1e-12))
    torque(alpha)
    return seen[alpha]
