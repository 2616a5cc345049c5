"""The mesh files in data/ are what their script makes, of the right topology, and carry foams."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import trimesh

import warpedfoam as wf

DATA = Path(__file__).parents[1] / "data"
EULER = {"torus.ply": 0, "sphere.ply": 2, "double_torus.ply": -2}


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_meshes", DATA / "make_meshes.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def load(path: Path) -> trimesh.Trimesh:
    mesh = trimesh.load(path, process=False)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def test_every_file_is_tested(script: ModuleType) -> None:
    assert {p.name for p in DATA.glob("*.ply")} == {*EULER, "junction.ply"}
    assert set(EULER) == set(script.SURFACES)


@pytest.mark.parametrize("name", [*EULER, "junction.ply"])
def test_files_are_what_the_script_makes(script: ModuleType, name: str, tmp_path: Path) -> None:
    made = {p.name: p for p in script.main(tmp_path)}[name]
    stored, fresh = load(DATA / name), load(made)
    np.testing.assert_array_equal(stored.faces, fresh.faces)
    np.testing.assert_allclose(stored.vertices, fresh.vertices, rtol=0.0, atol=1e-6 * stored.scale)


@pytest.mark.parametrize("name", EULER)
def test_files_are_closed_surfaces(script: ModuleType, name: str) -> None:
    path = DATA / name
    assert path.stat().st_size < 200_000
    mesh = wf.TriangleMesh.from_trimesh(load(path))
    mesh.require_surface(closed=True)
    assert mesh.euler_characteristic == EULER[name]
    surface = script.SURFACES[name]
    off = np.linalg.norm(surface.project(mesh.nodes) - mesh.nodes, axis=1).max()
    assert off < 1e-6 * surface.size  # single precision
    assert load(path).volume > 0.0  # triangles counter-clockwise seen from outside
    assert mesh.area == pytest.approx(surface.area, rel=0.01)


def test_the_junction_ends_in_three_rims_and_carries_a_foam(script: ModuleType) -> None:
    surface = wf.MeshSurface.from_file(DATA / "junction.ply")
    assert (surface.euler_characteristic, surface.rim.n_loops) == (-1, 3)
    assert all(len(sides) == 1 for sides in surface.rim_loops())  # no corners
    for k in range(3):
        u = np.linspace(0.0, surface.rim.lengths[k], 50)
        points = surface.rim.at(np.full(50, k), u)
        # each rim lies in the plane of its cut, and the surface on the function's
        cut = script.AXES @ points.mean(axis=0)
        np.testing.assert_allclose(points @ script.AXES[cut.argmax()], script.LONG, atol=2e-3)
        assert np.abs(script.three_tubes(points)).max() < 2e-3
    start = wf.voronoi_foam(wf.HeleShawCell(surface, gap=0.3), 120, seeds="blue", seed=0)
    result = wf.relax(start)
    assert result.converged
    assert result.is_minimum
    assert result.foam.network.charges.sum() == -6
    total = result.foam.bubble_curvatures.sum() + result.foam.wall_turning.sum()
    assert total == pytest.approx(-2 * np.pi, abs=1e-2)


def test_the_double_torus_carries_a_foam(script: ModuleType) -> None:
    """Genus 2, from the file: Σ q = −12; its surface is that of the function to the mesh's accuracy."""
    surface = wf.MeshSurface.from_file(DATA / "double_torus.ply")
    exact = script.SURFACES["double_torus.ply"]
    assert surface.area == pytest.approx(exact.area, rel=2e-4)
    result = wf.relax(wf.voronoi_foam(wf.HeleShawCell(surface, gap=0.3), 150, seeds="blue", seed=0))
    assert result.converged
    assert result.is_minimum
    assert result.foam.network.charges.sum() == -12
    assert result.foam.bubble_curvatures.sum() == pytest.approx(-4 * np.pi, abs=1e-2)
