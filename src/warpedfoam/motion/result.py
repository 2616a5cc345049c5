"""What a drift returns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from warpedfoam.arrays import Floats, frozen
from warpedfoam.foam import Foam


@dataclass(frozen=True)
class DriftEvent:
    """A change of topology on the way.

    Attributes
    ----------
    time : float
    step : int
        Steps in time before it.
    kind : str
        ``"t1"``, ``"wall t1"``, ``"join"`` or ``"part"``.
    losers, gainers : tuple of int
        Ids of the bubbles that lost a side and of those that gained one (see `T1Event`).
    position : tuple of three float
    energy_before, energy_after : float
        Of the whole foam.
    """

    time: float
    step: int
    kind: str
    losers: tuple[int, ...]
    gainers: tuple[int, ...]
    position: tuple[float, float, float]
    energy_before: float
    energy_after: float

    @classmethod
    def from_record(cls, entry: dict[str, Any]) -> DriftEvent:
        """From the plain values that a trajectory keeps."""
        x, y, z = entry["position"]
        lists = {name: tuple(entry[name]) for name in ("losers", "gainers")}
        return cls(**{**entry, **lists, "position": (x, y, z)})


@dataclass(frozen=True, eq=False)
class Drift:
    """A foam in motion.

    Attributes
    ----------
    foams : tuple of Foam
        The frames, with their pressures; the first is the start, brought to its volumes.
    times : (n,) array
        Of the frames.
    events : tuple of DriftEvent
        Every change of topology, in order.
    step_times, step_energies : (m,) arrays
        Time and energy after each step, the start included. Energies never rise, round-off aside.
    step_errors : (m,) array
        Estimated error of each step, in bubble sizes: the change by halving it; 0 for Euler steps.
    step_dissipation : (m,) array
        λ ∫ v² dA over each step, energy per time; 0 for the start.
    n_rejected : int
        Steps that were tried and taken back.
    completed : bool
        Whether the whole duration was covered.
    message : str
        Why it ended.
    """

    foams: tuple[Foam, ...]
    times: Floats
    events: tuple[DriftEvent, ...]
    step_times: Floats
    step_energies: Floats
    step_errors: Floats
    step_dissipation: Floats
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

    @property
    def n_t1(self) -> int:
        """How many films have turned, walls' films among them."""
        return sum(event.kind.endswith("t1") for event in self.events)

    @property
    def n_contacts(self) -> int:
        """How often clusters have met or parted."""
        return len(self.events) - self.n_t1

    @cached_property
    def energies(self) -> Floats:
        """γ Σ film areas of each frame, (n,)."""
        return frozen(np.array([foam.energy for foam in self.foams]))

    @cached_property
    def volume_errors(self) -> Floats:
        """Largest |V − V*| / V* of each frame, the exterior left out, (n,)."""
        return frozen(np.array([_volume_error(foam) for foam in self.foams]))

    @cached_property
    def centres(self) -> Floats:
        """Centre of each bubble in each frame, (n, n_bubbles, 3); see `Foam.bubble_centres`.

        NaN for a bubble that was not there yet: the last ones, which contacts have enclosed.
        """
        out = np.full((len(self.foams), max(foam.n_bubbles for foam in self.foams), 3), np.nan)
        for k, foam in enumerate(self.foams):
            out[k, : foam.n_bubbles] = foam.bubble_centres
        return frozen(out)


def _volume_error(foam: Foam) -> float:
    off = np.abs(foam.bubble_volumes / foam.target_volumes - 1.0)
    if foam.exterior is not None:
        off = np.delete(off, foam.exterior)
    return float(off.max())
