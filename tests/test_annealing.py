"""Annealing: never above its start, the same from the same seed, and after any interruption."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpedfoam as wf
from warpedfoam.moves import rewire
from warpedfoam.studies import checkpoint as checkpoints
from warpedfoam.studies.checkpoint import fingerprint
from warpedfoam.studies.foam_moves import MOVES, charge_rise, films_round, moved, turnable

CELL = wf.HeleShawCell(wf.Sphere(1.0), gap=1e-6)


@pytest.fixture(scope="module")
def start() -> wf.Foam:
    return wf.relax(wf.voronoi_foam(CELL, 20, seed=1)).foam


def same(one: wf.Annealing, two: wf.Annealing) -> None:
    assert one.energy == two.energy
    assert fingerprint(one.foam) == fingerprint(two.foam)
    assert fingerprint(one.last) == fingerprint(two.last)
    for name in ("move", "temperature", "proposed", "accepted", "n_t1", "energy", "best", "tried", "taken"):
        np.testing.assert_array_equal(getattr(one.history, name), getattr(two.history, name))


def test_charge_rise_is_what_rewiring_does() -> None:
    network = wf.voronoi_foam(CELL, 60, seed=4).network
    rise = charge_rise(network)
    for film in np.flatnonzero(turnable(network)):
        after = rewire(network, [film]).charges
        assert rise[film] == (after**2).sum() - (network.charges**2).sum()
    assert (rise < 0).any()


def test_turnable_films_turn_and_no_others() -> None:
    network = wf.voronoi_foam(CELL, 6, seed=3).network
    fine = turnable(network)
    for film in range(network.n_films):
        if fine[film]:
            rewire(network, [film])
        else:
            with pytest.raises(wf.TopologyError):
                rewire(network, [film])
    assert not fine.all()


def test_films_round_are_those_of_four_bubbles() -> None:
    network = wf.voronoi_foam(CELL, 40, seed=3).network
    near = films_round(network, 7)
    four = {*network.bubble[[14, 15]], *network.bubble[network.next[[14, 15]] ^ 1]}
    beside = [f for f in range(network.n_films) if {network.left[f], network.right[f]} & four and f != 7]
    assert near.tolist() == beside


@pytest.mark.parametrize("move", MOVES)
def test_a_move_ends_at_a_minimum_with_the_same_volumes(start: wf.Foam, move: str) -> None:
    found = [moved(start, move, np.random.default_rng(k), 0.5, 4) for k in range(6)]
    done = [r for r in found if r is not None and r.converged]
    assert len(done) >= 4
    for r in done:
        np.testing.assert_array_equal(r.foam.target_volumes, start.target_volumes)
        np.testing.assert_allclose(r.foam.bubble_volumes, start.target_volumes, rtol=1e-9)
        assert r.foam.network.charges.sum() == 12
    assert any(abs(r.energy / start.energy - 1.0) > 1e-6 for r in done)


def test_history_tells_what_happened(start: wf.Foam) -> None:
    found = wf.anneal(start, steps=25, moves=MOVES, seed=3, temperature=1.0, width=0.5)
    h = found.history
    before = np.concatenate([[found.start_energy], h.energy[:-1]])
    np.testing.assert_array_equal(h.best, np.minimum.accumulate(np.minimum(h.energy, found.start_energy)))
    assert found.energy == h.best[-1] == found.foam.energy
    assert found.last.energy == h.energy[-1]
    assert (h.energy == before)[~h.accepted].all()
    assert h.accepted[h.proposed <= before].all()
    moved_on = h.accepted & (h.energy != before)
    np.testing.assert_array_equal(h.energy[moved_on], h.proposed[moved_on])
    assert (h.energy > before).any(), "no step uphill at this temperature"
    np.testing.assert_allclose(h.temperature, 0.01 ** (np.arange(25) / 24))
    assert found.n_accepted == h.accepted.sum()
    assert {*h.move} == {*MOVES}


def test_without_temperature_it_only_falls_and_at_a_high_one_takes_all(start: wf.Foam) -> None:
    cold = wf.anneal(start, steps=15, moves=["pair"], temperature=0.0, seed=2)
    assert (np.diff(cold.history.energy) <= 1e-9 * cold.energy).all()
    hot = wf.anneal(start, steps=10, moves=["t1"], temperature=1e5, cooling=1.0, seed=2)
    assert hot.history.accepted[np.isfinite(hot.history.proposed)].all()


def test_it_finds_the_best_of_fourteen() -> None:
    # D6d, 23.95812912: one of many minima, not the one that the start relaxes to
    foam = wf.voronoi_foam(CELL, 14, seed=1)
    found = wf.anneal(foam, steps=60, moves=["pair"], temperature=0.05, order=6, seed=1)
    assert found.start_energy / 1e-6 > 24.2
    assert found.foam.film_lengths.sum() == pytest.approx(23.95812912, abs=1e-7)


def test_scale(start: wf.Foam) -> None:
    # lengths times 8 and a thinner gap: the same walk
    cell = wf.HeleShawCell(wf.Sphere(8.0), gap=8e-6)
    big = wf.Foam(cell, start.network, 8.0 * start.vertex_points, start.film_offsets)
    big = wf.Foam(
        cell, big.network, big.vertex_points, big.film_offsets, start.target_volumes * 512.0, tension=3.0
    )
    one, two = (wf.anneal(f, steps=8, moves=["pair", "t1"], seed=5) for f in (start, big))
    np.testing.assert_allclose(two.history.energy, 64.0 * 3.0 * one.history.energy, rtol=1e-8)


def test_interrupted_runs_end_the_same(start: wf.Foam, tmp_path: Path) -> None:
    options: dict[str, Any] = {"steps": 8, "seed": 9, "width": 0.5}
    whole = wf.anneal(start, **options)

    def stop(stage: str, fraction: float) -> None:
        assert stage == "anneal"
        if fraction > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        wf.anneal(start, **options, folder=tmp_path / "run", progress=stop)
    # before, a state of five steps; the rest from there
    fractions: list[float] = []
    again = wf.anneal(start, **options, folder=tmp_path / "run", progress=lambda _, f: fractions.append(f))
    assert fractions == [6 / 8, 7 / 8, 1.0]
    same(whole, again)
    # a run that has ended is only read
    same(whole, wf.anneal(start, **options, folder=tmp_path / "run", progress=stop))
    names = sorted(p.name for p in (tmp_path / "run").iterdir())
    assert names[0] == ".lock"
    assert names[-1] == "anneal.json"
    assert len(names) <= 4


def test_a_crash_between_foam_and_state_leaves_a_whole_state(
    start: wf.Foam, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options: dict[str, Any] = {"steps": 6, "seed": 9, "moves": ["pair"], "temperature": 1.0}
    whole = wf.anneal(start, **options)
    write, seen = checkpoints.write_record, []

    def fail(path: Any, record: Any) -> Path:
        seen.append(record["foams"])
        # the first state with another foam: both foams are there, the state is still the old one
        if seen[-1] != seen[0]:
            raise OSError("the disk is full")
        return write(path, record)

    monkeypatch.setattr(checkpoints, "write_record", fail)
    with pytest.raises(OSError, match="full"):
        wf.anneal(start, **options, folder=tmp_path)
    monkeypatch.undo()
    same(whole, wf.anneal(start, **options, folder=tmp_path))
    assert len(list(tmp_path.glob("*.npz"))) <= 2


@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX")
def test_a_killed_process_goes_on(start: wf.Foam, tmp_path: Path) -> None:
    wf.save(tmp_path / "start.npz", start)
    code = textwrap.dedent(
        """
        import sys, warpedfoam as wf
        start = wf.load(sys.argv[1])
        wf.anneal(start, steps=10_000, seed=9, moves=["pair"], cooling=1.0, folder=sys.argv[2])
        """
    )
    run = tmp_path / "run"
    process = subprocess.Popen([sys.executable, "-c", code, str(tmp_path / "start.npz"), str(run)])
    try:
        for _ in range(600):
            time.sleep(0.1)
            if process.poll() is not None or (len(list(run.glob("*.npz"))) and time_to_kill(run)):
                break
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    done: list[float] = []

    class Enough(Exception):
        pass

    def stop(_: str, fraction: float) -> None:
        done.append(fraction)
        raise Enough

    with pytest.raises(Enough):
        wf.anneal(start, steps=10_000, seed=9, moves=["pair"], cooling=1.0, folder=run, progress=stop)
    k = round(done[0] * 10_000)
    assert k > 3, "it began anew"
    state = checkpoints.json.loads((run / "anneal.json").read_text())["state"]["rows"]
    straight = wf.anneal(start, steps=k, seed=9, moves=["pair"], cooling=1.0)
    assert [row[5] for row in state] == straight.history.energy.tolist()


def time_to_kill(run: Path) -> bool:
    path = run / "anneal.json"
    return path.exists() and len(checkpoints.json.loads(path.read_text())["state"]["rows"]) >= 3


@pytest.mark.skipif(os.name == "nt", reason="locks are POSIX")
def test_one_run_at_a_time_in_a_folder(start: wf.Foam, tmp_path: Path) -> None:
    """Two runs in one folder would remove each other's foams."""

    def second(_: str, __: float) -> None:
        with pytest.raises(BlockingIOError, match="another run is writing"):
            wf.anneal(start, steps=3, seed=1, folder=tmp_path)

    first = wf.anneal(start, steps=3, seed=1, folder=tmp_path, progress=second)
    same(first, wf.anneal(start, steps=3, seed=1, folder=tmp_path))

    def other(_: str, __: float) -> None:
        with pytest.raises(BlockingIOError, match="another run is writing"):
            wf.minimal_partition(CELL.surface, 4, starts=1, hops=0, folder=tmp_path)

    wf.minimal_partition(CELL.surface, 4, starts=1, hops=0, folder=tmp_path, progress=other)


def test_a_folder_of_another_run_is_refused(start: wf.Foam, tmp_path: Path) -> None:
    wf.anneal(start, steps=1, seed=1, folder=tmp_path)
    with pytest.raises(ValueError, match="holds another run: seed differs"):
        wf.anneal(start, steps=1, seed=2, folder=tmp_path)
    other = wf.voronoi_foam(CELL, 20, seed=2)
    with pytest.raises(ValueError, match="start, steps differ"):
        wf.anneal(other, steps=2, seed=1, folder=tmp_path)
    (tmp_path / "anneal.json").write_text("{")
    with pytest.raises(wf.FileFormatError, match="damaged"):
        wf.anneal(start, steps=1, seed=1, folder=tmp_path)
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(NotADirectoryError, match="is a file"):
        wf.anneal(start, steps=1, folder=file)


def test_bad_input(start: wf.Foam) -> None:
    with pytest.raises(TypeError, match="foam"):
        wf.anneal(None)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="moves must be a sequence"):
        wf.anneal(start, moves="t1")
    with pytest.raises(ValueError, match="moves must be one of"):
        wf.anneal(start, moves=["t2"])
    with pytest.raises(ValueError, match="moves must name one"):
        wf.anneal(start, moves=[])
    with pytest.raises(ValueError, match="cooling"):
        wf.anneal(start, cooling=0.0)
    with pytest.raises(ValueError, match="temperature"):
        wf.anneal(start, temperature=-1.0)
    with pytest.raises(TypeError, match="progress"):
        wf.anneal(start, progress=3)  # type: ignore[arg-type]
