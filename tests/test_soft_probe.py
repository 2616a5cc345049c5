"""Bubbles held in a foam or apart from each other: forces against differences, T1s, a bubble that leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.studies.held_cluster import Hold, relax_held

SHEET = wf.HeleShawCell(wf.FlatTorus(20.0, 20.0), gap=1.0)
TUBE = wf.Torus(4.0, 1.5)
RING = wf.HeleShawCell(TUBE, gap=0.1)


@pytest.fixture(scope="module")
def foam() -> wf.Foam:
    """Sixty bubbles on a small torus, one of them half as large again."""
    start = wf.relax(wf.voronoi_foam(RING, 60, seed=3), order=6).foam
    targets = start.target_volumes.copy()
    targets[0] *= 1.5
    relaxed = wf.relax(replace(start, target_volumes=targets * RING.volume / targets.sum()))
    assert relaxed.converged
    return relaxed.foam


def up(foam: wf.Foam, probe: list[int], by: np.ndarray) -> np.ndarray:
    """Places up the tube from where the probe is."""
    phi, theta = TUBE.angles(wf.held_centre(foam, probe)[None])
    return TUBE.points(phi + by / TUBE.minor_radius, np.full(len(by), float(theta[0])))


def test_forces_are_minus_the_slope(foam: wf.Foam) -> None:
    """−dE/ds along the tube by four-point differences at fixed topology, to 1e-6 of the force."""
    h = 0.02
    points = up(foam, [0], 0.1 + h * np.arange(-2, 3))
    found = wf.probe_potential(foam, [0], points=points, t1=False, tolerance=1e-11)
    assert (found.residuals < 1e-10).all()
    assert found.minima.all()
    e = found.energies
    slope = (8.0 * (e[3] - e[1]) - (e[4] - e[0])) / (12.0 * h)
    force = float(found.forces[2] @ TUBE.vertex_frames(points[2:3])[0, 0])
    assert force < -1e-3
    assert force == pytest.approx(-slope, rel=1e-6)
    assert abs(found.forces[2] @ TUBE.normals(points[2:3])[0]) < 1e-9
    # the foam as a whole turns round the axis at no cost
    assert abs(found.forces[2] @ TUBE.vertex_frames(points[2:3])[0, 1]) < 1e-6


def test_at_rest_nothing_pulls(foam: wf.Foam) -> None:
    net = foam.network
    pair = [0, int(net.right[net.left == 0][0])]
    found = wf.probe_potential(foam, pair, points=[wf.held_centre(foam, pair)])
    assert np.abs(found.forces).max() < 1e-6
    assert found.energies[0] == pytest.approx(foam.energy, rel=1e-12)
    assert found.n_t1.tolist() == [0]


@pytest.mark.slow
def test_on_the_way_films_turn(foam: wf.Foam) -> None:
    """Pushed far enough films turn; volumes and χ are kept, and the probe is where it is held."""
    points = up(foam, [0], np.array([0.0, 0.8 * foam.bubble_size]))
    found = wf.probe_potential(foam, [0], points=points, step=0.2, tolerance=1e-6)
    assert found.n_t1[0] == 0
    assert found.n_t1[1] > 0
    one = found.foams[1]
    np.testing.assert_allclose(one.bubble_volumes, foam.target_volumes, rtol=1e-6)
    assert one.network.charges.sum() == 0
    np.testing.assert_allclose(wf.held_centre(one, [0]), points[1], atol=1e-5)
    with pytest.raises(wf.ConvergenceError, match="the probe held at"):
        wf.probe_potential(foam, [0], points=points[1:], t1=False, max_iterations=1)


def test_a_bubble_pulled_away_leaves() -> None:
    """Two bubbles held farther and farther apart: their film shrinks, lets go, and two disks are left."""
    surface = SHEET.surface
    foam = wf.relax(wf.cluster_foam(SHEET, 2, volumes=1.0, order=4)).foam
    one, two = foam.bubble_centres[:2]
    middle, away = 0.5 * (one + two), two - one
    axis = away / np.linalg.norm(away)
    frame = surface.vertex_frames(middle[None])[0]
    distance, pulls, energies = 1.5, [], []
    events: tuple[wf.ContactEvent, ...] = ()
    while not events:
        holds = [
            Hold(middle + 0.5 * s * distance * axis, frame, None, np.array([k]))
            for k, s in enumerate((-1.0, 1.0))
        ]
        held = relax_held(foam, holds, tolerance=1e-6, max_iterations=80)
        assert held.converged
        pulls.append(float(held.forces[1] @ axis))
        energies.append(held.foam.energy)
        assert held.forces[0] @ axis == pytest.approx(-pulls[-1], abs=1e-5)
        foam, events = wf.with_contacts(held.foam)
        net = held.foam.network
        between = (net.left != 2) & (net.right != 2)
        left = float(held.foam.film_lengths[between].min())
        distance += 0.15 if left > 0.3 else max(0.9 * left, 0.004)
        assert distance < 2.5
    assert [(e.kind, e.bubbles) for e in events] == [("part", (0, 1))]
    # the pull tends to two tensions, the energy rises all the way
    assert min(pulls) > -2.0
    assert (np.diff(energies) > 0.0).all()
    apart = wf.relax(foam, order=8)
    assert apart.converged
    assert apart.contacts == ()
    assert apart.energy == pytest.approx(4.0 * np.sqrt(np.pi), abs=1e-5)
    assert apart.foam.network.bubble_euler.tolist() == [1, 1, -2]


@pytest.mark.parametrize(
    ("bubbles", "change", "fault", "message"),
    [
        ([], {}, ValueError, "bubbles is empty"),
        ([99], {}, (ValueError, IndexError), "bubbles"),
        (list(range(60)), {}, ValueError, "must leave some"),
        ([0], {"step": 0.9}, ValueError, "step must be"),
        ([0], {"progress": 1}, TypeError, "progress must be callable"),
        ([0], {"points": [1.0, 2.0, 3.0]}, ValueError, "points must have shape"),
    ],
)
def test_refusals(
    foam: wf.Foam, bubbles: list[int], change: dict, fault: type[Exception], message: str
) -> None:
    arguments = {"points": [[5.5, 0.0, 0.0]], **change}
    with pytest.raises(fault, match=message):
        wf.probe_potential(foam, bubbles, **arguments)


def test_the_exterior_is_no_probe() -> None:
    cluster = wf.cluster_foam(SHEET, 3, volumes=1.0)
    with pytest.raises(ValueError, match="must not name the exterior"):
        wf.held_centre(cluster, [3])
