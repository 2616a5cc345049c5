"""`drift`: a foam in time, by friction against the film energy, with T1s on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.arrays import as_flag, as_instance, as_number, frozen
from warpedfoam.errors import TopologyError
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, writable_path
from warpedfoam.io.trajectory import SUFFIXES, Trajectory, TrajectoryWriter
from warpedfoam.motion.changes import CHANGES, chords, cutoffs
from warpedfoam.motion.drag import FrictionLaw
from warpedfoam.motion.endings import MET, RIM, TOO_SHORT, VANISHED
from warpedfoam.motion.frames import new_trajectory
from warpedfoam.motion.markers import spaced
from warpedfoam.motion.meeting import at_rim, crosses, marked
from warpedfoam.motion.options import DriftOptions
from warpedfoam.motion.result import Drift, DriftEvent
from warpedfoam.motion.scene import Scene
from warpedfoam.motion.stepper import StepFailed, Stepper
from warpedfoam.relax.rims import RimMet
from warpedfoam.relax.system import State

#: First step, in λ ℓ²/γ; a step below the second share of that is no step.
FIRST, LEAST = 1e-3, 1e-10
#: How steps grow and shrink: safety, least and greatest factor; factors after a failure and after a second.
SAFETY, SHRINK, GROW, FAILED = 0.9, 0.2, 2.0, (0.5, 0.2)
#: Steps stay below this share of one that failed, and that bound grows by this in every step.
BELOW, LIFT = 0.8, 1.3
#: A film below its cutoff may lose this share of its length in a step.
LOSS = 0.5
#: Sweeps that space markers after one step.
SPACINGS = 6
#: Without volumes to hold, a bubble below this share of the mean volume has vanished.
NOTHING = 1e-3
#: Changes of topology after one step.
MOST_CHANGES = 20

Progress = Callable[[str, float], None]


@dataclass(eq=False)
class _Run:
    """The moving parts of a drift."""

    stepper: Stepper
    options: DriftOptions
    state: State
    time: float = 0.0
    step: float = 0.0
    bound: float = 1e300
    count: int = 0
    rejected: int = 0
    foams: list[Foam] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    log: list[tuple[float, float, float, float]] = field(default_factory=list)
    events: list[DriftEvent] = field(default_factory=list)
    noted: tuple[int, int] = (0, 0)
    fault: str = ""


def drift(
    foam: Foam,
    *,
    friction: float = 1.0,
    duration: float,
    every: float | None = None,
    yield_friction: float = 0.0,
    hold_volumes: bool = True,
    tolerance: float = 1e-3,
    step: float | None = None,
    method: str = "extrapolated",
    order: int | None = None,
    t1: bool = True,
    cutoff: float = 0.02,
    trajectory: PathLike | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Drift:
    """Let a foam drift: its films move against friction on the plates, every volume held.

    The normal velocity v of each film obeys λ v = (p_i − p_j) − γ κ_g (the viscous froth; thin gap), films
    meet at 120° and end on rims at 90°. At any gap it is the gradient flow of the film energy: −δE = λ v
    per film area, so that dE/dt = −λ ∫ v² dA over all films. Per length of film the friction is λ d.

    An Euler step is a *minimising movement*: it minimises E plus the friction's work under the volumes, by
    Newton's method on the foam's own matrix, so that E cannot rise. One step and two half steps,
    extrapolated, are of second order; their difference sets the step. T1s happen between steps.

    Parameters
    ----------
    foam : Foam
        Its volumes are brought to their targets first. Films should be relaxed or nearly so.
    friction : float, optional
        λ, force per film area and velocity.
    duration : float
        Time to cover. λ ℓ²/γ, ℓ the bubble size, is the time in which bubbles find their shape.
    every : float, optional
        Time between frames; a fiftieth of the duration by default. There is one at the end in any case.
    yield_friction : float, optional
        τ: a film does not move where the force on it is below τ per film area; λ v + τ v/|v| where it moves.
        Rounded off so that a film held below τ creeps, at about a thousandth of τ/λ.
    hold_volumes : bool, optional
        False: all pressures are 0. Films shorten by their curvature alone, and bubbles are the grains of
        grain growth, until one vanishes.
    tolerance : float, optional
        Largest difference between one step and two half steps, in bubble sizes, 1e-8 … 0.1.
    step : float, optional
        A fixed time step in place of adaptive ones (shorter only before frames and where it must be).
    method : {"extrapolated", "euler"}, optional
        Second or first order in the time step; ``"euler"`` needs ``step``.
    order : int, optional
        p of the films; the foam's own by default.
    t1 : bool, optional
        Whether films may turn, and clusters meet and part.
    cutoff : float, optional
        Films shorter than this many bubble sizes may turn, if the energy falls.
    trajectory : str or path, optional
        HDF5 file (``.h5``) that takes each frame when it is reached; needs h5py.
    resume : bool, optional
        Go on with the frames in ``trajectory``, if there are any: the same foam and options are needed, the
        duration may grow. A run that was killed and resumed makes the same frames bit for bit.
    progress : callable, optional
        Called as ``progress("drift", fraction)`` after each step.

    Returns
    -------
    Drift
        Look at ``.completed``: a run that had to stop early says why in ``.message``.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range, the start cannot be brought to its volumes,
        or ``trajectory`` holds another run.
    FileExistsError
        If ``trajectory`` is there and ``resume`` is False.
    ImportError
        If ``trajectory`` is given and h5py is not installed.

    Notes
    -----
    The viscous froth is due to N. Kern, D. Weaire, A. Martin, S. Hutzler and S. J. Cox, Phys. Rev. E 70,
    041411 (2004). Outlines that meet are joined and films that let go are parted as in `relax`.

    Examples
    --------
    A circle on the unit sphere that shrinks without pressure: cos θ = cos θ₀ exp(γ t/λ).

    >>> import numpy as np
    >>> from warpedfoam import HeleShawCell, Sphere, cluster_foam
    >>> cell = HeleShawCell(Sphere(1.0), gap=0.01)
    >>> cap = cluster_foam(cell, 1, volumes=0.02, centre=[[0.0, 0.0, 1.0]])
    >>> film = drift(cap, duration=0.02, hold_volumes=False, every=0.01)
    >>> cosine = 1.0 - np.array([f.bubble_areas[0] for f in film.foams]) / (2.0 * np.pi)
    >>> bool(abs(cosine[2] / cosine[1] - np.exp(0.01)) < 1e-4)
    True
    """
    as_instance(foam, "foam", Foam)
    span = as_number(duration, "duration", positive=True)
    options = DriftOptions.checked(
        foam,
        span,
        {
            "friction": friction,
            "yield_friction": yield_friction,
            "hold_volumes": hold_volumes,
            "every": every,
            "tolerance": tolerance,
            "step": step,
            "method": method,
            "order": order,
            "t1": t1,
            "cutoff": cutoff,
        },
    )
    if options.method == "euler" and options.step is None:
        raise ValueError('step must be given for method="euler": its error is not estimated')
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    going_on = as_flag(resume, "resume")
    if going_on and trajectory is None:
        raise ValueError("resume needs trajectory, the file to go on with")
    run = _begun(foam, options)
    if trajectory is None:
        return _travelled(run, span, None, progress)
    path = writable_path(trajectory, suffixes=SUFFIXES)
    if going_on and path.exists():
        _recall(run, path)
    else:
        told = {"options": run.options.told(), "duration": span}
        new_trajectory(path, lambda writer: _write_frame(run, writer, told))
    with TrajectoryWriter(path, append=True) as writer:
        return _travelled(run, span, writer, progress)


def resume_drift(
    trajectory: PathLike, *, duration: float | None = None, progress: Progress | None = None
) -> Drift:
    """Go on with a drift from its trajectory alone, with the options kept in it.

    Parameters
    ----------
    trajectory : str or path
    duration : float, optional
        Of the whole run; what it was started with by default.
    progress : callable, optional

    Returns
    -------
    Drift
        The whole run, the frames that were there included.

    Raises
    ------
    ValueError
        If the frames are not those of a drift.
    FileNotFoundError, FileFormatError, ImportError
        If the file cannot be read.
    """
    with Trajectory(trajectory) as frames:
        told = frames.notes(0).get("drift")
        if not isinstance(told, dict):
            raise ValueError(f"{frames.path} holds no drift: it was written by something else")
        first = frames[0]
        path = frames.path
    span = as_number(told["duration"] if duration is None else duration, "duration", positive=True)
    return drift(first, duration=span, trajectory=path, resume=True, progress=progress, **told["options"])


def _begun(foam: Foam, options: DriftOptions) -> _Run:
    """A run at its start, the volumes right."""
    start = foam.with_order(options.order)
    law = FrictionLaw(options.friction, options.yield_friction)
    stepper = Stepper(start, law, hold_volumes=options.hold_volumes, method=options.method)
    try:
        state = stepper.on_volumes(stepper.state_of(start))
    except StepFailed as fault:
        raise ValueError(
            f"foam cannot be brought to its volumes ({fault}); relax it first, or let it keep the volumes "
            "that it has: dataclasses.replace(foam, target_volumes=None)"
        ) from None
    run = _Run(stepper, options, state)
    run.step = options.step or FIRST * stepper.time_scale
    run.log.append((0.0, stepper.energy(state), 0.0, 0.0))
    _keep_frame(run)
    return run


def _keep_frame(run: _Run) -> None:
    """Put the state into a frame, and go on from what the frame holds."""
    foam = run.stepper.foam_of(run.state)
    run.foams.append(foam)
    run.times.append(run.time)
    run.state = run.stepper.state_of(foam)


def _write_frame(run: _Run, writer: TrajectoryWriter, more: dict[str, Any]) -> None:
    """The last frame with all that is needed to go on from it."""
    log, events = run.noted
    notes: dict[str, Any] = {
        **more,
        "step": run.step,
        "bound": run.bound,
        "count": run.count,
        "rejected": run.rejected,
        "log": run.log[log:],
        "events": [asdict(event) for event in run.events[events:]],
    }
    run.noted = (len(run.log), len(run.events))
    writer.append(run.foams[-1], time=run.times[-1], notes={"drift": notes})


def _recall(run: _Run, path: Path) -> None:
    """Take up the run in a trajectory, if it is this one."""
    with Trajectory(path) as frames:
        notes = [frames.notes(k).get("drift") for k in range(len(frames))]
        if not notes or not all(isinstance(note, dict) for note in notes):
            raise ValueError(f"{path} holds no drift; use another file")
        foams = list(frames)
        times = frames.times.tolist()
    kept = [dict(note) for note in notes if note is not None]
    mine, theirs = run.options.told(), kept[0]["options"]
    other = [name for name in mine if mine[name] != theirs.get(name)]
    if other:
        raise ValueError(f"{path} holds a drift with another {', '.join(other)}; use another file")
    same = all(
        np.array_equal(getattr(run.foams[0], name), getattr(foams[0], name))
        for name in ("vertex_points", "film_offsets", "target_volumes")
    )
    if not same or foams[0].cell != run.foams[0].cell:
        raise ValueError(f"{path} holds the drift of another foam; use another file")
    run.foams, run.times, run.log, run.events = foams, times, [], []
    for note in kept:
        run.log += [(row[0], row[1], row[2], row[3]) for row in note["log"]]
        run.events += [DriftEvent.from_record(entry) for entry in note["events"]]
    last = kept[-1]
    run.time, run.step, run.bound = times[-1], last["step"], last["bound"]
    run.count, run.rejected = last["count"], last["rejected"]
    if foams[-1].n_bubbles != run.stepper.foam.n_bubbles:
        run.stepper = run.stepper.of(foams[-1])
    run.state = run.stepper.state_of(foams[-1])
    run.noted = (len(run.log), len(run.events))


def _travelled(
    run: _Run, duration: float, writer: TrajectoryWriter | None, progress: Progress | None
) -> Drift:
    while run.time < duration:
        # frames are counted, not added up
        number = int(np.floor(run.time / run.options.every * (1.0 + 1e-12))) + 1
        target = min(number * run.options.every, duration)
        if duration - target < 1e-9 * run.options.every:
            target = duration
        while run.time < target and not run.fault:
            _step(run, target)
            if progress is not None:
                progress("drift", run.time / duration)
        if run.time > run.times[-1]:
            # a run that has to stop shows where
            _keep_frame(run)
            if writer is not None:
                _write_frame(run, writer, {})
        if run.fault:
            break
    if progress is not None:
        progress("drift", 1.0)
    columns = np.array(run.log)
    met = sum(not event.kind.endswith("t1") for event in run.events)
    contacts = f" and {met} contact{'s' if met > 1 else ''}" if met else ""
    ended = f"drifted for {run.time:g} in {run.count} steps with {len(run.events) - met} T1s{contacts}"
    return Drift(
        foams=tuple(run.foams),
        times=frozen(np.array(run.times)),
        events=tuple(run.events),
        step_times=frozen(columns[:, 0].copy()),
        step_energies=frozen(columns[:, 1].copy()),
        step_errors=frozen(columns[:, 2].copy()),
        step_dissipation=frozen(columns[:, 3].copy()),
        n_rejected=run.rejected,
        completed=not run.fault,
        message=run.fault or ended,
    )


def _step(run: _Run, target: float) -> None:
    """One step that is kept, at most to ``target``; shorter and shorter ones are tried."""
    options, left = run.options, target - run.time
    while True:
        # two equal steps rather than a long and a tiny one
        time = left if run.step >= left else 0.5 * left if run.step > 0.5 * left else run.step
        if options.step is not None:
            time = min(options.step, run.step)
            time = left if time > left * (1.0 - 1e-9) else time
        if time < LEAST * run.stepper.time_scale:
            run.fault = TOO_SHORT.format(time=run.time, fault=run.fault or "tolerance")
            return
        try:
            made = run.stepper.advance(run.state, time)
            if _lost(run, made.state):
                raise StepFailed("a film shrinks too fast")
            if at_rim(_scene(run), run.state, made.state):
                raise StepFailed("an outline comes to the rim")
            if options.t1 and crosses(_scene(run), run.state, made.state):
                raise StepFailed("outlines meet")
        except RimMet as fault:
            run.fault = RIM.format(time=run.time, fault=fault)
            return
        except StepFailed as fault:
            run.step = FAILED[bool(run.fault)] * time
            run.bound = BELOW * time
            run.fault = str(fault)
            run.rejected += 1
            continue
        worst = made.error / options.tolerance
        if options.step is None and worst > 1.0:
            run.fault = ""
            run.rejected += 1
            run.step = time * max(SHRINK, SAFETY / np.sqrt(worst))
            continue
        break
    run.fault = ""
    if options.step is None:
        factor = min(GROW, SAFETY / np.sqrt(max(worst, 1e-12)))
        run.bound = min(LIFT * run.bound, 1e300)
        run.step = min(max(time * factor, run.step if time < run.step else 0.0), run.bound)
    else:
        # one that had to be shortened finds its length again by and by
        whole = time >= options.step or time == left
        run.step = options.step if whole else min(options.step, GROW * time)
    before, energy = run.state, run.log[-1][1]
    run.time = target if time == left else run.time + time
    run.count += 1
    run.state = made.state
    _space_markers(run, energy)
    if run.state.network is not before.network:
        # markers have come or gone: what shrinks shows in the next step
        before = run.state
    if options.t1:
        try:
            _change_topology(run, before)
        except TopologyError as fault:
            run.fault = MET.format(time=run.time, fault=fault)
    run.log.append((run.time, run.stepper.energy(run.state), made.error, made.dissipation))
    if not options.hold_volumes:
        shares = run.stepper.volumes(run.state) / run.stepper.system.mean_volume
        if shares.min() < NOTHING:
            name = run.stepper.foam.bubble_ids[int(np.argmin(shares))]
            run.fault = VANISHED.format(name=name, time=run.time)


def _lost(run: _Run, state: State) -> bool:
    """Whether a short film has lost too much of its length to be followed."""
    was, now = chords(run.stepper.foam.cell, run.state), chords(run.stepper.foam.cell, state)
    short = now < cutoffs(_scene(run), state)
    return bool((short & (now < (1.0 - LOSS) * was)).any())


def _scene(run: _Run) -> Scene:
    foam, system = run.stepper.foam, run.stepper.system
    return Scene(foam, system.length, system.shares, run.options.cutoff)


def _space_markers(run: _Run, energy: float) -> None:
    """Markers back to the middle between their neighbours, unless the energy would rise by that."""
    cell, fresh = run.stepper.foam.cell, run.state
    for _ in range(SPACINGS):
        moved = spaced(cell, fresh)
        if moved is None:
            break
        fresh = moved
    if run.options.t1:
        fresh = marked(_scene(run), fresh)
    if fresh is run.state:
        return
    try:
        fresh = run.stepper.on_volumes(fresh)
    except StepFailed:
        return
    if run.stepper.energy(fresh) <= energy:
        run.state = fresh


def _change_topology(run: _Run, before: State) -> None:
    """Try every change of topology; each that lowers the energy is kept."""
    for _ in range(MOST_CHANGES):
        if not _changed(run, before):
            return
        before = run.state


def _changed(run: _Run, before: State) -> bool:
    stepper, energy = run.stepper, run.stepper.energy(run.state)
    for kind in CHANGES:
        for offer in kind(_scene(run), before, run.state):
            moved, start = stepper, offer.state
            if offer.foam is not None:
                moved = stepper.of(offer.foam)
                start = replace(start, pressures=stepper.scale / moved.scale * start.pressures)
            try:
                state = moved.on_volumes(start)
            except StepFailed:
                continue
            after = moved.energy(state)
            if not after < energy:
                continue
            run.stepper = moved
            run.events.append(
                DriftEvent(
                    run.time,
                    run.count,
                    offer.kind,
                    offer.losers,
                    offer.gainers,
                    offer.position,
                    energy,
                    after,
                )
            )
            run.state = state
            # what is new moves fast
            run.step = min(run.step, FIRST * moved.time_scale)
            return True
    return False
