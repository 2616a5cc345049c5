"""``warpedfoam coarsen`` and its picture: files, resuming, exit codes."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import warpedfoam as wf
from warpedfoam.cli.app import app

from .test_coarsening import relaxed


@pytest.fixture
def foam(tmp_path: Path) -> Path:
    return wf.save(tmp_path / "foam.npz", relaxed("sphere"))


def run(*words: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["coarsen", *map(str, words)])
    return done.exit_code, done.output


def test_writes_everything_and_goes_on(foam: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ("--every", 0.05, "-o", out)
    code, text = run(foam, "--duration", 0.1, *options, "--json")
    assert code == 0
    facts = json.loads(text.splitlines()[-1])
    names = {"coarsen.h5", "coarsening.csv", "foam.npz", "coarsening.png", "coarsen.json"}
    assert {p.name for p in out.iterdir()} == names == {Path(p).name for p in facts["outputs"]}
    assert json.loads((out / "coarsen.json").read_text()) == facts
    with open(out / "coarsening.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["time", "bubbles", "mean_area", "mu2", "energy", "error"]
    assert float(rows[0]["mean_area"]) == pytest.approx(4.0 * np.pi / 40)
    assert wf.load(out / "foam.npz").energy == pytest.approx(float(rows[-1]["energy"]), rel=1e-12)
    code, text = run(foam, "--until", 38, *options)
    assert code == 2
    assert "--resume" in text
    code, text = run(foam, "--until", 38, *options, "--resume", "--no-picture")
    assert code == 0
    assert "bubbles have vanished" in text
    with wf.Trajectory(out / "coarsen.h5") as frames:
        assert frames.times[:3].tolist() == pytest.approx([0.0, 0.05, 0.1])
        assert frames[-1].n_bubbles <= 38
    assert not (out / "coarsening.png").exists()


def test_needs_an_end(foam: Path, tmp_path: Path) -> None:
    code, text = run(foam, "-o", tmp_path / "out")
    assert code == 2
    assert "duration" in text
    assert "Traceback" not in text


def test_the_picture_shows_the_run() -> None:
    made = wf.coarsen(relaxed("sphere"), until=37)
    left, middle, right = wf.plot_coarsening(made).axes
    np.testing.assert_array_equal(left.lines[0].get_ydata(), made.step_bubbles)
    assert len(np.asarray(left.lines[1].get_xdata())) == made.n_t1
    np.testing.assert_array_equal(middle.lines[0].get_ydata(), made.step_mu2)
    np.testing.assert_array_equal(right.lines[0].get_ydata(), made.step_energies)
    assert wf.plot_coarsening(made, width=86.0).get_size_inches()[0] == pytest.approx(86.0 / 25.4)
    with pytest.raises(TypeError, match="Coarsening"):
        wf.plot_coarsening(made.foam)  # type: ignore[arg-type]
