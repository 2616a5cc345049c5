"""Compiled loops over jets against numpy's, which are the model; and that nothing needs numba."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from warpedfoam import Foam, HeleShawCell, MeshSurface, Sphere, Torus, voronoi_foam
from warpedfoam.foam import bubble_integrals
from warpedfoam.kernels import jets as kernel
from warpedfoam.kernels import jets_compiled
from warpedfoam.kernels.jets import blended, blended_fast, compiled_blend, fit_jets
from warpedfoam.surfaces import Layer, mesh_surface

TORUS = Torus(20.0, 4.0)


def jittered(surface, n_nodes, seed=0):
    mesh = surface.triangulate(n_nodes)
    push = np.random.default_rng(seed).uniform(-0.2, 0.2, mesh.nodes.shape)
    return MeshSurface(surface.project(mesh.nodes + mesh.mean_edge * push), mesh.triangles)


@pytest.fixture
def fast(monkeypatch):
    pytest.importorskip("numba")
    monkeypatch.setattr(kernel, "MANY", 100)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.usefixtures("fast")
def test_fits_are_those_of_numpy(seed, monkeypatch):
    mesh = jittered(TORUS, 1500, seed).source
    longest, spacing = mesh_surface._edge_sizes(mesh)
    near = mesh_surface._padded(mesh.nodes, mesh_surface._rings(mesh, 3), 48)
    asked = (mesh.nodes, mesh_surface.max_normals(mesh), spacing, longest, near)
    one = fit_jets(*asked)
    monkeypatch.setattr(kernel, "compiled", lambda: None)
    two = fit_jets(*asked)
    np.testing.assert_allclose(one.coefficients, two.coefficients, atol=1e-11)
    np.testing.assert_allclose(one.frames, two.frames, atol=1e-11)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.usefixtures("fast")
def test_levels_are_those_of_numpy_near_and_far(seed, monkeypatch):
    surface = jittered(TORUS, 1500, seed)
    jets, candidates, tree = surface._jets
    rng = np.random.default_rng(seed)
    spread = surface.source.mean_edge * np.repeat([0.05, 0.5, 3.0], 300)[:, None]
    x = surface.nodes[rng.integers(0, surface.source.n_nodes, 900)] + spread * rng.normal(size=(900, 3))
    nearest = np.asarray(tree.query(x)[1], dtype=np.int64)
    found = blended(jets, x, nearest, candidates, second=True)
    # steps to nearer nodes lead to the nearest one
    blend = compiled_blend(jets)
    assert blend is not None
    for near, count in ((candidates[nearest, 1], 600), (nearest, 900)):
        walked = blended_fast(blend, jets, x[:count], near[:count], candidates, True)
        for a, b in zip(walked, found, strict=True):
            np.testing.assert_array_equal(a, b[:count])
    monkeypatch.setattr(kernel, "compiled", lambda: None)
    model = blended(jets, x, nearest, candidates, second=True)
    # where only the edge of a ball reaches, weights of 1e-15 cost second derivatives digits
    for a, b, close in zip(found, model, (1e-12, 1e-11, 1e-8), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=close)
    # some points were out of every ball's reach
    assert (model[2] == 0.0).all(axis=(1, 2)).any()


@pytest.mark.usefixtures("fast")
def test_surfaces_and_foams_are_the_same_without_numba(monkeypatch):
    one = jittered(TORUS, 1500)
    foam = voronoi_foam(HeleShawCell(one, 0.5), 150, seed=2)
    monkeypatch.setattr(kernel, "compiled", lambda: None)
    two = jittered(TORUS, 1500)
    same = voronoi_foam(HeleShawCell(two, 0.5), 150, seed=2)
    assert one.area == pytest.approx(two.area, rel=1e-13)
    np.testing.assert_array_equal(foam.network.next, same.network.next)
    np.testing.assert_allclose(foam.vertex_points, same.vertex_points, atol=1e-9)
    np.testing.assert_allclose(foam.bubble_volumes, same.bubble_volumes, rtol=1e-9)


@pytest.mark.usefixtures("fast")
def test_fits_that_fail_say_so():
    points = np.random.default_rng(0).normal(size=(200, 3))
    points[7] = np.nan
    near = np.tile(np.arange(40), (200, 1))
    with pytest.raises(np.linalg.LinAlgError):
        fit_jets(points, np.tile([0.0, 0.0, 1.0], (200, 1)), np.ones(200), np.ones(200), near)


def test_numba_is_loaded_for_large_meshes_only():
    code = (
        "import sys, warpedfoam as wf; mesh = wf.Sphere(1.0).triangulate(600); "
        "wf.MeshSurface(mesh.nodes, mesh.triangles).area; sys.exit('numba' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_interpreted_loops_are_never_run(monkeypatch):
    numba = pytest.importorskip("numba")
    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)
    assert jets_compiled.compiled.__wrapped__() is None


def test_tables_of_neighbours_keep_the_nearest():
    mesh = jittered(Sphere(1.0), 800).source
    rings = mesh_surface._rings(mesh, 3)
    for most in (10, 36, 80):
        table = mesh_surface._padded(mesh.nodes, rings, most)
        for i in (0, 17, 555):
            row = rings.indices[rings.indptr[i] : rings.indptr[i + 1]]
            gap = np.linalg.norm(mesh.nodes[row] - mesh.nodes[i], axis=1)
            wanted = row[np.argsort(gap)[:most]]
            assert set(table[i][table[i] >= 0]) == set(wanted)


# ------------------------------------------------------------------------ quadrature over bubbles


@pytest.mark.usefixtures("fast")
def test_volumes_on_finer_meshes_converge_at_fourth_order(monkeypatch):
    """The fans' own error, against four times as many points: fixed numbers miss the curvatures' ripples."""
    base = voronoi_foam(HeleShawCell(TORUS, 0.5), 80, seeds="blue", seed=0)
    edges, errors, fixed = [], [], []
    for n_nodes in (1200, 4800):
        surface = jittered(TORUS, n_nodes)
        cell = HeleShawCell(surface, 0.5)
        targets = np.full(80, cell.volume / 80)
        foam = Foam(cell, base.network, surface.project(base.vertex_points), base.film_offsets, targets)
        rays = surface.least_rays(80)

        def volumes(count, cell=cell, foam=foam):
            layer = replace(cell.layer, rays=count)
            return bubble_integrals(cell, foam.network, foam.vertex_points, foam.film_offsets, layer)

        exact = volumes(3 * rays)
        errors.append(np.sqrt(((foam.bubble_volumes / exact - 1.0) ** 2).mean()))
        with monkeypatch.context() as patch:
            patch.setattr(MeshSurface, "least_rays", lambda self, n: 0)
            fixed.append(np.sqrt(((volumes(6) / exact - 1.0) ** 2).mean()))
        edges.append(surface.source.mean_edge)
    order = np.log(errors[0] / errors[1]) / np.log(edges[0] / edges[1])
    assert order > 3.5
    assert errors[1] < 0.5 * fixed[1]


def test_drafts_stay_drafts(monkeypatch):
    """Two rays are a draft whatever the mesh: the first steps of relaxing take them."""
    surface = jittered(TORUS, 1500)
    cell = HeleShawCell(surface, 0.5)
    foam = voronoi_foam(cell, 150, seed=2)
    asked = []
    original = MeshSurface.least_rays
    monkeypatch.setattr(MeshSurface, "least_rays", lambda self, n: asked.append(n) or original(self, n))
    ends = foam.vertex_points[foam.network.tails], foam.vertex_points[foam.network.heads]
    surface.loop_integrals(*ends, foam.film_offsets, foam.network.loops, replace(Layer.surface(), rays=2))
    assert not asked
    surface.loop_integrals(*ends, foam.film_offsets, foam.network.loops, Layer.surface())
    assert asked == [150]
