"""`relax`: a foam to its local minimum of energy at fixed volumes, with T1s on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from warpedfoam.arrays import as_flag, as_integer, as_number, frozen
from warpedfoam.errors import TopologyError
from warpedfoam.foam import MAX_ORDER, Foam
from warpedfoam.relax.layered import relax_layers, require_lines
from warpedfoam.relax.linear import SingularMatrixError, factoriser
from warpedfoam.relax.result import Relaxation, RelaxationHistory
from warpedfoam.relax.rims import RimMet
from warpedfoam.relax.steps import (
    EXACT_ABOVE,
    EXACT_BELOW,
    LEAST_SHIFT,
    Run,
    exact_step,
    is_minimum,
    newton_matrix,
    proximal_step,
)
from warpedfoam.relax.system import (
    Linearised,
    Residuals,
    State,
    Stopwatch,
    System,
    pinned_unknowns,
)

#: Volumes below this share of the mean are held as if they had it.
LEAST_SHARE = 0.1
#: Least share of a step that is tried after one that led nowhere.
LEAST_STEP = 0.01
#: Relative error that the total of rough volumes may show.
DRAFT = 0.03
SLIPPED = (
    "stopped: the volumes no longer add up, so a film has slipped round the surface or a bubble has turned "
    "inside out; use more bubbles, volumes that differ less, or more marker vertices"
)
SINGULAR = "stopped: the Newton matrix is singular"
DEGENERATE = (
    "stopped: a force became infinite or undefined, a film has degenerated; begin with more even seeds "
    "(seeds='blue', or lloyd=5) or more bubbles"
)


def relax(
    foam: Foam,
    *,
    order: int | None = None,
    layers: int = 1,
    t1: bool = True,
    contacts: bool = True,
    tolerance: float = 1e-10,
    max_iterations: int = 1000,
    solver: str = "auto",
    progress: Callable[[str, float], None] | None = None,
) -> Relaxation:
    """Relax a foam to a local minimum of its film energy, every bubble's volume held.

    Minimises E = γ Σ (film areas through the gap) subject to V_i = V_i*. Far from equilibrium the
    steps are a proximal method of multipliers with local shifts; close to it Newton's method on the
    KKT system, with exact second derivatives and the film offsets eliminated film by film. Films
    that are about to vanish turn (T1) between steps if the pull of their neighbours favours it.
    One step costs two to five times its sparse factor-and-solve.

    Parameters
    ----------
    foam : Foam
    order : int, optional
        p of the films, 2 … 24; the foam's own by default. 4 for daily use, 8 for checks.
    layers : int, optional
        Layers of each film across the gap, 1 … 8. One layer is ruled along the surface's normals. With 2 or
        more the relaxed ruled foam is let go: its films slide on the plates, meet them at 90° and bulge in
        between, and the result is a `LayeredRelaxation`.
    t1 : bool, optional
        Whether films may turn. Without T1s a film that wants to vanish keeps the foam from
        converging, which is reported.
    contacts : bool, optional
        Whether open clusters that meet are joined and bubbles that let go are parted between the steps
        (`with_contacts`), and markers put where outlines need them. Without it films that cross are not
        seen.
    tolerance : float, optional
        Of the residual, in γ d, 1e-13 … 1e-3. Volumes are held to a hundredth of it or to 1e-12,
        whichever is larger, relative (bubbles below a tenth of the mean: relative to that).
    max_iterations : int, optional
    solver : {"auto", "superlu", "pardiso"}, optional
        Sparse solver; ``"auto"`` takes pardiso from 2000 bubbles if the package pypardiso is installed.
    progress : callable, optional
        Called as ``progress("relax", fraction)`` after each step.

    Returns
    -------
    Relaxation
        Look at ``.converged`` before use: a foam that did not converge is returned as it stands.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range.

    Examples
    --------
    >>> from warpedfoam import HeleShawCell, Sphere, voronoi_foam
    >>> foam = voronoi_foam(HeleShawCell(Sphere(1.0), gap=0.01), n_bubbles=40, seed=1)
    >>> result = relax(foam)
    >>> result.converged, result.residual < 1e-10, result.volume_error < 1e-12
    (True, True, True)
    """
    if not isinstance(foam, Foam):
        raise TypeError(f"foam must be a Foam, got {type(foam).__name__}")
    with_t1, meet = as_flag(t1, "t1"), as_flag(contacts, "contacts")
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    tol = as_number(tolerance, "tolerance", minimum=1e-13, maximum=1e-3)
    limit = as_integer(max_iterations, "max_iterations", minimum=0)
    p = as_integer(foam.order if order is None else order, "order", minimum=2, maximum=MAX_ORDER)
    across = as_integer(layers, "layers", minimum=1, maximum=8)
    if across > 1:
        require_lines(foam)
    method = factoriser(solver, foam.n_bubbles)
    start = foam.with_order(p)
    system = System(foam.cell, foam.target_volumes, p, method, foam.n_bubbles, foam.exterior)
    system.follows = foam.exterior is not None
    clock = Stopwatch(system.timings)
    scale = foam.tension * system.film_unit / system.mean_volume
    pressures = np.zeros(foam.n_bubbles) if foam.pressures is None else foam.pressures / scale
    if foam.exterior is not None:
        pressures = pressures - pressures[foam.exterior]
    state = State(start.network, start.vertex_points, start.film_offsets, pressures)
    run = Run(
        system,
        state,
        start,
        with_t1,
        np.zeros(start.network.n_films, dtype=np.int64),
        pinned_unknowns(foam.cell, state),
        meet and foam.exterior is not None,
    )
    first = run.snapshot()
    residuals, converged = _iterate(run, tol, limit, progress)
    clock.lap("total")
    if run.fault and not _adds_up(run):
        # what cannot be told apart from a slipped film is not handed out
        run.restore(first)
    state = run.state
    scale = foam.tension * run.system.film_unit / run.system.mean_volume
    zero = state.pressures.mean() if foam.exterior is None else state.pressures[foam.exterior]
    pressures = frozen((state.pressures - zero) * scale)
    final = replace(
        run.foam,
        network=state.network,
        vertex_points=state.points,
        film_offsets=state.offsets,
        pressures=pressures,
    )
    ruled = Relaxation(
        foam=final,
        energy=final.energy,
        pressures=pressures,
        residual=residuals.force,
        volume_error=residuals.volume_error,
        converged=converged,
        is_minimum=run.is_minimum,
        iterations=run.iteration,
        events=tuple(run.events),
        history=RelaxationHistory.of_rows(run.rows),
        timings=MappingProxyType(dict(system.timings)),
        message=_message(converged, residuals, run, tol, limit),
        contacts=tuple(run.contacts),
    )
    if across == 1:
        return ruled
    if not converged:
        return replace(ruled, message=f"{ruled.message}; the films were not let go to bulge")
    return relax_layers(ruled, across, tol)


def _adds_up(run: Run) -> bool:
    """Whether the volumes of the run's state add up, computed in full."""
    return run.system.linearise(run.state).slip <= run.foam.cell.surface.precision


def _iterate(
    run: Run, tolerance: float, limit: int, progress: Callable[[str, float], None] | None
) -> tuple[Residuals, bool]:
    exact = False
    sound = run.snapshot()
    while True:
        lin = run.system.linearise(run.state, draft=not exact)
        now = lin.residuals
        if progress is not None:
            # the mean digit count of the vertices' residuals grows almost evenly with time
            progress("relax", float(-np.log10(np.clip(now.vertex, 1e-5, 1.0)).mean()) / 5.0)
        # the volumes of tiny bubbles cannot be held to twelve digits: a tenth of the mean counts instead
        held = float((np.abs(now.volume) / np.maximum(run.system.shares, LEAST_SHARE)).max())
        done = now.force <= tolerance and held <= max(0.01 * tolerance, 1e-12)
        slipped = lin.slip > (DRAFT if lin.draft else run.foam.cell.surface.precision)
        if slipped or not np.isfinite(now.force):
            run.restore(sound)
            run.share *= 0.5
            hopeless = run.share < LEAST_STEP or run.iteration >= limit or run.state is lin.state
            if not hopeless:
                # a shorter step from where all was well
                lin = run.system.linearise(run.state, draft=not exact)
                now, hopeless = lin.residuals, not np.isfinite(lin.residuals.force)
            if hopeless:
                run.fault = SLIPPED if slipped else DEGENERATE
                return now, False
        else:
            sound = run.snapshot()
            run.share = min(1.0, 1.5 * run.share)
        if lin.draft and (done or run.iteration >= limit):
            exact = True
            continue
        if done or run.iteration >= limit:
            condensed = lin.condensed(positive=False)
            run.is_minimum = is_minimum(lin, newton_matrix(run, lin, condensed, LEAST_SHIFT), condensed)
            if run.is_minimum or run.iteration >= limit:
                _note(run, lin, exact)
                if run.refused:
                    run.fault = f"stopped: outlines have met, and {run.refused}"
                return now, done and run.is_minimum and not run.refused
        error = float(np.abs(now.volume / run.system.shares).max())
        if not exact:
            exact = now.force < EXACT_BELOW and error < EXACT_BELOW
        elif now.force > EXACT_ABOVE:
            exact = False
        _note(run, lin, exact)
        try:
            if exact:
                exact_step(run, lin)
            else:
                proximal_step(run, lin)
        except SingularMatrixError:
            run.fault = SINGULAR
            return now, False
        except RimMet as error:
            run.fault = f"stopped: {error}"
            return now, False
        except TopologyError as error:
            run.fault = f"stopped: outlines have met, and {error}"
            return now, False
        run.iteration += 1


def _note(run: Run, lin: Linearised, exact: bool) -> None:
    """Book the state that is about to be left, or that the run ends in."""
    now = lin.residuals
    energy = run.foam.tension * float(lin.area.sum())
    run.rows.append((run.iteration, energy, now.force, now.volume_error, len(run.events), exact))


def _message(converged: bool, residuals: Residuals, run: Run, tolerance: float, limit: int) -> str:
    if converged:
        return f"converged in {run.iteration} steps with {len(run.events)} T1s"
    if run.fault:
        return run.fault
    if residuals.force <= tolerance and not run.is_minimum:
        return "stopped at a stationary foam that is no minimum"
    return (
        f"not converged after {run.iteration} of {limit} steps: residual {residuals.force:.2e} "
        f"(wanted {tolerance:.0e}), volume error {residuals.volume_error:.2e}"
    )
