"""The main job: surface → Voronoi foam → relaxed foam → files in a folder."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from warpedfoam.cli.folders import output_folder
from warpedfoam.cli.progress import Progress, silent
from warpedfoam.foam import Foam
from warpedfoam.relax.result import Relaxation
from warpedfoam.studies.options import Options

RECORD = "record.json"


@dataclass(frozen=True, eq=False)
class Job:
    """A finished main job.

    Attributes
    ----------
    relaxation : Relaxation
    record : mapping
        What ``record.json`` holds: plain numbers, texts and lists.
    """

    relaxation: Relaxation
    record: Mapping[str, Any]

    @property
    def summary(self) -> dict[str, Any]:
        """The record without options and versions, and the T1s counted, not listed."""
        kept = {k: v for k, v in self.record.items() if k not in ("options", "versions", "command")}
        return {**kept, "t1": {k: v for k, v in self.record["t1"].items() if k != "events"}}


def run_job(options: Options, progress: Progress = silent) -> Job:
    """Build a foam, relax it and write every output.

    Each file is put in place by one rename. An earlier ``record.json`` is removed before the first and
    the new one written last, so a folder that has one holds the complete outputs of one run.

    Parameters
    ----------
    options : Options
    progress : callable, optional
        Called with a stage's name and the fraction done.

    Returns
    -------
    Job
        Also if the foam did not converge: look at ``relaxation.converged``.

    Raises
    ------
    ValueError
        Options that make no foam; the message says which.
    OSError
        If the folder cannot be written.
    """
    from warpedfoam.io import versions, write_record
    from warpedfoam.relax import relax
    from warpedfoam.tessellate import voronoi_foam

    folder = output_folder(options.output.folder)
    started = datetime.now(UTC)
    cell = options.plates
    chosen = options.foam
    clock = [time.perf_counter()]
    start = voronoi_foam(
        cell,
        options.n_bubbles,
        seeds=chosen.seeds if isinstance(chosen.seeds, str) else np.asarray(chosen.seeds),
        seed=options.seed,
        cells=chosen.cells,
        lloyd=chosen.lloyd,
        volumes=np.asarray(chosen.volumes) if isinstance(chosen.volumes, list) else chosen.volumes,
        n_nodes=chosen.n_nodes,
        order=options.relax.order,
        progress=progress,
    )
    clock.append(time.perf_counter())
    relaxed = relax(
        start,
        order=options.relax.order,
        t1=options.relax.t1,
        max_iterations=options.relax.max_iterations,
        tolerance=options.relax.tolerance,
        solver=options.relax.solver,
        progress=progress,
    )
    clock.append(time.perf_counter())
    output = options.output
    outputs = write_foam(folder, relaxed, color_by=output.color_by, picture=output.picture, progress=progress)
    clock.append(time.perf_counter())
    record = {
        **results(start, relaxed),
        "timings": {
            **dict(zip(("build", "relax", "write"), np.diff(clock).tolist(), strict=True)),
            "relax_parts": dict(relaxed.timings),
        },
        "started": started.isoformat(timespec="seconds"),
        "seed": options.seed,
        "options": options.as_mapping(),
        "versions": dict(versions()),
        "command": sys.argv,
        "outputs": {name: str(path) for name, path in outputs.items()},
    }
    record = plain(record)
    write_record(folder / RECORD, record)
    progress("write", 1.0)
    return Job(relaxed, record)


def _tidy(folder: Path) -> None:
    """Remove the temporary files of a run that was killed outright while writing, ten minutes ago or more."""
    for name in ("foam.ply", "foam_view.ply", "bubbles.csv", "films.csv", "foam.npz", "foam.png", RECORD):
        for part in folder.glob(f".{name}.*.part"):
            if time.time() - part.stat().st_mtime > 600.0:
                part.unlink(missing_ok=True)


def write_foam(
    folder: Path, relaxed: Relaxation, *, color_by: str, picture: bool, progress: Progress
) -> dict[str, Path]:
    """Write a relaxed foam in every format of the main job; an earlier record is removed first.

    Without a picture, one of an earlier run is removed.
    """
    from warpedfoam.io import save, write_bubbles_csv, write_films_csv, write_ply

    foam = relaxed.foam
    (folder / RECORD).unlink(missing_ok=True)
    _tidy(folder)
    progress("write", 0.0)
    ply, view = write_ply(folder / "foam.ply", foam, color_by=color_by)
    progress("write", 0.3)
    paths = {"ply": Path(ply), "view": Path(view)}
    for name, file, write in (
        ("bubbles", "bubbles.csv", write_bubbles_csv),
        ("films", "films.csv", write_films_csv),
        ("state", "foam.npz", save),
    ):
        write(folder / file, foam)
        paths[name] = folder / file
    progress("write", 0.5)
    drawn = folder / "foam.png"
    if picture:
        from warpedfoam.plot import save_picture

        title = None if relaxed.converged else f"NOT CONVERGED: {foam.n_bubbles} bubbles"
        save_picture(drawn, foam, color_by=color_by, title=title)
        paths["picture"] = drawn
    else:
        drawn.unlink(missing_ok=True)
    return {**paths, "record": folder / RECORD}


def results(start: Foam, relaxed: Relaxation) -> dict[str, Any]:
    """Numbers of a relaxation and its foam, for a record."""
    from warpedfoam.analysis import equilibrium_report, honeycomb_bound, side_distribution

    foam = relaxed.foam
    network = foam.network
    found, report = side_distribution(foam), equilibrium_report(foam)
    length = float(foam.film_lengths.sum())
    return {
        "converged": relaxed.converged,
        "is_minimum": relaxed.is_minimum,
        "message": relaxed.message,
        "iterations": relaxed.iterations,
        "residual": relaxed.residual,
        "volume_error": relaxed.volume_error,
        "energy": relaxed.energy,
        "energy_start": start.energy,
        "length": length,
        "length_over_honeycomb": length / honeycomb_bound(foam.bubble_areas),
        "n_bubbles": network.n_bubbles,
        "n_films": network.n_films,
        "n_vertices": network.n_vertices,
        "sides": dict(zip(map(str, found.sides.tolist()), found.counts.tolist(), strict=True)),
        "mu2": found.mu2,
        "sum_of_charges": found.total_charge,
        "euler_characteristic": network.euler_characteristic,
        "equilibrium": {
            "angle_error": report.angle_error,
            "curvature_spread": float(report.curvature_spread.max()),
            "laplace_error": report.laplace_error,
            "identity_error": report.identity_error,
        },
        "pressure_range": [float(relaxed.pressures.min()), float(relaxed.pressures.max())],
        "n_t1": relaxed.n_t1,
        "t1": {
            "count": relaxed.n_t1,
            "local_energy_change": float(sum(e.energy_after - e.energy_before for e in relaxed.events)),
            "events": [asdict(event) for event in relaxed.events],
        },
    }


def plain(value: Any) -> Any:
    """Turn numpy numbers into Python's, NaN and infinities into None, so that any reader takes the JSON."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
