"""The numbers of bubbles and films that files carry, as arrays by name."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpedfoam.foam import Foam

Scalars = dict[str, NDArray[Any]]


def bubble_scalars(foam: Foam) -> Scalars:
    """``bubble`` (its id), sides, charge, area, volume, gaussian_curvature (mean), and pressure if known."""
    network = foam.network
    out: Scalars = {
        "bubble": foam.bubble_ids,
        "sides": network.sides,
        "charge": network.charges,
        "area": foam.bubble_areas,
        "volume": foam.bubble_volumes,
        "gaussian_curvature": foam.bubble_curvatures / foam.bubble_areas,
    }
    if foam.pressures is not None:
        out["pressure"] = foam.pressures
    return out


def film_scalars(foam: Foam) -> Scalars:
    """``film``, the ids of the bubbles ``left`` and ``right`` of it, length, film_area, and pressure_jump."""
    network = foam.network
    out: Scalars = {
        "film": np.arange(network.n_films),
        "left": foam.bubble_ids[network.left],
        "right": foam.bubble_ids[network.right],
        "length": foam.film_lengths,
        "film_area": foam.film_areas,
    }
    if foam.pressures is not None:
        out["pressure_jump"] = foam.pressures[network.left] - foam.pressures[network.right]
    return out
