"""Changes of topology that a drift makes: films lost to walls, regions enclosed by clusters that meet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

PLATE = wf.Graph(lambda x: 0.0 * x[:, 0], lambda x: 0.0 * x[:, :2], 2.0, 2.0, disk=True)
SHEET = wf.HeleShawCell(wf.FlatTorus(20.0, 20.0), gap=1.0)


def ringed(count: int = 8) -> wf.Foam:
    """A large bubble in the middle of a disk, small ones round it, each with four sides and a wall."""
    cell = wf.HeleShawCell(PLATE, gap=0.02)
    turn = 2.0 * np.pi * np.arange(count) / count + 0.1
    ring = 0.8 * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    foam = wf.voronoi_foam(cell, seeds=np.concatenate([np.zeros((1, 3)), ring]), order=3)
    small = np.linspace(0.9, 1.1, count) * 0.2 / count
    return replace(foam, target_volumes=np.append(1.0 - small.sum(), small) * cell.volume)


def test_a_film_is_lost_to_the_wall_that_it_comes_to() -> None:
    """Without pressures a bubble of eight sides grows by 2π/3 a time until its corners reach the wall."""
    start = wf.relax(ringed())
    assert start.converged, start.message
    moved = wf.drift(start.foam, duration=0.07, every=0.07, tolerance=0.1, cutoff=0.05, hold_volumes=False)
    assert moved.completed, moved.message
    assert [event.kind for event in moved.events] == ["wall t1"]
    assert moved.n_t1 == 1
    event = moved.events[0]
    # the bubbles beside the film lose a side each, the one in the middle gains a film and a wall
    assert event.gainers == (0,)
    assert len(event.losers) == 2
    change = moved.foam.network.charges - start.foam.network.charges
    assert change[0] == -2
    assert change[list(event.losers)].tolist() == [1, 1]
    assert np.abs(change).sum() == 4
    assert moved.foam.network.n_films == start.foam.network.n_films - 1
    assert start.foam.network.wall_counts[0] == 0
    assert moved.foam.network.wall_counts[0] == 1
    # at the wall, and lower in energy
    assert np.hypot(*event.position[:2]) == pytest.approx(1.0, abs=0.02)
    assert event.energy_after < event.energy_before
    assert np.diff(moved.step_energies).max() < 0.0
    assert moved.foam.bubble_areas[0] > start.foam.bubble_areas[0] + 0.1


def three_disks(gap: float = 0.003) -> wf.Foam:
    """Three disks of area 1 that all but touch each other."""
    turn = 0.5 * np.pi + 2.0 * np.pi * np.arange(3) / 3
    away = (2.0 / np.sqrt(np.pi) + gap) / np.sqrt(3.0)
    corners = away * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    foam = wf.relax(wf.cluster_foam(SHEET, [1, 1, 1], volumes=1.0, centre=2.0 * corners, order=6)).foam
    points, network = foam.vertex_points.copy(), foam.network
    for bubble in range(3):
        films = (network.left == bubble) | (network.right == bubble)
        points[np.unique(network.tails[films])] += corners[bubble] - foam.bubble_centres[bubble]
    return replace(foam, vertex_points=points)


@pytest.fixture(scope="module")
def closing() -> wf.Drift:
    return wf.drift(three_disks(), duration=1.0, every=0.5, tolerance=0.1)


def test_an_enclosed_region_becomes_a_bubble(closing: wf.Drift) -> None:
    """Its air cannot get out: a bubble more, the last, with the volume that it had."""
    assert closing.completed, closing.message
    assert [event.kind for event in closing.events] == ["join"]
    assert set(closing.events[0].gainers) == {0, 1, 2}
    first, last = closing.foams[0], closing.foam
    assert (first.n_bubbles, last.n_bubbles) == (4, 5)
    assert last.exterior == first.exterior == 3
    assert last.bubble_ids.tolist() == [0, 1, 2, 3, 4]
    # an exterior of genus 1 with three outlines, then with one; the hole is a disk
    assert first.network.bubble_euler.tolist() == [1, 1, 1, -3]
    assert last.network.bubble_euler.tolist() == [1, 1, 1, -1, 1]
    # the hole between three disks of area 1 that touch
    hole = (np.sqrt(3.0) - 0.5 * np.pi) / np.pi
    assert last.target_volumes[4] == pytest.approx(hole, rel=0.2)
    assert last.target_volumes.sum() == pytest.approx(SHEET.volume, rel=1e-12)
    assert closing.volume_errors.max() < 1e-10
    assert np.diff(closing.step_energies).max() < 1e-10
    assert np.isnan(closing.centres[0, 4]).all()
    assert np.isfinite(closing.centres[1:]).all()
    assert np.linalg.norm(closing.centres[-1, 4] - closing.centres[-1, :3].mean(axis=0)) < 1e-3


def test_it_ends_where_relax_does(closing: wf.Drift) -> None:
    relaxed = wf.relax(closing.foam)
    assert relaxed.converged, relaxed.message
    assert not relaxed.events
    assert not relaxed.contacts
    assert closing.foam.energy == pytest.approx(relaxed.energy, rel=1e-4)


def test_a_run_goes_on_with_the_bubble_that_it_has_enclosed(tmp_path: Path) -> None:
    """Bit for bit, from a file whose last frame has more bubbles than its first."""
    pytest.importorskip("h5py")
    options = {"every": 0.01, "tolerance": 0.1, "order": 4}
    foam = three_disks()
    whole = wf.drift(foam, duration=0.02, **options)
    path = tmp_path / "run.h5"
    half = wf.drift(foam, duration=0.01, trajectory=path, **options)
    assert [f.n_bubbles for f in half.foams] == [4, 5]
    after = wf.drift(foam, duration=0.02, trajectory=path, resume=True, **options)
    for name in ("vertex_points", "film_offsets", "pressures", "target_volumes"):
        assert np.array_equal(getattr(after.foam, name), getattr(whole.foam, name))
    with wf.Trajectory(path) as frames:
        assert [f.n_bubbles for f in frames] == [4, 5, 5]
