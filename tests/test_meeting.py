"""Clusters that meet while they drift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.motion.drag import FrictionLaw
from warpedfoam.motion.stepper import Stepper

PAPER = wf.Torus(20.0, 4.0)


@pytest.fixture(scope="module")
def meeting() -> wf.Drift:
    """Two bubbles on either side of the outer equator, which both drift to."""
    cell = wf.HeleShawCell(PAPER, gap=0.5)
    centre = PAPER.points(np.array([0.25, -0.25]), np.zeros(2))
    foam = wf.cluster_foam(cell, [1, 1], volumes=0.5, centre=centre, order=6)
    return wf.drift(foam, duration=2e4, every=1e4, tolerance=0.03)


def test_two_bubbles_meet_and_become_a_double(meeting: wf.Drift) -> None:
    assert meeting.completed, meeting.message
    assert [event.kind for event in meeting.events] == ["join"]
    assert meeting.n_contacts == 1
    assert meeting.n_t1 == 0
    event = meeting.events[0]
    assert event.gainers == (0, 1)
    assert event.energy_after < event.energy_before
    # where they met: on the outer equator
    assert np.abs(np.array(event.position) - [24.0, 0.0, 0.0]).max() < 0.01
    # one cluster where there were two: V − F + Σχ stays
    assert meeting.foams[0].network.bubble_euler[-1] == -2
    assert meeting.foam.network.bubble_euler[-1] == -1
    assert meeting.foam.network.vertex_degrees.max() == 3
    assert wf.cluster_charges(meeting.foam).sum() == 6


def test_it_ends_where_relax_does(meeting: wf.Drift) -> None:
    relaxed = wf.relax(meeting.foam)
    assert relaxed.converged
    assert meeting.foam.energy == pytest.approx(relaxed.energy, rel=1e-10)


def test_energy_falls_and_volumes_stay(meeting: wf.Drift) -> None:
    steps = np.diff(meeting.step_energies)
    # once at rest, volumes right to 3e-12 are all that changes
    assert steps.max() < 1e-11 * meeting.energies[0]
    assert meeting.volume_errors.max() < 1e-11


def test_without_changes_of_topology_outlines_may_cross() -> None:
    cell = wf.HeleShawCell(PAPER, gap=0.5)
    centre = PAPER.points(np.array([0.2, -0.2]), np.zeros(2))
    foam = wf.cluster_foam(cell, [1, 1], volumes=0.5, centre=centre, order=4)
    moved = wf.drift(foam, duration=1.3e4, every=1.3e4, tolerance=0.1, t1=False)
    assert not moved.events
    one, other = moved.foam.bubble_centres[:2]
    assert np.linalg.norm(other - one) < 2.0 * np.sqrt(0.5 / (0.5 * np.pi))


def test_energies_are_judged_at_exact_volumes(meeting: wf.Drift) -> None:
    """E − Σ p (V − V*) is the energy at V*, to second order in what the volumes are off."""
    foam = wf.relax(meeting.foam).foam
    grown = foam.target_volumes * np.where(np.arange(3) == 0, 1.0 + 1e-4, 1.0)
    grown[2] -= grown.sum() - foam.target_volumes.sum()
    other = replace(foam, target_volumes=grown)
    stepper = Stepper(other, FrictionLaw(1.0), hold_volumes=True, method="euler")
    state, goal = stepper.state_of(foam), wf.relax(other).energy
    assert abs(stepper.energy(state) / goal - 1.0) > 1e-5
    assert stepper.energy_at_volumes(state) == pytest.approx(goal, rel=1e-8)
