"""Seeds: distances kept, areas served evenly, the user's own checked; and their colours."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist, pdist, squareform

from warpedfoam.kernels.thinning import accepted
from warpedfoam.surfaces import Sphere, Torus
from warpedfoam.tessellate.colouring import colour_graph, colour_seeds
from warpedfoam.tessellate.seeds import (
    blue_noise_seeds,
    check_seeds,
    lattice_seeds,
    random_seeds,
)

SPHERE = Sphere(radius=1.0)
TORUS = Torus(major_radius=20.0, minor_radius=4.0)
SURFACES = [SPHERE, TORUS]
MAKERS = [random_seeds, blue_noise_seeds]


def spacing(surface, n):
    return np.sqrt(surface.area / n)


# ---------------------------------------------------------------------------- making seeds


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("n", [1, 2, 3, 7, 200, 3000])
@pytest.mark.parametrize("make", [*MAKERS, lambda surface, n, rng: lattice_seeds(surface, n)])
def test_as_many_distinct_points_on_the_surface_as_asked(make, n, surface):
    seeds = make(surface, n, 5)
    assert seeds.shape == (n, 3)
    np.testing.assert_array_equal(check_seeds(surface, seeds), surface.project(seeds))


@pytest.mark.parametrize("make", MAKERS)
def test_the_generator_decides(make):
    first = make(TORUS, 50, 7)
    np.testing.assert_array_equal(first, make(TORUS, 50, np.random.default_rng(7)))
    assert not np.array_equal(first, make(TORUS, 50, 8))
    np.testing.assert_allclose(make(Sphere(radius=3.0), 50, 7), 3.0 * make(SPHERE, 50, 7), rtol=1e-14)


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("n", [50, 500, 5000])
def test_blue_noise_keeps_its_distance_and_leaves_no_gap(surface, n):
    seeds = blue_noise_seeds(surface, n, 0)
    tree = cKDTree(seeds)
    nearest = tree.query(seeds, k=2)[0][:, 1]
    assert nearest.min() > 0.68 * spacing(surface, n)
    holes = tree.query(surface.random_points(20 * n, 1))[0]
    assert holes.max() < 1.5 * spacing(surface, n)  # random seeds leave 2 to 3


def test_blue_noise_serves_equal_areas_evenly():
    """The number of seeds in a hemisphere varies far less than the binomial √n/2."""
    n = 400
    upper = [int((blue_noise_seeds(SPHERE, n, k)[:, 2] > 0).sum()) for k in range(30)]
    assert np.mean(upper) == pytest.approx(n / 2, abs=3)
    assert np.std(upper) < 0.5 * np.sqrt(n) / 2


def test_random_seeds_are_uniform_by_area():
    seeds = random_seeds(TORUS, 40_000, 0)
    outer = np.hypot(seeds[:, 0], seeds[:, 1]) > 20.0
    share = 0.5 + 4.0 / (np.pi * 20.0)
    assert outer.mean() == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / 40_000))


@given(st.integers(2, 40), st.floats(0.0, 0.6), st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_darts_in_rounds_are_darts_one_after_another(n, density, seed):
    rng = np.random.default_rng(seed)
    close = np.triu(rng.random((n, n)) < density, 1)
    taken: list[int] = []
    for dart in range(n):
        if not close[taken, dart].any():
            taken.append(dart)
    np.testing.assert_array_equal(np.flatnonzero(accepted(n, np.array(np.nonzero(close)))), taken)


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize(
    ("n", "rng", "fault", "message"),
    [
        (0, 0, ValueError, "n must be at least 1"),
        (-3, 0, ValueError, "n must be at least 1"),
        (2.0, 0, TypeError, "n must be an integer"),
        (True, 0, TypeError, "n must be an integer"),
        (5, -1, ValueError, "rng must be at least 0"),
        (5, None, TypeError, "rng must be an integer"),
        (5, np.random, TypeError, "rng must be an integer"),
    ],
)
def test_bad_numbers_of_seeds(make, n, rng, fault, message):
    with pytest.raises(fault, match=message):
        make(SPHERE, n, rng)


def test_bad_number_of_lattice_seeds():
    with pytest.raises(ValueError, match="n must be at least 1"):
        lattice_seeds(SPHERE, 0)


# ---------------------------------------------------------------------------- the user's seeds


def test_nearly_projected_seeds_are_projected():
    seeds = random_seeds(TORUS, 30, 0)
    moved = seeds + 1e-7 * TORUS.size * np.random.default_rng(1).uniform(-1, 1, seeds.shape)
    checked = check_seeds(TORUS, moved)
    np.testing.assert_array_equal(checked, TORUS.project(moved))
    phi, theta = TORUS.angles(checked)
    np.testing.assert_allclose(checked, TORUS.points(phi, theta), atol=1e-13)


GOOD = random_seeds(SPHERE, 6, 0)


def replaced(k, value):
    out = GOOD.copy()
    out[k] = value
    return out


@pytest.mark.parametrize(
    ("seeds", "fault", "message"),
    [
        (
            replaced(4, 1.001 * GOOD[4]),
            ValueError,
            r"seed 4 is 0\.001 off it; project them with surface\.project",
        ),
        (replaced(3, GOOD[1]), ValueError, "seeds 1 and 3 coincide"),
        (replaced(5, GOOD[0] + 1e-11), ValueError, "seeds 0 and 5 coincide"),
        (replaced(2, np.nan), ValueError, "seeds must be finite"),
        (replaced(2, np.inf), ValueError, "seeds must be finite"),
        (replaced(2, 0.0), ValueError, "centre"),
        (np.zeros((0, 3)), ValueError, "seeds must hold at least 1"),
        (GOOD[0], ValueError, "seeds must have shape"),
        (GOOD[:, :2], ValueError, "seeds must have shape"),
        ("abc", TypeError, "seeds must hold real numbers"),
        (GOOD > 0, TypeError, "seeds must hold real numbers"),
        (7, TypeError, "shape|real"),
    ],
)
def test_bad_seeds(seeds, fault, message):
    with pytest.raises((fault, ValueError), match=message):
        check_seeds(SPHERE, seeds)


# ---------------------------------------------------------------------------- colours


def closest_of_one_colour(points, colours):
    gaps = squareform(pdist(points))
    gaps[colours[:, None] != colours] = np.inf
    np.fill_diagonal(gaps, np.inf)
    return gaps.min()


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("reach", [0.5, 2.0, 5.0])
def test_equal_colours_are_far_apart(surface, make, reach):
    seeds = make(surface, 700, 3)
    radius = reach * spacing(surface, 700)
    colours = colour_seeds(seeds, radius)
    assert closest_of_one_colour(seeds, colours) > radius
    np.testing.assert_array_equal(np.unique(colours), np.arange(colours.max() + 1))
    gaps = cdist(seeds, seeds)
    assert colours.max() + 1 <= (gaps <= radius).sum(axis=1).max()
    crowd = np.flatnonzero(gaps[0] < radius / 2)  # all within the radius of one another
    assert len(np.unique(colours[crowd])) == len(crowd)
    np.testing.assert_array_equal(colours, colour_seeds(seeds, radius))


@pytest.mark.parametrize(("reach", "most"), [(4.0, 29), (5.0, 43), (6.0, 60)])
def test_the_number_of_colours_does_not_grow_with_the_number_of_seeds(reach, most):
    counts = [
        int(colour_seeds(blue_noise_seeds(SPHERE, n, 1), reach * spacing(SPHERE, n)).max()) + 1
        for n in (500, 4000)
    ]
    assert max(counts) <= most
    assert abs(counts[1] - counts[0]) <= 3


def test_a_point_at_the_radius_exactly_gets_another_colour():
    line = np.arange(4.0)[:, None] * [1.0, 0.0, 0.0]
    assert len(np.unique(colour_seeds(line, 1.0))) == 2
    assert len(np.unique(colour_seeds(line, 0.999))) == 1


@pytest.mark.parametrize("n", [1, 2, 63, 64, 65, 150])
def test_all_close_take_a_colour_each(n):
    seeds = random_seeds(SPHERE, n, 0)
    np.testing.assert_array_equal(np.sort(colour_seeds(seeds, 2.1)), np.arange(n))
    assert (colour_seeds(seeds, 1e-9) == 0).all()


def test_coinciding_points_differ():
    assert sorted(colour_seeds(np.zeros((3, 3)), 1.0)) == [0, 1, 2]


@given(st.integers(1, 60), st.floats(0.0, 1.0), st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_any_graph_is_coloured_properly(n, density, seed):
    close = np.triu(np.random.default_rng(seed).random((n, n)) < density, 1)
    close |= close.T
    tail, head = np.nonzero(close)
    colours = colour_graph(np.searchsorted(tail, np.arange(n + 1)), head)
    assert (colours >= 0).all()
    assert (colours[tail] != colours[head]).all()
    assert colours.max() <= close.sum(axis=1).max()


@pytest.mark.parametrize(
    ("points", "radius", "fault", "message"),
    [
        (np.zeros((0, 3)), 1.0, ValueError, "points must hold at least 1"),
        (np.zeros((4, 2)), 1.0, ValueError, "points must have shape"),
        (np.full((4, 3), np.nan), 1.0, ValueError, "points must be finite"),
        (np.zeros((4, 3)), 0.0, ValueError, "radius must be greater than 0"),
        (np.zeros((4, 3)), np.nan, ValueError, "radius must be finite"),
        (np.zeros((4, 3)), "1", TypeError, "radius must be a number"),
    ],
)
def test_bad_colour_arguments(points, radius, fault, message):
    with pytest.raises(fault, match=message):
        colour_seeds(points, radius)
