"""The geometric potential: bubbles and models side by side, forces, drift paths, the table, the picture."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

TORUS = wf.Torus(20.0, 4.0)
CELL = wf.HeleShawCell(TORUS, 0.5)
PHI = np.radians([0.0, 40.0, 90.0, 140.0, 180.0])
PATH = TORUS.points(PHI, np.full(5, 0.7))


def cylinder_model(volume: float, gap: float, k1: np.ndarray, k2: np.ndarray) -> np.ndarray:
    """E0 − E1 G, the paper's."""
    e0 = 2.0 * np.sqrt(np.pi * volume * gap)
    return np.asarray(e0 - np.sqrt(volume**3 / gap) / (3.0 * np.sqrt(np.pi)) * k1 * k2)


@pytest.fixture(scope="module")
def ruled() -> wf.GeometricPotential:
    return wf.geometric_potential(CELL, 0.5, path=PATH, method="ruled")


@pytest.fixture(scope="module")
def model() -> wf.GeometricPotential:
    return wf.geometric_potential(CELL, 0.5, path=PATH, method=cylinder_model)


def test_relaxed_bubbles(ruled: wf.GeometricPotential) -> None:
    for k in (1, 3):
        alone = wf.bubble_between_plates(CELL, 0.5, PATH[k], layers=1)
        assert ruled.energies[k] == alone.energy
        assert ruled.pressures[k] == alone.pressure
        np.testing.assert_array_equal(ruled.forces[k], alone.force)
    assert ruled.converged.all()
    assert (np.diff(ruled.energies) > 0.0).all()
    assert (ruled.layers, ruled.method) == (1, "ruled")
    free = wf.geometric_potential(CELL, 0.5, points=PATH[:1])
    assert free.lengths is None
    assert free.ratios[0] == pytest.approx(0.999517699, abs=2e-9)


def test_a_model_has_the_gradient_of_its_curvature(model: wf.GeometricPotential) -> None:
    """E = E0 − E1 cos φ / (r (R + r cos φ)): the force along e_φ in closed form."""
    e1 = np.sqrt(0.25) / (3.0 * np.sqrt(np.pi))
    gauss = np.cos(PHI) / (4.0 * (20.0 + 4.0 * np.cos(PHI)))
    np.testing.assert_allclose(model.energies, 2.0 * np.sqrt(0.25 * np.pi) - e1 * gauss, rtol=1e-14)
    slope = e1 * 20.0 * np.sin(PHI) / (4.0 * (20.0 + 4.0 * np.cos(PHI)) ** 2)
    along = np.einsum("nx,nx->n", model.forces, TORUS.vertex_frames(PATH)[:, 0])
    np.testing.assert_allclose(along, -slope / 4.0, atol=1e-10)
    across = np.einsum("nx,nx->n", model.forces, TORUS.vertex_frames(PATH)[:, 1])
    np.testing.assert_allclose(across, 0.0, atol=1e-13)
    assert model.method == "cylinder_model"


def test_theory_beside_films(tmp_path: Path) -> None:
    """To second order in the curvatures: within 2e-6 in E/E0 and a hundredth of the force on this torus."""
    films = wf.geometric_potential(CELL, 0.5, path=PATH)
    theory = wf.geometric_potential(CELL, 0.5, path=PATH, method="theory")
    assert (theory.method, theory.layers) == ("theory", 0)
    np.testing.assert_allclose(theory.ratios, films.ratios, atol=2e-6)
    assert np.abs(theory.ratios - films.ratios).max() > 1e-7
    strongest = np.linalg.norm(films.forces, axis=1).max()
    np.testing.assert_allclose(theory.forces, films.forces, atol=0.01 * strongest)
    assert wf.write_potential_csv(tmp_path / "both.csv", films, theory).exists()


def test_lengths_along_a_path() -> None:
    fine = TORUS.points(np.linspace(0.0, np.pi, 400), np.zeros(400))
    out = wf.geometric_potential(CELL, 0.5, path=fine, method=cylinder_model)
    assert out.lengths is not None
    assert out.lengths[-1] == pytest.approx(4.0 * np.pi, rel=1e-4)


@pytest.mark.parametrize("surface", [wf.Sphere(3.0), wf.Ellipsoid(3.0, 3.0, 3.0)])
def test_lengths_follow_the_surface_between_few_points(surface: wf.Sphere | wf.Ellipsoid) -> None:
    """A quarter of a great circle in 6 steps; chords would be 0.3 % short."""
    angle = np.linspace(0.0, 0.5 * np.pi, 7)
    path = 3.0 * np.stack([np.cos(angle), np.sin(angle), np.zeros(7)], axis=1)
    out = wf.geometric_potential(wf.HeleShawCell(surface, 0.1), 1e-3, path=path, method=cylinder_model)
    np.testing.assert_allclose(out.lengths, 3.0 * angle, rtol=1e-5)


def test_steps_right_through_a_body_are_straight() -> None:
    body = wf.HeleShawCell(wf.Ellipsoid(3.0, 2.0, 1.0), 0.1)
    out = wf.geometric_potential(body, 1e-3, path=[[3.0, 0.0, 0.0], [-3.0, 0.0, 0.0]], method=cylinder_model)
    np.testing.assert_allclose(out.lengths, [0.0, 6.0], rtol=1e-9)


def test_the_whole_surface() -> None:
    out = wf.geometric_potential(CELL, 0.5, nodes=500, method=cylinder_model)
    assert out.triangles is not None
    assert out.triangles.max() == len(out.points) - 1
    wanted = cylinder_model(0.5, 0.5, *TORUS.principal_curvatures(out.points).T)
    np.testing.assert_allclose(out.energies, wanted, rtol=1e-14)


def test_unstable_bubbles_leave_gaps() -> None:
    cell = wf.HeleShawCell(TORUS, 1.3)
    out = wf.geometric_potential(cell, 0.5, points=PATH[:2], layers=3)
    assert not out.converged.any()
    assert np.isnan(out.energies).all()
    assert np.isnan(out.forces).all()


@pytest.mark.parametrize("method", ["ruled", cylinder_model])
def test_drift_ends_at_the_outer_equator(method: object) -> None:
    """Along a meridian, downhill all the way; its length is that of the arc."""
    start = TORUS.points(np.array(1.2), np.array(-2.0))
    out = wf.drift_path(CELL, 0.5, start, method=method, step=0.9)  # type: ignore[arg-type]
    phi, theta = TORUS.angles(out.points)
    np.testing.assert_allclose(theta, -2.0, atol=1e-10)
    assert abs(phi[-1]) < 1e-2
    assert (np.diff(out.energies) < 0.0).all()
    assert out.lengths is not None
    assert out.lengths[-1] == pytest.approx(4.0 * 1.2, rel=2e-2)


def test_drift_bends_towards_steepest_descent() -> None:
    """On an ellipsoid every step goes along the force halfway through it."""
    surface = wf.Ellipsoid(8.0, 6.0, 5.0)
    out = wf.drift_path(wf.HeleShawCell(surface, 0.5), 0.5, [3.0, 4.0, 3.0], method=cylinder_model, step=0.2)
    middles = surface.project(0.5 * (out.points[1:] + out.points[:-1]))
    steps = np.diff(out.points, axis=0)[:10]
    force = wf.geometric_potential(out.cell, 0.5, points=middles[:10], method=cylinder_model).forces
    cosine = np.einsum("nx,nx->n", steps, force) / (
        np.linalg.norm(steps, axis=1) * np.linalg.norm(force, axis=1)
    )
    assert (cosine > 1.0 - 2e-5).all()
    assert abs(out.points[-1, 0]) > 7.9  # the sharpest end


def test_table(tmp_path: Path, ruled: wf.GeometricPotential, model: wf.GeometricPotential) -> None:
    path = wf.write_potential_csv(tmp_path / "p.csv", ruled, model)
    with path.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 5
    assert [float(r["ruled_energy"]) for r in rows] == ruled.energies.tolist()
    assert [float(r["cylinder_model_force_z"]) for r in rows] == model.forces[:, 2].tolist()
    assert {r["cylinder_model_pressure"] for r in rows} == {""}
    assert float(rows[0]["gaussian_curvature"]) == pytest.approx(1.0 / 96.0)
    assert list(rows[0])[:5] == ["x", "y", "z", "length", "gaussian_curvature"]


def test_table_refuses_what_does_not_belong_together(
    tmp_path: Path, ruled: wf.GeometricPotential, model: wf.GeometricPotential
) -> None:
    target = tmp_path / "p.csv"
    with pytest.raises(ValueError, match="at least one"):
        wf.write_potential_csv(target)
    with pytest.raises(ValueError, match="different methods"):
        wf.write_potential_csv(target, ruled, ruled)
    other = wf.geometric_potential(CELL, 0.5, points=PATH[:2], method=cylinder_model)
    with pytest.raises(ValueError, match="same cell and points"):
        wf.write_potential_csv(target, model, other)
    with pytest.raises(TypeError, match="potentials must be a GeometricPotential"):
        wf.write_potential_csv(target, 3)  # type: ignore[arg-type]
    assert not target.exists()


@pytest.mark.parametrize(("options", "match"), [
    ({"points": PATH, "path": PATH}, "points or path, not both"),
    ({"points": [[1.0, 2.0]]}, "points must have shape"),
    ({"path": PATH[:1]}, "path must hold at least 2"),
    ({"points": PATH, "method": "quick"}, "method must be one of"),
    ({"points": PATH, "layers": 1}, "layers must be at least 2"),
    ({"points": PATH, "hold": "free"}, "hold must be one of"),
    ({"nodes": 3}, "nodes must be at least 50"),
    ({"points": PATH, "method": lambda v, d, a, b: 1.0}, "the values of method must have shape"),
    ({"points": PATH, "volume": 0.0}, "volume must be greater than 0"),
])  # fmt: skip
def test_bad_input(options: dict[str, object], match: str) -> None:
    with pytest.raises((TypeError, ValueError), match=match):
        wf.geometric_potential(**{"cell": CELL, "volume": 0.5, **options})  # type: ignore[arg-type]


def test_drift_refuses(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="step must be greater than 0"):
        wf.drift_path(CELL, 0.5, PATH[0], step=0.0)
    with pytest.raises(wf.ConvergenceError, match="does not come to rest"):
        wf.drift_path(wf.HeleShawCell(TORUS, 1.3), 0.5, PATH[1], layers=2)


def test_pictures(model: wf.GeometricPotential) -> None:
    """The colours are those of the energies: extremes of E/E0 at the ends of the bar."""
    whole = wf.geometric_potential(CELL, 0.5, nodes=200, method=cylinder_model)
    for one in (whole, model):
        figure = wf.plot_potential(one)
        bar = figure.axes[-1]
        ticks = [float(t.get_text()) for t in bar.get_yticklabels()]
        assert ticks[0] == pytest.approx(one.ratios.min(), abs=2e-6)
        assert ticks[-1] == pytest.approx(one.ratios.max(), abs=2e-6)
        np.testing.assert_allclose(bar.get_ylim(), [one.ratios.min(), one.ratios.max()], rtol=1e-12)
        assert figure.axes[0].collections
    with pytest.raises(TypeError, match="potential must be a GeometricPotential"):
        wf.plot_potential(3)  # type: ignore[arg-type]
    wide = wf.geometric_potential(wf.HeleShawCell(TORUS, 1.3), 0.5, points=PATH[:1], layers=2)
    with pytest.raises(ValueError, match="no energy to draw"):
        wf.plot_potential(wide)


def test_the_page_on_films_runs() -> None:
    """docs/films_in_3d.md: its Python does what its text says."""
    text = (Path(__file__).parents[1] / "docs" / "films_in_3d.md").read_text(encoding="utf-8")
    space: dict[str, object] = {"__name__": "__main__"}
    for block in text.split("```python\n")[1:]:
        exec(compile(block.split("```")[0], "films_in_3d.md", "exec"), space)
    bubble, free, ruled = space["bubble"], space["free"], space["ruled"]
    assert isinstance(bubble, wf.BubbleBetweenPlates)
    assert bubble.message == "at rest"
    assert bubble.energy / bubble.flat_energy == pytest.approx(1.0000191, abs=5e-8)
    assert isinstance(free, wf.GeometricPotential)
    assert isinstance(ruled, wf.GeometricPotential)
    assert (free.energies < ruled.energies).all()
