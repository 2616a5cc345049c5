"""Repelling points: known energies, exact derivatives, points that stay on their surface."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.studies import thomson
from warpedfoam.studies.thomson import riesz_energy, thomson_points

SURFACES = {
    "sphere": wf.Sphere(2.0),
    "torus": wf.Torus(3.0, 1.0),
    "ellipsoid": wf.Ellipsoid(1.0, 1.5, 2.0),
    "flat": wf.FlatTorus(2.0, 3.0),
}


@pytest.mark.parametrize(
    ("n", "energy"),
    [
        (2, 0.5),
        (3, np.sqrt(3.0)),
        (4, 3.674234614),
        (6, 9.985281374),
        # Thomson's problem, published to nine digits
        (12, 49.165253058),
        (32, 412.261274651),
    ],
)
def test_thomsons_problem(n: int, energy: float) -> None:
    best = min(thomson_points(wf.Sphere(1.0), n, seed=k, exponent=1.0).energy for k in range(3))
    assert best == pytest.approx(energy, rel=1e-9)


@pytest.mark.parametrize("period", [None, np.array([1.0, 1.3, np.inf])])
@pytest.mark.parametrize("exponent", [0.5, 1.0, 3.0])
def test_gradient_of_the_energy(exponent: float, period: Any) -> None:
    x = np.random.default_rng(0).uniform(size=(9, 3))
    _, gradient = riesz_energy(x, exponent, period)
    for i, k in ((0, 0), (4, 1), (8, 2)):
        step = np.zeros_like(x)
        step[i, k] = 1e-5
        ahead, behind = (riesz_energy(x + s * step, exponent, period)[0] for s in (1, -1))
        assert (ahead - behind) / 2e-5 == pytest.approx(gradient[i, k], rel=1e-6)


@pytest.mark.parametrize("name", SURFACES)
def test_gradient_off_the_surface(name: str) -> None:
    # the chain rule of the projection, where it matters: away from the surface
    surface = SURFACES[name]
    rng = np.random.default_rng(1)
    x = surface.random_points(8, rng)
    y = ((x + rng.uniform(-0.2, 0.2, (8, 1)) * surface.normals(x)) / 0.5).ravel()
    args = (surface, 3.0, 0.5)
    _, gradient = thomson._objective(y, *args)
    for i in (0, 7, 17, 23):
        step = np.zeros_like(y)
        step[i] = 1e-5
        ahead, behind = (thomson._objective(y + s * step, *args)[0] for s in (1, -1))
        assert (ahead - behind) / 2e-5 == pytest.approx(gradient[i], rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("name", SURFACES)
def test_points_rest_on_their_surface(name: str) -> None:
    surface = SURFACES[name]
    found = thomson_points(surface, 30, seed=3)
    first, _ = riesz_energy(surface.random_points(30, 3), 3.0, surface.period)
    assert found.energy < first
    # nearest images change, and the force jumps, on the flat torus
    assert found.force < (0.05 if name == "flat" else 1e-3)
    np.testing.assert_allclose(surface.project(found.points), found.points, atol=1e-9)
    assert not found.points.flags.writeable


def test_rotation_and_scale() -> None:
    start = wf.Sphere(1.0).random_points(20, 5)
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    one = thomson_points(wf.Sphere(1.0), 20, start=start)
    two = thomson_points(wf.Sphere(4.0), 20, start=4.0 * start @ turn.T)
    assert two.energy * 4.0**3 == pytest.approx(one.energy, rel=1e-9)


def test_blocks_and_seeds(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = thomson_points(wf.Sphere(1.0), 25, seed=7, max_iterations=20)
    again = thomson_points(wf.Sphere(1.0), 25, seed=7, max_iterations=20)
    assert (whole.points == again.points).all()
    assert whole.seed == 7
    x = wf.Sphere(1.0).random_points(25, 1)
    energy, gradient = riesz_energy(x, 3.0)
    monkeypatch.setattr(thomson, "BLOCK", 60)
    parts = riesz_energy(x, 3.0)
    assert parts[0] == pytest.approx(energy, rel=1e-14)
    np.testing.assert_allclose(parts[1], gradient, rtol=1e-12)


def test_evenness_on_a_torus() -> None:
    # at s = 3 the outer half holds its share of the area, 1/2 + r/(π R); charges crowd there
    torus = wf.Torus(3.0, 1.0)
    share = 0.5 + 1.0 / (3.0 * np.pi)
    outer = [
        float((np.hypot(*thomson_points(torus, 300, seed=1, exponent=s).points[:, :2].T) > 3.0).mean())
        for s in (3.0, 1.0)
    ]
    assert outer[0] == pytest.approx(share, abs=0.03)
    assert outer[1] > outer[0] + 0.02


def test_bad_input() -> None:
    sphere = wf.Sphere(1.0)
    with pytest.raises(TypeError, match="surface"):
        thomson_points(None, 4)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="n must be at least 2"):
        thomson_points(sphere, 1)
    with pytest.raises(ValueError, match="exponent"):
        thomson_points(sphere, 4, exponent=0.0)
    with pytest.raises(ValueError, match="start must hold n = 4"):
        thomson_points(sphere, 4, start=np.eye(3))
    with pytest.raises(wf.ConvergenceError, match="coincide"):
        thomson_points(sphere, 2, start=[[0, 0, 1], [0, 0, 1]])
