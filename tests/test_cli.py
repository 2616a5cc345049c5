"""The command line: exit codes, options, outputs, and runs that are interrupted."""

from __future__ import annotations

import inspect
import json
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import warpedfoam.io
from warpedfoam.cli.app import app
from warpedfoam.cli.job import run_job
from warpedfoam.studies.options import options_from, read_options

SMALL = ["--seeds", "lattice", "-n", "16"]
OUTPUTS = {
    "foam.ply", "foam_view.ply", "bubbles.csv", "films.csv", "foam.npz", "foam.png", "record.json",
}  # fmt: skip
TOML = """
seed = 3
[surface]
kind = "sphere"
radius = 2.0
[cell]
gap = 0.1
[foam]
n_bubbles = 16
seeds = "lattice"
[relax]
order = 3
[output]
picture = false
"""
posix = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(a) for a in arguments])


def python(code: str, *arguments: str | Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def warpedfoam_command(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "warpedfoam.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.fixture
def toml(tmp_path: Path) -> Path:
    path = tmp_path / "foam.toml"
    path.write_text(TOML)
    return path


def test_foam_writes_every_output_and_exits_0(tmp_path: Path) -> None:
    out = tmp_path / "made" / "by itself"
    result = call("foam", "sphere", *SMALL, "-o", out)
    assert result.exit_code == 0, result.output
    assert {p.name for p in out.iterdir()} == OUTPUTS
    record = json.loads((out / "record.json").read_text())
    assert set(record["outputs"].values()) == {str(out / name) for name in OUTPUTS}
    assert record["converged"] is True
    assert record["is_minimum"] is True
    assert record["residual"] <= 1e-10
    assert record["sum_of_charges"] == 12
    assert sum(record["sides"].values()) == record["n_bubbles"] == 16
    assert record["options"]["surface"] == {"kind": "sphere", "radius": 10.0}
    assert record["options"]["foam"]["n_bubbles"] == 16
    assert record["versions"]["numpy"] == np.__version__
    assert record["t1"]["count"] == len(record["t1"]["events"]) == record["n_t1"]
    assert record["timings"]["build"] > 0.0
    foam = warpedfoam.io.load(out / "foam.npz")
    assert foam.energy == record["energy"]
    for word in ("converged", "16 bubbles on a sphere", "6 x 2", "foam.png"):
        assert word in result.stdout


def test_options_reach_the_foam(tmp_path: Path) -> None:
    result = call(
        "foam", "torus", "-n", "40", "--major-radius", "5", "--minor-radius", "2", "--gap", "0.1",
        "--seed", "7", "--seeds", "blue", "--lloyd", "1", "--volumes", "0.1", "--order", "3",
        "--color-by", "pressure", "-o", tmp_path, "--json",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    foam = warpedfoam.io.load(tmp_path / "foam.npz")
    assert (foam.cell.surface.major_radius, foam.cell.surface.minor_radius) == (5.0, 2.0)
    assert foam.cell.gap == 0.1
    assert foam.n_bubbles == 40
    assert foam.order == 3
    assert 0.02 < np.log(foam.target_volumes).std() < 0.3
    options = json.loads((tmp_path / "record.json").read_text())["options"]
    assert options["seed"] == 7
    assert options["foam"]["seeds"] == "blue"
    assert options["foam"]["lloyd"] == 1
    assert options["output"]["color_by"] == "pressure"


def test_run_reads_toml_and_overrides(toml: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    sets = ["--set", "cell.gap=0.2", "--set", "foam.n_bubbles=14"]
    result = call("run", toml, "-o", out, *sets, "--seed", 5, "--json")
    assert result.exit_code == 0, result.output
    summary = json.loads(result.stdout)
    assert summary["n_bubbles"] == 14
    assert summary["seed"] == 5
    assert "events" not in summary["t1"]
    foam = warpedfoam.io.load(out / "foam.npz")
    assert foam.cell.gap == 0.2
    assert foam.order == 3
    assert not (out / "foam.png").exists()


def test_same_job_with_and_without_a_file(toml: Path, tmp_path: Path) -> None:
    by_file, by_hand = tmp_path / "a", tmp_path / "b"
    assert call("run", toml, "-o", by_file, "-q").exit_code == 0
    arguments = ["--radius", "2", "--gap", "0.1", "--order", "3", "--seed", "3"]
    assert call("foam", "sphere", *SMALL, *arguments, "-o", by_hand, "-q").exit_code == 0
    for name in ("foam.npz", "bubbles.csv", "foam.ply"):
        assert (by_file / name).read_bytes() == (by_hand / name).read_bytes()


def test_not_converged_is_1_and_marked(toml: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = call("run", toml, "-o", out, "--set", "relax.max_iterations=1", "--json", "--quiet")
    assert result.exit_code == 1
    assert json.loads(result.stdout)["converged"] is False
    assert "did not converge" in result.stderr
    assert json.loads((out / "record.json").read_text())["converged"] is False
    assert (out / "foam.ply").exists()
    assert "NOT CONVERGED" in call("run", toml, "-o", out, "--set", "relax.max_iterations=1").stdout


def test_quiet_says_nothing(toml: Path, tmp_path: Path) -> None:
    result = call("run", toml, "-o", tmp_path / "out", "--quiet")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


BAD = [
    (["foam", "torus", "--gap", "17"], "gap"),
    (["foam", "torus", "--major-radius", "3"], "major_radius must exceed minor_radius"),
    (["foam", "torus", "--minor-radius", "-1"], "surface.minor_radius must be greater than 0"),
    (["foam", "sphere", "--radius", "nan"], "surface.radius must be finite"),
    (["foam", "sphere", "-n", "0"], "foam.n_bubbles must be at least 1"),
    (["foam", "sphere", "--seed", "-1"], "seed must be at least 0"),
    (["foam", "sphere", "--seeds", "rnadom"], "'random'"),
    (["foam", "sphere", "--lloyd", "-2"], "foam.lloyd must be at least 0"),
    (["foam", "sphere", "--volumes", "-0.1"], "foam.volumes must be at least 0"),
    (["foam", "sphere", "--order", "1"], "relax.order must be at least 2"),
    (["foam", "sphere", "--order", "25"], "relax.order must be at most 24"),
    (["foam", "sphere", "--color-by", "taste"], "output.color_by must be one of"),
    (["run", "no_such_file.toml"], "no_such_file.toml: No such file"),
]


@pytest.mark.parametrize(("arguments", "words"), BAD, ids=[" ".join(a) for a, _ in BAD])
def test_bad_input_is_2_with_one_line(arguments: list[str], words: str, tmp_path: Path) -> None:
    result = call(*arguments, "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert words in result.stderr
    assert result.stderr.count("\n") == 1
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[foam]\nn_bubles = 3", "unknown option foam.n_bubles; did you mean foam.n_bubbles?"),
        ("gap = 0.5", "unknown option gap; did you mean cell.gap?"),
        ("[foams]\nlloyd = 1", "unknown section foams; did you mean foam?"),
        ("[relax]\nxyz = 1", "unknown option relax.xyz; options are relax.order"),
        ("[surface]\nkind = 'sphere'\nmajor_radius = 2.0", "unknown option surface.major_radius"),
        ("[surface]\nkind = 'klein'", "surface.kind must be one of 'torus', 'sphere'"),
        ("[surface]\nmajor_radius = '20'", "surface.major_radius must be a number, got str '20'"),
        ("[foam]\nn_bubbles = 200.5", "foam.n_bubbles must be an integer"),
        ("[foam]\nn_bubbles = true", "foam.n_bubbles must be an integer"),
        ("[foam]\nseeds = 3", "foam.seeds must be one of"),
        ("[foam]\nseeds = [[1.0, 2.0]]", "foam.seeds must have shape (n, 3)"),
        ("[foam]\nvolumes = ['a']", "foam.volumes must hold real numbers"),
        ("[foam]\nvolumes = nan", "foam.volumes must be finite"),
        ("[relax]\nt1 = 'yes'", "relax.t1 must be True or False"),
        ("[relax]\ntolerance = 0.0", "relax.tolerance must be at least"),
        ("[relax]\nsolver = 'mumps'", "relax.solver must be one of"),
        ("[output]\nfolder = 3", "output.folder must be a text"),
        ("seed = 1.0", "seed must be an integer"),
        ("foam = 3", "foam must be a section"),
        ("[cell]\ngap = 30.0", "folds the outer plate"),
        ("[cell\ngap = 1", "is not a TOML file"),
    ],
)
def test_bad_toml_names_option_and_file(
    text: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the words are looked at below
        read_options(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert call("run", path).exit_code == 2
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("foam.n_bubbles", "write it as section.name=value"),
        ("foam.n_bubbles=", "write it as section.name=value"),
        ("foam.n_bubles=3", "--set foam.n_bubles=3: unknown option foam.n_bubles"),
        ("foam.n_bubbles=many", "--set foam.n_bubbles=many: foam.n_bubbles must be an integer"),
        ("fom.lloyd=1", "--set fom.lloyd=1: unknown section fom; did you mean foam?"),
        ("seed.x=1", "seed is not a section"),
    ],
)
def test_bad_overrides_name_themselves(override: str, words: str, toml: Path) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the words are looked at below
        read_options(toml, [override])
    assert words in str(caught.value)


def test_overrides_take_toml_values_and_bare_words(toml: Path) -> None:
    texts = ["foam.seeds=blue", "relax.t1=false", 'output.folder="a b"', "foam.volumes=[1, 2]", "cell.gap=1"]
    options = read_options(toml, texts)
    assert options.foam.seeds == "blue"
    assert options.relax.t1 is False
    assert options.output.folder == "a b"
    assert options.foam.volumes == [1, 2]
    assert options.cell.gap == 1.0


def test_defaults_are_the_same_with_and_without_a_file() -> None:
    example = Path(__file__).parents[1] / "examples" / "foam.toml"
    assert read_options(example).as_mapping() == options_from({}, "nothing").as_mapping()


def test_defaults_are_those_of_python() -> None:
    from warpedfoam.relax import relax
    from warpedfoam.tessellate import voronoi_foam

    options = options_from({}, "nothing").as_mapping()
    for function, section in ((relax, "relax"), (voronoi_foam, "foam")):
        parameters = inspect.signature(function).parameters
        for name, value in options[section].items():
            if name not in ("order", "n_bubbles"):
                assert value == parameters[name].default, name
    assert options["relax"]["order"] == inspect.signature(voronoi_foam).parameters["order"].default


def test_seeds_given_one_by_one_set_the_number_of_bubbles(tmp_path: Path) -> None:
    points = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1], [0, 0, -1.7], [0.1, 0.1, 1.7]]
    radius = float(np.sqrt(3.0))
    seeds = (radius * np.array(points) / np.linalg.norm(points, axis=1)[:, None]).tolist()
    values = {
        "surface": {"kind": "sphere", "radius": radius},
        "cell": {"gap": 0.1},
        "foam": {"seeds": seeds},
        "output": {"folder": str(tmp_path), "picture": False},
    }
    options = options_from(values, "test")
    assert options.n_bubbles is None
    assert run_job(options).record["n_bubbles"] == 6


def test_output_folder_that_is_a_file(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("keep me")
    result = call("foam", "sphere", *SMALL, "-o", path)
    assert result.exit_code == 2
    assert "is a file; choose another with -o" in result.stderr
    assert path.read_text() == "keep me"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["sphere", "-n", "3"], "n_bubbles must be at least 4"),
        (["torus", "-n", "4"], "too few bubbles for the surface"),
        (["torus", "-n", "2"], "too few bubbles for the surface"),
    ],
)
def test_too_few_bubbles_is_2_and_writes_nothing(arguments: list[str], words: str, tmp_path: Path) -> None:
    result = call("foam", *arguments, "-o", tmp_path)
    assert result.exit_code == 2
    assert words in result.stderr
    assert result.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_unknown_command_line_option_is_2() -> None:
    assert call("foam", "torus", "--radius", "3").exit_code == 2
    assert call("foam", "cube").exit_code == 2
    assert call("run").exit_code == 2


def test_a_fault_of_our_own_is_3_with_traceback(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("oops")

    monkeypatch.setattr(warpedfoam.io, "write_ply", broken)
    result = call("foam", "sphere", *SMALL, "-o", tmp_path)
    assert result.exit_code == 3
    assert "Traceback" in result.stderr
    assert not (tmp_path / "record.json").exists()


def test_debug_shows_the_traceback(tmp_path: Path) -> None:
    result = call("foam", "torus", "--gap", "17", "--debug", "-o", tmp_path)
    assert result.exit_code == 2
    assert "Traceback" in result.stderr


def test_version_and_help() -> None:
    version = warpedfoam_command("--version")
    assert (version.returncode, version.stdout.split()[0]) == (0, "warpedfoam")
    help_text = warpedfoam_command("foam", "torus", "--help")
    assert help_text.returncode == 0
    assert "--minor-radius" in help_text.stdout


def test_in_a_pipe_json_is_all_there_is(tmp_path: Path) -> None:
    done = warpedfoam_command("foam", "sphere", *SMALL, "--no-t1", "-o", tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    summary = json.loads(done.stdout)
    assert {"converged", "energy", "residual", "n_t1", "sides", "outputs", "timings"} <= set(summary)
    assert summary["n_t1"] == 0


def test_exit_codes_reach_the_shell(tmp_path: Path, toml: Path) -> None:
    bad = warpedfoam_command("foam", "torus", "--gap", "17", "-o", tmp_path)
    assert (bad.returncode, bad.stdout, bad.stderr.count("\n")) == (2, "", 1)
    short = warpedfoam_command("run", toml, "-o", tmp_path / "out", "--set", "relax.max_iterations=1")
    assert short.returncode == 1


@posix
def test_progress_on_a_terminal_goes_to_stderr(tmp_path: Path) -> None:
    import pty

    terminal, end = pty.openpty()
    arguments = ["foam", "sphere", *SMALL, "-o", str(tmp_path), "--json"]
    process = subprocess.Popen(
        [sys.executable, "-m", "warpedfoam.cli", *arguments], stdout=subprocess.PIPE, stderr=end, text=True
    )
    os.close(end)
    shown = b""
    try:
        while chunk := os.read(terminal, 65536):
            shown += chunk
    except OSError:
        pass  # the other end has closed
    finally:
        os.close(terminal)
    stdout, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    assert json.loads(stdout)["converged"] is True
    assert b"relax" in shown
    assert b"left" in shown


STUCK_WHILE_WRITING = """
    import sys, time
    import warpedfoam.io
    from warpedfoam.cli import main

    def stuck(path, foam):
        with warpedfoam.io.atomic_binary(path) as file:
            file.write(b"half a foam")
            file.flush()
            print("WRITING", flush=True)
            time.sleep(60.0)

    warpedfoam.io.save = stuck
    sys.argv = ["warpedfoam", "foam", "sphere", "--seeds", "lattice", "-n", "16", "-o", sys.argv[1]]
    sys.exit(main())
"""


@posix
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGKILL", -9)])
def test_interrupted_while_writing_leaves_whole_files_only(name: str, code: int, tmp_path: Path) -> None:
    assert call("foam", "sphere", *SMALL, "--radius", "3", "-o", tmp_path, "-q").exit_code == 0
    earlier = (tmp_path / "foam.npz").read_bytes()
    process = python(STUCK_WHILE_WRITING, tmp_path)
    assert process.stdout is not None
    assert process.stdout.readline() == "WRITING\n"
    process.send_signal(getattr(signal, name))
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == code
    assert (tmp_path / "foam.npz").read_bytes() == earlier
    assert not (tmp_path / "record.json").exists()  # so the folder does not pass for a complete run
    parts = [p.name for p in tmp_path.iterdir() if p.name not in OUTPUTS]
    if name == "SIGKILL":
        assert len(parts) == 1  # nothing could tidy it away; a run ten minutes later does
        os.utime(tmp_path / parts[0], (0.0, 0.0))
    else:
        assert parts == []
        assert stderr.count("\n") == 1
        assert "no file was left half-written" in stderr
    assert call("foam", "sphere", *SMALL, "-o", tmp_path, "-q").exit_code == 0
    assert {p.name for p in tmp_path.iterdir()} == OUTPUTS


@posix
def test_interrupted_while_relaxing_writes_nothing(tmp_path: Path) -> None:
    code = """
        import sys, time
        import warpedfoam.relax
        from warpedfoam.cli import main

        def stuck(*_, **__):
            print("RELAXING", flush=True)
            time.sleep(60.0)

        sys.modules["warpedfoam.relax"].relax = stuck
        sys.argv = ["warpedfoam", "foam", "sphere", "--seeds", "lattice", "-n", "16", "-o", sys.argv[1]]
        sys.exit(main())
    """
    process = python(code, tmp_path)
    assert process.stdout is not None
    assert process.stdout.readline() == "RELAXING\n"
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
