"""Bad calls on foams and networks, of `relax` and measurements, on files, pictures and options."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import warpedfoam as wf
from warpedfoam.studies.options import options_from, read_options

from .bad_calls import SPHERE, TORUS, bad, cell, changed, foam, named, rebuilt, table

ROOT = Path(__file__).parents[1]

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
