"""The table of bad calls, and what they work on; the rows are in `bad_geometry`,
`bad_foams`, `bad_gaps` and `bad_bubbles`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from types import FunctionType

import numpy as np

import warpedfoam as wf


@dataclass(frozen=True)
class Bad:
    """One bad call, the exception it must raise and what its message must say."""

    name: str
    call: Callable[[], object]
    fault: type[Exception]
    says: str


BAD: list[Bad] = []


def bad(
    name: str, fault: type[Exception], says: str
) -> Callable[[Callable[[], object]], Callable[[], object]]:
    def put(call: Callable[[], object]) -> Callable[[], object]:
        BAD.append(Bad(name, call, fault, says))
        return call

    return put


def table(prefix: str, call: Callable[..., object], rows: list[tuple[object, type[Exception], str]]) -> None:
    """One bad call for each row (argument, exception, message)."""
    for place, (value, fault, says) in enumerate(rows):
        shown = repr(value) if len(repr(value)) < 40 else type(value).__name__
        if isinstance(value, FunctionType):
            shown = str(place)  # its address would give the test another name in every run
        BAD.append(Bad(f"{prefix} {shown}", lambda v=value: call(v), fault, says))


# ---------------------------------------------------------------------------- what the calls work on

SPHERE, TORUS = wf.Sphere(1.0), wf.Torus(20.0, 4.0)


@cache
def cell():
    return wf.HeleShawCell(SPHERE, gap=0.1)


@cache
def foam():
    return wf.voronoi_foam(cell(), 20, seeds="lattice", n_nodes=1000)


@cache
def points():
    return SPHERE.lattice_points(20)


@cache
def small():
    return SPHERE.triangulate(42)


def changed(array, place, value):
    out = np.array(array)
    out[place] = value
    return out


def rebuilt(**change):
    """The foam built anew from its parts, some of them changed."""
    parts = {
        "cell": foam().cell,
        "network": foam().network,
        "vertex_points": foam().vertex_points,
        "film_offsets": foam().film_offsets,
        "target_volumes": foam().target_volumes,
        "bubble_ids": foam().bubble_ids,
    }
    return wf.Foam(**{**parts, **change})


def mesh_with(nodes=None, triangles=None):
    return wf.TriangleMesh(
        small().nodes if nodes is None else nodes, small().triangles if triangles is None else triangles
    )


NUMBERS: list[tuple[object, type[Exception], str]] = [
    (0.0, ValueError, "must be greater than 0, got 0"),
    (-1.0, ValueError, "must be greater than 0, got -1"),
    (np.nan, ValueError, "must be finite, got nan"),
    (np.inf, ValueError, "must be finite, got inf"),
    ("1", TypeError, "must be a number, got str '1'"),
    (None, TypeError, "must be a number, got NoneType"),
    (True, TypeError, "must be a number, got bool"),
    (1j, TypeError, "must be a number, got complex"),
    ([1.0], TypeError, "must be a number, got list"),
    (np.ones(2), TypeError, r"must be a single number, got an array of shape \(2,\)"),
]


def named(name):
    return [(value, fault, f"^{name} {says}") for value, fault, says in NUMBERS]
