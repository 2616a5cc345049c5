"""Numbers that carry their gradient and second derivatives: forward differentiation of second order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Floats


@dataclass(frozen=True, eq=False)
class Taylor:
    """Values (n,), gradients (n, m) and second derivatives (n, m, m) of a function of m variables.

    Examples
    --------
    >>> x = Taylor.variable(np.array([[0.5, 2.0]]), 0)
    >>> y = Taylor.variable(np.array([[0.5, 2.0]]), 1)
    >>> f = x**2 * y + 1.0
    >>> f.value.tolist(), f.gradient.tolist(), f.hessian.tolist()
    ([1.5], [[2.0, 0.25]], [[[4.0, 1.0], [1.0, 0.0]]])
    """

    value: Floats
    gradient: Floats
    hessian: Floats

    # numpy must leave mixed sums and products to this class
    __array_ufunc__ = None

    @classmethod
    def variable(cls, points: Floats, axis: int) -> Taylor:
        """The coordinate ``axis`` of points (n, m)."""
        n, m = points.shape
        gradient = np.zeros((n, m))
        gradient[:, axis] = 1.0
        return cls(points[:, axis].copy(), gradient, np.zeros((n, m, m)))

    def chain(self, value: Floats, first: Floats, second: Floats) -> Taylor:
        """f of this, from f, f' and f'' at its values."""
        square = self.gradient[:, :, None] * self.gradient[:, None]
        bend = first[:, None, None] * self.hessian + second[:, None, None] * square
        return Taylor(value, first[:, None] * self.gradient, bend)

    def _constant(self, other: Taylor | float) -> Taylor:
        if isinstance(other, Taylor):
            return other
        return Taylor(
            np.full_like(self.value, other), np.zeros_like(self.gradient), np.zeros_like(self.hessian)
        )

    def __add__(self, other: Taylor | float) -> Taylor:
        b = self._constant(other)
        return Taylor(self.value + b.value, self.gradient + b.gradient, self.hessian + b.hessian)

    def __neg__(self) -> Taylor:
        return Taylor(-self.value, -self.gradient, -self.hessian)

    def __pos__(self) -> Taylor:
        return self

    def __sub__(self, other: Taylor | float) -> Taylor:
        return self + (-self._constant(other))

    def __rsub__(self, other: float) -> Taylor:
        return (-self) + other

    def __mul__(self, other: Taylor | float) -> Taylor:
        b = self._constant(other)
        u, v = self.value[:, None], b.value[:, None]
        cross = self.gradient[:, :, None] * b.gradient[:, None]
        bend = u[..., None] * b.hessian + v[..., None] * self.hessian + cross + cross.transpose(0, 2, 1)
        return Taylor(self.value * b.value, u * b.gradient + v * self.gradient, bend)

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other: Taylor | float) -> Taylor:
        return self * self._constant(other) ** -1.0

    def __rtruediv__(self, other: float) -> Taylor:
        return self**-1.0 * other

    def __pow__(self, power: Taylor | float) -> Taylor:
        if isinstance(power, Taylor):
            return exp(power * log(self))
        a, k = self.value, float(power)
        # whole powers down to 0 have no negative powers in their derivatives
        first = k * a ** (k - 1.0) if k != 0.0 else np.zeros_like(a)
        second = k * (k - 1.0) * a ** (k - 2.0) if k not in (0.0, 1.0) else np.zeros_like(a)
        return self.chain(a**k, first, second)

    def __rpow__(self, base: float) -> Taylor:
        return exp(self * float(np.log(base)))


def exp(u: Taylor) -> Taylor:
    """e^u."""
    e = np.exp(u.value)
    return u.chain(e, e, e)


def log(u: Taylor) -> Taylor:
    """ln u."""
    return u.chain(np.log(u.value), 1.0 / u.value, -1.0 / u.value**2)


def sqrt(u: Taylor) -> Taylor:
    """√u."""
    return u**0.5


def sin(u: Taylor) -> Taylor:
    """Sine."""
    s, c = np.sin(u.value), np.cos(u.value)
    return u.chain(s, c, -s)


def cos(u: Taylor) -> Taylor:
    """Cosine."""
    s, c = np.sin(u.value), np.cos(u.value)
    return u.chain(c, -s, -c)


def tan(u: Taylor) -> Taylor:
    """Tangent."""
    t = np.tan(u.value)
    return u.chain(t, 1.0 + t**2, 2.0 * t * (1.0 + t**2))


def sinh(u: Taylor) -> Taylor:
    """Hyperbolic sine."""
    s, c = np.sinh(u.value), np.cosh(u.value)
    return u.chain(s, c, s)


def cosh(u: Taylor) -> Taylor:
    """Hyperbolic cosine."""
    s, c = np.sinh(u.value), np.cosh(u.value)
    return u.chain(c, s, c)


def tanh(u: Taylor) -> Taylor:
    """Hyperbolic tangent."""
    t = np.tanh(u.value)
    return u.chain(t, 1.0 - t**2, -2.0 * t * (1.0 - t**2))


def atan2(u: Taylor, v: Taylor) -> Taylor:
    """Angle of (v, u), its derivatives by those of the logarithm of a complex number."""
    a, b = u.value, v.value
    square = a**2 + b**2
    by_a, by_b = b / square, -a / square
    aa, ab = -2.0 * a * b / square**2, (a**2 - b**2) / square**2
    gradient = by_a[:, None] * u.gradient + by_b[:, None] * v.gradient
    cross = u.gradient[:, :, None] * v.gradient[:, None]
    bend = by_a[:, None, None] * u.hessian + by_b[:, None, None] * v.hessian
    bend += ab[:, None, None] * (cross + cross.transpose(0, 2, 1))
    for part, field in ((aa, u.gradient), (-aa, v.gradient)):
        bend += part[:, None, None] * field[:, :, None] * field[:, None]
    return Taylor(np.arctan2(a, b), gradient, bend)


def hypot(u: Taylor, v: Taylor) -> Taylor:
    """√(u² + v²)."""
    return sqrt(u * u + v * v)


#: Functions of formulas: for plain arrays and for `Taylor`, by name, with their number of arguments.
PLAIN: dict[str, Callable[..., Floats]] = {
    "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "atan2": np.arctan2, "hypot": np.hypot,
}  # fmt: skip
CARRIED: dict[str, Callable[..., Taylor]] = {
    "exp": exp, "log": log, "sqrt": sqrt, "sin": sin, "cos": cos, "tan": tan,
    "sinh": sinh, "cosh": cosh, "tanh": tanh, "atan2": atan2, "hypot": hypot,
}  # fmt: skip
ARGUMENTS = {name: 2 if name in ("atan2", "hypot") else 1 for name in PLAIN}
