"""What a relaxation returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from warpedfoam.arrays import Bools, Floats, Ints, frozen
from warpedfoam.foam import Foam
from warpedfoam.moves.join import ContactEvent
from warpedfoam.moves.t1 import T1Event


@dataclass(frozen=True, eq=False)
class RelaxationHistory:
    """The states that a relaxation went through, the start first; arrays (n_states,).

    Of a foam with bulging films it is the history of the ruled foam that they start from.

    Attributes
    ----------
    iteration : (n_states,) integer array
        Steps tried before the state; where one was taken back, the state before it stands again.
    energy : (n_states,) array
        γ Σ film areas. It may rise: volumes are being corrected.
    residual, volume_error : (n_states,) array
        As in `Relaxation`; volumes are rough on some surfaces as long as ``exact`` is False.
    n_t1 : (n_states,) integer array
        T1s made before the state.
    exact : (n_states,) array of bool
        Whether the step from the state is Newton's, on the KKT system.
    """

    iteration: Ints
    energy: Floats
    residual: Floats
    volume_error: Floats
    n_t1: Ints
    exact: Bools

    @classmethod
    def of_rows(cls, rows: list[tuple[int, float, float, float, int, bool]]) -> RelaxationHistory:
        """From a row for each state, in the order of the attributes."""
        kinds = (np.int64, np.float64, np.float64, np.float64, np.int64, np.bool_)
        columns = zip(*rows, strict=True) if rows else [()] * len(kinds)
        return cls(*(frozen(np.array(c, dtype=kind)) for c, kind in zip(columns, kinds, strict=True)))


@dataclass(frozen=True, eq=False)
class Relaxation:
    """A relaxed foam and how it was reached.

    Attributes
    ----------
    foam : Foam
        The last state, with its pressures; at equilibrium only if ``converged``.
    energy : float
        γ Σ film areas.
    pressures : (n_bubbles,) array
        Multipliers of the volumes, mean zero (only differences matter on a closed surface); an exterior
        has pressure 0.
    residual : float
        Largest projected force on a vertex or film node, in units of γ d.
    volume_error : float
        Largest |V − V*| / V*.
    converged : bool
        Both below their tolerances, and the Hessian has the inertia of a minimum.
    is_minimum : bool
        Whether the Newton matrix at the last state has the inertia of a minimum; False too where a
        fault ended the run before it was looked at.
    iterations : int
        Newton steps taken.
    events : tuple of T1Event
        Every T1 made, in order.
    history : RelaxationHistory
        Energy, residual, volume error and T1s step by step.
    timings : mapping of str to float
        Seconds by kind of work: ``"assemble"``, ``"solve"``, ``"pattern"``, ``"t1"``, ``"total"``.
    message : str
        Why it ended.
    contacts : tuple of ContactEvent
        Every contact of open clusters made or lost, in order.
    """

    foam: Foam
    energy: float
    pressures: Floats
    residual: float
    volume_error: float
    converged: bool
    is_minimum: bool
    iterations: int
    events: tuple[T1Event, ...]
    history: RelaxationHistory
    timings: Mapping[str, float]
    message: str
    contacts: tuple[ContactEvent, ...] = field(default=(), kw_only=True)

    @property
    def n_t1(self) -> int:
        """Number of T1s made."""
        return len(self.events)
