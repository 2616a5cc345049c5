"""Options of a drift, checked once; they are kept with its trajectory."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from warpedfoam.arrays import as_choice, as_flag, as_integer, as_number
from warpedfoam.foam import MAX_ORDER, Foam

METHODS = ("extrapolated", "euler")
#: Frames of a run whose ``every`` is left out.
FRAMES = 50


@dataclass(frozen=True)
class DriftOptions:
    """Checked arguments of `warpedfoam.drift`; ``every`` and ``order`` are never None."""

    friction: float
    yield_friction: float
    hold_volumes: bool
    every: float
    tolerance: float
    step: float | None
    method: str
    order: int
    t1: bool
    cutoff: float

    @classmethod
    def checked(cls, foam: Foam, duration: float, values: dict[str, Any]) -> DriftOptions:
        """Options from the arguments of `drift`.

        Raises
        ------
        TypeError, ValueError
            If one is of the wrong type or out of range.
        """
        every, step, order = values["every"], values["step"], values["order"]
        return cls(
            friction=as_number(values["friction"], "friction", positive=True),
            yield_friction=as_number(values["yield_friction"], "yield_friction", minimum=0.0),
            hold_volumes=as_flag(values["hold_volumes"], "hold_volumes"),
            every=duration / FRAMES if every is None else as_number(every, "every", positive=True),
            tolerance=as_number(values["tolerance"], "tolerance", minimum=1e-8, maximum=0.1),
            step=None if step is None else as_number(step, "step", positive=True),
            method=as_choice(values["method"], "method", METHODS),
            order=as_integer(foam.order if order is None else order, "order", minimum=2, maximum=MAX_ORDER),
            t1=as_flag(values["t1"], "t1"),
            cutoff=as_number(values["cutoff"], "cutoff", minimum=1e-4, maximum=0.2),
        )

    def told(self) -> dict[str, Any]:
        """The options for JSON."""
        return asdict(self)
