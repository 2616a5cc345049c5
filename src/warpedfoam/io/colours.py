"""One choice of colours for files and pictures, safe for colour-blind readers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import Bools, Floats, as_choice, as_instance, frozen
from warpedfoam.foam import Foam

Bytes = NDArray[np.uint8]

COLOR_CHOICES = ("charge", "pressure", "sides", "area")

# Hexagons are pale; fewer sides (q > 0) red, more sides (q < 0) blue, darker away from zero.
CHARGE_RANGE = 3
_CHARGES = ("#163f80", "#2f78bd", "#7db9e2", "#ececea", "#ee8a5f", "#cc3d28", "#8c1322")
# Monotonic in lightness; the darkest still tells from the films.
RAMP = ("#414487", "#355f8d", "#2a788e", "#21918c", "#22a884", "#44bf70", "#7ad151", "#bddf26", "#fde725")
OUTSIDE_COLOUR = "#c4c4c4"
FILM_COLOUR = "#1b1b1f"


@dataclass(frozen=True, eq=False)
class BubbleColours:
    """What the bubbles are coloured by.

    Attributes
    ----------
    name : str
        One of `COLOR_CHOICES`.
    label : str
        Name for a reader.
    values : (n_bubbles,) array
    rgb : (n_bubbles, 3) array of bytes
    limits : (float, float)
        Values at the ends of the ramp.
    inside : (n_bubbles,) array of bool
        False for what is no disk (the exterior of a cluster): grey and left out of the limits.
    """

    name: str
    label: str
    values: Floats
    rgb: Bytes
    limits: tuple[float, float]
    inside: Bools


def bubble_colours(foam: Foam, color_by: str = "charge") -> BubbleColours:
    """Colours of the bubbles by ``color_by``.

    Raises
    ------
    TypeError
        If ``foam`` is not a Foam.
    ValueError
        If ``color_by`` is unknown, or asks for pressures that the foam does not have.
    """
    as_instance(foam, "foam", Foam)
    name = as_choice(color_by, "color_by", COLOR_CHOICES)
    inside = foam.network.bubble_euler == 1
    if not inside.any():
        inside = np.ones_like(inside)
    if name == "pressure":
        if foam.pressures is None:
            raise ValueError("color_by='pressure' needs pressures: relax the foam first (warpedfoam.relax)")
        values, label = foam.pressures, "pressure"
    elif name == "area":
        values, label = foam.bubble_areas, "area of the bubble"
    elif name == "sides":
        values, label = foam.network.sides.astype(np.float64), "sides n"
    else:
        values, label = foam.network.charges.astype(np.float64), "charge q"
    low, high = float(values[inside].min()), float(values[inside].max())
    rgb = charge_rgb(values) if name == "charge" else ramp_rgb(values, (low, high))
    rgb[~inside] = as_rgb(OUTSIDE_COLOUR)
    return BubbleColours(name, label, frozen(values), frozen(rgb), (low, high), frozen(inside))


def charge_rgb(charges: Floats) -> Bytes:
    """Colours (n, 3) of charges; beyond ±`CHARGE_RANGE` the last colour stays.

    Examples
    --------
    >>> charge_rgb(np.array([1.0, -9.0])).tolist()
    [[238, 138, 95], [22, 63, 128]]
    """
    table = np.stack([as_rgb(c) for c in _CHARGES])
    place = np.clip(np.round(charges), -CHARGE_RANGE, CHARGE_RANGE).astype(np.int64) + CHARGE_RANGE
    out: Bytes = table[place]
    return out


def ramp_rgb(values: Floats, limits: tuple[float, float]) -> Bytes:
    """Colours (n, 3) of values between ``limits`` on the ramp; its middle if the limits are equal.

    Examples
    --------
    >>> ramp_rgb(np.array([0.0, 1.0]), (0.0, 1.0)).tolist()
    [[65, 68, 135], [253, 231, 37]]
    """
    low, high = limits
    # limits that differ by round-off only are one value
    width = high - low if high - low > 1e-9 * max(abs(low), abs(high)) else 0.0
    t = np.clip((values - low) / width, 0.0, 1.0) if width else np.full(len(values), 0.5)
    table = np.stack([as_rgb(c) for c in RAMP]).astype(np.float64)
    place = np.linspace(0.0, 1.0, len(table))
    mixed = np.stack([np.interp(t, place, table[:, k]) for k in range(3)], axis=1)
    return np.round(mixed).astype(np.uint8)


def as_rgb(colour: str) -> Bytes:
    """Bytes (3,) of a colour written ``#rrggbb``.

    Examples
    --------
    >>> as_rgb("#ff0010").tolist()
    [255, 0, 16]
    """
    return np.frombuffer(bytes.fromhex(colour.removeprefix("#")), dtype=np.uint8)
