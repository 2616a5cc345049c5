"""Coarsening: von Neumann's law, T2s, conservation, and runs that go on."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.moves.t2 import rewire_t2

#: κγ in dA/dt.
THIRD = np.pi / 3.0


@cache
def relaxed(kind: str, n: int = 40, seed: int = 3, gap: float = 0.01, seeds: str = "blue") -> wf.Foam:
    surface = {"sphere": wf.Sphere(1.0), "torus": wf.Torus(3.0, 1.0), "cylinder": wf.Cylinder(1.0, 3.0)}[kind]
    found = wf.relax(wf.voronoi_foam(wf.HeleShawCell(surface, gap), n, seed=seed, seeds=seeds))
    assert found.converged
    return found.foam


@cache
def run(n: int = 40, until: int = 24) -> wf.Coarsening:
    return wf.coarsen(relaxed("sphere", n), until=until)


def test_von_neumanns_law_on_a_sphere() -> None:
    """Exact at any gap, but for how films and volumes grow through it."""
    gap = 0.2
    foam = relaxed("sphere", gap=gap)
    film = gap + gap**2 / 2.0
    depth = ((1.0 + gap) ** 3 - 1.0) / 3.0
    law = THIRD * (foam.network.sides - 6) + foam.bubble_areas
    np.testing.assert_allclose(wf.gas_flow(foam), film**2 / depth * law, atol=3e-5)
    fine = wf.relax(foam, order=8).foam
    law = THIRD * (fine.network.sides - 6) + fine.bubble_areas
    np.testing.assert_allclose(wf.gas_flow(fine, permeability=2.0), 2.0 * film**2 / depth * law, atol=1e-9)


def test_von_neumanns_law_on_a_torus() -> None:
    """With the curvature's integral, in the limit of thin gaps: the fault falls as the gap squared."""
    faults = []
    for gap in (0.02, 0.01):
        foam = wf.relax(relaxed("torus", 60, gap=gap), order=8).foam
        law = THIRD * (foam.network.sides - 6) + foam.bubble_curvatures
        faults.append(np.abs(wf.gas_flow(foam) / gap - law).max())
    assert faults[1] < 1e-3
    assert faults[0] / faults[1] == pytest.approx(4.0, abs=0.1)


def test_regular_foams_on_a_sphere_stay_as_they_are() -> None:
    """Areas (6 − n)π/3: four triangles, six squares, twelve pentagons."""
    assert np.abs(wf.gas_flow(_cube())).max() < 1e-9


def test_energy_goes_as_gas_flows() -> None:
    """dE/dt = −κ Σ (p_i − p_j)² A, by differences."""
    foam, kappa, dt = relaxed("torus", 60), 0.7, 1e-5
    flow = wf.gas_flow(foam, permeability=kappa)
    energy = [
        wf.relax(replace(foam, target_volumes=foam.target_volumes + s * dt * flow)).energy for s in (-1, 1)
    ]
    found = (energy[1] - energy[0]) / (2.0 * dt)
    assert found == pytest.approx(-wf.gas_dissipation(foam, permeability=kappa), rel=1e-6)
    assert flow.sum() == pytest.approx(0.0, abs=1e-15)


def test_a_lone_bubble_gives_its_gas_away_with_order_two() -> None:
    """dA/dt = κγ f²/v² (A − 2π) on the unit sphere, so A = 2π − (2π − A₀) exp(κγ t f²/v²)."""
    gap = 0.1
    cell = wf.HeleShawCell(wf.Sphere(1.0), gap)
    foam = wf.cluster_foam(cell, 1, volumes=0.2, order=8)
    film, depth = gap + gap**2 / 2.0, ((1.0 + gap) ** 3 - 1.0) / 3.0
    faults = []
    for steps in (4, 8, 16):
        made = wf.coarsen(foam, duration=0.2, every=0.2, step=0.2 / steps)
        assert made.n_steps == steps
        areas = [made.foams[k].bubble_areas[0] for k in (0, -1)]
        exact = 2.0 * np.pi - (2.0 * np.pi - areas[0]) * np.exp(0.2 * film**2 / depth**2)
        faults.append(abs(areas[1] - exact))
    assert faults[-1] < 5e-4
    orders = np.log2(np.array(faults[:-1]) / faults[1:])
    assert (np.abs(orders - 2.0) < 0.35).all(), orders


def test_a_run() -> None:
    made = run()
    assert made.completed, made.message
    assert made.n_t2 == 40 - made.foam.n_bubbles
    assert made.step_bubbles[-1] == made.foam.n_bubbles <= 24
    assert made.n_t1 > 0
    assert (np.diff(made.step_energies) < 0.0).all()
    assert (np.diff(made.step_times) > 0.0).all()
    assert made.step_errors.max() <= 0.01
    ids = set(made.foams[0].bubble_ids.tolist())
    for foam in made.foams:
        assert foam.network.charges.sum() == 12
        assert foam.bubble_volumes.sum() == pytest.approx(foam.cell.volume, rel=1e-12)
        np.testing.assert_allclose(foam.bubble_volumes, foam.target_volumes, rtol=1e-9)
        assert set(foam.bubble_ids.tolist()) <= ids
        ids = set(foam.bubble_ids.tolist())
    gone = [event.losers[0] for event in made.events if event.kind == "t2"]
    assert sorted([*gone, *ids]) == list(range(40))


def test_frames_are_relaxed_and_on_time() -> None:
    made = wf.coarsen(relaxed("sphere"), duration=0.1, every=0.04)
    np.testing.assert_allclose(made.times, [0.0, 0.04, 0.08, 0.1], rtol=1e-12)
    again = wf.relax(made.foam)
    assert again.iterations <= 1
    assert again.energy == pytest.approx(made.foam.energy, rel=1e-13)


def test_permeability_is_a_unit_of_time() -> None:
    one = wf.coarsen(relaxed("sphere"), duration=0.2, every=0.1)
    other = wf.coarsen(relaxed("sphere"), duration=0.05, every=0.025, permeability=4.0)
    np.testing.assert_allclose(other.foam.bubble_areas, one.foam.bubble_areas, rtol=1e-8)
    np.testing.assert_allclose(4.0 * other.step_times, one.step_times, rtol=1e-8)


def test_time_goes_as_length_squared() -> None:
    small = relaxed("sphere")
    cell = wf.HeleShawCell(wf.Sphere(10.0), 0.1)
    large = wf.Foam(cell, small.network, 10.0 * small.vertex_points, small.film_offsets)
    one = wf.coarsen(small, duration=0.2, every=0.1)
    other = wf.coarsen(large, duration=20.0, every=10.0)
    np.testing.assert_allclose(other.foam.bubble_areas, 100.0 * one.foam.bubble_areas, rtol=1e-6)


def test_smaller_steps_change_less_and_less() -> None:
    """With T1s and T2s on the way: their times are of first order in the step."""
    foam = relaxed("sphere", 24, seed=5, seeds="random")
    found = [
        wf.coarsen(foam, duration=0.8, every=0.8, tolerance=t, vanish=1e-3) for t in (4e-2, 2.5e-3, 2e-4)
    ]
    assert {made.foam.n_bubbles for made in found} == {found[0].foam.n_bubbles}
    assert found[0].n_t2 > 0
    off = [np.abs(made.foam.bubble_areas - found[-1].foam.bubble_areas).max() for made in found[:-1]]
    assert off[1] < 0.01
    assert off[1] < 0.5 * off[0]


@pytest.mark.parametrize("kind", ["sphere", "torus", "cylinder"])
def test_any_bubble_may_vanish(kind: str) -> None:
    """Charges, Euler's number, names, volumes and equilibrium, whichever bubbles go."""
    foam = relaxed(kind, 40)
    chi = foam.cell.surface.euler_characteristic
    rng = np.random.default_rng(1)
    gone: list[int] = []
    while len(gone) < 8:
        bubble = int(rng.integers(foam.n_bubbles))
        if kind == "cylinder" and foam.network.wall_counts[bubble]:
            continue
        gone.append(int(foam.bubble_ids[bubble]))
        fewer = wf.t2(foam, bubble)
        assert fewer.n_bubbles == foam.n_bubbles - 1
        assert fewer.network.charges.sum() == 6 * chi
        assert fewer.network.euler_characteristic == chi
        assert fewer.target_volumes.sum() == pytest.approx(foam.cell.volume, rel=1e-12)
        gain = fewer.target_volumes - np.delete(foam.target_volumes, bubble)
        network = foam.network
        beside = np.unique(network.bubble[np.flatnonzero(network.bubble == bubble) ^ 1])
        near = np.isin(fewer.bubble_ids, foam.bubble_ids[beside])
        assert (gain[near] > 0.0).all()
        assert np.abs(gain[~near]).max() < 1e-12 * foam.cell.volume
        found = wf.relax(fewer)
        assert found.converged, found.message
        foam = found.foam
    assert not set(gone) & set(foam.bubble_ids.tolist())


def test_a_lens_on_a_film_leaves_the_film() -> None:
    """Two films between the bubbles on either side become one with the lens's gap closed."""
    foam = _lens()
    assert foam.network.sides.tolist() == [2, 4, 4, 2]
    left = wf.t2(foam, 0)
    # a marker stays: without it the film would be half a turn
    assert left.network.n_films == foam.network.n_films - 2
    assert len(left.network.markers) == len(foam.network.markers) + 1
    assert left.network.sides.tolist() == [2, 2, 2]
    # lunes of 120 degrees, if all are as large
    thirds = replace(left, target_volumes=np.full(3, left.cell.volume / 3.0))
    found = wf.relax(thirds)
    assert found.converged
    assert found.foam.film_lengths.sum() == pytest.approx(3.0 * np.pi, rel=1e-9)


def _lens() -> wf.Foam:
    """Three lunes round an axis, the film between two of them opened by a lens at the equator."""
    a = np.radians([-8.0, 8.0])
    points = np.array(
        [
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
            [np.cos(a[0]), 0.0, np.sin(a[0])],
            [np.cos(a[1]), 0.0, np.sin(a[1])],
        ]
    )
    third = np.radians(120.0)
    for angle in (third, -third):
        points = np.vstack([points, [np.cos(angle), np.sin(angle), 0.0]])
    # the other two films bear markers, since they are half turns
    north, south, low, high, east, west = range(6)
    films = [
        (low, high),
        (high, low),
        (high, north),
        (south, low),
        (north, east),
        (east, south),
        (north, west),
        (west, south),
    ]
    loops = {
        0: [0, 2],
        1: [5, 1, 7, 11, 9],
        2: [6, 3, 4, 12, 14],
        3: [8, 10, 15, 13],
    }
    following = np.empty(16, dtype=int)
    bubble = np.empty(16, dtype=int)
    for name, loop in loops.items():
        for here, after in zip(loop, loop[1:] + loop[:1], strict=True):
            following[here], bubble[here] = after, name
    origin = np.array([end for film in films for end in film])
    network = wf.CellNetwork(following, origin, bubble)
    cell = wf.HeleShawCell(wf.Sphere(1.0), 0.01)
    bulge = np.zeros((8, 3))
    bulge[0] = bulge[1] = -0.4
    return wf.Foam(cell, network, points, bulge)


def test_what_cannot_vanish_says_so() -> None:
    foam = relaxed("sphere")
    with pytest.raises(wf.TopologyError, match="can vanish"):
        rewire_t2(foam.network, int(np.argmax(foam.network.sides)))
    cluster = wf.cluster_foam(wf.HeleShawCell(wf.Sphere(1.0), 0.01), 2, volumes=0.001)
    assert cluster.exterior is not None
    with pytest.raises(ValueError, match="exterior"):
        wf.t2(cluster, cluster.exterior)
    last = wf.cluster_foam(wf.HeleShawCell(wf.Sphere(1.0), 0.01), 1, volumes=0.001)
    with pytest.raises(wf.TopologyError, match="last"):
        wf.t2(last, 0)
    with pytest.raises(ValueError, match="bubble"):
        wf.t2(foam, 40)


def test_a_bubble_apart_vanishes_into_the_exterior() -> None:
    cell = wf.HeleShawCell(wf.Torus(20.0, 4.0), 0.5)
    foam = wf.cluster_foam(
        cell, [1, 2], volumes=0.5, centre=cell.surface.points(np.zeros(2), np.array([0.0, 2.0]))
    )
    alone = int(np.flatnonzero(foam.network.sides == 0)[0])
    fewer = wf.t2(foam, alone)
    assert fewer.exterior == foam.exterior - 1
    assert fewer.network.bubble_euler[-1] == foam.network.bubble_euler[-1] + 1
    assert wf.relax(fewer).converged


class _Stop(Exception):
    """Someone ends the run."""


def test_a_run_that_was_stopped_goes_on(tmp_path: Path) -> None:
    foam, path = relaxed("sphere"), tmp_path / "run.h5"
    options = {"every": 0.05, "until": 38}
    whole = wf.coarsen(foam, **options)
    seen = []

    def stop(_stage: str, _fraction: float) -> None:
        seen.append(_fraction)
        if len(seen) == 14:
            raise _Stop

    with pytest.raises(_Stop):
        wf.coarsen(foam, trajectory=path, progress=stop, **options)
    with wf.Trajectory(path) as frames:
        assert 3 <= len(frames) < len(whole.foams)
    again = wf.coarsen(foam, trajectory=path, resume=True, **options)
    assert again.times.tolist() == whole.times.tolist()
    assert again.foam.vertex_points.tobytes() == whole.foam.vertex_points.tobytes()
    assert again.step_energies.tobytes() == whole.step_energies.tobytes()
    assert again.events == whole.events
    with pytest.raises(ValueError, match="another tolerance"):
        wf.coarsen(foam, trajectory=path, resume=True, tolerance=0.02, **options)
    with pytest.raises(ValueError, match="another foam"):
        wf.coarsen(relaxed("sphere", seed=4), trajectory=path, resume=True, **options)
    with pytest.raises(FileExistsError, match="resume=True"):
        wf.coarsen(foam, trajectory=path, **options)


def _cube() -> wf.Foam:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    loops = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return wf.relax(wf.Foam.from_loops(wf.HeleShawCell(wf.Sphere(1.0), 0.1), corners, loops)).foam


def test_a_foam_in_balance_stays() -> None:
    """No flow to measure steps by: it lasts as long as asked, and one that waits for bubbles to go ends."""
    made = wf.coarsen(_cube(), duration=1.0, every=0.5)
    assert made.completed, made.message
    assert made.times.tolist() == [0.0, 0.5, 1.0]
    np.testing.assert_allclose(made.foam.bubble_areas, made.foams[0].bubble_areas, rtol=1e-8)
    waiting = wf.coarsen(_cube(), until=3)
    assert not waiting.completed
    assert "in balance" in waiting.message


@pytest.mark.parametrize("duration", [1e-13, 1e-7])
def test_short_runs_get_to_their_end(duration: float) -> None:
    made = wf.coarsen(relaxed("sphere", 12), duration=duration, every=10.0)
    assert made.completed, made.message
    assert made.times.tolist() == [0.0, duration]


def test_more_bubbles_asked_for_than_there_are() -> None:
    made = wf.coarsen(relaxed("sphere", 12), until=12)
    assert made.completed
    assert made.n_steps == 0
    assert len(made.foams) == 1


def test_what_is_too_small_at_the_start_goes_first() -> None:
    foam = relaxed("sphere", 12)
    volumes = foam.target_volumes.copy()
    volumes[3] = 1e-3 * volumes.mean()
    volumes *= foam.cell.volume / volumes.sum()
    made = wf.coarsen(replace(foam, target_volumes=volumes), duration=0.01, every=0.01)
    assert made.completed, made.message
    assert [(event.kind, event.losers) for event in made.events if event.kind == "t2"] == [("t2", (3,))]
    assert made.step_bubbles.tolist() == [11] * (made.n_steps + 1)
    assert [frame.n_bubbles for frame in made.foams] == [11, 11]


def test_a_cluster_that_fills_the_sphere_ends_the_run() -> None:
    """Beyond half of the sphere a bubble grows, by A − 2π, until nothing is left outside."""
    cell = wf.HeleShawCell(wf.Sphere(1.0), 0.01)
    made = wf.coarsen(wf.cluster_foam(cell, 1, volumes=0.7 * cell.volume), duration=5.0, every=1.0)
    assert not made.completed
    assert "no room for its exterior" in made.message
    assert made.foam.bubble_volumes[1] > 0.0
    areas = [frame.bubble_areas[0] for frame in made.foams]
    steps = np.searchsorted(made.step_times, made.times)
    np.testing.assert_allclose(made.step_mean_areas[steps], areas, rtol=1e-12)
    full = np.log(2.0 * np.pi / (0.7 * 4.0 * np.pi - 2.0 * np.pi))
    assert made.times[-1] == pytest.approx(full, rel=0.1)


@pytest.mark.parametrize("n", [1, 2])
def test_a_cluster_that_loses_its_gas_ends_the_run(n: int) -> None:
    """One bubble or two alike: none is ever small beside the mean."""
    cell = wf.HeleShawCell(wf.Sphere(1.0), 0.01)
    made = wf.coarsen(wf.cluster_foam(cell, n, volumes=0.001), duration=5.0, every=1.0)
    assert not made.completed
    assert "given away its gas" in made.message
    assert made.foam.bubble_areas[:n].sum() < 0.003 * made.foams[0].bubble_areas[:n].sum()
    if n == 1:
        area = made.foams[0].bubble_areas[0]
        assert made.times[-1] == pytest.approx(-np.log(1.0 - area / (2.0 * np.pi)), rel=0.01)


def test_bubbles_that_cannot_go_are_not_told_as_gone() -> None:
    """Two triangles vanish at once and leave half turns, which films without markers cannot be."""
    made = wf.coarsen(wf.relax(_prism()).foam, until=1)
    assert not made.completed
    assert made.n_t2 == made.foams[0].n_bubbles - made.foam.n_bubbles
    assert made.step_bubbles[-1] == made.foam.n_bubbles


def _prism() -> wf.Foam:
    turn = np.radians([0.0, 120.0, 240.0])
    ends = [np.stack([np.cos(turn), np.sin(turn), np.full(3, z)], axis=1) for z in (-1.0, 1.0)]
    loops = [(2, 1, 0), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]
    shares = np.array([0.05, 0.05, 0.3, 0.3, 0.3])
    cell = wf.HeleShawCell(wf.Sphere(1.0), 0.01)
    return wf.Foam.from_loops(cell, np.vstack(ends), loops, target_volumes=shares * cell.volume)


def test_any_bubble_at_a_wall_may_vanish() -> None:
    """With long films too, which turn out over the rim at first."""
    foam = relaxed("cylinder", 30, seed=2, seeds="random")
    for bubble in np.flatnonzero(foam.network.wall_counts):
        fewer = wf.t2(foam, int(bubble))
        assert fewer.network.charges.sum() == 0
        assert fewer.target_volumes.sum() == pytest.approx(foam.cell.volume, rel=1e-12)


def test_going_on_needs_the_same_run_but_not_the_same_end(tmp_path: Path) -> None:
    foam, path = relaxed("sphere", 12), tmp_path / "run.h5"
    first = wf.coarsen(foam, duration=0.01, trajectory=path)
    longer = wf.coarsen(foam, duration=0.0104, trajectory=path, resume=True)
    assert longer.completed
    assert longer.times[:-2].tolist() == first.times.tolist()
    np.testing.assert_allclose(longer.times[-2:], [0.0102, 0.0104], rtol=1e-12)
    with pytest.raises(ValueError, match="another foam"):
        wf.coarsen(replace(foam, tension=2.0, pressures=None), duration=0.02, trajectory=path, resume=True)
    drifted = tmp_path / "drift.h5"
    wf.drift(foam, duration=1e-4, every=1e-4, trajectory=drifted)
    with pytest.raises(ValueError, match="holds no coarsening"):
        wf.coarsen(foam, duration=0.01, trajectory=drifted, resume=True)


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        ({}, "duration, until"),
        ({"until": 0}, "until"),
        ({"duration": -1.0}, "duration"),
        ({"duration": 1.0, "vanish": 0.5}, "vanish"),
        ({"duration": 1.0, "tolerance": 1.0}, "tolerance"),
        ({"duration": 1.0, "permeability": 0.0}, "permeability"),
        ({"duration": 1.0, "resume": True}, "trajectory"),
        ({"duration": 1.0, "step": np.nan}, "step"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, object], wanted: str) -> None:
    with pytest.raises((TypeError, ValueError), match=wanted):
        wf.coarsen(relaxed("sphere"), **arguments)  # type: ignore[arg-type]


def test_gas_needs_pressures() -> None:
    with pytest.raises(ValueError, match="relax it first"):
        wf.gas_flow(replace(relaxed("sphere"), pressures=None))
