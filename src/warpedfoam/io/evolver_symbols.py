"""Formulas as expressions of the Surface Evolver, and their derivatives as formulas."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping

from warpedfoam.surfaces.formula import CONSTANTS, as_float

Expr = ast.expr
_SIGNS: dict[type, str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "^"}


def derivative(node: Expr, name: str) -> Expr:
    """The derivative of a formula's tree by the coordinate ``name``, constants folded.

    Examples
    --------
    >>> spelt(derivative(ast.parse("x**3 + 2*sin(x*y)", mode="eval").body, "x"), {"x": "x1", "y": "x2"})
    '((3.0*(x1^2))+(2.0*(x2*cos((x1*x2)))))'
    """
    match node:
        case ast.Constant():
            return _number(0.0)
        case ast.Name(id=found):
            return _number(1.0 if found == name else 0.0)
        case ast.UnaryOp(op=ast.USub(), operand=u):
            return _times(_number(-1.0), derivative(u, name))
        case ast.UnaryOp(operand=u):
            return derivative(u, name)
        case ast.BinOp(left=u, op=ast.Pow(), right=v):
            return _power_slope(u, v, name)
        case ast.BinOp(left=u, op=op, right=v):
            du, dv = derivative(u, name), derivative(v, name)
            if isinstance(op, ast.Add):
                return _plus(du, dv)
            if isinstance(op, ast.Sub):
                return _minus(du, dv)
            if isinstance(op, ast.Mult):
                return _plus(_times(du, v), _times(u, dv))
            return _minus(_over(du, v), _over(_times(u, dv), _power(v, 2.0)))
        case ast.Call(func=ast.Name(id="atan2"), args=[u, v]):
            turn = _minus(_times(v, derivative(u, name)), _times(u, derivative(v, name)))
            return _over(turn, _plus(_power(u, 2.0), _power(v, 2.0)))
        case ast.Call(func=ast.Name(id="hypot"), args=[u, v]):
            push = _plus(_times(u, derivative(u, name)), _times(v, derivative(v, name)))
            return _over(push, node)
        case ast.Call(func=ast.Name(id=function), args=[u]):
            return _times(derivative(u, name), _SLOPES[function](u))
    raise AssertionError(ast.dump(node))


def spelt(node: Expr, names: Mapping[str, str]) -> str:
    """A tree in the Evolver's syntax, its coordinates by ``names``."""
    match node:
        case ast.Constant(value=value):
            return _spelt_number(as_float(value))
        case ast.Name(id=name):
            return _spelt_number(CONSTANTS[name]) if name in CONSTANTS else names[name]
        case ast.UnaryOp(op=op, operand=u):
            return f"(-{spelt(u, names)})" if isinstance(op, ast.USub) else spelt(u, names)
        case ast.BinOp(left=u, op=ast.Pow(), right=v):
            power = _constant(v)
            # the Evolver takes whole powers as products, of any sign
            if power is not None and power == round(power) and abs(power) < 100.0:
                whole = round(power)
                return f"({spelt(u, names)}^{whole})" if whole >= 0 else f"(1/({spelt(u, names)}^{-whole}))"
            return f"({spelt(u, names)}^{spelt(v, names)})"
        case ast.BinOp(left=u, op=op, right=v):
            return f"({spelt(u, names)}{_SIGNS[type(op)]}{spelt(v, names)})"
        case ast.Call(func=ast.Name(id="hypot"), args=[u, v]):
            return f"sqrt({spelt(u, names)}^2+{spelt(v, names)}^2)"
        case ast.Call(func=ast.Name(id=function), args=args):
            return f"{function}({','.join(spelt(arg, names) for arg in args)})"
    raise AssertionError(ast.dump(node))


def minus(one: Expr, other: Expr) -> Expr:
    """The difference of two formulas."""
    return _minus(one, other)


def _spelt_number(value: float) -> str:
    return repr(value) if value >= 0.0 else f"({value!r})"


def _number(value: float) -> Expr:
    return ast.Constant(value)


def _constant(node: Expr) -> float | None:
    """The value of a number, with its sign."""
    match node:
        case ast.Constant(value=value):
            return as_float(value)
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=value)):
            return -as_float(value)
        case ast.Name(id=name) if name in CONSTANTS:
            return CONSTANTS[name]
    return None


def _plus(u: Expr, v: Expr) -> Expr:
    a, b = _constant(u), _constant(v)
    if a is not None and b is not None:
        return _number(a + b)
    return v if a == 0.0 else u if b == 0.0 else ast.BinOp(u, ast.Add(), v)


def _minus(u: Expr, v: Expr) -> Expr:
    a, b = _constant(u), _constant(v)
    if a is not None and b is not None:
        return _number(a - b)
    if b == 0.0:
        return u
    return _times(_number(-1.0), v) if a == 0.0 else ast.BinOp(u, ast.Sub(), v)


def _times(u: Expr, v: Expr) -> Expr:
    a, b = _constant(u), _constant(v)
    if a is not None and b is not None:
        return _number(a * b)
    if 0.0 in (a, b):
        return _number(0.0)
    return v if a == 1.0 else u if b == 1.0 else ast.BinOp(u, ast.Mult(), v)


def _over(u: Expr, v: Expr) -> Expr:
    a, b = _constant(u), _constant(v)
    if a is not None and b is not None and b != 0.0:
        return _number(a / b)
    return _number(0.0) if a == 0.0 else u if b == 1.0 else ast.BinOp(u, ast.Div(), v)


def _power(u: Expr, power: float) -> Expr:
    return u if power == 1.0 else _number(1.0) if power == 0.0 else ast.BinOp(u, ast.Pow(), _number(power))


def _call(function: str, u: Expr) -> Expr:
    return ast.Call(ast.Name(function), [u], [])


def _power_slope(u: Expr, v: Expr, name: str) -> Expr:
    """u^v (v' ln u + v u'/u), the power itself where the exponent is a number."""
    du, dv = derivative(u, name), derivative(v, name)
    power = _constant(v)
    if power is not None:
        return _times(du, _times(_number(power), _power(u, power - 1.0)))
    grown = _plus(_times(dv, _call("log", u)), _over(_times(v, du), u))
    return _times(ast.BinOp(u, ast.Pow(), v), grown)


_SLOPES: dict[str, Callable[[Expr], Expr]] = {
    "exp": lambda u: _call("exp", u),
    "log": lambda u: _over(_number(1.0), u),
    "sqrt": lambda u: _over(_number(0.5), _call("sqrt", u)),
    "sin": lambda u: _call("cos", u),
    "cos": lambda u: _times(_number(-1.0), _call("sin", u)),
    "tan": lambda u: _plus(_number(1.0), _power(_call("tan", u), 2.0)),
    "sinh": lambda u: _call("cosh", u),
    "cosh": lambda u: _call("sinh", u),
    "tanh": lambda u: _minus(_number(1.0), _power(_call("tanh", u), 2.0)),
}
