"""Completion as the shells do it: scripts that the command writes, in bash, zsh and fish where they are."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import stat
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from warpedfoam.cli.app import app
from warpedfoam.cli.plotting import KINDS
from warpedfoam.io.colours import COLOR_CHOICES

from .test_cli_verbs import LEAVES

ROOT = Path(__file__).parents[1]
VERBS = set(typer.main.get_command(app).commands)  # type: ignore[attr-defined]
SHELLS = ("bash", "zsh", "fish")
#: What is typed, and what the shell must offer.
TYPED: dict[str, set[str]] = {
    "warpedfoam ": VERBS,
    "warpedfoam con": {"convert"},
    "warpedfoam foam s": {"sphere", "schwarz-p"},
    "warpedfoam info foam.npz --fr": {"--frame"},
    "warpedfoam plot foam.npz --kind ": set(KINDS),
    "warpedfoam plot foam.npz --of film_": {"film_length", "film_area"},
    "warpedfoam convert foam.npz o.ply --color-by ": set(COLOR_CHOICES),
    "warpedfoam foam torus --seeds ": {"random", "blue", "lattice"},
    "warpedfoam foam torus --cells p": {"power"},
    "warpedfoam relax foam.npz --solver s": {"superlu"},
    "warpedfoam cluster torus --layout h": {"hexagonal"},
    "warpedfoam figures paper --only cu": {"curvature"},
    "warpedfoam potential torus --method fr": {"free"},
    "warpedfoam partition cat": {"catenoid"},
    "warpedfoam view foam.npz --color-by i": {"id"},
}
#: Of these, what every shell is asked; each costs the start of a process.
IN_SHELLS = ("warpedfoam con", "warpedfoam info foam.npz --fr", "warpedfoam cluster torus --layout h")


@pytest.fixture
def command(tmp_path: Path) -> dict[str, str]:
    """An environment in which ``warpedfoam`` is found; run in earnest it says how it was called."""
    folder = tmp_path / "bin"
    folder.mkdir()
    script = folder / "warpedfoam"
    script.write_text(
        f'#!/bin/sh\n[ -n "$_WARPEDFOAM_COMPLETE" ] || {{ echo "RAN $*"; exit; }}\n'
        f'exec {shlex.quote(sys.executable)} -m warpedfoam.cli "$@"\n'
    )
    script.chmod(script.stat().st_mode | stat.S_IEXEC)
    (tmp_path / "foam.npz").write_bytes(b"")
    return {
        **os.environ,
        "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT / "src"),
        "HOME": str(tmp_path),
        "TERM": "dumb",
    }


def source(shell: str, environment: dict[str, str]) -> str:
    """The script that a user's shell reads at its start."""
    done = subprocess.run(
        ["warpedfoam"],
        env={**environment, "_WARPEDFOAM_COMPLETE": f"source_{shell}"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        executable=shutil.which("warpedfoam", path=environment["PATH"]),
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def offered(shell: str, typed: Sequence[str], environment: dict[str, str], folder: Path) -> list[list[str]]:
    """What a real shell offers after each of the lines, from its own completion."""
    script = folder / f"complete.{shell}"
    lines = [source(shell, environment)]
    for line in typed:
        words = line.split(" ")
        if shell == "bash":
            told = " ".join(map(shlex.quote, words))
            lines.append(f"COMP_WORDS=({told}); COMP_CWORD={len(words) - 1}; COMPREPLY=()")
            lines.append("_warpedfoam_completion warpedfoam")
            lines.append('printf "%s\\n" "${COMPREPLY[@]}"; echo "=="')
        elif shell == "fish":
            lines.append(f'complete -C {shlex.quote(line)}; echo "=="')
        else:
            told = " ".join(map(shlex.quote, words))
            lines.append(f'words=({told}); CURRENT={len(words)}; _warpedfoam_completion; echo "=="')
    if shell == "zsh":
        # the editor's part: what is added to the offer is printed
        lines.insert(0, "compdef() { }; _arguments() { print -l -- $@ }; _describe() { print -l -- ${(P)2} }")
        lines.insert(1, "_files() { }; compadd() { print -l -- $@ }")
    script.write_text("\n".join(lines) + "\n")
    done = subprocess.run(
        [
            shell,
            *(["--norc"] if shell == "bash" else ["-f"] if shell == "zsh" else ["--no-config"]),
            str(script),
        ],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    parts = done.stdout.split("==\n")
    assert len(parts) == len(typed) + 1
    return [part.splitlines() for part in parts[:-1]]


@pytest.mark.parametrize("line", TYPED)
def test_words_are_offered_where_there_is_a_choice(line: str) -> None:
    words = line.split(" ")
    asked = {
        "_WARPEDFOAM_COMPLETE": "complete_bash",
        "COMP_WORDS": line,
        "COMP_CWORD": str(len(words) - 1),
    }
    result = CliRunner().invoke(app, [], env=asked, prog_name="warpedfoam")
    assert (result.exit_code, result.stderr) == (0, "")
    assert set(result.stdout.split()) == TYPED[line]


def test_every_option_of_few_words_offers_them() -> None:
    """Those whose help lists what they take, but for several words by commas."""
    for path, leaf in LEAVES:
        for option in leaf.params:
            listed = re.search(r"\w+, .*\w+ or \w+", getattr(option, "help", "") or "")
            chooses = option.param_type_name == "option" and not option.is_flag and option.name != "out"
            if listed and chooses:
                assert option._custom_shell_complete is not None, f"{' '.join(path)} {option.opts}"


@pytest.mark.skipif(os.name == "nt", reason="shells of POSIX")
@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_completes_verbs_options_and_words(
    shell: str, tmp_path: Path, command: dict[str, str]
) -> None:
    text = source(shell, command)
    assert "_WARPEDFOAM_COMPLETE=complete_" + shell in text
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell} here; its script was written")
    found = offered(shell, IN_SHELLS, command, tmp_path)
    for line, words in zip(IN_SHELLS, found, strict=True):
        # fish tells what a word is for after a tab, zsh is given words in quotes
        offers = {word.split("\t")[0].strip() for word in words}
        if shell == "zsh":
            offers = set(re.findall(r'"([^"]*)"', "\n".join(words)))
        assert TYPED[line] <= offers, f"{line}: {offers}"
        last = line.split(" ")[-1]
        assert all(word.startswith(last) for word in offers if word in VERBS)


@pytest.mark.skipif(os.name == "nt" or shutil.which("bash") is None, reason="there is no bash here")
def test_the_tab_key_in_bash(tmp_path: Path, command: dict[str, str]) -> None:
    """A terminal, a bash in it, and the keys as they are pressed."""
    import pty

    (tmp_path / "rc").write_text("PS1='ready> '\n" + source("bash", command))
    terminal, end = pty.openpty()
    shell = subprocess.Popen(
        ["bash", "--noprofile", "--rcfile", str(tmp_path / "rc"), "-i"],
        stdin=end,
        stdout=end,
        stderr=end,
        env=command,
        cwd=tmp_path,
        start_new_session=True,
    )
    os.close(end)
    os.set_blocking(terminal, False)

    def until(text: str, seconds: float = 60.0) -> str:
        seen, limit = "", time.monotonic() + seconds
        while text not in seen:
            assert time.monotonic() < limit, seen
            try:
                seen += os.read(terminal, 4096).decode("utf-8", errors="replace")
            except BlockingIOError:
                time.sleep(0.02)
        return seen

    try:
        until("ready> ")
        os.write(terminal, b"warpedfoam conv\t")
        until("convert ")
        # a name of a file, then an option and its word
        os.write(terminal, b"fo\t")
        until("foam.npz ")
        os.write(terminal, b"o.ply --color\t")
        until("--color-by ")
        os.write(terminal, b"pres\t")
        until("pressure ")
        os.write(terminal, b"\n")
        assert "RAN convert foam.npz o.ply --color-by pressure" in until("ready> ")
    finally:
        shell.kill()
        shell.wait()
        os.close(terminal)
