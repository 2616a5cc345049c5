"""Ensembles: one table, bit for bit, whatever the order, the workers and what is killed on the way."""

from __future__ import annotations

import csv
import json
import os
import sys
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

import warpedfoam as wf
from warpedfoam.analysis import honeycomb_bound
from warpedfoam.errors import FileFormatError
from warpedfoam.studies import ensemble as module
from warpedfoam.studies.journal import opened
from warpedfoam.studies.member import Outcome, Task
from warpedfoam.studies.pool import computed

from .ensemble_samples import files, study, user_functions

posix = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> wf.Ensemble:
    return wf.run_ensemble(study(), tmp_path_factory.mktemp("plain"), workers=0)


# ----------------------------------------------------------------------------- what the table says


def test_a_row_is_the_foam_of_its_seed(plain: wf.Ensemble) -> None:
    cell = wf.HeleShawCell(wf.Sphere(1.0), gap=0.01)
    for run in plain.study.runs:
        start = wf.voronoi_foam(cell, 16, seed=run.seed, volumes=run.parameters["foam.volumes"], order=3)
        relaxed = wf.relax(start, order=3, solver="superlu")
        row = {name: values[run.number] for name, values in plain.columns.items()}
        assert (row["seed"], row["energy"], row["n_t1"]) == (run.seed, relaxed.energy, relaxed.n_t1)
        assert row["status"] == "converged"
        assert row["reason"] == ""
        assert row["defects.excess_pairs"] == wf.defects(relaxed.foam).summary["excess_pairs"]
        np.testing.assert_array_equal(plain.foam(run.number).vertex_points, relaxed.foam.vertex_points)


def test_charges_add_up_in_every_row(plain: wf.Ensemble) -> None:
    names = [name for name in plain.columns if name.startswith("charges.")]
    values = [int(name.partition(".")[2]) for name in names]
    assert values == sorted(values)
    counts = np.array([plain.column(name) for name in names])
    np.testing.assert_array_equal(counts.sum(axis=0), 16)
    np.testing.assert_array_equal(values @ counts, 12)


def test_csv_and_parquet_say_the_same_to_the_last_bit(plain: wf.Ensemble) -> None:
    table = parquet.read_table(plain.folder / "ensemble.parquet")
    with open(plain.folder / "ensemble.csv", newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert table.column_names == list(rows[0]) == list(plain.columns)
    for name in table.column_names:
        values = table[name].to_pylist()
        assert values == plain.columns[name]
        assert ["" if value is None else str(value) for value in values] == [row[name] for row in rows]
    kinds = {name: str(table.schema.field(name).type) for name in ("run", "energy", "status", "is_minimum")}
    assert kinds == {"run": "int64", "energy": "double", "status": "string", "is_minimum": "bool"}


def test_columns_and_foams_by_what_they_are(plain: wf.Ensemble) -> None:
    where = {"foam.volumes": 0.2}
    assert plain.rows(where) == [2, 3]
    np.testing.assert_array_equal(plain.column("energy", where), plain.columns["energy"][2:])
    assert [foam.seed for foam in plain.foams(where)] == plain.columns["seed"][2:]
    with pytest.raises(ValueError, match="there is no column 'mu3'; columns are run, repeat"):
        plain.column("mu3")


def test_the_record_tells_who_computed(plain: wf.Ensemble) -> None:
    record = json.loads((plain.folder / "record.json").read_text())
    assert record["counts"] == {"converged": 4, "not_converged": 0, "failed": 0, "lost": 0}
    assert record["computed_now"] == record["runs"] == 4
    (environment,) = record["environments"].values()
    assert environment["versions"]["numpy"] == np.__version__
    assert record["processor_seconds"] > 0.0


# ---------------------------------------------------------------------------------- what goes wrong


def test_what_fails_is_a_row_with_its_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = user_functions(
        tmp_path,
        """
        def several(foam):
            return {"a": foam.n_bubbles, "b": {"c": 0.5}}

        def nan(foam):
            return float("nan")

        def bad(foam):
            raise KeyError("no such thing")
        """,
        monkeypatch,
    )
    made = study(
        repeats=1,
        surface={"kind": "torus", "major_radius": 20.0, "minor_radius": 0.5},
        grid={"foam.n_bubbles": [24]},
        cases=[
            {"name": "thin", "foam.seeds": "random"},
            {"name": "ball", "surface": {"kind": "sphere", "radius": 1.0}},
            {"name": "hasty", "surface": {"kind": "sphere", "radius": 1.0}, "relax.max_iterations": 1},
        ],
        observables=("energy", f"{name}:several", f"{name}:nan", f"{name}:bad"),
    )  # fmt: skip
    done = wf.run_ensemble(made, tmp_path / "out", workers=0)
    assert done.columns["status"] == ["failed", "failed", "failed"]
    thin, ball, hasty = done.columns["reason"]
    assert thin.startswith("ResolutionError: ")
    assert ball == (
        f"observable nan: ValueError: {name}:nan is nan; return None where there is no value; "
        "observable bad: KeyError: 'no such thing'"
    )
    assert hasty.startswith("not converged after 1 of 1 steps")
    assert done.columns["several.a"] == [None, 24, 24]
    assert done.columns["several.b.c"] == [None, 0.5, 0.5]
    assert done.columns["energy"][0] is None
    assert done.columns["state"][0] is None
    assert done.foam(1).n_bubbles == 24
    with pytest.raises(ValueError, match="run 0 has no foam: ResolutionError"):
        done.foam(0)


def test_every_member_has_one_blas_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from threadpoolctl import threadpool_info, threadpool_limits

    name = user_functions(
        tmp_path,
        """
        from threadpoolctl import threadpool_info

        def threads(foam):
            return max(p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas")
        """,
        monkeypatch,
    )
    made = study(repeats=1, grid={}, observables=(f"{name}:threads",))
    with threadpool_limits(limits=2):
        before = max(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
        done = wf.run_ensemble(made, tmp_path / "out", workers=0)
    assert before == 2
    assert done.columns["threads"] == [1]


def test_what_does_not_converge_says_so(tmp_path: Path) -> None:
    done = wf.run_ensemble(study(relax={"max_iterations": 1}, repeats=1), tmp_path, workers=0)
    assert done.counts["not_converged"] == 2
    assert all(reason.startswith("not converged after 1 of 1") for reason in done.columns["reason"])
    assert done.foams() == []


def test_a_machine_without_memory_is_asked_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise MemoryError("full")

    with monkeypatch.context() as patch:
        patch.setattr("warpedfoam.studies.member.relax", full)
        first = wf.run_ensemble(study(), tmp_path, workers=0)
    assert first.counts["lost"] == 4
    assert set(first.columns["reason"]) == {"MemoryError: full"}
    again = wf.run_ensemble(study(), tmp_path, workers=0)
    assert again.counts["converged"] == again.record["computed_now"] == 4


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"workers": 2, "scheduler": "tcp://127.0.0.1:1"}, "workers or a scheduler, not both"),
        ({"workers": -1}, "workers must be at least 0"),
        ({"scheduler": 8786}, "scheduler must be an address"),
    ],
)
def test_bad_calls_are_refused(change: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        wf.run_ensemble(study(), tmp_path, **change)


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpedfoam.studies.pool.NEEDED", ("distributed", "no_such_package"))
    with pytest.raises(
        ModuleNotFoundError, match=r"need no_such_package: pip install 'warpedfoam\[ensemble\]'"
    ):
        wf.run_ensemble(study(), tmp_path / "out")
    assert not (tmp_path / "out").exists()


# ------------------------------------------------------------------------------- going on, bit for bit


def backwards(tasks: Iterable[Task], **_: object) -> Generator[Outcome]:
    yield from computed(reversed(list(tasks)), workers=0, scheduler=None)


def test_the_order_of_completion_plays_no_part(
    plain: wf.Ensemble, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "computed", backwards)
    wf.run_ensemble(study(), tmp_path)
    assert files(tmp_path) == files(plain.folder)
    lines = (tmp_path / "runs.jsonl").read_text().splitlines()
    assert [json.loads(line)["key"] for line in lines[1:]] == [r.key for r in study().runs][::-1]


def stop_after(count: int) -> Callable[[str, float], None]:
    def progress(_: str, fraction: float) -> None:
        if fraction * 4 >= count:
            raise KeyboardInterrupt

    return progress


def test_an_interrupted_study_goes_on(plain: wf.Ensemble, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        wf.run_ensemble(study(), tmp_path, workers=0, progress=stop_after(3))
    assert not (tmp_path / "record.json").exists()
    journal = tmp_path / "runs.jsonl"
    # as a kill in the middle of a line leaves it
    journal.write_bytes(journal.read_bytes()[:-20])
    assert wf.run_ensemble(study(), tmp_path, workers=0).record["computed_now"] == 2
    assert files(tmp_path) == files(plain.folder)
    assert wf.run_ensemble(study(), tmp_path, workers=0).record["computed_now"] == 0
    assert files(tmp_path) == files(plain.folder)
    next(tmp_path.glob("states/*")).unlink()
    assert wf.run_ensemble(study(), tmp_path, workers=0).record["computed_now"] == 1
    assert files(tmp_path) == files(plain.folder)


def test_a_study_may_grow_in_its_folder(plain: wf.Ensemble, tmp_path: Path) -> None:
    wf.run_ensemble(study(repeats=1, grid={"foam.volumes": [0.2]}), tmp_path, workers=0)
    assert wf.run_ensemble(study(), tmp_path, workers=0).record["computed_now"] == 3
    assert files(tmp_path) == files(plain.folder)


def test_another_study_is_kept_out(tmp_path: Path) -> None:
    wf.run_ensemble(study(repeats=1, grid={}), tmp_path, workers=0)
    with pytest.raises(ValueError, match="holds another study: its seed is 2, not 3"):
        wf.run_ensemble(study(seed=3), tmp_path, workers=0)


def test_an_edited_function_is_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs of a user's function that was edited meanwhile are computed again: no table of two halves."""
    name = user_functions(tmp_path, "def answer(foam):\n    return 1\n", monkeypatch)
    made = {"observables": (f"{name}:answer",), "grid": {}, "repeats": 2}
    first = wf.run_ensemble(study(**made), tmp_path / "out", workers=0)
    assert first.columns["answer"] == [1, 1]
    (tmp_path / f"{name}.py").write_text("def answer(foam):\n    return 22\n")
    monkeypatch.delitem(sys.modules, name)
    again = wf.run_ensemble(study(**made), tmp_path / "out", workers=0)
    assert again.columns["answer"] == [22, 22]
    assert again.columns["seed"] == first.columns["seed"]
    assert wf.run_ensemble(study(**made), tmp_path / "out", workers=0).record["computed_now"] == 0


@posix
def test_a_full_disk_is_told_with_the_file_and_costs_nothing_else(
    plain: wf.Ensemble, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sync, calls = os.fsync, []

    def full(descriptor: int) -> None:
        calls.append(descriptor)
        if len(calls) > 8:
            raise OSError(28, "No space left on device")
        sync(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space left on device") as fault:
            wf.run_ensemble(study(), tmp_path / "out", workers=0)
    assert str(tmp_path / "out") in str(fault.value.filename)
    assert not list((tmp_path / "out").rglob("*.part"))
    done = wf.run_ensemble(study(), tmp_path / "out", workers=0)
    assert 0 < done.record["computed_now"] < 4
    assert files(tmp_path / "out") == files(plain.folder)


def test_a_damaged_line_is_named(tmp_path: Path) -> None:
    wf.run_ensemble(study(repeats=1, grid={}), tmp_path, workers=0)
    journal = tmp_path / "runs.jsonl"
    journal.write_text(journal.read_text().replace('"status"', '"state"'))
    with pytest.raises(FileFormatError, match="line 2 is damaged"):
        wf.run_ensemble(study(repeats=1, grid={}), tmp_path, workers=0)


@posix
def test_one_run_at_a_time_in_a_folder(tmp_path: Path) -> None:
    with (
        opened(tmp_path),
        pytest.raises(BlockingIOError, match="another run is writing"),
    ):
        wf.run_ensemble(study(), tmp_path, workers=0)


# ------------------------------------------------------------------------------------- observables


def test_observables_are_what_they_are_called(tmp_path: Path) -> None:
    edges = [0.0, 60.0, 120.0, 180.0]
    profile = {"kind": "charge_profile", "name": "bands", "coordinate": "tube_angle", "edges": edges}
    names = (
        "energy_over_honeycomb", "length", "length_over_honeycomb", "energy_start", "volume_error",
        "n_films", "sum_of_charges", "euler_characteristic", "mean_order", "mu2", "residual", "iterations",
        "statistics", "equilibrium", "sides", "charges.-7", "charges.1", "defects.clusters", profile,
    )  # fmt: skip
    made = wf.Study(
        repeats=1,
        surface={"kind": "torus", "major_radius": 6.0, "minor_radius": 2.5},
        cell={"gap": 0.4},
        foam={"n_bubbles": 60, "volumes": 0.3},
        observables=names,
    )
    done = wf.run_ensemble(made, tmp_path, workers=0)
    foam = done.foam(0)
    row = {name: values[0] for name, values in done.columns.items()}
    areas = foam.bubble_volumes / 0.4
    bound = honeycomb_bound(areas)
    assert row["energy_over_honeycomb"] == pytest.approx(foam.energy / 0.4 / bound, rel=1e-14)
    assert row["length"] == pytest.approx(foam.film_lengths.sum(), rel=1e-14)
    assert row["length_over_honeycomb"] == row["length"] / honeycomb_bound(foam.bubble_areas)
    assert row["energy_start"] > foam.energy
    assert (row["n_films"], row["sum_of_charges"], row["euler_characteristic"]) == (180, 0, 0)
    assert row["mu2"] == row["statistics.mu2"] == pytest.approx(foam.network.sides.var(), rel=1e-12)
    assert row["mean_order"] == wf.bond_order(foam).mean_magnitude
    assert row["statistics.lewis"] == wf.foam_statistics(foam).lewis
    assert row["equilibrium.angle_error"] == wf.equilibrium_report(foam).angle_error
    assert row["sides.5"] == row["charges.1"] == (foam.network.charges == 1).sum()
    assert row["charges.-7"] == 0
    found = wf.defects(foam)
    assert {k: row[f"defects.clusters.{k}"] for k in found.kinds} == found.kinds

    def angle(x: np.ndarray) -> np.ndarray:
        return np.degrees(np.abs(np.arctan2(x[:, 2], np.hypot(x[:, 0], x[:, 1]) - 6.0)))

    bands = wf.charge_profile(foam, angle, edges)
    for k in range(3):
        assert row[f"bands.charge.{k}"] == bands.charge[k]
        assert row[f"bands.bubbles.{k}"] == bands.bubbles[k]
        assert row[f"bands.curvature.{k}"] == pytest.approx(bands.curvature[k], rel=1e-12)
        assert row[f"bands.region_curvature.{k}"] == pytest.approx(bands.region_curvature[k], rel=1e-12)
