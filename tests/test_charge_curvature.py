"""Charge against curvature: exact totals, closed forms of bands and caps, and ensembles within error bars."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import warpedfoam as wf
from warpedfoam.analysis import KINDS, band_curvatures
from warpedfoam.cli.app import app

from .io_foams import bubble_on_torus, sphere_foam, torus_foam
from .planted import icosahedron, subdivided

RING, TUBE = 8.0, 4.0
TORUS = wf.Torus(RING, TUBE)


def tube_angle(points: np.ndarray) -> np.ndarray:
    """|φ|, 0 on the outer equator and π on the inner one."""
    return np.abs(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]) - RING))


@pytest.fixture(scope="module")
def ensemble() -> list[wf.Foam]:
    """Relaxed random foams of 120 bubbles."""
    cell = wf.HeleShawCell(TORUS, gap=0.05)
    done = [wf.relax(wf.voronoi_foam(cell, 120, seed=seed)) for seed in range(12)]
    return [relaxed.foam for relaxed in done if relaxed.converged]


def test_bands_of_a_torus_have_closed_forms() -> None:
    """(3/π) ∫ G dA over φ0 < |φ| < φ1 is 12 (sin φ1 − sin φ0), with the square of the mesh width."""
    edges = np.linspace(0.0, np.pi, 7)
    exact = 12.0 * np.diff(np.sin(edges))
    errors = [
        np.abs(3 / np.pi * band_curvatures(TORUS, tube_angle, edges, n_nodes=n) - exact).max()
        for n in (8_000, 128_000)
    ]
    assert errors[1] < 1e-3
    assert errors[1] < errors[0] / 10.0  # four times finer


def test_caps_of_a_sphere_have_closed_forms() -> None:
    """6 (1 − cos θ), for any axis; an indicator of the cap will do too, if less exactly."""
    axis = np.array([0.6, 0.0, 0.8])
    sphere = wf.Sphere(2.0)

    def polar(points: np.ndarray) -> np.ndarray:
        return np.arccos(np.clip(points @ axis / 2.0, -1.0, 1.0))

    found = 3 / np.pi * band_curvatures(sphere, polar, [0.0, 0.7, np.pi])
    np.testing.assert_allclose(found, [6 * (1 - np.cos(0.7)), 6 * (1 + np.cos(0.7))], atol=2e-3)
    found = 3 / np.pi * band_curvatures(sphere, lambda x: polar(x) < 0.7, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(found[1], 6 * (1 - np.cos(0.7)), atol=2e-2)


def test_angles_may_jump() -> None:
    """φ itself, with its cut on the inner equator."""
    edges = np.linspace(-np.pi, np.pi, 5)

    def angle(points: np.ndarray) -> np.ndarray:
        return np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]) - RING)

    found = 3 / np.pi * band_curvatures(TORUS, angle, edges)
    np.testing.assert_allclose(found, 6.0 * np.diff(np.sin(edges)), atol=0.06)


def test_totals_are_exact() -> None:
    for surface in (wf.Sphere(1.0), TORUS, wf.Ellipsoid(2.0, 1.5, 1.0)):
        foam = wf.voronoi_foam(wf.HeleShawCell(surface, gap=0.01), 80, seed=2)
        profile = wf.charge_profile(foam, lambda x: x[:, 0], [-100.0, 0.0, 100.0])
        total = 6 * surface.euler_characteristic
        assert profile.charges.sum() == total
        assert profile.bubbles.sum() == 80
        assert profile.curvature.sum() == pytest.approx(total, abs=1e-4)
        assert profile.region_curvature.sum() == pytest.approx(total, abs=1e-9)
        assert profile.charge_error is None
        assert profile.difference_error is None
        charge, curvature = wf.charge_in(foam, lambda x: x[:, 0] < 0.0)
        assert charge == profile.charges[0, 0]
        assert curvature == pytest.approx(profile.curvature[0], abs=1e-12)


def test_edges_belong_to_one_band() -> None:
    """A band holds its lower edge, the last one its upper edge too: nothing is lost or counted twice."""
    foam = subdivided(icosahedron(), 3)
    z = foam.bubble_centres[:, 2]
    edges = np.unique(np.concatenate([[z.min(), z.max()], z[:7]]))
    profile = wf.charge_profile(foam, lambda x: x[:, 2], edges, n_nodes=0)
    assert profile.bubbles.sum() == foam.n_bubbles
    assert profile.charges.sum() == 12
    assert not profile.region_curvature.any()


def test_gauss_bonnet_in_regions(ensemble: list[wf.Foam]) -> None:
    """Charge less curvature of a set of bubbles is what the pressures do along its rim."""
    foam = ensemble[0]
    network, pressures = foam.network, foam.pressures
    assert pressures is not None
    inside = tube_angle(foam.bubble_centres) < np.pi / 2
    charge, curvature = wf.charge_in(foam, lambda x: tube_angle(x) < np.pi / 2)
    drop = (pressures[network.left] - pressures[network.right]) * foam.film_lengths
    # energies are per film area: a thin gap's pressure is γ κ
    rim = inside[network.left].astype(float) - inside[network.right]
    assert charge - curvature == pytest.approx(3 / np.pi * float(rim @ drop), abs=0.02)


def test_bands_of_an_ensemble_agree_with_curvature(ensemble: list[wf.Foam]) -> None:
    """Σ q = 0 for each foam; Q of the bands within error bars of (3/π) ∫ G dA, and not all of one sign."""
    assert len(ensemble) >= 11
    assert all(int(foam.network.charges.sum()) == 0 for foam in ensemble)
    edges = np.linspace(0.0, np.pi, 7)
    profile = wf.charge_profile(ensemble, tube_angle, edges)
    exact = 12.0 * np.diff(np.sin(edges))
    assert profile.charge_error is not None
    assert profile.difference_error is not None
    pull = (profile.charge - exact) / profile.charge_error
    assert (pull**2).mean() < 3.0
    assert np.abs(pull).max() < 4.0
    # the error bars are small enough to tell charge from none
    assert np.abs(exact / profile.charge_error)[[0, 1, 4, 5]].min() > 2.5
    halves = wf.charge_profile(ensemble, tube_angle, [0.0, np.pi / 2, np.pi])
    assert halves.charge[0] == pytest.approx(12.0, abs=4.0 * float(halves.charge_error[0]) + 0.5)
    assert halves.charge[0] > 8.0
    # made-up foams with their charges shuffled would fail: the same test on the mirrored profile
    assert (((profile.charge[::-1] - exact) / profile.charge_error) ** 2).mean() > 10.0


def test_standard_errors_are_those_of_the_mean(ensemble: list[wf.Foam]) -> None:
    profile = wf.charge_profile(ensemble, tube_angle, [0.0, 1.0, np.pi], n_nodes=0)
    spread = profile.charges.std(axis=0, ddof=1) / np.sqrt(len(ensemble))
    np.testing.assert_allclose(profile.charge_error, spread, rtol=1e-12)
    np.testing.assert_allclose(profile.charge, profile.charges.mean(axis=0), rtol=1e-12)


def test_energies_against_placement(ensemble: list[wf.Foam]) -> None:
    """Slopes are those of least squares, and planted slopes come back."""
    found = wf.charge_energies(ensemble, lambda x: np.cos(tube_angle(x)))
    assert found.energies.mean() == pytest.approx(1.0, rel=1e-12)
    design = np.stack([np.ones(len(ensemble)), found.placement, found.spread], axis=1)
    expected = np.linalg.lstsq(design, found.energies, rcond=None)[0]
    assert found.slope == pytest.approx(expected[1], rel=1e-6, abs=1e-12)
    assert found.spread_slope == pytest.approx(expected[2], rel=1e-6, abs=1e-12)
    assert found.slope_error > 0.0
    # charges cost energy in random foams
    assert found.spread_slope > 0.0


def test_exteriors_are_left_out() -> None:
    foam = bubble_on_torus()
    profile = wf.charge_profile(foam, lambda x: x[:, 0], [-10.0, 10.0], n_nodes=0)
    assert profile.bubbles.tolist() == [1.0]


def test_pictures(ensemble: list[wf.Foam], tmp_path: Path) -> None:
    profile = wf.charge_profile(ensemble[:3], tube_angle, np.linspace(0.0, np.pi, 5), n_nodes=2000)
    figures = {
        "profile": wf.plot_charge_profile(profile, coordinate="|φ|"),
        "energies": wf.plot_charge_energies(wf.charge_energies(ensemble, tube_angle)),
        "sides": wf.plot_sides(wf.foam_statistics(ensemble)),
        "correlations": wf.plot_correlations(wf.correlations(ensemble[:2])),
        "defects": wf.plot_defects(ensemble[0]),
        "order": wf.plot_order(ensemble[0]),
    }
    for name, figure in figures.items():
        path = wf.save_figure(tmp_path / f"{name}.png", figure, dpi=40)
        assert path.stat().st_size > 2000
    # what the picture of a profile shows is the profile
    line = figures["profile"].axes[0].lines
    shown = [entry.get_ydata() for entry in line if len(entry.get_ydata()) == 4]
    assert any(np.allclose(y, profile.charge) for y in shown)
    assert {t.get_text() for t in figures["defects"].legends[0].get_texts()} != set()


def test_one_foam_has_no_error_bars() -> None:
    profile = wf.charge_profile(torus_foam(), lambda x: x[:, 2], [-2.0, 0.0, 2.0], n_nodes=500)
    assert wf.plot_charge_profile(profile).axes[0].get_title() == "1 foam, no error bars"


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda f: wf.charge_profile(f, "x", [0, 1]), "coordinate must be a function"),
        (lambda f: wf.charge_profile(f, lambda x: x[:3, 0], [0, 1]), "coordinate must have shape"),
        (lambda f: wf.charge_profile(f, lambda x: x[:, 0] * np.nan, [0, 1]), "coordinate must be finite"),
        (lambda f: wf.charge_profile(f, lambda x: x[:, 0], [1, 0]), "ascending"),
        (lambda f: wf.charge_profile(f, lambda x: x[:, 0], [1]), "at least two"),
        (lambda f: wf.charge_profile([f, torus_foam()], lambda x: x[:, 0], [0, 1]), "one surface"),
        (lambda f: wf.charge_in(f, lambda x: x[:, 0]), "one True or False per point"),
        (lambda f: wf.charge_in(f, 3), "inside must be a function"),
        (lambda f: wf.charge_energies([f] * 3, lambda x: x[:, 0]), "at least 5 foams"),
        (lambda f: wf.charge_energies([f] * 5 + [sphere_foam(9)], lambda x: x[:, 0]), "equally many bubbles"),
    ],
)
def test_bad_input(call, match: str) -> None:
    with pytest.raises((ValueError, TypeError), match=match):
        call(sphere_foam(20))


def test_columns_as_csv(tmp_path: Path) -> None:
    found = wf.defects(sphere_foam(40))
    path = wf.write_columns_csv(tmp_path / "clusters.csv", found.columns("clusters"))
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [row["kind"] for row in rows] == found.clusters.kind.tolist()
    assert [float(row["burgers_y"]) for row in rows] == found.clusters.burgers[:, 1].tolist()
    with pytest.raises(ValueError, match="equal length, got a 2, b 3"):
        wf.write_columns_csv(path, {"a": np.zeros(2), "b": np.zeros(3)})
    with pytest.raises(TypeError, match="must be an array of one axis"):
        wf.write_columns_csv(path, {"a": np.zeros((2, 2))})


def test_command(tmp_path: Path, ensemble: list[wf.Foam]) -> None:
    state = wf.save(tmp_path / "foam.npz", ensemble[0])
    done = CliRunner().invoke(app, ["defects", str(state or tmp_path / "foam.npz"), "--json"])
    assert done.exit_code == 0
    facts = json.loads(done.output)
    found = wf.defects(ensemble[0])
    assert facts["total_charge"] == 0
    assert facts["clusters"] == found.kinds
    names = {"disclinations.csv", "clusters.csv", "dislocations.csv", "defects.png", "defects.json"}
    assert {p.name for p in tmp_path.iterdir()} == names | {"foam.npz"}
    assert json.loads((tmp_path / "defects.json").read_text())["charges"] == facts["charges"]
    rows = (tmp_path / "disclinations.csv").read_text().splitlines()
    assert rows[0].startswith("disclination,bubble,id,sides,charge,cluster,x,y,z")
    assert len(rows) == 1 + facts["charged_bubbles"]


def test_command_for_readers(tmp_path: Path, ensemble: list[wf.Foam]) -> None:
    wf.save(tmp_path / "foam.npz", ensemble[1])
    out = tmp_path / "new" / "folder"
    given = ["defects", str(tmp_path / "foam.npz"), "-o", str(out), "--no-picture"]
    done = CliRunner().invoke(app, given)
    assert done.exit_code == 0
    assert "clusters of charged bubbles" in done.output
    assert "120 bubbles, Euler characteristic 0" in done.output
    assert not (out / "defects.png").exists()
    (out / "defects.png").write_text("of an earlier run")
    assert CliRunner().invoke(app, [*given, "--quiet"]).output == ""
    assert not (out / "defects.png").exists()
    taken = CliRunner().invoke(app, [*given[:2], "-o", str(tmp_path / "foam.npz")])
    assert taken.exit_code == 2
    for bad in (["nowhere.npz"], [str(tmp_path / "foam.npz"), "--tiny", "7"]):
        assert CliRunner().invoke(app, ["defects", *bad]).exit_code == 2


def test_page_on_defects() -> None:
    """The code of the page runs and does what its text says."""
    text = (Path(__file__).parents[1] / "docs" / "defects.md").read_text(encoding="utf-8")
    space: dict = {"__name__": "__main__"}
    for block in re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        exec(compile(block, "defects.md", "exec"), space)
    assert space["profile"].charges.shape == (3, 6)
    assert space["found"].screening_length > 0.0
    for kind in KINDS:
        assert f"`{kind}`" in text
