"""Drifts on disk: a run that was killed and goes on makes the same frames, bit for bit."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import warpedfoam as wf

from .test_motion import one_bubble, quench

ROOT = Path(__file__).parents[1]
DURATION, EVERY = 0.45, 0.09

RUN = f"""
import sys
import warpedfoam as wf
from tests.test_motion import quench
wf.drift(quench(), duration={DURATION}, every={EVERY}, tolerance=2e-2, trajectory=sys.argv[1], resume=True)
"""


def contents(path: Path) -> list[bytes]:
    """Everything in the frames but the duration asked for."""
    out = []
    with wf.Trajectory(path) as frames:
        for k, foam in enumerate(frames):
            network = foam.network
            arrays = (
                network.next, network.origin, network.bubble, foam.vertex_points, foam.film_offsets,
                foam.pressures, foam.target_volumes, frames.times[[k]],
            )  # fmt: skip
            out.append(b"".join(np.asarray(a).tobytes() for a in arrays) + repr(frames.notes(k)).encode())
    return out


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, wf.Drift]:
    path = tmp_path_factory.mktemp("whole") / "run.h5"
    return path, wf.drift(quench(), duration=DURATION, every=EVERY, tolerance=2e-2, trajectory=path)


def test_the_file_holds_the_run(whole: tuple[Path, wf.Drift]) -> None:
    path, moved = whole
    assert moved.completed
    assert moved.n_t1 >= 1
    with wf.Trajectory(path) as frames:
        np.testing.assert_array_equal(frames.times, moved.times)
        np.testing.assert_allclose(moved.times, EVERY * np.arange(6), rtol=1e-12)
        assert [f.energy for f in frames] == moved.energies.tolist()
        assert frames[-1].network.sides.tolist() == moved.foam.network.sides.tolist()
    plain = wf.drift(quench(), duration=DURATION, every=EVERY, tolerance=2e-2)
    assert plain.foam.vertex_points.tobytes() == moved.foam.vertex_points.tobytes()
    assert plain.step_energies.tobytes() == moved.step_energies.tobytes()
    again = wf.resume_drift(path)
    assert again.events == moved.events == plain.events
    for name in ("step_times", "step_energies", "step_errors", "step_dissipation", "times", "energies"):
        assert getattr(again, name).tobytes() == getattr(moved, name).tobytes()


@pytest.mark.parametrize("frames", [1, 4])
def test_a_killed_run_goes_on_bit_for_bit(whole: tuple[Path, wf.Drift], tmp_path: Path, frames: int) -> None:
    """SIGKILL once some frames are there, somewhere in the middle of the next; then the run goes on."""
    path = tmp_path / "run.h5"
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, str(path)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"},
    )
    try:
        while process.poll() is None and not (path.exists() and length(path) >= frames):
            time.sleep(0.02)
    finally:
        process.kill()
        process.wait()
    assert frames <= length(path)
    wf.drift(quench(), duration=DURATION, every=EVERY, tolerance=2e-2, trajectory=path, resume=True)
    assert contents(path) == contents(whole[0])
    # a file that was being made when the process was killed may lie about, hidden
    assert [p.name for p in tmp_path.iterdir() if not p.name.startswith(".")] == ["run.h5"]


def length(path: Path) -> int:
    try:
        with wf.Trajectory(path) as frames:
            return len(frames)
    except wf.FileFormatError:
        return 0


def test_goes_on_for_longer_from_the_file_alone(whole: tuple[Path, wf.Drift], tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    foam = quench()
    wf.drift(foam, duration=3 * EVERY, every=EVERY, tolerance=2e-2, trajectory=path)
    moved = wf.resume_drift(path, duration=DURATION)
    assert moved.foam.vertex_points.tobytes() == whole[1].foam.vertex_points.tobytes()
    assert moved.step_energies.tobytes() == whole[1].step_energies.tobytes()


def test_refuses_other_runs(whole: tuple[Path, wf.Drift], tmp_path: Path) -> None:
    path = whole[0]
    foam, options = quench(), {"duration": DURATION, "every": EVERY, "tolerance": 2e-2}
    with pytest.raises(FileExistsError, match="resume=True"):
        wf.drift(foam, trajectory=path, **options)
    with pytest.raises(ValueError, match="another friction"):
        wf.drift(foam, trajectory=path, resume=True, friction=2.0, **options)
    with pytest.raises(ValueError, match="another foam"):
        wf.drift(quench(seed=4), trajectory=path, resume=True, **options)
    other = tmp_path / "other.h5"
    with wf.TrajectoryWriter(other) as writer:
        writer.append(one_bubble(order=4))
    with pytest.raises(ValueError, match="holds no drift"):
        wf.resume_drift(other)
    with pytest.raises(ValueError, match="holds no drift"):
        wf.drift(one_bubble(order=4), duration=1.0, trajectory=other, resume=True)


def test_notes_are_kept_with_frames(tmp_path: Path) -> None:
    with wf.TrajectoryWriter(tmp_path / "run.h5") as writer:
        writer.append(one_bubble(order=4), notes={"a": [1, 2.5], "b": {"c": "d"}})
        writer.append(one_bubble(order=4))
        with pytest.raises((TypeError, ValueError)):
            writer.append(one_bubble(order=4), notes={"a": float("nan")})
    with wf.Trajectory(tmp_path / "run.h5") as frames:
        assert frames.notes(0) == {"a": [1, 2.5], "b": {"c": "d"}}
        assert frames.notes(-1) == {}
        assert len(frames) == 2
