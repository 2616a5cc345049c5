"""The one door for input: every public function turns its arguments into arrays and numbers here.

Each function names the argument, what was found and what is wanted in its message.
"""

from __future__ import annotations

import numbers
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

Kind = TypeVar("Kind")


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return ``array`` as a contiguous read-only array that shares no memory with a writable one."""
    if not array.flags.writeable and array.flags.c_contiguous and array.base is None:
        return array
    out: NDArray[Any] = np.array(array, order="C", copy=True)
    out.flags.writeable = False
    return out


def as_instance(value: object, name: str, kind: type[Kind]) -> Kind:
    """Return ``value`` if it is a ``kind``; anything else is a ``TypeError``.

    Examples
    --------
    >>> as_instance(None, "foam", dict)
    Traceback (most recent call last):
    TypeError: foam must be a dict, got NoneType
    """
    if not isinstance(value, kind):
        raise TypeError(f"{name} must be a {kind.__name__}, got {type(value).__name__}")
    return value


def as_number(
    value: object,
    name: str,
    *,
    positive: bool = False,
    minimum: float | None = None,
    maximum: float | None = None,
) -> float:
    """Return a finite float; ``positive`` refuses zero and below.

    Raises
    ------
    TypeError
        If ``value`` is not a real number.
    ValueError
        If it is not finite or out of range.
    """
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (numbers.Real, np.ndarray)):
        raise TypeError(f"{name} must be a number, got {_shown(value)}")
    if isinstance(value, np.ndarray):
        if value.ndim or value.dtype.kind not in "fiu":
            raise TypeError(f"{name} must be a single number, got an array of shape {value.shape}")
        value = value.item()
    try:
        number = float(value)  # type: ignore[arg-type]
    except OverflowError:
        raise ValueError(f"{name} must be finite, got an integer too large for a float") from None
    if not np.isfinite(number):
        raise ValueError(f"{name} must be finite, got {number}")
    if positive and number <= 0.0:
        raise ValueError(f"{name} must be greater than 0, got {number:g}")
    if minimum is not None and number < minimum:
        raise ValueError(f"{name} must be at least {minimum:g}, got {number:g}")
    if maximum is not None and number > maximum:
        raise ValueError(f"{name} must be at most {maximum:g}, got {number:g}")
    return number


def as_integer(value: object, name: str, *, minimum: int | None = None, maximum: int | None = None) -> int:
    """Return an int; floats are refused even when they are whole, so that 200.5 is not read as 200.

    Raises
    ------
    TypeError
        If ``value`` is not an integer.
    ValueError
        If it is below ``minimum`` or above ``maximum``.
    """
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Integral):
        raise TypeError(f"{name} must be an integer, got {_shown(value)}")
    number = int(value)
    if minimum is not None and number < minimum:
        raise ValueError(f"{name} must be at least {minimum}, got {number}")
    if maximum is not None and number > maximum:
        raise ValueError(f"{name} must be at most {maximum}, got {number}")
    return number


def as_flag(value: object, name: str) -> bool:
    """Return a bool; anything else is a ``TypeError``."""
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be True or False, got {_shown(value)}")
    return bool(value)


def as_choice(value: object, name: str, choices: Sequence[str]) -> str:
    """Return ``value`` if it is one of ``choices``.

    Raises
    ------
    TypeError
        If it is not a string.
    ValueError
        If it is none of the choices.
    """
    if not isinstance(value, str):
        raise TypeError(f"{name} must be one of {', '.join(map(repr, choices))}, got {_shown(value)}")
    if value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}, got {value!r}")
    return value


def as_floats(value: ArrayLike, name: str, shape: tuple[int | None, ...]) -> Floats:
    """Return a finite float array of the given shape (``None`` leaves an axis free).

    Raises
    ------
    TypeError
        If the values are not real numbers.
    ValueError
        If the shape differs or a value is not finite.
    """
    raw = _as_array(value, name)
    if raw.dtype.kind not in "fiu":
        raise TypeError(f"{name} must hold real numbers, got {raw.dtype} values")
    array = np.asarray(raw, dtype=np.float64)
    _check_shape(array, name, shape)
    if not np.isfinite(array).all():
        bad = np.argwhere(~np.isfinite(array))[0]
        raise ValueError(
            f"{name} must be finite, but entry {tuple(int(i) for i in bad)} is {array[tuple(bad)]}"
        )
    return array


def as_points(value: ArrayLike, name: str, *, minimum: int = 1) -> Floats:
    """Return an (n, 3) float array of at least ``minimum`` points; one (3,) point is refused."""
    points = as_floats(value, name, (None, 3))
    if len(points) < minimum:
        raise ValueError(f"{name} must hold at least {minimum} points, got {len(points)}")
    return points


def as_indices(
    value: ArrayLike, name: str, shape: tuple[int | None, ...], *, below: int | None = None
) -> Ints:
    """Return an integer array with every entry in 0 … ``below`` − 1.

    Raises
    ------
    TypeError
        If the values are not integers.
    ValueError
        If the shape differs or an entry is out of range.
    """
    raw = _as_array(value, name)
    if raw.dtype.kind not in "iu":
        raise TypeError(f"{name} must hold integers, got {raw.dtype} values")
    array = np.asarray(raw, dtype=np.int64)
    _check_shape(array, name, shape)
    if array.size and (array.min() < 0 or (below is not None and array.max() >= below)):
        top = "" if below is None else f" and below {below}"
        raise ValueError(f"{name} must be at least 0{top}, found {int(array.min())} … {int(array.max())}")
    return array


def as_generator(seed: object, name: str = "seed") -> np.random.Generator:
    """Return a ``numpy.random.Generator`` from an integer seed or a generator; never global state.

    Raises
    ------
    TypeError
        If ``seed`` is neither.
    ValueError
        If the seed is negative.
    """
    if isinstance(seed, np.random.Generator):
        return seed
    return np.random.default_rng(as_integer(seed, name, minimum=0))


def _as_array(value: ArrayLike, name: str) -> NDArray[Any]:
    try:
        return np.asarray(value)
    except ValueError as fault:
        raise ValueError(f"{name} must be a rectangular array of numbers: {fault}") from None


def _check_shape(array: NDArray[Any], name: str, shape: tuple[int | None, ...]) -> None:
    fits = array.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        sizes = ", ".join("n" if s is None else str(s) for s in shape)
        wanted = f"({sizes},)" if len(shape) == 1 else f"({sizes})"
        raise ValueError(f"{name} must have shape {wanted}, got {array.shape}")


def _shown(value: object) -> str:
    text = repr(value)
    return f"{type(value).__name__} {text if len(text) < 40 else text[:37] + '...'}"
