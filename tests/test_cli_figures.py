"""``warpedfoam figures`` and ``warpedfoam potential``; rims under bubbles and circles."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import warpedfoam as wf
from warpedfoam import theory
from warpedfoam.cli.app import app
from warpedfoam.plot import figure_cylinder, figure_second_order
from warpedfoam.studies.paper_films import cylinder_films, scaled_films, torus_films

from .test_paper_figures import check_readable

ROOT = Path(__file__).parents[1]
TUBE = wf.Cylinder(6.0, 20.0)


def rows(path: Path) -> list[dict[str, float]]:
    with open(path, encoding="utf-8", newline="") as stream:
        return [{k: float(v or "nan") for k, v in row.items()} for row in csv.DictReader(stream)]


def call(*args: object, code: int = 0) -> str:
    done = CliRunner().invoke(app, [str(a) for a in args])
    assert done.exit_code == code, done.output
    return done.output


def test_figures_with_films_from_the_table(tmp_path: Path) -> None:
    table = ROOT / "data" / "torus_potential.csv"
    told = call("figures", "paper", "-o", tmp_path, "--only", "torus", "--only", "gap",
                "--torus-table", table, "--json")  # fmt: skip
    facts = json.loads(told)
    assert facts["figures"] == ["torus", "gap"]
    assert {p.name for p in tmp_path.iterdir()} == {
        "torus.png", "torus.csv", "torus_films.csv", "gap.png", "gap.csv", "figures.json",
    }  # fmt: skip
    films = rows(tmp_path / "torus_films.csv")
    assert len(films) == 65
    assert next(r for r in films if r["volume"] == 0.5)["ratio"] == pytest.approx(0.999517699, abs=1e-9)


def test_figures_for_a_column(tmp_path: Path) -> None:
    told = call("figures", "paper", "-o", tmp_path, "--only", "gap", "--width", "86", "--json")
    assert json.loads(told)["width_mm"] == 86.0
    with open(tmp_path / "gap.png", "rb") as stream:
        head = stream.read(24)
    # 160 dots an inch
    assert int.from_bytes(head[16:20], "big") == pytest.approx(86.0 / 25.4 * 160, abs=1)


def test_new_figures_can_be_read_on_a_column() -> None:
    films = cylinder_films(0.5, [0.5], [3.0, 6.0])
    drawn = figure_cylinder(0.5, (0.5,), radii=(3.0, 6.0), films=films, around=films, width=86.0)
    check_readable(drawn.figure, 86.0)
    scaled = scaled_films(0.5, 0.5, scales=(1.0, 2.0))
    along = {name: torus_films(0.5, [0.5], [0.0, 180.0], layers=n) for name, n in (("free", 3), ("ruled", 1))}
    check_readable(figure_second_order(films=scaled, along=along, width=86.0).figure, 86.0)


def test_films_are_those_of_the_table() -> None:
    kept = [r for r in rows(ROOT / "data" / "torus_potential.csv") if r["V"] == 0.5]
    fresh = torus_films(0.5, [0.5], [kept[0]["phi_degrees"], kept[-1]["phi_degrees"]])
    np.testing.assert_allclose(
        fresh["ratio"], [kept[0]["free_ratio"], kept[-1]["free_ratio"]], rtol=0, atol=2e-9
    )


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (["paper", "--width", "20"], "width must be at least 40"),
        (["nature"], "no figures 'nature'"),
        (["paper", "--only", "moon"], "no figure 'moon'"),
        (["paper", "--layers", "1"], "--layers must be from 2 to 12"),
        (["paper", "--torus-table", str(ROOT / "README.md")], "no table of films"),
    ],
)
def test_bad_figures(args: list[str], says: str, tmp_path: Path) -> None:
    assert says in call("figures", *args, "-o", tmp_path / "f", code=2)
    assert not (tmp_path / "f").exists()


def test_second_order_figure() -> None:
    """Errors fall at least as the third power of curvature, and the chart says so."""
    films = scaled_films(0.5, 0.5, (1.0, 2.0), cases=("sphere", "torus, 0°", "saddle"), layers=5)
    along = torus_films(0.5, [0.5], [0.0, 180.0])
    drawn = figure_second_order(films=films, along={"free": along, "ruled": along})
    slope = drawn.table["slope"]
    assert np.isnan(slope[::2]).all()
    assert (slope[1::2] > 3.7).all()


def test_cylinder_figure() -> None:
    """G = 0: the same energy at every place, off E0 as second-order theory says; it changes sign with V."""
    around = cylinder_films(0.5, [0.5], [6.0], places=3)
    assert np.ptp(around["ratio"]) < 1e-10
    films = cylinder_films(0.5, [0.3, 0.5], [6.0])
    drawn = figure_cylinder(volumes=(0.3, 0.5), radii=(6.0,), films=films, around=around)
    assert (drawn.table["ratio"][:2] - 1.0 > 0.0).tolist() == [False, True]
    np.testing.assert_allclose(drawn.table["ratio"], drawn.table["second_order"], rtol=0, atol=1e-8)


def test_potential_along_a_torus(tmp_path: Path) -> None:
    told = call("potential", "torus", "--along", 3, "--method", "theory,ruled", "-o", tmp_path, "--json")
    facts = json.loads(told)
    assert facts["methods"]["ruled"]["at_rest"] == 3
    found = rows(tmp_path / "potential.csv")
    k = theory.torus_curvatures(np.radians([0.0, 90.0, 180.0]), 20.0, 4.0)
    expected = theory.second_order_ratio(0.5, 0.5, *k)
    np.testing.assert_allclose([r["theory_ratio"] for r in found], expected, rtol=1e-12)
    assert found[2]["ruled_ratio"] == pytest.approx(1.000864669, abs=1e-8)
    assert (tmp_path / "potential.png").stat().st_size > 10_000


def test_potential_on_a_surface_with_rims(tmp_path: Path) -> None:
    """Places too close to the rim are blank, and that is no failure."""
    call("potential", "open-cylinder", "--points", 60, "-o", tmp_path, "--no-picture", "-q")
    found = rows(tmp_path / "potential.csv")
    blank = np.array([np.isnan(r["theory_energy"]) for r in found])
    high = np.abs([r["z"] for r in found])
    flat = np.sqrt(0.5 / (0.5 * np.pi))
    np.testing.assert_array_equal(blank, high > 10.0 - flat)
    assert blank.any()
    assert not blank.all()


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (["sphere", "--volume", "nan"], "--volume must be finite"),
        (["sphere", "--points", "3"], "--points must be at least 50"),
        (["sphere", "--method", "magic"], "--method must be one of"),
        (["sphere", "--method", "free,free"], "each method once"),
        (["torus", "--along", "1"], "--along must be at least 2"),
        (["torus", "--along", "3", "--volume", "50", "--method", "ruled"], "too large for the surface"),
        (["torus", "--gap", "1.2"], "less than d_crit"),
    ],
)
def test_bad_potentials(args: list[str], says: str, tmp_path: Path) -> None:
    assert says in call("potential", *args, "-o", tmp_path, code=2)
    assert list(tmp_path.iterdir()) == []


def test_bubbles_stay_within_the_rim() -> None:
    """One that just fits is as good as in the middle; drift paths end where the bubble touches the rim."""
    cell = wf.HeleShawCell(TUBE, 0.5)
    inner, middle = (wf.bubble_between_plates(cell, 0.5, [6.0, 0.0, z], layers=2) for z in (9.42, 0.0))
    assert inner.energy == pytest.approx(middle.energy, rel=1e-10)
    path = wf.drift_path(cell, 0.5, [6.0, 0.0, 8.0], method=lambda v, d, a, b: 1.0 + 0.0 * a)
    assert len(path.points) == 1  # no force
    bowl = wf.HeleShawCell(wf.Catenoid(6.0, 14.0), 0.5)
    end = wf.drift_path(bowl, 0.5, [6.0, 0.0, 0.5], method="theory").points[-1]
    assert 0.0 < 7.0 - abs(end[2]) < 0.6


def test_circles_stay_within_the_rim() -> None:
    """A circle next to the rim is as long as anywhere; a hole inside it is seen too."""
    assert wf.geodesic_circle(TUBE, [6.0, 0.0, 9.49], 0.5).perimeter == pytest.approx(np.pi, rel=1e-12)
    with pytest.raises(ValueError, match="over its rim"):
        wf.geodesic_circle(TUBE, [6.0, 0.0, 9.51], 0.5)
