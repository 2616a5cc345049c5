"""``warpedfoam drift``: files, resuming, exit codes."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import warpedfoam as wf
from warpedfoam.cli.app import app

from .test_motion import one_bubble


@pytest.fixture
def foam(tmp_path: Path) -> Path:
    return wf.save(tmp_path / "foam.npz", one_bubble(order=4))


def run(*words: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["drift", *map(str, words)])
    return done.exit_code, done.output


def test_writes_everything_and_goes_on(foam: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ("--every", 50, "--tolerance", 0.05, "-o", out)
    code, text = run(foam, "--duration", 100, *options, "--animation", "--json")
    assert code == 0
    facts = json.loads(text.splitlines()[-1])
    names = {"drift.h5", "energy.csv", "foam.npz", "drift.png", "drift.gif", "drift.json"}
    assert {p.name for p in out.iterdir()} == names == {Path(p).name for p in facts["outputs"]}
    assert json.loads((out / "drift.json").read_text()) == facts
    with open(out / "energy.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["time", "energy", "dissipation", "error"]
    energies = [float(row["energy"]) for row in rows]
    assert (np.diff(energies) < 0.0).all()
    assert wf.load(out / "foam.npz").energy == pytest.approx(energies[-1], rel=1e-12)
    assert facts["volume_error"] < 1e-10
    code, text = run(foam, "--duration", 150, *options)
    assert code == 2
    assert "--resume" in text
    code, text = run(foam, "--duration", 150, *options, "--resume", "--no-picture")
    assert code == 0
    assert "drifted for 150" in text
    with wf.Trajectory(out / "drift.h5") as frames:
        assert frames.times.tolist() == [0.0, 50.0, 100.0, 150.0]
    assert not (out / "drift.png").exists()


def test_a_run_that_stops_says_so(tmp_path: Path) -> None:
    small = wf.save(tmp_path / "small.npz", one_bubble(order=4, volume=0.05))
    code, text = run(
        small, "--duration", 1, "--no-pressure", "--tolerance", 0.1, "--no-picture", "-o", tmp_path / "out"
    )
    assert code == 1
    assert "all but vanished" in text


def test_bad_input(foam: Path, tmp_path: Path) -> None:
    for words, told in (
        (("--duration", -1), "duration must be greater than 0"),
        (("--duration", 1, "--friction", 0), "friction must be greater than 0"),
        (("--duration", 1, "--frame", 3, "--order", 99), "order must be at most"),
    ):
        code, text = run(foam, *words, "-o", tmp_path / "out")
        assert code == 2
        assert told in text
