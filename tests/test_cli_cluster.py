"""`warpedfoam cluster`: files, records, tables, pictures and refusals."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import warpedfoam as wf
from warpedfoam.cli.app import app

FLAT = ["--size", "width=12", "--size", "height=12", "--gap", "1", "--volume", "1"]


def run(*arguments: str):
    return CliRunner().invoke(app, ["cluster", *arguments])


def test_a_relaxed_cluster(tmp_path: Path) -> None:
    """Three bubbles of unit area on a sheet; what `foam` writes, and a record."""
    found = run("flat_torus", *FLAT, "-n", "3", "-o", str(tmp_path), "--json", "-q")
    assert found.exit_code == 0, found.output
    facts = json.loads(found.stdout)
    assert facts["energy"] == pytest.approx(8.793934, abs=1e-6)
    assert (facts["bubbles"], facts["exterior"], facts["exterior_euler"]) == (3, 3, -1)
    assert (facts["sum_of_charges"], facts["contacts"]) == (6, [])
    names = {"foam.ply", "foam_view.ply", "bubbles.csv", "films.csv", "foam.npz", "foam.png", "cluster.json"}
    assert {p.name for p in tmp_path.iterdir()} == names
    assert wf.load(tmp_path / "foam.npz").exterior == 3
    record = json.loads((tmp_path / "cluster.json").read_text(encoding="utf-8"))
    assert record["energy"] == facts["energy"]
    assert set(map(Path, record["outputs"])) == {tmp_path / name for name in names}


def test_the_summary(tmp_path: Path) -> None:
    found = run(
        "sphere", "--size", "radius=5", "-n", "2,1", "--centre", "5,0,0", "--centre", "0,5,0",
        "--order", "5", "--no-picture", "-o", str(tmp_path),
    )  # fmt: skip
    assert found.exit_code == 0, found.output
    for words in ("2,1 bubbles", "(radius 5.0)", "converged after", "0 joins", "charges add up to 12"):
        assert words in found.stdout
    assert not (tmp_path / "foam.png").exists()


def test_the_potential(tmp_path: Path) -> None:
    """A table of energies and forces along the tube, and its picture; the numbers of `cluster_potential`."""
    found = run("torus", "-n", "1", "--potential", "--places", "3", "-o", str(tmp_path), "--json", "-q")
    assert found.exit_code == 0, found.output
    facts = json.loads(found.stdout)
    assert facts["difference"] == pytest.approx(0.002307703, abs=1e-8)
    assert {p.name for p in tmp_path.iterdir()} == {
        "cluster_potential.csv",
        "cluster_potential.png",
        "cluster.json",
    }
    with (tmp_path / "cluster_potential.csv").open(encoding="utf-8") as stream:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(stream)]
    np.testing.assert_allclose([row["phi_degrees"] for row in rows], [0.0, 90.0, 180.0], atol=1e-9)
    assert rows[2]["energy"] - rows[0]["energy"] == pytest.approx(facts["difference"], abs=1e-12)
    assert rows[1]["force_along_phi"] < -1e-5
    assert all(row["minimum"] == 1.0 for row in rows)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("torus", "-n", "seven"), "write one number"),
        (("torus", "--centre", "24,0"), "write three numbers"),
        (("torus", "--centre", "a,b,c"), "write three numbers"),
        (("torus", "-n", "3,3", "--potential"), "for one cluster"),
        (("torus", "--potential", "--centre", "24,0,0"), "leave out --centre"),
        (("torus", "--potential", "--places", "1"), "--places must be at least 2"),
        (("torus", "--volume", "-1"), "--volume must be greater than 0"),
        (("torus", "--layout", "square"), "layout must be"),
        (("cube",), "cube"),
    ],
)
def test_refusals(arguments: tuple[str, ...], message: str, tmp_path: Path) -> None:
    found = run(*arguments, "-o", str(tmp_path / "out"))
    assert found.exit_code not in (0, None)
    assert message in found.output
    assert not (tmp_path / "out" / "cluster.json").exists()
