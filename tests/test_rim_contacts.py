"""Outlines that come to a rim are seen before they cross it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.relax.rims import CLOSE, TOUCH, rim_gap

HEIGHT = 12.0
TUBE = wf.HeleShawCell(wf.Cylinder(radius=3.0, height=HEIGHT), gap=0.2)
#: Bubbles go where G is least negative: from the waist to the rim.
WAIST = wf.HeleShawCell(wf.Catenoid(2.0, 3.0), gap=0.1)


def gap_of(foam: wf.Foam) -> tuple[float, int, np.ndarray]:
    assert foam.exterior is not None
    arrays = foam.vertex_points, foam.film_offsets
    return rim_gap(foam.cell, foam.network, *arrays, foam.exterior, foam.bubble_size)


def lifted(foam: wf.Foam, by: float) -> wf.Foam:
    return replace(foam, vertex_points=foam.vertex_points + np.array([0.0, 0.0, by]), pressures=None)


@pytest.fixture(scope="module")
def disk() -> wf.Foam:
    return wf.relax(wf.cluster_foam(TUBE, 1, volumes=0.2, centre=[3.0, 0.0, 2.0], order=6)).foam


def test_the_gap_is_the_distance_to_the_rim(disk: wf.Foam) -> None:
    """From the highest point of the outline, as it is and lifted; below 0 beyond the rim."""
    top = disk.film_curves(400)[..., 2].max()
    for by in (0.0, 2.0, 5.0 - top, 6.0 - top + 0.05):
        gap, bubble, at = gap_of(lifted(disk, by))
        assert gap * disk.bubble_size == pytest.approx(0.5 * HEIGHT - top - by, abs=3e-3)
        assert bubble == 0
        assert at[2] == pytest.approx(top + by, abs=3e-3)
    down = gap_of(lifted(disk, -7.0))
    low = disk.film_curves(400)[..., 2].min() - 7.0
    assert down[0] * disk.bubble_size == pytest.approx(0.5 * HEIGHT + low, abs=3e-3)
    sphere = wf.cluster_foam(wf.HeleShawCell(wf.Sphere(10.0), gap=0.5), 1, volumes=0.5)
    assert gap_of(sphere)[0] == np.inf


def test_a_bubble_next_to_a_rim_may_stay(disk: wf.Foam) -> None:
    """Nothing draws it there: it relaxes as it does anywhere else, or grows as far as there is room."""
    top = disk.film_curves(400)[..., 2].max()
    near = lifted(disk, 0.5 * HEIGHT - top - 0.03 * disk.bubble_size)
    found = wf.relax(near)
    assert found.converged, found.message
    assert found.energy == pytest.approx(disk.energy, rel=1e-8)
    targets = disk.target_volumes * [1.5, 1.0]
    targets[1] -= targets.sum() - disk.target_volumes.sum()
    grown = wf.relax(replace(near, target_volumes=targets))
    assert not grown.converged
    assert "bubble 0 has come to the rim near" in grown.message
    assert 0.0 < gap_of(grown.foam)[0] < CLOSE + 0.01


@pytest.mark.parametrize("contacts", [True, False])
def test_relax_ends_at_the_rim(contacts: bool) -> None:
    foam = wf.cluster_foam(WAIST, 1, volumes=0.05, centre=[2.0, 0.3, 0.5], order=6)
    found = wf.relax(foam, contacts=contacts)
    assert not found.converged
    assert found.message.startswith("stopped: bubble 0 has come to the rim near (2.5")
    assert TOUCH <= gap_of(found.foam)[0] < CLOSE
    assert np.isfinite(found.energy)
    assert found.energy < foam.energy or found.volume_error < 1e-2


def test_drift_ends_at_the_rim() -> None:
    foam = wf.cluster_foam(WAIST, 1, volumes=0.05, centre=[2.0, 0.3, 0.7], order=4)
    moved = wf.drift(foam, duration=1e5, every=1e5, tolerance=0.1)
    assert not moved.completed
    assert "bubble 0 has come to the rim near" in moved.message
    assert TOUCH <= gap_of(moved.foam)[0] < CLOSE
    assert moved.times[-1] < 1e4
    assert np.diff(moved.step_energies).max() < 1e-9
