"""``warpedfoam convert`` and ``warpedfoam info``."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import warpedfoam as wf
from warpedfoam.cli.app import app
from warpedfoam.cli.converting import WRITERS

from .io_foams import sphere_foam, with_pressures
from .test_io_files import _same


@pytest.fixture
def file(tmp_path: Path) -> str:
    return str(wf.save(tmp_path / "foam.npz", with_pressures(sphere_foam(20))))


def ran(*arguments: str, code: int = 0):
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == code, result.output
    return result


def test_every_ending_is_written(tmp_path: Path, file: str) -> None:
    targets = [str(tmp_path / f"out{ending}") for ending in WRITERS]
    facts = json.loads(ran("convert", file, *targets, "--json").stdout)
    assert set(targets) <= set(facts["written"])
    assert all(Path(name).exists() for name in facts["written"])


def test_the_foam_goes_round(tmp_path: Path, file: str) -> None:
    chain = [file, *(str(tmp_path / f"out{ending}") for ending in (".vtp", ".h5", ".hdf5", ".npz"))]
    for source, target in itertools.pairwise(chain):
        ran("convert", source, target)
        ran("convert", source, target)  # replaces what is there
    assert _same(wf.load(chain[-1]), wf.load(file))


def test_info(tmp_path: Path, file: str) -> None:
    foam = wf.load(file)
    facts = json.loads(ran("info", file, "--json").stdout)
    assert (facts["n_bubbles"], facts["n_films"], facts["surface"]) == (20, foam.network.n_films, "Sphere")
    assert (facts["energy"], facts["sum_of_charges"], facts["pressures"]) == (foam.energy, 12, True)
    assert "20 bubbles" in ran("info", file).stdout
    with wf.TrajectoryWriter(tmp_path / "run.h5") as writer:
        writer.append(sphere_foam(12))
        writer.append(sphere_foam(20), time=3.0)
    path = str(tmp_path / "run.h5")
    told = json.loads(ran("info", path, "--json").stdout)
    assert (told["frame"], told["n_frames"], told["time"], told["n_bubbles"]) == (1, 2, 3.0, 20)
    assert json.loads(ran("info", path, "--frame", "0", "--json").stdout)["n_bubbles"] == 12
    assert "holds 2 frames" in ran("info", path, "--frame", "2", code=2).stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["foam.npz", "out.xyz"], "must end in"),
        (["foam.npz", "foam.npz"], "it is the file to be read"),
        (["none.npz", "out.vtp"], "no such file"),
        (["foam.txt", "out.vtp"], "cannot read a foam"),
        (["foam.npz", "out.vtp", "--color-by", "area"], "--color-by is for"),
        (["foam.npz", "out.ply", "--color-by", "taste"], "color_by must be one of"),
    ],
)
def test_refusals_take_one_line(
    tmp_path: Path, file: str, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    said = ran("convert", *arguments, code=2).stderr
    assert words in said
    assert said.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["foam.npz"]
