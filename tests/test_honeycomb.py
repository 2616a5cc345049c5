"""The honeycomb bound: reached by the honeycomb, below every way to mix sizes, close for foams on tori."""

from __future__ import annotations

import numpy as np
import pytest

from warpedfoam.analysis import honeycomb_bound

from .io_foams import sphere_foam, torus_foam


def test_the_honeycomb_reaches_it():
    side = 0.7
    hexagon = 1.5 * 3**0.5 * side**2
    assert honeycomb_bound(np.full(50, hexagon)) == pytest.approx(50 * 3 * side, rel=1e-14)


def test_it_is_the_best_of_hales_bounds():
    areas = np.random.default_rng(0).lognormal(sigma=0.7, size=60)
    sizes = np.geomspace(0.5 * areas.min(), 2.0 * areas.max(), 20_000)
    each = 12**0.25 * np.minimum(areas, sizes[:, None]).sum(axis=1) / np.sqrt(sizes)
    assert (each <= honeycomb_bound(areas) * (1 + 1e-14)).all()
    assert each.max() == pytest.approx(honeycomb_bound(areas), rel=1e-3)


def test_it_lies_below_honeycombs_sorted_by_size():
    """Two honeycombs side by side, however far their sizes are apart."""
    for ratio in (1.0, 1.5, 3.0, 100.0):
        areas = np.repeat([1.0, ratio], 40)
        sorted_length = 12**0.25 * np.sqrt(areas).sum()
        assert honeycomb_bound(areas) <= sorted_length * (1 + 1e-14)
    assert honeycomb_bound(areas) > 0.89 * sorted_length


def test_units_and_order_do_not_matter():
    areas = np.random.default_rng(1).uniform(0.5, 2.0, 30)
    assert honeycomb_bound(9.0 * areas[::-1]) == pytest.approx(3.0 * honeycomb_bound(areas), rel=1e-14)


@pytest.mark.parametrize("foam", [torus_foam(8, 24), sphere_foam(60)], ids=["torus", "sphere"])
def test_foams_are_longer(foam):
    assert 1.0 < foam.film_lengths.sum() / honeycomb_bound(foam.bubble_areas) < 1.6


@pytest.mark.parametrize("areas", [[], [1.0, 0.0], [-1.0], [[1.0]], [np.nan], ["a"], 3.0])
def test_areas_that_are_none(areas):
    with pytest.raises((ValueError, TypeError), match="areas must"):
        honeycomb_bound(areas)
