"""Bad calls on surfaces and cells, of `voronoi_foam`, on meshes."""

from __future__ import annotations

import numpy as np

import warpedfoam as wf

from .bad_calls import SPHERE, TORUS, bad, cell, changed, mesh_with, named, points, small, table

# ---------------------------------------------------------------------------- surfaces

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
