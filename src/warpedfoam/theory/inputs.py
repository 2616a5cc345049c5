"""Arguments of formulas: finite numbers or arrays of them, of any shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warpedfoam.arrays import Floats


def as_values(value: ArrayLike, name: str, *, positive: bool = False) -> Floats:
    """Return finite floats of any shape; ``positive`` refuses 0 and below.

    Raises
    ------
    TypeError
        If the values are not real numbers.
    ValueError
        If one is not finite or out of range.

    Examples
    --------
    >>> as_values([0.5, -1.0], "gap", positive=True)
    Traceback (most recent call last):
    ValueError: gap must be greater than 0, found -1
    """
    try:
        raw = np.asarray(value)
    except ValueError as fault:
        raise ValueError(f"{name} must be a number or a rectangular array of numbers: {fault}") from None
    if raw.dtype.kind not in "fiu":
        raise TypeError(f"{name} must be a real number or an array of real numbers, got {raw.dtype} values")
    array = np.asarray(raw, dtype=np.float64)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, found {array[~np.isfinite(array)].ravel()[0]}")
    if positive and (array <= 0.0).any():
        raise ValueError(f"{name} must be greater than 0, found {array.min():g}")
    return array
