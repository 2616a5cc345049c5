"""Every command alike: examples in its help that work, the same options, one line for a fault."""

from __future__ import annotations

import csv
import io
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner, Result

import warpedfoam as wf
from warpedfoam import cli
from warpedfoam.cli.app import app
from warpedfoam.cli.groups import PARSER_FAULT

from .io_foams import sphere_foam, torus_foam, with_pressures

ROOT = typer.main.get_command(app)
#: What the surfaces and verbs are asked wrongly, if not for a file that is not there.
WRONG = {
    "figures": ["nothing"],
    "partition": ["cube", "-n", "12"],
    "convert": ["no_such_file.npz", "out.vtp"],
    "drift": ["no_such_file.npz", "--duration", "1"],
    "coarsen": ["no_such_file.npz", "--until", "1"],
}


def leaves(command: Any = ROOT, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command that does something, with the words that lead to it."""
    if not hasattr(command, "commands"):
        yield path, command
        return
    for name, inner in command.commands.items():
        yield from leaves(inner, (*path, name))


LEAVES = list(leaves())
IDS = [" ".join(path) for path, _ in LEAVES]
every = pytest.mark.parametrize(("path", "command"), LEAVES, ids=IDS)
#: Of the surfaces, which are made by one piece of code, two.
FEW = [leaf for leaf in LEAVES if len(leaf[0]) == 1 or leaf[0][-1] in ("torus", "mesh")]
few = pytest.mark.parametrize(("path", "command"), FEW, ids=[" ".join(path) for path, _ in FEW])


def call(*words: str | Path) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": "200"})


def examples(text: str) -> list[list[str]]:
    """The lines of a help text that one could type."""
    lines = [line.strip() for line in text.partition("Examples:")[2].splitlines()]
    return [shlex.split(line) for line in lines if line.startswith("warpedfoam ")]


def parsed(words: list[str]) -> Any:
    """The context of the command that these words would run, not run."""
    command, context, rest = ROOT, None, words
    while True:
        context = command.make_context(command.name or "warpedfoam", list(rest), parent=context)
        if not hasattr(command, "commands"):
            return context
        rest = [*context._protected_args, *context.args]
        _, command, rest = command.resolve_command(context, rest)


def options(command: Any) -> dict[str, Any]:
    """Options by every name that they have."""
    return {name: p for p in command.params if p.param_type_name == "option" for name in p.opts}


def bad_call(path: tuple[str, ...], command: Any) -> list[str]:
    if path[-1] in WRONG:
        return WRONG[path[-1]]
    needed = [p for p in command.params if p.param_type_name == "argument"]
    if needed and "--gap" not in options(command):
        return ["no_such_file.npz"] * len(needed)
    volume = ["--volume", "1"] if needed and "--volume" in options(command) else []
    return [*("no_such_file.ply" for _ in needed), "--gap", "-1", *volume]


def test_all_verbs_are_there() -> None:
    verbs = {path[0] for path, _ in LEAVES}
    assert verbs >= {
        "run", "foam", "relax", "check", "potential", "defects", "ensemble", "view", "convert", "figures",
        "info", "plot", "partition", "cluster", "drift", "coarsen",
    }  # fmt: skip


# ------------------------------------------------------------------ help


@every
def test_help_ends_with_examples_that_can_be_parsed(path: tuple[str, ...], command: Any) -> None:
    result = call(*path, "--help")
    assert result.exit_code == 0
    found = examples(result.stdout)
    assert found, f"the help of {' '.join(path)} has no Examples: give it epilog=epilog(...)"
    for words in found:
        assert words[1] == path[0]
        context = parsed(words[1:])
        assert context.command.name in (path[-1], "mesh")


@pytest.mark.parametrize("group", [(), ("foam",), ("potential",)], ids=["warpedfoam", "foam", "potential"])
def test_groups_have_examples_too(group: tuple[str, ...]) -> None:
    found = examples(call(*group, "--help").stdout)
    assert found
    for words in found:
        if "--install-completion" not in words:  # it would be installed
            parsed(words[1:])


def test_an_example_with_a_wrong_option_would_be_seen() -> None:
    for words in (["info", "foam.npz", "--sneed", "3"], ["foam", "torus", "-n", "many"], ["sing"]):
        with pytest.raises(PARSER_FAULT):
            parsed(words)


@pytest.mark.parametrize("page", ["README.md", "docs/pictures.md"])
def test_pages_type_what_exists(page: str) -> None:
    text = (Path(__file__).parents[1] / page).read_text(encoding="utf-8")
    lines = [line.partition("#")[0] for line in text.splitlines() if line.startswith("warpedfoam ")]
    assert len(lines) > 3
    for line in lines:
        if "completion" not in line:
            parsed(shlex.split(line)[1:])


# ------------------------------------------------------------------ options


@every
def test_the_same_options_everywhere(path: tuple[str, ...], command: Any) -> None:
    named = options(command)
    for name in ("--json", "--quiet", "--debug"):
        assert name in named, f"{' '.join(path)} has no {name}"
    assert "-q" in named["--quiet"].opts
    for option in named.values():
        assert option.help, option.name
        if "out" in (option.name or "").split("_"):
            assert set(option.opts) >= {"-o", "--output"}
    if "-n" in named:
        assert "--n-bubbles" in named["-n"].opts
    for first, second in (("-o", "--output"), ("-q", "--quiet"), ("-n", "--n-bubbles")):
        if first in named:
            assert named[first] is named[second]


# ------------------------------------------------------------------ faults


@few
def test_a_wrong_option_is_one_line_and_2(path: tuple[str, ...], command: Any) -> None:
    result = call(*path, "--no-such-option")
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith("warpedfoam: ")
    assert result.stderr.rstrip().endswith("--help")
    assert "Traceback" not in result.stderr
    assert result.stdout == ""


@few
def test_bad_input_is_one_line_and_2_and_debug_tells_more(
    path: tuple[str, ...], command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = [*path, *bad_call(path, command)]
    result = call(*words)
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("warpedfoam: ")
    assert result.stderr.count("\n") == 1
    assert "Traceback" not in result.stderr
    assert result.stdout == ""
    told = call(*words, "--debug")
    assert told.exit_code == 2
    assert "Traceback" in told.stderr
    assert told.stderr.endswith(result.stderr)
    assert list(tmp_path.iterdir()) == []


def test_missing_and_unknown_words() -> None:
    for words, said in (
        (["info"], "Missing argument"),
        (["sing"], "No such command"),
        (["foam", "torus", "-n", "many"], "a valid integer"),
        (["foam", "torus", "-n"], "requires an argument"),
    ):
        result = call(*words)
        assert result.exit_code == 2
        assert said in result.stderr
        assert result.stderr.count("\n") == 1
    # without a word: help, as an error
    assert call("foam").exit_code == 2
    assert "Usage" in call("foam").output


# ------------------------------------------------------------------ a reader that has gone, completion


class Gone(io.RawIOBase):
    """A pipe whose reader has gone."""

    def writable(self) -> bool:
        return True

    def write(self, _: Any) -> int:
        raise BrokenPipeError


@pytest.mark.parametrize("verb", ["info", "plot", "convert", "defects", "view", "relax"])
def test_a_reader_that_has_gone_is_no_fault(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    foam = wf.save(tmp_path / "foam.npz", sphere_foam(12, even=True))
    words = {
        "convert": [str(foam), str(tmp_path / "out.obj")],
        "plot": [str(foam), "-o", str(tmp_path / "out.svg")],
        "relax": [str(foam), "-o", str(tmp_path / "relaxed"), "--no-picture"],
        "defects": [str(foam), "--no-picture"],
    }.get(verb, [str(foam)])
    monkeypatch.setattr(sys, "argv", ["warpedfoam", verb, *words])
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BufferedWriter(Gone()), write_through=True))
    monkeypatch.setattr(cli, "_drop_output", lambda: None)
    monkeypatch.setattr(cli, "quit_on_interrupt", lambda: None)
    assert cli.main() == cli.CLOSED_PIPE
    # what could not be written must not be tried again when Python leaves
    with pytest.raises(BrokenPipeError):
        sys.stdout.detach().detach().write(b"")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("typed", "expected"),
    [("warpedfoam def", ["defects"]), ("warpedfoam plot foam.npz --kind h", ["histogram"])],
)
def test_the_shell_completes_words(typed: str, expected: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "warpedfoam.cli"],
        env={
            **os.environ,
            "_WARPEDFOAM_COMPLETE": "complete_bash",
            "COMP_WORDS": typed,
            "COMP_CWORD": str(len(typed.split()) - 1),
        },
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (done.stdout.split(), done.stderr) == (expected, "")


# ------------------------------------------------------------------ relax


def test_relax_does_what_python_does(tmp_path: Path) -> None:
    start = sphere_foam(16, seed=2)
    file = wf.save(tmp_path / "start.npz", start)
    out = tmp_path / "out"
    result = call("relax", file, "--order", "6", "-o", out, "--json")
    assert result.exit_code == 0, result.output
    expected = wf.relax(start, order=6)
    found = wf.load(out / "foam.npz")
    np.testing.assert_array_equal(found.vertex_points, expected.foam.vertex_points)
    assert found.order == 6
    facts = json.loads(result.stdout)
    assert (facts["energy"], facts["n_t1"]) == (expected.energy, expected.n_t1)
    record = json.loads((out / "record.json").read_text())
    assert record["options"]["order"] == 6
    assert record["source"] == str(file)
    assert {Path(p).name for p in record["outputs"].values()} == {p.name for p in out.iterdir()}
    with (out / "history.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["energy"]) for row in rows] == expected.history.energy.tolist()
    assert "16 bubbles" in call("relax", file, "-o", out, "--no-picture").stdout
    assert not (out / "relaxation.png").exists()
    assert not (out / "foam.png").exists()


def test_relax_lets_films_bulge(tmp_path: Path) -> None:
    start = sphere_foam(12, even=True)
    file = wf.save(tmp_path / "start.npz", start)
    out = tmp_path / "out"
    result = call("relax", file, "--layers", "2", "-o", out, "--no-picture")
    assert result.exit_code == 0, result.output
    assert "2 layers" in result.stdout
    with np.load(out / "bulging.npz") as found:
        assert found["film_points"].shape == (3, 30, 5, 3)
    assert call("relax", file, "-o", out, "--no-picture", "-q").exit_code == 0
    assert not (out / "bulging.npz").exists()


def test_relax_refuses_and_reports(tmp_path: Path) -> None:
    file = wf.save(tmp_path / "foam.npz", sphere_foam(16, seed=2))
    before = file.read_bytes()
    for words, said in (
        (["-o", str(tmp_path)], "holds the foam to be read"),
        (["--order", "1"], "order must be at least 2"),
        (["--layers", "9"], "layers must be at most 8"),
        (["--solver", "mumps"], "solver must be one of"),
        (["--color-by", "taste"], "color_by must be one of"),
    ):
        result = call("relax", file, *(words if "-o" in words else [*words, "-o", tmp_path / "out"]))
        assert result.exit_code == 2, result.output
        assert said in result.stderr
    result = call("relax", file, "--max-iterations", "1", "-o", tmp_path / "short", "--no-picture")
    assert result.exit_code == 1
    assert "did not converge" in result.stderr
    assert file.read_bytes() == before


def test_a_potential_along_a_path_is_drawn_as_curves(tmp_path: Path) -> None:
    facts = json.loads(call("potential", "torus", "--along", "5", "-o", tmp_path, "--json").stdout)
    assert str(tmp_path / "potential_path.png") in facts["outputs"]
    assert (tmp_path / "potential_path.png").read_bytes().startswith(b"\x89PNG")
    call("potential", "torus", "--points", "60", "-o", tmp_path, "--no-picture")
    assert not (tmp_path / "potential_path.png").exists()


# ------------------------------------------------------------------ plot


@pytest.mark.parametrize(
    ("words", "size"),
    [
        (["--kind", "foam", "--color-by", "pressure", "--view", "10,20", "--width", "86"], 86.0),
        (["--kind", "map", "--projection", "conformal", "--outline", "--vertices"], 180.0),
        (["--kind", "defects", "--width", "120", "--title", "mine"], 120.0),
        (["--kind", "order"], 228.6),
        (["--kind", "histogram", "--of", "film_length", "--width", "60"], 60.0),
        (["--kind", "sides"], 3 * 117.0),
    ],
    ids=lambda words: words[1] if isinstance(words, list) else "",
)
def test_plot_draws(words: list[str], size: float, tmp_path: Path) -> None:
    file = wf.save(tmp_path / "foam.npz", with_pressures(torus_foam()))
    target = tmp_path / "picture.svg"
    result = call("plot", file, *words, "-o", target, "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert facts["picture"] == str(target)
    assert facts["width_mm"] == pytest.approx(size)
    assert target.read_text().startswith("<?xml")


def test_plot_names_its_picture_and_refuses(tmp_path: Path) -> None:
    file = wf.save(tmp_path / "foam.npz", sphere_foam(12, even=True))
    assert call("plot", file, "--kind", "histogram", "--dpi", "40").exit_code == 0
    assert (tmp_path / "foam_histogram.png").read_bytes().startswith(b"\x89PNG")
    for words, said in (
        (["--kind", "song"], "--kind must be one of 'foam', 'map'"),
        (["--projection", "hammer"], "--projection is for --kind map, not for foam"),
        (["--of", "area"], "--of is for --kind histogram"),
        (["--kind", "map", "--view", "1,2"], "--view is for --kind foam or defects or order, not for map"),
        (["--kind", "map", "--projection", "angles"], "projection must be one of 'hammer'"),
        (["--view", "up"], "--view must be two angles"),
        (["--color-by", "taste"], "color_by must be one of"),
        (["--width", "3"], "width must be at least 40"),
        (["--kind", "sides", "--title", "x"], "--title is not for"),
        (["-o", str(tmp_path / "a.jpg")], "must end in"),
    ):
        result = call("plot", file, *words)
        assert result.exit_code == 2, words
        assert said in result.stderr
        assert result.stderr.count("\n") == 1
    assert {p.name for p in tmp_path.iterdir()} == {"foam.npz", "foam_histogram.png"}
