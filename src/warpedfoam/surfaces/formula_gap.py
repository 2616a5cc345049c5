"""`FormulaGap`: a gap written as a formula in x, y and z, with exact derivatives."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from warpedfoam.arrays import Floats
from warpedfoam.kernels.taylor import ARGUMENTS, CARRIED, PLAIN, Taylor

AXES = ("x", "y", "z")
CONSTANTS = {"pi": float(np.pi)}
#: Longest formula, in characters.
LONGEST = 2000
_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_UNARY: dict[type, Callable[[Any], Any]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}
#: What formulas may hold besides operators.
_TOLD = f"x, y, z, pi, numbers, + - * / ** and {', '.join(PLAIN)}"


@dataclass(frozen=True)
class FormulaGap:
    """A gap from a formula: numbers, x, y, z, pi, + - * / ** and common functions.

    Its derivatives are exact, and a foam in it can be saved.

    Parameters
    ----------
    formula : str
        Such as ``"0.5 + 0.01 * x - 0.02 * sin(z / 4)"``.

    Raises
    ------
    TypeError
        If ``formula`` is no string.
    ValueError
        If it cannot be read or holds something else.

    Examples
    --------
    >>> import numpy as np
    >>> gap = FormulaGap("0.5 + 0.01 * x * z")
    >>> gap(np.array([[2.0, 0.0, 3.0]])).round(12), gap.gradient(np.array([[2.0, 0.0, 3.0]])).round(12)
    (array([0.56]), array([[0.03, 0.  , 0.02]]))
    """

    formula: str

    def __post_init__(self) -> None:
        if not isinstance(self.formula, str):
            raise TypeError(f"formula must be a string, got {type(self.formula).__name__}")
        if len(self.formula) > LONGEST:
            raise ValueError(f"formula must have at most {LONGEST} characters, got {len(self.formula)}")
        _require_known(self._tree)

    @cached_property
    def _tree(self) -> ast.expr:
        try:
            return ast.parse(self.formula.strip(), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError) as fault:
            raise ValueError(
                f"formula {self.formula!r:.60} cannot be read: {getattr(fault, 'msg', fault)}"
            ) from None

    def __call__(self, points: Floats) -> Floats:
        """The formula's values, (n,)."""
        places = dict(zip(AXES, np.asarray(points, dtype=np.float64).T, strict=True))
        with np.errstate(all="ignore"):
            found = _value(self._tree, places, PLAIN)
        return np.array(np.broadcast_to(np.asarray(found, dtype=np.float64), (len(points),)))

    def gradient(self, points: Floats) -> Floats:
        """∇d, (n, 3)."""
        return self._carried(points).gradient

    def hessian(self, points: Floats) -> Floats:
        """∇²d, (n, 3, 3)."""
        return self._carried(points).hessian

    def _carried(self, points: Floats) -> Taylor:
        x = np.asarray(points, dtype=np.float64)
        places = {name: Taylor.variable(x, k) for k, name in enumerate(AXES)}
        with np.errstate(all="ignore"):
            found = _value(self._tree, places, CARRIED)
            # a plain number has no derivatives
            return found if isinstance(found, Taylor) else places["x"] * 0.0 + found


def _require_known(node: ast.expr) -> None:
    """Nothing but arithmetic."""
    match node:
        case ast.Constant(value=bool() | complex()):
            raise ValueError(f"formula may hold {_TOLD}; found {node.value!r}")
        case ast.Constant(value=int() | float()):
            return
        case ast.Name(id=name):
            if name not in AXES and name not in CONSTANTS:
                raise ValueError(f"formula may hold {_TOLD}; found {name!r}")
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            _require_known(left)
            _require_known(right)
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
            _require_known(operand)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in PLAIN:
            if len(args) != ARGUMENTS[name]:
                raise ValueError(f"formula: {name} takes {ARGUMENTS[name]} argument(s), got {len(args)}")
            for arg in args:
                _require_known(arg)
        case _:
            raise ValueError(f"formula may hold {_TOLD}; found {ast.unparse(node)!r:.40}")


def _value(node: ast.expr, places: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]]) -> Any:
    """A node's value: a number, an array or a `Taylor`."""
    match node:
        case ast.Constant(value=value):
            return float(value)  # type: ignore[arg-type]
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
    x = places["x"]
    return x * 0.0 + item if isinstance(x, Taylor) and not isinstance(item, Taylor) else item
