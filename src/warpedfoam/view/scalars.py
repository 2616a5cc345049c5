"""What the viewer can colour bubbles by: values, limits and colours over all frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Bools, Floats, frozen
from warpedfoam.foam import Foam
from warpedfoam.io.colours import (
    CHARGE_RANGE,
    OUTSIDE_COLOUR,
    RAMP,
    Bytes,
    as_rgb,
    bubble_colours,
    charge_rgb,
    diverging_rgb,
    ramp_rgb,
)

#: Names of the scalars; ``surface`` is the Gaussian curvature point by point, ``gap`` is there if one varies.
SCALARS = ("charge", "sides", "area", "volume", "pressure", "curvature", "surface", "gap", "id")
_LABELS = {
    "charge": "charge q = 6 − n",
    "sides": "sides n",
    "area": "area of the bubble",
    "volume": "volume of the bubble",
    "pressure": "pressure",
    "curvature": "Gaussian curvature, mean",
    "surface": "Gaussian curvature, pointwise",
    "gap": "gap at the centre",
    "id": "id of the bubble",
}


@dataclass(frozen=True, eq=False)
class Scalar:
    """One scalar of the bubbles of all frames.

    Attributes
    ----------
    name, label : str
        One of `SCALARS`, and what a reader calls it.
    kind : {"charge", "counted", "ramp", "diverging"}
        Counted scalars have a legend of values, the last two a colour bar.
    limits : (float, float)
        Values at the ends of the colour bar, the same in all frames.
    values : tuple of (n_bubbles,) arrays
        Frame by frame; NaN where a bubble that is no disk has no such value.
    rgb : tuple of (n_bubbles, 3) arrays of bytes
        Frame by frame.
    """

    name: str
    label: str
    kind: str
    limits: tuple[float, float]
    values: tuple[Floats, ...]
    rgb: tuple[Bytes, ...]

    @property
    def stops(self) -> Bytes:
        """Colours (n, 3) evenly spaced along the colour bar, or of the charges −3 … 3."""
        if self.kind in ("charge", "diverging"):
            return charge_rgb(np.arange(-CHARGE_RANGE, CHARGE_RANGE + 1.0))
        return np.stack([as_rgb(colour) for colour in RAMP])


def bubble_scalars(foams: Sequence[Foam], curvatures: Sequence[Floats]) -> tuple[Scalar, ...]:
    """All scalars that every foam has.

    Parameters
    ----------
    foams : sequence of Foam
    curvatures : sequence of arrays
        Gaussian curvature at the points that are drawn, foam by foam: the limits of its colours.
    """
    inside = [bubble_colours(foam, "charge").inside for foam in foams]
    disks = [foam.network.bubble_euler == 1 for foam in foams]
    found = [
        _charge(foams, inside),
        _ramp("sides", foams, inside, lambda foam: foam.network.sides.astype(np.float64), kind="counted"),
        # the loops of what is no disk do not tell its area, volume or curvature
        _ramp("area", foams, inside, lambda foam: foam.bubble_areas, disks),
        _ramp("volume", foams, inside, lambda foam: foam.bubble_volumes, disks),
    ]
    if all(foam.pressures is not None for foam in foams):
        found.append(_ramp("pressure", foams, inside, lambda foam: np.asarray(foam.pressures)))
    low = min(float(g.min()) for g in curvatures)
    high = max(float(g.max()) for g in curvatures)
    found += _curvature(foams, inside, disks, (low, high))
    if any(not foam.cell.parallel for foam in foams):
        found.append(_ramp("gap", foams, inside, lambda foam: foam.cell.gaps(foam.bubble_centres), disks))
    found.append(_ramp("id", foams, inside, lambda foam: foam.bubble_ids.astype(np.float64)))
    return tuple(found)


def _charge(foams: Sequence[Foam], inside: Sequence[Bools]) -> Scalar:
    values = tuple(foam.network.charges.astype(np.float64) for foam in foams)
    rgb = tuple(_greyed(charge_rgb(v), good) for v, good in zip(values, inside, strict=True))
    return Scalar("charge", _LABELS["charge"], "charge", _limits(values, inside), values, rgb)


def _ramp(
    name: str,
    foams: Sequence[Foam],
    inside: Sequence[Bools],
    of: Callable[[Foam], Floats],
    known: Sequence[Bools] | None = None,
    kind: str = "ramp",
) -> Scalar:
    values = tuple(of(foam) for foam in foams)
    limits = _limits(values, inside)
    rgb = tuple(_greyed(ramp_rgb(v, limits), good) for v, good in zip(values, inside, strict=True))
    return Scalar(name, _LABELS[name], kind, limits, _known(values, known), rgb)


def _curvature(
    foams: Sequence[Foam], inside: Sequence[Bools], disks: Sequence[Bools], limits: tuple[float, float]
) -> list[Scalar]:
    """Mean of each bubble, and the surface's own, in the same colours."""
    means = tuple(foam.bubble_curvatures / foam.bubble_areas for foam in foams)
    # a plane's curvature is 0 but for round-off, a flat point's is seldom hit
    scale = max(foam.cell.surface.size for foam in foams) ** 2
    least = max(1e-9 / scale, 1e-4 * max(-limits[0], limits[1]))
    low, high = (0.0 if abs(g) < least else g for g in limits)
    diverging = low < 0.0 < high
    if diverging:
        high = max(-low, high)
        low = -high
    kind = "diverging" if diverging else "ramp"
    rgb = tuple(
        _greyed(diverging_rgb(g, high) if diverging else ramp_rgb(g, (low, high)), good)
        for g, good in zip(means, inside, strict=True)
    )
    values = _known(means, disks)
    return [Scalar(name, _LABELS[name], kind, (low, high), values, rgb) for name in ("curvature", "surface")]


def _limits(values: Sequence[Floats], inside: Sequence[Bools]) -> tuple[float, float]:
    shown = np.concatenate([v[good] for v, good in zip(values, inside, strict=True)])
    return float(shown.min()), float(shown.max())


def _known(values: tuple[Floats, ...], known: Sequence[Bools] | None) -> tuple[Floats, ...]:
    if known is None:
        return tuple(frozen(v) for v in values)
    return tuple(frozen(np.where(good, v, np.nan)) for v, good in zip(values, known, strict=True))


def _greyed(rgb: Bytes, inside: Bools) -> Bytes:
    rgb[~inside] = as_rgb(OUTSIDE_COLOUR)
    return frozen(rgb)
