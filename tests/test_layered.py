"""Foams whose films bulge: derivatives, exact states, contact and vertex angles, energies."""

from __future__ import annotations

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.kernels.quadrature import lobatto
from warpedfoam.relax.layered import LayeredRelaxation, LayeredSystem, _State
from warpedfoam.surfaces.level_forms import as_level

from .nets import hemispheres

CELLS = {
    "sphere": wf.HeleShawCell(wf.Sphere(4.0), 0.3),
    "torus": wf.HeleShawCell(wf.Torus(6.0, 2.5), 0.3),
}


@pytest.fixture(scope="module")
def ruled() -> dict[str, wf.Relaxation]:
    return {name: wf.relax(wf.voronoi_foam(cell, 50, seed=1)) for name, cell in CELLS.items()}


@pytest.fixture(scope="module")
def bulging(ruled: dict[str, wf.Relaxation]) -> dict[str, LayeredRelaxation]:
    out = {}
    for name, one in ruled.items():
        result = wf.relax(one.foam, layers=4)
        assert isinstance(result, LayeredRelaxation)
        out[name] = result
    return out


def test_level_forms() -> None:
    """They are the surfaces, with derivatives to match."""
    for surface in (wf.Sphere(2.0), wf.Torus(5.0, 2.0)):
        level = as_level(surface)
        x = surface.random_points(20, 0)
        np.testing.assert_allclose(level.level(x, second=False)[0], 0.0, atol=1e-14)
        np.testing.assert_allclose(level.normals(x), surface.normals(x), atol=1e-13)
        np.testing.assert_allclose(level.shape_operators(x), surface.shape_operators(x), atol=1e-12)
        y = x + 0.2 * np.random.default_rng(1).standard_normal(x.shape)
        _, slope, bend = level.level(y, second=True)
        assert bend is not None
        for k, e in enumerate(np.eye(3)):
            ahead, behind = (level.level(y + s * 1e-5 * e, second=False) for s in (1, -1))
            np.testing.assert_allclose((ahead[0] - behind[0]) / 2e-5, slope[:, k], atol=1e-8)
            np.testing.assert_allclose((ahead[1] - behind[1]) / 2e-5, bend[:, k], atol=1e-8)
    ellipsoid = wf.Ellipsoid(3.0, 2.0, 2.0)
    assert as_level(ellipsoid) is ellipsoid


@pytest.mark.parametrize("name", CELLS)
def test_gradient_of_the_energy(ruled: dict[str, wf.Relaxation], name: str) -> None:
    """On rough films, along random changes of all curves, by central differences."""
    system = LayeredSystem(ruled[name].foam, 3)
    start = system.start()
    rng = np.random.default_rng(0)
    rough = start.offsets + 0.02 * rng.standard_normal(start.offsets.shape)
    state = _State(start.points, rough, start.pressures)
    way, none, h = rng.standard_normal(system.n_shape), np.zeros(50), 1e-6
    ahead, behind = (system.terms(system.moved(state, s * h * way, none)) for s in (1.0, -1.0))
    free = system.pull(system.terms(state), none)
    assert free @ way == pytest.approx((ahead.energy - behind.energy) / (2 * h), rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("name", CELLS)
def test_derivatives_of_volumes(ruled: dict[str, wf.Relaxation], name: str) -> None:
    """Boundary integrals against fans: quadrature error, which falls with the order of the films."""
    errors = []
    for order in (4, 8):
        system = LayeredSystem(ruled[name].foam.with_order(order), 2)
        state = system.start()
        way = np.random.default_rng(0).standard_normal(system.n_shape)
        way[system.n_vertex :] = 0.0
        ahead, behind = (system.terms(system.moved(state, s * 1e-5 * way, np.zeros(50))) for s in (1.0, -1.0))
        found = ((ahead.volumes - behind.volumes) / 2e-5)[:-1]
        _, volume = system.matrices(system.terms(state))
        errors.append(np.abs(volume.T @ way - found).max() / np.abs(found).max())
    assert errors[0] < 1e-3
    assert errors[1] < max(errors[0] / 20.0, 1e-8)


@pytest.mark.parametrize("name", CELLS)
def test_hessian_at_rest(bulging: dict[str, LayeredRelaxation], name: str) -> None:
    """Up to terms of the order of gap × change of curvature: what Newton's method gains in a step."""
    foam = bulging[name].foam
    system = LayeredSystem(foam, 2)
    state = system.start()
    hessian, _ = system.matrices(system.terms(state))
    rng, h = np.random.default_rng(0), 1e-5
    way = rng.standard_normal(system.n_shape)
    ahead, behind = (system.moved(state, s * h * way, np.zeros(50)) for s in (1.0, -1.0))
    found = (
        system.pull(system.terms(ahead), state.pressures) - system.pull(system.terms(behind), state.pressures)
    ) / (2 * h)
    assert np.linalg.norm(hessian @ way - found) < 1e-4 * np.linalg.norm(found)


@pytest.mark.parametrize("name", CELLS)
def test_fifty_bubbles(
    ruled: dict[str, wf.Relaxation], bulging: dict[str, LayeredRelaxation], name: str
) -> None:
    """It converges like the ruled one, to a lower energy, with pressures next to those of ruled films."""
    result = bulging[name]
    assert result.converged
    assert result.is_minimum
    assert result.residual < 1e-10
    assert result.volume_error < 1e-12
    assert "converged in" in result.message
    assert result.iterations <= 10
    saved = (result.ruled_energy - result.energy) / result.ruled_energy
    assert result.ruled_energy == pytest.approx(ruled[name].energy, rel=1e-12)
    low, high = {"sphere": (5e-8, 1e-7), "torus": (6e-6, 7e-6)}[name]
    assert low < saved < high
    apart = np.abs(result.pressures - ruled[name].pressures).max()
    assert 0.0 < apart < 1e-3 * np.ptp(ruled[name].pressures)
    assert abs(result.pressures.mean()) < 1e-14
    assert result.film_points.shape == (5, result.foam.network.n_films, 5, 3)


def test_pressures_are_slopes_in_volume(ruled: dict[str, wf.Relaxation]) -> None:
    """Gas moved from one bubble to another costs the difference of their pressures."""
    foam = ruled["torus"].foam.with_order(8)
    one = wf.relax(foam, layers=3)
    give, take, share = int(np.argmax(one.pressures)), int(np.argmin(one.pressures)), 2e-3
    energies = []
    for sign in (1.0, -1.0):
        targets = foam.target_volumes.copy()
        targets[take] += sign * share
        targets[give] -= sign * share
        other = wf.Foam(foam.cell, foam.network, foam.vertex_points, foam.film_offsets, targets)
        result = wf.relax(other, layers=3, t1=False)
        assert result.converged
        energies.append(result.energy)
    slope = (energies[0] - energies[1]) / (2.0 * share)
    assert slope == pytest.approx(one.pressures[take] - one.pressures[give], rel=1e-4)


def test_contact_at_right_angles_comes_out(ruled: dict[str, wf.Relaxation]) -> None:
    """On the sphere the error at the plates falls with the order of the films."""
    foam = ruled["sphere"].foam
    error = []
    for order in (4, 8):
        result = wf.relax(foam, order=order, layers=4)
        assert isinstance(result, LayeredRelaxation)
        error.append(result.contact_error)
        assert "not resolved" not in result.message
    assert error[0] < 1e-3
    assert error[1] < error[0] / 50.0


def test_films_too_coarse_for_their_contact_say_so() -> None:
    foam = wf.voronoi_foam(wf.HeleShawCell(wf.Sphere(1.0), gap=0.1), 12, seeds="lattice", order=2)
    result = wf.relax(foam, layers=2)
    assert isinstance(result, LayeredRelaxation)
    assert result.contact_error > 0.02
    assert "not resolved" in result.message


def test_films_meet_at_120_degrees_all_the_way_across(ruled: dict[str, wf.Relaxation]) -> None:
    """Three films leave each line in directions that add up to nothing, at every height."""
    foam = ruled["sphere"].foam
    errors = []
    for order in (4, 8):
        result = wf.relax(foam, order=order, layers=4)
        assert isinstance(result, LayeredRelaxation)
        slopes = lobatto(4).derivative / 0.3
        x = result.film_points
        along = np.einsum("ij,kfjx->kfix", lobatto(order).derivative, x)
        up = np.einsum("lk,kfix->lfix", slopes, x)
        up /= np.linalg.norm(up, axis=3, keepdims=True)
        out = along - np.einsum("kfix,kfix->kfi", along, up)[..., None] * up
        out /= np.linalg.norm(out, axis=3, keepdims=True)
        network = result.foam.network
        total = np.zeros((5, network.n_vertices, 3))
        for k in range(5):
            np.add.at(total[k], network.tails, out[k, :, 0])
            np.add.at(total[k], network.heads, -out[k, :, -1])
        errors.append(np.linalg.norm(total, axis=2).max())
    assert errors[1] < 1e-4
    assert errors[1] < errors[0] / 20.0


def test_planes_through_the_centre_stay() -> None:
    """A dodecahedron's films lie in planes through the centre: nothing to gain, contact exact."""
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    corners = [(0.0, a, b * golden) for a in (-1, 1) for b in (-1, 1)]
    faces = np.array([np.roll(c, s) for c in corners for s in range(3)])
    cell = wf.HeleShawCell(wf.Sphere(2.0), 0.4)
    foam = wf.voronoi_foam(cell, 12, seeds=2.0 * faces / np.linalg.norm(faces[0]))
    result = wf.relax(foam, order=8, layers=3)
    assert isinstance(result, LayeredRelaxation)
    assert result.converged
    # 21.89182969: length of the net on the unit sphere; (r + d)² − r² over 2
    assert result.energy == pytest.approx(21.89182969 * (2.4**2 - 2.0**2) / 2.0, rel=1e-8)
    assert result.energy == pytest.approx(result.ruled_energy, rel=1e-9)
    assert result.contact_error < 1e-7
    np.testing.assert_allclose(result.pressures, 0.0, atol=1e-6)


def test_between_planes_nothing_bulges() -> None:
    cell = wf.HeleShawCell(wf.FlatTorus(6.0, 5.0), 0.5)
    result = wf.relax(wf.voronoi_foam(cell, 30, seed=0), layers=2)
    assert isinstance(result, LayeredRelaxation)
    assert result.converged
    assert result.energy == pytest.approx(result.ruled_energy, rel=1e-12)
    assert result.contact_error < 1e-9


def test_on_an_ellipsoid_and_at_unequal_volumes() -> None:
    cell = wf.HeleShawCell(wf.Ellipsoid(5.0, 4.0, 3.0), 0.3)
    foam = wf.voronoi_foam(cell, 40, seed=2, volumes=0.2)
    result = wf.relax(foam, layers=3)
    assert isinstance(result, LayeredRelaxation)
    assert result.converged
    assert 1e-7 < 1.0 - result.energy / result.ruled_energy < 1e-4


def test_scale(ruled: dict[str, wf.Relaxation]) -> None:
    foam = ruled["sphere"].foam
    small = wf.HeleShawCell(wf.Sphere(4e-3), 0.3e-3)
    again = wf.Foam(small, foam.network, 1e-3 * foam.vertex_points, foam.film_offsets)
    one, two = (wf.relax(f, layers=2) for f in (foam, again))
    assert one.converged
    assert two.converged
    assert two.energy == pytest.approx(1e-6 * one.energy, rel=1e-11)


@pytest.mark.parametrize(("layers", "match"), [
    (0, "layers must be at least 1"), (9, "layers must be at most 8"), (2.0, "layers must be an integer"),
])  # fmt: skip
def test_bad_layers(ruled: dict[str, wf.Relaxation], layers: object, match: str) -> None:
    with pytest.raises((TypeError, ValueError), match=match):
        wf.relax(ruled["sphere"].foam, layers=layers)  # type: ignore[arg-type]


def test_an_unfinished_foam_is_not_let_go() -> None:
    foam = wf.voronoi_foam(CELLS["sphere"], 50, seed=1)
    result = wf.relax(foam, layers=4, max_iterations=1)
    assert not result.converged
    assert not isinstance(result, LayeredRelaxation)
    assert "not let go to bulge" in result.message


def test_markers_are_refused() -> None:
    with pytest.raises(ValueError, match="without marker vertices"):
        wf.relax(hemispheres(0.05, n_markers=4, order=8, tilt=0.1), layers=2)


def test_bulging_bubbles_hold_their_volumes_where_they_reach_round_the_tube() -> None:
    """The flux of θ (−y, x, 0) through their films, a field along the plates: neither fans nor forms."""
    cell = wf.HeleShawCell(wf.Torus(2.0, 1.0), 0.1)
    result = wf.relax(wf.voronoi_foam(cell, 12, seed=15, lloyd=2), order=12, layers=4)
    assert isinstance(result, LayeredRelaxation)
    assert result.converged
    along, up = lobatto(12), lobatto(4)
    x = result.film_points
    lines = np.einsum("ij,kfjx->kfix", along.derivative, x)
    rises = np.einsum("lk,kfjx->lfjx", up.derivative, x)
    network = result.foam.network
    found = np.zeros(12)
    middle = np.arctan2(*result.foam.bubble_centres[:, 1::-1].T)
    for bubble, sign in ((network.left, 1.0), (network.right, -1.0)):
        turned = np.arctan2(x[..., 1], x[..., 0]) - middle[bubble][:, None]
        theta = np.angle(np.exp(1j * turned))
        field = np.stack([-x[..., 1] * theta, x[..., 0] * theta, np.zeros_like(theta)], axis=-1)
        through = np.einsum("kfjx,kfjx->kfj", field, np.cross(lines, rises))
        np.add.at(found, bubble, sign * np.einsum("k,j,kfj->f", up.weights, along.weights, through))
    np.testing.assert_allclose(found, result.foam.target_volumes, rtol=2e-7)
