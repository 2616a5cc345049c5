"""One choice of colours for files and pictures, safe for colour-blind readers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpedfoam.arrays import Bools, Floats, as_choice, as_instance, frozen
from warpedfoam.foam import Foam

Bytes = NDArray[np.uint8]

COLOR_CHOICES = ("charge", "pressure", "sides", "area", "volume", "curvature")
#: The choices for a help text.
COLOR_HELP = f"{', '.join(COLOR_CHOICES[:-1])} or {COLOR_CHOICES[-1]}"

# Hexagons are pale; fewer sides (q > 0) red, more sides (q < 0) blue, darker away from zero.
CHARGE_RANGE = 3
CHARGES = ("#163f80", "#2f78bd", "#7db9e2", "#ececea", "#ee8a5f", "#cc3d28", "#8c1322")
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
        One of `COLOR_CHOICES`, or another name for values of the caller's own.
    label : str
        Name for a reader.
    values : (n_bubbles,) array
    rgb : (n_bubbles, 3) array of bytes
    limits : (float, float)
        Values at the ends of the ramp.
    inside : (n_bubbles,) array of bool
        False for the exterior of clusters, and for what is no disk or has no value: grey, without a share
        in the limits.
    kind : {"charge", "counted", "ramp", "diverging"}
        The first two have a legend with counts, the others a colour bar.
    """

    name: str
    label: str
    values: Floats
    rgb: Bytes
    limits: tuple[float, float]
    inside: Bools
    kind: str = "ramp"


def bubble_colours(
    foam: Foam, color_by: str | ArrayLike = "charge", label: str | None = None
) -> BubbleColours:
    """Colours of the bubbles by ``color_by``, a name or a value for each bubble (NaN: none, grey).

    Raises
    ------
    TypeError
        If ``foam`` is not a Foam, or ``color_by`` neither a name nor numbers.
    ValueError
        If ``color_by`` is unknown, asks for pressures that the foam does not have, or has not one value for
        each bubble.
    """
    as_instance(foam, "foam", Foam)
    inside = foam.network.bubble_euler == 1
    if foam.exterior is not None:
        # on a sphere it is a disk, but no bubble all the same
        inside = inside & (np.arange(foam.n_bubbles) != foam.exterior)
    if not inside.any():
        inside = np.ones_like(inside)
    if isinstance(color_by, str):
        name = as_choice(color_by, "color_by", COLOR_CHOICES)
        values, text = _named(foam, name)
    else:
        name, text = "values", "value"
        values = _given(color_by, foam.n_bubbles)
        inside = inside & np.isfinite(values)
        if not inside.any():
            raise ValueError("color_by has no value that is a number")
    low, high = float(values[inside].min()), float(values[inside].max())
    kind = {"charge": "charge", "sides": "counted"}.get(name, "ramp")
    if name == "curvature":
        # a plane's curvature is 0 but for round-off
        least = max(1e-9 / foam.cell.surface.size**2, 1e-4 * max(-low, high))
        low, high = (0.0 if abs(g) < least else g for g in (low, high))
    if name == "curvature" and low < 0.0 < high:
        kind, high = "diverging", max(-low, high)
        low = -high
    if kind == "charge":
        rgb = charge_rgb(values)
    elif kind == "diverging":
        rgb = diverging_rgb(values, high)
    else:
        rgb = ramp_rgb(np.where(inside, values, low), (low, high))
    rgb[~inside] = as_rgb(OUTSIDE_COLOUR)
    return BubbleColours(
        name, text if label is None else label, frozen(values), frozen(rgb), (low, high), frozen(inside), kind
    )


def _named(foam: Foam, name: str) -> tuple[Floats, str]:
    """Values of the bubbles, and what a reader calls them."""
    if name == "pressure":
        if foam.pressures is None:
            raise ValueError("color_by='pressure' needs pressures: relax the foam first (warpedfoam.relax)")
        return foam.pressures, "pressure (γ / length)"
    if name == "area":
        return foam.bubble_areas, "area of the bubble (length²)"
    if name == "volume":
        return foam.bubble_volumes, "volume of the bubble (length³)"
    if name == "curvature":
        return (
            foam.bubble_curvatures / foam.bubble_areas,
            "Gaussian curvature, mean of the bubble (1 / length²)",
        )
    if name == "sides":
        return foam.network.sides.astype(np.float64), "sides n"
    return foam.network.charges.astype(np.float64), "charge q"


def _given(values: ArrayLike, count: int) -> Floats:
    try:
        out = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        out = np.zeros(())
    if not out.ndim:
        raise TypeError(
            f"color_by must be one of {', '.join(map(repr, COLOR_CHOICES))}, or a number for each bubble, "
            f"got {type(values).__name__}"
        )
    if out.shape != (count,):
        raise ValueError(f"color_by must hold {count} numbers, one per bubble, got shape {out.shape}")
    return out


def charge_rgb(charges: Floats) -> Bytes:
    """Colours (n, 3) of charges; beyond ±`CHARGE_RANGE` the last colour stays.

    Examples
    --------
    >>> charge_rgb(np.array([1.0, -9.0])).tolist()
    [[238, 138, 95], [22, 63, 128]]
    """
    table = np.stack([as_rgb(c) for c in CHARGES])
    place = np.clip(np.round(charges), -CHARGE_RANGE, CHARGE_RANGE).astype(np.int64) + CHARGE_RANGE
    out: Bytes = table[place]
    return out


def diverging_rgb(values: Floats, limit: float) -> Bytes:
    """Colours (n, 3) between −``limit`` and ``limit``, through the colours of the charges −3 … 3.

    Positive curvature is red, as the positive charges are that it attracts.

    Examples
    --------
    >>> diverging_rgb(np.array([-1.0, 0.0, 1.0]), 1.0).tolist()
    [[22, 63, 128], [236, 236, 234], [140, 19, 34]]
    """
    table = charge_rgb(np.arange(-CHARGE_RANGE, CHARGE_RANGE + 1.0)).astype(np.float64)
    t = np.clip(values / limit, -1.0, 1.0)
    place = np.linspace(-1.0, 1.0, len(table))
    return np.round(np.stack([np.interp(t, place, table[:, k]) for k in range(3)], axis=1)).astype(np.uint8)


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
