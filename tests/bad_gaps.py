"""Bad calls with gaps that vary."""

from __future__ import annotations

from functools import cache

import numpy as np

import warpedfoam as wf

from .bad_calls import SPHERE, TORUS, bad, table

SHEET = wf.FlatTorus(4.0, 3.0)


class Crooked:
    """A gap whose derivatives are another's."""

    def __init__(self, slope=0.1, bend=0.0):
        self.slope, self.bend = slope, bend

    def __call__(self, x):
        return 0.3 + 0.1 * x[:, 0]

    def gradient(self, x):
        return np.tile([self.slope, 0.0, 0.0], (len(x), 1))

    def hessian(self, x):
        return np.full((len(x), 3, 3), self.bend)


# a surface with arcs of its own, which is no kind of Sphere
OWN = {k: v for k, v in vars(wf.Sphere).items() if k not in ("__dict__", "__weakref__")}
Foreign = type("Foreign", (), OWN)


table(
    "gap as a function",
    lambda v: wf.HeleShawCell(SPHERE, gap=v),
    [
        (np.sin, ValueError, r"gap's values must have shape \(10242,\), got \(10242, 3\)"),
        (lambda x: 0.1, ValueError, r"gap's values must have shape \(10242,\), got \(\)"),
        (lambda x: x[:, 0], ValueError, r"gap must be greater than 0, but at \(.*\) it is -1"),
        (
            lambda x: np.where(x[:, 2] > 0, 0.1, np.nan),
            ValueError,
            r"gap must be finite, but at .* it is nan",
        ),
        (lambda x: np.full(len(x), "wide"), TypeError, "gap's values must hold real numbers"),
        (lambda x: 0.1 + 1j * x[:, 0], TypeError, "gap's values must hold real numbers, got complex128"),
        (lambda x: np.where(x[:, 0] > 0.1, 0.1, 0.2), ValueError, "gap is too rough to be differentiated"),
        (lambda x: 1e70 + 1e69 * x[:, 0], ValueError, "gap must be at most 1e"),
        (wf.LinearGap, TypeError, "gap must be a number or a function of points, got the class LinearGap"),
        (Crooked(slope=0.2), ValueError, r"gap's gradient is not that of its values: at .* differs by 0.1"),
        (Crooked(bend=0.3), ValueError, "gap's hessian is not that of its values: at"),
        (
            wf.ShiftedSphereGap(wf.Sphere(2.0), 0.1, (0.0, 0.0, 0.01)),
            ValueError,
            r"gap belongs to Sphere\(radius=2.0\), but the inner plate is Sphere\(radius=1.0\)",
        ),
    ],
)
bad(
    "gap that varies on foreign arcs",
    TypeError,
    "gap varies, which a Foreign cannot carry: derive it from Level",
)(lambda: wf.HeleShawCell(Foreign(1.0), lambda x: 0.1 + 0.01 * x[:, 0]))
bad("gap that folds somewhere", ValueError, r"gap folds the outer plate at \(.*\): it is .* less than 16")(
    lambda: wf.HeleShawCell(TORUS, lambda x: 24.5 - 0.5 * np.hypot(x[:, 0], x[:, 1]))
)
bad("gap that does not repeat", ValueError, r"gap does not repeat after \(4, 0, 0\).*a plate that ends")(
    lambda: wf.HeleShawCell(SHEET, wf.LinearGap(1.0, (0.1, 0.0, 0.0)))
)
table(
    "FormulaGap",
    wf.FormulaGap,
    [
        (0.5, TypeError, "formula must be a string, got float"),
        ("", ValueError, "cannot be read"),
        ("0.5 +", ValueError, "formula '0.5 \\+' cannot be read"),
        ("w + 1", ValueError, "formula may hold x, y, z, pi, numbers.*; found 'w'"),
        ("__import__('os')", ValueError, 'found "__import__'),
        ("x.real", ValueError, "found 'x.real'"),
        ("sin(x, y)", ValueError, "sin takes 1 argument"),
        ("[x]", ValueError, "formula may hold"),
        ("True", ValueError, "found True"),
        ("x if y else z", ValueError, "found 'x if y else z'"),
        ("1+" * 1000 + "1", ValueError, "at most 2000 characters"),
        ("(" * 300 + "x" + ")" * 300, ValueError, "cannot be read"),
    ],
)
table(
    "LinearGap",
    lambda v: wf.LinearGap(*v),
    [
        ((0.0, (0, 0, 0)), ValueError, "gap must be greater than 0"),
        ((1.0, (0, 0)), ValueError, r"slope must have shape \(3,\)"),
        ((1.0, 0.1), ValueError, r"slope must have shape \(3,\)"),
        ((1.0, (0, 0, 0), (np.nan, 0, 0)), ValueError, "origin must be finite"),
    ],
)
table(
    "ShiftedSphereGap",
    lambda v: wf.ShiftedSphereGap(*v),
    [
        ((TORUS, 0.1, (0, 0, 0)), TypeError, "surface must be a Sphere, got Torus"),
        ((SPHERE, 0.1, (0, 0, 0.1)), ValueError, "shift must be less than the gap 0.1, or the plates touch"),
        ((SPHERE, "wide", (0, 0, 0.1)), TypeError, "gap must be a number"),
    ],
)
table(
    "ShiftedTubeGap",
    lambda v: wf.ShiftedTubeGap(*v),
    [
        ((SPHERE, 0.1, 0.0), TypeError, "surface must be a Torus, got Sphere"),
        ((TORUS, 0.5, 0.4, 0.4), ValueError, "shift must be less than the gap 0.5"),
        ((TORUS, 0.5, np.inf), ValueError, "outward must be finite"),
    ],
)


@cache
def wedge():
    return wf.HeleShawCell(SPHERE, wf.LinearGap(0.1, (0.02, 0.0, 0.0)))


@cache
def wedged():
    return wf.voronoi_foam(wedge(), 20, seeds="lattice", n_nodes=1000)


table(
    "parallel plates only:",
    lambda v: v(),
    [
        (
            lambda: wf.relax(wedged(), layers=2),
            ValueError,
            "relaxing with layers above 1 needs parallel plates, but the gap of this cell varies",
        ),
        (lambda: wf.write_fe("foam.fe", wedged()), ValueError, "write_fe needs parallel plates"),
        (
            lambda: wf.bubble_between_plates(wedge(), 0.01, [0.0, 0.0, 1.0]),
            ValueError,
            "a bubble between plates needs parallel plates",
        ),
        (
            lambda: wf.geometric_potential(wedge(), 0.01, points=[[0.0, 0.0, 1.0]]),
            ValueError,
            "a bubble between plates needs parallel plates",
        ),
    ],
)
