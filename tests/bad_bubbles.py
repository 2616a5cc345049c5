"""Bad calls of single bubbles, potentials, circles and formulas; rows of the table in `bad_calls`."""

from __future__ import annotations

from functools import cache

import numpy as np

import warpedfoam as wf
from warpedfoam import theory
from warpedfoam.studies.rims import OverRim

from .bad_calls import TORUS, bad, foam, named, table

CELL = wf.HeleShawCell(TORUS, gap=0.5)
PLACE = [24.0, 0.0, 0.0]
#: Ends at z = ±10; the flat radius of V = 0.5 in its gap is 0.56.
TUBE = wf.Cylinder(6.0, 20.0)
TUBE_CELL = wf.HeleShawCell(TUBE, gap=0.5)


@cache
def tube_mesh() -> wf.MeshSurface:
    mesh = TUBE.triangulate(1500)
    return wf.MeshSurface(mesh.nodes, mesh.triangles)


PLACES: list[tuple[object, type[Exception], str]] = [
    ([1.0, 2.0], ValueError, "must have shape"),
    ([[24.0, 0.0, 0.0]], ValueError, "must have shape"),
    ([np.nan, 0.0, 0.0], ValueError, "must be finite"),
    ("here", TypeError, "must"),
    (None, TypeError, "must"),
]
LAYERS: list[tuple[object, type[Exception], str]] = [
    (0, ValueError, "layers must be"),
    (13, ValueError, "layers must be"),
    (2.5, TypeError, "layers must be an integer"),
    ("4", TypeError, "layers must be"),
    (True, TypeError, "layers must be"),
]
CELLS: list[tuple[object, type[Exception], str]] = [
    (TORUS, TypeError, "cell must be a HeleShawCell, got Torus"),
    (None, TypeError, "cell must be a HeleShawCell"),
]

table("cell of a bubble", lambda v: wf.bubble_between_plates(v, 0.5, PLACE), CELLS)
table("volume of a bubble", lambda v: wf.bubble_between_plates(CELL, v, PLACE), [
    *named("volume"),
    (50.0, ValueError, "volume 50 is too large for the surface"),
    (1e4, ValueError, "volume must be less than the cell's"),
    (1e-300, ValueError, "volume must be larger"),
])  # fmt: skip
table("position of a bubble", lambda v: wf.bubble_between_plates(CELL, 0.5, v), PLACES)
table("layers of a bubble", lambda v: wf.bubble_between_plates(CELL, 0.5, PLACE, layers=v), LAYERS)
table("angles of a bubble", lambda v: wf.bubble_between_plates(CELL, 0.5, PLACE, angles=v), [
    (4, ValueError, "angles must be"),
    (18, ValueError, "angles must be odd"),
    (101, ValueError, "angles must be"),
    (17.0, TypeError, "angles must be"),
])  # fmt: skip
table("hold of a bubble", lambda v: wf.bubble_between_plates(CELL, 0.5, PLACE, hold=v), [
    ("tight", ValueError, "hold must be one of"),
    (None, TypeError, "hold must be"),
])  # fmt: skip
for hold in ("centroid", "projection", "free"):
    bad(f"a {hold} bubble over the rim", OverRim, r"reach over the rim, 0.3 away; hold it farther")(
        lambda hold=hold: wf.bubble_between_plates(TUBE_CELL, 0.5, [6.0, 0.0, 9.7], hold=hold)
    )
bad("a bubble over the rim of a mesh", OverRim, "would reach over the rim")(
    lambda: wf.bubble_between_plates(wf.HeleShawCell(tube_mesh(), 0.5), 0.5, [6.0, 0.0, 9.7], layers=2)
)

table("cell of a potential", lambda v: wf.geometric_potential(v, 0.5, points=[PLACE]), CELLS)
table("volume of a potential", lambda v: wf.geometric_potential(CELL, v, points=[PLACE]), named("volume"))
table("points of a potential", lambda v: wf.geometric_potential(CELL, 0.5, points=v), [
    (PLACE, ValueError, "points must have shape"),
    (np.full((2, 3), np.nan), ValueError, "points must be finite"),
    (np.empty((0, 3)), ValueError, "points"),
])  # fmt: skip
table("path of a potential", lambda v: wf.geometric_potential(CELL, 0.5, path=v), [
    ([PLACE], ValueError, "path must hold at least 2"),
    ("path", TypeError, "must"),
])  # fmt: skip
table("method of a potential", lambda v: wf.geometric_potential(CELL, 0.5, points=[PLACE], method=v), [
    ("magic", ValueError, "method must be one of"),
    (3, TypeError, "method must be"),
    (lambda *_: np.ones(7), ValueError, "the values of method"),
    (lambda _v, _d, a, _b: np.full(len(a), np.nan), ValueError, "the values of method must be finite"),
])  # fmt: skip
table("layers of a potential", lambda v: wf.geometric_potential(CELL, 0.5, points=[PLACE], layers=v), LAYERS)
table(
    "nodes of a potential",
    lambda v: wf.geometric_potential(CELL, 0.5, nodes=v, method="theory"),
    [(10, ValueError, "nodes must be at least 50"), (60.5, TypeError, "nodes must be")],
)
bad("points and a path", ValueError, "points or path, not both")(
    lambda: wf.geometric_potential(CELL, 0.5, points=[PLACE], path=[PLACE, PLACE])
)
for method in ("theory", "ruled"):
    bad(f"a potential over the rim by {method}", OverRim, "reach over it at all 2 places")(
        lambda method=method: wf.geometric_potential(
            TUBE_CELL, 0.5, points=[[6.0, 0.0, 9.7], [6.0, 0.0, -9.9]], method=method
        )
    )
table("start of a path", lambda v: wf.drift_path(CELL, 0.5, v, method="theory"), PLACES)
table("step of a path", lambda v: wf.drift_path(CELL, 0.5, PLACE, method="theory", step=v), [
    row for row in named("step") if row[0] is not None
])  # fmt: skip
table("steps of a path", lambda v: wf.drift_path(CELL, 0.5, PLACE, method="theory", most=v), [
    (0, ValueError, "most must be at least 1"),
    (1.5, TypeError, "most must be"),
])  # fmt: skip

table("surface of a circle", lambda v: wf.geodesic_circle(v, PLACE, 0.5), [
    (CELL, TypeError, "surface must be a surface"),
    (wf.Torus, TypeError, "surface must be a surface"),
])  # fmt: skip
table("centre of a circle", lambda v: wf.geodesic_circle(TORUS, v, 0.5), PLACES)
table("radius of a circle", lambda v: wf.geodesic_circle(TORUS, PLACE, v), named("radius"))
for way in ("jacobi", "exact", "heat"):
    bad(f"a circle over the rim by {way}", OverRim, "radius must be at most about 0.3.*over its rim")(
        lambda way=way: wf.geodesic_circle(TUBE, [6.0, 0.0, 9.7], 0.5, way)
    )
    bad(f"a circle over the rim of a mesh by {way}", OverRim, "over its rim")(
        lambda way=way: wf.geodesic_circle(tube_mesh(), [6.0, 0.0, 9.7], 0.5, way)
    )

table("layers of a foam", lambda v: wf.relax(foam(), layers=v), [r for r in LAYERS if r[0] != 0])

VALUES: list[tuple[object, type[Exception], str]] = [
    (0.0, ValueError, "must be greater than 0, found 0"),
    (-1.0, ValueError, "must be greater than 0, found -1"),
    (np.nan, ValueError, "must be finite, found nan"),
    ([0.5, np.inf], ValueError, "must be finite, found inf"),
    ("1", TypeError, "must be a real number"),
    (None, TypeError, "must be a real number"),
    (1j, TypeError, "must be a real number"),
    ([[1.0], [1.0, 2.0]], ValueError, "must be a number or a rectangular array"),
]
for function in (theory.flat_energy, theory.flat_radius, theory.second_order_coefficients):
    name = function.__name__
    table(f"volume of {name}", lambda v, f=function: f(v, 0.5), [(a, e, f"volume {m}") for a, e, m in VALUES])
    table(f"gap of {name}", lambda v, f=function: f(0.5, v), [(a, e, f"gap {m}") for a, e, m in VALUES])
table("k1 of the second order", lambda v: theory.second_order_ratio(0.5, 0.5, v, 0.0), [
    (np.nan, ValueError, "k1 must be finite"),
    ("k", TypeError, "k1 must be a real number"),
    (-5.0, ValueError, "gap must be less than the radii of curvature"),
])  # fmt: skip
bad("shapes of formulas that do not broadcast", ValueError, "broadcast")(
    lambda: theory.second_order_ratio(np.ones(2), np.ones(3), 0.1, 0.1)
)
bad("theory beyond d_crit", ValueError, r"gap must be less than d_crit")(
    lambda: theory.second_order_ratio(0.5, 1.2, 0.1, 0.1)
)
