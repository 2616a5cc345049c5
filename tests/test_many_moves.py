"""Many moves at once: regions that add up, far apart, kept or undone one by one; crystals of warm points."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.kernels.periodic import nearest_image
from warpedfoam.moves.t1 import t1_sites
from warpedfoam.studies import warm_points
from warpedfoam.studies.checkpoint import fingerprint
from warpedfoam.studies.foam_moves import candidates, turnable
from warpedfoam.studies.many_moves import APART, many_moves, middles, region_changes, scattered
from warpedfoam.studies.thomson import riesz_energy

SPHERE = wf.HeleShawCell(wf.Sphere(1.0), gap=1e-6)
FLAT = wf.HeleShawCell(wf.FlatTorus(3.0, 4.0), gap=1e-3)
LARGE: dict[str, Any] = {"moves": ("glide", "wander"), "sites": 50}


@pytest.fixture(scope="module", params=[SPHERE, FLAT], ids=["sphere", "flat"])
def foam(request: pytest.FixtureRequest) -> wf.Foam:
    return wf.relax(wf.voronoi_foam(request.param, 120, seed=2, order=3)).foam


def test_regions_add_up_to_the_whole_change(foam: wf.Foam) -> None:
    films = np.flatnonzero(turnable(foam.network))[[0, 40, 80]]
    other = foam
    for film in films:
        other = wf.moves.t1(other, int(film)) if turnable(other.network)[film] else other
    after = wf.relax(other).foam
    places = foam.vertex_points[::30]
    change = region_changes(foam, after, places)
    assert change.shape == (len(places),)
    assert change.sum() == pytest.approx(after.energy - foam.energy, rel=1e-9)
    assert (change != 0.0).all()
    np.testing.assert_array_equal(region_changes(foam, foam, places), 0.0)


def test_scattered_points_are_apart_and_none_is_missing(foam: wf.Foam) -> None:
    points, period = middles(foam), foam.cell.surface.period
    apart = 4.0 * foam.bubble_size
    chosen = scattered(points, period, apart, np.random.default_rng(0))
    d = np.linalg.norm(nearest_image(points[:, None] - points[chosen], period), axis=2)
    among = d[chosen] + 9.0 * np.eye(len(chosen))
    assert among.min() > apart
    assert (d.min(axis=1) <= apart).all(), "there was room for another one"
    assert len(scattered(points[:1], period, apart, np.random.default_rng(0))) == 1


def test_wandering_begins_at_charges(foam: wf.Foam) -> None:
    network = foam.network
    near = candidates(network, "wander")
    four = t1_sites(network, np.arange(network.n_films)).bubbles
    charged = (network.charges[four] != 0).any(axis=1)
    np.testing.assert_array_equal(near, turnable(network) & charged)
    assert (candidates(network, "glide") <= near | ~charged).all()


def test_only_good_moves_are_kept(foam: wf.Foam) -> None:
    unit = foam.tension * foam.cell.layer.shares.sum() * foam.bubble_size
    tried = taken = partly = lower = 0
    for k in range(6):
        found = many_moves(foam, "wander", np.random.default_rng(k), 50, 0.0, unit, 3)
        tried, taken = tried + found.tried, taken + found.taken
        if found.result is None:
            continue
        assert found.allowance == 0.0
        assert 0 < found.taken <= found.tried
        partly += found.taken < found.tried
        assert found.rise is not None
        assert found.result.converged
        np.testing.assert_allclose(found.result.foam.bubble_volumes, foam.target_volumes, rtol=1e-9)
        # regions are judged one by one, and what is kept is no higher than all together
        lower += found.result.energy < foam.energy
        assert found.result.energy <= foam.energy + found.rise + 1e-12 * foam.energy
    assert tried > 10
    assert lower >= 3
    assert taken > 0
    assert partly > 0


def test_nothing_to_do_in_a_honeycomb() -> None:
    cell = wf.HeleShawCell(wf.FlatTorus(4.0, 2.0 * np.sqrt(3.0)), gap=1e-3)
    comb = wf.minimal_partition(cell.surface, 16, starts=1, hops=10, order=3).foam
    found = many_moves(comb, "wander", np.random.default_rng(0), 5, 1.0, comb.energy, 3)
    assert (found.result, found.tried, found.taken) == (None, 0, 0)
    walk = wf.anneal(comb, steps=3, seed=0, **LARGE)
    assert walk.energy == walk.start_energy
    assert not walk.history.accepted.any()


def test_walks_fall_and_tell_what_they_did(foam: wf.Foam) -> None:
    cold = wf.anneal(foam, steps=5, temperature=0.0, seed=1, **LARGE)
    h = cold.history
    assert (np.diff(np.concatenate([[cold.start_energy], h.energy])) <= 1e-9 * cold.energy).all()
    assert cold.energy < cold.start_energy
    assert (h.taken <= h.tried).all()
    assert (h.taken[~h.accepted] == 0).all()
    assert (h.taken[h.accepted] > 0).all()
    assert h.tried.max() > 1
    # six bubble sizes apart, so there is room for so many only
    most = foam.cell.surface.area / (np.pi * (0.5 * APART * foam.bubble_size) ** 2)
    assert h.tried.max() <= most
    one = wf.anneal(foam, steps=5, seed=1)
    assert (one.history.tried == 1).all()


def test_interrupted_walks_end_the_same(foam: wf.Foam, tmp_path: Path) -> None:
    options: dict[str, Any] = {"steps": 4, "seed": 4, "temperature": 0.05, **LARGE}
    whole = wf.anneal(foam, **options)

    def stop(_: str, fraction: float) -> None:
        if fraction > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        wf.anneal(foam, **options, folder=tmp_path, progress=stop)
    again = wf.anneal(foam, **options, folder=tmp_path)
    assert fingerprint(again.last) == fingerprint(whole.last)
    np.testing.assert_array_equal(again.history.taken, whole.history.taken)
    with pytest.raises(ValueError, match="sites differs"):
        wf.anneal(foam, **{**options, "sites": 2}, folder=tmp_path)
    with pytest.raises(ValueError, match="sites"):
        wf.anneal(foam, sites=0)


SURFACES = {
    "sphere": wf.Sphere(2.0),
    "torus": wf.Torus(3.0, 1.0),
    "flat": wf.FlatTorus(2.0, 3.0),
    "schwarz": wf.SchwarzP(2.0),
}


@pytest.mark.parametrize("name", SURFACES)
def test_warm_points_stay_on_their_surface_and_spread(name: str) -> None:
    surface = SURFACES[name]
    found = wf.anneal_points(surface, 60, seed=3, steps=250)
    np.testing.assert_allclose(surface.project(found.points), found.points, atol=1e-9 * surface.size)
    first, _ = riesz_energy(surface.random_points(60, 3), 3.0, surface.period)
    assert found.energy < first
    assert found.energy == riesz_energy(found.points, 3.0, surface.period)[0]
    again = wf.anneal_points(surface, 60, seed=3, steps=250)
    np.testing.assert_array_equal(found.points, again.points)
    assert (found.seed, found.iterations) == (3, 250)


def test_forces_are_slopes_of_the_energy_within_reach() -> None:
    surface, s = wf.FlatTorus(8.0, 9.0), 3.0
    x = surface.random_points(72, 5)

    def energy(points: Any) -> float:
        i, j = np.triu_indices(72, 1)
        r = np.linalg.norm(nearest_image(points[i] - points[j], surface.period), axis=1)
        r = r[r < warm_points.REACH]
        return float((r**-s).sum())

    crystal = warm_points._Crystal(surface, 1.0, s, wf.anneal_points(surface, 72, steps=80, seed=1).points)
    x = crystal.points
    for k in (0, 30, 71):
        for axis in (0, 1):
            step = np.zeros_like(x)
            step[k, axis] = 1e-6
            slope = (energy(x + step) - energy(x - step)) / 2e-6
            assert crystal.force[k, axis] == pytest.approx(-slope, rel=1e-5, abs=1e-6)


def test_slow_cooling_leaves_fewer_pairs() -> None:
    # 300 points: quenched from the same random starts against cooled
    def pairs(steps: int, heat: float) -> float:
        out = []
        for seed in range(3):
            points = wf.anneal_points(SPHERE.surface, 300, seed=seed, steps=steps, temperature=heat).points
            foam = wf.voronoi_foam(SPHERE, seeds=points, order=3)
            out.append(wf.defects(foam).summary["excess_pairs"])
        return float(np.mean(out))

    assert pairs(700, 0.3) + 2.0 < pairs(120, 0.0)


def test_bad_points() -> None:
    with pytest.raises(ValueError, match="rims"):
        wf.anneal_points(wf.Cylinder(1.0, 3.0), 10)
    with pytest.raises(ValueError, match="n = 5 points"):
        wf.anneal_points(SPHERE.surface, 5, start=np.eye(3))
    with pytest.raises(ValueError, match="steps"):
        wf.anneal_points(SPHERE.surface, 5, steps=-1)
    with pytest.raises(ValueError, match="cooling"):
        wf.anneal_points(SPHERE.surface, 5, cooling=0.0)
    with pytest.raises(TypeError, match="surface"):
        wf.anneal_points(None, 5)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="progress"):
        wf.anneal_points(SPHERE.surface, 5, progress=1)  # type: ignore[arg-type]
