"""Surfaces as a careless user gives them: refused with a message that says what is wrong, or sound."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

BOX = [[-1.5] * 3, [1.5] * 3]
K = 2.0 * np.pi / 10.0
RING = wf.Torus(20.0, 4.0).triangulate(1000)
NODES, TRIANGLES = RING.nodes, RING.triangles
#: Points on a cylinder of radius 2, the last one beyond its rim.
OVER = [[2.0, 0.0, -2.0], [-2.0, 0.0, 0.0], [0.0, 2.0, 1.0], [0.0, -2.0, 3.0]]
TUBE, FLAT, UNIT = wf.Cylinder(1.0, 5.0, True), wf.FlatTorus(2.0, 2.0), wf.SchwarzP(2.0)


def ball(x):
    return (x**2).sum(axis=1) - 1.0


def ball_slope(x):
    return 2.0 * x


def hills(x):
    return np.cos(K * x).sum(axis=1)


def hills_slope(x):
    return -K * np.sin(K * x)


def egg(z):
    return 4.0 * (1.0 - z**2 / 9.0)


def egg_slope(z):
    return -8.0 * z / 9.0


def implicit(function=ball, gradient=ball_slope, box=BOX, hessian=None):
    return wf.Implicit(function, gradient, box, hessian=hessian)


def graph(function=hills, gradient=hills_slope, width=10.0, height=10.0, **more):
    return wf.Graph(function, gradient, width, height, periodic=True, **more)


def revolution(square=egg, slope=egg_slope, bottom=-3.0, top=3.0):
    return wf.Revolution(square, slope, bottom, top)


def foam(surface, n=None, **more):
    return wf.voronoi_foam(wf.HeleShawCell(surface, gap=0.02), n, **more)


@cache
def shaken(surface):
    return surface.random_points(60, rng=0)


def twice(x):
    """Two balls."""
    return ((np.abs(x) - [0.75, 0.0, 0.0]) ** 2).sum(axis=1) - 0.25


def twice_slope(x):
    return 2.0 * (np.abs(x) - [0.75, 0.0, 0.0]) * np.where(x < 0.0, -1.0, 1.0)


def roof(x):
    """|x|, repeating."""
    return 0.3 * np.abs((x[:, 0] + 5.0) % 10.0 - 5.0)


def roof_slope(x):
    return np.stack([0.3 * np.sign((x[:, 0] + 5.0) % 10.0 - 5.0), 0.0 * x[:, 0]], axis=1)


Row = tuple[str, Callable[[], object], type[Exception], str]
V, T, M, R = ValueError, TypeError, wf.MeshError, wf.ResolutionError
ROWS: list[Row] = [
    # functions in space
    ("an int", lambda: implicit(lambda x: 1), V, "function's values must have shape"),
    ("a column", lambda: implicit(lambda x: ball(x)[:, None]), V, "function's values must have shape"),
    ("one point only", lambda: implicit(lambda x: ball(x[:1])[0]), V, "function's values must have shape"),
    ("bools", lambda: implicit(lambda x: ball(x) < 0.0), T, "must hold real numbers, got bool"),
    ("complex", lambda: implicit(lambda x: ball(x) + 0j), T, "must hold real numbers, got complex"),
    ("nothing", lambda: implicit(lambda x: None), T, "must hold real numbers, got object"),
    (
        "NaN in places",
        lambda: implicit(lambda x: np.where(x[:, 0] > 0.5, np.nan, ball(x))),
        V,
        "function's values must be finite",
    ),
    (
        "NaN in the gradient",
        lambda: implicit(gradient=lambda x: np.where(x[:, :1] > 0.5, np.nan, 2.0 * x)),
        V,
        "gradient's values must be finite",
    ),
    ("turned gradient", lambda: implicit(gradient=lambda x: -2.0 * x), V, "gradient is not that of function"),
    ("no gradient", lambda: implicit(gradient=lambda x: 0.0 * x), V, "gradient is not that of function"),
    ("gradient by rows", lambda: implicit(gradient=lambda x: 2.0 * x.T), V, "gradient's values must have sh"),
    ("steps", lambda: implicit(lambda x: np.sign(ball(x))), V, "gradient is not that of function"),
    ("a square", lambda: implicit(lambda x: ball(x) ** 2), M, "does not change sign inside bounds"),
    ("two balls", lambda: implicit(twice, twice_slope).mesh, M, "2 separate components"),
    ("box that cuts", lambda: implicit(box=[[-1.5, -1.5, -0.5], [1.5] * 3]), M, "choose a larger box"),
    ("flat box", lambda: implicit(box=[[-1.5, -1.5, 0.0], [1.5, 1.5, 0.0]]), V, "with room between them"),
    ("Hessian's name", lambda: implicit(hessian="exact"), T, "hessian must be callable, got str"),
    (
        "one Hessian",
        lambda: wf.HeleShawCell(implicit(hessian=lambda x: np.eye(3)), 0.1),
        V,
        "hessian's values must have shape",
    ),
    # graphs and turned profiles
    ("periodic disk", lambda: graph(disk=True), V, "a disk is not periodic"),
    ("oval disk", lambda: wf.Graph(hills, hills_slope, 10.0, 9.0, disk=True), V, "both its diameter"),
    ("wrong period", lambda: graph(width=9.0), V, "function does not repeat after"),
    (
        "turned slope",
        lambda: graph(gradient=lambda x: -hills_slope(x)),
        V,
        "gradient is not that of function",
    ),
    ("a roof", lambda: graph(roof, roof_slope), V, "gradient is not that of function"),
    ("a scalar height", lambda: graph(lambda x: 0.0), V, "function's values must have shape"),
    ("no width", lambda: graph(width=0.0), V, "width must be greater than 0"),
    (
        "a graph that folds",
        lambda: wf.HeleShawCell(graph(), 5.0),
        V,
        "folds the outer plate: it must be less",
    ),
    ("poles swapped", lambda: revolution(bottom=3.0, top=-3.0), V, "top must lie above bottom"),
    ("profile below 0", lambda: revolution(lambda z: -egg(z)), V, "square must be above 0 between"),
    (
        "pointed poles",
        lambda: revolution(lambda z: egg(z) ** 2, lambda z: 2 * egg(z) * egg_slope(z)),
        V,
        "round",
    ),
    ("wrong slope", lambda: revolution(slope=lambda z: -egg_slope(z)), V, "slope is not the derivative"),
    # surfaces with formulas, seeds on them
    ("long catenoid", lambda: wf.Catenoid(1.0, 25.0), V, "height must be at most 20 neck radii"),
    ("no neck", lambda: wf.Catenoid(0.0, 5.0), V, "neck_radius must be"),
    ("word for periodic", lambda: wf.Cylinder(1.0, 5.0, periodic="no"), T, "periodic"),
    ("seed beyond a rim", lambda: foam(wf.Cylinder(2.0, 5.0), seeds=OVER), V, "is 0.5 off it"),
    ("tube, 3 bubbles", lambda: foam(TUBE, 3), R, "would not be disks"),
    ("NaN axis", lambda: wf.Ellipsoid(1.0, np.nan, 1.0), V, "b must be finite"),
    ("needle", lambda: wf.voronoi_foam(wf.HeleShawCell(wf.Ellipsoid(1.0, 1.0, 1e3), 1e-6), 60), R, "too few"),
    ("Schwarz folds", lambda: wf.HeleShawCell(UNIT, 1.0), V, "folds the outer plate: it must be less"),
    (
        "seeds off",
        lambda: foam(FLAT, seeds=np.add(shaken(FLAT), [0.0, 0.0, 0.1])),
        V,
        r"surface.project\(seeds\)",
    ),
    (
        "seeds on the axis",
        lambda: foam(TUBE, seeds=shaken(TUBE) * [0.0, 0.0, 1.0]),
        V,
        "no clear nearest point",
    ),
    (
        "a seed and its image",
        lambda: foam(FLAT, seeds=np.vstack([shaken(FLAT), np.add(shaken(FLAT)[:1], [2.0, 0.0, 0.0])])),
        V,
        "seeds 0 and 60 coincide",
    ),
    ("coarse mesh", lambda: foam(UNIT, 150, n_nodes=100), R, "use at least 900"),
    (
        "empty bubbles",
        lambda: foam(FLAT, 4, volumes=[0.08, 0.0, 0.0, 0.0], cells="power"),
        V,
        "must be above 0",
    ),
    ("too polydisperse", lambda: foam(FLAT, 60, volumes=50.0, cells="power"), V, "must be at most 1"),
    # meshes
    ("a hole", lambda: foam(wf.MeshSurface(NODES, TRIANGLES[1:]), 60), R, "close those that are damage"),
    (
        "a triangle turned",
        lambda: wf.MeshSurface(NODES, np.vstack([TRIANGLES[:1, ::-1], TRIANGLES[1:]])),
        M,
        "oriented against each other",
    ),
    ("counted from 1", lambda: wf.MeshSurface(NODES, TRIANGLES + 1), V, "triangles must be at least 0"),
    ("flattened", lambda: wf.MeshSurface(NODES * [1.0, 1.0, 1e-6], TRIANGLES), M, "no smooth surface passes"),
    ("far away", lambda: wf.MeshSurface(NODES + 1e9, TRIANGLES), M, "move it to the origin"),
    ("report of an array", lambda: wf.mesh_report(NODES), T, "mesh must be a TriangleMesh"),
    # geodesics
    ("no such method", lambda: wf.geodesic_report(RING, 0, method="Exact"), V, "one of 'heat', 'exact'"),
    (
        "t, exact",
        lambda: wf.geodesic_distances(RING, 0, 0.5, method="exact"),
        V,
        "t is for method='heat' only",
    ),
    ("radius", lambda: wf.geodesic_report(RING, 0, method="exact", radius=0), V, "radius must be greater"),
    ("source far off", lambda: wf.geodesic_report(RING, [[99.0, 0.0, 0.0]]), V, "project them first"),
    (
        "exact on a tube",
        lambda: wf.geodesic_distances(TUBE, [[1.0, 0.0, 0.0]], method="exact"),
        V,
        "half the period",
    ),
]


@pytest.mark.parametrize(("call", "fault", "says"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
def test_refused_with_a_message(call, fault, says):
    with pytest.raises(fault, match=says):
        call()


@pytest.mark.parametrize("surface", [implicit, revolution, graph], ids=["implicit", "revolution", "graph"])
def test_functions_cannot_be_saved(surface, tmp_path: Path):
    with pytest.raises(TypeError, match=r"cannot save surface\..*: it is a function"):
        wf.save(tmp_path / "foam.npz", foam(surface(), 60))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("surface", "chi"),
    [
        (lambda: implicit(lambda x: list(ball(x)), lambda x: ball_slope(x).tolist()), 2),
        (lambda: implicit(lambda x: -ball(x), lambda x: -ball_slope(x)), 2),  # inside out
        (lambda: implicit(box=[[-1.0] * 3, [1.0] * 3]), 2),
        (lambda: graph(lambda x: np.zeros(len(x), dtype=int), lambda x: np.zeros((len(x), 2), dtype=int)), 0),
        (lambda: graph(lambda x: 0.0 * x[:, 0] + 1e9, lambda x: 0.0 * x), 0),
    ],
    ids=["lists", "inside out", "box that touches", "ints", "high up"],
)
def test_odd_but_sound(surface, chi):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert foam(surface(), 60).network.charges.sum() == 6 * chi


def test_seeds_in_other_images_are_the_same_seeds():
    away = np.random.default_rng(0).integers(-3, 4, (60, 3)) * [2.0, 2.0, 0.0]
    here, there = (foam(FLAT, seeds=shaken(FLAT) + shift) for shift in (0.0, away))
    assert here.network.charges.tolist() == there.network.charges.tolist()
    assert np.allclose(here.target_volumes, there.target_volumes, rtol=1e-9)
