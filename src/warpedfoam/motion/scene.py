"""What changes of topology see and offer."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from warpedfoam.arrays import Floats, Ints
from warpedfoam.cell import HeleShawCell
from warpedfoam.foam import Foam
from warpedfoam.relax.system import State


@dataclass(frozen=True, eq=False)
class Scene:
    """What stays during a run: the foam's cell and names, ℓ, volumes over their mean, the cutoff."""

    foam: Foam
    length: float
    shares: Floats
    cutoff: float

    @property
    def cell(self) -> HeleShawCell:
        """Where the foam is."""
        return self.foam.cell

    @property
    def tension(self) -> float:
        """γ."""
        return self.foam.tension

    @property
    def bubble_ids(self) -> Ints:
        """Names of the bubbles."""
        return self.foam.bubble_ids


@dataclass(frozen=True, eq=False)
class Candidate:
    """A state of another topology, its volumes not yet right; who loses and gains a side, and where.

    ``foam`` is given if there are other bubbles than before, with their names and volumes.
    """

    kind: str
    state: State
    losers: tuple[int, ...]
    gainers: tuple[int, ...]
    position: tuple[float, float, float]
    foam: Foam | None = None


#: Offers candidates from the states before and after a step, both of one network.
TopologyChange = Callable[[Scene, State, State], Iterable[Candidate]]
