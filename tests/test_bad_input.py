"""Bad calls through the front door: the right exception, a message that says what to do, no crash."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.cli.config import options_from, read_options

ROOT = Path(__file__).parents[1]


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
    for value, fault, says in rows:
        shown = repr(value) if len(repr(value)) < 40 else type(value).__name__
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


# ---------------------------------------------------------------------------- surfaces

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


table("Sphere", wf.Sphere, named("radius"))
table("Torus major", lambda v: wf.Torus(v, 1.0), named("major_radius"))
table("Torus minor", lambda v: wf.Torus(3.0, v), named("minor_radius"))
table("gap", lambda v: wf.HeleShawCell(SPHERE, gap=v), named("gap"))
table(
    "Torus",
    lambda v: wf.Torus(*v),
    [((1.0, 1.0), ValueError, "must exceed minor_radius"), ((1.0, 2.0), ValueError, "1 <= 2")],
)
table(
    "gap on a torus",
    lambda v: wf.HeleShawCell(TORUS, gap=v),
    [
        (16.5, ValueError, "gap 16.5 folds the outer plate: it must be less than 16"),
        (1e9, ValueError, "folds the outer plate"),
    ],
)
table(
    "cell of",
    lambda v: wf.HeleShawCell(v, gap=0.1),
    [
        (None, TypeError, r"surface must be a surface such as Sphere\(1.0\)"),
        ("sphere", TypeError, "got str"),
        (wf.Sphere, TypeError, "surface must be a surface"),
        (np.zeros((3, 3)), TypeError, "got ndarray"),
        (small(), TypeError, "got TriangleMesh"),
    ],
)
table("gap varies", lambda v: wf.HeleShawCell(SPHERE, gap=v), [(np.sin, TypeError, "gap must be a number")])
table(
    "n_heights",
    lambda v: wf.HeleShawCell(SPHERE, 0.1, v),
    [(0, ValueError, "n_heights must be at least 1"), (2.0, TypeError, "n_heights must be an integer")],
)
table(
    "triangulate",
    SPHERE.triangulate,
    [(11, ValueError, "n_nodes must be at least 12"), (1e3, TypeError, "n_nodes must be an integer")],
)
table("triangulate a torus", TORUS.triangulate, [(47, ValueError, "n_nodes must be at least 48, got 47")])

# ---------------------------------------------------------------------------- building

table(
    "n_bubbles",
    lambda v: wf.voronoi_foam(cell(), v),
    [
        (0, ValueError, "^n_bubbles must be at least 1, got 0"),
        (1, wf.ResolutionError, "n_bubbles must be at least 4"),
        (2, wf.ResolutionError, "two hemispheres and three lunes can be built with Foam.from_loops"),
        (3, wf.ResolutionError, "n_bubbles must be at least 4"),
        (-1, ValueError, "^n_bubbles must be at least 1, got -1"),
        (2.5, TypeError, "^n_bubbles must be an integer, got float 2.5"),
        (20.0, TypeError, "^n_bubbles must be an integer, got float 20.0"),
        (True, TypeError, "^n_bubbles must be an integer, got bool True"),
        ("200", TypeError, "^n_bubbles must be an integer, got str '200'"),
        (np.nan, TypeError, "^n_bubbles must be an integer"),
        ([20], TypeError, "^n_bubbles must be an integer, got list"),
        (None, TypeError, "n_bubbles is needed unless seeds is an array"),
    ],
)
table(
    "seeds",
    lambda v: wf.voronoi_foam(cell(), seeds=v() if callable(v) else v),
    [
        (lambda: 1.01 * points(), ValueError, r"seed \d+ is 0.01 off it; project them"),
        (lambda: changed(points(), 3, points()[7]), ValueError, "seeds 3 and 7 coincide; remove one"),
        (
            lambda: changed(points(), 3, np.nan),
            ValueError,
            r"seeds must be finite, but entry \(3, 0\) is nan",
        ),
        (lambda: changed(points(), (2, 1), np.inf), ValueError, r"entry \(2, 1\) is inf"),
        (lambda: changed(points(), 3, 0.0), ValueError, "centre"),
        (lambda: points()[:, :2], ValueError, r"seeds must have shape \(n, 3\), got \(20, 2\)"),
        (lambda: points()[0], ValueError, r"seeds must have shape \(n, 3\), got \(3,\)"),
        (np.zeros((0, 3)), ValueError, "seeds must hold at least 1"),
        ([[1, 0, 0], [0, 1]], ValueError, "seeds must be a rectangular array"),
        (lambda: points() > 0, TypeError, "seeds must hold real numbers"),
        (lambda: points().astype(complex), TypeError, "seeds must hold real numbers"),
        (None, TypeError, "seeds must hold real numbers"),
        ({}, TypeError, "seeds must hold real numbers"),
    ],
)
table(
    "kind of seeds",
    lambda v: wf.voronoi_foam(cell(), 20, seeds=v),
    [
        ("hexagons", ValueError, "seeds must be one of 'random', 'blue', 'lattice', got 'hexagons'"),
        ("", ValueError, "seeds must be one of"),
        ("Random", ValueError, "got 'Random'"),
    ],
)
bad("n_bubbles and seeds at odds", ValueError, "n_bubbles is 21, but seeds holds 20 points; leave one out")(
    lambda: wf.voronoi_foam(cell(), 21, seeds=points())
)
table(
    "seed",
    lambda v: wf.voronoi_foam(cell(), 20, seed=v),
    [
        (-1, ValueError, "seed must be at least 0"),
        (1.0, TypeError, "seed must be an integer"),
        (None, TypeError, "seed must be an integer"),
        ("0", TypeError, "seed must be an integer"),
        (np.random, TypeError, "seed must be an integer"),
    ],
)
table(
    "lloyd",
    lambda v: wf.voronoi_foam(cell(), 20, lloyd=v),
    [
        (-1, ValueError, "lloyd must be at least 0"),
        (1.5, TypeError, "lloyd must be an integer"),
        (10**6, ValueError, "lloyd must be at most 1000"),
        (True, TypeError, "lloyd must be an integer"),
    ],
)
table(
    "order of new films",
    lambda v: wf.voronoi_foam(cell(), 20, order=v),
    [
        (0, ValueError, "order must be at least 2"),
        (1.5, TypeError, "order must be an integer"),
        (25, ValueError, "order must be at most 24"),
    ],
)
table(
    "volumes",
    lambda v: wf.voronoi_foam(cell(), 20, volumes=v() if callable(v) else v),
    [
        (lambda: np.ones(20), ValueError, r"volumes must add up to the cell's volume .*multiply them by"),
        (lambda: np.ones(19), ValueError, r"volumes must have shape \(20,\), got \(19,\)"),
        (lambda: np.ones((20, 1)), ValueError, "volumes must have shape"),
        (lambda: np.full(20, np.nan), ValueError, "volumes must be finite"),
        (lambda: changed(np.ones(20), 4, -1.0), ValueError, "volumes must be above 0, but bubble 4 has -1"),
        (lambda: changed(np.ones(20), 4, 0.0), ValueError, "volumes must be above 0, but bubble 4 has 0"),
        (-0.1, ValueError, "volumes must be at least 0"),
        (2.5, ValueError, "volumes as a log-normal width must be at most 1"),
        (np.nan, ValueError, "volumes must be finite"),
        ("equal", TypeError, "volumes must be a number"),
        (True, TypeError, "volumes must be a number"),
    ],
)
table(
    "n_nodes",
    lambda v: wf.voronoi_foam(cell(), 20, n_nodes=v),
    [
        (10, ValueError, "n_nodes must be at least 100"),
        (1000.0, TypeError, "n_nodes must be an integer"),
        ("fine", TypeError, "n_nodes must be an integer"),
    ],
)
bad("too coarse", wf.ResolutionError, "n_nodes = 1000 is too coarse for 500 bubbles; use at least 3000")(
    lambda: wf.voronoi_foam(cell(), 500, n_nodes=1000)
)
bad("too few on a torus", wf.ResolutionError, r"would not be disks.*Use about \d+ bubbles or more \(now 5\)")(
    lambda: wf.voronoi_foam(wf.HeleShawCell(TORUS, 0.5), 5, n_nodes=2000)
)
table(
    "voronoi_foam of",
    lambda v: wf.voronoi_foam(v, 20),
    [
        (SPHERE, TypeError, "cell must be a HeleShawCell, got Sphere"),
        (None, TypeError, "cell must be a HeleShawCell, got NoneType"),
        (wf.HeleShawCell, TypeError, "cell must be a HeleShawCell"),
    ],
)

# ---------------------------------------------------------------------------- meshes and distances


def two_spheres():
    nodes = np.concatenate([small().nodes, small().nodes + 5.0])
    return mesh_with(nodes, np.concatenate([small().triangles, small().triangles + 42]))


def third_sheet():
    a, b, c = small().triangles[0]
    nodes = np.concatenate([small().nodes, [2.0 * small().nodes[c]]])
    return mesh_with(nodes, np.concatenate([small().triangles, [[a, b, 42]]]))


table(
    "distances on",
    lambda v: wf.geodesic_distances(v(), 0),
    [
        (lambda: None, TypeError, "surface_or_mesh must be a Surface, a TriangleMesh or a trimesh.Trimesh"),
        (lambda: wf.Sphere, TypeError, "surface_or_mesh must be"),
        (lambda: mesh_with(triangles=small().triangles[1:]), wf.MeshError, "the mesh is open: 3 rim edges"),
        (third_sheet, wf.MeshError, "belongs to more than two triangles: the mesh is not a manifold"),
        (two_spheres, wf.MeshError, "the mesh has 2 separate components; keep one"),
        (lambda: mesh_with(np.zeros((0, 3))), ValueError, "nodes must hold at least 3 points, got 0"),
        (lambda: mesh_with(triangles=np.zeros((0, 3), int)), wf.MeshError, "triangles is empty"),
        (lambda: mesh_with(triangles=small().triangles + 1), ValueError, "triangles must be .* below 42"),
        (lambda: mesh_with(triangles=small().triangles - 1), ValueError, "triangles must be at least 0"),
        (lambda: mesh_with(triangles=small().triangles * 1.0), TypeError, "triangles must hold integers"),
        (lambda: mesh_with(triangles=small().triangles[:, :2]), ValueError, "triangles must have shape"),
        (lambda: mesh_with(changed(small().nodes, 5, np.nan)), ValueError, "nodes must be finite"),
        (
            lambda: mesh_with(
                changed(small().nodes, small().triangles[0, 0], small().nodes[small().triangles[0, 1]])
            ),
            wf.MeshError,
            "triangles have no area",
        ),
        (
            lambda: mesh_with(triangles=changed(small().triangles, 0, small().triangles[0, ::-1])),
            wf.MeshError,
            "oriented against each other; flip one",
        ),
        (
            lambda: mesh_with(np.concatenate([small().nodes, [[9.0, 0, 0]]])),
            wf.MeshError,
            "1 nodes belong to no triangle",
        ),
    ],
)
table(
    "sources",
    lambda v: wf.geodesic_distances(small(), v),
    [
        (-1, ValueError, "sources must be at least 0"),
        (42, ValueError, "sources must be at least 0 and below 42, found 42"),
        (2**62, ValueError, "below 42"),
        (2**70, TypeError, "sources must hold integers"),
        ([], ValueError, "sources"),
        (np.zeros((0, 3)), ValueError, "sources must hold at least 1"),
        ("0", TypeError, "sources must hold integers"),
        (None, TypeError, "sources must hold integers"),
        (True, TypeError, "sources must hold integers"),
        ([[0, 1], [2]], ValueError, "sources must be one node, a list of nodes or"),
        ([[0.0, 0.0, np.nan]], ValueError, "sources must be finite"),
        ([[0.0, 0.0, 3.0]], ValueError, "sources must be points on the surface, but point 0 is 2 from"),
        ([0.0, 0.0, 1.0], ValueError, "sources must have shape"),
    ],
)
table(
    "time",
    lambda v: wf.geodesic_distances(small(), 0, v),
    [
        (0.0, ValueError, "t must be greater than 0"),
        (-1.0, ValueError, "t must be greater than 0"),
        (np.nan, ValueError, "t must be finite"),
        (1e-30, ValueError, "t must be from .* squared mean edges"),
        ("1", TypeError, "t must be a number"),
    ],
)
table("solver on", wf.HeatGeodesics, [("mesh.ply", TypeError, "surface_or_mesh must be")])

# ---------------------------------------------------------------------------- foams and networks

table(
    "cell of a foam",
    lambda v: rebuilt(cell=v),
    [(SPHERE, TypeError, "cell must be a HeleShawCell, got Sphere"), (None, TypeError, "cell must be")],
)
table("network of a foam", lambda v: rebuilt(network=v), [([], TypeError, "network must be a CellNetwork")])
bad("a sphere's network on a torus", wf.TopologyError, "Euler characteristic 2, its surface 0")(
    lambda: rebuilt(cell=wf.HeleShawCell(TORUS, 0.5))
)
table(
    "parts of a foam",
    lambda v: rebuilt(**v()),
    [
        (
            lambda: {"vertex_points": foam().vertex_points[:-1]},
            ValueError,
            "vertex_points must hold 36 points",
        ),
        (
            lambda: {"vertex_points": 2 * foam().vertex_points},
            ValueError,
            r"on the surface.*project them first",
        ),
        (
            lambda: {"vertex_points": changed(foam().vertex_points, 2, np.nan)},
            ValueError,
            "vertex_points must be finite",
        ),
        (lambda: {"film_offsets": np.zeros((3, 3))}, ValueError, r"film_offsets must have shape \(54, n\)"),
        (lambda: {"film_offsets": np.full((54, 3), np.nan)}, ValueError, "film_offsets must be finite"),
        (lambda: {"target_volumes": np.ones(19)}, ValueError, "target_volumes must have shape"),
        (
            lambda: {"target_volumes": np.ones(20)},
            ValueError,
            "target_volumes must add up to the cell's volume .*scale them by the ratio",
        ),
        (
            lambda: {"target_volumes": changed(foam().target_volumes, 7, -1.0)},
            ValueError,
            "target_volumes must be above 0, but bubble 7 has -1",
        ),
        (lambda: {"bubble_ids": np.zeros(20, int)}, ValueError, "bubble_ids must differ"),
        (lambda: {"bubble_ids": np.arange(20.0)}, TypeError, "bubble_ids must hold integers"),
        (lambda: {"bubble_ids": np.arange(20) - 1}, ValueError, "bubble_ids must be at least 0"),
        (lambda: {"pressures": np.zeros(3)}, ValueError, "pressures must have shape"),
        (lambda: {"pressures": np.full(20, np.inf)}, ValueError, "pressures must be finite"),
        (lambda: {"seed": -1}, ValueError, "seed must be at least 0"),
        (lambda: {"seed": 0.5}, TypeError, "seed must be an integer"),
    ],
)
table("tension", lambda v: rebuilt(tension=v), named("tension"))
table(
    "film_curves",
    lambda v: foam().film_curves(v),
    [(1, ValueError, "k must be at least 2"), (2.0, TypeError, "k must be an integer")],
)
table(
    "with_order",
    lambda v: foam().with_order(v),
    [
        (0, ValueError, "order must be at least 2"),
        (41, ValueError, "order must be at most 24"),
        (4.0, TypeError, "order must be an integer"),
    ],
)
table(
    "from_loops",
    lambda v: wf.Foam.from_loops(cell(), [[0, 0, 1], [1, 0, 0], [0, 1, 0]], v),
    [
        ([(0, 1, 2)], wf.TopologyError, "bubble on one side only"),
        ([], wf.TopologyError, "loops is empty"),
        ([(0, 1, 2), (0, 1, 2)], wf.TopologyError, "orient all counter-clockwise"),
        ([(0, 1, 3), (3, 1, 0)], wf.TopologyError, "vertex 2 has 0 films"),
    ],
)
bad("loops round the wrong way", ValueError, "counter-clockwise")(
    lambda: wf.Foam.from_loops(
        cell(),
        [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]],
        [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)],
    )
)
bad("network of too few half-films", wf.TopologyError, "an even number of half-films above 0")(
    lambda: wf.CellNetwork([0], [0], [0])
)
bad("network without a permutation", wf.TopologyError, "next must be a permutation")(
    lambda: wf.CellNetwork([0, 0], [0, 1], [0, 0])
)
table(
    "T1 of film",
    lambda v: wf.t1(foam(), v),
    [
        (-1, ValueError, "film must be at least 0 and below 54"),
        (54, ValueError, "film must be at least 0 and below 54, found 54"),
        (0.5, TypeError, "film must hold integers"),
        ("0", TypeError, "film must hold integers"),
        (None, TypeError, "film must hold integers"),
    ],
)
bad("T1 that leaves two sides", wf.TopologyError, "film 0 cannot turn: .* at least four sides")(
    lambda: wf.t1(
        wf.Foam.from_loops(
            cell(),
            [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]],
            [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)],
        ),
        0,
    )
)

# ---------------------------------------------------------------------------- relaxing and measuring

table(
    "relax",
    wf.relax,
    [
        (None, TypeError, "foam must be a Foam, got NoneType"),
        (cell(), TypeError, "foam must be a Foam, got HeleShawCell"),
        (np.zeros(3), TypeError, "foam must be a Foam, got ndarray"),
    ],
)
table(
    "relax with",
    lambda v: wf.relax(foam(), **v),
    [
        ({"order": 1}, ValueError, "order must be at least 2"),
        ({"order": 25}, ValueError, "order must be at most 24"),
        ({"order": 4.0}, TypeError, "order must be an integer"),
        ({"tolerance": 0.0}, ValueError, "tolerance must be at least 1e-13"),
        ({"tolerance": -1.0}, ValueError, "tolerance must be at least 1e-13"),
        ({"tolerance": np.nan}, ValueError, "tolerance must be finite"),
        ({"tolerance": "tight"}, TypeError, "tolerance must be a number"),
        ({"max_iterations": -1}, ValueError, "max_iterations must be at least 0"),
        ({"max_iterations": 1.5}, TypeError, "max_iterations must be an integer"),
        ({"t1": 1}, TypeError, "t1 must be True or False"),
        ({"t1": "yes"}, TypeError, "t1 must be True or False"),
        ({"solver": "cholmod"}, ValueError, "solver must be one of 'auto', 'superlu', 'pardiso'"),
        ({"solver": None}, TypeError, "solver must be one of"),
    ],
)
table("equilibrium_report", wf.equilibrium_report, [(None, TypeError, "foam must be a Foam, got NoneType")])
table(
    "side_distribution", wf.side_distribution, [([3, 4], TypeError, "foam must be a Foam or a CellNetwork")]
)

# ---------------------------------------------------------------------------- files and pictures

table(
    "load",
    wf.load,
    [
        ("no/such/foam.npz", FileNotFoundError, "cannot read no/such/foam.npz: there is no such file"),
        (".", wf.FileFormatError, "cannot read .: it is not a file"),
        (str(ROOT / "pyproject.toml"), wf.FileFormatError, "not an .npz archive"),
        (None, TypeError, "path must be a string or a pathlib.Path"),
        (3, TypeError, "path must be a string or a pathlib.Path"),
        ("", ValueError, "path must name a file"),
    ],
)
table(
    "save",
    lambda v: wf.save(v, foam()),
    [
        ("no/such/folder/foam.npz", FileNotFoundError, "there is no folder no/such/folder; make it first"),
        (".", IsADirectoryError, "it is a folder; add a file name"),
        (b"foam.npz", TypeError, "path must be a string"),
    ],
)
table(
    "save of",
    lambda v: wf.save("foam.npz", v),
    [(None, TypeError, "foam must be a Foam"), (SPHERE, TypeError, "foam must be a Foam")],
)
table(
    "write_ply",
    lambda v: wf.write_ply("no_such_folder/foam.ply", foam(), **v),
    [
        ({}, FileNotFoundError, "there is no folder no_such_folder"),
    ],
)
table(
    "write_ply with",
    lambda v: wf.write_ply("/tmp/foam.ply", foam(), **v),
    [
        ({"color_by": "mood"}, ValueError, "color_by must be one of 'charge', 'pressure', 'sides', 'area'"),
        ({"color_by": "pressure"}, ValueError, "needs pressures: relax the foam first"),
        ({"color_by": None}, TypeError, "color_by must be one of"),
        ({"curve_points": 1}, ValueError, "curve_points must be at least 2"),
        ({"curve_points": 9.0}, TypeError, "curve_points must be an integer"),
    ],
)
table("write_ply as", lambda v: wf.write_ply(v, foam()), [("foam.obj", ValueError, "must end in .ply")])
table("write_ply of", lambda v: wf.write_ply("/tmp/foam.ply", v), [(None, TypeError, "foam must be a Foam")])
table(
    "bubbles of", lambda v: wf.write_bubbles_csv("/tmp/b.csv", v), [(None, TypeError, "foam must be a Foam")]
)
table("films of", lambda v: wf.write_films_csv("/tmp/f.csv", v), [(None, TypeError, "foam must be a Foam")])
table(
    "record",
    lambda v: wf.write_record("/tmp/r.json", v),
    [
        ([1], TypeError, "record must be a mapping"),
        ({"energy": np.nan}, ValueError, r"record\['energy'\] is nan"),
        ({"x": object()}, TypeError, r"record\['x'\] is a object"),
        ({1: 2}, TypeError, "keys of record must be strings"),
    ],
)
table(
    "picture",
    lambda v: wf.plot_foam(foam(), **v),
    [
        ({"color_by": "mood"}, ValueError, "color_by must be one of"),
        ({"size": (0.1, 3.0)}, ValueError, "size must be at least 1 inch"),
        ({"title": 3}, TypeError, "title must be a string"),
        ({"view": "top"}, TypeError, "view must be"),
    ],
)
table("picture of", wf.plot_foam, [(None, TypeError, "foam must be a Foam")])
table("picture as", lambda v: wf.save_picture(v, foam()), [("foam.bmp", ValueError, r"\.png")])

# ---------------------------------------------------------------------------- options

table(
    "options",
    lambda v: options_from(v, "foam.toml"),
    [
        ({"foam": {"n_bubles": 3}}, ValueError, "unknown option foam.n_bubles; did you mean foam.n_bubbles"),
        ({"fom": {"n_bubbles": 3}}, ValueError, r"unknown section fom; did you mean foam\?"),
        ({"foam": 3}, ValueError, r"foam must be a section, \[foam\], got 3"),
        ({"foam": {"n_bubbles": 0}}, ValueError, "foam.n_bubbles must be at least 1"),
        ({"foam": {"n_bubbles": "200"}}, ValueError, "foam.n_bubbles must be an integer"),
        ({"foam": {"seeds": "hex"}}, ValueError, "foam.seeds must be one of"),
        ({"foam": {"lloyd": -1}}, ValueError, "foam.lloyd must be at least 0"),
        ({"surface": {"kind": "cube"}}, ValueError, "surface.kind must be one of"),
        (
            {"surface": {"kind": "sphere", "major_radius": 1.0}},
            ValueError,
            "unknown option surface.major_radius",
        ),
        ({"surface": {"minor_radius": 30.0}}, ValueError, "major_radius must exceed minor_radius"),
        ({"cell": {"gap": 16.5}}, ValueError, "folds the outer plate"),
        ({"cell": {"gap": -1}}, ValueError, "cell.gap must be greater than 0"),
        ({"relax": {"order": 1}}, ValueError, "relax.order must be at least 2"),
        ({"relax": {"t1": 1}}, ValueError, "relax.t1 must be True or False"),
        ({"relax": {"solver": "best"}}, ValueError, "relax.solver must be one of"),
        ({"output": {"color_by": "mood"}}, ValueError, "output.color_by must be one of"),
        ({"seed": -1}, ValueError, "seed must be at least 0"),
        ({"colour": "red"}, ValueError, "unknown option colour"),
    ],
)
table(
    "option file",
    read_options,
    [
        ("no_such_foam.toml", FileNotFoundError, "no_such_foam.toml"),
        (str(ROOT / "README.md"), ValueError, "is not a TOML file"),
    ],
)


# ---------------------------------------------------------------------------- the tests


def test_the_table_is_long_and_its_names_differ():
    assert len(BAD) >= 60
    assert len({row.name for row in BAD}) > 0.9 * len(BAD)


@pytest.mark.parametrize("row", BAD, ids=[row.name for row in BAD])
def test_bad_calls_say_what_is_wrong(row: Bad, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(row.fault, match=row.says) as caught:
        row.call()
    kinds = (ValueError, TypeError, OSError, wf.WarpedFoamError)
    assert type(caught.value) in {row.fault, *wf.WarpedFoamError.__subclasses__()}
    assert isinstance(caught.value, kinds)
    assert list(tmp_path.iterdir()) == []  # nothing half-written


SURVIVAL = """
import importlib.util, sys, warnings
warnings.simplefilter("error")
spec = importlib.util.spec_from_file_location("bad_input", sys.argv[1])
module = importlib.util.module_from_spec(spec)
sys.modules["bad_input"] = module
spec.loader.exec_module(module)
refused = 0
for row in module.BAD:
    try:
        row.call()
    except row.fault:
        refused += 1
relaxed = module.wf.relax(module.foam())
print(refused, len(module.BAD), relaxed.converged)
"""


def test_one_interpreter_survives_them_all_and_works_on(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SURVIVAL, __file__],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(wf.__file__).parents[1])},
        timeout=120,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.split() == [str(len(BAD)), str(len(BAD)), "True"]


# ---------------------------------------------------------------------------- found by attack, mended


@pytest.mark.parametrize("radius", [1e-200, 1e200])
def test_sizes_beyond_floating_point_are_refused_by_name(radius):
    with pytest.raises(ValueError, match="radius"):
        wf.voronoi_foam(wf.HeleShawCell(wf.Sphere(radius), gap=0.1 * radius), 20, seeds="lattice")


@pytest.mark.parametrize(
    "call",
    [
        lambda: wf.HeleShawCell(SPHERE, 0.1, n_heights=1000),
        lambda: wf.Foam.from_loops(cell(), np.eye(3), [(0, 1, 2), (2, 1, 0)], order=100),
    ],
    ids=["n_heights", "from_loops"],
)
def test_enormous_orders_are_refused(call):
    with pytest.raises(ValueError, match="must be at most"):
        call()


def test_bubbles_inside_out_are_refused_with_targets_too():
    corners, loops = (
        [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]],
        [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)],
    )
    with pytest.raises(ValueError, match="counter-clockwise"):
        wf.Foam.from_loops(cell(), corners, loops, target_volumes=np.full(4, cell().volume / 4))


def test_a_surface_covered_twice_is_refused():
    torus = wf.HeleShawCell(wf.Torus(3.0, 1.0), 0.1)
    one = wf.voronoi_foam(torus, 60, seeds="lattice", n_nodes=2000)
    net = one.network
    network = wf.CellNetwork(
        np.concatenate([net.next, net.next + len(net.next)]),
        np.concatenate([net.origin, net.origin + net.n_vertices]),
        np.concatenate([net.bubble, net.bubble + net.n_bubbles]),
    )
    places = np.concatenate([one.vertex_points, one.vertex_points])
    with pytest.raises(ValueError, match=r"twice|volume|pieces"):
        wf.Foam(torus, network, places, target_volumes=np.full(120, torus.volume / 120))


@pytest.mark.parametrize("surface", [wf.Sphere(1.0), wf.Torus(3.0, 1.0)], ids=["sphere", "torus"])
def test_a_film_without_length_is_reported_without_warnings(surface):
    start = wf.voronoi_foam(wf.HeleShawCell(surface, 0.1), 60, seeds="lattice", n_nodes=2000)
    places = changed(start.vertex_points, start.network.heads[0], start.vertex_points[start.network.tails[0]])
    crushed = wf.Foam(
        start.cell, start.network, places, start.film_offsets, target_volumes=start.target_volumes
    )
    assert wf.relax(crushed).message


def test_two_hemispheres_have_centres_and_tables(tmp_path):
    angle = 2 * np.pi * np.arange(3) / 3
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    halves = wf.Foam.from_loops(cell(), rim, [(0, 1, 2), (0, 2, 1)])
    np.testing.assert_allclose(halves.bubble_centres, [[0, 0, 1], [0, 0, -1]], atol=1e-9)
    wf.write_bubbles_csv(tmp_path / "bubbles.csv", halves)
