"""Gaps that vary: a positive function of points in space with two derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from warpedfoam.arrays import Bools, Floats, as_floats, as_number
from warpedfoam.kernels.differences import differences
from warpedfoam.kernels.gap_films import Thickness

Function = Callable[[Floats], Floats]


@runtime_checkable
class GapField(Protocol):
    """A gap d(x) that knows its derivatives in space; points are (n, 3).

    Only values on the inner plate matter, and derivatives along it. What lies off the plate is up to the
    field, but `gradient` and `hessian` must be those of one and the same function in space.
    """

    def __call__(self, points: Floats, /) -> Floats:
        """The gap, (n,), above 0."""
        ...

    def gradient(self, points: Floats, /) -> Floats:
        """∇d, (n, 3)."""
        ...

    def hessian(self, points: Floats, /) -> Floats:
        """∇²d, (n, 3, 3), symmetric."""
        ...


@dataclass(frozen=True)
class FunctionGap:
    """A gap from a plain function, with derivatives by central differences of sixth order.

    `HeleShawCell` makes one of every plain function and chooses the step.

    Parameters
    ----------
    function : callable
        d at points (n, 3), returning (n,); smooth, and defined within three steps of the inner plate.
    step : float
        Of the differences.

    Examples
    --------
    >>> import numpy as np
    >>> wave = FunctionGap(lambda x: 0.5 + 0.1 * np.sin(x[:, 0]), step=0.02)
    >>> bool(abs(wave.gradient(np.array([[0.4, 0.0, 0.0]]))[0, 0] - 0.1 * np.cos(0.4)) < 1e-12)
    True
    """

    function: Function
    step: float

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise TypeError(f"function must be callable, got {type(self.function).__name__}")
        object.__setattr__(self, "step", as_number(self.step, "step", positive=True))

    def __call__(self, points: Floats) -> Floats:
        """The user's function."""
        return gap_values(self.function, points)

    def gradient(self, points: Floats) -> Floats:
        """By differences."""
        return differences(self, points, self.step, second=False)[1]

    def hessian(self, points: Floats) -> Floats:
        """By differences."""
        found = differences(self, points, self.step, second=True)[2]
        assert found is not None
        return found


@dataclass(frozen=True, eq=False)
class Profile:
    """A gap over its mean, p = d / d̄, as films and volumes need it.

    ``anchor`` (3,) is a point of the plate: a film that has degenerated has nodes that are no numbers, and
    those never reach the user's function.
    """

    field: GapField
    mean: float
    anchor: Floats

    def values(self, points: Floats) -> Floats:
        """p at points (…, 3), (…)."""
        flat, lost = self._sound(points)
        out = positive_gap(self.field, flat) / self.mean
        out[lost] = np.nan
        return out.reshape(points.shape[:-1])

    def gradients(self, points: Floats) -> Floats:
        """∇p at points (…, 3)."""
        flat, lost = self._sound(points)
        out = as_floats(self.field.gradient(flat), "gap's gradient", (len(flat), 3)) / self.mean
        out[lost] = np.nan
        return out.reshape(points.shape)

    def thickness(self, points: Floats, *, second: bool) -> Thickness:
        """p and its derivatives at the nodes (K, F, 3) of arcs."""
        hessian = None
        if second:
            flat, lost = self._sound(points)
            bend = as_floats(self.field.hessian(flat), "gap's hessian", (len(flat), 3, 3)) / self.mean
            bend[lost] = np.nan
            hessian = bend.reshape(*points.shape, 3)
        return Thickness(self.values(points), self.gradients(points), hessian)

    def _sound(self, points: Floats) -> tuple[Floats, Bools]:
        """Points (n, 3), and which of them are no numbers and were replaced."""
        flat = points.reshape(-1, 3)
        lost: Bools = np.asarray(~np.isfinite(flat).all(axis=1))
        return np.where(lost[:, None], self.anchor, flat), lost


def gap_values(function: Function, points: Floats) -> Floats:
    """A gap's values (n,), copied and finite.

    Raises
    ------
    TypeError, ValueError
        If they are no real numbers, of the wrong shape, or not finite.
    """
    found = np.asarray(function(points.copy()))
    if found.shape == (len(points),) and found.dtype.kind in "fiu" and not np.isfinite(found).all():
        bad = int(np.flatnonzero(~np.isfinite(found))[0])
        raise ValueError(
            f"gap must be finite, but at {shown(points[bad])} it is {found[bad]}; it is needed on the inner "
            "plate and, for derivatives, a little off it"
        )
    return np.array(as_floats(found, "gap's values", (len(points),)))


def positive_gap(function: Function, points: Floats) -> Floats:
    """A gap's values (n,), checked: finite and above 0.

    Raises
    ------
    TypeError, ValueError
        If they are no such numbers.
    """
    values = gap_values(function, points)
    if (values <= 0.0).any():
        bad = int(np.argmin(values))
        raise ValueError(f"gap must be greater than 0, but at {shown(points[bad])} it is {values[bad]:g}")
    return values


def shown(point: Floats) -> str:
    """A point for messages."""
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"
