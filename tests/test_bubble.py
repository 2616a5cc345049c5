"""One bubble between plates: published digits, closed forms, theory to fourth order, forces, stability."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.kernels.lateral_film import film_grid
from warpedfoam.studies.bubble import critical_gap

TORUS = wf.Torus(20.0, 4.0)
CELL = wf.HeleShawCell(TORUS, 0.5)
SCALES = np.array([1.0, 2.0, 4.0, 8.0])


def on_torus(degrees: float, theta: float = 0.3) -> np.ndarray:
    return TORUS.points(np.radians(degrees), np.array(theta))


def ratio(bubble: wf.BubbleBetweenPlates) -> float:
    return bubble.energy / bubble.flat_energy


def on_sphere(radius: float, volume: float, gap: float = 0.5, **options: object) -> wf.BubbleBetweenPlates:
    cell = wf.HeleShawCell(wf.Sphere(radius), gap)
    return wf.bubble_between_plates(cell, volume, [0.0, 0.0, radius], **options)  # type: ignore[arg-type]


def second_order(k: np.ndarray, volume: float, gap: float) -> float:
    """E/E0 to second order in the curvatures of the surface midway between the plates."""
    k1, k2 = k / (1.0 + 0.5 * gap * k)
    rho2 = volume / (np.pi * gap)
    x = 0.5 * gap / np.sqrt(rho2)
    y = np.sqrt(3.0) * x
    mean, half = 0.5 * (k1 + k2), 0.5 * (k1 - k2)
    return float(
        1.0
        - k1 * k2 * (rho2 / 8.0 + gap**2 / 24.0)
        + mean**2 * rho2 / 2.0 * (1.0 + x**2 / 3.0 - np.tan(x) / x)
        + half**2 * (gap**2 / 48.0 + rho2 / 4.0 * (1.0 - x**2 - np.tanh(y) / y))
    )


# --- numbers ----------------------------------------------------------------------------------------


def test_sphere() -> None:
    """An independent axisymmetric computation to 1e-11; four layers, the default."""
    bubble = on_sphere(12.0, 0.5)
    assert bubble.converged
    assert bubble.energy == pytest.approx(1.77185042614, abs=1e-9)
    assert bubble.pressure == pytest.approx(1.770933247, abs=1e-7)
    np.testing.assert_allclose(bubble.contact_radii, [0.55166956, 0.57632222], atol=1e-7)
    assert ratio(on_sphere(10.0, 0.3)) == pytest.approx(0.999658749, abs=1e-9)
    assert ratio(on_sphere(10.0, 0.5)) == pytest.approx(0.999513760, abs=1e-9)


@pytest.mark.parametrize(("degrees", "free", "ruled"), [
    (0, 0.999517699, 0.999562686), (90, 1.000019111, 1.000072659), (180, 1.000791843, 1.000864669),
])  # fmt: skip
def test_torus(degrees: float, free: float, ruled: float) -> None:
    """An independent spectral computation to 1e-9, mean tube angle held."""
    assert ratio(wf.bubble_between_plates(CELL, 0.5, on_torus(degrees))) == pytest.approx(free, abs=2e-9)
    fine = wf.bubble_between_plates(CELL, 0.5, on_torus(degrees), layers=6)
    assert ratio(fine) == pytest.approx(free, abs=6e-10)
    flat = wf.bubble_between_plates(CELL, 0.5, on_torus(degrees), layers=1)
    assert ratio(flat) == pytest.approx(ruled, abs=6e-10)


@pytest.mark.parametrize(
    ("radius", "volume", "gap"),
    [(10.0, 0.3, 0.5), (26.0, 0.7, 0.5), (2.0, 0.9, 0.3), (1.0, 0.2, 0.1), (1.0, 0.15, 0.05)],
)
def test_ruled_films_on_spheres_are_cones(radius: float, volume: float, gap: float) -> None:
    """E = π r² σ2 sqrt(1 − (1 − 3V/2πσ3r³)²) with σ_n = (1 + d/r)^n − 1; the last reaches down to 57°."""
    sigma2, sigma3 = (1.0 + gap / radius) ** 2 - 1.0, (1.0 + gap / radius) ** 3 - 1.0
    cos = 1.0 - 3.0 * volume / (2.0 * np.pi * sigma3 * radius**3)
    bubble = on_sphere(radius, volume, gap, layers=1)
    assert bubble.energy == pytest.approx(np.pi * radius**2 * sigma2 * np.sqrt(1.0 - cos**2), rel=1e-11)
    np.testing.assert_allclose(
        bubble.contact_radii, np.array([radius, radius + gap]) * np.sqrt(1.0 - cos**2), rtol=1e-10
    )


def test_between_planes() -> None:
    cell = wf.HeleShawCell(wf.FlatTorus(5.0, 5.0), 0.4)
    bubble = wf.bubble_between_plates(cell, 0.6, [0.1, 0.2, 0.0])
    rho = np.sqrt(0.6 / (np.pi * 0.4))
    assert bubble.energy == pytest.approx(2.0 * np.pi * rho * 0.4, rel=1e-14)
    assert bubble.pressure == pytest.approx(1.0 / rho, rel=1e-13)
    np.testing.assert_allclose(bubble.contact_radii, rho, rtol=1e-13)
    np.testing.assert_allclose(bubble.force, 0.0, atol=1e-13)
    np.testing.assert_allclose(bubble.centroid, [0.1, 0.2, 0.2], atol=1e-14)


# --- convergence ------------------------------------------------------------------------------------


@pytest.mark.parametrize("surface", ["sphere", "torus"])
def test_spectral_convergence_in_layers(surface: str) -> None:
    """Energies fall towards the limit from above, a hundredfold and more with every two layers."""

    def at(layers: int) -> wf.BubbleBetweenPlates:
        if surface == "sphere":
            return on_sphere(8.0, 0.5, layers=layers)
        return wf.bubble_between_plates(CELL, 0.5, on_torus(180.0), layers=layers)

    limit = at(9)
    error = np.array([at(n).energy - limit.energy for n in (2, 4, 6)])
    assert (error[:2] > 0.0).all()
    assert error[1] < error[0] / 300.0
    assert abs(error[2]) < 1e-11
    contact = [at(n).contact_error for n in (2, 4, 6)] + [limit.contact_error]
    assert contact[3] < contact[2] / 5.0 < contact[1] / 50.0 < contact[0] / 500.0
    assert contact[2] < 1e-5  # 90° come out by themselves


def test_angles_converge() -> None:
    fine = wf.bubble_between_plates(CELL, 0.5, on_torus(140.0), angles=45)
    error = [
        abs(wf.bubble_between_plates(CELL, 0.5, on_torus(140.0), angles=m).energy - fine.energy)
        for m in (7, 11, 17)
    ]
    assert error[1] < error[0] / 100.0
    assert error[2] < 1e-10


def test_mean_curvature_is_constant() -> None:
    """2H = p at a place of rest; elsewhere the force that holds the bubble adds −F · r (φ − φ0) e_φ / V.

    H is computed from the film's two fundamental forms.
    """
    for degrees in (180.0, 120.0):
        _mean_curvature(wf.bubble_between_plates(CELL, 0.5, on_torus(degrees), layers=9, angles=41))


def _mean_curvature(bubble: wf.BubbleBetweenPlates) -> None:
    grid = film_grid(0.5, 9, 41, 8)
    x = bubble.points
    rise = np.linalg.solve(grid.rise.T @ grid.rise, grid.rise.T @ grid.climb)  # d/dt at the heights

    def by_t(y: np.ndarray) -> np.ndarray:
        return np.tensordot(rise, y, 1)

    a, b = grid.turn @ x, by_t(x)
    normal = np.cross(a, b)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)

    def dot(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.einsum("kjx,kjx->kj", u, v)

    e, f, g = dot(a, a), dot(a, b), dot(b, b)
    ll, m, n = dot(grid.turn @ a, normal), dot(grid.turn @ b, normal), dot(by_t(b), normal)
    twice = -(e * n - 2.0 * f * m + g * ll) / (e * g - f * f)
    (phi0,), _ = TORUS.angles(bubble.position[None])
    turn = TORUS.angles(x.reshape(-1, 3))[0].reshape(x.shape[:2]) - phi0
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    push = bubble.force @ TORUS.vertex_frames(bubble.position[None])[0, 0]
    wanted = bubble.pressure - push * 4.0 * turn / 0.5
    np.testing.assert_allclose(twice[1:-1], wanted[1:-1], rtol=2e-6)
    assert np.ptp(dot(by_t(b), normal)) > 1e-3  # it does bulge


# --- theory -----------------------------------------------------------------------------------------


def saddle(scale: float) -> wf.Graph:
    k = 2.0 * np.pi / (20.0 * scale)

    def height(x: np.ndarray) -> np.ndarray:
        return scale * (np.cos(k * x[:, 0]) - np.cos(k * x[:, 1]))

    def slope(x: np.ndarray) -> np.ndarray:
        return scale * k * np.stack([-np.sin(k * x[:, 0]), np.sin(k * x[:, 1])], axis=1)

    return wf.Graph(height, slope, 20.0 * scale, 20.0 * scale, periodic=True)


def torus_case(scale: float, degrees: float) -> tuple[wf.Surface, np.ndarray]:
    torus = wf.Torus(20.0 * scale, 4.0 * scale)
    return torus, torus.points(np.radians(degrees), np.array(0.2))


CASES = {
    "sphere": lambda s: (wf.Sphere(4.0 * s), [0.0, 0.0, 4.0 * s]),
    "torus 0": lambda s: torus_case(s, 0.0),
    "torus 45": lambda s: torus_case(s, 45.0),
    "torus 90": lambda s: torus_case(s, 90.0),
    "torus 180": lambda s: torus_case(s, 180.0),
    "cylinder": lambda s: (wf.Cylinder(4.0 * s, 20.0 * s, periodic=True), [4.0 * s, 0.0, 0.0]),
    "saddle": lambda s: (saddle(s), [0.0, 0.0, 0.0]),
    "beside the saddle": lambda s: (saddle(s), [2.0 * s, s, 0.0]),
    "Schwarz P": lambda s: (wf.SchwarzP(20.0 * s), [5.0 * s, 5.0 * s, 2.0 * s]),
}


@pytest.mark.parametrize("case", CASES)
def test_second_order_theory(case: str) -> None:
    """What is left falls with the fourth power of the curvature at fixed V and d: there is no third order."""
    left = []
    for scale in SCALES[:3]:
        surface, near = CASES[case](scale)
        bubble = wf.bubble_between_plates(wf.HeleShawCell(surface, 0.5), 0.5, near, layers=6)
        k = surface.principal_curvatures(bubble.position[None])[0]
        left.append(abs(ratio(bubble) - second_order(k, 0.5, 0.5)))
    slopes = np.log2(np.array(left[:-1]) / np.array(left[1:]))
    assert (slopes > 3.7).all()
    assert left[0] < 2e-5


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-4])
def test_thin_gaps(gap: float) -> None:
    """Round-off through the gap does not keep a bubble from its rest; theory holds there too."""
    bubble = wf.bubble_between_plates(
        wf.HeleShawCell(TORUS, gap), np.pi * 0.56**2 * gap, on_torus(0.0), layers=2
    )
    assert bubble.converged
    k = TORUS.principal_curvatures(bubble.position[None])[0]
    assert ratio(bubble) == pytest.approx(second_order(k, bubble.volume, gap), abs=2e-6)


# --- derivatives ------------------------------------------------------------------------------------


def test_pressure_is_the_slope_in_volume() -> None:
    h = 1e-3
    for layers in (1, 4):
        energies = [
            wf.bubble_between_plates(CELL, 0.5 + s * h, on_torus(70.0), layers=layers).energy
            for s in (-2, -1, 1, 2)
        ]
        slope = (energies[0] - 8 * energies[1] + 8 * energies[2] - energies[3]) / (12 * h)
        assert wf.bubble_between_plates(CELL, 0.5, on_torus(70.0), layers=layers).pressure == pytest.approx(
            slope, abs=1e-10
        )


@pytest.mark.parametrize("hold", ["centroid", "projection"])
@pytest.mark.parametrize("layers", [1, 3])
@pytest.mark.parametrize(("surface", "near"), [
    (TORUS, [17.0, 5.0, 2.0]),
    (wf.Cylinder(4.0, 20.0, periodic=True), [2.0, 3.0, 7.0]),
    (wf.Ellipsoid(6.0, 5.0, 4.0), [3.0, 3.0, 2.0]),
    (saddle(1.0), [4.0, 3.0, 0.0]),
    (wf.SchwarzP(20.0), [5.0, 5.0, 0.2]),
], ids=lambda v: type(v).__name__ if not isinstance(v, list) else "")  # fmt: skip
def test_force_is_the_slope_in_place(surface: wf.Surface, near: list[float], layers: int, hold: str) -> None:
    cell = wf.HeleShawCell(surface, 0.5)

    def at(point: object) -> wf.BubbleBetweenPlates:
        return wf.bubble_between_plates(cell, 0.5, point, layers=layers, hold=hold)  # type: ignore[arg-type]

    bubble, h = at(near), 0.03
    frame = surface.vertex_frames(bubble.position[None])[0]
    for way, e in zip(np.eye(2), frame, strict=True):
        energies = [
            at(surface.retract(bubble.position[None], (s * h * way)[None])[0]).energy for s in (-2, -1, 1, 2)
        ]
        slope = (energies[0] - 8 * energies[1] + 8 * energies[2] - energies[3]) / (12 * h)
        assert bubble.force @ e == pytest.approx(-slope, abs=2e-9)
    assert abs(bubble.force @ np.cross(*frame)) < 1e-14


def test_on_a_mesh() -> None:
    """The mesh's smooth surface is off by its own error; the bubble on it is as exact as on a formula."""
    mesh = wf.Sphere(4.0).triangulate(640)
    cell = wf.HeleShawCell(wf.MeshSurface(mesh.nodes, mesh.triangles), 0.5)
    bubble = wf.bubble_between_plates(cell, 0.5, [1.0, 2.0, 3.0], layers=3, angles=17)
    assert bubble.converged
    assert bubble.residual < 1e-11
    assert ratio(bubble) == pytest.approx(ratio(on_sphere(4.0, 0.5, layers=3)), abs=2e-5)


# --- what is held -----------------------------------------------------------------------------------


def test_the_projection_holds_the_centroid() -> None:
    for surface, near in ((TORUS, on_torus(77.0)), (wf.Ellipsoid(6.0, 5.0, 4.0), [3.0, 3.0, 2.0])):
        cell = wf.HeleShawCell(surface, 0.5)
        bubble = wf.bubble_between_plates(cell, 0.5, near, hold="projection")
        np.testing.assert_allclose(surface.project(bubble.centroid[None])[0], bubble.position, atol=1e-12)
    other = wf.bubble_between_plates(CELL, 0.5, on_torus(77.0))
    gap = np.linalg.norm(TORUS.project(other.centroid[None])[0] - other.position)
    assert 1e-5 < gap < 1e-2  # mean angles are another choice


def test_free_bubbles_come_to_rest() -> None:
    bubble = wf.bubble_between_plates(CELL, 0.5, on_torus(20.0), hold="free", layers=2, angles=17)
    assert bubble.converged
    assert abs(TORUS.angles(bubble.position[None])[0][0]) < 1e-5
    top = wf.bubble_between_plates(CELL, 0.5, on_torus(180.0), hold="free", layers=1, angles=25)
    assert not top.converged
    assert not top.is_minimum
    assert "not where the energy is least" in top.message
    round_ = on_sphere(12.0, 0.5, hold="free")
    np.testing.assert_allclose(round_.position, [0.0, 0.0, 12.0], atol=1e-12)
    assert round_.converged


# --- symmetry ---------------------------------------------------------------------------------------


def test_rotations_and_mirrors() -> None:
    one, turned, below = (
        wf.bubble_between_plates(CELL, 0.5, on_torus(d, t)) for d, t in ((60, 0.3), (60, -2.0), (-60, 0.3))
    )
    assert turned.energy == pytest.approx(one.energy, rel=1e-13)
    assert below.energy == pytest.approx(one.energy, rel=1e-13)
    np.testing.assert_allclose(below.force * [1, 1, -1], one.force, atol=1e-12)
    tilted = wf.bubble_between_plates(
        wf.HeleShawCell(wf.Sphere(12.0), 0.5), 0.5, 12.0 * np.array([0.6, 0.0, 0.8])
    )
    assert tilted.energy == pytest.approx(on_sphere(12.0, 0.5).energy, rel=1e-13)


@pytest.mark.parametrize("scale", [1e-6, 3.0, 1e5])
def test_scale(scale: float) -> None:
    one = wf.bubble_between_plates(CELL, 0.5, on_torus(60.0))
    torus = wf.Torus(20.0 * scale, 4.0 * scale)
    place = torus.points(np.radians(60.0), np.array(0.3))
    cell = wf.HeleShawCell(torus, 0.5 * scale)
    large = wf.bubble_between_plates(cell, 0.5 * scale**3, place)
    assert large.converged
    assert large.energy == pytest.approx(one.energy * scale**2, rel=1e-12)
    assert large.pressure == pytest.approx(one.pressure / scale, rel=1e-11)
    np.testing.assert_allclose(large.force, one.force * scale, atol=1e-11 * scale)


# --- stability --------------------------------------------------------------------------------------


def test_the_critical_gap_between_planes() -> None:
    """The Hessian turns at d = (π V)^(1/3) to four digits, and the result says so."""
    for share, stable in ((0.9999, True), (1.0001, False)):
        gap = share * critical_gap(0.5)
        bubble = wf.bubble_between_plates(
            wf.HeleShawCell(wf.FlatTorus(9.0, 9.0), gap), 0.5, [0.0, 0.0, 0.0], layers=8
        )
        assert bubble.is_minimum is stable
        assert bubble.converged is stable
        assert ("beyond (pi V)^(1/3)" in bubble.message) is not stable


def test_wide_gaps_on_spheres_are_flagged() -> None:
    wide = on_sphere(10.0, 0.5, 1.3)
    assert not wide.converged
    assert "beyond (pi V)^(1/3) = 1.162" in wide.message
    ruled = on_sphere(10.0, 0.5, 1.3, layers=1)
    assert ruled.converged
    assert "one that may bulge would be unstable" in ruled.message
    close = on_sphere(10.0, 0.5, 1.12)
    assert not close.converged
    assert "close to (pi V)^(1/3)" in close.message


# --- input ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("options", "match"), [
    ({"cell": TORUS}, "cell must be a HeleShawCell"),
    ({"volume": -1.0}, "volume must be greater than 0"),
    ({"volume": "big"}, "volume must be a number"),
    ({"volume": np.nan}, "volume must be finite"),
    ({"volume": 1e4}, "volume must be less than the cell's"),
    ({"volume": 60.0}, "too large for the surface"),
    ({"position": [1.0, 2.0]}, "position must have shape"),
    ({"position": [np.inf, 0.0, 0.0]}, "position must be finite"),
    ({"position": [0.0, 0.0, 0.0]}, "nearest point"),
    ({"layers": 0}, "layers must be at least 1"),
    ({"layers": 2.0}, "layers must be an integer"),
    ({"layers": 13}, "layers must be at most 12"),
    ({"hold": "tight"}, "hold must be one of"),
    ({"angles": 16}, "angles must be odd"),
    ({"angles": 3}, "angles must be at least 5"),
])  # fmt: skip
def test_bad_input(options: dict[str, object], match: str) -> None:
    good: dict[str, object] = {"cell": CELL, "volume": 0.5, "position": [24.0, 0.0, 0.0]}
    with pytest.raises((TypeError, ValueError), match=match):
        wf.bubble_between_plates(**{**good, **options})  # type: ignore[arg-type]


def test_too_large_for_a_surface_that_repeats() -> None:
    cell = wf.HeleShawCell(wf.FlatTorus(1.0, 1.0), 0.5)
    with pytest.raises(ValueError, match="too large"):
        wf.bubble_between_plates(cell, 0.4, [0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="too large"):
        wf.bubble_between_plates(wf.HeleShawCell(wf.Sphere(1.0), 0.1), 0.6, [0.0, 0.0, 1.0])


def test_results_are_read_only() -> None:
    bubble = on_sphere(12.0, 0.5)
    for name in ("position", "force", "contact_radii", "centroid", "points"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(bubble, name)[...] = 0.0
    assert bubble.points.shape == (5, bubble.points.shape[1], 3)


# --- the table --------------------------------------------------------------------------------------


def test_the_table_of_the_torus() -> None:
    """Every dE/dφ is that of the cosine series through its thirteen energies; some entries are made again."""
    path = Path(__file__).parents[1] / "data" / "torus_potential.csv"
    with path.open(newline="", encoding="utf-8") as stream:
        table = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(stream)]
    assert len(table) == 65
    phi, n = np.radians(np.arange(0, 181, 15)), np.arange(13)
    for volume in (0.3, 0.4, 0.5, 0.6, 0.7):
        part = [row for row in table if row["V"] == volume]
        for kind in ("free", "ruled"):
            energy = np.array([row[f"{kind}_energy"] for row in part])
            series = np.linalg.solve(np.cos(np.outer(phi, n)), energy)
            slope = -np.sin(np.outer(phi, n)) @ (n * series)
            np.testing.assert_allclose([row[f"{kind}_dE_dphi"] for row in part], slope, atol=2e-8)
        steepest = max(part, key=lambda row: row["free_dE_dphi"])
        assert steepest["phi_degrees"] in (105.0, 120.0)
    for row in table[4::17]:
        for kind, layers in (("free", 6), ("ruled", 1)):
            place = on_torus(row["phi_degrees"], 0.0)
            bubble = wf.bubble_between_plates(CELL, row["V"], place, layers=layers)
            assert bubble.energy == pytest.approx(row[f"{kind}_energy"], abs=2e-12)
            assert bubble.pressure == pytest.approx(row[f"{kind}_pressure"], abs=1e-11)
