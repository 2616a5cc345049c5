"""Surfaces from formulas: derivatives, agreement with functions, files, and strangers' formulas."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import warpedfoam as wf
from warpedfoam.cli.app import app
from warpedfoam.cli.partition import surface_options
from warpedfoam.kernels.differences import differences
from warpedfoam.studies.options import options_from
from warpedfoam.surfaces.formula import DEEPEST, LONGEST

RING = "(sqrt(x**2 + y**2) - 2)**2 + z**2 - 1"
BOX = [[-3.5, -3.5, -1.5], [3.5, 3.5, 1.5]]


def ring() -> wf.Implicit:
    return wf.Implicit.from_formula(RING, BOX)


def hills(**more: bool) -> wf.Graph:
    return wf.Graph.from_formula("0.2*cos(2*pi*x/4) * sin(2*pi*y/4)", 4.0, 4.0, **more)


def vase() -> wf.Revolution:
    return wf.Revolution.from_formula("(1 + 0.2*sin(2*z))**2", -1.0, 1.5)


def egg() -> wf.Revolution:
    return wf.Revolution.from_formula("4*(1 - z**2/9)", -3.0, 3.0)


SURFACES = {
    "ring": ring,
    "hills": hills,
    "joined hills": lambda: hills(periodic=True),
    "round hill": lambda: hills(disk=True),
    "vase": vase,
    "egg": egg,
}


@pytest.mark.parametrize(
    ("text", "variables"),
    [
        ("x**3*y - exp(x*z)/(2 + cos(y)) + atan2(z, 3 + x)", "xyz"),
        ("sqrt(4 + x*y) + tanh(x) - hypot(x + 2, y)", "xy"),
        ("(2 + sin(3*z))**1.5 + z**2", "z"),
    ],
)
def test_derivatives_are_those_of_the_values(text: str, variables: str) -> None:
    f = wf.Formula(text, variables)
    x = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))
    keep = [k for k, name in enumerate("xyz") if name in variables]

    def at(p):
        return f(p[:, keep] if len(keep) > 1 else p[:, keep[0]])

    _, slope, bend = differences(at, x, 0.01, second=True)
    points = x[:, keep] if len(keep) > 1 else x[:, keep[0]]
    wanted = bend[:, keep][:, :, keep]
    np.testing.assert_allclose(f.gradient(points).reshape(20, -1), slope[:, keep], atol=1e-8)
    np.testing.assert_allclose(f.hessian(points).reshape(wanted.shape), wanted, atol=1e-6)


def test_a_formula_gives_the_surface_of_the_functions() -> None:
    k = 0.5 * np.pi
    plain = wf.Graph(
        lambda p: 0.2 * np.cos(k * p[:, 0]) * np.sin(k * p[:, 1]),
        lambda p: (
            0.2
            * k
            * np.stack(
                [-np.sin(k * p[:, 0]) * np.sin(k * p[:, 1]), np.cos(k * p[:, 0]) * np.cos(k * p[:, 1])],
                axis=1,
            )
        ),
        4.0,
        4.0,
        periodic=True,
    )
    x = plain.random_points(50, 0)
    told = hills(periodic=True)
    np.testing.assert_allclose(told.normals(x), plain.normals(x), atol=1e-12)
    np.testing.assert_allclose(told.principal_curvatures(x), plain.principal_curvatures(x), atol=1e-8)
    torus, other = wf.Torus(2.0, 1.0), ring()
    x = torus.random_points(50, 0)
    np.testing.assert_allclose(other.gaussian_curvature(x), torus.gaussian_curvature(x), rtol=1e-11)
    x = egg().random_points(50, 0)
    twin = wf.Ellipsoid(2.0, 2.0, 3.0)
    np.testing.assert_allclose(egg().principal_curvatures(x), twin.principal_curvatures(x), rtol=1e-10)


@pytest.mark.parametrize("name", ["ring", "joined hills", "round hill", "vase"])
def test_a_foam_on_it_comes_back_bit_for_bit(tmp_path: Path, name: str) -> None:
    cell = wf.HeleShawCell(SURFACES[name](), 0.1)
    foam = wf.voronoi_foam(cell, 30, seeds="blue", n_nodes=2000)
    copies = [wf.load(wf.save(tmp_path / "foam.npz", foam))]
    if name in ("ring", "vase"):
        wf.write_vtp(tmp_path / "foam.vtp", foam)
        copies.append(wf.read_vtp(tmp_path / "foam.vtp"))
        with wf.TrajectoryWriter(tmp_path / "foam.h5") as writer:
            writer.append(foam)
        with wf.Trajectory(tmp_path / "foam.h5") as frames:
            copies.append(frames[0])
    for again in copies:
        assert type(again.cell.surface) is type(cell.surface)
        np.testing.assert_array_equal(again.vertex_points, foam.vertex_points)
        np.testing.assert_array_equal(again.network.next, foam.network.next)
        np.testing.assert_array_equal(again.bubble_volumes, foam.bubble_volumes)
        assert again.energy == foam.energy


def rewritten(path: Path, surface: dict) -> Path:
    """A saved foam whose header names another surface."""
    with np.load(path) as archive:
        arrays = dict(archive)
    header = json.loads(arrays["header"].tobytes())
    header["surface"]["fields"].update(surface)
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    np.savez(path, **arrays)
    return path


def test_strangers_files_are_read_as_arithmetic_only(tmp_path: Path) -> None:
    foam = wf.voronoi_foam(wf.HeleShawCell(egg(), 0.1), 14, seed=1, n_nodes=800)
    for function, words in (
        ("__import__('os').system('touch harm')", "formula may hold"),
        ("-" * 1900 + "z", "cannot be read|deep"),
        ("9**9**9**9**9", "finite"),
        ("9" * 1500, "finite"),
        ("1 + " * 400 + "z", "deep"),
    ):
        path = wf.save(tmp_path / "foam.npz", foam)
        square = {"class": "Formula", "fields": {"text": function, "variables": "z"}}
        with pytest.raises(wf.FileFormatError, match=words):
            wf.load(rewritten(path, {"square": square}))
    for square in ("4*(1 - z**2/9)", {"class": "FormulaGap", "fields": {"formula": "4 - z**2"}}, None):
        with pytest.raises(wf.FileFormatError):
            wf.load(rewritten(wf.save(tmp_path / "foam.npz", foam), {"square": square}))
    assert not Path("harm").exists()


def test_from_the_shell(tmp_path: Path) -> None:
    words = ["foam", "revolution", "--formula", "4*(1 - z**2/9)", "--bottom", "-3", "--top", "3"]
    done = CliRunner().invoke(app, [*words, "-n", "14", "--gap", "0.1", "-o", str(tmp_path), "--quiet"])
    assert done.exit_code == 0, done.output
    foam = wf.load(tmp_path / "foam.npz")
    assert foam.cell.surface.square == wf.Formula("4*(1 - z**2/9)", "z")
    for kind, sizes, words in (
        ("implicit", {"bounds": "1 2 3"}, "bounds must be six numbers"),
        ("implicit", {"formula": "import os"}, "cannot be read"),
        ("graph", {"edge": "soft"}, "edge must be one of"),
        ("graph", {"formula": "z"}, "found 'z'"),
        ("revolution", {"bottom": 30.0}, "top must lie above bottom"),
    ):
        with pytest.raises(ValueError, match=words):
            _ = options_from({"surface": {"kind": kind, **sizes}}, "here").plates
    given = surface_options("graph", ["formula=x*y/9", "width=6", "height=6", "edge=disk"])
    assert given.build().disk


def test_refusals() -> None:
    for text, variables, words in (
        ("x + z", "xy", "formula may hold x, y, pi.*found 'z'"),
        ("x" * (LONGEST + 1), "xyz", "at most 2000"),
        ("+".join("x" * (DEEPEST + 1)), "xyz", "nests more than 300 deep"),
        ("x", "xw", "variables must be one of"),
        ("", "xyz", "cannot be read"),
        ("x.real", "xyz", "found 'x.real'"),
        ("(lambda: x)()", "xyz", "found"),
    ):
        with pytest.raises(ValueError, match=words):
            wf.Formula(text, variables)
    assert wf.Formula("+".join("x" * DEEPEST))(np.ones((1, 3)))[0] == DEEPEST
    with pytest.raises(TypeError, match="formula must be a string, got int"):
        wf.Formula(3)
    with pytest.raises(TypeError, match="gradient must be callable, got NoneType"):
        wf.Implicit(lambda x: x[:, 0], None, BOX)
    with pytest.raises(TypeError, match="gradient must be callable, got NoneType"):
        wf.Graph(lambda x: x[:, 0], None, 1.0, 1.0)
    with pytest.raises(TypeError, match="slope must be callable, got NoneType"):
        wf.Revolution(lambda z: 1.0 + z**2, None, 0.0, 1.0)
    with pytest.raises(ValueError, match="formula of x, y and z"):
        wf.Implicit(wf.Formula("x", "xy"), None, BOX)
    with pytest.raises(ValueError, match="formula of x and y"):
        wf.Graph(wf.Formula("x"), None, 1.0, 1.0)
    with pytest.raises(ValueError, match="formula of z"):
        wf.Revolution(wf.Formula("x"), None, 0.0, 1.0)
    with pytest.raises(ValueError, match="does not repeat"):
        wf.Graph.from_formula("x", 1.0, 1.0, periodic=True)
    with pytest.raises(ValueError, match="values must be finite"):
        wf.Graph.from_formula("log(x)", 1.0, 1.0)
    with pytest.raises(wf.MeshError, match="change sign"):
        wf.Implicit.from_formula("x**2 + 1", BOX)
