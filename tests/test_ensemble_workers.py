"""Ensembles on workers that are killed or started apart, and from the command line."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import warpedfoam as wf
from warpedfoam.cli.app import app

from .ensemble_samples import files, study, user_functions, write_study

posix = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> wf.Ensemble:
    return wf.run_ensemble(study(), tmp_path_factory.mktemp("plain"), workers=0)


# ------------------------------------------------------------------------------------------ workers

KILLERS = """
    import os
    from pathlib import Path

    HERE = Path(__file__).parent

    def energy(foam):
        if not (HERE / "free").exists():
            with open(HERE / "pids", "a") as stream:
                stream.write(f"{os.getpid()}\\n")
            if not (HERE / "worker").exists():
                (HERE / "worker").write_text("killed")
                os.kill(os.getpid(), 9)
            if len((HERE / "out" / "runs.jsonl").read_bytes().splitlines()) >= 3:
                (HERE / "free").write_text("the run is killed too")
                os.kill(os.getppid(), 9)
        return foam.energy
"""


def gone(pid: int) -> bool:
    """Whether a process has ended, waiting for it up to half a minute."""
    for _ in range(300):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        state = Path(f"/proc/{pid}/stat")
        if state.exists() and state.read_text().rpartition(")")[2].split()[0] == "Z":
            return True
        time.sleep(0.1)
    return False


def command(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "warpedfoam.cli", "ensemble", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@posix
def test_a_killed_worker_and_a_killed_run_change_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = user_functions(tmp_path, KILLERS, monkeypatch)
    write_study(tmp_path / "study.toml", f"{name}:energy", 8)
    arguments = (tmp_path / "study.toml", "-o", tmp_path / "out", "--workers", "2", "--json")
    killed = command(*arguments)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    assert (tmp_path / "worker").exists()
    kept = len((tmp_path / "out" / "runs.jsonl").read_bytes().splitlines()) - 1
    assert 2 <= kept < 8
    assert not (tmp_path / "out" / "record.json").exists()
    # no worker outlives its run
    assert all(gone(int(pid)) for pid in set((tmp_path / "pids").read_text().split()))
    again = command(*arguments)
    assert again.returncode == 0, again.stderr
    assert json.loads(again.stdout)["computed_now"] == 8 - kept
    wf.run_ensemble(wf.read_study(tmp_path / "study.toml"), tmp_path / "here", workers=0)
    assert files(tmp_path / "out") == files(tmp_path / "here")


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    """The address of a scheduler with one worker, started apart."""
    card = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    local = ["--no-dashboard", "--scheduler-file", str(card)]
    processes = [
        subprocess.Popen([*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", *local], **quiet)
    ]
    try:
        for _ in range(600):
            if card.exists() and card.stat().st_size:
                break
            time.sleep(0.1)
        address = json.loads(card.read_text())["address"]
        worker = ["--no-nanny", "--nthreads", "2", "--local-directory", str(tmp_path)]
        processes.append(subprocess.Popen([*dask, "worker", *worker, *local], **quiet))
        yield address
    finally:
        for process in processes[::-1]:
            process.terminate()
        for process in processes:
            # a worker that lost its scheduler may try to reach it for long
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def test_a_scheduler_started_apart_gives_the_same_table(
    plain: wf.Ensemble, scheduler: str, tmp_path: Path
) -> None:
    done = wf.run_ensemble(study(), tmp_path / "out", scheduler=scheduler)
    assert done.record["computed_now"] == 4
    assert files(tmp_path / "out") == files(plain.folder)


# --------------------------------------------------------------------------------- the command line


def call(*arguments: str | Path) -> Any:
    return CliRunner().invoke(app, ["ensemble", *map(str, arguments)])


def test_the_command_says_how_it_went(tmp_path: Path) -> None:
    write_study(tmp_path / "study.toml", "n_t1", 2)
    done = call(tmp_path / "study.toml", "-o", tmp_path / "out", "--workers", "0")
    assert done.exit_code == 0
    assert "2: 2 converged; 2 of them computed now" in done.output
    assert (tmp_path / "out" / "ensemble.parquet").exists()
    options = ("--workers", "0", "-q", "--set", "relax.max_iterations=1")
    hasty = call(tmp_path / "study.toml", "-o", tmp_path / "two", *options)
    assert hasty.exit_code == 1
    assert hasty.output.startswith(
        "warpedfoam: 2 of 2 runs not_converged; see the table; the first says: not converged after 1 of 1"
    )
    grown = call(tmp_path / "study.toml", "-o", tmp_path / "out", "--workers", "0", "--json",
                 "--set", "grid.foam.n_bubbles=[14, 16]")  # fmt: skip
    assert grown.exit_code == 0, grown.output
    facts = json.loads(grown.stdout)
    assert (facts["runs"], facts["computed_now"], facts["first_reason"]) == (4, 2, None)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--set", "repeat=2"], "--set repeat=2: unknown option repeat; did you mean repeats?"),
        (["--set", "surface.radius=x"], "surface.radius must be a number"),
        (["--set", "foam.n_bubbles=100000000"], "foam.n_bubbles must be at most 200000"),
        (["--set", "grid.foam.n_bubbles=14"], "grid.foam.n_bubbles must be a list of values"),
        (["--set", "grid.foam.bubbles=[14]"], "did you mean foam.n_bubbles?"),
        (["--scheduler", "nonsense"], "nonsense"),
    ],
)
def test_bad_commands_end_with_one_line(arguments: list[str], message: str, tmp_path: Path) -> None:
    write_study(tmp_path / "study.toml", "n_t1", 2)
    done = call(tmp_path / "study.toml", "-o", tmp_path / "out", *arguments)
    assert done.exit_code == 2
    assert message in done.output
    assert len(done.output.splitlines()) == 1
