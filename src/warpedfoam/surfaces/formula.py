"""`Formula`: a function of the coordinates written down as text, with exact derivatives."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.taylor import ARGUMENTS, CARRIED, PLAIN, Taylor

CONSTANTS = {"pi": float(np.pi)}
#: Longest formula, in characters, and its deepest nesting (a sum of n terms nests n deep).
LONGEST, DEEPEST = 2000, 300
_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_UNARY: dict[type, Callable[[Any], Any]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}


@dataclass(frozen=True)
class Formula:
    """A function from a formula: numbers, coordinates, pi, + - * / ** and common functions.

    Nothing else is read, so that the formula of a stranger's file does no harm. Its first and second
    derivatives are exact.

    Parameters
    ----------
    text : str
        Such as ``"0.5 * cos(2 * pi * x / 10)"``.
    variables : str, optional
        The coordinates that it may hold, a letter each.

    Raises
    ------
    TypeError
        If ``text`` is no string.
    ValueError
        If it cannot be read or holds something else.

    Examples
    --------
    >>> import numpy as np
    >>> bowl = Formula("x**2 + 3 * x * y", "xy")
    >>> points = np.array([[1.0, 2.0]])
    >>> bowl(points).tolist(), bowl.gradient(points).tolist(), bowl.hessian(points).tolist()
    ([7.0], [[8.0, 3.0]], [[[2.0, 3.0], [3.0, 0.0]]])
    """

    text: str
    variables: str = "xyz"

    def __post_init__(self) -> None:
        for name in ("text", "variables"):
            if not isinstance(getattr(self, name), str):
                found = type(getattr(self, name)).__name__
                raise TypeError(f"{'formula' if name == 'text' else name} must be a string, got {found}")
        if self.variables not in ("x", "y", "z", "xy", "xyz"):
            raise ValueError(f"variables must be one of x, y, z, xy and xyz, got {self.variables!r}")
        if len(self.text) > LONGEST:
            raise ValueError(f"formula must have at most {LONGEST} characters, got {len(self.text)}")
        for node in _flattened(self.tree):
            self._require_known(node)

    @cached_property
    def tree(self) -> ast.expr:
        """The formula as Python reads it."""
        try:
            return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError) as fault:
            raise ValueError(
                f"formula {self.text!r:.60} cannot be read: {getattr(fault, 'msg', fault)}"
            ) from None

    def __call__(self, points: Floats) -> Floats:
        """Values (n,) at points (n, m), or (n,) where there is one coordinate."""
        x = self._columns(points)
        places = dict(zip(self.variables, x.T, strict=True))
        with np.errstate(all="ignore"):
            found = _value(self.tree, places, PLAIN)
        return np.array(np.broadcast_to(np.asarray(found, dtype=np.float64), (len(x),)))

    def gradient(self, points: Floats) -> Floats:
        """First derivatives, shaped as the points."""
        found: Floats = self._carried(points).gradient
        return found.reshape(np.shape(points))

    def hessian(self, points: Floats) -> Floats:
        """Second derivatives (n, m, m), or (n,) at points (n,)."""
        found: Floats = self._carried(points).hessian
        return found if np.ndim(points) == 2 else found[:, 0, 0]

    def _columns(self, points: Floats) -> Floats:
        x = np.asarray(points, dtype=np.float64)
        return x[:, None] if x.ndim == 1 else x

    def _carried(self, points: Floats) -> Taylor:
        x = self._columns(points)
        places = {name: Taylor.variable(x, k) for k, name in enumerate(self.variables)}
        with np.errstate(all="ignore"):
            found = _value(self.tree, places, CARRIED)
            # a plain number has no derivatives
            return found if isinstance(found, Taylor) else places[self.variables[0]] * 0.0 + found

    def _require_known(self, node: ast.expr) -> None:
        """Nothing but arithmetic."""
        told = f"{', '.join(self.variables)}, pi, numbers, + - * / ** and {', '.join(PLAIN)}"
        match node:
            case ast.Constant(value=bool() | complex()):
                raise ValueError(f"formula may hold {told}; found {node.value!r}")
            case ast.Constant(value=int() | float()):
                return
            case ast.Name(id=name):
                if name not in self.variables and name not in CONSTANTS:
                    raise ValueError(f"formula may hold {told}; found {name!r}")
            case ast.BinOp(op=op) if type(op) in _BINARY:
                return
            case ast.UnaryOp(op=op) if type(op) in _UNARY:
                return
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in PLAIN:
                if len(args) != ARGUMENTS[name]:
                    raise ValueError(f"formula: {name} takes {ARGUMENTS[name]} argument(s), got {len(args)}")
            case _:
                raise ValueError(f"formula may hold {told}; found {ast.unparse(node)!r:.40}")


def _flattened(tree: ast.expr) -> Iterator[ast.expr]:
    """The parts of a formula from the top, without recursion: hostile ones are deep.

    Raises
    ------
    ValueError
        If it nests too deep to be evaluated.
    """
    level = [tree]
    for _ in range(DEEPEST):
        yield from level
        below: list[ast.expr] = []
        for node in level:
            match node:
                case ast.BinOp(left=left, right=right):
                    below += (left, right)
                case ast.UnaryOp(operand=operand):
                    below.append(operand)
                case ast.Call(args=args):
                    below += args
        if not below:
            return
        level = below
    raise ValueError(f"formula nests more than {DEEPEST} deep; put its sums in brackets, two halves each")


def as_float(value: object) -> float:
    """A number of a formula; whole ones beyond floating point are infinite."""
    try:
        return float(value)  # type: ignore[arg-type]
    except OverflowError:
        return np.inf


def _value(node: ast.expr, places: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]]) -> Any:
    """A node's value: a number, an array or a `Taylor`."""
    match node:
        case ast.Constant(value=value):
            return as_float(value)
        case ast.Name(id=name):
            return CONSTANTS[name] if name in CONSTANTS else places[name]
        case ast.BinOp(left=left, op=op, right=right):
            one, other = _value(left, places, functions), _value(right, places, functions)
            if isinstance(one, float) and isinstance(other, float):
                # NumPy's numbers overflow to inf, where Python's raise or turn complex
                return float(_BINARY[type(op)](np.float64(one), np.float64(other)))
            return _BINARY[type(op)](one, other)
        case ast.UnaryOp(op=op, operand=operand):
            return _UNARY[type(op)](_value(operand, places, functions))
        case ast.Call(func=ast.Name(id=name), args=args):
            given = [_value(arg, places, functions) for arg in args]
            if all(isinstance(item, float) for item in given):
                return float(PLAIN[name](*given))
            return functions[name](*(_promoted(item, places) for item in given))
    raise AssertionError(ast.dump(node))


def _promoted(item: Any, places: Mapping[str, Any]) -> Any:
    """A number beside a `Taylor` becomes one."""
    first = next(iter(places.values()))
    return first * 0.0 + item if isinstance(first, Taylor) and not isinstance(item, Taylor) else item
