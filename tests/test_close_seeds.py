"""Seeds that nearly coincide: no region is shut in by another, none is empty, no mesh is refined for it."""

from __future__ import annotations

import numpy as np
import pytest

from warpedfoam import Ellipsoid, FlatTorus, HeleShawCell, Sphere, relax, voronoi_foam
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.tessellate import HeatGeodesics
from warpedfoam.tessellate.fields import seed_fields
from warpedfoam.tessellate.regions import _euler, opened_rings

SURFACES = {"sphere": Sphere(1.0), "egg": Ellipsoid(1.0, 1.2, 1.5), "sheet": FlatTorus(4.0, 3.0)}


def pairs(surface, count, apart, seed):
    """``count`` random seeds, each with a twin at a distance of about ``apart``."""
    rng = np.random.default_rng(seed)
    one = surface.random_points(count, rng)
    return np.concatenate([one, surface.project(one + apart * rng.standard_normal(one.shape))])


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
@pytest.mark.parametrize("apart", [1e-3, 1e-5])
@pytest.mark.parametrize("seed", range(4))
def test_twins_get_a_bubble_each(surface, apart, seed):
    seeds = pairs(surface, 100, apart, seed)
    foam = voronoi_foam(HeleShawCell(surface, 0.02), seeds=seeds, n_nodes=4800)
    assert foam.n_bubbles == 200
    assert foam.network.charges.sum() == 6 * surface.euler_characteristic


def test_a_shut_in_region_is_opened():
    """A region of one node inside another gets that one's nodes on its side."""
    mesh = Sphere(1.0).triangulate(1000)
    seeds = np.array([[0.0, 0.0, 1.0], [0.02, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    seeds /= np.linalg.norm(seeds, axis=1, keepdims=True)
    labels = np.linalg.norm(mesh.nodes[:, None] - seeds[[0, 2, 3, 4]], axis=2).argmin(axis=1)
    labels = np.array([0, 2, 3, 4])[labels]
    labels[np.linalg.norm(mesh.nodes - seeds[1], axis=1).argmin()] = 1
    assert _euler(mesh, labels, 5)[0] == 0
    opened = opened_rings(mesh, labels, seeds)
    assert (_euler(mesh, opened, 5)[:2] == 1).all()
    assert (opened[labels > 1] == labels[labels > 1]).all()
    assert (np.bincount(opened)[:2] > 20).all()


def test_twins_relax():
    foam = voronoi_foam(HeleShawCell(Sphere(1.0), 0.02), seeds=pairs(Sphere(1.0), 50, 1e-3, 1), n_nodes=4000)
    result = relax(foam)
    assert result.converged
    assert result.is_minimum


@pytest.mark.parametrize("surface", [Sphere(1.0), FlatTorus(4.0, 3.0)], ids=["sphere", "sheet"])
def test_no_distance_is_shorter_than_the_chord(surface):
    """Each entry of the coloured fields belongs to the seed that it names."""
    mesh = surface.triangulate(12_000)
    seeds = surface.random_points(500, 0)
    field = seed_fields(HeatGeodesics(mesh, mesh.mean_edge**2), seeds, np.sqrt(surface.area / 500))
    chord = np.linalg.norm(nearest_image(mesh.nodes[:, None] - seeds[field.seeds], surface.period), axis=2)
    found = np.sqrt(np.maximum(field.squares, 0.0))
    assert (found > chord - 2.0 * mesh.mean_edge).all()
