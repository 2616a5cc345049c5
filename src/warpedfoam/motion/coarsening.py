"""`coarsen`: gas passes from bubble to bubble, small ones vanish, the foam stays relaxed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.arrays import Floats, as_flag, as_instance, as_integer, as_number, frozen
from warpedfoam.errors import TopologyError
from warpedfoam.foam import Foam
from warpedfoam.io.atomic import PathLike, writable_path
from warpedfoam.io.trajectory import SUFFIXES, Trajectory, TrajectoryWriter
from warpedfoam.motion.coarsening_result import Coarsening, CoarseningEvent
from warpedfoam.motion.frames import new_trajectory
from warpedfoam.motion.gas import gas_flow
from warpedfoam.moves.t2 import t2
from warpedfoam.relax import Relaxation, relax

#: First step, and one that is no step, in units of mean area / κγ; frames in units of that, too.
FIRST, LEAST, FRAME = 1e-3, 1e-9, 0.2
#: How steps shrink and grow: safety, least and greatest factor, and the factor after a failure.
SAFETY, SHRINK, GROW, FAILED = 0.9, 0.2, 1.5, 0.5
#: Bubbles are followed down to half of the volume at which they vanish.
BELOW = 0.5
#: Flow, in mean volumes per mean area / κγ, that is none: a foam in balance would never have fewer bubbles.
STILL = 1e-9
#: Steps of a relaxation; after a T2 it has farther to go.
STEPS, STEPS_AFTER = 200, 1000

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class _Options:
    permeability: float
    every: float
    tolerance: float
    step: float | None
    vanish: float
    order: int


@dataclass(eq=False)
class _Run:
    """The moving parts of a coarsening."""

    options: _Options
    unit: float
    foam: Foam
    rate: Floats
    time: float = 0.0
    step: float = 0.0
    count: int = 0
    rejected: int = 0
    past: tuple[float, Floats] | None = None
    foams: list[Foam] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    log: list[tuple[float, float, int, float, float, float]] = field(default_factory=list)
    events: list[CoarseningEvent] = field(default_factory=list)
    noted: tuple[int, int] = (0, 0)
    fault: str = ""

    @property
    def held(self) -> Floats:
        """Volumes of all bubbles but an exterior."""
        return _held(self.foam, self.foam.target_volumes)


def coarsen(
    foam: Foam,
    *,
    permeability: float = 1.0,
    duration: float | None = None,
    until: int | None = None,
    every: float | None = None,
    tolerance: float = 0.01,
    step: float | None = None,
    vanish: float = 0.003,
    order: int | None = None,
    trajectory: PathLike | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Coarsening:
    """Let a foam coarsen: gas passes through films from high pressure to low, and bubbles vanish.

    Films find their shape much faster than gas moves: the foam is relaxed at all times, T1s on the way, and
    volumes follow `gas_flow`, dV_i/dt = −κ Σ (p_i − p_j) A_ij. A bubble below ``vanish`` mean volumes goes
    (T2): its films meet, its gas is its neighbours'.

    An open cluster loses gas to its exterior, or takes all of it: the run ends where ``vanish`` of the one or
    the other is left.

    Volumes are stepped by Adams and Bashforth's second-order formula (Euler's after a change of topology),
    and the difference from the trapezoidal rule sets the step. Since rates hardly change but when films turn
    (by von Neumann's law not at all on flat plates), it is T1s within a step that make the error: it is of
    second order in the step between T1s, of first order in their times.

    Parameters
    ----------
    foam : Foam
        Relaxed first; what is smaller than ``vanish`` goes before the first frame.
    permeability : float, optional
        κ, volume per time, film area and pressure.
    duration : float, optional
        Time to cover. Mean area / κγ is the time in which bubbles come and go.
    until : int, optional
        End when no more bubbles than this are left, an exterior not counted. Give this, a duration, or both.
        Without a duration a foam in balance, where no gas flows, ends the run too.
    every : float, optional
        Time between frames; by default a fiftieth of the duration, or a fifth of the first mean area / κγ.
    tolerance : float, optional
        Largest error of a step in any bubble, in mean volumes, 1e-6 … 0.1.
    step : float, optional
        A fixed time step in place of adaptive ones (shorter only where it must be).
    vanish : float, optional
        Bubbles smaller than this many mean volumes vanish, 1e-4 … 0.05.
    order : int, optional
        p of the films; the foam's own by default.
    trajectory : str or path, optional
        HDF5 file (``.h5``) that takes each frame when it is reached; needs h5py.
    resume : bool, optional
        Go on with the frames in ``trajectory``, if there are any: the same foam and options are needed, but
        for duration and until; ``every`` is the file's if it is left out. A run that was killed and resumed
        makes the same frames bit for bit.
    progress : callable, optional
        Called as ``progress("coarsen", fraction)`` after each step.

    Returns
    -------
    Coarsening
        Look at ``.completed``: a run that had to stop early says why in ``.message``.

    Raises
    ------
    TypeError, ValueError
        If an argument is of the wrong type or out of range, the start does not relax, or ``trajectory``
        holds another run.
    FileExistsError
        If ``trajectory`` is there and ``resume`` is False.
    ImportError
        If ``trajectory`` is given and h5py is not installed.

    Examples
    --------
    A bubble alone on a sphere gives its gas away: dA/dt = κγ (A − 2π), in a thin gap.

    >>> import numpy as np
    >>> from warpedfoam import HeleShawCell, Sphere, cluster_foam
    >>> foam = cluster_foam(HeleShawCell(Sphere(1.0), gap=1e-3), 1, volumes=1e-3)
    >>> run = coarsen(foam, duration=0.1, every=0.1)
    >>> exact = 2.0 * np.pi - (2.0 * np.pi - run.foams[0].bubble_areas[0]) * np.exp(0.1)
    >>> bool(abs(run.foam.bubble_areas[0] / exact - 1.0) < 2e-3)
    True
    """
    as_instance(foam, "foam", Foam)
    kappa = as_number(permeability, "permeability", positive=True)
    if duration is None and until is None:
        raise ValueError("give duration, until, or both: nothing else ends a coarsening")
    span = None if duration is None else as_number(duration, "duration", positive=True)
    few = 0 if until is None else as_integer(until, "until", minimum=1)
    unit = _held(foam, foam.target_volumes).mean() / foam.cell.volume * foam.cell.surface.area
    unit /= kappa * foam.tension
    default = FRAME * unit if span is None else span / 50.0
    options = _Options(
        kappa,
        default if every is None else as_number(every, "every", positive=True),
        as_number(tolerance, "tolerance", minimum=1e-6, maximum=0.1),
        None if step is None else as_number(step, "step", positive=True),
        as_number(vanish, "vanish", minimum=1e-4, maximum=0.05),
        as_integer(foam.order if order is None else order, "order", minimum=2),
    )
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    going_on = as_flag(resume, "resume")
    if going_on and trajectory is None:
        raise ValueError("resume needs trajectory, the file to go on with")
    path = None if trajectory is None else writable_path(trajectory, suffixes=SUFFIXES)
    run = _begun(foam, options, unit)
    report = progress or (lambda _stage, _fraction: None)
    if path is None:
        return _coarsened(run, span, few, None, report)
    if going_on and path.exists():
        _recall(run, path, usual=every is None)
    else:
        new_trajectory(path, lambda writer: _write_frame(run, writer, {"options": asdict(options)}))
    with TrajectoryWriter(path, append=True) as writer:
        return _coarsened(run, span, few, writer, report)


def _held(foam: Foam, values: Floats) -> Floats:
    return values if foam.exterior is None else np.delete(values, foam.exterior)


def _begun(foam: Foam, options: _Options, unit: float) -> _Run:
    found = relax(foam, order=options.order, solver="superlu")
    if not found.converged:
        raise ValueError(f"foam does not relax, so that its pressures are unknown: {found.message}")
    start = found.foam
    run = _Run(options, unit, start, gas_flow(start, permeability=options.permeability))
    run.step = options.step or FIRST * unit
    _let_vanish(run)
    _log(run, 0.0)
    _keep_frame(run)
    return run


def _log(run: _Run, error: float) -> None:
    sides = _held(run.foam, run.foam.network.sides.astype(np.float64))
    surface = run.foam.cell.surface
    area = surface.area / len(sides)
    if run.foam.exterior is not None:
        area = float(_held(run.foam, run.foam.bubble_areas).mean())
    run.log.append((run.time, run.foam.energy, len(sides), float(sides.var()), error, area))


def _keep_frame(run: _Run) -> None:
    """Keep a frame, and forget what is not in it."""
    run.foams.append(run.foam)
    run.times.append(run.time)
    run.past = None


def _write_frame(run: _Run, writer: TrajectoryWriter, more: dict[str, Any]) -> None:
    log, events = run.noted
    notes: dict[str, Any] = {
        **more,
        "step": run.step,
        "count": run.count,
        "rejected": run.rejected,
        "log": run.log[log:],
        "events": [asdict(event) for event in run.events[events:]],
    }
    run.noted = (len(run.log), len(run.events))
    writer.append(run.foams[-1], time=run.times[-1], notes={"coarsening": notes})


def _recall(run: _Run, path: Path, *, usual: bool) -> None:
    """Take up the run in a trajectory, if it is this one; as ``usual`` with its time between frames."""
    with Trajectory(path) as frames:
        notes = [frames.notes(k).get("coarsening") for k in range(len(frames))]
        if not notes or not all(isinstance(note, dict) for note in notes):
            raise ValueError(f"{path} holds no coarsening; use another file")
        foams, times = list(frames), frames.times.tolist()
    kept = [dict(note) for note in notes if note is not None]
    theirs = kept[0]["options"]
    if usual:
        run.options = replace(run.options, every=theirs["every"])
    mine = asdict(run.options)
    other = [name for name in mine if mine[name] != theirs.get(name)]
    if other:
        raise ValueError(f"{path} holds a coarsening with another {', '.join(other)}; use another file")
    same = all(
        np.array_equal(getattr(run.foam, name), getattr(foams[0], name))
        for name in ("vertex_points", "film_offsets", "target_volumes", "bubble_ids", "tension")
    )
    if not same or foams[0].cell != run.foam.cell:
        raise ValueError(f"{path} holds the coarsening of another foam; use another file")
    run.foams, run.times, run.log, run.events = foams, times, [], []
    for note in kept:
        run.log += [(row[0], row[1], row[2], row[3], row[4], row[5]) for row in note["log"]]
        run.events += [CoarseningEvent.from_record(entry) for entry in note["events"]]
    last = kept[-1]
    run.foam, run.time, run.step = foams[-1], times[-1], last["step"]
    run.rate = gas_flow(run.foam, permeability=run.options.permeability)
    run.count, run.rejected = last["count"], last["rejected"]
    run.noted = (len(run.log), len(run.events))


def _coarsened(
    run: _Run, duration: float | None, until: int, writer: TrajectoryWriter | None, report: Progress
) -> Coarsening:
    end = np.inf if duration is None else duration
    first = run.log[0][2]
    while run.time < end and len(run.held) > until and not run.fault:
        if end == np.inf and np.abs(run.rate).max() * run.unit < STILL * run.held.mean():
            run.fault = f"stopped: no gas flows at time {run.time:.6g}, the foam is in balance"
            break
        # frames are counted, not added up
        number = int(np.floor(run.time / run.options.every * (1.0 + 1e-12))) + 1
        target = min(number * run.options.every, end)
        while run.time < target and len(run.held) > until and not run.fault:
            _step(run, target)
            shares = (run.time / end, (first - len(run.held)) / max(first - until, 1) if until else 0.0)
            report("coarsen", min(max(shares), 1.0))
        if run.time > run.times[-1]:
            _keep_frame(run)
            if writer is not None:
                _write_frame(run, writer, {})
    report("coarsen", 1.0)
    columns = list(zip(*run.log, strict=True))
    gone = sum(event.kind == "t2" for event in run.events)
    ended = (
        f"coarsened for {run.time:g} in {run.count} steps: {gone} bubbles have vanished, {len(run.held)} are "
        "left"
    )
    return Coarsening(
        foams=tuple(run.foams),
        times=frozen(np.array(run.times)),
        events=tuple(run.events),
        step_times=frozen(np.array(columns[0], dtype=np.float64)),
        step_energies=frozen(np.array(columns[1], dtype=np.float64)),
        step_bubbles=frozen(np.array(columns[2], dtype=np.int64)),
        step_mu2=frozen(np.array(columns[3], dtype=np.float64)),
        step_errors=frozen(np.array(columns[4], dtype=np.float64)),
        step_mean_areas=frozen(np.array(columns[5], dtype=np.float64)),
        n_rejected=run.rejected,
        completed=not run.fault,
        message=run.fault or ended,
    )


def _step(run: _Run, target: float) -> None:
    """One step that is kept, at most to ``target``; shorter and shorter ones are tried."""
    options, foam = run.options, run.foam
    mean = float(run.held.mean())
    # a foam in balance has no flow to measure time by
    least = LEAST * min(mean / max(float(np.abs(run.rate).max()), 1e-300), run.unit)
    small = BELOW * options.vanish * mean
    shrinking = run.rate < 0.0
    room = float(((foam.target_volumes - small)[shrinking] / -run.rate[shrinking]).min(initial=np.inf))
    lost = -float(_held(foam, run.rate).sum())
    if foam.exterior is not None and lost > 0.0:
        # a cluster shrinks as a whole, by half at most: its films have as far to go
        room = min(room, 0.5 * float(run.held.sum()) / lost)
    left, fault, rejected = target - run.time, "", run.rejected
    wanted = run.step if options.step is None else options.step
    while True:
        time = min(wanted, room, left)
        if left - time < least and run.rejected == rejected:
            # what would be left is no step, nor is it a failure if the whole way is none
            time = left
        elif time < least:
            run.fault = f"stopped: steps became too short at time {run.time:.6g} ({fault or 'tolerance'})"
            return
        speed = run.rate
        if run.past is not None:
            speed = speed + 0.5 * time / run.past[0] * (run.rate - run.past[1])
        targets = foam.target_volumes + time * speed
        if not targets.min() > 0.5 * small:
            wanted, fault = FAILED * time, "a bubble vanishes too fast"
            run.rejected += 1
            continue
        found = _relaxed(foam, targets, STEPS)
        if not found.converged:
            wanted, fault = FAILED * time, found.message
            run.rejected += 1
            continue
        rate = gas_flow(found.foam, permeability=options.permeability)
        error = 0.0
        if len(rate) == len(run.rate):
            off = _held(foam, np.abs(0.5 * (run.rate + rate) - speed))
            error = time * float(off.max()) / mean
        if options.step is None and error > options.tolerance:
            wanted, fault = time * max(SHRINK, SAFETY * np.sqrt(options.tolerance / error)), ""
            run.rejected += 1
            continue
        break
    if options.step is None:
        # one that was cut short at a frame or a vanishing bubble says little about the next
        grown = time * min(GROW, SAFETY * np.sqrt(options.tolerance / max(error, 1e-12)))
        run.step = max(grown, wanted) if time < wanted else grown
    run.time = target if time == left else run.time + time
    run.count += 1
    turned = _booked(run, found)
    run.past = None if turned or len(rate) != len(run.rate) else (time, run.rate)
    run.foam, run.rate = found.foam, rate
    _let_vanish(run)
    _log(run, error)


def _relaxed(foam: Foam, targets: Floats, steps: int) -> Relaxation:
    scaled = targets * (foam.cell.volume / targets.sum())
    return relax(replace(foam, target_volumes=scaled), max_iterations=steps, solver="superlu")


def _booked(run: _Run, found: Relaxation) -> bool:
    """Put a relaxation's events into the list; whether there were any."""
    for event in found.events:
        run.events.append(
            CoarseningEvent(run.time, run.count, "t1", event.losers, event.gainers, event.position)
        )
    for contact in found.contacts:
        ids = contact.bubbles
        lost, won = (ids, ()) if contact.kind == "part" else ((), ids)
        run.events.append(CoarseningEvent(run.time, run.count, contact.kind, lost, won, contact.position))
    return bool(found.events or found.contacts)


def _let_vanish(run: _Run) -> None:
    """T2s on all bubbles that are too small, smallest first; all of them are kept or none."""
    foam, gone = run.foam, list[CoarseningEvent]()
    start = run.foams[0] if run.foams else foam
    if run.held.sum() < run.options.vanish * _held(start, start.target_volumes).sum():
        # mean volumes shrink with a cluster: none of its bubbles need ever be small beside them
        run.fault = f"stopped: the cluster has given away its gas at time {run.time:.6g}"
        return
    while True:
        held = foam.target_volumes.copy()
        mean = float(_held(foam, held).mean())
        if foam.exterior is not None:
            held[foam.exterior] = np.inf
        bubble = int(held.argmin())
        if held[bubble] >= run.options.vanish * mean:
            break
        if foam.n_bubbles == 2:
            run.fault = f"stopped: the last bubble but one is about to vanish at time {run.time:.6g}"
            return
        x, y, z = foam.bubble_centres[bubble].tolist()
        name = int(foam.bubble_ids[bubble])
        try:
            foam = t2(foam, bubble)
        except TopologyError as fault:
            run.fault = f"stopped: bubble {name} is about to vanish at time {run.time:.6g}, but {fault}"
            return
        gone.append(CoarseningEvent(run.time, run.count, "t2", (name,), (), (x, y, z)))
    if foam.exterior is not None and foam.target_volumes[foam.exterior] < run.options.vanish * mean:
        run.fault = f"stopped: the cluster has left no room for its exterior at time {run.time:.6g}"
        return
    if foam is run.foam:
        return
    found = _relaxed(foam, foam.target_volumes, STEPS_AFTER)
    if not found.converged:
        run.fault = f"stopped: the foam did not relax after a T2 at time {run.time:.6g}: {found.message}"
        return
    run.events += gone
    _booked(run, found)
    run.past = None
    run.foam = found.foam
    run.rate = gas_flow(run.foam, permeability=run.options.permeability)
