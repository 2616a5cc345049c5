"""`probe_potential`: a few bubbles of a foam moved through it, and what that costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import (
    Bools,
    Floats,
    Ints,
    as_flag,
    as_indices,
    as_instance,
    as_integer,
    as_number,
    as_points,
    frozen,
)
from warpedfoam.errors import ConvergenceError
from warpedfoam.foam import Foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.t1 import allowed, outward_tangents, pulls, t1, t1_sites
from warpedfoam.studies.held_cluster import HeldCluster, Hold, relax_held, volume_moment

#: Films shorter than the first, in bubble sizes, turn if they are pulled to; new ones have the second.
SHORT, FRESH = 0.02, 0.05
#: How often a step is halved before a film turns, and T1s in one step.
HALVINGS, MOST_T1 = 4, 24
#: A film that stops a step must be shorter than this by then, in bubble sizes.
STOPPING = 0.25


@dataclass(frozen=True, eq=False)
class ProbePotential:
    """Energy of a foam against where some of its bubbles are held, along one path.

    Attributes
    ----------
    points : (n, 3) array
        Where the centre of volume of the probe was held, in order.
    energies : (n,) array
        γ Σ film areas of the whole foam.
    forces : (n, 3) array
        −∇E by the held point at fixed topology, tangent to the surface.
    residuals : (n,) array
        Largest force left on a vertex or node, in γ d.
    minima : (n,) array of bool
        Whether the energy is a local minimum under the constraint.
    n_t1 : (n,) array
        T1s made up to there since the start.
    foams : tuple of Foam
    """

    points: Floats
    energies: Floats
    forces: Floats
    residuals: Floats
    minima: Bools
    n_t1: Ints
    foams: tuple[Foam, ...]


def probe_potential(
    foam: Foam,
    bubbles: ArrayLike,
    *,
    points: ArrayLike,
    t1: bool = True,
    step: float = 0.1,
    tolerance: float = 1e-9,
    max_iterations: int = 60,
    progress: Callable[[str, float], None] | None = None,
) -> ProbePotential:
    """Move the centre of volume of some bubbles through a foam, from point to point.

    As in `cluster_potential` the energy is minimised under e_k · ∫ (x − q) w dA = 0, the integral over
    ``bubbles`` alone, every volume held; the multipliers are the force −∇E. All around is foam, which
    yields and rearranges: the *soft* probe.

    T1s make E many-valued. At fixed topology it is a function of q as far as the topology lasts, and the
    force is its slope. With ``t1`` a film that vanishes on the way turns, and the energy falls by a jump:
    what is returned then belongs to this path, and the way back is another. Curvature is seen in the
    mean over many paths, not on one: a foam holds a probe with forces of the order of γ d.

    Parameters
    ----------
    foam : Foam
        Relaxed; with or without an exterior.
    bubbles : (k,) integer array
        The probe; it should be in one piece round its centre.
    points : (n, 3) array
        Where to hold its centre, one after the other, projected. From where it is, and from point to
        point, it goes along the projected chord.
    t1 : bool, optional
        Whether films may turn.
    step : float, optional
        Longest step on the way, in bubble sizes, at most 0.5.
    tolerance : float, optional
        Of the residual, in γ d.
    max_iterations : int, optional
        Newton steps at one place.
    progress : callable, optional
        Called as ``progress("probe", fraction)``.

    Raises
    ------
    TypeError, ValueError
        Wrong types or shapes, no such bubbles, all of them, or the exterior among them.
    ConvergenceError
        If a film wants to vanish and may not, or a place cannot be reached.

    Examples
    --------
    At rest nothing pulls; a little off, the foam pulls back:

    >>> from warpedfoam import HeleShawCell, Torus, relax, voronoi_foam
    >>> tube = Torus(4.0, 1.5)
    >>> rest = relax(voronoi_foam(HeleShawCell(tube, gap=0.1), 60, seed=3), order=6).foam
    >>> at = held_centre(rest, [0])
    >>> up = tube.vertex_frames(at[None])[0, 0]
    >>> found = probe_potential(rest, [0], points=[at, at + 0.1 * up], t1=False)
    >>> bool(abs(found.forces[0]).max() < 1e-6), bool(found.forces[1] @ up < -1e-3)
    (True, True)
    """
    probe = _probe(foam, bubbles)
    surface = foam.cell.surface
    where = surface.project(as_points(points, "points"))
    turning = as_flag(t1, "t1")
    stride = as_number(step, "step", positive=True, maximum=0.5) * foam.bubble_size
    tol = as_number(tolerance, "tolerance", minimum=1e-13, maximum=1e-3)
    limit = as_integer(max_iterations, "max_iterations", minimum=1)
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    here, now, turned = held_centre(foam, probe), foam, 0
    found: list[HeldCluster] = []
    counts = []
    for k, target in enumerate(where):
        way = nearest_image(target - here, surface.period)
        pieces = max(1, int(np.ceil(float(np.linalg.norm(way)) / stride)))
        share, size = 0.0, 1.0 / pieces
        while True:
            size = min(size, 1.0 - share)
            end = share + size > 1.0 - 1e-9
            at = target if end else surface.project((here + (share + size) * way)[None])[0]
            held, made = _moved(now, probe, at, tol, limit, turning, size <= 1.01 / (pieces * 2**HALVINGS))
            if held is None:
                size *= 0.5
                continue
            now, turned = held.foam, turned + made
            share += size
            if share > 1.0 - 1e-9:
                break
            size = min(2.0 * size, 1.0 / pieces)
        here = target
        found.append(held)
        counts.append(turned)
        if progress is not None:
            progress("probe", (k + 1) / len(where))
    return ProbePotential(
        points=frozen(where),
        energies=frozen(np.array([one.foam.energy for one in found])),
        forces=frozen(np.array([one.force for one in found])),
        residuals=frozen(np.array([one.residual for one in found])),
        minima=frozen(np.array([one.is_minimum for one in found])),
        n_t1=frozen(np.array(counts, dtype=np.int64)),
        foams=tuple(one.foam for one in found),
    )


def held_centre(foam: Foam, bubbles: ArrayLike) -> Floats:
    """Where the centre of volume of some bubbles is, (3,): the point that `probe_potential` holds."""
    probe, surface = _probe(foam, bubbles), foam.cell.surface
    centres = foam.bubble_centres[probe]
    about = centres[0] + nearest_image(centres - centres[0], surface.period).mean(axis=0)
    point = surface.project(about[None])[0]
    for _ in range(20):
        moment, volume = volume_moment(foam, point, probe)
        frame = surface.vertex_frames(point[None])[0]
        off = (frame @ moment / volume) @ frame
        point = surface.project((point + off)[None])[0]
        if np.linalg.norm(off) < 1e-13 * surface.size:
            break
    return np.asarray(frozen(point))


def _probe(foam: Foam, bubbles: ArrayLike) -> Ints:
    as_instance(foam, "foam", Foam)
    if not np.size(bubbles):
        raise ValueError("bubbles is empty")
    probe = np.unique(as_indices(bubbles, "bubbles", (None,), below=foam.n_bubbles))
    if foam.exterior is not None and (probe == foam.exterior).any():
        raise ValueError("bubbles must not name the exterior")
    if len(probe) == foam.n_bubbles:
        raise ValueError("bubbles must leave some of the foam round the probe")
    return probe


def _moved(
    foam: Foam, probe: Ints, at: Floats, tolerance: float, limit: int, turning: bool, last: bool
) -> tuple[HeldCluster | None, int]:
    """The foam with the probe at a place, and the T1s made; None if a shorter step should be tried."""
    surface = foam.cell.surface
    hold = Hold(at, surface.vertex_frames(at[None])[0], None, probe)
    now, turned = foam, np.zeros(0, dtype=np.int64)
    while True:
        held, made = relax_held(now, hold, tolerance=tolerance, max_iterations=limit), len(turned)
        if held.converged:
            films = _turning(held.foam, SHORT) if turning else np.zeros(0, dtype=np.int64)
            # what has turned here does not turn back
            films = films[~np.isin(films, turned)]
            if not films.size:
                return held, made
            now = held.foam
        elif not last:
            return None, 0
        else:
            films = _stopping(now) if turning else np.zeros(0, dtype=np.int64)
            films = films[~np.isin(films, turned)]
        if not films.size or made >= MOST_T1:
            what = "after a film has turned" if made else "a film may want to vanish"
            raise ConvergenceError(
                f"the probe held at {np.round(at, 3).tolist()} did not converge in {held.iterations} steps: "
                f"residual {held.residual:.1e}; {what}"
            )
        now = t1(now, int(films[0]), length=FRESH * foam.bubble_size)
        turned = np.append(turned, films[0])


def _chords(foam: Foam) -> Floats:
    tail, head = foam.film_ends
    return np.asarray(np.linalg.norm(head - tail, axis=1) / foam.bubble_size)


def _turning(foam: Foam, short: float) -> Ints:
    """Short films whose neighbours pull harder on the turned one, shortest first."""
    size = _chords(foam)
    films = np.flatnonzero(size < short)
    sites = t1_sites(foam.network, films)
    fine = allowed(foam.network, sites)
    tangents = outward_tangents(
        foam.cell.surface, foam.network, foam.vertex_points, foam.film_offsets, sites.outer
    )
    now, then = pulls(tangents)
    fine &= np.linalg.norm(then, axis=1) > np.linalg.norm(now, axis=1)
    films = films[fine]
    return np.asarray(films[np.argsort(size[films], kind="stable")])


def _stopping(before: Foam) -> Ints:
    """Films that may turn and were short before a step that failed, shortest first."""
    was = _chords(before)
    films = np.flatnonzero(was < STOPPING)
    films = films[allowed(before.network, t1_sites(before.network, films))]
    return np.asarray(films[np.argsort(was[films], kind="stable")])
