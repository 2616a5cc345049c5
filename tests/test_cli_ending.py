"""How the command ends when it is interrupted while importing, or nobody reads what it prints."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import warpedfoam
from warpedfoam import startup

SOURCE = Path(warpedfoam.__file__).parents[1]
JOB = ["foam", "sphere", "--seeds", "lattice", "-n", "16", "-o"]
# what installers write for the entry point
SCRIPT = """
import sys
from warpedfoam.cli import main
if __name__ == "__main__":
    sys.exit(main())
"""
STUCK = "import time; print('IMPORTING', flush=True); time.sleep(60.0)"
#: The first package that warpedfoam's machinery imports, and the one that only the command line does.
SLOW = ["numpy", "typer"]
posix = pytest.mark.skipif(os.name == "nt", reason="POSIX signals and pipes")


def environment(*folders: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (*folders, SOURCE)))}


def commands(folder: Path) -> dict[str, list[str]]:
    """The two ways to start it, the first with a script such as an installer writes."""
    script = folder / "bin" / "warpedfoam"
    script.parent.mkdir()
    script.write_text(SCRIPT)
    return {
        "script": [sys.executable, str(script)],
        "module": [sys.executable, "-m", "warpedfoam.cli"],
    }


def interrupted(command: list[str], slow: Path) -> tuple[int, str]:
    """Exit code and stderr after a SIGINT in the middle of a slow import."""
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(slow)
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "IMPORTING\n"
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=60)
    return process.returncode, stderr


def slow_import(folder: Path, package: str) -> Path:
    """A folder that holds a package of this name whose import takes a minute."""
    slow = folder / "slow"
    slow.mkdir()
    (slow / f"{package}.py").write_text(STUCK)
    return slow


@posix
@pytest.mark.parametrize("package", SLOW)
@pytest.mark.parametrize("start", ["script", "module"])
def test_interrupted_while_importing_is_130_and_one_line(start: str, package: str, tmp_path: Path) -> None:
    command = commands(tmp_path)[start]
    code, stderr = interrupted([*command, *JOB, str(tmp_path / "out")], slow_import(tmp_path, package))
    assert (code, stderr) == (130, "warpedfoam: interrupted\n")
    assert not (tmp_path / "out").exists()


@posix
def test_other_programs_keep_their_ctrl_c(tmp_path: Path) -> None:
    code = "try:\n    import warpedfoam.cell\nexcept KeyboardInterrupt:\n    raise SystemExit(42)"
    assert interrupted([sys.executable, "-c", code], slow_import(tmp_path, "numpy")) == (42, "")


@posix
def test_an_ignored_interrupt_stays_ignored() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        startup.quit_on_interrupt()
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        startup.raise_on_interrupt()
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(
    ("argv", "original", "expected"),
    [
        (["/usr/bin/warpedfoam", "run"], ["python", "/usr/bin/warpedfoam", "run"], True),
        (["warpedfoam.exe"], ["warpedfoam.exe"], True),
        (["-m", "foam"], ["python", "-m", "warpedfoam.cli", "foam"], True),
        (["-m"], ["python", "-mwarpedfoam.cli"], True),
        (["-m"], ["python", "-m", "pytest"], False),
        (["-c"], ["python", "-c", "import warpedfoam"], False),
        (["/home/me/study.py", "warpedfoam"], ["python", "study.py", "warpedfoam"], False),
        ([""], ["python"], False),
        ([], ["python"], False),
    ],
)
def test_the_command_knows_itself(
    argv: list[str], original: list[str], expected: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", argv)
    monkeypatch.setattr(sys, "orig_argv", original)
    assert startup.is_command() is expected


def unread(command: list[str]) -> tuple[int, str]:
    """Exit code and stderr of a command whose stdout nobody reads."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(
            command,
            stdout=writing,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(),
            timeout=300,
            check=False,
        )
    finally:
        os.close(writing)
    return done.returncode, done.stderr


@posix
@pytest.mark.parametrize("option", [[], ["--json"]], ids=["text", "json"])
@pytest.mark.parametrize("start", ["script", "module"])
def test_a_closed_pipe_ends_it_quietly_with_all_files_written(
    start: str, option: list[str], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert unread([*commands(tmp_path)[start], *JOB, str(out), *option]) == (141, "")
    assert (out / "record.json").exists()


@posix
def test_help_into_a_closed_pipe_is_quiet(tmp_path: Path) -> None:
    code, stderr = unread([*commands(tmp_path)["script"], "foam", "torus", "--help"])
    assert code in (1, 141)  # 1 is what rich makes of it
    assert stderr == ""


@posix
@pytest.mark.parametrize("option", [[], ["--json"]], ids=["text", "json"])
def test_without_stdout_it_works_too(option: list[str], tmp_path: Path) -> None:
    arguments = [*commands(tmp_path)["script"], *JOB, str(tmp_path / "out"), *option]
    done = subprocess.run(
        ["sh", "-c", 'exec "$@" >&-', "sh", *arguments],
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        timeout=300,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
