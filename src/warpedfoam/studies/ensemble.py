"""`run_ensemble`: every run of a study, on as many workers as there are, into one tidy table."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpedfoam.arrays import as_instance, as_integer, frozen
from warpedfoam.foam import Foam
from warpedfoam.io import load, versions, write_columns_parquet, write_record
from warpedfoam.io.atomic import PathLike, as_path
from warpedfoam.studies.ensemble_table import Columns, table_columns, write_csv
from warpedfoam.studies.journal import Journal, opened
from warpedfoam.studies.member import STATES, Task
from warpedfoam.studies.pool import computed, require_packages
from warpedfoam.studies.study import Run, Study

TABLE_CSV, TABLE_PARQUET, STUDY, RECORD = "ensemble.csv", "ensemble.parquet", "study.json", "record.json"


@dataclass(frozen=True, eq=False)
class Ensemble:
    """The table of a study, and where its foams are.

    Attributes
    ----------
    study : Study
    folder : Path
    columns : mapping of str to list
        One entry a run, in the order of the runs; None where there is none. ``run``, ``repeat``, ``seed``,
        what varies, ``status`` (converged, not_converged, failed, lost), ``reason``, ``state`` (the foam's
        file), and the observables.
    record : mapping
        What ``record.json`` holds.
    """

    study: Study
    folder: Path
    columns: Mapping[str, list[Any]]
    record: Mapping[str, Any]

    @property
    def n_runs(self) -> int:
        """Number of rows."""
        return len(self.columns["run"])

    @property
    def counts(self) -> dict[str, int]:
        """Number of runs by status."""
        return {state: self.columns["status"].count(state) for state in STATES}

    def column(self, name: str, where: Mapping[str, Any] | None = None) -> NDArray[Any]:
        """A column as an array: integers, floats (NaN where blank), or objects.

        Parameters
        ----------
        name : str
        where : mapping, optional
            Only rows in which these columns have these values, such as ``{"status": "converged"}``.

        Raises
        ------
        ValueError
            If there is no such column.
        """
        rows = self.rows(where)
        values = [self._column(name)[k] for k in rows]
        kinds = {type(value) for value in values}
        if kinds and kinds <= {float, int, type(None)} and kinds != {int}:
            return frozen(np.array([np.nan if v is None else v for v in values], dtype=np.float64))
        return frozen(np.array(values, dtype=None if len(kinds) == 1 else object))

    def rows(self, where: Mapping[str, Any] | None = None) -> list[int]:
        """Numbers of the runs in which these columns have these values."""
        wanted = [(self._column(name), value) for name, value in (where or {}).items()]
        return [k for k in range(self.n_runs) if all(column[k] == value for column, value in wanted)]

    def foam(self, run: int) -> Foam:
        """Load the foam of a run.

        Raises
        ------
        ValueError
            If it failed before there was one, or foams were not kept.
        """
        number = as_integer(run, "run", minimum=0, maximum=self.n_runs - 1)
        state = self.columns["state"][number]
        if not state:
            raise ValueError(
                f"run {number} has no foam: {self.columns['reason'][number] or 'states = false'}"
            )
        return load(self.folder / state)

    def foams(self, where: Mapping[str, Any] | None = None) -> list[Foam]:
        """Load the converged foams in which these columns have these values."""
        return [self.foam(k) for k in self.rows({"status": "converged", **(where or {})})]

    def _column(self, name: str) -> list[Any]:
        if name not in self.columns:
            raise ValueError(f"there is no column {name!r}; columns are {', '.join(self.columns)}")
        return self.columns[name]


def run_ensemble(
    study: Study,
    folder: PathLike,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Ensemble:
    """Compute what a study asks for and write it as one table, or go on where an earlier call ended.

    The folder keeps a journal: a run that is finished is never computed again, whatever ended the
    process. The table is the same, bit for bit, whatever the number of workers and the order in which
    they finish: every run has a seed of its own, one BLAS thread and a given sparse solver. (Other versions
    of numpy, scipy or libigl, or another kind of processor, may change last digits, and by way of a T1
    more or less whole foams; ``record.json`` lists the environments that took part.)

    Parameters
    ----------
    study : Study
        Its grid, cases and repeats may have grown since the folder was begun; nothing else may differ.
    folder : str or path
        Made if need be. Gets ``ensemble.csv``, ``ensemble.parquet``, ``states/``, ``study.json``,
        ``runs.jsonl`` (the journal) and, last, ``record.json``.
    workers : int, optional
        Processes on this machine; one per available processor by default, 0 for none: in this process.
        Scripts that use workers need ``if __name__ == "__main__":`` round the call.
    scheduler : str, optional
        Address of a dask scheduler (``"tcp://host:8786"``) whose workers compute instead.
    progress : callable, optional
        Called as ``progress("ensemble", fraction)``.

    Returns
    -------
    Ensemble
        Look at ``.counts``: runs that failed or did not converge are rows with a reason.

    Raises
    ------
    ValueError
        If the folder belongs to another study.
    OSError
        If the folder cannot be written, another process writes there, or the scheduler cannot be reached.
    ModuleNotFoundError
        If the extra ``ensemble`` is not installed.

    Examples
    --------
    >>> import tempfile
    >>> study = Study(
    ...     repeats=2,
    ...     surface={"kind": "sphere", "radius": 1.0},
    ...     cell={"gap": 0.01},
    ...     grid={"foam.n_bubbles": [12, 20]},
    ...     observables=("mu2", "sum_of_charges"),
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     ensemble = run_ensemble(study, folder, workers=0)
    >>> ensemble.columns["sum_of_charges"], ensemble.counts["converged"]
    ([12, 12, 12, 12], 4)
    """
    as_instance(study, "study", Study)
    if scheduler is not None and workers is not None:
        raise ValueError("give workers or a scheduler, not both: a scheduler has its own workers")
    if scheduler is not None and not isinstance(scheduler, str):
        raise TypeError(f"scheduler must be an address such as tcp://host:8786, got {scheduler!r}")
    if workers is not None:
        as_integer(workers, "workers", minimum=0, maximum=10_000)
    require_packages()
    place = _folder(folder)
    report = progress or (lambda _stage, _fraction: None)
    started, clock = datetime.now(UTC), time.perf_counter()
    with opened(place) as journal:
        _keep_study(place, study)
        waiting = [run for run in study.runs if not _finished(journal, run, study.states)]
        n_old = len(study.runs) - len(waiting)
        report("ensemble", n_old / len(study.runs))
        lost: dict[str, str] = {}
        if waiting:
            tasks = (_task(run, study) for run in waiting)
            outcomes = computed(tasks, workers=workers, scheduler=scheduler)
            try:
                for n_done, outcome in enumerate(outcomes, start=n_old + 1):
                    if outcome.status == "lost":
                        lost[outcome.key] = outcome.reason
                    else:
                        journal.add(outcome)
                    report("ensemble", n_done / len(study.runs))
            finally:
                outcomes.close()  # the workers too, whatever ended the loop
        columns = _columns(study, journal, lost)
        write_csv(place / TABLE_CSV, columns)
        write_columns_parquet(place / TABLE_PARQUET, columns)
        used = [journal.rows[run.key] for run in study.runs if run.key in journal.rows]
        names = sorted({row["environment"] for row in used})
        record = {
            "study": study.as_mapping(),
            "runs": len(study.runs),
            "computed_now": len(waiting) - len(lost),
            "counts": {state: columns["status"].count(state) for state in STATES},
            "processor_seconds": float(sum(row["seconds"] for row in used)),
            "clock_seconds": time.perf_counter() - clock,
            "started": started.isoformat(timespec="seconds"),
            "environments": {name: journal.environments.get(name, {}) for name in names},
            "versions": versions(),
            "outputs": [str(place / name) for name in (TABLE_CSV, TABLE_PARQUET, RECORD)],
        }
        write_record(place / RECORD, record)
    return Ensemble(study, place, columns, record)


def _folder(folder: PathLike) -> Path:
    place = as_path(folder, "folder")
    try:
        place.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise NotADirectoryError(f"the output folder {place} is a file; choose another") from None
    return place


def _keep_study(folder: Path, study: Study) -> None:
    """Write the study beside its results; refuse a folder that holds another one's."""
    path = folder / STUDY
    wanted = json.loads(json.dumps(study.as_mapping()))
    if path.exists():
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            differing = [name for name in study.fixed if found[name] != wanted[name]]
        except (ValueError, KeyError, TypeError):
            raise ValueError(f"{path} is not what a study writes; choose another folder") from None
        if differing:
            name = differing[0]
            raise ValueError(
                f"{folder} holds another study: its {name} is {found[name]}, not {wanted[name]}; choose "
                "another folder (only grid, cases, repeats and states may change)"
            )
    # a record marks a complete run
    (folder / RECORD).unlink(missing_ok=True)
    write_record(path, wanted)


def _finished(journal: Journal, run: Run, states: bool) -> bool:
    row = journal.rows.get(run.key)
    if row is None:
        return False
    # a foam that failed before it was relaxed has no state
    return not states or not row["values"] or journal.state_path(run.key).exists()


def _task(run: Run, study: Study) -> Task:
    return Task(run.key, run.seed, run.values, study.measures, study.states, study.folder)


def _columns(study: Study, journal: Journal, lost: Mapping[str, str]) -> Columns:
    rows, measured = [], []
    for run in study.runs:
        found = journal.rows.get(run.key)
        path = journal.state_path(run.key)
        kept = study.states and found is not None and path.exists()
        rows.append(
            {
                "run": run.number,
                "repeat": run.repeat,
                "seed": run.seed,
                **run.parameters,
                "status": "lost" if found is None else found["status"],
                "reason": lost.get(run.key, "") if found is None else found["reason"],
                "state": f"{path.parent.name}/{path.name}" if kept else None,
            }
        )
        measured.append({} if found is None else found["values"])
    return table_columns(rows, measured)
