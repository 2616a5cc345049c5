"""The commands among themselves: the same files, the same options, examples that run."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import warpedfoam as wf
from warpedfoam.cli.app import app
from warpedfoam.cli.converting import WRITERS
from warpedfoam.cli.examples import EXAMPLES

from .io_foams import sphere_foam, with_pressures
from .test_io_files import _same

ROOT = Path(__file__).parents[1]
FOAM = with_pressures(sphere_foam(12))
#: What makes an example small enough for a test, put behind it: the last of two equal options counts.
SMALLER: dict[str, list[str]] = {
    "run": ["--set", "foam.n_bubbles=80", "--no-picture"],
    "foam": ["-n", "80", "--no-picture"],
    "potential": ["--points", "60", "--no-picture"],
    "relax": ["--order", "5", "--no-picture"],
    "cluster": ["-n", "3", "--no-picture"],
    "drift": ["--no-picture"],
    "figures": ["--only", "curvature"],
    "ensemble": [
        "--set", "repeats=1", "--set", "grid.surface.aspect_ratio=[2.0]", "--set", "foam.n_bubbles=60",
        "--workers", "0",
    ],
    "partition": ["--starts", "2", "--hops", "1", "--no-picture"],
    "defects": ["--no-picture"],
}  # fmt: skip


def call(*words: str | Path) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.mark.slow
def test_the_first_example_of_every_command_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In one folder, one after the other, as a newcomer types them."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "examples", "examples", ignore=shutil.ignore_patterns("*.py"))
    Path("data").mkdir()
    shutil.copy(ROOT / "data" / "double_torus.ply", "data")
    verbs = ["foam", "run", *(name for name in EXAMPLES if name not in ("", "foam", "run"))]
    for verb in verbs:
        words = EXAMPLES[verb][0].split()
        assert words[:2] == ["warpedfoam", verb]
        result = call(*words[1:], *SMALLER.get(verb, []), "--quiet")
        assert (result.exit_code, result.stderr) == (0, ""), (verb, result.output)
    assert {"foam.vtp", "foam.glb", "foam.pdf", "out", "relaxed", "tori"} <= {
        p.name for p in tmp_path.iterdir()
    }


def sources(folder: Path) -> dict[str, Path]:
    """The foam in every file that holds one; in the trajectory it is the first frame of two."""
    with wf.TrajectoryWriter(folder / "f.h5") as writer:
        writer.append(FOAM)
        writer.append(sphere_foam(20), time=2.0)
    shutil.copy(folder / "f.h5", folder / "f.hdf5")
    found = {".npz": wf.save(folder / "f.npz", FOAM), ".vtp": wf.write_vtp(folder / "f.vtp", FOAM)}
    return {**found, ".h5": folder / "f.h5", ".hdf5": folder / "f.hdf5"}


def test_every_file_that_holds_a_foam_becomes_every_other(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    for ending, file in sources(tmp_path).items():
        targets = [out / f"from{ending}{other}" for other in WRITERS]
        frame = ["--frame", "0"] if ending in (".h5", ".hdf5") else []
        result = call("convert", file, *targets, *frame)
        assert (result.exit_code, result.stderr) == (0, ""), result.output
        assert all(target.exists() for target in targets)
        assert _same(wf.load(out / f"from{ending}.npz"), FOAM)
        assert _same(wf.read_vtp(out / f"from{ending}.vtp"), FOAM)
        for other in (".h5", ".hdf5"):
            with wf.Trajectory(out / f"from{ending}{other}") as frames:
                assert len(frames) == 1
                assert _same(frames[0], FOAM)
        # the rest from one source is the rest from another
        for other in (".obj", ".csv", ".json", ".graphml", ".fe", ".ply", ".glb"):
            assert (out / f"from{ending}{other}").read_bytes() == (out / f"from.npz{other}").read_bytes()


@pytest.mark.parametrize("ending", [".ply", ".obj", ".glb", ".csv", ".json", ".fe", ".toml", ".txt", ""])
def test_what_cannot_be_read_or_written_is_refused_with_what_can(tmp_path: Path, ending: str) -> None:
    file = tmp_path / f"foam{ending}"
    file.write_text("anything")
    for verb in ("convert", "info", "relax", "plot", "defects", "view", "drift"):
        more = {"convert": [tmp_path / "o.vtp"], "drift": ["--duration", "1"]}.get(verb, [])
        result = call(verb, file, *more)
        assert result.exit_code == 2
        assert ".npz, .vtp, .h5 or .hdf5" in result.stderr, verb
        assert result.stderr.count("\n") == 1
    wf.save(tmp_path / "sound.npz", FOAM)
    if ending not in WRITERS:
        said = call("convert", tmp_path / "sound.npz", file).stderr
        assert all(other in said for other in WRITERS)
    assert file.read_text() == "anything"


def test_the_same_files_for_every_command(tmp_path: Path) -> None:
    found = sources(tmp_path)
    for ending, file in found.items():
        frame = ["--frame", "0"] if ending in (".h5", ".hdf5") else []
        facts = json.loads(call("info", file, *frame, "--json").stdout)
        assert facts["energy"] == FOAM.energy
        facts = json.loads(
            call("defects", file, *frame, "-o", tmp_path / "d", "--no-picture", "--json").stdout
        )
        assert facts["bubbles"] == 12
        assert call("view", file, *frame, "-o", tmp_path / "v.html", "-q").exit_code == 0
    facts = json.loads(call("view", found[".h5"], found[".npz"], "-o", tmp_path / "v.html", "--json").stdout)
    assert facts["bubbles"] == [12, 20, 12]
    page = (tmp_path / "v.html").read_text(encoding="utf-8")
    assert "f, time 0" in page
    assert "f, time 2" in page
    for verb in ("info", "defects", "view", "plot"):
        said = call(verb, found[".h5"], "--frame", "7")
        assert said.exit_code == 2
        assert "holds 2 frames, numbered from 0" in said.stderr


def test_pictures_are_left_out_where_one_likes(tmp_path: Path) -> None:
    small = ["--seeds", "lattice", "-n", "16", "-q", "-o", tmp_path / "out"]
    assert call("foam", "sphere", *small, "--no-picture").exit_code == 0
    assert not (tmp_path / "out" / "foam.png").exists()
    toml = tmp_path / "foam.toml"
    toml.write_text("[surface]\nkind = 'sphere'\n[foam]\nn_bubbles = 16\nseeds = 'lattice'\n")
    for given, there in (([], True), (["--no-picture"], False), (["--picture"], True)):
        assert call("run", toml, "-q", "-o", tmp_path / "run", *given).exit_code == 0
        assert (tmp_path / "run" / "foam.png").exists() is there


def test_too_much_is_one_line(tmp_path: Path) -> None:
    """No memory holds the lattice of seeds, and the line stays short."""
    for words in (["--major-radius", "1e20"], ["--color-by", "x" * 10_000]):
        result = call("foam", "torus", *words, "-o", tmp_path / "out")
        assert result.exit_code == 2, result.output
        assert result.stderr.count("\n") == 1
        assert len(result.stderr) < 1100
        assert "Traceback" not in result.stderr


@pytest.mark.parametrize("verb", ["info", "convert", "defects", "view", "plot", "relax"])
def test_damaged_files_are_one_line_and_2(verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    more = ["out.obj"] if verb == "convert" else []
    for ending, file in sources(tmp_path).items():
        data = file.read_bytes()
        for damaged in (
            b"",
            data[: len(data) // 2],
            data[: len(data) // 2] + b"\x00\xff" + data[len(data) // 2 + 2 :],
        ):
            Path(f"bad{ending}").write_bytes(damaged)
            result = call(verb, f"bad{ending}", *more)
            assert result.exit_code == 2, result.output
            assert result.stderr.count("\n") == 1
            assert f"bad{ending}" in result.stderr
    assert not Path("out.obj").exists()
