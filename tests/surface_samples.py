"""Surfaces, layers and foams on them that the tests of geometry share."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from warpedfoam import Foam, HeleShawCell, Sphere, Torus, voronoi_foam
from warpedfoam.surfaces import Layer

#: Every surface class that integrates in closed form and the ones of its kind that are put to the test;
#: those of `LevelSurface` are in level_samples.py.
EXAMPLES = {
    Sphere: [Sphere(1.0), Sphere(7.5)],
    Torus: [Torus(20.0, 4.0), Torus(3.0, 1.2), Torus(1.3, 1.0), Torus(0.03, 0.01)],
}
SURFACES = [surface for kind in EXAMPLES.values() for surface in kind]
LAYERS = {
    "surface": Layer.surface(),
    "curvature": Layer.curvature(),
    "gap": Layer.between_plates(0.3),
    "gap, 5 heights": Layer.between_plates(0.7, 5),
}

each_surface = pytest.mark.parametrize("surface", SURFACES, ids=repr)
each_layer = pytest.mark.parametrize("layer", LAYERS.values(), ids=LAYERS)


def scale_of(surface):
    """A length over which the surface curves."""
    return 1.0 / max(abs(k) for k in surface.curvature_range())


def samples(surface, count=60, seed=0):
    return surface.random_points(count, seed)


@cache
def foam_on(surface, order=5, n_heights=2):
    """About a hundred bubbles on the surface, films bent at random, a gap of 0.3 curvature radii."""
    cell = HeleShawCell(surface, gap=0.3 * scale_of(surface), n_heights=n_heights)
    foam = voronoi_foam(cell, 90, seeds="blue", seed=1, order=order)
    rng = np.random.default_rng(2)
    return Foam(cell, foam.network, foam.vertex_points, rng.uniform(-0.03, 0.03, foam.film_offsets.shape))
