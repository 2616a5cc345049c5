"""`cluster_potential`: closed forms, forces and torques against differences, symmetry, orders, refusals."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.relax.system import Step
from warpedfoam.studies import held_cluster
from warpedfoam.studies.held_cluster import Hold, constraints, volume_moment

TORUS = wf.Torus(20.0, 4.0)
CELL = wf.HeleShawCell(TORUS, gap=0.5)
#: Energy of the paper's flat bubble, V = d = 0.5.
FLAT = float(np.sqrt(4 * np.pi * 0.5 * 0.5))


def on_torus(phi: np.ndarray, theta: float = 0.0) -> np.ndarray:
    return TORUS.points(np.asarray(phi), np.full(len(phi), theta))


def four_point(values: np.ndarray, step: float) -> float:
    """Derivative in the middle of five values."""
    return float((8.0 * (values[3] - values[1]) - (values[4] - values[0])) / (12.0 * step))


def test_one_bubble_on_the_papers_torus() -> None:
    """E/E0 of normal films, computed independently: 0.999562686 outside and 1.000864669 inside."""
    found = wf.cluster_potential(CELL, 1, volumes=0.5, points=on_torus([0.0, np.pi]))
    np.testing.assert_allclose(found.energies / FLAT, [0.999562686, 1.000864669], atol=2e-9)
    assert np.abs(found.forces).max() < 1e-9
    assert found.minima.all()
    assert (found.residuals < 1e-10).all()


def test_one_bubble_half_way_up() -> None:
    """There the independent value, 1.000072659, is for (1/V) ∫ φ dV = 90°: shifted by force times way."""
    found = wf.cluster_potential(CELL, 1, volumes=0.5, points=on_torus([0.5 * np.pi]))
    foam = found.foams[0]
    # mean of φ by one fan in the angles: ∫ φ w dA over the bubble
    moment, volume = volume_moment(foam, found.points[0])
    assert volume == pytest.approx(0.5, rel=1e-12)
    assert np.abs(moment - (moment @ [0, 0, 1.0]) * np.array([0, 0, 1.0])).max() < 1e-11
    # Γ^φ_θθ θ²/2 and what the disk's width makes of it: r δφ = <s²>/2 · sin φ/(R + r cos φ)
    radius = np.sqrt(0.5 / (np.pi * 0.5))
    shift = 0.5 * (radius**2 / 4.0) / 20.0
    up = float(found.forces[0] @ TORUS.vertex_frames(found.points)[0, 0])
    moved = min(abs((found.energies[0] + s * up * shift) / FLAT - 1.000072659) for s in (-1.0, 1.0))
    assert abs(found.energies[0] / FLAT - 1.000072659) < 5e-7
    assert moved < 3e-8


@pytest.mark.parametrize(("n", "hold"), [(1, "centre"), (2, "centre"), (3, "both"), (7, "both")])
def test_force_is_minus_the_slope(n: int, hold: str) -> None:
    """−dE/dφ by four-point differences, to 1e-6 of the force; no force round the axis where α is free."""
    h, middle = 0.02, 1.2
    phi = middle + h * np.arange(-2, 3)
    found = wf.cluster_potential(
        CELL, n, volumes=0.5, points=on_torus(phi, 0.7), hold=hold, orientation=0.3, tolerance=1e-11
    )
    slope = four_point(found.energies, h) / TORUS.minor_radius
    up, along = TORUS.vertex_frames(found.points[2:3])[0] @ found.forces[2]
    assert up == pytest.approx(-slope, rel=1e-6)
    assert abs(found.forces[2] @ TORUS.normals(found.points[2:3])[0]) < 1e-12
    if hold == "centre":
        assert abs(along) < 1e-6 * abs(up)


@pytest.mark.parametrize("n", [2, 7])
def test_torque_is_minus_the_slope(n: int) -> None:
    h = 0.02
    angles = 0.3 + h * np.arange(-2, 3)
    found = wf.cluster_potential(
        CELL,
        n,
        volumes=0.5,
        points=on_torus(np.full(5, 1.2)),
        hold="both",
        orientation=angles,
        tolerance=1e-11,
    )
    np.testing.assert_allclose(found.orientations, angles)
    assert found.torques[2] == pytest.approx(-four_point(found.energies, h), rel=2e-5)
    # two bubbles have an axis, seven a sixfold one: the torque falls by an order
    assert 1e-6 < abs(found.torques[2]) < 1e-3


def test_a_free_orientation_has_no_torque_and_less_energy() -> None:
    at = on_torus([1.2])
    free = wf.cluster_potential(CELL, 2, volumes=0.5, points=at, orientation=1.3)
    assert abs(free.torques[0]) < 1e-8
    assert free.minima[0]
    held = wf.cluster_potential(
        CELL,
        2,
        volumes=0.5,
        points=np.repeat(at, 6, axis=0),
        hold="both",
        orientation=np.arange(6) * np.pi / 6,
    )
    assert (held.energies > free.energies[0] - 1e-12).all()
    assert np.ptp(held.energies) > 1e-6
    # half a turn changes nothing
    again = wf.cluster_potential(
        CELL, 2, volumes=0.5, points=at, hold="both", orientation=float(free.orientations[0]) + np.pi
    )
    assert again.energies[0] == pytest.approx(free.energies[0], abs=1e-10)


def test_nothing_pulls_on_a_sphere_or_a_sheet() -> None:
    """Every point is alike: no force, the energies of the free clusters, whatever the orientation."""
    sphere = wf.HeleShawCell(wf.Sphere(3.0), gap=0.2)
    points = np.array([[3.0, 0.0, 0.0], [1.0, -2.0, 0.5]])
    found = wf.cluster_potential(sphere, 3, volumes=0.2, points=points, orientation=[0.0, 1.0])
    assert np.abs(found.forces).max() < 1e-8
    free = wf.relax(wf.cluster_foam(sphere, 3, volumes=0.2))
    np.testing.assert_allclose(found.energies, free.energy, rtol=1e-9)
    sheet = wf.HeleShawCell(wf.FlatTorus(20.0, 20.0), gap=1.0)
    flat = wf.cluster_potential(sheet, 3, volumes=1.0, points=[[1.0, 2.0, 0.0]])
    assert flat.energies[0] == pytest.approx(8.793934, abs=1e-6)
    assert np.abs(flat.forces).max() < 1e-8


def test_symmetry_of_the_torus() -> None:
    """All round the axis: equal energies and forces in the frame."""
    points = np.concatenate([on_torus([1.0]), on_torus([1.2]), on_torus([1.0], 2.0)])
    found = wf.cluster_potential(
        CELL, 3, volumes=0.5, points=points, hold="both", orientation=[0.2, -0.2, 0.2]
    )
    np.testing.assert_allclose(found.energies[2], found.energies[0], rtol=1e-10)
    along = np.einsum("nix,nx->ni", TORUS.vertex_frames(points), found.forces)
    np.testing.assert_allclose(along[2], along[0], atol=1e-8)


def test_orders_converge() -> None:
    """The difference of inside and outside, p = 4, 6, 8 against 12."""
    ends = on_torus([0.0, np.pi])

    def difference(order: int) -> float:
        return float(
            np.diff(wf.cluster_potential(CELL, 3, volumes=0.5, points=ends, order=order).energies)[0]
        )

    best = difference(12)
    error = {p: abs(difference(p) / best - 1.0) for p in (4, 6, 8)}
    assert error[4] > 5.0 * error[6] > 25.0 * error[8]
    assert error[8] < 1e-6


def test_a_cluster_of_the_users_own() -> None:
    """A relaxed cluster of unequal bubbles, taken elsewhere, keeps volumes and topology."""
    relaxed = wf.relax(wf.cluster_foam(CELL, 4, volumes=[0.4, 0.5, 0.6, 0.5], centre=[24.0, 0.0, 0.0]))
    found = wf.cluster_potential(CELL, cluster=relaxed.foam, points=on_torus([0.0, 1.0]))
    assert found.energies[0] == pytest.approx(relaxed.energy, rel=1e-5)
    assert found.energies[1] > found.energies[0]
    for foam in found.foams:
        np.testing.assert_allclose(foam.bubble_volumes[:4], [0.4, 0.5, 0.6, 0.5], rtol=1e-10)
        assert np.array_equal(foam.network.next, relaxed.foam.network.next)


def test_the_page() -> None:
    text = (Path(__file__).parents[1] / "docs" / "clusters.md").read_text(encoding="utf-8")
    space: dict[str, object] = {}
    for block in re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        exec(compile(block, "clusters.md", "exec"), space)
    assert space["relaxed"].converged  # type: ignore[attr-defined]
    assert space["exterior"] == 7
    # as printed on the page
    assert space["difference"] == pytest.approx(0.025414921, abs=2e-9)
    assert "| 7 | 0.025414921 |" in text
    assert space["force"][1] < 0.0  # type: ignore[index]


class TestConstraints:
    def test_moments_of_a_cap(self) -> None:
        """|∫ x dA| = π sin²θ of a spherical cap of angular radius θ."""
        sphere = wf.HeleShawCell(wf.Sphere(1.0), gap=0.01)
        pole = np.array([0.0, 0.0, 1.0])
        volume = 0.05 * sphere.volume
        foam = wf.relax(wf.cluster_foam(sphere, 1, volumes=volume, centre=pole, max_turn=30.0)).foam
        weight = sphere.volume / (4 * np.pi)
        cosine = 1.0 - volume / (2 * np.pi * weight)
        moment, total = volume_moment(foam, pole)
        assert total == pytest.approx(volume, rel=1e-10)
        height = np.pi * (1.0 - cosine**2) * weight - volume
        # the bubble may have slid a little: its centre of area lies on the axis of wherever it is
        assert np.linalg.norm(moment + volume * pole) == pytest.approx(height + volume, rel=1e-9)

    def test_gradients_by_differences(self) -> None:
        at = on_torus([1.0])[0]
        foam = wf.relax(
            wf.cluster_foam(CELL, 3, volumes=0.5, centre=at, orientation=0.3), t1=False, max_iterations=4
        ).foam
        rng = np.random.default_rng(0)
        hold = Hold(at, TORUS.vertex_frames(at[None])[0], rng.normal(size=(foam.network.n_vertices, 2)))
        size, volume = foam.bubble_size, 1.5
        steps = rng.normal(size=(foam.network.n_vertices, 2))
        held = held_cluster.held_vertices(TORUS, foam.network, foam.vertex_points, foam.film_offsets)
        assert held is not None
        along = np.einsum("mi,mi->m", steps[held.vertices], held.directions)
        steps[held.vertices] -= along[:, None] * held.directions
        bends = 0.1 * rng.normal(size=foam.film_offsets.shape)

        def seen(t: float) -> np.ndarray:
            points = TORUS.retract(foam.vertex_points, t * size * steps)
            moved = replace(foam, vertex_points=points, film_offsets=foam.film_offsets + t * bends)
            return constraints(moved, hold, volume) / [size, size, 1.0]

        gradient = held_cluster._gradients(foam, hold, volume, size)
        found = held_cluster._inner(gradient, Step(steps, bends, np.zeros(4)), foam)
        h = 1e-4
        np.testing.assert_allclose(found, (seen(h) - seen(-h)) / (2 * h), rtol=1e-6, atol=1e-9)


class TestRefusals:
    @pytest.mark.parametrize(
        ("change", "fault", "message"),
        [
            ({"volumes": None}, TypeError, "volumes must be given"),
            ({"hold": "angle"}, ValueError, "hold must be"),
            ({"n_bubbles": 1, "hold": "both"}, ValueError, "a single bubble has no orientation"),
            ({"points": [24.0, 0.0, 0.0]}, ValueError, "points must have shape"),
            ({"tolerance": 0.1}, ValueError, "tolerance must be"),
            ({"orientation": [0.0, 1.0]}, ValueError, "orientation"),
            ({"progress": 3}, TypeError, "progress must be callable"),
            ({"max_iterations": 1}, wf.ConvergenceError, "did not converge in 1 steps"),
        ],
    )
    def test_bad_arguments(self, change: dict, fault: type[Exception], message: str) -> None:
        arguments = {"n_bubbles": 2, "volumes": 0.5, "points": [[24.0, 0.0, 0.0]], **change}
        with pytest.raises(fault, match=message):
            wf.cluster_potential(CELL, arguments.pop("n_bubbles"), **arguments)

    def test_clusters_that_are_none(self) -> None:
        full = wf.voronoi_foam(CELL, 150, seeds="lattice")
        with pytest.raises(ValueError, match="a foam with an exterior"):
            wf.cluster_potential(CELL, cluster=full, points=[[24.0, 0.0, 0.0]])
        two = wf.cluster_foam(CELL, [1, 1], volumes=0.5, centre=[[24.0, 0, 0], [-24.0, 0, 0]])
        with pytest.raises(ValueError, match="several outlines"):
            wf.cluster_potential(CELL, cluster=two, points=[[24.0, 0.0, 0.0]])
        with pytest.raises(ValueError, match="in the same cell"):
            wf.cluster_potential(
                wf.HeleShawCell(TORUS, gap=0.4),
                cluster=wf.cluster_foam(CELL, 2, volumes=0.5),
                points=[[24.0, 0, 0]],
            )
        with pytest.raises(ValueError, match="leave out n_bubbles"):
            wf.cluster_potential(
                CELL, 2, cluster=wf.cluster_foam(CELL, 2, volumes=0.5), points=[[24.0, 0.0, 0.0]]
            )
