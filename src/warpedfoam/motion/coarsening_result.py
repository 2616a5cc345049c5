"""What a coarsening returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from warpedfoam.arrays import Floats, Ints
from warpedfoam.foam import Foam


@dataclass(frozen=True)
class CoarseningEvent:
    """A change of topology on the way.

    Attributes
    ----------
    time : float
    step : int
        Steps in time before it.
    kind : str
        ``"t1"`` (at walls too), ``"t2"``, ``"join"`` or ``"part"``.
    losers, gainers : tuple of int
        Ids of the bubbles that lost a side and of those that gained one; of a T2 the bubble that vanished,
        and nobody.
    position : tuple of three float
    """

    time: float
    step: int
    kind: str
    losers: tuple[int, ...]
    gainers: tuple[int, ...]
    position: tuple[float, float, float]

    @classmethod
    def from_record(cls, entry: dict[str, Any]) -> CoarseningEvent:
        """From the plain values that a trajectory keeps."""
        x, y, z = entry["position"]
        lists = {name: tuple(entry[name]) for name in ("losers", "gainers")}
        return cls(**{**entry, **lists, "position": (x, y, z)})


@dataclass(frozen=True, eq=False)
class Coarsening:
    """A foam whose gas moves.

    Attributes
    ----------
    foams : tuple of Foam
        The frames, relaxed; the first is the start.
    times : (n,) array
        Of the frames.
    events : tuple of CoarseningEvent
        Every change of topology, in order.
    step_times, step_energies, step_bubbles, step_mu2 : (m,) arrays
        Time, energy, number of bubbles (without an exterior) and variance of their sides after each step, the
        start included.
    step_errors : (m,) array
        Estimated error of each step, in mean volumes.
    step_mean_areas : (m,) array
        Area of the inner plate per bubble after each step, without an exterior.
    n_rejected : int
        Steps that were tried and taken back.
    completed : bool
        Whether the duration was covered, or as few bubbles are left as were asked for.
    message : str
        Why it ended.
    """

    foams: tuple[Foam, ...]
    times: Floats
    events: tuple[CoarseningEvent, ...]
    step_times: Floats
    step_energies: Floats
    step_bubbles: Ints
    step_mu2: Floats
    step_errors: Floats
    step_mean_areas: Floats
    n_rejected: int
    completed: bool
    message: str

    @property
    def foam(self) -> Foam:
        """The last frame."""
        return self.foams[-1]

    @property
    def n_steps(self) -> int:
        """Steps made."""
        return len(self.step_times) - 1

    def n_events(self, kind: str) -> int:
        """How many events there were of a kind."""
        return sum(event.kind == kind for event in self.events)

    @property
    def n_t1(self) -> int:
        """How many films have turned."""
        return self.n_events("t1")

    @property
    def n_t2(self) -> int:
        """How many bubbles have vanished."""
        return self.n_events("t2")
