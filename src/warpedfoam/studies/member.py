"""One member of an ensemble: built, relaxed and measured, on whatever worker it lands."""

from __future__ import annotations

import hashlib
import json
import platform
import tempfile
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.io import save, versions
from warpedfoam.relax import relax
from warpedfoam.relax.result import Relaxation
from warpedfoam.studies.observables import Measured, Observable, Value, look_in
from warpedfoam.studies.study import plates_of
from warpedfoam.tessellate import voronoi_foam

#: What a member may end as; a lost one's worker died, and it is tried again when the study is.
STATES = ("converged", "not_converged", "failed", "lost")

#: What says nothing about a foam: it might succeed elsewhere, or later.
MACHINE_FAULTS = (MemoryError, OSError)

# a worker with several threads still computes one foam at a time: threads would share BLAS and caches
_ALONE = threading.Lock()


@dataclass(frozen=True)
class Task:
    """What a worker is told: plain values only.

    Attributes
    ----------
    key, seed, values
        As in `warpedfoam.studies.study.Run`.
    measures : tuple of Observable
    states : bool
        Send the foam back too.
    folder : str
        Where modules of the user's are looked for.
    """

    key: str
    seed: int
    values: Mapping[str, Any]
    measures: tuple[Observable, ...]
    states: bool
    folder: str


@dataclass(frozen=True)
class Outcome:
    """What a worker sends back.

    Attributes
    ----------
    key : str
    status, reason : str
        One of `STATES`, and why; empty if converged.
    values : mapping
        Observables by column.
    state : bytes or None
        The foam as `warpedfoam.save` writes it.
    seconds : float
        Processor time.
    environment : mapping
        Versions and processor, which decide the last digits.
    """

    key: str
    status: str
    reason: str
    values: Mapping[str, Value]
    state: bytes | None
    seconds: float
    environment: Mapping[str, Any]


def compute(task: Task) -> Outcome:
    """Build, relax and measure one foam with one BLAS thread; what goes wrong is told, not raised.

    Raises
    ------
    MemoryError, OSError
        Too little memory, a full disk, a file that this machine does not see: the machine's fault, not
        the foam's.
    """
    from threadpoolctl import threadpool_limits

    with _ALONE, threadpool_limits(limits=1):
        clock = time.thread_time()
        status, reason, values, state = _computed(task)
        return Outcome(task.key, status, reason, values, state, time.thread_time() - clock, environment())


def _computed(task: Task) -> tuple[str, str, dict[str, Value], bytes | None]:
    try:
        relaxed, energy_start = relaxed_foam(task.values, task.seed)
    except MACHINE_FAULTS:
        raise
    except Exception as fault:
        return "failed", _told(fault), {}, None
    status = "converged" if relaxed.converged else "not_converged"
    reasons = [] if relaxed.converged else [relaxed.message]
    values: dict[str, Value] = {}
    look_in(task.folder)
    measured = Measured(relaxed, energy_start)
    for measure in task.measures:
        try:
            # a quotient without sense is refused by its value, not by a warning
            with np.errstate(all="ignore"):
                values |= measure.evaluate(measured)
        except MACHINE_FAULTS:
            raise
        except Exception as fault:
            status = "failed"
            reasons.append(f"observable {measure.name}: {_told(fault)}")
    return status, "; ".join(reasons), values, _bytes(relaxed) if task.states else None


def relaxed_foam(values: Mapping[str, Any], seed: int) -> tuple[Relaxation, float]:
    """The relaxed foam of these options and this seed, and its energy before.

    Raises
    ------
    ValueError, TypeError, ConvergenceError
        Whatever `warpedfoam.voronoi_foam` and `warpedfoam.relax` refuse.
    """
    chosen, relaxing = values["foam"], values["relax"]
    start = voronoi_foam(
        plates_of(values),
        chosen["n_bubbles"],
        seeds=chosen["seeds"] if isinstance(chosen["seeds"], str) else np.asarray(chosen["seeds"]),
        seed=seed,
        cells=chosen["cells"],
        lloyd=chosen["lloyd"],
        volumes=np.asarray(chosen["volumes"]) if isinstance(chosen["volumes"], list) else chosen["volumes"],
        n_nodes=chosen["n_nodes"],
        order=relaxing["order"],
    )
    return relax(start, **relaxing), start.energy


def lost(task: Task, fault: BaseException | str) -> Outcome:
    """The outcome of a task that no worker could finish."""
    reason = fault if isinstance(fault, str) else _told(fault)
    return Outcome(task.key, "lost", reason, {}, None, 0.0, {})


def environment() -> dict[str, Any]:
    """Versions, and the processor as BLAS sees it."""
    from threadpoolctl import threadpool_info

    found = {str(pool.get("architecture", "")) for pool in threadpool_info()} - {""}
    return {"versions": versions(), "machine": platform.machine(), "blas": sorted(found)}


def environment_name(content: Mapping[str, Any]) -> str:
    """A short name that stands for an environment."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode("utf-8")).hexdigest()[:12]


def _told(fault: BaseException) -> str:
    return f"{type(fault).__name__}: {' '.join(str(fault).split())}"


def _bytes(relaxed: Relaxation) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return save(Path(folder) / "foam.npz", relaxed.foam).read_bytes()
