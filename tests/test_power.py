"""Power cells: volumes near those asked for, on every kind of surface, and what that saves."""

from __future__ import annotations

import numpy as np
import pytest

from warpedfoam import Ellipsoid, FlatTorus, HeleShawCell, Sphere, Torus, relax, voronoi_foam
from warpedfoam.tessellate import HeatGeodesics
from warpedfoam.tessellate.fields import seed_fields
from warpedfoam.tessellate.power import _rates, power_weights

CELLS = {
    "sphere": HeleShawCell(Sphere(1.0), 0.05),
    "torus": HeleShawCell(Torus(20.0, 4.0), 0.5),
    "ellipsoid": HeleShawCell(Ellipsoid(1.0, 1.2, 1.5), 0.05),
    "sheet": HeleShawCell(FlatTorus(20.0, 16.0), 0.5),
}
each_cell = pytest.mark.parametrize("cell", CELLS.values(), ids=CELLS)


def off(foam):
    return np.abs(foam.bubble_volumes / foam.target_volumes - 1.0)


@each_cell
@pytest.mark.parametrize("seeds", ["random", "blue"])
@pytest.mark.parametrize("width", [0.0, 0.3, 0.6])
def test_foams_start_near_their_volumes(cell, seeds, width):
    plain, power = (
        voronoi_foam(cell, 200, seeds=seeds, seed=3, volumes=width, cells=kind)
        for kind in ("voronoi", "power")
    )
    np.testing.assert_array_equal(plain.target_volumes, power.target_volumes)
    assert off(power).mean() < 0.1
    # random seeds are far from any volumes, blue ones near equal volumes
    if seeds == "random" or width > 0.2:
        assert off(power).mean() < 0.3 * off(plain).mean()


@pytest.mark.parametrize("name", ["sphere", "torus"])
def test_finer_meshes_come_nearer(name):
    found = [
        off(voronoi_foam(CELLS[name], 60, seeds="blue", seed=1, volumes=0.4, cells="power", n_nodes=n)).mean()
        for n in (1500, 6000, 24_000)
    ]
    assert found[2] < 0.5 * found[0]
    assert found[2] < 0.02


@each_cell
def test_it_saves_t1s_and_ends_in_a_minimum(cell):
    results = {
        kind: [relax(voronoi_foam(cell, 200, seed=s, volumes=0.4, cells=kind)) for s in (0, 1)]
        for kind in ("voronoi", "power")
    }
    assert all(r.converged and r.is_minimum for pair in results.values() for r in pair)
    assert sum(r.n_t1 for r in results["power"]) < 0.6 * sum(r.n_t1 for r in results["voronoi"])


def test_rates_are_those_of_the_cells():
    """Volumes gained by a small weight, against the Laplacian of the interfaces, on a fine mesh."""
    sheet = FlatTorus(10.0, 8.0)
    mesh = sheet.triangulate(60_000)
    seeds = voronoi_seeds(sheet)
    field = seed_fields(HeatGeodesics(mesh, mesh.mean_edge**2), seeds, 2.0)
    rates = _rates(field, field.labels(), seeds, 1.0).toarray()
    np.testing.assert_allclose(rates.sum(axis=0), 0.0, atol=1e-9)
    weight = np.zeros(len(seeds))
    weight[4] = 0.1
    held = [
        np.bincount(field.weighted(s * weight).labels(), mesh.node_areas, len(seeds)) for s in (-1.0, 1.0)
    ]
    gained = (held[1] - held[0]) / 0.2
    assert gained[4] == pytest.approx(rates[4, 4], rel=0.1)
    np.testing.assert_allclose(gained, rates[:, 4], atol=0.1 * rates[4, 4])


def voronoi_seeds(sheet):
    return sheet.lattice_points(20)


def test_weights_of_equal_volumes_on_a_lattice_do_nothing_much():
    sheet = FlatTorus(10.0, 10.0)
    mesh = sheet.triangulate(4000)
    i, j = np.meshgrid(np.arange(4), np.arange(4), indexing="ij")
    seeds = np.column_stack([2.5 * i.ravel() - 4, 2.5 * j.ravel() - 4, np.zeros(16)])
    field = seed_fields(HeatGeodesics(mesh, mesh.mean_edge**2), seeds, 2.5)
    weights = power_weights(field, seeds, mesh.node_areas, np.ones(16))
    assert np.abs(weights).max() < 0.1 * 2.5**2


def test_unknown_cells_are_refused():
    with pytest.raises(ValueError, match="cells must be one of 'voronoi', 'power'"):
        voronoi_foam(CELLS["sphere"], 20, cells="square")
    with pytest.raises(TypeError, match="cells must be one of"):
        voronoi_foam(CELLS["sphere"], 20, cells=1)
