"""The discrete film and region of one bubble: closed forms, exact gradients, Hessians at rest."""

from __future__ import annotations

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.kernels.lateral_film import (
    film_area,
    film_grid,
    region_moments,
    region_points,
    resampled,
    truncation,
)
from warpedfoam.studies.chart import Chart, Nodes, OutOfChart, angle_coordinates, tangent_coordinates
from warpedfoam.studies.held import HeldBubble, solve, stiffness

K = 2.0 * np.pi / 20.0
RING = wf.Torus(20.0, 4.0).triangulate(2000)
SURFACES = {
    "sphere": (wf.Sphere(5.0), [1.0, 2.0, 4.0]),
    "torus": (wf.Torus(20.0, 4.0), [17.0, 5.0, 2.0]),
    "cylinder": (wf.Cylinder(4.0, 20.0, periodic=True), [2.0, 3.0, 7.0]),
    "ellipsoid": (wf.Ellipsoid(6.0, 5.0, 4.0), [3.0, 3.0, 2.0]),
    "graph": (
        wf.Graph(
            lambda x: np.cos(K * x).sum(axis=1), lambda x: -K * np.sin(K * x), 20.0, 20.0, periodic=True
        ),
        [4.0, 3.0, 0.5],
    ),
    "mesh": (wf.MeshSurface(RING.nodes, RING.triangles), [17.0, 5.0, 2.0]),
}


def held_on(name: str, *, layers: int = 3, angles: int = 17, projection: bool = False) -> HeldBubble:
    surface, near = SURFACES[name]
    chart = Chart.at(surface, surface.project(np.array([near]))[0])
    angular = None if projection else angle_coordinates(chart)
    grid = film_grid(0.5, layers, angles, 8)
    return HeldBubble(chart, grid, 0.5, angular or tangent_coordinates(chart))


def uneven(held: HeldBubble, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return 0.56 * (1.0 + 0.05 * rng.standard_normal((held.grid.n_free, len(held.grid.angles))))


@pytest.mark.parametrize("layers", [1, 2, 5])
def test_a_flat_cylinder_is_exact(layers: int) -> None:
    chart = Chart.at(wf.FlatTorus(4.0, 4.0), np.array([0.3, -0.2, 0.0]))
    grid = film_grid(0.7, layers, 5, 3)
    nodes = chart.nodes(grid, np.full((len(grid.heights), 5), 0.4))
    assert film_area(grid, nodes.points[-1])[0] == pytest.approx(2 * np.pi * 0.4 * 0.7, rel=1e-14)
    shape = region_points(grid, nodes.points).shape[:-1]
    moments, _ = region_moments(grid, nodes.points, np.ones((1, *shape)), np.zeros((1, *shape, 3)))
    assert moments[0] == pytest.approx(np.pi * 0.16 * 0.7, rel=1e-14)


def test_a_ruled_region_has_the_volume_of_steiner() -> None:
    """On an ellipsoid, where H and G vary: ∫ (d + H d² + G d³/3) dA in polar coordinates of the chart."""
    held = held_on("ellipsoid", layers=1, angles=33)
    radii = 0.6 * (1.0 + 0.1 * np.cos(2.0 * held.grid.angles))[None]
    volume = held.state(radii).moments[0]
    s, w = np.polynomial.legendre.leggauss(12)
    s, w = 0.5 * (s + 1.0), 0.5 * w
    chart, angles = held.chart, held.grid.angles
    rays = np.cos(angles)[:, None] * chart.frame[0] + np.sin(angles)[:, None] * chart.frame[1]
    flat = chart.origin + (s[:, None] * radii)[..., None] * rays
    surface, d = SURFACES["ellipsoid"][0], 0.5
    assert isinstance(surface, wf.Ellipsoid)
    foot = surface.foot(flat.reshape(-1, 3), np.broadcast_to(chart.frame[2], (flat.size // 3, 3)))
    k = surface.principal_curvatures(foot)
    density = (d + 0.5 * k.sum(axis=1) * d**2 + k.prod(axis=1) * d**3 / 3.0) / (
        surface.normals(foot) @ chart.frame[2]
    )
    area = w[:, None] * s[:, None] * radii**2 * (2.0 * np.pi / len(angles))
    assert volume == pytest.approx(float((area * density.reshape(area.shape)).sum()), rel=1e-12)


@pytest.mark.parametrize("projection", [False, True])
@pytest.mark.parametrize("layers", [1, 3])
@pytest.mark.parametrize("name", SURFACES)
def test_gradients(name: str, layers: int, projection: bool) -> None:
    """Of the energy, the volume and both coordinates, on a rough film, by central differences."""
    held = held_on(name, layers=layers, projection=projection)
    radii, h = uneven(held), 1e-5
    state = held.state(radii)
    way = np.random.default_rng(1).standard_normal(radii.shape)
    ahead, behind = held.state(radii + h * way), held.state(radii - h * way)
    found = np.array([ahead.energy - behind.energy, *(ahead.moments - behind.moments)]) / (2.0 * h)
    exact = np.array([state.gradient @ way.ravel(), *(state.slants @ way.ravel())])
    np.testing.assert_allclose(found, exact, atol=3e-9)


@pytest.mark.parametrize("layers", [1, 3])
@pytest.mark.parametrize("name", SURFACES)
def test_hessians_at_rest(name: str, layers: int) -> None:
    """Against differences of the gradients; at rest the parts left out vanish with the resolution."""
    held = held_on(name, layers=layers, angles=25)
    start = np.full((held.grid.n_free, 25), 0.56)
    rest = solve(held, start, np.array([1.77, 0.0, 0.0]))
    assert rest.residual < 1e-11
    h = 1e-5
    hessian = held.hessian(rest.state, rest.multipliers)
    for seed in range(3):
        # smooth changes: rough ones are not resolved
        rng, j = np.random.default_rng(seed), np.arange(4)
        waves = rng.standard_normal((held.grid.n_free, 4))
        way = np.einsum("kj,ji->ki", waves, np.cos(j[:, None] * held.grid.angles + seed))

        def pull(radii: np.ndarray) -> np.ndarray:
            state = held.state(radii)
            return state.gradient - rest.multipliers @ state.slants

        radii = rest.state.radii
        found = (pull(radii + h * way) - pull(radii - h * way)) / (2.0 * h)
        # a ruled film's forces along the plates vanish only together
        rough = 1e-4 if name == "mesh" else 1e-5 if layers == 1 else 1e-6
        np.testing.assert_allclose(found, hessian @ way.ravel(), atol=rough * np.abs(hessian).max())
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-14 * np.abs(hessian).max())
    assert stiffness(held, rest) > 0.0


def test_newton_is_quadratic() -> None:
    """From a wrong radius: the last steps square the error."""
    held = held_on("torus", layers=4, angles=33)
    rest = solve(held, np.full((5, 33), 0.6), np.array([1.6, 0.0, 0.0]))
    assert rest.iterations <= 6
    assert rest.residual < 1e-12
    assert rest.fault < 1e-13


def test_coordinates_have_the_gradients_they_say() -> None:
    for name in ("torus", "cylinder"):
        held = held_on(name)
        x = held.chart.origin + 0.5 * np.random.default_rng(0).standard_normal((20, 3))
        _, slopes = held.coordinates(x)
        for k, e in enumerate(np.eye(3)):
            found = (held.coordinates(x + 1e-5 * e)[0] - held.coordinates(x - 1e-5 * e)[0]) / 2e-5
            np.testing.assert_allclose(found, slopes[:, :, k], atol=1e-8)
        np.testing.assert_allclose(held.coordinates(held.chart.origin[None])[0], 0.0, atol=1e-14)
        here = held.coordinates(held.chart.origin[None])[1][:, 0]
        np.testing.assert_allclose(here, held.chart.frame[:2], atol=1e-14)


def test_nodes_lie_at_their_heights() -> None:
    held = held_on("torus")
    nodes: Nodes = held.state(uneven(held)).nodes
    torus = wf.Torus(20.0, 4.0)
    x = nodes.points.reshape(-1, 3)
    away = np.einsum("nx,nx->n", x - torus.project(x), torus.normals(x)).reshape(nodes.points.shape[:-1])
    np.testing.assert_allclose(away, np.broadcast_to(held.grid.heights[:, None], away.shape), atol=1e-13)


def test_a_bubble_that_leaves_its_chart() -> None:
    for name in ("sphere", "ellipsoid"):
        held = held_on(name)
        with pytest.raises(OutOfChart):
            held.state(np.full((4, 17), 4.9))


def test_resampling_keeps_the_curve() -> None:
    angles = 2.0 * np.pi * np.arange(9) / 9
    fine = 2.0 * np.pi * np.arange(15) / 15
    np.testing.assert_allclose(
        resampled((1.0 + 0.2 * np.cos(3 * angles) - 0.1 * np.sin(4 * angles))[None], 15)[0],
        1.0 + 0.2 * np.cos(3 * fine) - 0.1 * np.sin(4 * fine),
        atol=1e-14,
    )


def test_truncation_sees_the_highest_modes() -> None:
    held = held_on("torus", angles=33)
    radii = np.full((4, 33), 0.5)
    quiet = truncation(held.grid, radii, held.state(radii).nodes.points)
    rough = radii * (1.0 + 1e-3 * np.cos(16 * held.grid.angles))
    assert quiet < 1e-8
    assert truncation(held.grid, rough, held.state(radii).nodes.points) == pytest.approx(1e-3, rel=0.01)
